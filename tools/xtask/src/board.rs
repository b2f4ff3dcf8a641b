//! The boards, and the option that chooses them.

/// A board with its own image.
pub struct Board {
    /// Name and cargo feature.
    pub name: &'static str,
    /// What it may use; none where only the memory itself is the limit.
    pub budget: Option<Budget>,
}

/// Most bytes that an image may use.
pub struct Budget {
    pub flash: u64,
    /// Statics and stack.
    pub ram: u64,
}

pub const BOARDS: &[Board] = &[
    Board { name: "nucleo-h753zi", budget: Some(Budget { flash: 256 * 1024, ram: 160 * 1024 }) },
    Board { name: "nucleo-f767zi", budget: None },
    // Flash without the sectors of the settings; main RAM, which the stack does not even need there.
    Board { name: "nucleo-f429zi", budget: Some(Budget { flash: (2048 - 256) * 1024, ram: 192 * 1024 }) },
];

/// QEMU's, which nobody flashes.
pub const EMULATED: Board = Board { name: "mps2-an500", budget: None };

/// The boards that `name` means: one, or `all`.
pub fn named(name: &str) -> Result<&'static [Board], String> {
    if name == "all" {
        return Ok(BOARDS);
    }
    let known = || BOARDS.iter().map(|board| board.name).collect::<Vec<_>>().join(", ");
    let at = BOARDS.iter().position(|board| board.name == name);
    at.and_then(|at| BOARDS.get(at..=at))
        .ok_or_else(|| format!("no board `{name}`; there are {} and all", known()))
}

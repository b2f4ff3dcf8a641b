//! The boards, and the option that chooses them.

/// A board with its own image.
pub struct Board {
    /// Name and cargo feature.
    pub name: &'static str,
    /// What it runs.
    pub program: Program,
    /// What it may use; none where only the memory itself is the limit.
    pub budget: Option<Budget>,
}

/// The programs that boards run, each with an entry of its own.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Program {
    Gateway,
    AxisModule,
    /// No program to use: it takes the loop of a module through all its states, for `cargo xtask cost`.
    LoopCost,
}

impl Program {
    /// The name of its entry.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gateway => "gateway",
            Self::AxisModule => "axis_module",
            Self::LoopCost => "loop_cost",
        }
    }

    /// The cargo feature that it takes beside that of its board.
    pub const fn feature(self) -> Option<&'static str> {
        match self {
            Self::Gateway => None,
            Self::AxisModule | Self::LoopCost => Some("axis-module"),
        }
    }
}

/// Most bytes that an image may use.
pub struct Budget {
    pub flash: u64,
    /// Statics and stack.
    pub ram: u64,
}

pub const BOARDS: &[Board] = &[
    Board {
        name: "nucleo-h753zi",
        program: Program::Gateway,
        budget: Some(Budget { flash: 768 * 1024, ram: 216 * 1024 }),
    },
    Board { name: "nucleo-f767zi", program: Program::Gateway, budget: None },
    Board {
        name: "nucleo-f429zi",
        program: Program::Gateway,
        // Flash without the sectors of the settings; main RAM and CCM.
        budget: Some(Budget { flash: (2048 - 256) * 1024, ram: 256 * 1024 }),
    },
    Board {
        name: "nucleo-g474re",
        program: Program::AxisModule,
        // A quarter of the flash, and half of the RAM.
        budget: Some(Budget { flash: 128 * 1024, ram: 64 * 1024 }),
    },
];

/// QEMU's, which nobody flashes.
pub const EMULATED: Board = emulated(Program::Gateway);

/// QEMU's board with a program.
pub const fn emulated(program: Program) -> Board {
    Board { name: "mps2-an500", program, budget: None }
}

impl Board {
    /// The cargo features of its image.
    pub fn features(&self) -> String {
        [Some(self.name), self.program.feature()].into_iter().flatten().collect::<Vec<_>>().join(",")
    }
}

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

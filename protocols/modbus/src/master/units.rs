//! From when on each slave may be addressed again.

use puente_line::Instant;

/// A moment a unit, for all 256 in 1280 bytes: milliseconds since start-up, rounded up, in 39 bits (17 years); the topmost bit
/// says that the unit still owes a reply.
#[derive(Clone, Debug)]
pub(super) struct Units([[u8; 5]; 256]);

const OWING: u64 = 1 << 39;

impl Units {
    pub const fn new() -> Self {
        Self([[0; 5]; 256])
    }

    /// From when on `unit` may be addressed.
    pub fn ready_at(&self, unit: u8) -> Instant {
        Instant::from_millis(self.get(unit) & !OWING)
    }

    /// `unit` has answered and may be addressed again at `ready`; `None` for at once.
    pub fn rest(&mut self, unit: u8, ready: Option<Instant>) {
        self.set(unit, ready, 0);
    }

    /// `unit` has not answered. It is left alone until `ready`, or until its late reply is seen.
    pub fn quarantine(&mut self, unit: u8, ready: Instant) {
        self.set(unit, Some(ready), OWING);
    }

    /// Whether `unit` has not answered its last request.
    pub fn owes(&self, unit: u8) -> bool {
        self.get(unit) & OWING != 0
    }

    fn get(&self, unit: u8) -> u64 {
        let [a, b, c, d, e] = self.0[usize::from(unit)];
        u64::from_be_bytes([0, 0, 0, a, b, c, d, e])
    }

    fn set(&mut self, unit: u8, ready: Option<Instant>, flag: u64) {
        let millis = ready.map_or(0, |at| at.as_micros().div_ceil(1000)).min(OWING - 1);
        let [_, _, _, bytes @ ..] = (millis | flag).to_be_bytes();
        self.0[usize::from(unit)] = bytes;
    }
}

//! The status word.

use core::fmt;

/// Status word, read at [`STATUS`](super::register::STATUS) (thesis, text above table 4.5).
///
/// Bits 9 to 14 are unused. [`Display`](fmt::Display) lists the bits that are set by the drive's own names, from the
/// highest down, as in `S-RDY,COIN,AC-IN`; a word without any of them is shown as `-`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status(pub u16);

impl Status {
    /// ALM: an alarm is present.
    pub const ALM: u16 = 1 << 15;
    /// S-RDY: the drive is ready.
    pub const S_RDY: u16 = 1 << 8;
    /// WAIT: the drive waits.
    pub const WAIT: u16 = 1 << 7;
    /// COIN: position control: position complete; speed control: the set speed is reached.
    pub const COIN: u16 = 1 << 6;
    /// AC-IN: mains present.
    pub const AC_IN: u16 = 1 << 5;
    /// PS-IN: position control: reference pulses arrive; speed control: the set speed is beyond the limits.
    pub const PS_IN: u16 = 1 << 4;
    /// PA-ST: position control: alarm state; speed control: torque excess.
    pub const PA_ST: u16 = 1 << 3;
    /// TGON: the motor has stopped, in the words of the thesis; the usual meaning of the name is the opposite.
    pub const TGON: u16 = 1 << 2;
    /// N-OT: reverse rotation is prohibited.
    pub const N_OT: u16 = 1 << 1;
    /// P-OT: forward rotation is prohibited.
    pub const P_OT: u16 = 1 << 0;

    const NAMES: [(u16, &'static str); 10] = [
        (Self::ALM, "ALM"),
        (Self::S_RDY, "S-RDY"),
        (Self::WAIT, "WAIT"),
        (Self::COIN, "COIN"),
        (Self::AC_IN, "AC-IN"),
        (Self::PS_IN, "PS-IN"),
        (Self::PA_ST, "PA-ST"),
        (Self::TGON, "TGON"),
        (Self::N_OT, "N-OT"),
        (Self::P_OT, "P-OT"),
    ];

    /// The names of the bits that are set, from the highest down.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.into_iter().filter(move |(bit, _)| self.has(*bit)).map(|(_, name)| name)
    }

    const fn has(self, bit: u16) -> bool {
        self.0 & bit != 0
    }

    /// [`Status::ALM`].
    pub const fn alarm(self) -> bool {
        self.has(Self::ALM)
    }

    /// [`Status::S_RDY`].
    pub const fn ready(self) -> bool {
        self.has(Self::S_RDY)
    }

    /// [`Status::WAIT`].
    pub const fn waiting(self) -> bool {
        self.has(Self::WAIT)
    }

    /// [`Status::COIN`].
    pub const fn coin(self) -> bool {
        self.has(Self::COIN)
    }

    /// [`Status::AC_IN`].
    pub const fn mains(self) -> bool {
        self.has(Self::AC_IN)
    }

    /// [`Status::PS_IN`].
    pub const fn reference_input(self) -> bool {
        self.has(Self::PS_IN)
    }

    /// [`Status::PA_ST`].
    pub const fn pa_st(self) -> bool {
        self.has(Self::PA_ST)
    }

    /// [`Status::TGON`].
    pub const fn stopped(self) -> bool {
        self.has(Self::TGON)
    }

    /// [`Status::N_OT`].
    pub const fn reverse_prohibited(self) -> bool {
        self.has(Self::N_OT)
    }

    /// [`Status::P_OT`].
    pub const fn forward_prohibited(self) -> bool {
        self.has(Self::P_OT)
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut set = self.names();
        f.write_str(set.next().unwrap_or("-"))?;
        set.try_for_each(|name| write!(f, ",{name}"))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::Status;
    use std::string::ToString;

    #[test]
    fn words_of_the_thesis() {
        // Tables 4.6 and 4.5.
        assert_eq!(Status(0x0163).to_string(), "S-RDY,COIN,AC-IN,N-OT,P-OT");
        assert_eq!(Status(0x0036).to_string(), "AC-IN,PS-IN,TGON,N-OT");
        let online = Status(0x0163);
        assert!(online.ready() && online.coin() && online.mains());
        assert!(online.reverse_prohibited() && online.forward_prohibited());
        assert!(!online.alarm() && !online.waiting() && !online.reference_input());
        assert!(!online.pa_st() && !online.stopped());
    }

    #[test]
    fn edges() {
        assert_eq!(Status(0).to_string(), "-");
        assert_eq!(Status(0x7E00).to_string(), "-", "bits 9 to 14 are unused");
        assert_eq!(Status(0xFFFF).to_string(), "ALM,S-RDY,WAIT,COIN,AC-IN,PS-IN,PA-ST,TGON,N-OT,P-OT");
        assert!(Status(0x8000).alarm() && Status(0x0080).waiting() && Status(0x0010).reference_input());
        assert!(Status(0x0008).pa_st() && Status(0x0004).stopped());
    }
}

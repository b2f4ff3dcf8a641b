//! What is particular to a drive.

use puente_canopen::Address;
use puente_canopen::pdo::Mapped;

use super::Mode;
use super::object::{
    CONTROLWORD, INTERPOLATION_SET_POINT, MODE, MODE_DISPLAY, POSITION, STATUSWORD, TARGET_POSITION,
    TARGET_VELOCITY, VELOCITY,
};

/// What is in PDO 1 to 4.
pub type PdoSet = [&'static [Mapped]; 4];

/// How a drive takes interpolated positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interpolation {
    /// 60C0h.
    pub submode: i16,
    /// It has 60C1h:2, absolute or relative, which is written before 60C1h:1: that one makes the drive take both.
    pub says_relative: bool,
    /// A new period (60C2h) counts only after parameters have been stored and the drive has been reset.
    pub period_needs_reset: bool,
}

/// A kind of drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Profile {
    /// Its name in the settings.
    pub name: &'static str,
    /// The modes that it has.
    pub modes: &'static [Mode],
    /// Its receive PDOs as delivered.
    pub receive: PdoSet,
    /// Its transmit PDOs as delivered.
    pub transmit: PdoSet,
    /// How it takes interpolated positions.
    pub interpolation: Interpolation,
    /// Its PDOs must be switched on after each boot.
    pub pdos_off: bool,
    /// Its transmit PDOs have event timers (sub-index 5).
    pub event_timers: bool,
}

/// Thesis, table 1: the receive PDOs of CiA 402.
const RECEIVE: PdoSet = [
    &[CONTROLWORD.mapped()],
    &[CONTROLWORD.mapped(), MODE.mapped()],
    &[CONTROLWORD.mapped(), TARGET_POSITION.mapped()],
    &[CONTROLWORD.mapped(), TARGET_VELOCITY.mapped()],
];

/// Thesis, table 1: the transmit PDOs of CiA 402.
const TRANSMIT: PdoSet = [
    &[STATUSWORD.mapped()],
    &[STATUSWORD.mapped(), MODE_DISPLAY.mapped()],
    &[STATUSWORD.mapped(), POSITION.mapped()],
    &[STATUSWORD.mapped(), VELOCITY.mapped()],
];

impl Profile {
    /// Lexium 23A of Schneider Electric. Its interpolation and its event timers are *assumed* to be those of the standard.
    pub const LEXIUM_23A: Self = Self {
        name: "lexium23a",
        modes: &[
            Mode::JOG,
            Mode::ProfilePosition,
            Mode::ProfileVelocity,
            Mode::ProfileTorque,
            Mode::Homing,
            Mode::InterpolatedPosition,
        ],
        receive: RECEIVE,
        transmit: TRANSMIT,
        interpolation: Interpolation { submode: 0, says_relative: false, period_needs_reset: false },
        pdos_off: true,
        event_timers: true,
    };

    /// CMMS-AS of Festo. All of it is *assumed*: from the manuals of the CMMP-AS.
    pub const FESTO_CMMS: Self = Self {
        name: "festo-cmms",
        modes: &[
            Mode::ProfilePosition,
            Mode::ProfileVelocity,
            Mode::ProfileTorque,
            Mode::Homing,
            Mode::InterpolatedPosition,
        ],
        receive: RECEIVE,
        transmit: TRANSMIT,
        interpolation: Interpolation { submode: -2, says_relative: true, period_needs_reset: true },
        pdos_off: true,
        event_timers: false,
    };

    /// Any drive of CiA 402; 6502h says what modes it has.
    pub const GENERIC: Self = Self {
        name: "generic",
        modes: &[
            Mode::ProfilePosition,
            Mode::Velocity,
            Mode::ProfileVelocity,
            Mode::ProfileTorque,
            Mode::Homing,
            Mode::InterpolatedPosition,
            Mode::CyclicPosition,
            Mode::CyclicVelocity,
            Mode::CyclicTorque,
        ],
        receive: RECEIVE,
        transmit: TRANSMIT,
        interpolation: Interpolation { submode: 0, says_relative: false, period_needs_reset: false },
        pdos_off: false,
        event_timers: true,
    };

    /// All of them.
    pub const ALL: [&'static Self; 3] = [&Self::LEXIUM_23A, &Self::FESTO_CMMS, &Self::GENERIC];

    /// The profile of a name.
    pub fn named(name: &str) -> Option<&'static Self> {
        Self::ALL.into_iter().find(|profile| profile.name == name)
    }

    /// Whether it has a mode.
    pub fn has(&self, mode: Mode) -> bool {
        self.modes.contains(&mode)
    }

    /// What receive PDO 4 has for interpolated position (thesis, 6.4.4).
    pub const INTERPOLATED: &'static [Mapped] = &[INTERPOLATION_SET_POINT.mapped()];
}

/// Where parameter `Pgroup-number` of a Delta ASDA drive is, P1-44 at 212Ch. Of the Lexium 23A, which is one by another name,
/// it is *assumed*. Its length has to be read from the drive. `None` for groups above 15.
pub fn parameter_of_delta(group: u8, number: u8) -> Option<Address> {
    (group < 16).then(|| Address::new(0x2000 | u16::from(group) << 8 | u16::from(number), 0))
}

//! What a drive falls with.

use crate::can::fault::DriveFault;
use crate::can::node::Model;
use crate::can::node::emcy::register;

/// What is wrong: the codes of CiA 402 and Festo; those of a Lexium are *assumed* to be the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Alarm {
    /// Emergency error code.
    pub code: u16,
    /// Bit of the error register.
    pub register: u8,
    /// The manufacturer's bytes: of a Festo drive the main number of its error, of a Lexium the number of its alarm, as its
    /// display shows it (*assumed*: as of the Delta ASDA, and that they come so).
    festo: u8,
    lexium: u16,
    /// The motor stops with its ramp; otherwise it loses its current at once.
    pub ramps: bool,
    /// It is told, but the drive does not fall.
    pub warns: bool,
}

const fn alarm(code: u16, register: u8, festo: u8, lexium: u16, ramps: bool) -> Alarm {
    Alarm { code, register, festo, lexium, ramps, warns: false }
}

/// The motor is further from its demand than 6065h for longer than 6066h.
pub const FOLLOWING_ERROR: Alarm = alarm(0x8611, register::PROFILE, 17, 0x009, true);
/// Too hot.
pub const HOT: Alarm = alarm(0x4310, register::TEMPERATURE, 3, 0x016, true);
/// The master is lost.
pub const CONNECTION: Alarm = alarm(super::super::node::GUARDING, register::COMMUNICATION, 12, 0x301, true);
/// AL401 of the Lexium (thesis, 6.4): NMT reset while it was under current. Its emergency error code is *assumed*.
pub const RESET: Alarm = alarm(0xFF01, register::GENERIC, 0, 0x401, false);
/// A limit switch stops it.
pub const NEGATIVE_LIMIT: Alarm = Alarm { warns: true, ..alarm(0x8612, register::PROFILE, 43, 0x014, true) };
/// A limit switch stops it.
pub const POSITIVE_LIMIT: Alarm = Alarm { warns: true, ..alarm(0x8612, register::PROFILE, 43, 0x015, true) };

impl Alarm {
    /// What a fault leads to, on a model; `None` where it is none by itself.
    pub fn of(fault: DriveFault, model: Model) -> Option<Self> {
        let festo = model == Model::FestoCmms;
        Some(match fault {
            // E06 of Festo is a short circuit at the output.
            DriveFault::OverCurrent if festo => alarm(0x2320, register::CURRENT, 6, 0, false),
            DriveFault::OverCurrent => alarm(0x2310, register::CURRENT, 0, 0x001, false),
            DriveFault::OverVoltage => alarm(0x3210, register::VOLTAGE, 7, 0x002, false),
            DriveFault::UnderVoltage => alarm(0x3220, register::VOLTAGE, 2, 0x003, true),
            DriveFault::Hot(true) => HOT,
            DriveFault::Encoder if festo => alarm(0x7382, register::PROFILE, 8, 0, false),
            DriveFault::Encoder => alarm(0x7305, register::PROFILE, 0, 0x011, false),
            DriveFault::Hot(false) | DriveFault::Blocked(_) => return None,
        })
    }

    /// The manufacturer's bytes.
    pub fn vendor(self, model: Model) -> [u8; 5] {
        match model {
            Model::FestoCmms => [self.festo, 0, 0, 0, 0],
            Model::Lexium23a => {
                let [low, high] = self.lexium.to_le_bytes();
                [low, high, 0, 0, 0]
            }
            Model::Generic | Model::Node => [0; 5],
        }
    }
}

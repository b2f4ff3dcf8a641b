//! What keeps a drive from jumping when it goes under current, or changes its mode.

use super::object::{
    INTERPOLATION_SET_POINT, POSITION, TARGET_POSITION, TARGET_TORQUE, TARGET_VELOCITY, VL_TARGET,
};
use super::{Mode, Object};

/// A set-point that must be set before its mode counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// To where the drive stands.
    Actual {
        /// The set-point.
        target: Object,
        /// What it is set to.
        actual: Object,
    },
    /// To 0.
    Zero {
        /// The set-point.
        target: Object,
    },
}

/// What to preset before a drive goes under current in a mode, or changes to it under current. Modes that do not move by a
/// set-point have nothing.
pub const fn presets(mode: Mode) -> Option<Preset> {
    Some(match mode {
        Mode::ProfilePosition | Mode::CyclicPosition => {
            Preset::Actual { target: TARGET_POSITION, actual: POSITION }
        }
        Mode::InterpolatedPosition => Preset::Actual { target: INTERPOLATION_SET_POINT, actual: POSITION },
        Mode::ProfileVelocity | Mode::CyclicVelocity => Preset::Zero { target: TARGET_VELOCITY },
        Mode::Velocity => Preset::Zero { target: VL_TARGET },
        Mode::ProfileTorque | Mode::CyclicTorque => Preset::Zero { target: TARGET_TORQUE },
        Mode::None | Mode::Homing | Mode::Vendor(_) => return None,
    })
}

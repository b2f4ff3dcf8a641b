//! What keeps a drive from jumping when it goes under current, or changes its mode.

use super::{Mode, Object, object};

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
    let Some(target) = mode.target() else {
        return None;
    };
    Some(match mode {
        Mode::ProfilePosition | Mode::CyclicPosition | Mode::InterpolatedPosition => {
            Preset::Actual { target, actual: object::POSITION }
        }
        _ => Preset::Zero { target },
    })
}

//! What an axis of the table is like.

use std::f64::consts::PI;

/// Figures of an axis. The thesis gives the number of axes, the type of the amplifiers and their ±10 V input that sets
/// speed and sense; **every figure of the default is assumed**, except where a field names a source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisProfile {
    /// The motor with what it moves.
    pub motor: Motor,
    /// Most current in either direction, A: twice the 10 A that the amplifier's name gives as its continuous current.
    pub max_current: f64,
    /// Supply of the amplifier, V; 12 to 50 for the series (maxon, ADS 50/5 operating instructions).
    pub supply: f64,
    /// Time constant of the current loop, s.
    pub current_loop: f64,
    /// What the amplifier makes of its input.
    pub amplifier: Amplifier,
    /// Encoder counts of one turn of the motor, x4.
    pub counts_per_turn: u32,
    /// End stops, counts.
    pub travel: (i64, i64),
}

/// A DC motor; inertia and friction are those of the whole axis, at the motor's shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    /// Torque of a current, N·m/A, and voltage of a speed, V·s/rad.
    pub constant: f64,
    /// Of the winding, ohm.
    pub resistance: f64,
    /// kg·m².
    pub inertia: f64,
    /// Friction that grows with the speed, N·m·s/rad.
    pub viscous: f64,
    /// Dry friction, the same at rest and in motion, N·m.
    pub coulomb: f64,
}

/// What an amplifier makes of its input of -1 to 1 (-10 V to +10 V): two of the four modes of the ADS series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amplifier {
    /// Speed by encoder: the input sets the speed, as in the thesis. A proportional loop.
    Speed {
        /// Speed at full input, rad/s.
        full: f64,
        /// A for each rad/s that the motor is too slow.
        gain: f64,
    },
    /// Torque: the input sets the current.
    Current {
        /// Current at full input, A.
        full: f64,
    },
}

impl Default for AxisProfile {
    /// A motor of the 150 W class on a light axis. Full input is 100 000 counts a second.
    fn default() -> Self {
        Self {
            motor: Motor { constant: 0.06, resistance: 1.2, inertia: 5e-5, viscous: 2e-5, coulomb: 0.02 },
            max_current: 20.0,
            supply: 48.0,
            current_loop: 0.2e-3,
            // 3000 r/min.
            amplifier: Amplifier::Speed { full: 100.0 * PI, gain: 0.15 },
            counts_per_turn: 2_000,
            travel: (-100_000, 100_000),
        }
    }
}

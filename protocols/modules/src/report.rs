//! What a module says when it is asked.
//!
//! DAT, 13 bytes, big-endian:
//!
//! | bytes | |
//! |--:|---|
//! | 1 | bits 0 to 3: the state, and in a fault its cause; bits 4 to 6: the [`Refusal`], 0 for none; bit 7: 0 |
//! | 4 | position, counts, signed; at most ±2^31 |
//! | 2 | following error: reference less position, counts, signed; at most ±2^15 |
//! | 4 | velocity, counts a second, f32 |
//! | 2 | command, -32767 to 32767 for full scale |

use core::fmt;

use puente_drives::pid::{Cause, EncoderFault, State, Status};

/// Bytes of a report's DAT.
pub const DATA: usize = 13;

/// What a module is at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// The state.
    pub state: State,
    /// Why what was said to it last had no effect, or not all of it.
    pub refused: Option<Refusal>,
    /// Counts.
    pub position: i32,
    /// Reference less position, counts.
    pub following_error: i16,
    /// Counts a second; finite.
    pub velocity: f32,
    /// The command, -1 to 1.
    pub command: f32,
}

/// Why a section had no effect, or not all of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The gains are none that the loop can hold an axis with.
    Gains,
    /// There is no believable position.
    NoPosition,
    /// The module is in a fault, which only Off ends.
    Fault,
    /// Another is the commander.
    Commander,
    /// A Hold from one who has not said Off or Observe since his last Hold or Follow does not put it under current.
    NoEdge,
    /// A Follow without a Hold before it: the module is without current, or another has stopped it.
    HoldFirst,
    /// The data are no setting, or the set-point is out of its range.
    Meaningless,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Gains => "Kp is 0 or a gain is out of its range: the axis would not be held",
            Self::NoPosition => "the encoder gives no position",
            Self::Fault => "the module is in a fault; disable it first",
            Self::Commander => "another station commands the module",
            Self::NoEdge => "the module was without current; disable it first, then enable it",
            Self::HoldFirst => "the module was stopped; enable it first",
            Self::Meaningless => "the module does not understand the setting",
        })
    }
}

impl Report {
    /// What a module says that is at `status`.
    pub fn new(status: Status, refused: Option<Refusal>) -> Self {
        let error = status.reference.saturating_sub(status.position);
        Self {
            state: status.state,
            refused,
            position: saturated(status.position),
            following_error: error.clamp(i16::MIN.into(), i16::MAX.into()) as i16,
            velocity: status.velocity,
            command: status.command,
        }
    }

    /// Reads DAT; `None` unless it is a report.
    pub fn parse(data: &[u8]) -> Option<Self> {
        let &[code, p0, p1, p2, p3, e0, e1, v0, v1, v2, v3, c0, c1] = data else {
            return None;
        };
        let command = i16::from_be_bytes([c0, c1]);
        let velocity = f32::from_be_bytes([v0, v1, v2, v3]);
        let (state, refused) = states(code)?;
        (velocity.is_finite() && command > i16::MIN).then_some(Self {
            state,
            refused,
            position: i32::from_be_bytes([p0, p1, p2, p3]),
            following_error: i16::from_be_bytes([e0, e1]),
            velocity,
            command: f32::from(command) / FULL_SCALE,
        })
    }

    /// Writes DAT.
    pub fn emit(&self) -> [u8; DATA] {
        let [p0, p1, p2, p3] = self.position.to_be_bytes();
        let [e0, e1] = self.following_error.to_be_bytes();
        let [v0, v1, v2, v3] = finite(self.velocity).to_be_bytes();
        let [c0, c1] = scaled(self.command).to_be_bytes();
        [code(self.state, self.refused), p0, p1, p2, p3, e0, e1, v0, v1, v2, v3, c0, c1]
    }
}

const FULL_SCALE: f32 = 32_767.0;

fn saturated(position: i64) -> i32 {
    position.clamp(i32::MIN.into(), i32::MAX.into()) as i32
}

fn finite(value: f32) -> f32 {
    if value.is_finite() { value } else { 0.0 }
}

/// To the nearest step; the conversion saturates.
fn scaled(command: f32) -> i16 {
    let steps = command * FULL_SCALE;
    let half = if steps < 0.0 { -0.5 } else { 0.5 };
    ((steps + half) as i16).max(-i16::MAX)
}

const ENCODER: [EncoderFault; 6] = [
    EncoderFault::Unread,
    EncoderFault::Jump,
    EncoderFault::Width,
    EncoderFault::Edges,
    EncoderFault::Line,
    EncoderFault::Parity,
];

const REFUSALS: [Refusal; 7] = [
    Refusal::Gains,
    Refusal::NoPosition,
    Refusal::Fault,
    Refusal::Commander,
    Refusal::NoEdge,
    Refusal::HoldFirst,
    Refusal::Meaningless,
];

fn code(state: State, refused: Option<Refusal>) -> u8 {
    let refused = refused.and_then(|refused| (1..).zip(REFUSALS).find(|(_, known)| *known == refused));
    state_code(state) | refused.map_or(0, |(code, _)| code) << 4
}

fn states(code: u8) -> Option<(State, Option<Refusal>)> {
    let refused = match code >> 4 {
        0 => None,
        refused => Some(*REFUSALS.get(usize::from(refused) - 1)?),
    };
    Some((state_of(code & 0x0F)?, refused))
}

/// Four bits.
pub(crate) fn state_code(state: State) -> u8 {
    match state {
        State::Disabled => 0,
        State::Starting => 1,
        State::Enabled => 2,
        State::Held => 3,
        State::Fault(cause) => cause_code(cause),
    }
}

pub(crate) fn state_of(code: u8) -> Option<State> {
    Some(match code {
        0 => State::Disabled,
        1 => State::Starting,
        2 => State::Enabled,
        3 => State::Held,
        code => State::Fault(cause_of(code)?),
    })
}

pub(crate) fn cause_code(cause: Cause) -> u8 {
    match cause {
        Cause::Amplifier => 4,
        Cause::Communication => 5,
        Cause::FollowingError => 6,
        Cause::Encoder(fault) => {
            (8..).zip(ENCODER).find(|(_, known)| *known == fault).map_or(8, |(code, _)| code)
        }
    }
}

pub(crate) fn cause_of(code: u8) -> Option<Cause> {
    Some(match code {
        4 => Cause::Amplifier,
        5 => Cause::Communication,
        6 => Cause::FollowingError,
        8.. => Cause::Encoder(*ENCODER.get(usize::from(code - 8))?),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_is_one_state() {
        let mut known = 0;
        for byte in 0..=255 {
            if let Some((state, refused)) = states(byte) {
                assert_eq!(code(state, refused), byte);
                known += 1;
            }
        }
        assert_eq!(known, (4 + 3 + 6) * 8);
    }

    #[test]
    fn a_report_by_hand() {
        let report = Report {
            state: State::Enabled,
            refused: Some(Refusal::Commander),
            position: -2,
            following_error: 300,
            velocity: 1.0,
            command: -0.5,
        };
        let data = [0x42, 0xFF, 0xFF, 0xFF, 0xFE, 0x01, 0x2C, 0x3F, 0x80, 0, 0, 0xC0, 0x00];
        assert_eq!(report.emit(), data);
        let read = Report::parse(&data).expect("a report");
        assert_eq!(Report { command: 0.0, ..read }, Report { command: 0.0, ..report });
        assert!((read.command + 0.5).abs() < 2e-5);
        assert_eq!(Report::parse(&data[1..]), None);
        assert_eq!(Report::parse(&[0x80; 13]), None, "bit 7");
    }

    #[test]
    fn what_is_too_great_is_the_greatest() {
        let status = Status {
            state: State::Held,
            position: i64::MIN,
            velocity: f32::NAN,
            set_point: 0,
            reference: i64::MAX,
            command: 2.0,
        };
        let read = Report::parse(&Report::new(status, None).emit()).expect("a report");
        assert_eq!((read.position, read.following_error), (i32::MIN, i16::MAX));
        assert_eq!((read.velocity, read.command), (0.0, 1.0));
    }
}

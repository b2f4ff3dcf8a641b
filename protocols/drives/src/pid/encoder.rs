//! What a sample of an encoder means, and whether to believe it.

use core::fmt;

use super::{Wide, Width, gray};

/// What the samples of an encoder are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoder {
    /// A number: a timer that counts the edges of an incremental encoder, or an absolute encoder with a binary code.
    Binary(Width),
    /// The Gray code of an absolute encoder.
    Gray(Width),
}

impl Encoder {
    /// Bits of a sample.
    pub const fn width(self) -> Width {
        match self {
            Self::Binary(width) | Self::Gray(width) => width,
        }
    }
}

/// Why there is no position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderFault {
    /// No sample has been taken yet.
    Unread,
    /// The position changed faster than the axis can.
    Jump,
    /// A sample has more bits than the encoder.
    Width,
    /// Edges of an incremental encoder were missed, as [`Quadrature::missed`](super::Quadrature::missed) or a timer tells.
    /// Its position is no longer the axis's.
    Edges,
    /// The line of an SSI encoder is torn or shorted.
    Line,
    /// An answer of an SSI encoder has the wrong parity.
    Parity,
}

impl fmt::Display for EncoderFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Unread => "encoder not read yet",
            Self::Jump => "encoder jumped",
            Self::Width => "encoder sample too wide",
            Self::Edges => "encoder edges missed",
            Self::Line => "encoder line dead",
            Self::Parity => "encoder parity wrong",
        })
    }
}

/// The position and the velocity of an axis, from samples of its encoder.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tracker {
    encoder: Encoder,
    /// Most counts between two samples.
    most: u32,
    /// Samples a second.
    rate: f32,
    /// What a sample weighs in the velocity.
    weight: f32,
    /// From the first sample on.
    wide: Option<Wide>,
    velocity: f32,
    health: Result<(), EncoderFault>,
}

impl Tracker {
    pub fn new(encoder: Encoder, most: u32, rate: f32, weight: f32) -> Self {
        Self { encoder, most, rate, weight, wide: None, velocity: 0.0, health: Err(EncoderFault::Unread) }
    }

    /// Takes a sample. The first good one is where the position begins.
    ///
    /// After a jump the position is where the encoder says: with an absolute one it stays right within its range.
    #[inline]
    pub fn sample(&mut self, sample: Result<u32, EncoderFault>) {
        let change = sample.and_then(|raw| self.change(raw));
        let counts = change.unwrap_or(0);
        self.velocity += (counts as f32 * self.rate - self.velocity) * self.weight;
        self.health = change.map(|_| ());
    }

    #[inline]
    fn change(&mut self, raw: u32) -> Result<i32, EncoderFault> {
        let width = self.encoder.width();
        if raw > width.max() {
            return Err(EncoderFault::Width);
        }
        let number = match self.encoder {
            Encoder::Binary(_) => raw,
            Encoder::Gray(_) => gray::to_binary(raw),
        };
        let Some(wide) = &mut self.wide else {
            self.wide = Some(Wide::new(width, number));
            return Ok(0);
        };
        let change = wide.sample(number);
        if change.unsigned_abs() > self.most { Err(EncoderFault::Jump) } else { Ok(change) }
    }

    /// Counts; 0 before the first sample.
    pub const fn position(&self) -> i64 {
        match &self.wide {
            Some(wide) => wide.position(),
            None => 0,
        }
    }

    /// Counts a second.
    pub const fn velocity(&self) -> f32 {
        self.velocity
    }

    /// Of the last sample.
    pub const fn health(&self) -> Result<(), EncoderFault> {
        self.health
    }
}

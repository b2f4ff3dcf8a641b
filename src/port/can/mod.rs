//! The contract of a CAN port.

// What a CAN controller needs, and a host has not.
#[cfg(any(test, all(target_os = "none", feature = "nucleo", network)))]
pub(super) mod mailboxes;
#[cfg(any(test, all(target_os = "none", feature = "nucleo", network)))]
pub(super) mod timing;

use puente_canopen::Frame;

/// Bit rates of CiA 301, and 100 kbit/s, which many nodes know; in bit/s. Which of them, and which others, a port can do,
/// [`super::check_can`] says.
pub const BIT_RATES: [u32; 9] =
    [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

/// One CAN bus.
///
/// The port is an active node: it acknowledges what it hears, and retransmits what nobody acknowledged. It comes back by
/// itself after [`CanState::Off`] and [`CanState::Down`].
pub trait CanPort {
    /// The receiving half.
    type Reader<'a>: CanReader
    where
        Self: 'a;
    /// The sending half.
    type Writer<'a>: CanWriter
    where
        Self: 'a;

    /// Both halves, usable at once.
    fn split(&mut self) -> (Self::Reader<'_>, Self::Writer<'_>);
}

/// The receiving half of a CAN port.
///
/// A port that has to be opened is opened by its reader: so there must always be one that reads.
pub trait CanReader {
    /// Waits for what happens on the bus. Loses nothing when it is dropped.
    ///
    /// The port's own frames are not heard. A change of state comes once; before the first, the state is
    /// [`CanState::Down`].
    async fn read(&mut self) -> CanEvent;

    /// What the port has counted, as far as it can tell.
    fn counters(&self) -> CanCounters;
}

/// The sending half of a CAN port.
pub trait CanWriter {
    /// Takes a frame as soon as there is room for it, and resolves when it is taken. Dropped before, it is not taken.
    ///
    /// Frames of the same identifier go out in the order in which they are taken. There is room for few, so that a frame
    /// that is taken waits for few others.
    async fn write(&mut self, frame: &Frame) -> Result<(), NotTaken>;

    /// Drops what is taken and not on the bus yet, as far as the port can.
    fn discard(&mut self);
}

/// What happens on a CAN bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanEvent {
    /// A frame of another node.
    Frame(Frame),
    /// The state of the port is another one now.
    State(CanState),
    /// So many frames, at least, were on the bus and could not be kept.
    Lost(u32),
}

/// Fault confinement (ISO 11898-1), and whether there is a port at all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CanState {
    /// Error-active: all is well.
    Active,
    /// An error counter has reached 96.
    Warning,
    /// Error-passive: an error counter is above 127.
    Passive,
    /// Bus-off: too many errors while sending. It ends after 128 times 11 recessive bits, or as the adapter has it.
    Off,
    /// There is no port: a device that is not there, or a connection that was cut.
    #[default]
    Down,
}

impl CanState {
    /// The state of a controller that says these things of itself; the worst counts.
    #[cfg(all(target_os = "none", feature = "nucleo", network))]
    pub(super) const fn flagged(off: bool, passive: bool, warning: bool) -> Self {
        match (off, passive, warning) {
            (true, ..) => Self::Off,
            (_, true, _) => Self::Passive,
            (.., true) => Self::Warning,
            _ => Self::Active,
        }
    }

    /// The state that follows from both error counters.
    pub const fn of(tx_errors: u8, rx_errors: u8) -> Self {
        match if tx_errors > rx_errors { tx_errors } else { rx_errors } {
            0..96 => Self::Active,
            96..128 => Self::Warning,
            _ => Self::Passive,
        }
    }

    /// In a word.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Active => "active",
            Self::Warning => "warning",
            Self::Passive => "passive",
            Self::Off => "off",
            Self::Down => "down",
        }
    }

    /// Whether frames can be sent.
    pub const fn sends(self) -> bool {
        !matches!(self, Self::Off | Self::Down)
    }
}

/// What a CAN port has counted since the start, 0 where it cannot tell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CanCounters {
    /// Transmit error counter.
    pub tx_errors: u8,
    /// Receive error counter.
    pub rx_errors: u8,
    /// How often the port went bus-off.
    pub bus_offs: u32,
    /// Frames that were received and could not be kept.
    pub lost: u32,
}

/// A frame that was not taken: the port is [`CanState::Off`] or [`CanState::Down`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotTaken(pub CanState);

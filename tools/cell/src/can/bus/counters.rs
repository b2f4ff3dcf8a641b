//! The error counters of a node, and what follows from them (ISO 11898-1, fault confinement).

/// How a node takes part in the traffic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Error active.
    Active,
    /// Error active, with a counter of 96 or more.
    Warning,
    /// Error passive: a counter is above 127.
    Passive,
    /// Bus off: the transmit counter was above 255.
    Off,
}

/// Sequences of 11 recessive bits after which a node that was off is on again.
const RECOVERY: u64 = 128;
/// Such a sequence.
pub(super) const RECESSIVE: u64 = 11;

/// The error counters of a seat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    transmit: u16,
    receive: u16,
    /// Sequences of recessive bits that it waits for; 0: it is not off.
    recovery: u64,
    bus_offs: u32,
}

impl Counters {
    /// The transmit error counter.
    pub fn transmit(self) -> u16 {
        self.transmit
    }

    /// The receive error counter.
    pub fn receive(self) -> u16 {
        self.receive
    }

    /// How often it went off.
    pub fn bus_offs(self) -> u32 {
        self.bus_offs
    }

    /// How it takes part.
    pub fn state(self) -> State {
        match self.transmit.max(self.receive) {
            _ if self.recovery > 0 => State::Off,
            0..=95 => State::Active,
            96..=127 => State::Warning,
            _ => State::Passive,
        }
    }

    pub(super) fn switch_off(&mut self) {
        if self.recovery == 0 {
            self.recovery = RECOVERY;
            self.bus_offs += 1;
        }
    }

    pub(super) fn sent(&mut self) {
        self.transmit = self.transmit.saturating_sub(1);
    }

    pub(super) fn received(&mut self) {
        self.receive = if self.receive > 127 { 127 } else { self.receive.saturating_sub(1) };
    }

    /// `unacknowledged`: of an error passive node that counts for nothing, so that one alone on the bus does not go off.
    pub(super) fn transmit_error(&mut self, unacknowledged: bool) {
        if unacknowledged && self.state() == State::Passive {
            return;
        }
        self.transmit += 8;
        if self.transmit > 255 {
            self.switch_off();
        }
    }

    pub(super) fn receive_error(&mut self) {
        self.receive = (self.receive + 1).min(255);
    }

    /// Sequences of recessive bits have passed.
    pub(super) fn recover(&mut self, sequences: u64) {
        if self.recovery > 0 {
            self.recovery = self.recovery.saturating_sub(sequences);
            if self.recovery == 0 {
                (self.transmit, self.receive) = (0, 0);
            }
        }
    }

    /// Idle bits after which it takes part again.
    pub(super) fn recovers_in(self) -> u64 {
        self.recovery * RECESSIVE
    }
}

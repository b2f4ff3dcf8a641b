//! What goes out besides transfers: frames of clients, and LSS.

use core::fmt;

use puente_canopen::{Frame, lss};
use puente_line::Duration;

use super::Can;
use crate::bus::Undelivered;
use crate::desk::seats::Seats;
use crate::desk::turn::{Place, Which};
use crate::desk::{Desk, Permits, Reason, State};

/// The place for frames of clients.
#[derive(Clone, Copy)]
struct Frames(u8);

impl Which for Frames {
    type Outcome = Result<(), Undelivered>;

    fn place(self, state: &mut State) -> Option<(&mut Place<Self::Outcome>, &mut Seats)> {
        Some((&mut state.can.bus(self.0)?.frames, &mut state.seats))
    }

    fn bus(self, _: &State) -> Option<u8> {
        Some(self.0)
    }
}

/// The place for LSS commands.
#[derive(Clone, Copy)]
struct Lss(u8);

impl Which for Lss {
    type Outcome = Result<lss::Outcome, lss::Failure>;

    fn place(self, state: &mut State) -> Option<(&mut Place<Self::Outcome>, &mut Seats)> {
        Some((&mut state.can.bus(self.0)?.lss_place, &mut state.seats))
    }

    fn bus(self, _: &State) -> Option<u8> {
        Some(self.0)
    }
}

/// Why an LSS command did not end well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LssFailure {
    /// It was not sent.
    NotSent(Reason),
    /// What came of it.
    Lss(lss::Failure),
}

impl fmt::Display for LssFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LssFailure::NotSent(reason) => write!(f, "not sent: {reason}"),
            LssFailure::Lss(failure) => failure.fmt(f),
        }
    }
}

impl Can {
    fn sends(&mut self, bus: u8) -> Result<(), Reason> {
        let bus = self.bus(bus).ok_or(Reason::Unmapped)?;
        if bus.state.sends() { Ok(()) } else { Err(Reason::LineDown) }
    }
}

impl Desk {
    /// Sends a frame of the client of a seat, and waits until the port has taken it. It goes while all `permits` hold; `stop`
    /// where it stops axes and moves none: then even where the client is gone. Clients take turns.
    ///
    /// # Errors
    /// Why it was not sent.
    pub async fn send_frame(
        &self,
        seat: u8,
        bus: u8,
        frame: &Frame,
        permits: Permits,
        stop: bool,
    ) -> Result<(), Reason> {
        self.with(|state| state.can.sends(bus))?;
        let mut turn = self.turn_at(Frames(bus), seat).await;
        self.with(|state| {
            if let Some(bus) = state.can.bus(bus) {
                bus.frame = *frame;
            }
        });
        turn.send(permits, stop);
        turn.outcome().await.map_err(|undelivered| match undelivered {
            Undelivered::Stopped => Reason::Stopped,
            Undelivered::Line(_) | Undelivered::LineDown | Undelivered::TooLong => Reason::LineDown,
        })
    }

    /// Gives an LSS command for the client of a seat, and waits for its outcome. Nodes answer each of its questions within
    /// `timeout`, or 100 ms. Clients take turns, a command each; dropped, a command under way is given up.
    ///
    /// # Errors
    /// Any [`LssFailure`].
    pub async fn lss(
        &self,
        seat: u8,
        bus: u8,
        command: lss::Command,
        timeout: Option<Duration>,
    ) -> Result<lss::Outcome, LssFailure> {
        self.with(|state| state.can.sends(bus)).map_err(LssFailure::NotSent)?;
        let mut turn = self.turn_at(Lss(bus), seat).await;
        self.with(|state| {
            if let Some(bus) = state.can.bus(bus) {
                bus.lss = (command, timeout);
            }
        });
        turn.send(Permits::new(), false);
        turn.outcome().await.map_err(LssFailure::Lss)
    }
}

//! What clients send to nodes themselves, by the rules of the axes.

use core::fmt;

use puente_canopen::{Frame, NodeId, lss, nmt};

use super::super::{Gateway, Guest};
use crate::axis::{CanRefusal, CanRuling};
use crate::clock;
use crate::desk::Reason;

/// Why a frame was not sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unsent {
    /// All places are taken, and it does more than stop axes.
    Full,
    /// The client has closed its side: nobody would stop what it moves.
    Gone,
    /// By the rules of an axis.
    Refused(CanRefusal),
    /// It was not on the bus.
    NotSent(Reason),
}

impl Unsent {
    /// A word for it.
    pub(super) const fn code(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Gone => "gone",
            Self::Refused(CanRefusal::Leased(_)) => "leased",
            Self::Refused(CanRefusal::Reserved) => "reserved",
            Self::NotSent(_) => "not-sent",
        }
    }
}

impl fmt::Display for Unsent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Full => f.write_str("all places are taken; only stop and disable are served"),
            Self::Gone => f.write_str("the client has closed its side, so nothing would stop the axis"),
            Self::Refused(refusal) => refusal.fmt(f),
            Self::NotSent(reason) => write!(f, "not sent: {reason}"),
        }
    }
}

impl Gateway {
    fn ruling(&self, guest: Guest, gone: bool, bus: u8, frame: &Frame) -> Result<CanRuling, Unsent> {
        let ruling = self.axes.judge_can(guest.commander(), bus, frame).map_err(Unsent::Refused)?;
        let refusal = match () {
            () if guest.stop_only && !ruling.stop => Unsent::Full,
            () if gone && !ruling.permits.is_empty() => Unsent::Gone,
            () => return Ok(ruling),
        };
        self.axes.frame_ended(&ruling.permits, false);
        Err(refusal)
    }

    /// Sends a frame.
    pub(super) async fn send_frame(
        &self,
        guest: Guest,
        gone: bool,
        bus: u8,
        frame: &Frame,
    ) -> Result<(), Unsent> {
        let CanRuling { permits, stop } = self.ruling(guest, gone, bus, frame)?;
        let sent = self.desk.send_frame(guest.seat, bus, frame, permits.clone(), stop).await;
        self.axes.frame_ended(&permits, sent.is_ok());
        sent.map_err(Unsent::NotSent)
    }

    /// Commands a node, or all.
    pub(super) fn command_node(
        &self,
        guest: Guest,
        gone: bool,
        bus: u8,
        command: nmt::Command,
        node: Option<NodeId>,
    ) -> Result<(), Unsent> {
        let CanRuling { permits, .. } = self.ruling(guest, gone, bus, &command.frame(node))?;
        let sent = self.desk.nmt(clock::now(), bus, command, node, &permits);
        self.axes.frame_ended(&permits, sent.is_ok());
        sent.map_err(Unsent::NotSent)
    }

    /// Whether layer setting services may be used now. They are for nodes that nobody moves.
    pub(super) fn may_configure(&self, guest: Guest, gone: bool, bus: u8) -> Result<(), Unsent> {
        let ruling = self.ruling(guest, gone, bus, &lss::Request::Store.frame())?;
        self.axes.frame_ended(&ruling.permits, true);
        Ok(())
    }
}

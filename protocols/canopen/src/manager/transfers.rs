//! Transfers of callers: SDO and LSS.

use puente_line::{Duration, Instant};

use super::Manager;
use super::channels::Borrower;
use crate::{NodeId, lss, sdo};

impl<const NODES: usize, const CHANNELS: usize> Manager<'_, NODES, CHANNELS> {
    /// Takes a transfer with the first SDO server of any node, whether or not it was ever heard. While the bus is off it fails
    /// at once.
    ///
    /// # Errors
    /// `Busy` while the node has a transfer in work or is being booted, and where all channels are lent. A channel stays with
    /// its node until nothing of a transfer that failed can come any more ([`sdo::Config::quarantine`]). Try again when
    /// [`Manager::poll`] has been idle the next time.
    pub fn submit(&mut self, now: Instant, node: NodeId, transfer: sdo::Transfer) -> Result<(), sdo::Busy> {
        self.submit_with(now, node, transfer, self.config.sdo)
    }

    /// As [`Manager::submit`], but worked like this.
    ///
    /// # Errors
    /// As [`Manager::submit`].
    pub fn submit_with(
        &mut self,
        now: Instant,
        node: NodeId,
        transfer: sdo::Transfer,
        config: sdo::Config,
    ) -> Result<(), sdo::Busy> {
        // A member that is to be booted comes first, if it can be; one that is refused may be asked why until then.
        let due = self.up && self.member(node).is_some_and(|managed| managed.is_due(now));
        if due && self.channels.find(now, node, Borrower::Boot).is_some() {
            return Err(sdo::Busy);
        }
        let boots_wait = self.members.iter().any(|managed| managed.waits());
        let to = Borrower::Caller { boots_wait };
        let channel = self.channels.lend(now, node, to).ok_or(sdo::Busy)?;
        channel.submit(transfer, config)?;
        if !self.up {
            channel.lose(now);
        }
        Ok(())
    }

    /// The bytes that [`Sdo::Fetch`](super::Sdo::Fetch) asks for. Fewer end the transfer with [`sdo::Failure::Supply`].
    pub fn supply(&mut self, now: Instant, node: NodeId, bytes: &[u8]) {
        if let Some(client) = self.client(node) {
            client.supply(now, bytes);
        }
    }

    /// Gives the transfer with this node up; its end is still told.
    pub fn cancel(&mut self, now: Instant, node: NodeId) {
        if let Some(client) = self.client(node) {
            client.cancel(now);
        }
    }

    /// Whether the transfer with this node waits before each segment, or each block, that it reads: its caller has no room for
    /// one, and for a segment more: 896 bytes where [`sdo::Config::block`] is 127. Said after each
    /// [`Sdo::Data`](super::Sdo::Data), before the next poll. Ends with the transfer.
    pub fn pause(&mut self, node: NodeId, paused: bool) {
        if let Some(client) = self.client(node) {
            client.pause(paused);
        }
    }

    /// Takes an LSS command; its outcome is [`Action::Lss`](super::Action::Lss). Nodes answer each of its questions within
    /// `timeout`, or as [`Config::lss`](super::Config::lss) has it. While the bus is off nobody answers.
    ///
    /// # Errors
    /// `Busy` until the outcome of the last one has been told.
    pub fn lss(
        &mut self,
        _now: Instant,
        command: lss::Command,
        timeout: Option<Duration>,
    ) -> Result<(), lss::Busy> {
        self.lss.submit(command)?;
        self.lss.set_timeout(timeout.unwrap_or(self.config.lss));
        if !self.up {
            self.lss.abandon();
        }
        Ok(())
    }

    /// Gives the LSS command in work up, if there is one: it ends as if nobody had answered.
    pub const fn cancel_lss(&mut self) {
        self.lss.abandon();
    }

    fn client(&mut self, node: NodeId) -> Option<&mut sdo::Client> {
        self.channels.of(node)?.client()
    }
}

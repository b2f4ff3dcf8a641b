//! The commander's lease: who may move an axis, until when, and what happened when it ended.
//!
//! Each axis has an epoch. A stop, or the end of a lease, starts a new one, and every request that carries a
//! [`Permit`] of an older epoch is dropped unsent.
//!
//! When a lease ends, somebody must stop the axis: who took the lease away and holds the [`Duty`], or else the axis's
//! watchman. Until the drive has confirmed a stop the axis is not leased again.

mod desk;

use core::fmt;

use puente_line::{Duration, Instant};

/// A lease lasts at least this long while the axis is being prepared, until motion has begun.
const PREPARING: Duration = Duration::from_secs(2);
/// Who was stopped by somebody else must keep still this long before the axis obeys it again: a jog button that is
/// still held must not restart what another has stopped.
const STANDSTILL: Duration = Duration::from_secs(1);

/// Who may hold a lease: one connection, or one user of the HTTP interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holder {
    /// A connection, by its running number.
    Connection(u32),
    /// An HTTP user, by a number made of its token or address.
    Http(u32),
    /// The gateway itself.
    Gateway,
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Holder::Connection(number) => write!(f, "client {number}"),
            Holder::Http(number) => write!(f, "web client {number:08x}"),
            Holder::Gateway => f.write_str("the gateway"),
        }
    }
}

/// Why a lease ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Its holder said nothing for too long.
    Expired,
    /// Its holder closed the connection, or lost it.
    Disconnected,
    /// Somebody else stopped the axis.
    Stopped,
    /// The gateway's own stop was not confirmed by the drive.
    StopUnconfirmed,
    /// The drive has switched itself off.
    DriveFault,
    /// The drive, or its bus, is not there any more.
    DriveLost,
    /// The gateway itself has started anew while the axis may have moved.
    Restarted,
}

impl Cause {
    /// The name used in replies.
    pub const fn name(self) -> &'static str {
        match self {
            Cause::Expired => "lease-expired",
            Cause::Disconnected => "commander-disconnected",
            Cause::Stopped => "stopped-by-other",
            Cause::StopUnconfirmed => "stop-unconfirmed",
            Cause::DriveFault => "drive-fault",
            Cause::DriveLost => "drive-lost",
            Cause::Restarted => "gateway-restarted",
        }
    }
}

/// How the last commander lost the axis. Latched until cleared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// Why.
    pub cause: Cause,
    /// Who lost it.
    pub holder: Holder,
    /// When.
    pub at: Instant,
}

/// The axis is under somebody else's lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leased {
    /// By this holder, for this long unless it is renewed.
    By(Holder, Duration),
    /// The asker itself was stopped by somebody else and has to keep still this long.
    Standstill(Duration),
    /// By nobody: the gateway is about to stop the axis.
    Stopping,
}

/// Leave to act on an axis, valid until the next stop or loss of the lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Permit {
    axis: u8,
    epoch: u32,
    holder: Holder,
}

impl Permit {
    pub(super) fn valid(&self, leases: &[AxisLease], now: Instant) -> bool {
        leases.get(usize::from(self.axis)).is_some_and(|axis| {
            let others = axis.lease.as_ref().is_some_and(|l| l.holder != self.holder || l.until <= now);
            axis.epoch == self.epoch && !others
        })
    }

    /// As [`valid`](Self::valid), and its holder has the lease.
    pub(super) fn commands(&self, leases: &[AxisLease], now: Instant) -> bool {
        self.valid(leases, now) && leases.get(usize::from(self.axis)).is_some_and(|axis| axis.lease.is_some())
    }

    /// When it ends unless its holder shows life.
    pub(super) fn end(&self, leases: &[AxisLease]) -> Option<Instant> {
        leases.get(usize::from(self.axis))?.lease.as_ref().map(|lease| lease.until)
    }

    /// The axis that it is for.
    pub(super) fn axis(&self) -> u8 {
        self.axis
    }
}

struct Lease {
    holder: Holder,
    hold: Duration,
    until: Instant,
    /// Motion has begun.
    running: bool,
}

/// What is to be done about an axis that may move without a lease.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Stopping {
    /// Nothing.
    Done,
    /// The holder of a [`Duty`] is stopping it.
    InHand,
    /// The watchman has to.
    Owed(Cause),
}

pub(super) struct AxisLease {
    epoch: u32,
    lease: Option<Lease>,
    stopping: Stopping,
    event: Option<Event>,
    standstill: Option<(Holder, Instant)>,
    /// What the port was told: the axis may move.
    may_move: bool,
    /// No lease is given any more.
    closed: bool,
}

impl AxisLease {
    pub(super) const fn new() -> Self {
        let stopping = Stopping::Done;
        Self {
            epoch: 0,
            lease: None,
            stopping,
            event: None,
            standstill: None,
            may_move: false,
            closed: false,
        }
    }

    #[cfg(test)]
    pub(super) fn may_move(&self) -> bool {
        self.may_move
    }

    /// Nobody moves it, and the last stop that was due has been confirmed.
    fn rests(&self) -> bool {
        self.lease.is_none() && self.stopping == Stopping::Done
    }

    fn lose(&mut self, cause: Cause, now: Instant) {
        if let Some(lease) = self.lease.take() {
            self.epoch = self.epoch.wrapping_add(1);
            self.event = Some(Event { cause, holder: lease.holder, at: now });
            self.stopping = Stopping::Owed(cause);
        }
    }

    /// Motion has begun: from now on the holder must show life.
    pub(super) fn run(&mut self, now: Instant) {
        if let Some(lease) = &mut self.lease {
            lease.running = true;
            lease.until = now + lease.hold;
        }
    }

    /// The motion under this permit has come to its end. To be told to [`Desk::lease_ended`].
    pub(super) fn end(&mut self, permit: Permit) {
        self.lease.take_if(|lease| lease.holder == permit.holder);
    }

    /// A lease that has run out counts as lost whether or not the watchman has seen it yet.
    fn refresh(&mut self, now: Instant) {
        if self.lease.as_ref().is_some_and(|lease| lease.until <= now) {
            self.lose(Cause::Expired, now);
        }
    }

    /// Takes the lease from whoever else has it, who must keep still from now on.
    fn take_from_others(&mut self, by: Holder, now: Instant) -> Option<Lease> {
        let lease = self.lease.take_if(|lease| lease.holder != by)?;
        self.standstill = Some((lease.holder, now + STANDSTILL));
        self.event = Some(Event { cause: Cause::Stopped, holder: lease.holder, at: now });
        Some(lease)
    }

    fn refuse_others(&mut self, holder: Holder, now: Instant) -> Result<(), Leased> {
        self.refresh(now);
        if let Some(lease) = &self.lease
            && lease.holder != holder
        {
            return Err(Leased::By(lease.holder, lease.until.since(now)));
        }
        Ok(())
    }
}

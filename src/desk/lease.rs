//! The commander's lease: who may move an axis, until when, and what happened when it ended.
//!
//! Each axis has an epoch. A stop, or the end of a lease, starts a new one, and every request that carries a
//! [`Permit`] of an older epoch is dropped unsent.

use core::fmt;

use puente_line::{Duration, Instant};

use super::{Desk, State};
use crate::clock;

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
}

impl Cause {
    /// The name used in replies.
    pub const fn name(self) -> &'static str {
        match self {
            Cause::Expired => "lease-expired",
            Cause::Disconnected => "commander-disconnected",
            Cause::Stopped => "stopped-by-other",
            Cause::StopUnconfirmed => "stop-unconfirmed",
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
}

struct Lease {
    holder: Holder,
    hold: Duration,
    until: Instant,
    /// Motion has begun.
    running: bool,
}

pub(super) struct AxisLease {
    epoch: u32,
    lease: Option<Lease>,
    /// The lease was lost and the axis has not been stopped yet.
    lost: Option<Cause>,
    event: Option<Event>,
    standstill: Option<(Holder, Instant)>,
}

impl AxisLease {
    pub(super) const fn new() -> Self {
        Self { epoch: 0, lease: None, lost: None, event: None, standstill: None }
    }

    fn lose(&mut self, cause: Cause, now: Instant) {
        if let Some(lease) = self.lease.take() {
            self.epoch = self.epoch.wrapping_add(1);
            self.event = Some(Event { cause, holder: lease.holder, at: now });
            self.lost = Some(cause);
        }
    }

    /// A lease that has run out counts as lost whether or not the watchman has seen it yet.
    fn refresh(&mut self, now: Instant) {
        if self.lease.as_ref().is_some_and(|lease| lease.until <= now) {
            self.lose(Cause::Expired, now);
        }
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

impl Desk {
    fn on_axis<R>(&self, axis: u8, f: impl FnOnce(&mut AxisLease) -> R) -> Option<R> {
        let result = self.with(|state| state.leases.get_mut(usize::from(axis)).map(f));
        if let Some(signal) = self.leases_changed.get(usize::from(axis)) {
            signal.signal(());
        }
        result
    }

    /// Leave to act on an axis without moving it: refused where another holds the lease.
    pub fn permit(&self, now: Instant, axis: u8, holder: Holder) -> Result<Permit, Leased> {
        let permit = self.on_axis(axis, |state| {
            state.refuse_others(holder, now).map(|()| Permit { axis, epoch: state.epoch, holder })
        });
        permit.unwrap_or(Err(Leased::Standstill(Duration::ZERO)))
    }

    /// Leave to move an axis: takes or renews the lease for `hold` (the desk's lease time where none is given).
    pub fn lease(
        &self,
        now: Instant,
        axis: u8,
        holder: Holder,
        hold: Option<Duration>,
    ) -> Result<Permit, Leased> {
        let hold = hold.unwrap_or_else(|| self.with(|state| state.lease_time));
        let permit = self.on_axis(axis, |state| {
            state.refuse_others(holder, now)?;
            if let Some((stopped, until)) = state.standstill
                && stopped == holder
                && now < until
            {
                state.standstill = Some((holder, now + STANDSTILL));
                return Err(Leased::Standstill(STANDSTILL));
            }
            let lease = state.lease.get_or_insert(Lease {
                holder,
                hold,
                until: now + hold.max(PREPARING),
                running: false,
            });
            lease.hold = hold;
            if lease.running {
                lease.until = now + hold;
            }
            Ok(Permit { axis, epoch: state.epoch, holder })
        });
        permit.unwrap_or(Err(Leased::Standstill(Duration::ZERO)))
    }

    /// Motion has begun under this permit: from now on its holder must show life.
    pub fn moving(&self, now: Instant, permit: Permit) {
        self.on_axis(permit.axis, |state| {
            if let Some(lease) = state.lease.as_mut().filter(|lease| lease.holder == permit.holder) {
                lease.running = true;
                lease.until = now + lease.hold;
            }
        });
    }

    /// The holder of a permit gives its lease back without having moved the axis.
    pub fn unlease(&self, permit: Permit) {
        self.on_axis(permit.axis, |state| {
            if state.lease.as_ref().is_some_and(|lease| lease.holder == permit.holder && !lease.running) {
                state.lease = None;
            }
        });
    }

    /// A connection has shown life.
    pub fn renew(&self, now: Instant, connection: u32) {
        self.with(|state| {
            for axis in &mut state.leases {
                axis.refresh(now);
                if let Some(lease) = axis.lease.as_mut().filter(|lease| lease.running)
                    && lease.holder == Holder::Connection(connection)
                {
                    lease.until = now + lease.hold;
                }
            }
        });
    }

    /// A connection is gone: its axes are to be stopped.
    pub fn leave(&self, now: Instant, connection: u32) {
        self.with(|state| {
            for axis in &mut state.leases {
                if axis.lease.as_ref().is_some_and(|lease| lease.holder == Holder::Connection(connection)) {
                    axis.lose(Cause::Disconnected, now);
                }
            }
        });
        self.leases_changed.iter().for_each(|signal| signal.signal(()));
    }

    /// Somebody stops an axis: ends any lease and revokes every permit.
    pub fn revoke(&self, now: Instant, axis: u8, by: Holder) {
        self.on_axis(axis, |state| {
            if let Some(lease) = state.lease.take_if(|lease| lease.holder != by) {
                state.standstill = Some((lease.holder, now + STANDSTILL));
                state.event = Some(Event { cause: Cause::Stopped, holder: lease.holder, at: now });
            }
            state.lease = None;
            state.epoch = state.epoch.wrapping_add(1);
        });
    }

    /// Who holds an axis, and for how long.
    pub fn leased(&self, now: Instant, axis: u8) -> Option<(Holder, Duration)> {
        self.with(|state| {
            let lease = state.leases.get(usize::from(axis))?.lease.as_ref()?;
            (lease.until > now).then(|| (lease.holder, lease.until.since(now)))
        })
    }

    /// How the last commander lost an axis, until cleared.
    pub fn event(&self, axis: u8) -> Option<Event> {
        self.with(|state| state.leases.get(usize::from(axis))?.event)
    }

    /// Forgets the latched event.
    pub fn clear_event(&self, axis: u8) {
        self.on_axis(axis, |state| state.event = None);
    }

    /// The gateway could not stop an axis.
    pub fn stop_unconfirmed(&self, now: Instant, axis: u8) {
        self.on_axis(axis, |state| {
            let holder = state.event.map_or(Holder::Gateway, |event| event.holder);
            state.event = Some(Event { cause: Cause::StopUnconfirmed, holder, at: now });
        });
    }

    /// Waits until the lease of an axis is lost, and tells why. For the one task that stops the axis.
    pub async fn lost(&self, axis: u8) -> Cause {
        loop {
            let check = |state: &mut State| {
                let state = state.leases.get_mut(usize::from(axis))?;
                state.refresh(clock::now());
                Some((state.lost.take(), state.lease.as_ref().map(|lease| lease.until)))
            };
            let (lost, until) = self.with(check).unwrap_or_default();
            if let Some(cause) = lost {
                return cause;
            }
            match self.leases_changed.get(usize::from(axis)) {
                Some(signal) => embassy_futures::select::select(signal.wait(), clock::at(until)).await,
                None => core::future::pending().await,
            };
        }
    }
}

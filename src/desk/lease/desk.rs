//! The leases of all axes, as the desk keeps them.

use puente_line::{Duration, Instant};

use super::super::{Desk, Duty, State};
use super::{AxisLease, Cause, Event, Holder, Lease, Leased, PREPARING, Permit, STANDSTILL, Stopping};
use crate::clock;
use crate::port;

impl Desk {
    fn on_axis<R>(&self, axis: u8, f: impl FnOnce(&mut AxisLease) -> R) -> Option<R> {
        let result = self.with(|state| {
            let lease = state.leases.get_mut(usize::from(axis))?;
            let result = f(lease);
            // Before a permit can be used, and not before the stop is confirmed: should the gateway fail, it knows which
            // axes to stop.
            if lease.may_move == lease.rests() {
                lease.may_move = !lease.may_move;
                port::may_move(axis, lease.may_move);
            }
            Some(result)
        });
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
            if state.closed || matches!(state.stopping, Stopping::Owed(_)) {
                return Err(Leased::Stopping);
            }
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

    /// As [`lease`](Self::lease) of a holder that has the lease; none where it has ended.
    pub fn prolong(
        &self,
        now: Instant,
        axis: u8,
        holder: Holder,
        hold: Option<Duration>,
    ) -> Result<Option<Permit>, Leased> {
        let hold = hold.unwrap_or_else(|| self.with(|state| state.lease_time));
        let permit = self.on_axis(axis, |state| {
            state.refuse_others(holder, now)?;
            let permit = Permit { axis, epoch: state.epoch, holder };
            Ok(state.lease.as_mut().map(|lease| {
                lease.hold = hold;
                if lease.running {
                    lease.until = now + hold;
                }
                permit
            }))
        });
        permit.unwrap_or(Ok(None))
    }

    /// Motion has begun under this permit: from now on its holder must show life. False where its lease has ended
    /// meanwhile; then the axis is being stopped.
    pub fn moving(&self, now: Instant, permit: Permit) -> bool {
        let moving = self.on_axis(permit.axis, |state| {
            let holds = state.lease.as_ref().is_some_and(|lease| lease.holder == permit.holder);
            if holds {
                state.run(now);
            }
            holds
        });
        moving == Some(true)
    }

    /// The holder of a permit gives its lease back without having moved the axis.
    pub fn unlease(&self, permit: Permit) {
        self.on_axis(permit.axis, |state| {
            if state.lease.as_ref().is_some_and(|lease| lease.holder == permit.holder && !lease.running) {
                state.lease = None;
            }
        });
    }

    /// The holder of a permit gives its lease back with the axis at rest.
    pub fn release(&self, permit: Permit) {
        self.on_axis(permit.axis, |state| state.lease.take_if(|lease| lease.holder == permit.holder));
    }

    /// A lease has [ended](AxisLease::end) with its motion.
    pub(in crate::desk) fn lease_ended(&self, axis: u8) {
        self.on_axis(axis, |_| ());
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
        self.lose_all(now, |holder| holder == Holder::Connection(connection));
    }

    /// The gateway is about to end: every axis under a lease is to be stopped, and none is leased any more.
    pub fn close(&self, now: Instant) {
        self.with(|state| state.leases.iter_mut().for_each(|axis| axis.closed = true));
        self.lose_all(now, |_| true);
    }

    /// As [`close`](Self::close) where no axis is under a lease or has to be stopped; otherwise nothing changes. Tells
    /// which.
    pub fn close_at_rest(&self, now: Instant) -> bool {
        self.with(|state| {
            state.leases.iter_mut().for_each(|axis| axis.refresh(now));
            let rests = state.leases.iter().all(AxisLease::rests);
            state.leases.iter_mut().for_each(|axis| axis.closed |= rests);
            rests
        })
    }

    /// Gives leases again.
    pub fn reopen(&self) {
        self.with(|state| state.leases.iter_mut().for_each(|axis| axis.closed = false));
    }

    fn lose_all(&self, now: Instant, of: impl Fn(Holder) -> bool) {
        self.with(|state| {
            for axis in &mut state.leases {
                if axis.lease.as_ref().is_some_and(|lease| of(lease.holder)) {
                    axis.lose(Cause::Disconnected, now);
                }
            }
        });
        self.leases_changed.iter().chain(&self.work).for_each(|signal| signal.signal(()));
    }

    /// The gateway has failed while this axis may have moved, and has just started anew: its watchman has to stop it.
    pub fn restarted(&self, now: Instant, axis: u8) {
        self.on_axis(axis, |state| {
            state.stopping = Stopping::Owed(Cause::Restarted);
            state.event = Some(Event { cause: Cause::Restarted, holder: Holder::Gateway, at: now });
        });
    }

    /// Whether no axis is under a lease, and every stop that was due has been confirmed.
    pub fn at_rest(&self) -> bool {
        self.with(|state| state.leases.iter().all(AxisLease::rests))
    }

    /// Somebody is about to stop an axis in all directions: ends any lease and revokes every permit. Where that leaves
    /// an axis that may move, it is the duty of the caller to stop it.
    pub fn revoke(&self, now: Instant, axis: u8, by: Holder) -> Duty<'_> {
        let epoch = self.on_axis(axis, |state| {
            let lease = state.take_from_others(by, now).or_else(|| state.lease.take());
            if lease.is_some() || state.stopping != Stopping::Done {
                state.stopping = Stopping::InHand;
            }
            state.epoch = state.epoch.wrapping_add(1);
            state.epoch
        });
        Duty { desk: self, axis, epoch: epoch.unwrap_or_default() }
    }

    /// The duty that began with this epoch has ended. Who has revoked later has the duty now.
    pub(in crate::desk) fn end_stopping(&self, axis: u8, epoch: u32, with: Stopping) {
        self.on_axis(axis, |state| {
            if state.epoch == epoch && state.stopping == Stopping::InHand {
                state.stopping = with;
            }
        });
    }

    /// The drive itself has ended the motion of its commander, who must keep still from now on. It has been seen at
    /// rest, so that nobody has to stop it; but one that is lost is to be stopped as soon as it is there again.
    pub(in crate::desk) fn fallen(&self, now: Instant, axis: u8, cause: Cause) {
        self.on_axis(axis, |state| {
            if let Some(lease) = state.take_from_others(Holder::Gateway, now) {
                state.event = Some(Event { cause, holder: lease.holder, at: now });
                if cause == Cause::DriveLost {
                    state.stopping = Stopping::Owed(cause);
                }
            }
            state.epoch = state.epoch.wrapping_add(1);
        });
    }

    /// Somebody stops an axis in one direction, by a request of its own: revokes every permit. Its own lease stays, for
    /// the other direction may be on; that of another ends, and the axis is stopped altogether.
    pub fn revoke_permits(&self, now: Instant, axis: u8, by: Holder) {
        self.on_axis(axis, |state| {
            if state.take_from_others(by, now).is_some() {
                state.stopping = Stopping::Owed(Cause::Stopped);
            }
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

    /// Waits until an axis has to be stopped by its watchman, and tells why.
    pub async fn owed(&self, axis: u8) -> Cause {
        loop {
            let check = |state: &mut State| {
                let state = state.leases.get_mut(usize::from(axis))?;
                state.refresh(clock::now());
                Some((state.stopping, state.lease.as_ref().map(|lease| lease.until)))
            };
            let (stopping, until) = self.with(check).unwrap_or((Stopping::Done, None));
            if let Stopping::Owed(cause) = stopping {
                return cause;
            }
            match self.leases_changed.get(usize::from(axis)) {
                Some(signal) => embassy_futures::select::select(signal.wait(), clock::at(until)).await,
                None => core::future::pending().await,
            };
        }
    }

    /// Whether an axis has to be stopped by its watchman now.
    pub fn owes(&self, axis: u8) -> bool {
        let owed = |lease: &AxisLease| matches!(lease.stopping, Stopping::Owed(_));
        self.with(|state| state.leases.get(usize::from(axis)).is_some_and(owed))
    }
}

//! What is told and sent next, and what follows from the time.

use puente_line::{Instant, micros};

use super::Manager;
use super::channel::Said;
use super::channels::Borrower;
use super::types::{Action, Event, Sdo};
use crate::boot::Verdict;
use crate::time::TimeOfDay;
use crate::{Frame, NodeId, lss, sdo};

impl<const NODES: usize, const CHANNELS: usize> Manager<'_, NODES, CHANNELS> {
    /// What the time has brought about.
    pub(super) fn elapse(&mut self, now: Instant) {
        self.babble.elapse(now);
        self.listen(now);
        self.boot(now);
        if !self.up {
            // What cannot be sent is not sent later.
            for managed in &mut self.members {
                let _ = managed.monitor.request(now);
            }
        }
    }

    /// Begins with the members that are due, in turn.
    fn boot(&mut self, now: Instant) {
        if !self.up {
            return;
        }
        let (count, turn) = (self.members.len(), self.turn);
        for offset in 0..count {
            let at = (turn + offset) % count;
            let Some(managed) = self.members.get_mut(at).filter(|managed| managed.is_due(now)) else {
                continue;
            };
            let Some(channel) = self.channels.lend(now, managed.member.id, Borrower::Boot) else {
                managed.wait();
                continue;
            };
            if managed.try_now() {
                channel.boot(managed.member.plan, self.config.sdo);
            } else {
                channel.probe(managed.member.plan, self.config.sdo);
            }
            self.turn = (at + 1) % count;
        }
    }

    /// What there is to tell.
    pub(super) fn told(&mut self, now: Instant) -> Option<Action> {
        if let Some(event) = self.bus_events.pop_front().or_else(|| self.babble.event()) {
            return Some(Action::Bus(event));
        }
        if let Some((node, event)) = self.events.pop_front() {
            return Some(Action::Node(node, event));
        }
        if let Some(end) = self.lss.outcome(now) {
            return Some(Action::Lss(end));
        }
        // Each round ends a step of a boot, and may free its channel.
        while let Some((node, said)) = self.channels.brought(now, !self.commands.is_full()) {
            if let Some(action) = self.said(now, node, said) {
                return Some(action);
            }
            self.boot(now);
        }
        self.channels.release(now);
        None
    }

    /// The next frame.
    pub(super) fn transmit(&mut self, now: Instant) -> Option<Action> {
        if let Some((command, node)) = self.commands.pop_front() {
            self.commanded(now, command, node);
            return Some(Action::Transmit(command.frame(node)));
        }
        let time = self.clock.and_then(|(at, time)| {
            TimeOfDay::from_unix_millis(time.to_unix_millis().saturating_add(micros(now.since(at)) / 1_000))
        });
        let own = self.heartbeat.poll(now).or_else(|| self.time.poll(now, time));
        if let Some(frame) = own.or_else(|| self.guard(now)) {
            return Some(Action::Transmit(frame));
        }
        if let lss::Action::Transmit(frame) = self.lss.poll(now) {
            return Some(Action::Transmit(frame));
        }
        let (node, said) = self.channels.poll(now)?;
        self.said(now, node, said)
    }

    /// The next question of guarding.
    fn guard(&mut self, now: Instant) -> Option<Frame> {
        let count = self.members.len();
        for offset in 0..count {
            let at = (self.turn + offset) % count;
            if let Some(managed) = self.members.get_mut(at)
                && let Some(frame) = managed.monitor.request(now)
            {
                self.table.guard(managed.member.id);
                return Some(frame);
            }
        }
        None
    }

    /// What a channel has said.
    fn said(&mut self, now: Instant, node: NodeId, said: Said) -> Option<Action> {
        let retry = self.config.retry;
        let repeated = self.channels.of(node).is_some_and(|channel| channel.has_repeated());
        let event = match said {
            Said::Frame(frame) => return Some(Action::Transmit(frame)),
            Said::Sdo(sdo) => {
                if let Sdo::Done(end) = &sdo {
                    self.table.transferred(node, repeated || owes(*end));
                }
                return Some(Action::Sdo(node, sdo));
            }
            Said::Command(command) => {
                let _ = self.commands.push_back((command, Some(node)));
                return None;
            }
            Said::Present => {
                let managed = self.member_mut(node)?;
                // It came back while it was asked.
                if managed.is_booted() {
                    self.channels.of(node)?.leave(now);
                } else {
                    managed.present();
                }
                return None;
            }
            Said::Declined(address, code) => Event::Declined(address, code),
            Said::Booted => {
                self.table.transferred(node, repeated);
                self.counters.booted = self.counters.booted.wrapping_add(1);
                self.member_mut(node)?.booted(now);
                Event::Booted
            }
            Said::NotBooted(verdict) => {
                let failed = match verdict {
                    Verdict::Failed { failure, .. } => owes(Err(failure)),
                    _ => false,
                };
                self.table.transferred(node, repeated || failed);
                if !self.member_mut(node)?.refused(now, verdict, retry) {
                    return None;
                }
                Event::NotBooted(verdict)
            }
            Said::Absent => {
                self.table.transferred(node, true);
                if !self.member_mut(node)?.absent(now + retry) {
                    return None;
                }
                Event::Missing
            }
        };
        Some(Action::Node(node, event))
    }
}

/// Whether responses of a transfer that ended like this may still come.
const fn owes(end: Result<sdo::Outcome, sdo::Failure>) -> bool {
    !matches!(end, Ok(_) | Err(sdo::Failure::Aborted(_) | sdo::Failure::Booted))
}

//! What the bus says.

use puente_line::Instant;

use super::Manager;
use super::types::{Event, Evidence};
use crate::cob::Function;
use crate::emcy::Emergency;
use crate::monitor;
use crate::nmt::{Command, Sign};
use crate::{Frame, Id, NodeId};

impl<const NODES: usize, const CHANNELS: usize> Manager<'_, NODES, CHANNELS> {
    /// Takes a frame of the bus. What others of this gateway have sent counts as heard; what the manager has sent itself must
    /// not come back.
    pub fn receive(&mut self, now: Instant, frame: &Frame) {
        let function = Function::of(frame.id());
        if !self.is_asked_for(function) {
            self.babble.count(now, frame.id());
        }
        match function {
            Some(Function::Emcy(node) | Function::SdoResponse(node) | Function::ErrorControl(node))
                if node == self.config.node && !frame.is_remote() =>
            {
                self.duplicate(node, Evidence::Own);
            }
            Some(Function::Nmt) => {
                if let Some((command, node)) = Command::parse(frame) {
                    self.commanded(now, command, node);
                }
            }
            Some(Function::Emcy(node)) => {
                if let Some((_, emergency)) = Emergency::parse(frame) {
                    self.emergency(now, node, emergency);
                }
            }
            Some(Function::ErrorControl(node)) if frame.is_remote() => self.table.guarded(node),
            Some(Function::ErrorControl(_)) => {
                if let Some(sign) = Sign::parse(frame) {
                    self.sign(now, sign, frame);
                }
            }
            Some(Function::SdoRequest(node)) => self.table.share(node),
            Some(Function::SdoResponse(node)) if !frame.is_remote() => self.response(now, node, frame),
            Some(Function::LssSlave) => self.lss.receive(now, frame),
            _ => {}
        }
    }

    /// Many frames of a transfer are no babbling.
    fn is_asked_for(&mut self, function: Option<Function>) -> bool {
        let Some(Function::SdoResponse(node)) = function else {
            return false;
        };
        self.table.is_shared(node) || self.channels.of(node).is_some_and(|channel| channel.is_busy())
    }

    fn sign(&mut self, now: Instant, sign: Sign, frame: &Frame) {
        let (event, mut evidence) = self.table.sign(now, sign);
        let retry = self.config.retry;
        match self.member_mut(sign.node) {
            Some(managed) => {
                evidence = evidence.or(managed.receive(now, frame, retry));
                if managed.monitor.is_guarding() {
                    evidence = evidence.or(self.table.answer(sign.node));
                }
                self.listen(now);
            }
            None => {
                if let Some(event) = event {
                    self.watched(now, sign.node, event);
                }
            }
        }
        if let Some(evidence) = evidence {
            self.duplicate(sign.node, evidence);
        }
    }

    fn emergency(&mut self, now: Instant, node: NodeId, emergency: Emergency) {
        self.counters.emergencies = self.counters.emergencies.wrapping_add(1);
        self.table.emergency(now, node, emergency);
        if self.babble.is_loud(Id::Base(node.emcy())) {
            self.counters.untold = self.counters.untold.wrapping_add(1);
        } else {
            self.tell(node, Event::Emergency(emergency));
        }
    }

    fn response(&mut self, now: Instant, node: NodeId, frame: &Frame) {
        self.table.hear(now, node);
        match self.channels.of(node) {
            Some(channel) if !channel.is_free(now) => channel.receive(now, frame),
            // An abort may come at any time, of a transfer that somebody began before this manager did.
            _ if frame.data().first() == Some(&0x80) => {}
            _ => {
                if let Some(evidence) = self.table.unasked(node) {
                    self.duplicate(node, evidence);
                }
            }
        }
    }

    /// A command has been given, by whomever.
    pub(super) fn commanded(&mut self, now: Instant, command: Command, node: Option<NodeId>) {
        self.table.commanded(node);
        let retry = self.config.retry;
        for managed in &mut self.members {
            if node.is_none_or(|node| node == managed.member.id) {
                managed.commanded(now, command, retry);
            }
        }
    }

    /// Takes what the monitors tell, as long as there is room for it, the members in turn.
    pub(super) fn listen(&mut self, now: Instant) {
        let (count, retry) = (self.members.len(), self.config.retry);
        for offset in 0..count {
            let at = (self.turn + offset) % count;
            while !self.events.is_full()
                && let Some(managed) = self.members.get_mut(at)
                && let Some(event) = managed.monitor.event(now)
            {
                managed.heard(now, event, retry);
                let node = managed.member.id;
                self.watched(now, node, event);
            }
        }
    }

    /// A node shows itself, or not any more.
    fn watched(&mut self, now: Instant, node: NodeId, event: monitor::Event) {
        if event == monitor::Event::BootUp
            && let Some(channel) = self.channels.of(node)
        {
            channel.booted(now);
        }
        if self.babble.is_loud(Id::Base(node.error_control())) && !matches!(event, monitor::Event::Lost(_)) {
            self.counters.untold = self.counters.untold.wrapping_add(1);
        } else {
            self.tell(node, Event::Monitor(event));
        }
    }

    fn duplicate(&mut self, node: NodeId, evidence: Evidence) {
        if !self.table.is_duplicate(node) && self.tell(node, Event::DuplicateId(evidence)) {
            self.table.duplicate(node);
        }
    }

    /// Whether there was room for it.
    fn tell(&mut self, node: NodeId, event: Event) -> bool {
        let told = self.events.push_back((node, event)).is_ok();
        self.counters.untold = self.counters.untold.wrapping_add(u32::from(!told));
        told
    }
}

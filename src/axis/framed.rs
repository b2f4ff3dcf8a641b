//! Frames that clients send straight to a PID module: the rules of the axis hold for them too.

use puente_framed::section::NOBODY;
use puente_framed::{Class, Frame, Kind};
use puente_modules::{Control, Form, Setting};

use super::{Axes, Commander, Drive};
use crate::clock;
use crate::desk::{Leased, Permits};

/// How a client's frame is to be handled.
#[derive(Clone, Debug)]
pub struct FrameRuling {
    /// What it needs in order to go: one for each axis that it moves. To be told to [`Axes::frame_ended`].
    pub permits: Permits,
    /// It stops axes, and does nothing else.
    pub stop: bool,
}

/// What a frame does to an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Effect {
    Read,
    Stop,
    Motion,
}

impl Axes {
    /// Ends the motion of every axis that a frame stops, before the frame itself is sent. Allowed to everyone, at any time.
    pub fn halt(&self, by: Commander, bus: u8, frame: &Frame<'_>) {
        for (axis, effect) in self.effects(bus, frame) {
            if effect == Effect::Stop {
                self.desk.revoke_permits(clock::now(), axis, by.holder);
            }
        }
    }

    /// Judges a client's frame. Of an axis that it moves the gateway itself wants nothing from now on.
    ///
    /// # Errors
    /// Where another client holds the lease of an axis that it moves, or that axis has to stand still.
    pub fn judge_frame(&self, by: Commander, bus: u8, frame: &Frame<'_>) -> Result<FrameRuling, Leased> {
        self.halt(by, bus, frame);
        let now = clock::now();
        let mut permits = Permits::new();
        for (axis, _) in self.effects(bus, frame).filter(|(_, effect)| *effect == Effect::Motion) {
            let permit = self.desk.lease(now, axis, by.holder, None);
            // There is room: no axis comes twice.
            let _ = permits.push(permit.inspect_err(|_| self.frame_ended(&permits, false))?);
        }
        for permit in &permits {
            self.desk.observe(now, *permit);
        }
        let stops = |address| {
            self.effects(bus, frame).any(|(axis, effect)| {
                effect == Effect::Stop && self.get(axis).is_ok_and(|axis| axis.address == address)
            })
        };
        let mut addressed =
            frame.sections().map(|section| section.address).filter(|address| *address != NOBODY).peekable();
        let stop = addressed.peek().is_some() && addressed.all(stops);
        Ok(FrameRuling { permits, stop })
    }

    /// A frame that moves axes has been sent, or not.
    pub fn frame_ended(&self, permits: &Permits, sent: bool) {
        for permit in permits {
            if sent {
                self.desk.moving(clock::now(), *permit);
            } else {
                self.desk.unlease(*permit);
            }
        }
    }

    /// What a frame does to each axis of the bus to which it says something.
    fn effects(&self, bus: u8, frame: &Frame<'_>) -> impl Iterator<Item = (u8, Effect)> {
        self.iter().filter_map(move |(id, axis)| match &axis.drive {
            Drive::Pid(spec) if axis.bus == bus => Some((id, effect(frame, axis.address, spec.form)?)),
            _ => None,
        })
    }
}

/// What a frame does to the module at an address; none where it says nothing to it.
fn effect(frame: &Frame<'_>, address: u8, form: Form) -> Option<Effect> {
    let commands = matches!(
        frame.kind,
        Kind::Plain | Kind::Single(Class::Data) | Kind::Numbered { class: Class::Data, .. }
    );
    let sections = frame.sections().filter(|section| section.address == address);
    sections.map(|section| if commands { said(form, section.data) } else { Effect::Read }).max()
}

/// What a section does. What is not understood, or says no order, may move an axis.
fn said(form: Form, data: &[u8]) -> Effect {
    match Setting::parse(form, data).ok().and_then(|setting| setting.order) {
        Some(order) => match order.control {
            Control::Observe => Effect::Read,
            Control::Off | Control::Hold => Effect::Stop,
            Control::Follow => Effect::Motion,
        },
        None => Effect::Motion,
    }
}

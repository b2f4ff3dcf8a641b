//! CAN frames, and objects, that clients send straight to CiA 402 drives: the rules of the axis hold for them too.
//!
//! | what | who may |
//! |---|---|
//! | reads, remote frames for PDOs, TIME, nodes that are no axis' | everyone |
//! | a controlword that disables or stops (disable voltage, quick stop, shutdown) | everyone |
//! | a controlword that enables operation, a set-point, a mode | whoever gets the lease, and with it shows life |
//! | any other write to the node of an axis, NMT to it or to all, LSS | everyone while no other commands the axis |
//! | SYNC where the gateway produces it; what the node of an axis says itself | nobody |
//!
//! Receive PDOs are judged by what the gateway has set them up to be.

use puente_canopen::cob::Function;
use puente_canopen::sdo::{Initiate, Request};
use puente_canopen::{Address, Frame, NodeId};
use puente_drives::cia402::object::{
    CONTROLWORD, INTERPOLATION_SET_POINT, MODE, TARGET_POSITION, TARGET_TORQUE, TARGET_VELOCITY, VL_TARGET,
};
use puente_drives::cia402::{Controlword, Profile};

use super::{Axes, Commander, Drive, Ruling, cia402};
use crate::clock;
use crate::desk::{Class, Leased, Permits};

/// How a client's CAN frame is to be handled.
#[derive(Clone, Debug)]
pub struct CanRuling {
    /// What it needs in order to go: one for each axis that it acts on. To be told to [`Axes::frame_ended`].
    pub permits: Permits,
    /// It stops axes, and does nothing else.
    pub stop: bool,
}

/// Why a client's CAN frame may not go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanRefusal {
    /// Another client commands an axis that it acts on, or that axis has to stand still.
    Leased(Leased),
    /// It is not a client's to send: SYNC, where the gateway produces it, or what the node of an axis says.
    Reserved,
}

/// What a frame, or a write, does to an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Effect {
    Act,
    Stop,
    Motion,
}

impl core::fmt::Display for CanRefusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            CanRefusal::Leased(leased) => super::AxisError::Leased(*leased).fmt(f),
            CanRefusal::Reserved => {
                f.write_str("SYNC is the gateway's to send, and what the node of an axis says is that node's")
            }
        }
    }
}

impl Axes {
    /// Judges a client's frame for a CANopen bus. Of an axis that it moves the gateway itself wants nothing from now on; the
    /// motion of one that it stops ends before the frame is sent.
    ///
    /// # Errors
    /// Any [`CanRefusal`].
    pub fn judge_can(&self, by: Commander, bus: u8, frame: &Frame) -> Result<CanRuling, CanRefusal> {
        let function = Function::of(frame.id());
        let mut ruling = CanRuling { permits: Permits::new(), stop: false };
        let reserved = |(_, node, spec): (u8, NodeId, cia402::Spec)| {
            is_reserved(function, frame.is_remote(), node, spec)
        };
        if self.servos(bus).any(reserved) {
            return Err(CanRefusal::Reserved);
        }
        let effects = || {
            let effect = move |(id, node, spec)| Some((id, effect(function?, frame, node, spec)?));
            self.servos(bus).filter_map(effect)
        };
        let now = clock::now();
        for (axis, _) in effects().filter(|(_, effect)| *effect == Effect::Stop) {
            self.desk.revoke_permits(now, axis, by.holder);
            ruling.stop = true;
        }
        for (axis, effect) in effects().filter(|(_, effect)| *effect != Effect::Stop) {
            let permit = match effect {
                Effect::Motion => self.desk.lease(now, axis, by.holder, None),
                _ => self.desk.permit(now, axis, by.holder),
            };
            let permit = permit.map_err(|leased| {
                self.frame_ended(&ruling.permits, false);
                CanRefusal::Leased(leased)
            })?;
            if effect == Effect::Motion {
                self.desk.observe(now, permit);
            }
            // There is room: no axis comes twice.
            let _ = ruling.permits.push(permit);
            ruling.stop = false;
        }
        Ok(ruling)
    }

    /// Judges the writing of an object of a node, by its first bytes; none where they are not known yet. To be told to
    /// [`raw_ended`](Self::raw_ended). Reads are free.
    ///
    /// # Errors
    /// Where another client holds the lease of the axis, or that has to stand still.
    pub fn judge_sdo(
        &self,
        by: Commander,
        bus: u8,
        node: NodeId,
        address: Address,
        data: &[u8],
    ) -> Result<Ruling, Leased> {
        let Some((id, ..)) = self.servos(bus).find(|(_, other, _)| *other == node) else {
            return Ok(Ruling { class: Class::Free, motion: None });
        };
        let now = clock::now();
        Ok(match written(address, data) {
            Effect::Stop => {
                self.desk.revoke_permits(now, id, by.holder);
                Ruling { class: Class::Stop, motion: None }
            }
            Effect::Act => {
                Ruling { class: Class::Guarded(self.desk.permit(now, id, by.holder)?), motion: None }
            }
            Effect::Motion => {
                let permit = self.desk.lease(now, id, by.holder, None)?;
                self.desk.observe(now, permit);
                Ruling { class: Class::Motion(permit), motion: Some(permit) }
            }
        })
    }

    /// The drives of a bus.
    fn servos(&self, bus: u8) -> impl Iterator<Item = (u8, NodeId, cia402::Spec)> {
        self.iter().filter_map(move |(id, axis)| match &axis.drive {
            Drive::Cia402(drive) if axis.bus == bus => Some((id, NodeId::new(axis.address)?, drive.spec)),
            _ => None,
        })
    }
}

/// Whether nobody but the gateway, or the node of this axis, sends such a frame.
fn is_reserved(function: Option<Function>, remote: bool, node: NodeId, spec: cia402::Spec) -> bool {
    match function {
        Some(Function::Sync) => spec.sync,
        // Who asks for it out of turn makes its toggle bit look wrong.
        Some(Function::ErrorControl(of)) => of == node,
        Some(Function::Emcy(of) | Function::Tpdo(_, of) | Function::SdoResponse(of)) => of == node && !remote,
        _ => false,
    }
}

/// What a frame does to the axis of a node; none where it does nothing.
fn effect(function: Function, frame: &Frame, node: NodeId, spec: cia402::Spec) -> Option<Effect> {
    if frame.is_remote() {
        return None;
    }
    match function {
        Function::Nmt => {
            let of = frame.data().get(1).copied().unwrap_or(0);
            (of == 0 || of == node.value()).then_some(Effect::Act)
        }
        Function::LssMaster => Some(Effect::Act),
        Function::Rpdo(number, of) if of == node => Some(received(frame, number, spec)),
        Function::SdoRequest(of) if of == node => match Request::parse(frame.data()).ok()? {
            Request::InitiateDownload { address, data } => Some(match data {
                Initiate::Expedited(data) => written(address, &data),
                Initiate::Unsized(data) => written(address, &data),
                Initiate::Segmented { .. } => written(address, &[]),
            }),
            Request::InitiateBlockDownload { address, .. } => Some(written(address, &[])),
            // What follows was judged when it began, and the rest reads.
            _ => None,
        },
        _ => None,
    }
}

/// What a receive PDO does.
fn received(frame: &Frame, number: u8, spec: cia402::Spec) -> Effect {
    let mapped = match spec.cyclic {
        Some(_) if number == 4 => &[],
        _ => mapping(spec.profile, number),
    };
    match (mapped.first(), frame.data()) {
        (Some(first), [low, high, ..]) if first.address == CONTROLWORD.address => controlled(*low, *high),
        _ => Effect::Motion,
    }
}

fn mapping(profile: &Profile, number: u8) -> &'static [puente_canopen::pdo::Mapped] {
    let at = number.checked_sub(1).map(usize::from);
    at.and_then(|at| profile.receive.get(at)).copied().unwrap_or_default()
}

/// What the writing of an object does.
fn written(address: Address, data: &[u8]) -> Effect {
    const MOVES: [Address; 7] = [
        CONTROLWORD.address,
        MODE.address,
        TARGET_POSITION.address,
        TARGET_VELOCITY.address,
        TARGET_TORQUE.address,
        VL_TARGET.address,
        INTERPOLATION_SET_POINT.address,
    ];
    match data {
        [low, high, ..] if address == CONTROLWORD.address => controlled(*low, *high),
        _ if MOVES.contains(&address) => Effect::Motion,
        _ => Effect::Act,
    }
}

/// What a controlword does.
fn controlled(low: u8, high: u8) -> Effect {
    let word = Controlword(u16::from_le_bytes([low, high]));
    let voltage = Controlword::ENABLE_VOLTAGE | Controlword::NO_QUICK_STOP;
    let enables = word.has(voltage | Controlword::SWITCH_ON | Controlword::ENABLE_OPERATION);
    match word.has(voltage | Controlword::SWITCH_ON) {
        _ if enables => Effect::Motion,
        // Its edge resets a fault.
        _ if word.has(Controlword::FAULT_RESET) => Effect::Act,
        // Switch on; or disable operation, of what is enabled.
        true => Effect::Act,
        false => Effect::Stop,
    }
}

#[cfg(test)]
mod tests;

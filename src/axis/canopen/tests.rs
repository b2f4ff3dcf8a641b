//! What frames and writes do, and who may send them.

use puente_canopen::nmt::Command;
use puente_line::Duration;

use super::*;
use crate::axis::{AxisSpec, DriveSpec};
use crate::desk::{BusSpec, Desk, Holder, Units};

const U: u8 = 2;

fn node(id: u8) -> NodeId {
    NodeId::new(id).expect("a node")
}

fn by(number: u32) -> Commander {
    Commander { seat: number as u8, holder: Holder::Connection(number) }
}

/// Axes u and v on bus 0, nodes 2 and 3.
fn axes(sync: bool) -> Axes {
    let desk: &'static Desk = Box::leak(Box::new(const { Desk::new() }));
    let spec =
        BusSpec { units: Units::default(), queue_timeout: Duration::ZERO, reply_timeout: Duration::ZERO };
    desk.configure([spec], Duration::from_secs(60));
    desk.add_cyclic(0, 0, Default::default());
    desk.add_cyclic(1, 0, Default::default());
    let axis = |name: &str, address| AxisSpec {
        name: name.try_into().expect("a name"),
        bus: 0,
        bus_name: "can".try_into().expect("a name"),
        address,
        drive: DriveSpec::Cia402(cia402::Spec { profile: &Profile::LEXIUM_23A, sync, cyclic: None }),
    };
    Axes::new(desk, [axis("u", 2), axis("v", 3)])
}

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::new(puente_canopen::Id::base(id), data).expect("a frame")
}

fn of(frame: &Frame) -> Option<Effect> {
    let spec = cia402::Spec { profile: &Profile::LEXIUM_23A, sync: false, cyclic: None };
    effect(Function::of(frame.id())?, frame, node(U), spec)
}

#[test]
fn controlwords() {
    for (word, expected) in [
        (0x00_u16, Effect::Stop),
        (0x02, Effect::Stop),
        (0x06, Effect::Stop),
        (0x0B, Effect::Stop),
        (0x07, Effect::Act),
        (0x80, Effect::Act),
        (0x0F, Effect::Motion),
        (0x8F, Effect::Motion),
        (0x1F, Effect::Motion),
        (0x10F, Effect::Motion),
    ] {
        let [low, high] = word.to_le_bytes();
        assert_eq!(controlled(low, high), expected, "{word:04X}");
        assert_eq!(of(&frame(0x202, &[low, high])), Some(expected), "{word:04X}");
        assert_eq!(of(&frame(0x602, &[0x2B, 0x40, 0x60, 0, low, high, 0, 0])), Some(expected), "{word:04X}");
    }
}

#[test]
fn frames() {
    for (id, data, expected) in [
        (0x402_u16, &[0x0F, 0, 1, 0, 0, 0][..], Some(Effect::Motion)),
        (0x402, &[0x06, 0, 1, 0, 0, 0], Some(Effect::Stop)),
        (0x202, &[0x06], Some(Effect::Motion)),
        (0x203, &[0x0F, 0], None),
        (0x602, &[0x40, 0x40, 0x60, 0, 0, 0, 0, 0], None),
        (0x602, &[0x23, 0x7A, 0x60, 0, 1, 0, 0, 0], Some(Effect::Motion)),
        (0x602, &[0x2F, 0x60, 0x60, 0, 3, 0, 0, 0], Some(Effect::Motion)),
        (0x602, &[0x23, 0x83, 0x60, 0, 1, 0, 0, 0], Some(Effect::Act)),
        (0x602, &[0x21, 0x40, 0x60, 0, 2, 0, 0, 0], Some(Effect::Motion)),
        (0x602, &[0xC6, 0xFF, 0x60, 0, 4, 0, 0, 0], Some(Effect::Motion)),
        (0x000, &[0x81, 2], Some(Effect::Act)),
        (0x000, &[0x81, 0], Some(Effect::Act)),
        (0x000, &[0x81, 3], None),
        (0x7E5, &[4, 1, 0, 0, 0, 0, 0, 0], Some(Effect::Act)),
        (0x100, &[0; 6], None),
        (0x123, &[1], None),
    ] {
        assert_eq!(of(&frame(id, data)), expected, "{id:03X} {data:02X?}");
    }
}

#[test]
fn another_commander_is_refused_and_stops_are_not() {
    let axes = axes(false);
    let enable = frame(0x202, &[0x0F, 0]);
    let ruling = axes.judge_can(by(1), 0, &enable).expect("a lease");
    axes.frame_ended(&ruling.permits, true);
    assert_eq!((ruling.permits.len(), ruling.stop), (1, false));
    for refused in [
        enable,
        frame(0, &[0x02, 2]),
        Command::ResetNode.frame(None),
        frame(0x602, &[0x2F, 0x98, 0x60, 0, 35]),
    ] {
        let refusal = axes.judge_can(by(2), 0, &refused).err();
        // A request that is cut short is none.
        let short = refused.length() < 8 && refused.id() == puente_canopen::Id::base(0x602);
        assert_eq!(matches!(refusal, Some(CanRefusal::Leased(_))), !short, "{refused:?}");
    }
    assert!(axes.judge_sdo(by(2), 0, node(2), Address { index: 0x6098, sub: 0 }, &[35]).is_err());
    // The other axis is free.
    let other = axes.judge_can(by(2), 0, &frame(0x203, &[0x0F, 0])).expect("a lease");
    axes.frame_ended(&other.permits, false);
    let stop = axes.judge_can(by(2), 0, &frame(0x202, &[0x02, 0])).expect("allowed");
    assert!(stop.stop && stop.permits.is_empty());
    assert_eq!(axes.leased(0), None);
    assert!(axes.desk.owes(0), "the gateway stops it, too");
}

#[test]
fn writes_of_objects() {
    let axes = axes(false);
    let judge = |id, index, data: &[u8]| axes.judge_sdo(by(1), 0, node(id), Address { index, sub: 0 }, data);
    assert!(matches!(judge(5, 0x6040, &[0x0F, 0]).map(|ruling| ruling.class), Ok(Class::Free)), "no axis");
    assert!(matches!(judge(2, 0x6083, &[1, 0, 0, 0]).map(|ruling| ruling.class), Ok(Class::Guarded(_))));
    assert!(matches!(judge(2, 0x6040, &[0x02, 0]).map(|ruling| ruling.class), Ok(Class::Stop)));
    let motion = judge(2, 0x60FF, &[1, 0, 0, 0]).expect("a lease");
    assert!(matches!(motion.class, Class::Motion(_)));
    axes.raw_ended(&motion, false);
    assert_eq!(axes.leased(0), None, "it was not sent");
}

#[test]
fn what_is_nobodys_to_send() {
    let reserved =
        |axes: &Axes, frame: &Frame| matches!(axes.judge_can(by(1), 0, frame), Err(CanRefusal::Reserved));
    let (free, with_sync) = (axes(false), axes(true));
    let sync = frame(0x080, &[]);
    assert!(reserved(&with_sync, &sync) && !reserved(&free, &sync));
    for id in [0x082, 0x182, 0x582, 0x702] {
        assert!(reserved(&free, &frame(id, &[0; 8])), "{id:03X}");
        assert!(!reserved(&free, &frame(id + 3, &[0; 8])), "{id:03X} of another node");
        let remote = Frame::remote(puente_canopen::Id::base(id), 0);
        assert_eq!(reserved(&free, &remote), id == 0x702, "{id:03X}");
    }
}

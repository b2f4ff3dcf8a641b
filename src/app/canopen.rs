//! What the settings say of CANopen buses, as those take it who work with it.

use core::marker::PhantomData;

use heapless::Vec;
use puente_canopen::boot::{Plan, Signs};
use puente_canopen::dcf::{self, Entry, List};
use puente_canopen::lss::Known;
use puente_canopen::manager::{Config, Member, babble_limit};
use puente_canopen::monitor::Supervision;
use puente_canopen::{NodeId, sdo, sync};
use puente_drives::cia402::homing::Method;
use puente_drives::cia402::object::{HOMING_ACCELERATION, MAX_PROFILE_VELOCITY};
use puente_line::Duration;
use puente_servos::{Axis, Homing, setup};
use static_cell::{ConstStaticCell, StaticCell};

use super::{DESK, millis};
use crate::axis::cia402;
use crate::bus::canopen::{Room, Setup};
use crate::desk::{BusImage, CanBus, CanSpec, Servos};
use crate::port::limits::{AXES, CANOPEN, NODES, WRITES};
use crate::settings::{self, AXIS_HEARTBEAT_MS, Bus, Canopen, Cia402, Drive, Node, Settings};

/// Bytes of a value as it is listed for a node: index, sub-index, size, and the longest value.
const ENTRY: usize = 3 + 4 + 8;
/// Bytes of what is written to an axis' node: its PDOs, with a cyclic mode or without, its homing, and two values more.
const AXIS: usize = 254;
/// Bytes of what is written to one node, and to all of them; before each list there is its length.
const MOST: usize = 4 + WRITES * ENTRY + AXIS;
const ALL: usize = AXES * (4 + AXIS + setup::MOST_WATCH) + NODES * (4 + WRITES * ENTRY);

static ROOMS: [StaticCell<Room>; CANOPEN] = [const { StaticCell::new() }; CANOPEN];
static LISTS: ConstStaticCell<[u8; ALL]> = ConstStaticCell::new([0; ALL]);

/// Makes a manager for each CANopen bus, and adds it to the desk.
#[inline(never)]
pub(super) fn add(settings: &Settings) {
    let mut lists: &'static mut [u8] = LISTS.take();
    let buses = (0..).zip(&settings.buses).filter_map(|(index, bus)| Some((index, bus, bus.canopen()?)));
    for (room, (index, bus, canopen)) in ROOMS.iter().zip(buses) {
        let Some(node) = NodeId::new(canopen.node) else { continue };
        let room = room.init_with(|| Room::new(config(node, canopen)));
        let axes = axes_of(settings, bus).filter_map(|(_, axis, cia402)| drive(axis, cia402));
        room.join(members_of(settings, bus, canopen, &mut lists), axes);
        DESK.add_can(CanSpec { bus: index, net: canopen.net, bitrate: canopen.bitrate, room });
    }
}

/// What the pump of a CANopen bus works with.
pub struct Parts {
    /// Clients,
    pub clients: CanBus<'static>,
    /// axes,
    pub image: BusImage<'static, Servos>,
    /// and how it works.
    pub setup: Setup,
}

/// What the pump of a CANopen bus works with; none where the bus is none.
pub fn canopen(settings: &Settings, index: u8) -> Option<Parts> {
    let bus = settings.buses.get(usize::from(index))?;
    let canopen = bus.canopen()?;
    let clients = CanBus::new(&DESK, index)?;
    let room = clients.room()?;
    let axes = axes_of(settings, bus).map(|(id, ..)| id).collect();
    let image = BusImage { desk: &DESK, bus: index, axes, kind: PhantomData };
    Some(Parts { clients, image, setup: Setup { room, sdo_timeout: millis(canopen.sdo_timeout_ms.into()) } })
}

fn config(node: NodeId, canopen: &Canopen) -> Config {
    Config {
        sync: Duration::from_micros(canopen.sync_us.into()),
        overflow: sync::Overflow::new(canopen.sync_overflow),
        heartbeat: millis(canopen.heartbeat_ms.into()),
        sdo: sdo::Config { timeout: millis(canopen.sdo_timeout_ms.into()), ..sdo::Config::DEFAULT },
        babble: babble_limit(canopen.bitrate),
        ..Config::new(node)
    }
}

/// The axes of a bus with their numbers.
fn axes_of<'s>(
    settings: &'s Settings,
    bus: &'s Bus,
) -> impl Iterator<Item = (u8, &'s settings::Axis, &'s Cia402)> {
    (0..).zip(&settings.axes).filter_map(|(id, axis)| match &axis.drive {
        Drive::Cia402(cia402) if axis.bus == bus.name => Some((id, axis, cia402)),
        _ => None,
    })
}

/// What the axis of a drive on this bus goes by.
pub(super) fn axis(settings: &Settings, bus: u8, cia402: &Cia402) -> cia402::Spec {
    let canopen = settings.buses.get(usize::from(bus)).and_then(Bus::canopen);
    let sync = canopen.is_some_and(|canopen| canopen.sync_us > 0);
    cia402::Spec { profile: cia402.profile, sync, cyclic: cia402.cyclic }
}

/// The drive of an axis.
fn drive(axis: &settings::Axis, cia402: &Cia402) -> Option<Axis> {
    let homing = Homing {
        method: cia402.homing.and_then(Method::new),
        fast: cia402.homing_fast,
        slow: cia402.homing_slow,
    };
    Some(Axis { homing, cyclic: cia402.cyclic, ..Axis::new(NodeId::new(axis.address)?, cia402.profile) })
}

/// The nodes that are booted and watched: those of axes, and the others of which the settings say something.
fn members_of<'s>(
    settings: &'s Settings,
    bus: &'s Bus,
    canopen: &'s Canopen,
    lists: &'s mut &'static mut [u8],
) -> impl Iterator<Item = Member<'static>> {
    let axes = move || axes_of(settings, bus);
    let nodes = move || settings.nodes.iter().filter(|node| node.bus == bus.name);
    let of_axes = axes().map(|(_, axis, _)| axis.address);
    let others = nodes().map(|node| node.id).filter(move |id| axes().all(|(_, axis, _)| axis.address != *id));
    of_axes.chain(others).filter_map(move |id| {
        let axis = axes().find(|(_, axis, _)| axis.address == id).map(|(_, axis, cia402)| (axis, cia402));
        let usual = || Node::new(bus.name.clone(), id);
        let node = nodes().find(|node| node.id == id).cloned().unwrap_or_else(usual);
        member(&node, axis, canopen, lists)
    })
}

fn member(
    node: &Node,
    axis: Option<(&settings::Axis, &Cia402)>,
    canopen: &Canopen,
    lists: &mut &'static mut [u8],
) -> Option<Member<'static>> {
    let sync = Duration::from_micros(canopen.sync_us.into());
    let heartbeat =
        node.heartbeat_ms.or_else(|| (axis.is_some() && node.guard_ms == 0).then_some(AXIS_HEARTBEAT_MS));
    let (signs, supervision) = match (node.guard_ms, heartbeat) {
        (0, None) => (Signs::Unchanged, Supervision::Off),
        (0, Some(0)) => (Signs::Heartbeat(0), Supervision::Off),
        (0, Some(ms)) => {
            let timeout = millis(lost_after(ms).into());
            (Signs::Heartbeat(ms), Supervision::Heartbeat { timeout })
        }
        (ms, _) => {
            let (time, factor) = (millis(ms.into()), node.life_factor);
            (Signs::Guarding { time: ms, factor }, Supervision::Guarding { time, factor })
        }
    };
    let plan = Plan {
        device_type: node.device_type,
        identity: Known {
            vendor: node.vendor,
            product: node.product,
            revision: node.revision,
            serial: node.serial,
        },
        configuration: list(node, axis, sync, lists),
        wishes: axis.and_then(|_| watch(canopen, lists)).unwrap_or(List::EMPTY),
        signs,
        starts: node.start,
    };
    Some(Member { plan, supervision, optional: node.optional, ..Member::new(NodeId::new(node.id)?) })
}

/// What is written to a node: what the settings say of it, then what its axis needs.
#[inline(never)]
fn list(
    node: &Node,
    axis: Option<(&settings::Axis, &Cia402)>,
    sync: Duration,
    lists: &mut &'static mut [u8],
) -> List<'static> {
    let mut list = Vec::<u8, MOST>::new();
    let written = writes(&mut list, node, axis, sync);
    written.ok().and_then(|()| keep(&list, lists)).unwrap_or_else(|| {
        // There is room for the longest.
        log::error!("node {} of \"{}\": no room for what is written to it", node.id, node.bus);
        List::EMPTY
    })
}

/// What makes the drive of an axis stop when this gateway is gone.
fn watch(canopen: &Canopen, lists: &mut &'static mut [u8]) -> Option<List<'static>> {
    let timeout = lost_after(canopen.heartbeat_ms);
    let manager = NodeId::new(canopen.node).filter(|_| timeout > 0)?;
    let mut list = Vec::<u8, { setup::MOST_WATCH }>::new();
    setup::push_watch(&mut list, manager, timeout).ok()?;
    keep(&list, lists)
}

/// Who sends a heartbeat so often is lost after this, ms: one may be missing, and the next be late.
const fn lost_after(heartbeat_ms: u16) -> u16 {
    let ms = heartbeat_ms as u32 * 5 / 2;
    if ms > u16::MAX as u32 { u16::MAX } else { ms as u16 }
}

/// Puts a list where it stays.
fn keep(list: &[u8], lists: &mut &'static mut [u8]) -> Option<List<'static>> {
    let (place, rest) = core::mem::take(lists).split_at_mut_checked(list.len())?;
    place.copy_from_slice(list);
    *lists = rest;
    List::parse(place).ok()
}

fn writes(
    list: &mut Vec<u8, MOST>,
    node: &Node,
    axis: Option<(&settings::Axis, &Cia402)>,
    sync: Duration,
) -> Result<(), dcf::Full> {
    for write in &node.writes {
        let (bytes, length) = write.value.bytes();
        let data = bytes.get(..length).unwrap_or_default();
        dcf::push(list, Entry { address: write.address, data })?;
    }
    let Some((axis, cia402)) = axis else { return Ok(()) };
    if let Some(drive) = drive(axis, cia402) {
        setup::push(list, &drive, sync)?;
    }
    let own =
        [(HOMING_ACCELERATION, cia402.homing_acceleration), (MAX_PROFILE_VELOCITY, cia402.max_velocity)];
    for (object, value) in own {
        if let Some(value) = value {
            dcf::push(list, Entry { address: object.address, data: &value.to_le_bytes() })?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(text: &str) -> Settings {
        let settings: Settings = toml::from_str(text).expect("a document");
        assert_eq!(settings.check(), Ok(()));
        settings
    }

    const TEXT: &str = r#"
        [[bus]]
        name = "can"
        protocol = "canopen"
        port = "sim"
        sync_us = 2000
        sync_overflow = 10
        [[axis]]
        name = "u"
        bus = "can"
        drive = "cia402"
        profile = "festo-cmms"
        address = 2
        homing = 1
        homing_fast = 1
        homing_slow = 1
        homing_acceleration = 1
        max_velocity = 1
        [[axis]]
        name = "v"
        bus = "can"
        drive = "cia402"
        address = 3
        [[node]]
        bus = "can"
        id = 2
        optional = true
        heartbeat_ms = 40
        vendor = 7
        writes = [["0x2000", 1, "u16", 258]]
        [[node]]
        bus = "can"
        id = 5
        guard_ms = 100
        start = false
        [[node]]
        bus = "can"
        id = 6
    "#;

    #[test]
    fn axes_and_nodes_are_members_once_each() {
        let settings = settings(TEXT);
        let bus = &settings.buses[0];
        let canopen = bus.canopen().expect("a CANopen bus");
        let mut lists: &'static mut [u8] = Box::leak(Box::new([0; ALL]));
        let members: std::vec::Vec<_> = members_of(&settings, bus, canopen, &mut lists).collect();
        let ids: std::vec::Vec<_> = members.iter().map(|member| member.id.value()).collect();
        assert_eq!(ids, [2, 3, 5, 6]);
        let [u, v, guarded, plain] = &members[..] else { panic!("four") };
        assert_eq!((u.optional, u.plan.identity.vendor, u.plan.starts), (true, Some(7), true));
        assert_eq!((u.plan.signs, v.plan.signs), (Signs::Heartbeat(40), Signs::Heartbeat(200)));
        assert_eq!(u.supervision, Supervision::Heartbeat { timeout: Duration::from_millis(100) });
        let time = Duration::from_millis(100);
        assert_eq!(guarded.supervision, Supervision::Guarding { time, factor: 3 });
        assert_eq!(
            (guarded.plan.signs, guarded.plan.starts),
            (Signs::Guarding { time: 100, factor: 3 }, false)
        );
        assert_eq!((plain.supervision, plain.plan.signs), (Supervision::Off, Signs::Unchanged));
        assert_eq!(plain.plan.configuration.entries().count(), 0);
        // What the settings say comes first, what the axis has of its own last.
        let written: std::vec::Vec<_> = u.plan.configuration.entries().collect();
        assert_eq!((written[0].address.index, written[0].data), (0x2000, &[2, 1][..]));
        let last = written.last().expect("something");
        assert_eq!((last.address, last.data), (MAX_PROFILE_VELOCITY.address, &[1, 0, 0, 0][..]));
        assert!(written.iter().any(|entry| entry.address.index == 0x1800), "its PDOs are switched on");
        assert!(v.plan.configuration.entries().count() > 0);
        let config = config(NodeId::MAX, canopen);
        assert_eq!(config.sync, Duration::from_millis(2));
        assert_eq!(config.overflow.map(sync::Overflow::last), Some(10));
    }

    /// As much as any axis can have, whatever the drive.
    #[test]
    fn there_is_room_for_what_is_written_to_an_axis() {
        for profile in puente_drives::cia402::Profile::ALL {
            let text = TEXT.replace("festo-cmms", profile.name);
            let settings = settings(&text.replace("max_velocity = 1", "max_velocity = 1\ncyclic = \"ip\""));
            let (_, axis, cia402) = axes_of(&settings, &settings.buses[0]).next().expect("an axis");
            let mut list = Vec::<u8, MOST>::new();
            let node = Node::new("can".parse().expect("a name"), 2);
            assert!(writes(&mut list, &node, Some((axis, cia402)), Duration::from_millis(2)).is_ok());
            assert!(list.len() <= 4 + AXIS, "{} needs {}", profile.name, list.len());
        }
    }
}

//! What happens when drives boot.

use std::time::Duration;

use puente_canopen::boot::Plan;
use puente_canopen::lss::Known;
use puente_drives::cia402::{Mode, Profile};
use puente_servos::{Node, Order, Progress, Why, setup};

use crate::device::Device;
use crate::rig::{Rig, axis, cyclic};

/// Thesis, 6.4.1: `602, 8, 23 - 00 - 14 - 01 - 02 - 02 - 00 - 40` and `602, 8, 23 - 00 - 18 - 01 - 82 - 01 - 00 - 40`.
#[test]
fn pdos_are_switched_on_as_in_the_thesis() {
    let mut rig = Rig::new(&[axis(2, &Profile::LEXIUM_23A)], Duration::ZERO);
    rig.run_ms(200);
    let told = rig.told(0x602);
    for frame in
        [[0x23, 0x00, 0x14, 0x01, 0x02, 0x02, 0x00, 0x40], [0x23, 0x00, 0x18, 0x01, 0x82, 0x01, 0x00, 0x40]]
    {
        let of_this = |told: &&Vec<u8>| told[0] != 0x40 && told[1..4] == frame[1..4];
        assert_eq!(told.iter().filter(of_this).collect::<Vec<_>>(), [&frame.to_vec()], "once, and no more");
    }
    assert_eq!(rig.devices[0].get(0x1802, 3), 200);
    assert_eq!(rig.devices[0].get(0x1802, 5), 200);
    assert_eq!(rig.devices[0].nmt, 5);
    assert_eq!(rig.report(0).node, Node::Present);
    assert_eq!(rig.report(0).position, Some(0));
    assert!(rig.devices[0].words.is_empty(), "nothing is commanded");
}

#[test]
fn the_set_point_of_a_cyclic_mode_is_alone_in_rpdo_4() {
    let sync = Duration::from_millis(2);
    let rig = Rig::new(&[cyclic(3, Mode::InterpolatedPosition), cyclic(4, Mode::CyclicTorque)], sync).boot();
    let [ip, torque] = &rig.devices[..] else { panic!("two") };
    assert_eq!((ip.get(0x1603, 0), ip.get(0x1603, 1) as u32), (1, 0x60C1_0120));
    assert_eq!((ip.get(0x1403, 1) as u32, ip.get(0x1403, 2)), (0x4000_0503, 1));
    assert_eq!((ip.get(0x60C2, 1), ip.get(0x60C2, 2)), (2, -3));
    assert_eq!((ip.get(0x1802, 1) as u32, ip.get(0x1802, 2)), (0x4000_0383, 1));
    assert_eq!(ip.get(0x1803, 1) as u32, 0xC000_0483);
    assert_eq!((torque.get(0x1603, 0), torque.get(0x1603, 1) as u32), (1, 0x6071_0010));
    let remap: Vec<_> = ip.written.iter().filter(|(index, ..)| matches!(index, 0x1403 | 0x1603)).collect();
    let order: Vec<_> = remap.iter().map(|(index, sub, _)| (*index, *sub)).collect();
    assert_eq!(order, [(0x1403, 1), (0x1603, 0), (0x1603, 1), (0x1603, 0), (0x1403, 2), (0x1403, 1)]);
}

/// 60C1h:2 is written before anything of 60C1h:1.
#[test]
fn a_festo_is_told_that_set_points_are_absolute() {
    let cyclic =
        puente_servos::Axis { cyclic: Some(Mode::InterpolatedPosition), ..axis(5, &Profile::FESTO_CMMS) };
    let mut rig = Rig::new(&[cyclic], Duration::from_millis(1)).boot();
    rig.reach(0, Order::Hold);
    let device = &rig.devices[0];
    assert_eq!((device.get(0x60C0, 0), device.get(0x60C1, 2)), (-2, 0));
    assert_eq!(device.get(0x1802, 5), 0, "it has no event timers");
    assert!(!device.written.iter().any(|(index, ..)| *index == 0x60C2), "that counts after a reset only");
}

#[test]
fn a_period_that_cannot_be_changed_must_be_that_of_sync() {
    let cyclic =
        puente_servos::Axis { cyclic: Some(Mode::InterpolatedPosition), ..axis(5, &Profile::FESTO_CMMS) };
    let mut rig = Rig::new(&[cyclic], Duration::from_millis(4));
    rig.run_ms(300);
    let (expected, received) = (Duration::from_millis(4), Some(Duration::from_millis(1)));
    assert_eq!(rig.report(0).node, Node::Period { expected, received });
}

#[test]
fn the_longest_setup_fits() {
    let homing = puente_servos::Homing {
        method: puente_drives::cia402::homing::Method::new(17),
        fast: Some(1),
        slow: Some(1),
    };
    for profile in Profile::ALL {
        for mode in [None, Some(Mode::InterpolatedPosition), Some(Mode::CyclicTorque)] {
            let axis = puente_servos::Axis { cyclic: mode, homing, ..axis(2, profile) };
            let mut list: heapless::Vec<u8, { setup::MOST }> = heapless::Vec::new();
            assert_eq!(setup::push(&mut list, &axis, Duration::from_millis(1)), Ok(()));
        }
    }
}

#[test]
fn what_is_no_such_drive_takes_no_orders() {
    let mut io = Device::new(2);
    io.put(0x1000, 0, 0x0191);
    let mut lacking = Device::new(3);
    lacking.objects.remove(&(0x6061, 0));
    let mut modes = Device::new(4);
    modes.put(0x6502, 0, 0x01);
    let good = Device::new(5);
    let axes = [2, 3, 4, 5].map(|id| axis(id, &Profile::LEXIUM_23A));
    let mut rig = Rig::with(&axes, Duration::ZERO, vec![io, lacking, modes, good], |plan| plan);
    rig.run_ms(500);
    let said: Vec<_> = (0..4).map(|place| rig.report(place).node.to_string()).collect();
    let expected = [
        "refused: no drive: its device profile is 401, not 402",
        "refused: object 6061h:0 is missing",
        "refused: it does not have the mode pv",
        "present",
    ];
    assert_eq!(said, expected);
    rig.set(0, Order::Hold);
    rig.reach(3, Order::Hold);
    assert_eq!(rig.fell, [(0, Why::NotPresent)]);
    assert!(rig.devices[0].words.is_empty());
}

#[test]
fn a_wrong_identity_holds_nobody_else_up() {
    let axes = [axis(2, &Profile::GENERIC), axis(3, &Profile::GENERIC)];
    let devices = vec![Device::new(2), Device::new(3)];
    let mut vendors = [0x81, 0x80].into_iter();
    let mut rig = Rig::with(&axes, Duration::ZERO, devices, |plan: Plan<'static>| Plan {
        identity: Known { vendor: vendors.next(), ..Known::default() },
        ..plan
    });
    rig.run_ms(300);
    assert!(matches!(rig.report(0).node, Node::Refused(_)), "{:?}", rig.report(0).node);
    rig.set(0, Order::Hold);
    rig.reach(1, Order::Hold);
    assert_eq!(rig.progress(0), Progress::Idle);
    assert_eq!(rig.fell, [(0, Why::NotPresent)]);
    assert!(rig.devices[0].words.is_empty());
    assert_eq!(rig.devices[0].nmt, 127, "it is not started");
}

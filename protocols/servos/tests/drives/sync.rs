//! Set-points with every SYNC.

use std::time::Duration;

use puente_canopen::sdo::Transfer;
use puente_canopen::{Address, Id, manager};
use puente_drives::cia402::Mode;
use puente_servos::{Failure, Motion, Order, Progress};

use crate::rig::{Rig, cyclic};

const PERIOD: Duration = Duration::from_millis(2);

fn follow(mode: Mode) {
    let mut rig = Rig::new(&[cyclic(2, mode), cyclic(3, mode)], PERIOD).boot();
    rig.devices[0].put(0x6064, 0, 4_000);
    rig.run_ms(10);
    rig.sent.clear();
    rig.reach(0, Order::Move(Motion::Interpolate(4_000)));
    rig.reach(1, Order::Move(Motion::Interpolate(0)));
    assert_eq!(rig.devices[0].position(), 4_000);
    let set_points = rig.told(0x502);
    assert!(set_points.iter().all(|data| data[..] == [0xA0, 0x0F, 0, 0]), "{set_points:?}");
    rig.sent.clear();
    for target in (4_000..4_500).step_by(10) {
        rig.set(0, Order::Move(Motion::Interpolate(target)));
        rig.set(1, Order::Move(Motion::Interpolate(target - 4_000)));
        rig.run(PERIOD);
    }
    // One of each axis after each SYNC, in order, and nothing between.
    let raw: Vec<_> = rig.sent.iter().map(|(at, frame)| (*at, frame.id().raw())).collect();
    let syncs: Vec<_> = (0..raw.len()).filter(|at| raw[*at].1 == 0x80).collect();
    assert_eq!(syncs.len(), 50);
    for at in syncs {
        let ids: Vec<_> = raw[at..].iter().take(3).map(|(_, id)| *id).collect();
        assert_eq!(ids, [0x80, 0x502, 0x503]);
        assert!(raw[at..at + 3].iter().all(|(when, _)| *when == raw[at].0), "at once");
    }
    let here = rig.devices[0].position();
    assert!((4_460..=4_490).contains(&here), "{here}");
    rig.reach(0, Order::Hold);
    let here = rig.devices[0].position();
    rig.run_ms(50);
    assert_eq!(rig.devices[0].position(), here);
    rig.reach(0, Order::Move(Motion::Interpolate(here)));
    rig.run_ms(50);
    assert_eq!(rig.devices[0].position(), here, "not to where it was to go before");
    assert_eq!(rig.master.counters().late, 0);
}

#[test]
fn interpolated_position() {
    follow(Mode::InterpolatedPosition);
}

#[test]
fn cyclic_position() {
    follow(Mode::CyclicPosition);
}

/// A stop does not wait for SYNC, and what waits for SYNC does not undo it.
#[test]
fn a_stop_comes_before_sync() {
    let mut rig = Rig::new(&[cyclic(2, Mode::CyclicPosition)], PERIOD).boot();
    rig.reach(0, Order::Move(Motion::Interpolate(0)));
    rig.now += Duration::from_micros(50);
    rig.run(PERIOD);
    rig.sent.clear();
    rig.set(0, Order::Stop);
    let asked = rig.now;
    rig.run(PERIOD * 5);
    assert_eq!(rig.sent[0].1.id(), Id::base(0x202));
    assert_eq!(rig.sent[0].1.data(), [0x02, 0]);
    assert!(rig.sent[0].0.since(asked) <= Duration::from_micros(100), "{:?}", rig.sent[0]);
    assert!(rig.told(0x502).is_empty());
    assert_eq!(rig.devices[0].power.state, "quick stop");
}

#[test]
fn a_cyclic_mode_needs_sync_and_its_own_pdo() {
    let mut rig = Rig::new(&[cyclic(2, Mode::InterpolatedPosition)], Duration::ZERO).boot();
    rig.set(0, Order::Move(Motion::Interpolate(0)));
    rig.run_ms(20);
    assert_eq!(rig.progress(0), Progress::Failed(Failure::NoSync));
    let mut rig = Rig::new(&[cyclic(2, Mode::CyclicVelocity)], PERIOD).boot();
    rig.set(0, Order::Move(Motion::Interpolate(0)));
    rig.run_ms(20);
    assert_eq!(rig.progress(0), Progress::Failed(Failure::NoMode(Mode::InterpolatedPosition)));
    assert!(!rig.devices[0].is_enabled());
}

/// A client that asks again and again does not keep the drive from its own transfers, nor the other way round.
#[test]
fn a_client_and_the_drive_take_turns() {
    let mut rig = Rig::new(&[cyclic(2, Mode::InterpolatedPosition)], PERIOD).boot();
    let node = rig.devices[0].id;
    let node = puente_canopen::NodeId::new(node).expect("a node-ID");
    let transfer = Transfer::Upload { address: Address::new(0x1000, 0), block: false };
    rig.set(0, Order::Move(Motion::Velocity(20)));
    rig.manager.clear();
    for _ in 0..3_000 {
        let _ = rig.master.submit(rig.now, node, transfer);
        rig.run(Duration::from_micros(100));
    }
    assert_eq!(rig.devices[0].speed, 20);
    let done = rig
        .manager
        .iter()
        .filter(|action| matches!(action, manager::Action::Sdo(_, manager::Sdo::Done(Ok(_)))));
    assert!(done.count() > 200);
}

//! What goes wrong, and that nothing moves by itself afterwards.

use std::time::Duration;

use puente_canopen::{Frame, Id};
use puente_drives::cia402::{Profile, State};
use puente_servos::{Motion, Node, Order, Progress, Why};

use crate::rig::{Rig, axis};

const RUN: Order = Order::Move(Motion::Velocity(20));

fn rig(count: u8) -> Rig {
    let axes: Vec<_> = (2..2 + count).map(|id| axis(id, &Profile::LEXIUM_23A)).collect();
    Rig::new(&axes, Duration::ZERO).boot()
}

/// All run, and have nothing else in mind.
fn running(count: u8) -> Rig {
    let mut rig = rig(count);
    for place in 0..usize::from(count) {
        rig.reach(place, RUN);
    }
    rig
}

/// Nothing moves it, until something else has been wanted.
fn stays(rig: &mut Rig, place: usize) {
    rig.set(place, RUN);
    rig.set(place, Order::Hold);
    rig.run_ms(100);
    assert_eq!(rig.master.order(place), Order::Observe);
    assert!(!rig.devices[place].is_enabled());
}

#[test]
fn a_stop_is_sent_at_once_and_lasts() {
    let mut rig = running(1);
    rig.sent.clear();
    rig.set(0, Order::Stop);
    rig.poll();
    assert_eq!(rig.told(0x202), [[0x02, 0]]);
    assert_eq!(rig.sent.len(), 1, "before everything else");
    rig.run_ms(50);
    assert_eq!((rig.progress(0), rig.report(0).state()), (Progress::Reached, Some(State::QuickStopActive)));
    rig.run_ms(5_000);
    assert_eq!((rig.devices[0].power.state, rig.devices[0].speed), ("quick stop", 0));
    rig.reach(0, RUN);
    let numbers = &rig.devices[0].power.numbers;
    assert_eq!(numbers[numbers.len() - 5..], [11, 12, 2, 3, 4], "by way of switch on disabled");
}

/// Where it never says that it stands.
#[test]
fn a_quick_stop_that_never_ends_can_be_left() {
    let mut rig = running(1);
    rig.devices[0].secretive = true;
    rig.reach(0, Order::Stop);
    rig.set(0, Order::Off);
    rig.run_ms(1_000);
    assert_eq!(rig.devices[0].power.state, "quick stop");
    rig.run_ms(1_500);
    assert_eq!((rig.devices[0].power.state, rig.progress(0)), ("switch on disabled", Progress::Reached));
}

#[test]
fn a_fault_is_told_and_reset_on_command_only() {
    let mut rig = running(2);
    rig.devices[0].fail(0x8611);
    rig.run_ms(20);
    assert_eq!(rig.fell, [(0, Why::Fault(Some(0x8611)))]);
    let report = rig.report(0);
    assert_eq!(
        (report.fault, report.emergency.map(|emergency| emergency.code)),
        (Some(0x8611), Some(0x8611))
    );
    stays(&mut rig, 0);
    rig.set(0, Order::Off);
    rig.run_ms(100);
    assert_eq!(rig.devices[0].power.state, "fault");
    rig.reach(0, Order::Reset { serial: 1 });
    assert_eq!(rig.devices[0].power.state, "switch on disabled");
    assert_eq!(rig.report(0).fault, None);
    rig.reach(0, RUN);
    assert_eq!(rig.progress(1), Progress::Reached, "the other has gone on");
    assert_eq!(rig.devices[1].speed, 20);
}

/// The cause is still there: another attempt is another number.
#[test]
fn a_fault_that_stays_is_reset_again_when_asked() {
    let mut rig = rig(1);
    rig.devices[0].fail(0x3210);
    rig.devices[0].power.broken = true;
    rig.run_ms(20);
    rig.set(0, Order::Reset { serial: 1 });
    rig.run_ms(6_000);
    assert!(matches!(rig.progress(0), Progress::Failed(_)), "{:?}", rig.progress(0));
    rig.devices[0].power.broken = false;
    rig.run_ms(1_000);
    assert_eq!(rig.devices[0].power.state, "fault", "it does not try by itself");
    rig.reach(0, Order::Reset { serial: 2 });
    assert_eq!(rig.devices[0].power.state, "switch on disabled");
}

/// An emergency that is no fault stops nothing.
#[test]
fn an_emergency_during_a_move_is_reported() {
    let mut rig = running(1);
    rig.devices[0].emergency(0x4310);
    rig.run_ms(5);
    assert_eq!(rig.report(0).emergency.map(|emergency| emergency.code), Some(0x4310));
    assert_eq!((rig.progress(0), rig.fell.len()), (Progress::Reached, 0));
    rig.devices[0].emergency(0);
    rig.run_ms(5);
    assert_eq!(rig.report(0).emergency, None);
}

#[test]
fn a_lost_node_falls_and_does_not_go_on_when_it_is_back() {
    let mut rig = running(2);
    rig.devices[0].dead = true;
    rig.sent.clear();
    rig.run_ms(200);
    assert_eq!(rig.fell, [(0, Why::Lost)]);
    assert_eq!(rig.report(0).node, Node::Lost);
    assert_eq!(rig.told(0x202), [[0x02, 0]], "it is told to stop, in case it hears that");
    rig.set(0, RUN);
    rig.devices[0].dead = false;
    rig.run_ms(2_000);
    assert_eq!(rig.report(0).node, Node::Present);
    assert_eq!(rig.master.order(0), Order::Observe);
    assert_eq!(rig.told(0x202).len(), 1, "nothing was told since");
    assert_eq!((rig.devices[1].speed, rig.fell.len()), (20, 1));
    rig.reach(0, Order::Off);
    rig.reach(0, RUN);
}

#[test]
fn a_node_that_boots_knows_of_nothing() {
    let mut rig = running(2);
    rig.devices[0].boot();
    rig.run_ms(1_000);
    assert_eq!(rig.fell, [(0, Why::Rebooted)]);
    assert_eq!(rig.report(0).node, Node::Present, "it was configured again");
    assert_eq!(rig.devices[0].get(0x1400, 1) as u32, 0x4000_0202);
    stays(&mut rig, 0);
    rig.set(0, Order::Observe);
    rig.reach(0, RUN);
    assert_eq!(rig.devices[1].speed, 20);
}

/// Either would obey, and nobody knows which one reports.
#[test]
fn a_drive_whose_node_id_is_given_twice_is_stopped_and_not_commanded_until_it_boots() {
    let mut rig = running(2);
    rig.sent.clear();
    let second = Frame::full(Id::Base(0x582), [0x43, 0, 0x10, 0, 1, 2, 3, 4]);
    rig.master.receive(rig.now, &second);
    rig.master.receive(rig.now, &second);
    rig.run_ms(200);
    assert_eq!(rig.fell, [(0, Why::NotPresent)]);
    assert_eq!(rig.report(0).node, Node::Duplicate);
    assert_eq!(rig.told(0x202), [[0x02, 0]], "both are told to stop");
    // Lost and back is not one of them gone.
    rig.devices[0].dead = true;
    rig.run_ms(200);
    rig.devices[0].dead = false;
    rig.run_ms(2_000);
    assert_eq!(rig.report(0).node, Node::Duplicate);
    rig.set(0, Order::Off);
    rig.set(0, RUN);
    rig.run_ms(100);
    assert_eq!(rig.devices[0].speed, 0);
    rig.devices[0].boot();
    rig.run_ms(1_000);
    assert_eq!(rig.report(0).node, Node::Present);
    assert_eq!(rig.devices[1].speed, 20);
    rig.set(0, Order::Observe);
    rig.reach(0, RUN);
}

/// A limit switch, a safe torque off, another master.
#[test]
fn a_drive_that_leaves_operation_falls() {
    let mut rig = running(1);
    rig.devices[0].power.state = "switched on";
    rig.run_ms(20);
    assert_eq!(rig.fell, [(0, Why::Left(State::SwitchedOn))]);
    stays(&mut rig, 0);
}

#[test]
fn a_node_that_is_stopped_is_not_operational() {
    let mut rig = running(1);
    rig.devices[0].nmt = 127;
    rig.run_ms(200);
    assert!(matches!(rig.fell[..], [(0, Why::NotOperational(_))]), "{:?}", rig.fell);
}

#[test]
fn when_the_bus_is_off_nothing_is_wanted_any_more() {
    let mut rig = running(2);
    rig.sent.clear();
    rig.cut = true;
    rig.master.bus(rig.now, false);
    rig.run_ms(50);
    assert_eq!(rig.fell, [(0, Why::Bus), (1, Why::Bus)]);
    assert_eq!(rig.sent, []);
    rig.cut = false;
    rig.master.bus(rig.now, true);
    rig.run_ms(50);
    assert_eq!((rig.told(0x202), rig.told(0x203)), (vec![vec![0x02, 0]], vec![vec![0x02, 0]]));
    assert_eq!(rig.devices[0].speed, 0);
    stays(&mut rig, 0);
}

/// Nothing is commanded to what is only observed, and what somebody else has put under current is halted before it is taken over.
#[test]
fn what_another_has_enabled_is_halted_first() {
    let mut rig = rig(1);
    let device = &mut rig.devices[0];
    for word in [0x06, 0x07, 0x0F] {
        device.power.write(word);
    }
    device.put(0x6060, 0, 3);
    device.put(0x6061, 0, 3);
    device.put(0x60FF, 0, 10);
    rig.run_ms(100);
    assert_eq!(
        (rig.devices[0].speed, rig.sent.iter().filter(|(_, frame)| frame.id().raw() == 0x202).count()),
        (10, 0)
    );
    rig.reach(0, Order::Hold);
    assert_eq!((rig.devices[0].speed, rig.devices[0].get(0x60FF, 0)), (0, 0));
    assert_eq!(rig.devices[0].words[0], 0x010F);
}

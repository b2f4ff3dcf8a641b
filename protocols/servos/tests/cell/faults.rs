//! What goes wrong with one drive, while the other goes on.

use std::time::Duration;

use puente_canopen::NodeId;
use puente_cell::can::{DriveFault, Fault, Model};
use puente_drives::cia402::Profile;
use puente_servos::{Axis, Motion, Node, Order, Progress, Why};

use crate::rig::Rig;

const RUN: Order = Order::Move(Motion::Velocity(5_000));

fn running() -> Rig {
    let axes = [1, 2].map(|id| Axis::new(NodeId::new(id).expect("a node-ID"), &Profile::LEXIUM_23A));
    let mut rig = Rig::new(&axes, Model::Lexium23a, Duration::ZERO);
    rig.reach(0, RUN);
    rig.reach(1, RUN);
    rig
}

/// The second drive has not noticed anything, and the first has not moved since.
fn others_go_on(rig: &mut Rig) {
    assert!(rig.velocity(2) > 1_000.0);
    assert_eq!(rig.report(1).progress, Progress::Reached);
    assert!(rig.fell.iter().all(|(place, _)| *place == 0), "{:?}", rig.fell);
    rig.set(0, RUN);
    rig.run_ms(2_000);
    assert!(rig.velocity(1).abs() < 1.0, "it moves by itself");
    assert_eq!(rig.master.order(0), Order::Observe);
}

/// Two and a half heartbeats, and its ramp.
#[test]
fn drives_whose_master_is_gone_stop_by_themselves() {
    let mut rig = running();
    rig.alone_ms(70);
    assert!(rig.velocity(1) > 1_000.0 && rig.velocity(2) > 1_000.0);
    rig.alone_ms(500);
    assert!(rig.velocity(1).abs() < 1.0 && rig.velocity(2).abs() < 1.0);
    // It comes back, and nothing moves by itself.
    rig.run_ms(1_000);
    assert!(rig.velocity(1).abs() < 1.0 && rig.velocity(2).abs() < 1.0);
}

/// Nobody hears it any more, but it hears: the quick stop that it is told reaches it.
#[test]
fn a_node_that_is_lost_is_stopped() {
    let mut rig = running();
    rig.cell.suffer(rig.now, 1, Fault::Mute(true));
    rig.run_ms(300);
    assert_eq!(rig.fell, [(0, Why::Lost)]);
    rig.run_ms(1_000);
    assert!(rig.velocity(1).abs() < 1.0);
    rig.cell.suffer(rig.now, 1, Fault::Mute(false));
    others_go_on(&mut rig);
    rig.set(0, Order::Observe);
    rig.wait(|rig| rig.report(0).node == Node::Present);
    rig.reach(0, RUN);
}

#[test]
fn a_node_that_boots_is_configured_and_does_not_move() {
    let mut rig = running();
    rig.cell.suffer(rig.now, 1, Fault::Reset);
    rig.run_ms(500);
    assert_eq!(rig.fell[0], (0, Why::Rebooted));
    others_go_on(&mut rig);
    rig.set(0, Order::Observe);
    rig.wait(|rig| rig.report(0).node == Node::Present);
    rig.reach(0, RUN);
}

#[test]
fn another_device_in_its_place_is_refused() {
    let mut rig = running();
    rig.cell.suffer(rig.now, 1, Fault::Identity(0x1234));
    rig.cell.suffer(rig.now, 1, Fault::Reset);
    rig.run_ms(500);
    assert!(matches!(rig.report(0).node, Node::Refused(_)), "{}", rig.report(0).node);
    others_go_on(&mut rig);
}

#[test]
fn the_fault_of_a_drive_is_told_with_its_code() {
    let mut rig = running();
    rig.cell.suffer(rig.now, 1, Fault::Drive(DriveFault::OverCurrent));
    rig.run_ms(100);
    assert!(matches!(rig.fell[..], [(0, Why::Fault(_))]), "{:?}", rig.fell);
    let report = rig.report(0);
    assert!(report.fault.is_some_and(|code| code != 0));
    assert_eq!(report.emergency.map(|emergency| emergency.code), report.fault);
    others_go_on(&mut rig);
    rig.reach(0, Order::Reset { serial: 1 });
    rig.reach(0, RUN);
    assert_eq!(rig.report(0).fault, None);
}

#[test]
fn emergencies_during_a_move_are_told_and_the_move_goes_on() {
    let mut rig = running();
    rig.cell.suffer(rig.now, 1, Fault::Emergencies(3));
    rig.run_ms(20);
    assert!(rig.report(0).emergency.is_some());
    assert!(rig.velocity(1) > 1_000.0);
    assert_eq!(rig.fell, []);
}

#[test]
fn a_node_that_is_off_the_bus_is_lost_and_comes_back() {
    let mut rig = running();
    rig.cell.suffer(rig.now, 1, Fault::Die);
    rig.run_ms(300);
    assert_eq!(rig.fell, [(0, Why::Lost)]);
    assert!(rig.velocity(2) > 1_000.0);
    rig.cell.suffer(rig.now, 1, Fault::Reset);
    rig.wait(|rig| rig.report(0).node == Node::Present);
    others_go_on(&mut rig);
}

/// The gateway's own controller: nobody goes on, and each is told to stop when it is back.
#[test]
fn when_the_gateway_is_off_the_bus_all_fall() {
    let mut rig = running();
    rig.master.bus(rig.now, false);
    rig.run_ms(50);
    assert_eq!(rig.fell, [(0, Why::Bus), (1, Why::Bus)]);
    rig.master.bus(rig.now, true);
    rig.run_ms(1_000);
    assert!(rig.velocity(1).abs() < 1.0 && rig.velocity(2).abs() < 1.0);
}

//! Faults of a CAN bus and of what is on it, seen by clients of several axes: what the axis does, what its commander is told,
//! and that the others go on.

mod common;

use common::can::Adapter;
use common::http::insist;
use common::servos::{AXES, Far, Rig, drive, drives, patient};
use common::{ms, until};
use puente_canopen::{Address, NodeId};
use puente_cell::can::{Cell, Fault};
use serde_json::json;

/// The bus is shorted: whoever sends goes off, the gateway first. An adapter tells so by Linux' state lines; or, as Lawicel's,
/// only that it has errors, and then the nodes are lost.
#[test]
fn the_gateways_own_bus_off_is_told_by_every_axis_and_ends_by_itself() {
    for tells in [true, false] {
        let far = Far::new();
        let rig = Rig::start(5_000, "", |document| far.settings(document));
        rig.adapter.device().tells = tells;
        rig.are_present(&AXES);
        let mut commander = rig.turning();
        far.turn(&mut commander);
        let mut events = rig.client();
        for command in ["set network 1", "set events bus 1"] {
            assert_eq!(events.ask(&format!("[1] {command}")), "[1] OK");
        }
        rig.suffer(0, Fault::Short(true));
        if tells {
            rig.is_refused("off", &mut commander);
            until("it is told", || events.line() == "1 0 ERROR 301 #Bus off.");
            let log = rig.gateway.log();
            assert!(log.contains("bus 1: off the bus"), "{log}");
        } else {
            for (axis, _) in AXES {
                rig.becomes(&mut commander, axis, "node", "lost");
                commander.error(&format!("axis {axis} enable"), "lost");
                commander.error(&format!("axis {axis} velocity 5"), "lost");
            }
        }
        far.goes_on(&mut commander);
        rig.suffer(0, Fault::Short(false));
        rig.comes_back(&mut commander);
        far.goes_on(&mut commander);
    }
}

/// Somebody sets a drive to the node-ID of axis v, which turns, and switches it on. Both would obey.
#[test]
fn a_second_node_of_a_number_stops_its_axis_and_no_other() {
    let config = drives().with(drive(9));
    let rig = Rig::with(Adapter::wire(Cell::new(config)), 5_000, "", "", |document| document);
    rig.are_present(&AXES);
    let mut commander = rig.turning();
    let mut events = rig.client();
    assert_eq!(events.ask("[1] set events heartbeat 1"), "[1] OK");
    // Two that say the same at the same time cannot be told from one.
    rig.suffer(9, Fault::Slow(ms(20)));
    rig.suffer(9, Fault::Id(node(3)));
    rig.becomes(&mut commander, "v", "node", "duplicate");
    rig.becomes(&mut commander, "v", "lease", "none");
    for command in ["enable", "velocity 5", "move 5", "home"] {
        let told = commander.error(&format!("axis v {command}"), "duplicate");
        assert!(told.contains("two nodes have its node-ID"), "{told}");
    }
    until("it is told", || events.line() == "1 3 DUPLICATE");
    let found = insist(rig.gateway.main, "GET /api/buses/can/nodes/3", "").json();
    assert_eq!(found["duplicate"], json!(true), "{found}");
    let found = insist(rig.gateway.main, "GET /api/axes/v", "").json();
    assert_eq!((&found["node"], &found["online"]), (&json!("duplicate"), &json!(false)), "{found}");
    assert!(rig.gateway.log().contains("node 3: node-ID given twice"));
    rig.go_on(&mut commander, &[AXES[0], AXES[2]]);
    let stand = || {
        let device = rig.adapter.device();
        let drives = device.bus.nodes().iter().filter(|other| other.id() == Some(node(3)));
        drives.filter_map(|node| node.drive()).filter(|drive| drive.velocity() == 0.0).count() == 2
    };
    until("both stand", || {
        commander.ok("feed");
        stand()
    });
    // One gets its own number again, and both are switched off and on: who has spoken at the same time may be off the bus.
    rig.suffer(3, Fault::Id(node(9)));
    rig.suffer(3, Fault::Reset);
    rig.becomes(&mut commander, "v", "node", "present");
    rig.go_on(&mut commander, &[AXES[0], AXES[2]]);
    let mut next = rig.client();
    rig.is_moved(&mut next, "v");
    rig.go_on(&mut commander, &[AXES[0], AXES[2]]);
}

/// Transfers of several clients with a node whose SDO server dies in the midst of one. Its PDOs go on.
#[test]
fn an_sdo_server_that_dies_in_a_transfer_holds_nobody_up() {
    let (long, short) = (Address::new(0x2F00, 0), Address::new(0x2F01, 0));
    let bytes: Vec<u8> = (0..2_000_u32).map(|at| at as u8).collect();
    let mut config = drives();
    config.drives[1].domains = vec![(long, bytes.clone()), (short, bytes[..100].to_vec())];
    let rig = Rig::with(Adapter::wire(Cell::new(config)), 5_000, "", "", patient);
    rig.are_present(&AXES);
    let whole: String = bytes.iter().map(|byte| format!("{byte:02X} ")).collect();
    let mut commander = rig.turning();
    for block in [0, 1] {
        let mut reader = rig.client();
        assert_eq!(reader.ask(&format!("[1] set sdo_block {block}")), "[1] OK");
        rig.suffer(3, Fault::SdoDies(100));
        reader.send("[2] 3 read 0x2F00 0 hex");
        reader.begins();
        // Those that come after it are refused each in its turn, or told that theirs did not come.
        let mut waiting = rig.client();
        waiting.send("[3] 3 read 0x1000 0 u32");
        rig.go_on(&mut commander, &AXES);
        // What has come by then is there, and what broke it off.
        let answer = reader.long();
        let (begun, why) = answer.split_once('\n').expect("two lines");
        assert!(begun.len() > 300 && format!("[2] {whole}").starts_with(begun), "{begun}");
        assert_eq!(why, "...ERROR:0x05040000 #SDO protocol timed out.");
        assert_eq!(waiting.line(), "[3] ERROR:0x05040000 #SDO protocol timed out.");
        assert_eq!(waiting.ask("[4] 2 read 0x6060 0 i8"), "[4] 3", "other nodes answer");
        rig.go_on(&mut commander, &AXES);
        rig.suffer(3, Fault::SdoDead(false));
        let read = reader.ask("[5] 3 read 0x2F00 0 hex");
        assert_eq!(read.trim_end(), format!("[5] {}", whole.trim_end()), "the channel is free");
        // Writing is broken off, too.
        rig.suffer(3, Fault::SdoDies(5));
        let write = format!("[6] 3 write 0x2F01 0 hex {}", &whole[..3 * 100]);
        assert_eq!(commander.ask(&write), "[6] ERROR:0x05040000 #SDO protocol timed out.");
        rig.suffer(3, Fault::SdoDead(false));
    }
    rig.suffer(3, Fault::SdoDies(5));
    let path = "GET /api/buses/can/nodes/3/objects/2F01";
    assert_eq!(insist(rig.gateway.main, path, "").error(), (504, "no-reply".into()));
    let told = commander.error("node can 3 read 2F01:0", "no-reply");
    assert!(told.contains("the node did not answer"), "{told}");
    rig.go_on(&mut commander, &AXES);
    // The axis is stopped by its PDO; what needs an object is refused.
    let told = commander.error("axis v move 100 500", "drive");
    assert!(told.contains("the node did not answer"), "{told}");
    commander.ok("axis v stop");
    rig.suffer(3, Fault::SdoDead(false));
    let read = insist(rig.gateway.main, path, "").json()["value"].clone();
    assert_eq!(read, json!(whole[..3 * 100].trim_end()));
    commander.ok("axis v enable");
    commander.ok("axis v velocity 500");
    rig.go_on(&mut commander, &[AXES[0], AXES[2]]);
}

fn node(id: u8) -> NodeId {
    NodeId::new(id).expect("a node-ID")
}

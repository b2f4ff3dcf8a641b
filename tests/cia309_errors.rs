//! CiA 309-3: every error number that can occur, as a reply and unasked.

mod common;

use common::can::{Adapter, Nodes, Objects, Slave, await_open};
use common::client::{Lines, figure, send_and_close, value};
use common::wire::Wire;
use common::{Document, Gateway, until};
use puente_canopen::Address;
use puente_canopen::lss::Identity;
use puente_cell::can::{Cell, Config, DriveConfig, Fault, Model};
use puente_line::Instant;
use puente_slcan::Flags;

fn objects() -> Objects {
    Objects::default()
        .with(0x1017, 0, 1000u16.to_le_bytes())
        .with(0x2001, 0, [0])
        .refusing(0x2003, 0x0601_0001)
        .refusing(0x2004, 0x0800_0022)
}

/// Node 4 on network 1.
fn rig(nodes: Nodes) -> (Wire<Adapter<Nodes>>, Gateway) {
    let adapter = Adapter::wire(nodes.with(4, objects()));
    let gateway = Document::new().canopen("can", &adapter, "heartbeat_ms = 0").start();
    await_open(&gateway);
    (adapter, gateway)
}

/// One of the next lines is this.
#[track_caller]
fn comes(client: &mut Lines, line: &str) {
    let came: Vec<_> = (0..100).map(|_| client.line()).take_while(|next| next != line).collect();
    assert!(came.len() < 100, "no '{line}' in {came:?}");
}

#[test]
fn every_error_has_its_number() {
    let (_adapter, gateway) = rig(Nodes::default());
    let mut client = Lines::connect(gateway.main);
    let too_long = format!("4 w 0x2001 0 hex {}", "00 ".repeat(5000));
    for (command, error) in [
        ("5 fly", "100 #Request not supported."),
        ("set wings 1", "100 #Request not supported."),
        ("4 read 0x1000", "101 #Syntax error."),
        ("4 w 0x1017 0 u16 65536", "101 #Syntax error."),
        ("4 w 0x1017 0 u16", "101 #Syntax error."),
        ("lss_get_node", "103 #Time-out."),
        ("_lss_fastscan 10", "103 #Time-out."),
        ("r 0x1000 0", "105 #No default node set."),
        ("9 4 r 0x1000 0", "106 #Unsupported net."),
        ("0 r 0x1000 0", "107 #Unsupported node."),
        ("128 start", "107 #Unsupported node."),
        ("lss_set_node 128", "502 #LSS node-ID not supported."),
        (&too_long, "600 #Running out of memory."),
        ("4 r 0x3000 0", "0x06020000 #Object does not exist."),
        ("4 r 0x2003 0", "0x06010001 #Attempt to read a write only object."),
        ("4 w 0x2004 0 u8 1", "0x08000022"),
    ] {
        let reply = client.ask(&format!("[6] {command}"));
        assert!(reply.starts_with(&format!("[6] ERROR:{error}")), "{command}: {reply}");
    }
    assert_eq!(client.ask("[7] set sdo_timeout 50"), "[7] OK");
    let silent = "[8] ERROR:0x05040000 #SDO protocol timed out.";
    assert_eq!(client.ask("[8] 99 r 0x1000 0"), silent);
    assert_eq!(client.ask("5 r 0x1000 0"), "[0] ERROR:101 #Syntax error.");
    assert_eq!(client.ask("[9] 4 r 0x1017 0 u16"), "[9] 1000");
}

#[test]
fn without_a_can_bus_there_is_no_network() {
    let gateway = Gateway::factory();
    let mut client = Lines::connect(gateway.main);
    assert_eq!(client.ask("[1] 4 r 0x1000 0"), "[1] ERROR:104 #No default net set.");
    assert_eq!(client.ask("[2] 1 4 r 0x1000 0"), "[2] ERROR:106 #Unsupported net.");
}

#[test]
fn every_refusal_of_an_lss_node_has_its_number() {
    let identity = Identity { vendor: 0x0179, product: 2, revision: 0x0001_0000, serial: 0xABCD };
    let (adapter, gateway) = rig(Nodes::default().with_slave(Slave::new(identity)));
    let mut client = Lines::connect(gateway.main);
    // It is there, and is not the one that is looked for.
    let reply = client.ask("[1] lss_allnodes 50 9 0 2 0x179 2 2 2 0x10000 2 0xABCE");
    assert_eq!(reply, "[1] ERROR:102 #Request not processed due to internal state.");
    assert_eq!(client.ask("[2] lss_switch_glob 1"), "[2] OK");
    for (error, command, number) in [
        (1, "lss_set_node 7", 502),
        (1, "lss_conf_bitrate 0 9", 503),
        (1, "lss_store", 504),
        (2, "lss_store", 505),
        (255, "lss_store", 501),
    ] {
        adapter.device().bus.slave.as_mut().expect("a slave").error = error;
        let reply = client.ask(&format!("[2] {command}"));
        assert!(reply.starts_with(&format!("[2] ERROR:{number} #")), "{command}: {reply}");
    }
}

const STATE: &str = "ERROR:102 #Request not processed due to internal state.";

/// An axis u, which is the drive of node 2, under way by this client.
fn moving(net: &str) -> (Wire<Adapter<Cell>>, Gateway, Lines) {
    let drive = DriveConfig::new(2, Model::Lexium23a).expect("a node-ID");
    let adapter = Adapter::wire(Cell::new(Config::new(1_000_000).with(drive)));
    let gateway = Document::new()
        .net(&format!("lease_ms = 5000\n{net}"))
        .canopen("can", &adapter, "bitrate = 1000000\nsync_us = 10000")
        .servo("u", "can", 2)
        .start();
    let mut client = Lines::connect(gateway.main);
    until("the drive is there", || value(&client.ask("axis u status"), "node") == Some("present"));
    client.ok("axis u enable");
    client.ok("axis u velocity 300");
    (adapter, gateway, client)
}

/// What is answered, among the frames of the nodes.
#[track_caller]
fn answer(client: &mut Lines, line: &str) -> String {
    client.send(line);
    std::iter::repeat_with(|| client.line()).find(|line| !line.starts_with([':', '='])).expect("a line")
}

/// What another client commands is nobody else's: neither by an NMT command, nor by an object, nor by a frame.
#[test]
fn what_another_client_commands_is_refused() {
    let (_adapter, gateway, mut commander) = moving("");
    let mut other = Lines::connect(gateway.main);
    for command in [
        "2 stop",
        "0 preop",
        "2 reset node",
        "2 w 0x6040 0 u16 0x0F",
        "2 w 0x6060 0 i8 1",
        "2 w 0x6083 0 u32 1000",
        "lss_switch_glob 1",
    ] {
        assert_eq!(other.ask(&format!("[1] {command}")), format!("[1] {STATE}"), "{command}");
    }
    for (frame, code) in [
        (":000,2,02-02", "leased"),
        (":602,8,2B-40-60-00-0F-00-00-00", "leased"),
        ("=202,2,0F-00X", "leased"),
        (":7E5,8,04-01-00-00-00-00-00-00", "leased"),
        (":080,0,", "reserved"),
        (":582,8,60-40-60-00-00-00-00-00", "reserved"),
    ] {
        assert!(answer(&mut other, frame).starts_with(&format!("error {code} ")), "{frame}");
    }
    let status = commander.ok("axis u status");
    assert_eq!((value(&status, "state"), value(&status, "event")), (Some("operation-enabled"), Some("none")));
    // Reading and stopping are everyone's.
    assert_eq!(answer(&mut other, "[2] 2 r 0x6060 0 i8"), "[2] 3");
    assert_eq!(other.ask("[3] 2 w 0x6040 0 u16 6"), "[3] OK");
    // Who was stopped by somebody else does not move it again at once.
    assert_eq!(commander.ask("[4] 2 w 0x6040 0 u16 0x0F"), format!("[4] {STATE}"));
    let frame = ":602,8,2B-40-60-00-0F-00-00-00";
    assert!(answer(&mut commander, frame).starts_with("error leased "), "{frame}");
}

/// A write that waits for its turn at the node is not sent after a stop.
#[test]
fn what_waits_while_the_axis_is_stopped_is_refused() {
    let (adapter, gateway, mut commander) = moving("");
    let [mut reader, mut other] = [(); 2].map(|()| Lines::connect(gateway.main));
    assert!(adapter.device().bus.suffer(Instant::ZERO, 2, Fault::SdoDead(true)));
    let begun = adapter.device().frames.len();
    let asked = |index: u16| {
        let device = adapter.device();
        let mut requests = device.frames[begun..].iter().filter(|frame| frame.id().raw() == 0x602);
        requests.any(|frame| frame.data()[1..3] == index.to_le_bytes())
    };
    assert_eq!(reader.ask("[1] set sdo_timeout 2000"), "[1] OK");
    reader.send("[2] 2 r 0x6041 0");
    until("the node is asked", || asked(0x6041));
    commander.send("[3] 2 w 0x60FF 0 i32 5000");
    until("it waits", || figure(&other.ask("bus can status"), "waiting") == 1);
    other.send("[4] 2 w 0x6040 0 u16 6");
    assert_eq!(commander.line(), format!("[3] {STATE}"));
    assert!(!asked(0x60FF), "it was not sent");
}

/// Who comes when all places are taken may stop, and no more; who has closed its side moves nothing, for nobody would stop it.
#[test]
fn clients_without_a_place_or_without_a_side_move_nothing() {
    let (_adapter, gateway, mut commander) = moving("clients = 1");
    let ask = |command: &str| {
        // Its line ends with its side, so that the one is not there without the other.
        let reply = send_and_close(gateway.main, format!("[1] {command}").as_bytes());
        String::from_utf8_lossy(&reply).trim_end().to_owned()
    };
    for command in ["2 r 0x6041 0", "2 w 0x6083 0 u32 1", "2 start", "lss_get_node"] {
        assert_eq!(ask(command), format!("[1] {STATE}"), "{command}");
    }
    commander.ok("axis u disable");
    drop(commander);
    until("there is a place", || ask("2 r 0x6060 0 i8") == "[1] 3");
    assert_eq!(ask("2 w 0x6040 0 u16 0x0F"), format!("[1] {STATE}"));
}

/// What has been told of a value cannot be taken back.
#[test]
fn a_value_that_is_broken_off_ends_with_its_error() {
    let node = DriveConfig::new(3, Model::Node).expect("a node-ID");
    let long = DriveConfig { domains: vec![(Address::new(0x2000, 0), vec![0xAB; 50_000])], ..node };
    let adapter = Adapter::wire(Cell::new(Config::new(1_000_000).with(long)));
    let gateway = Document::new().canopen("can", &adapter, "heartbeat_ms = 0").start();
    await_open(&gateway);
    for block in [0, 1] {
        let mut client = Lines::connect(gateway.main);
        assert_eq!(client.ask(&format!("[1] set sdo_block {block}")), "[1] OK");
        client.send("[2] 3 r 0x2000 0");
        let before = adapter.device().bus.totals().frames;
        until("some of it has been read", || adapter.device().bus.totals().frames > before + 1_000);
        assert!(adapter.device().bus.suffer(Instant::ZERO, 3, Fault::SdoDead(true)), "a node");
        let read = client.long();
        let (value, end) = read.split_once('\n').expect("two lines");
        assert!(value.starts_with("[2] AB AB AB ") && value.ends_with(" AB"), "{value}");
        assert_eq!(end, "...ERROR:0x05040000 #SDO protocol timed out.");
        assert!(adapter.device().bus.suffer(Instant::ZERO, 3, Fault::SdoDead(false)), "a node");
    }
}

/// Who waits too long for its turn at a node.
#[test]
fn a_turn_that_comes_too_late_is_a_time_out() {
    let (adapter, gateway) = rig(Nodes::default());
    let [mut slow, mut next] = [(); 2].map(|()| Lines::connect(gateway.main));
    assert_eq!(slow.ask("[1] set sdo_timeout 20000"), "[1] OK");
    slow.send("[2] 99 r 0x1000 0");
    until("it is asked", || adapter.device().frames.iter().any(|frame| frame.id().raw() == 0x600 + 99));
    assert_eq!(next.ask("[3] 99 r 0x1000 0"), "[3] ERROR:103 #Time-out.");
}

/// An adapter that has no bus any more; and what its controller is at.
#[test]
fn what_becomes_of_the_bus_is_told() {
    let (adapter, gateway) = rig(Nodes::default());
    let [mut told, mut client] = [(); 2].map(|()| Lines::connect(gateway.main));
    assert_eq!(told.ask("[1] set events bus 1"), "[1] OK");
    for (flags, line) in [
        (Flags::PASSIVE | Flags::WARNING, "1 0 ERROR 300 #Error passive."),
        (0, "1 0 ERROR 305 #CAN active."),
    ] {
        adapter.device().flags = Flags(flags);
        assert_eq!(told.line(), line);
    }
    adapter.device().refuses = true;
    assert_eq!(told.line(), "1 0 ERROR 304 #CAN init.");
    for command in ["4 r 0x1017 0", "4 w 0x1017 0 u16 5", "4 stop", "lss_get_node", "_lss_fastscan 10"] {
        assert_eq!(client.ask(&format!("[2] {command}")), "[2] ERROR:301 #Bus off.", "{command}");
    }
    client.error(":604,8,40-17-10-00-00-00-00-00", "not-sent");
    adapter.device().refuses = false;
    assert_eq!(told.line(), "1 0 ERROR 305 #CAN active.");
    assert_eq!(client.ask("[3] 4 r 0x1017 0 u16"), "[3] 1000");
}

/// More is heard while a command of the client is under way than the gateway keeps for it.
#[test]
fn a_client_that_was_too_slow_is_told() {
    let (adapter, gateway) = rig(Nodes::default());
    let mut client = Lines::connect(gateway.main);
    assert_eq!(client.ask("[1] set events bus 1"), "[1] OK");
    assert_eq!(client.ask("[2] set sdo_timeout 1000"), "[2] OK");
    client.send("[3] 99 r 0x1000 0");
    for _ in 0..600 {
        adapter.device().bus.say(0x80, &[]);
    }
    assert_eq!(client.line(), "[3] ERROR:0x05040000 #SDO protocol timed out.");
    assert_eq!(client.line(), "1 0 ERROR 303 #CAN buffer overflow.");
}

/// Node 3 is guarded, node 4 has a heartbeat.
#[test]
fn nodes_that_are_lost_are_told() {
    let node = |id| DriveConfig::new(id, Model::Node).expect("a node-ID");
    let adapter = Adapter::wire(Cell::new(Config::new(1_000_000).with(node(3)).with(node(4))));
    let gateway = Document::new()
        .canopen("can", &adapter, "bitrate = 1000000\nheartbeat_ms = 0")
        .node("can", 3, "guard_ms = 200\nlife_factor = 3")
        .node("can", 4, "heartbeat_ms = 200")
        .start();
    let mut client = Lines::connect(gateway.main);
    for node in [3, 4] {
        let booted =
            || client.ask(&format!("node can {node} status")).contains("state=operational health=booted");
        until("it is there", booted);
    }
    let suffer = |node, fault| assert!(adapter.device().bus.suffer(Instant::ZERO, node, fault), "a node");
    assert_eq!(client.ask("[1] set events heartbeat 1"), "[1] OK");
    for (node, fault, line) in [
        (4, Fault::Mute(true), "1 4 ERROR 203 #Heartbeat lost."),
        (4, Fault::Mute(false), "1 4 ERROR 202 #Heartbeat started."),
        (3, Fault::Mute(true), "1 3 ERROR 201 #Lost connection."),
        (3, Fault::Mute(false), "1 3 ERROR 202 #Heartbeat started."),
        (3, Fault::WrongToggle, "1 3 ERROR 200 #Lost guarding message."),
    ] {
        suffer(node, fault);
        comes(&mut client, line);
    }
    // Answers that repeat the bit do not count.
    comes(&mut client, "1 3 ERROR 201 #Lost connection.");
}

//! CiA 309-3: every command with its reply. Errors are in `cia309_errors.rs`.

mod common;

use common::can::{Adapter, Nodes, Objects, Slave, await_open};
use common::client::Lines;
use common::wire::Wire;
use common::{Document, Gateway, target};
use puente_canopen::lss::Identity;

/// A long object: 1000 bytes on the way through a buffer of the gateway that is smaller.
fn long() -> Vec<u8> {
    (0..1000u32).map(|at| (at * 7 % 251) as u8).collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ")
}

fn objects() -> Objects {
    Objects::default()
        .with(0x1000, 0, 0x0002_0192u32.to_le_bytes())
        .with(0x1017, 0, 1000u16.to_le_bytes())
        .with(0x1008, 0, *b"Simulated \"node\"")
        .with(0x2000, 1, 1.5f32.to_le_bytes())
        .with(0x2000, 2, [0; 8])
        .with(0x2001, 0, long())
        .with(0x2002, 0, [0])
        .refusing(0x2003, 0x0601_0001)
        .refusing(0x2004, 0x0800_0022)
}

/// Nodes 4 and 5 on network 1.
fn rig(more: impl FnOnce(Nodes) -> Nodes) -> (Wire<Adapter<Nodes>>, Gateway) {
    let adapter = Adapter::wire(more(Nodes::default().with(4, objects()).with(5, objects())));
    let gateway = Document::new().canopen("can", &adapter, "heartbeat_ms = 0").start();
    await_open(&gateway);
    (adapter, gateway)
}

#[test]
fn objects_are_read_and_written_in_all_types() {
    let (adapter, gateway) = rig(|nodes| nodes);
    let mut client = Lines::connect(gateway.main);
    let long = hex(&long());
    for (command, reply) in [
        ("[1] 4 read 0x1000 0 u32", "[1] 131474"),
        ("[2] 1 4 r 0x1000 0", "[2] 92 01 02 00"),
        ("[3] 4 r 0x1000 0 x32", "[3] 0x00020192"),
        ("[4] 4 read 0x1017 0 i16 # as CANopenNode documents it", "[4] 1000"),
        ("[5] 4 r 0x1017 0 u32", "[5] E8 03"),
        ("[6] 4 r 0x1008 0 vs", "[6] \"Simulated \"\"node\"\"\""),
        ("[7] 4 r 0x1008 0 os", "[7] U2ltdWxhdGVkICJub2RlIg=="),
        ("[8] 4 r 0x2000 1 r32", "[8] 1.5"),
        ("[9] 4 w 0x1017 0 u16 0x7D0", "[9] OK"),
        ("[10] 4 r 0x1017 0 u16", "[10] 2000"),
        ("[11] 4 w 0x2000 2 i64 -2", "[11] OK"),
        ("[12] 4 r 0x2000 2 i64", "[12] -2"),
        ("[13] 4 w 0x2000 2 r64 0.1", "[13] OK"),
        ("[14] 4 r 0x2000 2 r64", "[14] 0.1"),
        ("[15] 4 w 0x1008 0 vs \"two words # no comment\" # comment", "[15] OK"),
        ("[16] 4 r 0x1008 0 vs", "[16] \"two words # no comment\""),
        ("[17] 4 w 0x1008 0 d MTIzNDU2Nzg5", "[17] OK"),
        ("[18] 4 r 0x1008 0 d", "[18] MTIzNDU2Nzg5"),
        ("[19] 4 w 0x1008 0 hex 0a 0B 0c0D", "[19] OK"),
        ("[20] 4 r 0x1008 0 hex", "[20] 0A 0B 0C 0D"),
        ("[21] 4 w 0x2002 0 b 1", "[21] OK"),
        ("[22] 4 r 0x2002 0 b", "[22] 1"),
        ("[23] 4 r 0x2001 0", &format!("[23] {long}")),
        ("[24] set sdo_block 1", "[24] OK"),
        ("[25] 4 r 0x2001 0", &format!("[25] {long}")),
        ("[26] 4 w 0x2002 0 hex 01 02 03 04 05 06 07 08", "[26] OK"),
        ("[27] 4 r 0x2002 0", "[27] 01 02 03 04 05 06 07 08"),
    ] {
        assert_eq!(client.ask(command), reply, "{command}");
    }
    assert_eq!(adapter.device().bus.objects(0).value(0x1017, 0), Some(&2000u16.to_le_bytes()[..]));
    assert_eq!(adapter.device().bus.objects(1).value(0x1017, 0), Some(&1000u16.to_le_bytes()[..]));
}

/// A line that is longer than what a board lets a client send ahead.
#[test]
fn a_value_may_come_in_a_long_line() {
    let (_adapter, gateway) = rig(|nodes| nodes);
    let mut client = Lines::connect(gateway.main);
    // A board writes 256 bytes at most.
    let bytes = if target().is_board() { 256 } else { 400 };
    let value: Vec<u8> = (0..bytes).map(|at| at as u8).collect();
    let spaced = hex(&value).replace(' ', &" ".repeat(30));
    assert_eq!(client.ask(&format!("[1] 4 w 0x2001 0 hex {spaced}")), "[1] OK");
    assert_eq!(client.ask("[2] 4 r 0x2001 0"), format!("[2] {}", hex(&value)));
    assert_eq!(client.ask(&format!("[3] 4 w 0x2001 0 hex {spaced} x")), "[3] ERROR:101 #Syntax error.");
    assert_eq!(client.ask("[4] 4 r 0x1017 0 u16"), "[4] 1000");
}

#[test]
fn nodes_are_commanded() {
    let (adapter, gateway) = rig(|nodes| nodes);
    let mut client = Lines::connect(gateway.main);
    for (command, code, node) in [
        ("4 start", 0x01, 4),
        ("4 stop", 0x02, 4),
        ("1 0 preop", 0x80, 0),
        ("4 preoperational", 0x80, 4),
        ("4 reset node", 0x81, 4),
        ("0 reset comm", 0x82, 0),
        ("5 reset communication", 0x82, 5),
    ] {
        let before = adapter.device().frames.len();
        assert_eq!(client.ask(&format!("[7] {command}")), "[7] OK");
        let sent = || {
            adapter.device().frames.iter().skip(before).any(|f| f.id().raw() == 0 && f.data() == [code, node])
        };
        common::until("the command is on the bus", sent);
    }
}

#[test]
fn what_a_client_sets_is_its_own() {
    let (_adapter, gateway) = rig(|nodes| nodes);
    let [mut one, mut other] = [(); 2].map(|()| Lines::connect(gateway.main));
    for command in ["set network 1", "set node 4", "set sdo_timeout 300", "1 set sdo_block 0"] {
        assert_eq!(one.ask(&format!("[1] {command}")), "[1] OK", "{command}");
    }
    assert_eq!(one.ask("[2] r 0x1017 0 u16"), "[2] 1000");
    assert_eq!(other.ask("[3] r 0x1017 0 u16"), "[3] ERROR:105 #No default node set.");
}

#[test]
fn help_lamps_and_log_are_shown() {
    let (adapter, gateway) = rig(|nodes| nodes);
    let mut client = Lines::connect(gateway.main);
    for (command, word) in [("help", "set network"), ("help datatype", "r32"), ("help lss", "lss_store")] {
        let text = client.ask_long(&format!("[1] {command}"));
        assert!(text.contains(word), "{command}: {text}");
    }
    assert_eq!(client.ask("# a comment"), "");
    assert_eq!(client.ask(""), "");
    // The lamps end with a carriage return, and go on until the next command.
    client.send("[2] led");
    assert_eq!(client.until_return(), " CANopen status LEDs: R  G*        ");
    assert_eq!(client.ask("[3] 4 r 0x1017 0 u16").trim_start(), "[3] 1000");
    adapter.device().bus.say(0x85, &[0x30, 0x81, 0x11, 1, 2, 3, 4, 5]);
    common::until("an emergency is in the log", || {
        let log = client.ask("[4] log");
        log == "1 5 EMCY 8130 11 1 2 3 4 5" && client.line().is_empty()
    });
}

#[test]
fn what_happens_is_told_where_it_is_wanted() {
    let (adapter, gateway) = rig(|nodes| nodes);
    let [mut told, mut other] = [(); 2].map(|()| Lines::connect(gateway.main));
    for kind in ["boot_up", "emcy", "heartbeat", "pdo"] {
        assert_eq!(told.ask(&format!("[1] 1 set events {kind} 1")), "[1] OK");
    }
    assert_eq!(told.ask("[2] boot_up_indication Enable"), "[2] OK");
    adapter.device().bus.say(0x709, &[0]);
    assert_eq!(told.line(), "1 9 BOOT_UP");
    adapter.device().bus.say(0x709, &[5]);
    assert_eq!(told.line(), "1 9 ERROR 202 #Heartbeat started.");
    assert_eq!(told.line(), "1 9 STATE operational");
    adapter.device().bus.say(0x709, &[0x7F]);
    assert_eq!(told.line(), "1 9 STATE pre-operational");
    adapter.device().bus.say(0x89, &[0x10, 0x10, 1, 0, 0, 0, 0, 0]);
    assert_eq!(told.line(), "1 9 EMCY 1010 01 0 0 0 0 0");
    adapter.device().bus.say(0x289, &[0x37, 6, 1]);
    assert_eq!(told.line(), "1 9 PDO 2 37 06 01");
    assert_eq!(told.ask("[3] set events all 0"), "[3] OK");
    adapter.device().bus.say(0x709, &[0]);
    assert_eq!(told.ask("[4] 4 r 0x1017 0 u16"), "[4] 1000");
    assert_eq!(other.ask("[5] 4 r 0x1017 0 u16"), "[5] 1000", "who wants nothing is told nothing");
}

#[test]
fn node_ids_are_given_over_the_bus() {
    let identity = Identity { vendor: 0x0179, product: 2, revision: 0x0001_0000, serial: 0xABCD };
    let (adapter, gateway) = rig(|nodes| nodes.with_slave(Slave::new(identity)));
    let who = "0x00000179 0x00000002 0x00010000 0x0000ABCD";
    let mut client = Lines::connect(gateway.main);
    for (command, reply) in [
        ("_lss_fastscan", who),
        ("lss_switch_glob 0", "OK"),
        ("lss_switch_sel 0x179 2 0x10000 0xABCD", "OK"),
        ("lss_inquire_addr", who),
        ("lss_inquire_addr 3", "0x0000ABCD"),
        ("lss_get_node", "0xFF"),
        ("lss_set_node 6", "OK"),
        ("lss_get_node", "0x06"),
        ("lss_conf_bitrate 0 0", "OK"),
        ("lss_store", "OK"),
        ("lss_activate_bitrate 10", "OK"),
        ("lss_switch_glob 1", "OK"),
    ] {
        assert_eq!(client.ask(&format!("[1] 1 {command}")), format!("[1] {reply}"), "{command}");
    }
    adapter.device().bus.slave.as_mut().expect("a slave").id = 255;
    assert_eq!(client.ask("[3] lss_switch_glob 0"), "[3] OK");
    let found = client.ask_long("[4] lss_allnodes 100 9 1");
    assert_eq!(found, format!("# Node-ID 9 assigned to: {who}\n# Found 1 nodes, search finished.\n[4] OK"));
    assert_eq!(adapter.device().bus.slave.as_ref().map(|slave| slave.id), Some(9));
}

/// The time-out of a question is the one that the client says: an answer that comes after the usual 100 ms counts. A scan whose
/// client is gone is given up; it would take minutes.
#[test]
fn lss_nodes_have_as_long_as_the_client_says() {
    let (adapter, gateway) = rig(|nodes| nodes);
    let questions = || adapter.device().frames.iter().filter(|frame| frame.data()[0] == 0x51).count();
    for (at, command) in ["_lss_fastscan 2000", "lss_allnodes 2000"].into_iter().enumerate() {
        let before = questions();
        let mut client = Lines::connect(gateway.main);
        client.send(&format!("[1] {command}"));
        common::until("it asks", || questions() == before + 1);
        std::thread::sleep(common::ms(300));
        adapter.device().bus.say(0x7E4, &[0x4F, 0, 0, 0, 0, 0, 0, 0]);
        common::until("it goes on", || questions() == before + 2);
        common::client::reset(client.stream());
        let reply = Lines::connect(gateway.main).ask("[2] lss_get_node");
        assert_eq!(reply, "[2] ERROR:103 #Time-out.", "{at}: {command}");
    }
}

/// Each has its own answers, in its order, whatever the others ask: also where they ask the same node, and before the answer has
/// come.
#[test]
fn three_clients_read_1000_objects_each_and_none_is_lost_or_mixed() {
    const READS: u32 = 1000;
    let value = |node: u32, index: u32| node << 24 | index << 4 | 5;
    let objects = |id: u32| {
        (0..16).fold(Objects::default(), |objects, at| {
            objects.with(0x3000 + at as u16, 1, value(id, at).to_le_bytes())
        })
    };
    let nodes = (1..=3).fold(Nodes::default(), |nodes, id| nodes.with(id as u8, objects(id)));
    let adapter = Adapter::wire(nodes);
    let gateway = Document::new().canopen("can", &adapter, "heartbeat_ms = 0").start();
    await_open(&gateway);
    std::thread::scope(|scope| {
        for client in 0..3 {
            let mut lines = Lines::connect(gateway.main);
            scope.spawn(move || {
                let what = |read: u32| (1 + (client + read) % 3, (read * 7 + client) % 16);
                let ask = |lines: &mut Lines, read: u32| {
                    let (node, at) = what(read);
                    lines.send(&format!("[{}] {node} r {} 1 u32", read + client * 10_000, 0x3000 + at));
                };
                // Some are asked before the answer to the last has come.
                (0..4).for_each(|read| ask(&mut lines, read));
                for read in 0..READS {
                    let (node, at) = what(read);
                    assert_eq!(lines.line(), format!("[{}] {}", read + client * 10_000, value(node, at)));
                    if read + 4 < READS {
                        ask(&mut lines, read + 4);
                    }
                }
            });
        }
    });
    let requests =
        adapter.device().frames.iter().filter(|frame| (0x600..0x680).contains(&frame.id().raw())).count();
    assert_eq!(requests, 3 * READS as usize, "each was asked once");
}

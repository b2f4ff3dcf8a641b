//! Lines, as CANopenNode's gateway reads them.

use proptest::prelude::*;
use puente_canopen::lss::{Identity, Known, Mode, Part};
use puente_canopen::sdo::Abort;
use puente_canopen::{Address, NodeId, nmt};
use puente_cia309::command::{AllNodes, Lss, Setting};
use puente_cia309::indication::{Indication, Kinds, What};
use puente_cia309::leds::Lamp;
use puente_cia309::reply::{Answer, Reply};
use puente_cia309::value::DataType;
use puente_cia309::{Command, Error, Refused, Request, Session, help};

fn node(id: u8) -> NodeId {
    NodeId::new(id).expect("node-ID")
}

/// Networks 1 and 2 are there; 1 is set.
fn read(line: &str) -> Result<Option<Request<'_>>, Refused> {
    Session::new(Some(1)).parse(line.as_bytes(), |net| matches!(net, 1 | 2))
}

fn command(line: &str) -> Command<'_> {
    read(line).unwrap_or_else(|refused| panic!("{line}: {refused:?}")).expect("a command").command
}

fn error(line: &str) -> u16 {
    read(line).expect_err(line).error.code()
}

#[test]
fn every_command_is_read() {
    use Command::{Help, Led, Log, Nmt, Read, Set, Write};
    use nmt::Command::{EnterPreOperational, ResetCommunication, ResetNode, Start, Stop};
    let object = Address::new(0x1017, 0);
    for line in
        ["[1] 4 read 0x1017 0 i16", "[1] 1 4 r 4119 0 I16\r\n", "  [0x1]\t4  READ 010027 00 i16 # why"]
    {
        assert_eq!(command(line), Read(node(4), object, DataType::Signed(2)), "{line}");
    }
    assert_eq!(command("[7] 4 r 0x1017 0"), Read(node(4), object, DataType::Hex));
    let value = b"1000 # ms".as_slice();
    let write = Write { node: node(4), address: object, kind: DataType::Unsigned(2), value };
    assert_eq!(command("[1] 4 w 0x1017 0 u16 1000 # ms"), write);
    for (line, what) in [
        ("start", Start),
        ("stop", Stop),
        ("preop", EnterPreOperational),
        ("preoperational", EnterPreOperational),
        ("reset node", ResetNode),
        ("reset comm", ResetCommunication),
        ("RESET Communication", ResetCommunication),
    ] {
        assert_eq!(command(&format!("[1] 5 {line}")), Nmt(what, Some(node(5))));
        assert_eq!(command(&format!("[1] 2 0 {line}")), Nmt(what, None));
    }
    for (line, what) in [
        ("set network 2", Setting::Network(2)),
        ("2 set node 127", Setting::Node(node(127))),
        ("set sdo_timeout 65535", Setting::SdoTimeout(65535)),
        ("set sdo_block 1", Setting::SdoBlock(true)),
        ("set events emcy 1", Setting::Events(Kinds::EMCY, true)),
        ("set events ALL 0", Setting::Events(Kinds::ALL, false)),
        ("boot_up_indication Enable", Setting::Events(Kinds::BOOT_UP, true)),
    ] {
        assert_eq!(command(&format!("[1] {line}")), Set(what));
    }
    assert_eq!(command("[1] help"), Help(help::COMMANDS));
    assert_eq!(command("[1] help datatype"), Help(help::TYPES));
    assert_eq!(command("[1] help lss"), Help(help::LSS));
    assert_eq!(command("[1] led"), Led);
    assert_eq!(command("[1] log"), Log);
}

#[test]
fn every_lss_command_is_read() {
    let who = Identity { vendor: 1, product: 2, revision: 0xFFFF_FFFF, serial: 4 };
    let known = Known { vendor: Some(1), product: None, revision: None, serial: Some(9) };
    let all = AllNodes { timeout: 100, start: 2, store: true, known: Known::default() };
    for (line, what) in [
        ("lss_switch_glob 0", Lss::SwitchGlobal(Mode::Waiting)),
        ("lss_switch_glob 1", Lss::SwitchGlobal(Mode::Configuration)),
        ("lss_switch_sel 1 0x2 0xFFFFFFFF 4", Lss::Select(who)),
        ("lss_set_node 255", Lss::SetNode(255)),
        ("lss_conf_bitrate 0 9", Lss::BitRate(9)),
        ("lss_activate_bitrate 1000", Lss::Activate(1000)),
        ("lss_store", Lss::Store),
        ("lss_inquire_addr", Lss::InquireAll),
        ("lss_inquire_addr 3", Lss::Inquire(Part::Serial)),
        ("lss_get_node", Lss::NodeId),
        ("_lss_fastscan", Lss::Fastscan(100)),
        ("_LSS_FASTSCAN 50", Lss::Fastscan(50)),
        ("lss_allnodes", Lss::AllNodes(all)),
        ("lss_allnodes 0", Lss::AllNodes(all)),
        ("lss_allnodes 10 3 0", Lss::AllNodes(AllNodes { timeout: 10, start: 3, store: false, ..all })),
        (
            "lss_allnodes 10 3 1 2 1 0 5 1 0 2 9",
            Lss::AllNodes(AllNodes { timeout: 10, start: 3, store: true, known }),
        ),
    ] {
        for net in ["", "2 ", "2 5 "] {
            let line = format!("[1] {net}{line}");
            let request = read(&line).expect("read").expect("a command");
            assert_eq!(
                (request.command, request.net),
                (Command::Lss(what), Some(if net.is_empty() { 1 } else { 2 }))
            );
        }
    }
}

#[test]
fn what_is_wrong_has_its_number() {
    for (line, number) in [
        ("[1] 5 fly", 100),
        ("[1] -1 start", 100),
        ("[1] set wings 1", 100),
        ("[1] lss_identity", 100),
        ("start", 101),
        ("[1 5 start", 101),
        ("[x] 5 start", 101),
        ("[4294967296] 5 start", 101),
        ("[1]", 101),
        ("[1] 5", 101),
        ("[1] 1 5 5 start", 101),
        ("[1] 5x start", 101),
        ("[1] 5 start now", 101),
        ("[1] 5 reset", 101),
        ("[1] 5 reset all", 101),
        ("[1] 5 read 0x10000 0", 101),
        ("[1] 5 read 0x1000 256", 101),
        ("[1] 5 read 0x1000", 101),
        ("[1] 5 read 0x1000 0 t", 101),
        ("[1] 5 read 0x1000 0 u32 1", 101),
        ("[1] 5 write 0x1000 0", 101),
        ("[1] set node 0", 101),
        ("[1] set sdo_timeout 0", 101),
        ("[1] set sdo_block 2", 101),
        ("[1] set events emcy", 101),
        ("[1] help me", 101),
        ("[1] lss_inquire_addr 4", 101),
        ("[1] lss_conf_bitrate 1 0", 101),
        ("[1] lss_conf_bitrate 0 5", 101),
        ("[1] lss_allnodes 10 3", 101),
        ("[1] lss_store 1", 101),
        ("[1] 5 readaveryveryverylongobject 0", 101),
        ("[1] read 0x1000 0", 105),
        ("[1] read", 105),
        ("[1] start", 105),
        ("[1] 3 5 read 0x1000 0", 106),
        ("[1] 65536 5 read 0x1000 0", 106),
        ("[1] 3 lss_store", 106),
        ("[1] set network 3", 106),
        ("[1] 128 read 0x1000 0", 107),
        ("[1] 0 read 0x1000 0", 107),
        ("[1] 1 200 start", 107),
        ("[1] lss_set_node 128", 502),
        ("[1] lss_set_node 0", 502),
    ] {
        assert_eq!(error(line), number, "{line}");
    }
    let nowhere = Session::new(None).parse(b"[9] 5 read 0x1000 0", |_| true);
    assert_eq!(nowhere, Err(Refused { sequence: 9, error: Error::NoNet }));
    let unread = read("5 read 0x1000 0");
    assert_eq!(unread, Err(Refused { sequence: 0, error: Error::Syntax }));
}

#[test]
fn a_line_may_say_nothing() {
    for line in ["", " \t\r\n", "# [1] 5 start", "   # "] {
        assert_eq!(read(line), Ok(None));
    }
}

#[test]
fn a_client_sets_what_it_does_not_want_to_repeat() {
    let mut session = Session::new(None);
    session.set(Setting::Network(2));
    session.set(Setting::Node(node(9)));
    let request = session.parse(b"[3] stop", |_| true).expect("read").expect("a command");
    assert_eq!((request.net, request.command), (Some(2), Command::Nmt(nmt::Command::Stop, Some(node(9)))));
    let kinds = Kinds::NONE.with(Kinds::ALL, true).with(Kinds::PDO, false);
    assert!(kinds.has(Kinds::SYNC) && !kinds.has(Kinds::PDO) && Kinds::ALL.with(Kinds::ALL, false).is_none());
}

#[test]
fn replies_have_canopennodes_form() {
    let reply = |answer| Reply { sequence: 12, answer }.to_string();
    assert_eq!(reply(Answer::Ok), "[12] OK\r\n");
    assert_eq!(reply(Answer::Error(Error::Syntax)), "[12] ERROR:101 #Syntax error.\r\n");
    let none = Answer::Abort(Abort(0x0602_0000));
    assert_eq!(reply(none), "[12] ERROR:0x06020000 #Object does not exist.\r\n");
    assert_eq!(reply(Answer::Abort(Abort(0xFFFF))), "[12] ERROR:0x0000FFFF #-\r\n");
    assert_eq!(reply(Answer::Part(10)), "[12] 0x0000000A\r\n");
    assert_eq!(reply(Answer::NodeId(255)), "[12] 0xFF\r\n");
    let who = Identity { vendor: 1, product: 2, revision: 3, serial: 0xABCD };
    assert_eq!(reply(Answer::Identity(who)), "[12] 0x00000001 0x00000002 0x00000003 0x0000ABCD\r\n");
    assert_eq!(
        Reply::broken_off(Abort::TIMEOUT).to_string(),
        "\n...ERROR:0x05040000 #SDO protocol timed out.\r\n"
    );
    for error in Error::ALL {
        assert!(reply(Answer::Error(*error)).contains(&format!("ERROR:{} #", error.code())));
    }
}

#[test]
fn indications_have_lelys_form() {
    let line = |what| Indication { net: 1, what }.to_string();
    let emergency =
        puente_canopen::emcy::Emergency { code: 0x8130, register: 0x11, vendor: [0, 1, 2, 3, 255] };
    assert_eq!(line(What::BootUp(node(5))), "1 5 BOOT_UP\r\n");
    assert_eq!(line(What::Emergency(node(5), emergency)), "1 5 EMCY 8130 11 0 1 2 3 255\r\n");
    let lost = What::Error(Some(node(5)), Error::HeartbeatLost);
    assert_eq!(line(lost), "1 5 ERROR 203 #Heartbeat lost.\r\n");
    assert_eq!(line(What::Error(None, Error::BusOff)), "1 0 ERROR 301 #Bus off.\r\n");
    assert_eq!(line(What::Pdo(node(2), 1, &[0x37, 6])), "1 2 PDO 1 37 06\r\n");
    assert_eq!(line(What::Sync(Some(3))), "1 SYNC 3\r\n");
    assert_eq!(line(What::Duplicate(node(5))), "1 5 DUPLICATE\r\n");
    assert_eq!(line(What::State(node(5), nmt::State::Operational)), "1 5 STATE operational\r\n");
    assert!([What::BootUp(node(5)), lost, What::Sync(None)].iter().all(|what| Kinds::ALL.has(what.kind())));
}

#[test]
fn lamps_flash() {
    assert_eq!(Lamp::On.at(7), (true, None));
    let lit =
        |lamp: Lamp| (0..20).map(|at| if lamp.at(at * 100 + 50).0 { '*' } else { ' ' }).collect::<String>();
    assert_eq!(lit(Lamp::Single), "**          **      ");
    assert_eq!(lit(Lamp::Double), "**  **          **  ");
    assert_eq!(Lamp::Single.at(300), (false, Some(900)));
}

proptest! {
    /// Whatever comes, it is read or refused, and what is refused has its sequence number.
    #[test]
    fn any_line_is_taken(line in proptest::collection::vec(any::<u8>(), 0..80), sequence: u32) {
        let _ = Session::new(Some(1)).parse(&line, |_| true);
        let mut numbered = format!("[{sequence}] ").into_bytes();
        numbered.extend(line.iter().filter(|byte| **byte != b'\n'));
        match Session::new(Some(1)).parse(&numbered, |_| true) {
            Ok(Some(request)) => prop_assert_eq!(request.sequence, sequence),
            Ok(None) => prop_assert!(false, "there is a word"),
            Err(refused) => prop_assert_eq!(refused.sequence, sequence),
        }
    }

    /// The value of a write is the end of its line: more of it may come later.
    #[test]
    fn a_value_is_the_end_of_its_line(value in "[!-~][ -~]{0,200}") {
        let line = format!("[1] 5 w 0x2000 1 d {value}");
        let Command::Write { value: found, .. } = command(&line) else { panic!("no write") };
        prop_assert_eq!(found, value.as_bytes());
    }
}

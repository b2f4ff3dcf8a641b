//! Controller mode and bridge mode: frames as text.

mod common;

use common::can::{Adapter, Nodes, Objects, await_open};
use common::client::Lines;
use common::wire::Wire;
use common::{Document, Gateway, until};

fn rig() -> (Wire<Adapter<Nodes>>, Gateway) {
    let objects = || Objects::default().with(0x6041, 0, [0x40, 2]);
    let adapter = Adapter::wire((2..5).fold(Nodes::default(), |nodes, id| nodes.with(id, objects())));
    let gateway = Document::new().canopen("can", &adapter, "heartbeat_ms = 0").start();
    await_open(&gateway);
    (adapter, gateway)
}

const REPLY: &str = "582,8,4B-41-60-00-40-02-00-00";

#[test]
fn answers_come_in_the_mode_of_the_last_message() {
    let (_adapter, gateway) = rig();
    let mut client = Lines::connect(gateway.main);
    assert_eq!(client.ask(":602,8,40-41-60-00-00-00-00-00"), format!(":{REPLY}"));
    assert_eq!(client.ask("=602,8,40-41-60-00-00-00-00-00X"), format!("={REPLY}X"));
    // Neither needs a line feed, nor do two messages a pause.
    client.put(
        ":602,8,40-41-60-00-00-00-00-00\r=603,8,4041600000000000X:604, 8, 40 – 41 – 60 – 00 – 00 – 00 – 00 – 00\r",
    );
    let answers = [(); 3].map(|()| client.line());
    for id in ["582", "583", "584"] {
        assert!(answers.iter().any(|line| line.contains(&REPLY.replace("582", id))), "{answers:?}");
    }
    assert_eq!(answers[2].chars().next(), Some(':'));
}

#[test]
fn what_nodes_say_unasked_comes_too_but_no_echo() {
    let (adapter, gateway) = rig();
    let [mut client, mut other] = [(); 2].map(|()| Lines::connect(gateway.main));
    client.send(":000,2,01-02");
    let sent = || adapter.device().frames.iter().any(|frame| frame.id().raw() == 0 && frame.data() == [1, 2]);
    until("the frame is on the bus", sent);
    adapter.device().bus.say(0x182, &[0x40, 2]);
    assert_eq!(client.line(), ":182,2,40-02");
    // Another client's question is nobody's answer; the answer to it is heard by all.
    assert_eq!(other.ask("[1] 2 r 0x6041 0 x16"), "[1] 0x0240");
    assert_eq!(client.line(), format!(":{REPLY}"));
    // Whoever goes on in another dialect is not told any more.
    assert_eq!(client.ask("[1] 2 r 0x6041 0 u16"), "[1] 576");
    adapter.device().bus.say(0x182, &[0x40, 2]);
    assert_eq!(client.ask("[2] 2 r 0x6041 0 u16"), "[2] 576");
    assert!(client.ask("bus").starts_with("ok buses=can"));
}

#[test]
fn what_is_no_frame_is_answered_by_a_line_and_the_connection_stays() {
    let (_adapter, gateway) = rig();
    let mut client = Lines::connect(gateway.main);
    for (message, code) in [
        (":602,8,40", "frame-data"),
        (":602,9,", "frame-length"),
        (":xyz,0", "frame-id"),
        ("=602X", "frame"),
        ("=602,8,4041", "frame"),
    ] {
        let answer = client.ask(message);
        assert!(answer.starts_with(&format!("error {code} ")), "{message}: {answer}");
    }
    // Modbus ASCII goes on to be understood beside them.
    assert!(client.ask(":010309010001F0").starts_with("error bad-lrc"));
    assert_eq!(client.ask(":602,8,40-41-60-00-00-00-00-00"), format!(":{REPLY}"));
}

/// The document shows SDO requests of six bytes; servers pass those over.
#[test]
fn an_sdo_request_has_eight_bytes() {
    let (adapter, gateway) = rig();
    let mut client = Lines::connect(gateway.main);
    assert_eq!(client.ask(":602,6,40-41-60-00-00-00"), format!(":{REPLY}"));
    let asked = adapter.device().frames.iter().rev().find(|frame| frame.id().raw() == 0x602).copied();
    assert_eq!(asked.map(|frame| frame.data().to_vec()), Some(vec![0x40, 0x41, 0x60, 0, 0, 0, 0, 0]));
}

#[test]
fn without_a_can_bus_it_says_so() {
    let gateway = Gateway::factory();
    let answer = Lines::connect(gateway.main).ask(":602,8,40-41-60-00-00-00-00-00");
    assert!(answer.starts_with("error unknown-bus "), "{answer}");
}

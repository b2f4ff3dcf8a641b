//! Host alone: a board has no ports of its own for SLCAN and socketcand.
//!
//! The gateway as a CAN adapter: what programs of others see of its bus, and whether they may send.

mod common;

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};

use common::can::{Adapter, Nodes, Objects, await_open};
use common::wire::Wire;
use common::{Document, Gateway, client, until};

/// A port that was free a moment ago: 0 means that there is no such door.
fn free() -> u16 {
    TcpListener::bind("127.0.0.1:0").and_then(|door| door.local_addr()).expect("a port").port()
}

fn rig(frames: &str) -> (Wire<Adapter<Nodes>>, Gateway, [SocketAddr; 2]) {
    let objects = Objects::default().with(0x6041, 0, [0x40, 2]);
    let adapter = Adapter::wire(Nodes::default().with(2, objects));
    let [slcan, socketcand] = [free(), free()];
    let gateway = Document::new()
        .net(&format!("slcan_port = {slcan}\nsocketcand_port = {socketcand}"))
        .canopen("can", &adapter, &format!("heartbeat_ms = 0\nclient_frames = \"{frames}\""))
        .start();
    await_open(&gateway);
    // What that has said is through.
    until("it is said", || adapter.device().frames.iter().any(|frame| frame.id().raw() == 0x7E5));
    (adapter, gateway, [slcan, socketcand].map(|port| SocketAddr::from(([127, 0, 0, 1], port))))
}

#[track_caller]
fn ask(stream: &mut TcpStream, question: &str, answer: &str) {
    stream.write_all(question.as_bytes()).expect("sent");
    hear(stream, answer);
}

#[track_caller]
fn hear(stream: &mut TcpStream, answer: &str) {
    let mut heard = vec![0; answer.len()];
    stream.read_exact(&mut heard).expect("an answer");
    assert_eq!(String::from_utf8_lossy(&heard), answer);
}

#[test]
fn both_show_the_bus_and_send_where_they_may() {
    let (_adapter, _gateway, [slcan, socketcand]) = rig("write");
    let [mut slcan, mut socketcand] = [slcan, socketcand].map(client::connect);
    // As python-can opens them.
    ask(&mut slcan, "C\rS8\rO\r", "\r\r\r");
    ask(&mut socketcand, "", "< hi >");
    ask(&mut socketcand, "< open can0 >", "< ok >");
    ask(&mut socketcand, "< rawmode >", "< ok >");
    ask(&mut slcan, "t60284041600000000000\r", "z\r");
    hear(&mut slcan, "t58284B41600040020000\r");
    let mut heard = String::new();
    while heard.matches('>').count() < 2 {
        let mut byte = [0];
        socketcand.read_exact(&mut byte).expect("a frame");
        heard.push(byte[0].into());
    }
    let (request, response) = heard.split_once('>').expect("two");
    assert!(request.starts_with("< frame 602 ") && request.ends_with(" 4041600000000000 "), "{heard}");
    assert!(response.starts_with("< frame 582 ") && response.ends_with(" 4B41600040020000 >"), "{heard}");
    ask(&mut socketcand, "< send 602 8 40 41 60 0 0 0 0 0 >", "< frame 582 ");
    hear(&mut slcan, "t60284041600000000000\rt58284B41600040020000\r");
}

#[test]
fn they_only_listen_where_the_settings_do_not_say_otherwise() {
    let (adapter, _gateway, [slcan, socketcand]) = rig("read");
    let [mut slcan, mut socketcand] = [slcan, socketcand].map(client::connect);
    // Another bit rate than that of the bus is refused.
    ask(&mut slcan, "S4\rO\r", "\x07\r");
    ask(&mut slcan, "t60284041600000000000\r", "\x07");
    ask(&mut socketcand, "< open can >", "< hi >< ok >");
    ask(&mut socketcand, "< send 602 0 >", "< error the bus is read-only >");
    ask(&mut socketcand, "< open nothing >", "< error could not open bus >");
    adapter.device().bus.say(0x182, &[0x40, 2]);
    hear(&mut slcan, "t18224002\r");
    assert!(adapter.device().frames.iter().all(|frame| frame.id().raw() != 0x602));
}

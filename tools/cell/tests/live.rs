//! Ports in real time.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::fd::AsFd;
use std::path::PathBuf;
use std::time::Duration;

use puente_cell::live::{Place, Port, Received, wait};
use puente_line::Settings;
use rustix::termios::{QueueSelector, tcflush};

fn settings() -> Settings {
    Settings { baud: 115_200, format: "8N1".parse().expect("a format") }
}

/// Waits for what comes next, which must come.
fn next(port: &mut Port) -> (Received, Vec<u8>) {
    let mut buffer = Vec::new();
    for _ in 0..1_000 {
        match port.receive(&mut buffer).expect("it is open") {
            Received::Nothing => wait([port.as_fd()], Some(Duration::from_millis(10))).expect("waited"),
            received => return (received, buffer),
        }
    }
    panic!("nothing came")
}

fn open_pty(name: &str) -> (Port, File, PathBuf) {
    let link = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{}", std::process::id()));
    let place = Place::Pty(link.to_str().expect("a path").into());
    let port = Port::open(&place, settings()).expect("a port");
    let far = OpenOptions::new().read(true).write(true).open(&link).expect("its far side");
    (port, far, link)
}

#[test]
fn a_pseudo_terminal_tells_what_was_dropped() {
    let (mut port, mut far, link) = open_pty("live-pty");
    far.write_all(&[1, 0, 2]).expect("sent");
    assert_eq!(next(&mut port), (Received::Bytes, vec![1, 0, 2]));
    far.write_all(&[3, 4]).expect("sent");
    tcflush(&far, QueueSelector::OFlush).expect("dropped");
    far.write_all(&[5]).expect("sent");
    assert_eq!(next(&mut port), (Received::Discard, vec![]), "before what was written after it");
    // The system may have passed on what was dropped already.
    let mut rest = Vec::new();
    while rest.last() != Some(&5) {
        rest.extend(next(&mut port).1);
    }
    assert!(rest == [5] || rest == [3, 4, 5], "{rest:?}");
    port.write(&[7, 8]).expect("sent");
    let mut received = [0; 2];
    far.read_exact(&mut received).expect("heard");
    assert_eq!(received, [7, 8]);
    std::fs::remove_file(link).expect("removed");
}

#[test]
fn a_tcp_client_takes_the_place_of_one_that_has_gone() {
    let mut port = Port::open(&Place::Listen("127.0.0.1:0".into()), settings()).expect("a port");
    let address = port.address().expect("an address");
    assert_eq!(port.name(), format!("tcp {address}"));
    port.write(&[1]).expect("lost, there is nobody");
    for round in 0..3 {
        let mut client = TcpStream::connect(address).expect("a connection");
        client.write_all(&[round]).expect("sent");
        let mut heard = Vec::new();
        while heard.is_empty() {
            heard = next(&mut port).1;
        }
        assert_eq!(heard, [round]);
        port.write(&[9, round]).expect("sent");
        let mut received = [0; 2];
        client.read_exact(&mut received).expect("heard");
        assert_eq!(received, [9, round]);
    }
}

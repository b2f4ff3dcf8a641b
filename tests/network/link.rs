//! The link goes and comes back, with clients in every state.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::thread;
use std::time::{Duration, Instant};

use puente_modbus::Mode;

use crate::common::client::{Modbus, connect, figure, mbap, read_pdu, value};
use crate::common::ethernet::Host;
use crate::common::rig::Rig;
use crate::common::wire::cell;
use crate::common::{Gateway, ms, thesis, until};
use crate::{LEASED, beside};

const STATUS: u16 = 0x0901;

fn link(rig: &mut Rig, state: &str) {
    assert_eq!(rig.gateway.monitor(&format!("set_link lan9118.0 {state}")), "");
}

/// How often the log says so.
fn said(rig: &Rig, text: &str) -> usize {
    rig.gateway.log().matches(text).count()
}

const NO_LINK: &str = "network: no link";
const HEALED: &str = "network: puente at 10.0.2.15/24, from a DHCP server";

/// What a new client is told; nothing where it is not answered.
fn answer(rig: &Rig, command: &str) -> Option<String> {
    let mut stream = TcpStream::connect(rig.gateway.main).ok()?;
    stream.set_read_timeout(Some(ms(2000))).ok()?;
    stream.write_all(format!("{command}\r\n").as_bytes()).ok()?;
    let mut reply = Vec::new();
    let mut byte = [0];
    while !reply.ends_with(b"\n") {
        stream.read_exact(&mut byte).ok()?;
        reply.push(byte[0]);
    }
    Some(String::from_utf8(reply).expect("text").trim_end().to_owned())
}

/// An old client of whom the board knows nothing any more gets an end, or goes on; it does not wait for ever.
fn ends_or_goes_on(mut stream: TcpStream, request: &[u8]) {
    stream.set_read_timeout(Some(Duration::from_secs(30))).expect("a timeout");
    let _ = stream.write_all(request);
    if let Err(error) = stream.read(&mut [0; 512]) {
        assert!(error.kind() != std::io::ErrorKind::WouldBlock, "it waits for ever");
    }
}

#[test]
fn a_link_that_is_cut_for_5_s_stops_the_axis_and_heals() {
    let mut rig = Rig::on_board(|_| {});
    let cut = Duration::from_secs(5);
    let traffic = thread::spawn({
        let modbus = rig.gateway.modbus;
        move || {
            let mut client = Modbus::connect(modbus);
            let mut readings = 0;
            while client.stream.write_all(&mbap(1, 2, &read_pdu(STATUS, 1))).is_ok()
                && client.stream.read_exact(&mut [0; 11]).is_ok()
            {
                readings += 1;
            }
            readings
        }
    });
    let idle = connect(rig.gateway.main);
    let (commander, _) = rig.jogging();
    let mut stream = commander.stream();
    // It feeds its lease until the cut, and goes on: what it says does not arrive.
    let mut feeding = stream.try_clone().expect("a clone");
    let feeder = thread::spawn(move || {
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(4) && feeding.write_all(b"feed\r\n").is_ok() {
            thread::sleep(ms(50));
        }
    });
    thread::sleep(ms(1000));
    assert!(rig.turns(), "the lease holds while it is fed");
    let lost = Instant::now();
    link(&mut rig, "off");
    let (before, late) = rig.stop_after(lost);
    println!("stop on the wire {late:?} after the cut, {before} frames before it");
    assert!(late < cut, "it did not wait for the link");
    until("the board notices", || said(&rig, NO_LINK) == 1);
    thread::sleep(cut.saturating_sub(lost.elapsed()));
    assert!(!rig.turns());
    link(&mut rig, "on");
    until("the link is healed", || said(&rig, HEALED) == 2);
    until("clients reconnect", || answer(&rig, "axis x status").is_some_and(|line| line.starts_with("ok ")));
    assert!(["commander-disconnected", "lease-expired"].contains(&rig.event().as_str()));
    assert!(!rig.turns(), "it does not go on by itself");
    assert_eq!(Modbus::connect(rig.gateway.modbus).read(3, STATUS, 1).map(|words| words.len()), Ok(1));
    feeder.join().expect("fed");
    ends_or_goes_on(idle, b"feed\r\n");
    while stream.read(&mut [0; 512]).is_ok_and(|count| count > 0) {}
    let readings = traffic.join().expect("it has ended");
    assert!(readings > 0);
    // The axis is free for a new commander.
    let (_commander, _) = rig.jogging();
}

/// A DHCP server may give the board another address when the link is back; its own one stays, and so do its connections.
#[test]
fn connections_to_the_boards_own_address_outlast_a_cut_but_no_lease_does() {
    let wire = cell(Mode::Ascii, thesis(), &[1, 2, 3]);
    let own = "dhcp = false\naddress = \"10.0.2.15/24\"\nrouter = \"10.0.2.2\"";
    let gateway = Gateway::start(&Rig::document(Mode::Ascii, 250, &wire, "").net(own));
    let mut rig = Rig { wire, gateway };
    let mut client = Modbus::connect(rig.gateway.modbus);
    assert!(client.read(2, STATUS, 1).is_ok());
    let (mut commander, _) = rig.jogging();
    let lost = Instant::now();
    link(&mut rig, "off");
    until("the board notices", || said(&rig, NO_LINK) > 0);
    rig.stop_after(lost);
    commander.send("axis x status");
    thread::sleep(ms(500));
    link(&mut rig, "on");
    // What was said meanwhile arrives late, over the same connection.
    let status = commander.line();
    assert_eq!(value(&status, "event"), Some("lease-expired"), "{status}");
    assert!(client.read(2, STATUS, 1).is_ok());
}

/// What clients have said when the link is cut: nothing, half a request, requests that wait for the line, half the head of
/// an HTTP request, a request for a long reply, a command.
fn states() -> [(u16, Vec<u8>); 6] {
    let reading = mbap(1, 1, &read_pdu(STATUS, 1));
    let waiting = (0..4).flat_map(|number| mbap(number, 1, &read_pdu(STATUS, 20)));
    [
        (80, Vec::new()),
        (502, reading[..9].to_vec()),
        (502, waiting.collect()),
        (80, b"GET /api/axes HTTP/1.1\r\nHost: ga".to_vec()),
        (80, b"GET / HTTP/1.1\r\nHost: gateway\r\n\r\n".to_vec()),
        (80, b"axis x status\r\n".to_vec()),
    ]
}

/// Free requests, replies and places, seen by a client that takes one of the places.
fn free(host: &mut Host) -> [u64; 3] {
    let asker = host.connect((LEASED, 80));
    let line = host.ask(asker, "system", Duration::from_secs(10));
    host.end(asker);
    let figures =
        |line: String| ["free_requests", "free_replies", "free_places"].map(|key| figure(&line, key));
    line.filter(|line| line.starts_with("ok")).map_or([0; 3], figures)
}

#[test]
fn two_hundred_cuts_with_clients_in_every_state_leak_nothing() {
    const CYCLES: usize = 200;
    const REST: [u64; 3] = [24, 3, 17];
    let (mut rig, mut host, mut server) = beside([10, 0, 2, 77]);
    host.until("the board is at rest", |host| free(host) == REST);
    for cycle in 1..=CYCLES {
        let clients = states().map(|(port, bytes)| (host.connect((LEASED, port)), bytes));
        // Some are cut off while they connect, some when they have just spoken, some later.
        let mut spoken = 0;
        host.lives(ms([0, 1, 5, 20][cycle % 4]), |host| {
            for (client, bytes) in clients.iter().skip(spoken) {
                if !host.tcp(*client).can_send() {
                    break;
                }
                host.tcp(*client).send_slice(bytes).expect("sent");
                spoken += 1;
            }
            false
        });
        link(&mut rig, "off");
        host.until("the board notices", |_| said(&rig, NO_LINK) == cycle);
        // Some of them end while nobody hears it.
        for (client, _) in clients.iter().skip(cycle % 7) {
            host.tcp(*client).close();
        }
        link(&mut rig, "on");
        host.until("the link is healed", |host| {
            server.serve(host);
            said(&rig, HEALED) == cycle + 1
        });
        for (client, _) in clients {
            host.end(client);
        }
    }
    host.until("the board is at rest again", |host| free(host) == REST);
    // Every place listens again, too.
    let clients: Vec<_> = (0..16).map(|number| host.connect((LEASED, [80, 502][number % 2]))).collect();
    let refused = mbap(0, 1, &[0x80, 1]);
    for client in clients {
        host.until("it is connected", |host| host.tcp(client).can_send());
        host.tcp(client).send_slice(&mbap(0, 1, &[0, 0])).expect("sent");
        let mut reply = vec![0; refused.len()];
        host.until("it is answered", |host| host.tcp(client).recv_slice(&mut reply) == Ok(refused.len()));
        assert_eq!(reply, refused);
    }
}

/// Its cable is cut somewhere else: the board's own link stays up.
#[test]
fn a_commander_that_is_gone_without_a_word_is_let_go() {
    let (rig, mut host, _) = beside([10, 0, 2, 77]);
    let [commander, idle] = [80, 502].map(|port| host.connect((LEASED, port)));
    for command in ["axis x enable", "axis x jog 100"] {
        let reply = host.ask(commander, command, Duration::from_secs(10)).expect("an answer");
        assert!(reply.starts_with("ok"), "{reply}");
    }
    host.until("it is connected", |host| host.tcp(idle).can_send());
    assert_eq!(free(&mut host)[2], 15);
    // From here on these two neither hear nor say anything.
    let gone = Instant::now();
    for socket in [commander, idle] {
        let port = host.tcp(socket).local_endpoint().expect("it is connected").port;
        host.cable.lost.push(port);
    }
    rig.stop_after(gone);
    let status = host.connect((LEASED, 80));
    let status = host.ask(status, "axis x status", Duration::from_secs(10)).expect("an answer");
    assert_eq!(value(&status, "event"), Some("lease-expired"), "{status}");
    host.until("both are let go", |host| free(host)[2] == 16);
    println!("let go after {:?}", gone.elapsed());
}

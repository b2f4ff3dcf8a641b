//! The board's name, asked for as other hosts do, and read by an independent decoder.

use std::net::Ipv4Addr;
use std::time::Duration;

use simple_dns::rdata::{A, RData};
use simple_dns::{CLASS, Name, Packet, QCLASS, QTYPE, Question, TYPE};
use smoltcp::iface::SocketHandle;
use smoltcp::wire::{EthernetAddress, EthernetFrame, Ipv4Packet, UdpPacket};

use crate::common::ethernet::{Host, datagram};
use crate::{LEASED, beside};

const GROUP: Ipv4Addr = Ipv4Addr::new(224, 0, 0, 251);
const GROUP_MAC: EthernetAddress = EthernetAddress([0x01, 0x00, 0x5E, 0, 0, 251]);
const PORT: u16 = 5353;
const OWN: [u8; 4] = [10, 0, 2, 77];

fn query(id: u16, name: &str, kind: TYPE, unicast: bool) -> Vec<u8> {
    let mut packet = Packet::new_query(id);
    let name = Name::new(name).expect("a name");
    packet.questions.push(Question::new(name, QTYPE::TYPE(kind), QCLASS::CLASS(CLASS::IN), unicast));
    packet.build_bytes_vec().expect("bytes")
}

/// The answers of a message, as text.
fn answers(message: &[u8]) -> Vec<String> {
    let packet = Packet::parse(message).expect("a message");
    let told = packet.answers.iter().map(|record| match &record.rdata {
        RData::A(A { address }) => format!("{} A {}", record.name, Ipv4Addr::from(*address)),
        RData::PTR(name) => format!("{} PTR {}", record.name, name.0),
        RData::SRV(srv) => format!("{} SRV {} {}", record.name, srv.port, srv.target),
        RData::TXT(_) => format!("{} TXT", record.name),
        other => format!("{} {other:?}", record.name),
    });
    told.collect()
}

const ADDRESS: &str = "puente.local A 10.0.2.15";

/// The answers to a question to the group, asked again every second as resolvers do. Whether they came to the group.
fn ask(host: &mut Host, socket: SocketHandle, query: &[u8]) -> (Vec<String>, bool) {
    while host.datagram(socket).is_some() {}
    let mut heard = None;
    for _ in 0..20 {
        host.send(socket, query, (GROUP, PORT));
        let answered = host.lives(Duration::from_secs(1), |host| {
            heard = host.datagram(socket);
            heard.is_some()
        });
        if answered {
            break;
        }
    }
    let (bytes, meta) = heard.expect("an answer");
    assert_eq!(meta.endpoint.to_string(), "10.0.2.15:5353");
    (answers(&bytes), meta.local_address == Some(GROUP.into()))
}

#[test]
fn the_board_is_found_by_its_name_and_by_its_services() {
    let (_rig, mut host, _) = beside(OWN);
    host.cable.kept = Some(Vec::new());
    let socket = host.udp(PORT, Some(GROUP));
    // It tells all of itself twice, a second apart.
    let mut announced = Vec::new();
    host.until("it announces itself", |host| {
        announced.extend(host.datagram(socket));
        announced.len() == 2
    });
    for (bytes, _) in announced {
        let mut told = answers(&bytes);
        told.sort();
        assert_eq!(
            told,
            [
                "_http._tcp.local PTR puente._http._tcp.local",
                "_modbus._tcp.local PTR puente._modbus._tcp.local",
                "_services._dns-sd._udp.local PTR _http._tcp.local",
                "_services._dns-sd._udp.local PTR _modbus._tcp.local",
                "puente._http._tcp.local SRV 80 puente.local",
                "puente._http._tcp.local TXT",
                "puente._modbus._tcp.local SRV 502 puente.local",
                "puente._modbus._tcp.local TXT",
                ADDRESS,
            ]
        );
    }
    for (name, kind, expected) in [
        ("puente.local", TYPE::A, vec![ADDRESS]),
        ("_http._tcp.local", TYPE::PTR, vec!["_http._tcp.local PTR puente._http._tcp.local"]),
        ("puente._http._tcp.local", TYPE::SRV, vec!["puente._http._tcp.local SRV 80 puente.local"]),
        ("puente._modbus._tcp.local", TYPE::SRV, vec!["puente._modbus._tcp.local SRV 502 puente.local"]),
        (
            "_services._dns-sd._udp.local",
            TYPE::PTR,
            vec![
                "_services._dns-sd._udp.local PTR _http._tcp.local",
                "_services._dns-sd._udp.local PTR _modbus._tcp.local",
            ],
        ),
    ] {
        let (told, to_group) = ask(&mut host, socket, &query(0, name, kind, false));
        assert_eq!((told, to_group), (expected.iter().map(ToString::to_string).collect(), true), "{name}");
    }
    // Who wishes it is answered alone, and so is who does not know mDNS.
    let alone = (vec![ADDRESS.to_owned()], false);
    assert_eq!(ask(&mut host, socket, &query(0, "puente.local", TYPE::A, true)), alone);
    let plain = host.udp(40_000, None);
    assert_eq!(ask(&mut host, plain, &query(7, "puente.local", TYPE::A, false)), alone);
    all_as_the_standard_wants(&host.cable.kept.expect("frames"));
}

/// That what went to the group is marked as not routed: 255 hops (RFC 6762, clause 11), and the group's MAC address.
fn all_as_the_standard_wants(frames: &[Vec<u8>]) {
    let mut found = 0;
    for frame in frames {
        let frame = EthernetFrame::new_checked(frame.as_slice()).expect("a frame");
        let Ok(ip) = Ipv4Packet::new_checked(frame.payload()) else { continue };
        if ip.dst_addr() == GROUP && ip.src_addr() == Ipv4Addr::from(LEASED) {
            let Ok(udp) = UdpPacket::new_checked(ip.payload()) else { continue };
            // Those of IGMP are another matter.
            if udp.src_port() == PORT {
                assert_eq!((ip.hop_limit(), frame.dst_addr(), udp.dst_port()), (255, GROUP_MAC, PORT));
                found += 1;
            }
        }
    }
    assert!(found >= 7, "{found} answers to the group");
}

#[test]
fn no_message_keeps_the_board_from_answering_the_next_one() {
    let (rig, mut host, _) = beside(OWN);
    let socket = host.udp(PORT, Some(GROUP));
    let mut announcements = 0;
    host.until("it has announced itself", |host| {
        announcements += usize::from(host.datagram(socket).is_some());
        announcements == 2
    });
    let question = query(0, "puente.local", TYPE::A, true);
    let mut bad: Vec<Vec<u8>> =
        vec![vec![], vec![0; 11], vec![0xFF; 1400], query(0, "x.local", TYPE::A, false)];
    bad.extend((0..question.len()).map(|length| question[..length].to_vec()));
    bad.extend((0..question.len()).map(|at| {
        let mut bytes = question.clone();
        bytes[at] ^= 0xC0;
        bytes
    }));
    // A name that points to itself.
    bad.push([&[0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0][..], &[0xC0, 12, 0, 1, 0, 1]].concat());
    for bytes in bad {
        host.send(socket, &bytes, (GROUP, PORT));
    }
    let expected = (vec![ADDRESS.to_owned()], false);
    assert_eq!(ask(&mut host, socket, &question), expected);
    // Askers that are not there, and one that is on no network here.
    for (ip, port) in [([10, 0, 2, 98], 40_000), ([10, 0, 2, 99], 40_001), ([172, 16, 0, 1], 40_002)] {
        let nobody = EthernetAddress([2, 0, 0, 0, 0, 0x99]);
        host.cable.send(&datagram((nobody, ip, port), (GROUP_MAC, GROUP.octets(), PORT), &question));
    }
    assert_eq!(ask(&mut host, socket, &question), expected);
    // Longer ones than it hears, and more than it has room for.
    for _ in 0..200 {
        host.send(socket, &[0; 1200], (LEASED.into(), PORT));
        host.send(socket, &question, (LEASED.into(), PORT));
    }
    assert_eq!(ask(&mut host, socket, &question), expected);
    assert!(!rig.gateway.log().contains("panicked"));
}

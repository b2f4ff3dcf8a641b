//! What is answered, read by an independent decoder.

use std::net::Ipv4Addr;

use proptest::collection::vec;
use proptest::prelude::*;
use puente_mdns::{Answer, Host, LONGEST, NAME, PORT, Service, To};
use simple_dns::rdata::{A, PTR, RData};
use simple_dns::{CLASS, Name, Packet, PacketFlag, QCLASS, QTYPE, Question, ResourceRecord, TYPE};

const SERVICES: [Service; 2] = [Service { name: "_http", port: 80 }, Service { name: "_modbus", port: 502 }];
const HOST: Host<'_> = Host { name: "puente", address: Ipv4Addr::new(192, 168, 1, 111), services: &SERVICES };
const ALONE: To = To::Group { shared: false };
const SHARED: To = To::Group { shared: true };

fn question(name: &str, kind: QTYPE, unicast: bool) -> Question<'_> {
    Question::new(Name::new(name).expect("a name"), kind, QCLASS::CLASS(CLASS::IN), unicast)
}

fn query(questions: &[(&str, TYPE)]) -> Vec<u8> {
    let mut packet = Packet::new_query(0);
    packet.questions =
        questions.iter().map(|(name, kind)| question(name, QTYPE::TYPE(*kind), false)).collect();
    packet.build_bytes_vec().expect("bytes")
}

fn ask(questions: &[(&str, TYPE)]) -> Option<Answer> {
    HOST.answer(&query(questions), PORT)
}

/// Records as text: the name, the class' top bit as `!`, the time to live, and the data.
fn told(records: &[ResourceRecord<'_>]) -> Vec<String> {
    let data = |record: &ResourceRecord<'_>| match &record.rdata {
        RData::A(A { address }) => format!("A {}", Ipv4Addr::from(*address)),
        RData::PTR(PTR(name)) => format!("PTR {name}"),
        RData::SRV(srv) => format!("SRV {} {} {} {}", srv.priority, srv.weight, srv.port, srv.target),
        RData::TXT(txt) => format!("TXT {:?}", txt.attributes()),
        RData::NSEC(nsec) => {
            let maps = nsec.type_bit_maps.iter();
            let maps: Vec<_> = maps.map(|map| (map.window_block, map.bitmap.to_vec())).collect();
            format!("NSEC {} {maps:?}", nsec.next_name)
        }
        other => panic!("unexpected: {other:?}"),
    };
    let line = |record: &ResourceRecord<'_>| {
        let unique = if record.cache_flush { "!" } else { "" };
        format!("{}{unique} {} {}", record.name, record.ttl, data(record))
    };
    records.iter().map(line).collect()
}

/// To whom, the answers, and what else is told.
fn read(answer: Option<Answer>) -> (To, Vec<String>, Vec<String>) {
    let answer = answer.expect("an answer");
    let packet = Packet::parse(&answer.bytes).expect("a message");
    assert!(packet.has_flags(PacketFlag::RESPONSE | PacketFlag::AUTHORITATIVE_ANSWER));
    assert!(packet.name_servers.is_empty());
    (answer.to, told(&packet.answers), told(&packet.additional_records))
}

const ADDRESS: &str = "puente.local! 120 A 192.168.1.111";
const HTTP: [&str; 3] = [
    "_http._tcp.local 4500 PTR puente._http._tcp.local",
    "puente._http._tcp.local! 120 SRV 0 0 80 puente.local",
    "puente._http._tcp.local! 4500 TXT {}",
];
const MODBUS: [&str; 3] = [
    "_modbus._tcp.local 4500 PTR puente._modbus._tcp.local",
    "puente._modbus._tcp.local! 120 SRV 0 0 502 puente.local",
    "puente._modbus._tcp.local! 4500 TXT {}",
];
const KINDS: [&str; 2] = [
    "_services._dns-sd._udp.local 4500 PTR _http._tcp.local",
    "_services._dns-sd._udp.local 4500 PTR _modbus._tcp.local",
];

#[test]
fn the_address() {
    for name in ["puente.local", "PUENTE.Local"] {
        let (to, answers, more) = read(ask(&[(name, TYPE::A)]));
        assert_eq!((to, answers, more), (ALONE, vec![ADDRESS.to_owned()], vec![]));
    }
}

#[test]
fn the_kinds_of_services_and_who_offers_them() {
    let (to, answers, more) = read(ask(&[("_services._dns-sd._udp.local", TYPE::PTR)]));
    assert_eq!((to, more), (SHARED, vec![]));
    assert_eq!(answers, KINDS);
    for (kind, [instance, server, text]) in [("_http._tcp.local", HTTP), ("_modbus._tcp.local", MODBUS)] {
        let (to, answers, more) = read(ask(&[(kind, TYPE::PTR)]));
        assert_eq!((to, answers), (SHARED, vec![instance.to_owned()]));
        assert_eq!(more, [ADDRESS, server, text]);
    }
}

#[test]
fn the_server_and_the_text_of_a_service() {
    let (to, answers, more) = read(ask(&[("puente._http._tcp.local", TYPE::SRV)]));
    assert_eq!((to, answers, more), (ALONE, vec![HTTP[1].to_owned()], vec![ADDRESS.to_owned()]));
    let (to, answers, more) = read(ask(&[("puente._modbus._tcp.local", TYPE::TXT)]));
    assert_eq!((to, answers, more), (ALONE, vec![MODBUS[2].to_owned()], vec![]));
}

#[test]
fn several_questions_get_one_answer() {
    let (to, answers, more) = read(ask(&[("puente.local", TYPE::A), ("_http._tcp.local", TYPE::PTR)]));
    assert_eq!((to, answers), (SHARED, vec![ADDRESS.to_owned(), HTTP[0].to_owned()]));
    assert_eq!(more, HTTP[1..]);
}

#[test]
fn a_question_for_any_record_gets_all_of_the_name() {
    let mut packet = Packet::new_query(0);
    packet.questions.push(question("puente._http._tcp.local", QTYPE::ANY, false));
    let (_, answers, _) = read(HOST.answer(&packet.build_bytes_vec().expect("bytes"), PORT));
    assert_eq!(answers, HTTP[1..]);
}

/// Without this a PC that wants an IPv6 address too waits for it for seconds.
#[test]
fn that_there_is_no_ipv6_address_is_said() {
    let (to, answers, more) = read(ask(&[("puente.local", TYPE::AAAA)]));
    assert_eq!((to, more), (ALONE, vec![]));
    assert_eq!(answers, ["puente.local! 120 NSEC puente.local [(0, [64])]"]);
}

#[test]
fn what_is_not_asked_of_this_host_is_not_answered() {
    for (name, kind) in [
        ("puente-2.local", TYPE::A),
        ("puente", TYPE::A),
        ("puente.lan", TYPE::A),
        ("x.puente.local", TYPE::A),
        ("local", TYPE::A),
        ("_ipp._tcp.local", TYPE::PTR),
        ("other._http._tcp.local", TYPE::SRV),
        ("_http._tcp.local", TYPE::A),
    ] {
        assert_eq!(ask(&[(name, kind)]), None, "{name}");
    }
    let mut packet = Packet::new_query(0);
    let chaos = QCLASS::CLASS(CLASS::CH);
    packet.questions.push(Question::new(
        Name::new("puente.local").expect("a name"),
        QTYPE::TYPE(TYPE::A),
        chaos,
        false,
    ));
    assert_eq!(HOST.answer(&packet.build_bytes_vec().expect("bytes"), PORT), None);
}

#[test]
fn who_asks_for_it_is_answered_alone() {
    let mut packet = Packet::new_query(0);
    packet.questions.push(question("puente.local", QTYPE::TYPE(TYPE::A), true));
    let (to, answers, _) = read(HOST.answer(&packet.build_bytes_vec().expect("bytes"), PORT));
    assert_eq!((to, answers), (To::Asker, vec![ADDRESS.to_owned()]));
    // One question of two is for all.
    packet.questions.push(question("_http._tcp.local", QTYPE::TYPE(TYPE::PTR), false));
    assert_eq!(read(HOST.answer(&packet.build_bytes_vec().expect("bytes"), PORT)).0, SHARED);
}

#[test]
fn who_does_not_know_mdns_gets_a_dns_answer() {
    let mut packet = Packet::new_query(0x1234);
    packet.questions.push(question("puente.local", QTYPE::TYPE(TYPE::A), false));
    let answer = HOST.answer(&packet.build_bytes_vec().expect("bytes"), 40_000).expect("an answer");
    assert_eq!(answer.to, To::Asker);
    let packet = Packet::parse(&answer.bytes).expect("a message");
    assert_eq!(packet.id(), 0x1234);
    let [asked] = &packet.questions[..] else { panic!("{:?}", packet.questions) };
    assert_eq!((asked.qname.to_string(), asked.qtype), ("puente.local".to_owned(), QTYPE::TYPE(TYPE::A)));
    assert_eq!(told(&packet.answers), ["puente.local 10 A 192.168.1.111"]);
}

#[test]
fn what_the_asker_knows_is_not_repeated() {
    let asked = |ttl: u32, target: &'static str| {
        let mut packet = Packet::new_query(0);
        packet.questions.push(question("_http._tcp.local", QTYPE::TYPE(TYPE::PTR), false));
        let known = RData::PTR(PTR(Name::new(target).expect("a name")));
        let name = Name::new("_http._tcp.local").expect("a name");
        packet.answers.push(ResourceRecord::new(name, CLASS::IN, ttl, known));
        HOST.answer(&packet.build_bytes_vec_compressed().expect("bytes"), PORT)
    };
    assert_eq!(asked(4000, "puente._http._tcp.local"), None);
    assert!(asked(2000, "puente._http._tcp.local").is_some(), "it will soon be forgotten");
    assert!(asked(4000, "other._http._tcp.local").is_some(), "it is another's");
    let mut packet = Packet::new_query(0);
    packet.questions.push(question("puente.local", QTYPE::TYPE(TYPE::A), false));
    let name = Name::new("puente.local").expect("a name");
    let known = |ip: [u8; 4]| RData::A(A { address: u32::from_be_bytes(ip) });
    packet.answers.push(ResourceRecord::new(name.clone(), CLASS::IN, 100, known([192, 168, 1, 111])));
    assert_eq!(HOST.answer(&packet.build_bytes_vec().expect("bytes"), PORT), None);
    packet.answers[0] = ResourceRecord::new(name, CLASS::IN, 100, known([192, 168, 1, 112]));
    assert!(HOST.answer(&packet.build_bytes_vec().expect("bytes"), PORT).is_some());
}

#[test]
fn the_announcement_tells_all_and_is_no_query() {
    let bytes = HOST.announcement().expect("it fits");
    let packet = Packet::parse(&bytes).expect("a message");
    let all: Vec<&str> =
        [ADDRESS].into_iter().chain([KINDS[0]]).chain(HTTP).chain([KINDS[1]]).chain(MODBUS).collect();
    assert_eq!(told(&packet.answers), all);
    assert_eq!(HOST.answer(&bytes, PORT), None, "two hosts do not go on answering each other");
}

#[test]
fn the_longest_name_fits_and_a_longer_one_says_nothing() {
    let longest = "p".repeat(NAME);
    let host = Host { name: &longest, ..HOST };
    let bytes = host.announcement().expect("it fits");
    assert_eq!(Packet::parse(&bytes).expect("a message").answers.len(), 9);
    let mut packet = Packet::new_query(0);
    let names = ["L.local", "_services._dns-sd._udp.local", "_http._tcp.local", "_modbus._tcp.local"];
    let instances = ["L._http._tcp.local", "L._modbus._tcp.local"];
    let names: Vec<_> = names.iter().chain(&instances).map(|name| name.replace('L', &longest)).collect();
    packet.questions = names.iter().map(|name| question(name, QTYPE::ANY, false)).collect();
    packet.questions.push(question(&names[0], QTYPE::TYPE(TYPE::AAAA), false));
    let answer = host.answer(&packet.build_bytes_vec().expect("bytes"), PORT).expect("it fits");
    assert_eq!(Packet::parse(&answer.bytes).expect("a message").answers.len(), 10);
    for name in ["p".repeat(NAME + 1), String::new()] {
        assert_eq!(Host { name: &name, ..HOST }.announcement(), None);
    }
}

fn names() -> impl Strategy<Value = String> {
    let own = [
        "puente.local",
        "_services._dns-sd._udp.local",
        "_http._tcp.local",
        "_modbus._tcp.local",
        "puente._http._tcp.local",
        "puente._modbus._tcp.local",
    ];
    let own = proptest::sample::select(own.to_vec()).prop_map(str::to_owned);
    prop_oneof![4 => own, 1 => "[a-z_]{1,20}(\\.[a-z]{1,10}){0,3}"]
}

fn questions() -> impl Strategy<Value = Vec<(String, TYPE, bool)>> {
    let kinds = vec![TYPE::A, TYPE::AAAA, TYPE::PTR, TYPE::SRV, TYPE::TXT, TYPE::NSEC, TYPE::MX];
    vec((names(), proptest::sample::select(kinds), any::<bool>()), 0..40)
}

/// Whatever is answered can be read, and is no longer than it may be.
fn check(message: &[u8], port: u16) {
    if let Some(answer) = HOST.answer(message, port) {
        assert!(answer.bytes.len() <= LONGEST);
        let packet = Packet::parse(&answer.bytes).expect("a message");
        assert!(!packet.answers.is_empty());
        assert_eq!(HOST.answer(&answer.bytes, PORT), None);
    }
}

proptest! {
    #[test]
    fn no_bytes_do_harm(bytes in vec(any::<u8>(), 0..600), port in any::<u16>()) {
        check(&bytes, port);
        check(&bytes, PORT);
    }

    #[test]
    fn no_query_does_harm_whatever_bytes_of_it_are_wrong(
        questions in questions(),
        compressed in any::<bool>(),
        wrong in vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
        cut in any::<prop::sample::Index>(),
    ) {
        let mut packet = Packet::new_query(7);
        packet.questions = questions.iter().map(|(name, kind, unicast)| question(name, QTYPE::TYPE(*kind), *unicast)).collect();
        let bytes = if compressed { packet.build_bytes_vec_compressed() } else { packet.build_bytes_vec() };
        let mut bytes = bytes.expect("bytes");
        for port in [PORT, 1] {
            check(&bytes, port);
        }
        for (at, byte) in wrong {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        bytes.truncate(cut.index(bytes.len()) + 1);
        for port in [PORT, 1] {
            check(&bytes, port);
        }
    }
}

/// A name that points to itself, to another that points back, or behind itself, is no name.
#[test]
fn names_that_run_in_circles_are_refused() {
    let head = |questions: u8| [0, 0, 0, 0, 0, questions, 0, 0, 0, 0, 0, 0];
    for name in [&[0xC0, 12][..], &[0xC0, 14, 0xC0, 12], &[0xC0, 255], &[1, b'p', 0xC0, 12]] {
        let message = [&head(1)[..], name, &[0, 1, 0, 1]].concat();
        assert_eq!(HOST.answer(&message, PORT), None, "{name:?}");
    }
    let many = [&[0, 0, 0, 0, 255, 255, 0, 0, 0, 0, 0, 0][..], &[0, 0, 1, 0, 1].repeat(200)].concat();
    assert_eq!(HOST.answer(&many, PORT), None);
}

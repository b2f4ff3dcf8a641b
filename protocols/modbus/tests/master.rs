//! Properties of the master, and a model of a line with faulty slaves.

mod common;

use std::collections::VecDeque;
use std::time::Duration;

use common::{End, Rig, adu, config, micros};
use proptest::collection::vec;
use proptest::prelude::*;
use puente_line::Instant;
use puente_modbus::reply::Reply;
use puente_modbus::{Action, Config, Counters, Echo, Master, Mode, Outcome};

fn modes() -> impl Strategy<Value = Mode> {
    prop_oneof![Just(Mode::Rtu), Just(Mode::Ascii)]
}

fn echoes() -> impl Strategy<Value = Echo> {
    prop_oneof![4 => Just(Echo::Off), 1 => Just(Echo::Strip), 1 => Just(Echo::Verify)]
}

/// Requests of every kind of length: exact, counted, opaque.
fn requests() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![
        (1..=4_u8, 1..=3_u8).prop_map(|(function, quantity)| vec![function, 0, 0, 0, quantity]),
        Just(vec![6, 0, 0x25, 0, 0x64]),
        Just(vec![8, 0, 0, 1, 2]),
        Just(vec![0x10, 0, 1, 0, 1, 2, 0, 7]),
        Just(vec![0x11]),
        Just(vec![0x2B, 0x0E, 1, 0]),
        Just(vec![0x41, 1, 2]),
    ]
}

/// A reply to one of `requests`.
fn reply_to(request: &[u8]) -> Vec<u8> {
    match *request {
        [function @ 1..=2, .., quantity] => {
            let bytes = quantity.div_ceil(8);
            [vec![function, bytes], vec![quantity; bytes.into()]].concat()
        }
        [function @ 3..=4, .., quantity] => {
            [vec![function, 2 * quantity], vec![quantity; 2 * usize::from(quantity)]].concat()
        }
        [0x10, ..] => request[..5].to_vec(),
        [0x11] => vec![0x11, 2, 9, 0xFF],
        [0x2B, ..] => vec![0x2B, 0x0E, 1, 0x81, 0, 0, 1, 0, 2, 0x41, 0x42],
        _ => request.to_vec(),
    }
}

/// Something that a line may say: a valid frame, whole or maimed, or noise.
fn utterances(mode: Mode) -> impl Strategy<Value = Vec<u8>> {
    let pdus = prop_oneof![
        vec(any::<u8>(), 1..=8),
        requests(),
        requests().prop_map(|request| reply_to(&request)),
        (1..=4_u8, vec(any::<u8>(), 0..=20)).prop_map(|(function, data)| [
            vec![function, data.len() as u8],
            data
        ]
        .concat()),
        (1..=0x41_u8, 1..=4_u8).prop_map(|(function, code)| vec![function | 0x80, code]),
        vec(any::<u8>(), 1..=6).prop_map(|data| [vec![0x41], data].concat()),
    ];
    let frames = (0..=3_u8, pdus).prop_map(move |(unit, pdu)| adu(mode, unit, &pdu));
    prop_oneof![
        4 => frames.clone(),
        1 => (frames.clone(), any::<prop::sample::Index>(), any::<u8>()).prop_map(|(mut frame, at, byte)| {
            let at = at.index(frame.len());
            frame[at] = byte;
            frame
        }),
        1 => (frames, any::<prop::sample::Index>()).prop_map(|(mut frame, at)| {
            frame.truncate(at.index(frame.len()));
            frame
        }),
        1 => vec(any::<u8>(), 0..=12),
        1 => vec(prop::sample::select(&b":0123456789abcdefABCDEF\r\n"[..]), 0..=24),
    ]
}

/// Bursts with the pauses before them, in microseconds: none, short ones, and some beyond t3.5 or the deadline.
fn talk(mode: Mode) -> impl Strategy<Value = Vec<(u64, Vec<u8>)>> {
    let pauses = prop_oneof![Just(0), 1..1_500_u64, 2_006..20_000_u64, 100_000..900_000_u64];
    vec((pauses, utterances(mode)), 0..12)
}

#[derive(Clone, Debug)]
struct Scenario {
    config: Config,
    requests: VecDeque<(u8, Vec<u8>)>,
    talk: Vec<(u64, Vec<u8>)>,
}

fn scenarios() -> impl Strategy<Value = Scenario> {
    (modes(), echoes(), vec((0..=3_u8, requests()), 1..5)).prop_flat_map(|(mode, echo, requests)| {
        talk(mode).prop_map(move |talk| Scenario {
            config: Config { echo, ..config(mode) },
            requests: requests.clone().into(),
            talk,
        })
    })
}

/// What a master did, in order.
#[derive(Debug, PartialEq, Eq)]
enum Deed {
    Sent(Instant, Vec<u8>),
    Done(End),
}

/// Plays a scenario: bursts are received in portions of `portion` bytes; if `eager`, the master is polled after
/// each though nothing is due. Requests are submitted as soon as the master is idle.
fn play(scenario: &Scenario, portion: usize, eager: bool) -> (Vec<Deed>, Counters) {
    let mut master = Master::new(scenario.config);
    let mut requests = scenario.requests.clone();
    let mut deeds = Vec::new();
    let mut now = Instant::from_millis(5_000);
    let mut bursts: VecDeque<_> = scenario.talk.clone().into();
    settle(&mut master, &mut requests, now, &mut deeds);
    loop {
        // Up to the next burst, or for long enough after the last one.
        let until = now + bursts.front().map_or(Duration::from_secs(60), |(pause, _)| micros(*pause));
        while let Some(at) = master.poll_at().filter(|at| *at <= until) {
            now = now.max(at);
            settle(&mut master, &mut requests, now, &mut deeds);
        }
        now = until;
        let Some((_, bytes)) = bursts.pop_front() else {
            return (deeds, master.counters());
        };
        for chunk in bytes.chunks(portion) {
            master.receive(now, chunk);
            if eager && master.poll_at().is_none_or(|at| at > now) {
                assert_eq!(master.poll(now), Action::Idle);
            }
        }
        settle(&mut master, &mut requests, now, &mut deeds);
    }
}

/// Polls until the master has nothing to do at `now`.
fn settle(master: &mut Master, requests: &mut VecDeque<(u8, Vec<u8>)>, now: Instant, deeds: &mut Vec<Deed>) {
    loop {
        if let Some((unit, pdu)) = requests.front()
            && master.submit(*unit, pdu).is_ok()
        {
            requests.pop_front();
        }
        deeds.push(match master.poll(now) {
            Action::Transmit(bytes) => Deed::Sent(now, bytes.to_vec()),
            Action::Done(Outcome::Reply(pdu)) => Deed::Done(End::Reply(pdu.to_vec())),
            Action::Done(Outcome::Broadcast) => Deed::Done(End::Broadcast),
            Action::Done(Outcome::NoReply(evidence)) => Deed::Done(End::NoReply(evidence)),
            Action::Idle => break,
        });
    }
    let due = master.poll_at();
    assert!(due.is_none_or(|due| due > now), "poll would spin at {due:?}, now {now:?}");
}

/// Whether `bytes` hold the frame `adu`, in digits of either case for ASCII.
fn holds(mode: Mode, bytes: &[u8], adu: &[u8]) -> bool {
    match mode {
        Mode::Rtu => bytes.windows(adu.len()).any(|window| window == adu),
        Mode::Ascii => {
            let adu = adu.strip_suffix(b"\r\n").unwrap_or(adu);
            bytes.windows(adu.len()).any(|window| window.eq_ignore_ascii_case(adu))
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    /// In whatever portions bytes come, the same follows from them.
    #[test]
    fn portions_make_no_difference(scenario in scenarios(), portion in 1..9_usize) {
        let whole = play(&scenario, usize::MAX, false);
        prop_assert_eq!(&whole, &play(&scenario, portion, false));
        prop_assert_eq!(&whole, &play(&scenario, portion, true));
    }

    /// Every request sent comes to exactly one end; a reply pairs with its request and was on the wire, after it, for its
    /// unit. No transmission breaks the silence.
    #[test]
    fn replies_pair(scenario in scenarios()) {
        let (deeds, counters) = play(&scenario, usize::MAX, false);
        let mode = scenario.config.mode;
        let all: Vec<u8> = scenario.talk.iter().flat_map(|(_, bytes)| bytes.clone()).collect();
        let mut ends = deeds.iter().filter(|deed| matches!(deed, Deed::Done(_)));
        for (unit, request) in &scenario.requests {
            let Some(Deed::Done(end)) = ends.next() else {
                panic!("no end of {request:02X?}");
            };
            if let End::Reply(pdu) = end {
                prop_assert!(*unit != 0);
                prop_assert!(Reply::parse(request, pdu).is_ok(), "{:02X?} to {:02X?}", pdu, request);
                prop_assert!(holds(mode, &all, &adu(mode, *unit, pdu)));
            } else {
                prop_assert_eq!(*unit == 0, matches!(end, End::Broadcast) || scenario.config.echo != Echo::Off && *unit == 0);
            }
        }
        prop_assert_eq!(ends.next(), None);
        let sent = deeds.iter().filter(|deed| matches!(deed, Deed::Sent(..))).count();
        prop_assert_eq!(sent, scenario.requests.len());
        prop_assert_eq!(counters.requests as usize, sent);
        prop_assert!(counters.garbage_bytes as usize <= all.len());
        let mut at = Instant::from_millis(5_000);
        let arrivals: Vec<_> = scenario.talk.iter().filter_map(|(pause, bytes)| {
            at += micros(*pause);
            (!bytes.is_empty()).then_some(at)
        }).collect();
        let gap = match mode {
            Mode::Rtu => puente_modbus::rtu::t3_5(scenario.config.line),
            Mode::Ascii => puente_modbus::rtu::t1_5(scenario.config.line),
        };
        for deed in &deeds {
            if let Deed::Sent(moment, _) = deed {
                prop_assert!(!arrivals.iter().any(|arrival| *arrival < *moment && *moment < *arrival + gap));
            }
        }
    }
}

/// What the slave of one transaction does.
#[derive(Clone, Copy, Debug)]
enum Fault {
    None,
    Silent,
    /// After the deadline, within the quarantine.
    Late(u64),
    Corrupt(prop::sample::Index),
    Truncated(prop::sample::Index),
    WrongUnit,
    WrongFunction,
    WrongCount,
    GarbageBefore,
    GarbageBehind,
    EchoedRequest,
    Duplicate,
    Exception,
}

fn faults() -> impl Strategy<Value = Fault> {
    prop_oneof![
        6 => Just(Fault::None),
        1 => Just(Fault::Silent),
        3 => (0..450_u64).prop_map(Fault::Late),
        1 => any::<prop::sample::Index>().prop_map(Fault::Corrupt),
        1 => any::<prop::sample::Index>().prop_map(Fault::Truncated),
        1 => Just(Fault::WrongUnit),
        1 => Just(Fault::WrongFunction),
        1 => Just(Fault::WrongCount),
        1 => Just(Fault::GarbageBefore),
        1 => Just(Fault::GarbageBehind),
        1 => Just(Fault::EchoedRequest),
        1 => Just(Fault::Duplicate),
        1 => Just(Fault::Exception),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// A line with three slaves, each transaction with a fault or none. Every value read carries the number of its request,
    /// so that a reply to any other request is recognised.
    #[test]
    fn a_line_of_faulty_slaves(
        mode in modes(),
        steps in vec((1..=3_u8, 1..=4_u8, any::<bool>(), faults()), 1..40),
    ) {
        let mut rig = Rig::new(config(mode));
        for (serial, (unit, quantity, input, fault)) in steps.into_iter().enumerate() {
            let function = if input { 4 } else { 3 };
            let request = [function, 0, serial as u8, 0, quantity];
            let data: Vec<u8> = (0..quantity).flat_map(|index| [serial as u8 ^ 0xA0, index << 4 | unit]).collect();
            let reply = [vec![function, data.len() as u8], data].concat();
            // A scripted slave does not talk while another one does.
            let disturbed = rig.coming.iter().any(|(at, _)| *at <= rig.now.max(rig.master.ready_at(unit)) + micros(1_000_000));
            rig.send(unit, &request);
            let whole = rig.adu(unit, &reply);
            let own = rig.adu(unit, &request);
            let wire = rig.config.line.wire_time(own.len());
            let delay = wire + micros(8_000);
            let mut good = true;
            match fault {
                Fault::None => rig.bytes(delay, &whole),
                Fault::Silent => good = false,
                Fault::Late(millis) => {
                    rig.bytes(wire + rig.config.reply_timeout + micros(1_000 * millis), &whole);
                    good = false;
                }
                Fault::Corrupt(at) => {
                    let mut frame = whole.clone();
                    let at = at.index(frame.len());
                    frame[at] ^= 0x01;
                    rig.bytes(delay, &frame);
                    good = false;
                }
                Fault::Truncated(at) => {
                    rig.bytes(delay, &whole[..at.index(whole.len())]);
                    good = false;
                }
                Fault::WrongUnit => {
                    let frame = rig.adu(unit + 1, &reply);
                    rig.bytes(delay, &frame);
                    good = false;
                }
                Fault::WrongFunction => {
                    let frame = rig.adu(unit, &[vec![7 - function], reply[1..].to_vec()].concat());
                    rig.bytes(delay, &frame);
                    good = false;
                }
                Fault::WrongCount => {
                    let frame = rig.adu(unit, &[function, 2 * quantity + 2, 1, 2]);
                    rig.bytes(delay, &frame);
                    good = false;
                }
                Fault::GarbageBefore => {
                    let noise = [&[0x00, unit, 0xFE][..], &whole].concat();
                    rig.bytes(delay, &noise);
                }
                Fault::GarbageBehind => {
                    let noise = [&whole[..], &[0x00, unit, 0xFE]].concat();
                    rig.bytes(delay, &noise);
                }
                Fault::EchoedRequest => {
                    rig.bytes(micros(100), &own);
                    rig.bytes(delay, &whole);
                }
                Fault::Duplicate => {
                    let twice = [whole.clone(), whole.clone()].concat();
                    rig.bytes(delay, &twice);
                }
                Fault::Exception => {
                    let frame = rig.adu(unit, &[function | 0x80, 4]);
                    rig.bytes(delay, &frame);
                }
            }
            let end = rig.finish();
            match &end {
                End::Reply(pdu) if matches!(fault, Fault::Exception) => prop_assert_eq!(&pdu[..], &[function | 0x80, 4][..]),
                End::Reply(pdu) => prop_assert_eq!(pdu, &reply),
                End::Broadcast => panic!("nothing was broadcast"),
                End::NoReply(_) => {}
            }
            if !disturbed {
                prop_assert_eq!(matches!(end, End::Reply(_)), good, "{:?}", end);
            }
        }
    }
}

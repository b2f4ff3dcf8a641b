//! Stations outside: what they say comes at any time, and they hear what is on the line.

mod common;

use std::time::Duration;

use common::fast;
use puente_framed::arbiter::Failure;
use puente_framed::frame::MAX_FRAME;
use puente_framed::station::{Action, Config};
use puente_framed::{Kind, Station, section};
use puente_line::Instant;
use puente_shared_line::external::External;
use puente_shared_line::talker::{Load, Talker, frame_of};
use puente_shared_line::{Line, Node, Place};

const fn at(micros: u64) -> Instant {
    Instant::from_micros(micros)
}

/// 10 us a character; transceivers that turn round at once, and nobody is judged.
fn place() -> Place {
    Place { turnaround: Duration::ZERO, jitter: Duration::ZERO, judged: false, ..Place::new(fast()) }
}

fn two() -> Line<External> {
    let mut line = Line::new(fast(), Duration::from_micros(20), 0.0, 1);
    line.join(External::default(), place());
    line.join(External::default(), place());
    line
}

fn run<N: Node>(line: &mut Line<N>, until: u64) {
    line.run_until(at(until)).expect("nobody is judged");
}

fn say(line: &mut Line<External>, station: usize, now: u64, bytes: &[u8]) {
    run(line, now);
    line.tell(station).say(bytes);
}

/// What a station has heard by then, and not before.
fn heard(line: &mut Line<External>, station: usize, by: u64) -> Vec<u8> {
    run(line, by);
    line.node_mut(station).take()
}

#[test]
fn bytes_are_heard_when_they_end_and_not_before() {
    let mut line = two();
    say(&mut line, 0, 100, &[1, 2, 3]);
    assert_eq!(heard(&mut line, 1, 109), []);
    assert_eq!(heard(&mut line, 1, 110), [1]);
    assert_eq!(heard(&mut line, 1, 129), [2]);
    assert_eq!(line.poll_at(), Some(at(130)));
    assert_eq!(heard(&mut line, 1, 500), [3]);
    assert_eq!(heard(&mut line, 0, 500), [1, 2, 3], "its echo");
    assert_eq!((line.poll_at(), line.pending(0)), (None, 0));
}

/// One long burst is on the line as the same bytes in small pieces are that come in time.
#[test]
fn bursts_are_one_stream() {
    let mut line = two();
    for (count, bytes) in [[1, 2], [3, 4], [5, 6]].iter().enumerate() {
        say(&mut line, 0, 100 + 15 * count as u64, bytes);
    }
    assert_eq!(heard(&mut line, 1, 159), [1, 2, 3, 4, 5]);
    assert_eq!(heard(&mut line, 1, 160), [6]);
}

/// Whether or not the line has been looked at in between.
#[test]
fn a_character_that_begins_inside_another_spoils_it() {
    for looks in [&[][..], &[101, 103, 104]] {
        let mut line = two();
        say(&mut line, 0, 100, &[0x11]);
        looks.iter().for_each(|look| run(&mut line, *look));
        say(&mut line, 1, 105, &[0x22]);
        assert_ne!(heard(&mut line, 0, 110), [0x11]);
        assert!(line.totals().spoiled > 0);
    }
}

#[test]
fn what_is_discarded_is_not_sent() {
    let mut line = two();
    say(&mut line, 0, 100, &[1, 2, 3, 4]);
    run(&mut line, 115);
    assert_eq!(line.pending(0), 2);
    line.tell(0).discard();
    line.tell(0).say(&[0xAA]);
    assert_eq!(heard(&mut line, 1, 500), [1, 2, 0xAA]);
    line.tell(0).discard();
    assert_eq!(heard(&mut line, 1, 600), [], "there was nothing");
}

#[test]
fn a_mute_station_hears_and_is_not_heard() {
    let mut line = two();
    line.place(0).mute = true;
    say(&mut line, 0, 100, &[1, 2, 3]);
    say(&mut line, 1, 200, &[4]);
    assert_eq!((heard(&mut line, 0, 500), heard(&mut line, 1, 500)), (vec![4], vec![4]));
}

#[test]
fn a_station_without_echo_hears_the_others_alone() {
    for looks in [&[][..], &[105, 115]] {
        let mut line = two();
        line.place(0).echo = false;
        say(&mut line, 0, 100, &[1, 2]);
        looks.iter().for_each(|look| run(&mut line, *look));
        say(&mut line, 1, 200, &[3]);
        assert_eq!((heard(&mut line, 0, 500), heard(&mut line, 1, 500)), (vec![3], vec![1, 2, 3]));
    }
}

enum Either {
    Outside(External),
    Rival(Box<Talker>),
}

impl Node for Either {
    fn hear(&mut self, now: Instant, heard: puente_shared_line::Heard) {
        match self {
            Self::Outside(node) => node.hear(now, heard),
            Self::Rival(node) => node.hear(now, heard),
        }
    }

    fn carrier(&mut self, now: Instant) {
        match self {
            Self::Outside(node) => node.carrier(now),
            Self::Rival(node) => node.carrier(now),
        }
    }

    fn poll(&mut self, now: Instant) -> Option<puente_shared_line::Drive> {
        match self {
            Self::Outside(node) => node.poll(now),
            Self::Rival(node) => node.poll(now),
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        match self {
            Self::Outside(node) => node.poll_at(),
            Self::Rival(node) => node.poll_at(),
        }
    }
}

/// A station of the bus that is outside and learns everything late, in pieces, gets its frames onto a busy line.
#[test]
fn a_station_outside_gets_on_with_rivals() {
    let own = Config::new(1, fast(), MAX_FRAME);
    let late = fast().wire_time(30);
    // All on a line have the same slot: it is longer than what the one outside hears late.
    let mut own = Config { silence: late, ..own };
    own.arbiter.slot = fast().wire_time(8) + 2 * late;
    own.arbiter.gap += late;
    let mut line: Line<Either> = Line::new(fast(), own.arbiter.gap, 0.0, 1);
    line.join(Either::Outside(External::default()), place());
    for address in [201, 202] {
        let load = Load::Offered(Duration::from_millis(2));
        let talker = Talker::new(own.arbiter, frame_of(address, 250, 51), load, address.into());
        line.join(Either::Rival(Box::new(talker)), Place::new(fast()));
    }
    let mut station = Station::<0, 0, 1, 32, MAX_FRAME>::new(own, Instant::ZERO, 7);
    let mut body = heapless::Vec::<u8, 64>::new();
    section::push(&mut body, 250, &[0x33; 40]).expect("room");
    let (mut outcomes, mut on_the_way) = (Vec::new(), Vec::new());
    while line.now() < Instant::from_millis(2_000) {
        let now = line.now() + late / 2;
        line.run_until(now).expect("the rivals have manners");
        let Either::Outside(outside) = line.tell(0) else { unreachable!() };
        // A step late.
        for byte in std::mem::replace(&mut on_the_way, outside.take()) {
            station.receive(now, byte);
            act(&mut station, now, outside, &mut outcomes);
        }
        if now.as_micros() / 10_000 > outcomes.len() as u64 {
            let _ = station.post(now, Kind::Plain, &body);
        }
        act(&mut station, now, outside, &mut outcomes);
    }
    assert!(outcomes.len() > 150 && outcomes.iter().all(Result::is_ok), "{outcomes:?}");
    assert!(station.statistics().collisions > 10, "the line was too kind");
}

/// Does what the station outside wants.
fn act(
    station: &mut Station<0, 0, 1, 32, MAX_FRAME>,
    now: Instant,
    outside: &mut External,
    outcomes: &mut Vec<Result<(), Failure>>,
) {
    loop {
        match station.poll(now) {
            Action::Transmit(bytes) => outside.say(bytes),
            Action::Jam(bytes) => {
                outside.discard();
                outside.say(bytes);
            }
            Action::Posted(outcome) => outcomes.push(outcome),
            Action::Idle => return,
            _ => {}
        }
    }
}

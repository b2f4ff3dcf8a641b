//! Stations that tell each other stories which nobody else could have told.
#![allow(dead_code)]

use std::collections::BTreeMap;
use std::time::Duration;

use puente_framed::frame::TAGGED_OVERHEAD;
use puente_framed::section;
use puente_framed::station::{Action, Config};
use puente_framed::window::{Outcome, Ticket};
use puente_framed::{Class, Kind, Random, Station};
use puente_line::{Instant, Settings};
use puente_shared_line::station::{Application, Framed};
use puente_shared_line::{Line, Place};

/// Room of every station here.
pub const PEERS: usize = 6;
pub const WINDOW: usize = 8;
pub const LONGEST: usize = 160;
pub const BODY: usize = LONGEST - TAGGED_OVERHEAD;

pub type Node = Framed<Talker, PEERS, PEERS, WINDOW, BODY, LONGEST>;

pub fn fast() -> Settings {
    Settings { baud: 1_000_000, format: "8N1".parse().expect("format") }
}

pub fn config(address: u8) -> Config {
    Config::new(address, fast(), LONGEST)
}

/// The `count`-th message from one station to another: nobody mistakes it for any other.
pub fn message(from: u8, to: u8, count: u32) -> Vec<u8> {
    let mut random = Random::new(u64::from(from) << 40 | u64::from(to) << 32 | u64::from(count));
    let length = 5 + random.bits(6) as usize;
    let mut data = vec![from];
    data.extend(count.to_be_bytes());
    // 7E and 0A come up often.
    data.extend((5..length).map(|_| match random.bits(3) {
        0 => 0x7E,
        1 => 0x0A,
        _ => random.bits(8) as u8,
    }));
    let mut body = heapless::Vec::<u8, LONGEST>::new();
    section::push(&mut body, to, &data).expect("it is short");
    body.to_vec()
}

/// Which message it is.
pub fn number(body: &[u8]) -> u32 {
    u32::from_be_bytes(body[3..7].try_into().expect("four bytes"))
}

/// Keeps its windows full, and notes what becomes of every message.
pub struct Talker {
    pub address: u8,
    pub peers: Vec<u8>,
    /// Nothing new is begun from then on.
    pub stop: bool,
    /// At most so many frames are outstanding to a peer.
    pub outstanding: usize,
    /// Messages submitted to each peer.
    pub submitted: BTreeMap<u8, u32>,
    tickets: BTreeMap<(u8, u32), u32>,
    pub outcomes: BTreeMap<(u8, u32), Outcome>,
    /// Messages from each peer, in the order in which they came.
    pub received: BTreeMap<u8, Vec<u32>>,
    pub confirmed: u64,
    /// Frames outside of any window.
    pub heard: Vec<(u8, Kind, Vec<u8>)>,
    keep: bool,
}

impl Talker {
    pub fn new(address: u8, peers: &[u8]) -> Self {
        Self {
            address,
            peers: peers.to_vec(),
            stop: false,
            outstanding: WINDOW,
            submitted: BTreeMap::new(),
            tickets: BTreeMap::new(),
            outcomes: BTreeMap::new(),
            received: BTreeMap::new(),
            confirmed: 0,
            heard: Vec::new(),
            keep: true,
        }
    }

    /// Keeps no more than counts, for long runs: what comes must follow what came before, and be confirmed.
    pub fn strict(mut self) -> Self {
        self.keep = false;
        self
    }

    fn received(&mut self, from: u8, body: &[u8]) {
        let count = number(body);
        assert_eq!(body, message(from, self.address, count), "{from} to {}: corrupted", self.address);
        let known = self.received.entry(from).or_default();
        if self.keep {
            known.push(count);
        } else {
            let expected = known.first().map_or(0, |last| last + 1);
            assert_eq!(count, expected, "{from} to {}: lost, repeated or out of order", self.address);
            *known = vec![count];
        }
    }

    fn done(&mut self, to: u8, Ticket(ticket): Ticket, outcome: Outcome) {
        let count = self.tickets.remove(&(to, ticket)).expect("it was submitted, and is reported once");
        if outcome == Outcome::Confirmed {
            self.confirmed += 1;
        }
        if self.keep {
            self.outcomes.insert((to, count), outcome);
        } else {
            assert_eq!(outcome, Outcome::Confirmed, "{} to {to}: message {count}", self.address);
        }
    }
}

impl Application<PEERS, PEERS, WINDOW, BODY, LONGEST> for Talker {
    fn take(&mut self, _now: Instant, action: Action<'_>) {
        match action {
            Action::Received { from, body, .. } => self.received(from, body),
            Action::Done { to, ticket, outcome } => self.done(to, ticket, outcome),
            Action::Heard(frame) => self.heard.push((frame.origin, frame.kind, frame.body.to_vec())),
            Action::Free => {}
            other => panic!("not for the application: {other:?}"),
        }
    }

    fn drive(&mut self, now: Instant, station: &mut Station<PEERS, PEERS, WINDOW, BODY, LONGEST>) {
        if self.stop {
            return;
        }
        for &to in &self.peers {
            let count = self.submitted.entry(to).or_default();
            while station.outstanding(to) < self.outstanding {
                let body = message(self.address, to, *count);
                let Ok(Ticket(ticket)) = station.submit(now, to, Class::Data, &body) else {
                    break;
                };
                self.tickets.insert((to, ticket), *count);
                *count += 1;
            }
        }
    }
}

/// A line of talkers, some metres apart.
pub fn line(noise: f64, seed: u64) -> Line<Node> {
    Line::new(fast(), config(1).arbiter.gap, noise, seed)
}

pub fn join(line: &mut Line<Node>, talker: Talker, config: Config, seed: u64) -> usize {
    let station = Station::new(config, line.now(), seed);
    let place =
        Place { position: Duration::from_nanos(70 * u64::from(config.address)), ..Place::new(fast()) };
    line.join(Framed { application: talker, station }, place)
}

/// Runs on until `done`, at most for `limit`.
pub fn run(line: &mut Line<Node>, limit: Duration, mut done: impl FnMut(&Line<Node>) -> bool) {
    let end = line.now() + limit;
    while !done(line) {
        assert!(line.now() < end, "not done after {limit:?}");
        let next = line.now() + Duration::from_millis(10);
        line.run_until(next).unwrap_or_else(|violation| panic!("{violation}"));
    }
}

/// Lets all that is under way come to its end.
pub fn drain(line: &mut Line<Node>, stations: usize) {
    for station in 0..stations {
        line.tell(station).application.stop = true;
    }
    run(line, Duration::from_secs(120), |line| {
        line.nodes().all(|node| {
            let talker = &node.application;
            talker.peers.iter().all(|peer| node.station.outstanding(*peer) == 0) && talker.tickets.is_empty()
        })
    });
}

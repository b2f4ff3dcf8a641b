//! A master, a mock clock and a line whose other end is scripted.
#![allow(dead_code)]

use std::collections::VecDeque;
use std::time::Duration;

use puente_line::{Instant, Settings};
use puente_modbus::{Action, Config, Evidence, Master, Mode, Outcome, ascii, rtu};

/// An outcome that owns its reply.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    Reply(Vec<u8>),
    Broadcast,
    NoReply(Evidence),
}

pub fn line(baud: u32, format: &str) -> Settings {
    Settings { baud, format: format.parse().expect("format") }
}

pub fn config(mode: Mode) -> Config {
    Config::new(mode, line(19_200, "8E1"))
}

pub fn adu(mode: Mode, unit: u8, pdu: &[u8]) -> Vec<u8> {
    match mode {
        Mode::Rtu => rtu::emit(unit, pdu).to_vec(),
        Mode::Ascii => ascii::emit(unit, pdu).to_vec(),
    }
}

pub fn micros(micros: u64) -> Duration {
    Duration::from_micros(micros)
}

pub struct Rig {
    pub config: Config,
    pub master: Master,
    pub now: Instant,
    /// What will arrive, in order.
    pub coming: VecDeque<(Instant, Vec<u8>)>,
    /// What was transmitted, and when.
    pub sent: Vec<(Instant, Vec<u8>)>,
}

impl Rig {
    pub fn new(config: Config) -> Self {
        Self {
            config,
            master: Master::new(config),
            // Not zero, so that nothing works by chance of the clock's start.
            now: Instant::from_millis(10_000),
            coming: VecDeque::new(),
            sent: Vec::new(),
        }
    }

    /// A frame in this line's framing.
    pub fn adu(&self, unit: u8, pdu: &[u8]) -> Vec<u8> {
        adu(self.config.mode, unit, pdu)
    }

    /// Bytes that arrive `after` from now, all at once.
    pub fn bytes(&mut self, after: Duration, bytes: &[u8]) {
        let at = self.now + after;
        let place = self.coming.iter().position(|(other, _)| *other > at).unwrap_or(self.coming.len());
        self.coming.insert(place, (at, bytes.to_vec()));
    }

    /// Submits and runs until the request is on the line.
    pub fn send(&mut self, unit: u8, pdu: &[u8]) -> Instant {
        self.master.submit(unit, pdu).expect("idle");
        let before = self.sent.len();
        while self.sent.len() == before {
            assert_eq!(self.step(), None, "done before it was sent");
        }
        self.now
    }

    /// Runs until the request is done.
    pub fn finish(&mut self) -> End {
        for _ in 0..100_000 {
            if let Some(end) = self.step() {
                return end;
            }
        }
        panic!("the master does not come to an end");
    }

    /// Sends a request, answers with `script` (moments after the end of the request), runs to its end.
    pub fn exchange(&mut self, unit: u8, pdu: &[u8], script: &[(Duration, Vec<u8>)]) -> End {
        self.send(unit, pdu);
        let sent = self.config.line.wire_time(self.adu(unit, pdu).len());
        for (after, bytes) in script {
            self.bytes(sent + *after, bytes);
        }
        self.finish()
    }

    /// Runs until `until`, with nothing submitted.
    pub fn idle(&mut self, until: Instant) {
        while self.coming.front().is_some_and(|(at, _)| *at <= until) {
            assert_eq!(self.step(), None);
        }
        self.now = self.now.max(until);
    }

    /// One call of `poll`; then the clock goes on to whatever comes next.
    fn step(&mut self) -> Option<End> {
        match self.master.poll(self.now) {
            Action::Transmit(bytes) => self.sent.push((self.now, bytes.to_vec())),
            Action::Done(outcome) => {
                return Some(match outcome {
                    Outcome::Reply(pdu) => End::Reply(pdu.to_vec()),
                    Outcome::Broadcast => End::Broadcast,
                    Outcome::NoReply(evidence) => End::NoReply(evidence),
                });
            }
            Action::Idle => {
                let due = self.master.poll_at();
                assert!(due.is_none_or(|due| due > self.now), "poll would spin at {due:?}");
                match (self.coming.front().map(|(at, _)| *at), due) {
                    (Some(arrival), due) if due.is_none_or(|due| arrival <= due) => {
                        let (at, bytes) = self.coming.pop_front().expect("something is coming");
                        self.now = at;
                        self.master.receive(at, &bytes);
                    }
                    (_, Some(due)) => self.now = due,
                    (_, None) => panic!("nothing will ever happen"),
                }
            }
        }
        None
    }
}

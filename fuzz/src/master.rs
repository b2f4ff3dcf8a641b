//! A master under any sequence of requests, bytes and pauses.

use puente_line::Instant;
use puente_modbus::reply::Reply;
use puente_modbus::{Action, Config, Echo, Master, Mode, Outcome, rtu};

use crate::{Operands, adu, holds, line};

/// Requests with every kind of reply length.
const REQUESTS: &[&[u8]] = &[
    &[3, 0, 0, 0, 1],
    &[3, 0, 0, 0, 2],
    &[1, 0, 0, 0, 9],
    &[6, 0, 0x25, 0, 0x64],
    &[8, 0, 0, 0xA5, 0x37],
    &[0x10, 0, 1, 0, 1, 2, 0, 7],
    &[0x11],
    &[0x16, 0, 4, 0, 0xF2, 0, 0x25],
    &[0x17, 0, 0, 0, 1, 0, 9, 0, 1, 2, 0, 7],
    &[0x2B, 0x0E, 1, 0],
    &[0x41, 1, 2],
    &[3, 0, 0, 0, 125],
];

struct Run {
    mode: Mode,
    master: Master,
    now: Instant,
    /// Unit and PDU of the request in work.
    request: Option<(u8, Vec<u8>)>,
    /// What was heard since it was sent.
    heard: Vec<u8>,
    last_heard: Option<Instant>,
}

/// Reads `data` as a configuration and a sequence of events. Asserts that a reply pairs with its request and was on the wire
/// after it, that no transmission breaks the silence, that every request comes to an end and that polling never spins.
pub fn run(mode: Mode, data: &[u8]) {
    let mut operands = Operands(data);
    let echo = match operands.byte() & 7 {
        0 => Echo::Strip,
        1 => Echo::Verify,
        _ => Echo::Off,
    };
    let config = Config { echo, ..Config::new(mode, line()) };
    let mut run = Run {
        mode,
        master: Master::new(config),
        now: Instant::from_millis(5_000),
        request: None,
        heard: Vec::new(),
        last_heard: None,
    };
    while !operands.0.is_empty() {
        run.event(&mut operands);
        run.settle();
    }
    // Left alone, it finishes what it has.
    for _ in 0..8 {
        if let Some(at) = run.master.poll_at() {
            run.now = run.now.max(at);
            run.settle();
        }
    }
    assert!(run.request.is_none(), "a request without an end");
    assert_eq!(run.master.poll_at(), None);
}

impl Run {
    fn event(&mut self, operands: &mut Operands<'_>) {
        match operands.byte() % 8 {
            0 | 1 => {
                let unit = operands.byte() & 3;
                let pdu = REQUESTS[usize::from(operands.byte()) % REQUESTS.len()];
                assert_eq!(self.master.submit(unit, pdu).is_ok(), self.request.is_none());
                self.request.get_or_insert_with(|| (unit, pdu.to_vec()));
            }
            2 => {
                let count = operands.byte() & 31;
                self.hear(operands.bytes(count.into()));
            }
            3 => {
                let unit = operands.byte() & 3;
                let count = 1 + (operands.byte() & 15);
                self.hear(&adu(self.mode, unit, operands.bytes(count.into())));
            }
            4 => {
                if let Some((unit, pdu)) = self.request.clone() {
                    let function = if operands.byte() & 3 == 0 { pdu[0] | 0x80 } else { pdu[0] };
                    let count = operands.byte() & 15;
                    let pdu = [&[function][..], operands.bytes(count.into())].concat();
                    self.hear(&adu(self.mode, unit, &pdu));
                }
            }
            5 => self.now += operands.pause(),
            6 => {
                if let Some(at) = self.master.poll_at() {
                    self.now = self.now.max(at);
                }
            }
            _ => {
                self.master.line_error(self.now);
                self.last_heard = Some(self.now);
            }
        }
    }

    fn hear(&mut self, bytes: &[u8]) {
        self.master.receive(self.now, bytes);
        self.heard.extend(bytes);
        if !bytes.is_empty() {
            self.last_heard = Some(self.now);
        }
    }

    /// Polls until there is nothing to do now.
    fn settle(&mut self) {
        loop {
            match self.master.poll(self.now) {
                Action::Idle => break,
                Action::Transmit(bytes) => {
                    let (unit, pdu) = self.request.as_ref().expect("a request");
                    assert_eq!(bytes, adu(self.mode, *unit, pdu));
                    let gap = match self.mode {
                        Mode::Rtu => rtu::t3_5(line()),
                        Mode::Ascii => rtu::t1_5(line()),
                    };
                    assert!(self.last_heard.is_none_or(|last| self.now >= last + gap));
                    self.heard.clear();
                }
                Action::Done(outcome) => {
                    let (unit, request) = self.request.take().expect("a request");
                    match outcome {
                        Outcome::Reply(pdu) => {
                            assert_ne!(unit, 0);
                            Reply::parse(&request, pdu).expect("a reply that pairs");
                            assert!(holds(self.mode, &self.heard, &adu(self.mode, unit, pdu)));
                        }
                        Outcome::Broadcast => assert_eq!(unit, 0),
                        Outcome::NoReply(_) => {}
                    }
                }
            }
        }
        assert!(self.master.poll_at().is_none_or(|at| at > self.now), "polling would spin");
    }
}

//! A client and a server with a bus between them that loses what the test says.

use std::collections::VecDeque;

use puente_canopen::sdo::{Action, Client, Config, Failure, Outcome, Transfer};
use puente_canopen::{Address, Frame, Id, NodeId};
use puente_line::{Duration, Instant};

use super::server::{Habits, Message, Server};

/// Who said it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum From {
    Client,
    Server,
}

/// A frame that may be lost.
#[derive(Clone, Copy, Debug)]
pub struct Passing {
    pub from: From,
    /// It is a segment of a block.
    pub segment: bool,
    pub bytes: Message,
}

/// Where frames go.
pub trait Far {
    fn take(&mut self, now: Instant, message: Message) -> Vec<Message>;

    /// What the client says now is a segment, what the server has just said is one.
    fn in_block(&self) -> (bool, bool);
}

impl Far for Server {
    fn take(&mut self, _: Instant, message: Message) -> Vec<Message> {
        Server::take(self, message)
    }

    fn in_block(&self) -> (bool, bool) {
        Server::in_block(self)
    }
}

pub struct Channel<F> {
    pub now: Instant,
    pub client: Client,
    pub far: F,
    /// Under way to the client.
    coming: VecDeque<(Instant, Passing)>,
    /// Frames of both, in order.
    pub log: Vec<(From, Vec<u8>)>,
    pub logs: bool,
    /// The server's time for an answer.
    pub latency: Duration,
}

/// A frame of 8 bytes at 1 Mbit/s.
const FRAME: Duration = Duration::from_micros(130);

pub const NODE: u8 = 5;

pub const READ: Transfer = Transfer::Upload { address: Address::new(0x2000, 0), block: false };
pub const READ_BLOCK: Transfer = Transfer::Upload { address: Address::new(0x2000, 0), block: true };

pub const fn write(size: usize, block: bool) -> Transfer {
    Transfer::Download { address: Address::new(0x2000, 0), size: size as u32, block }
}

/// Nothing is lost.
pub fn keep(_: Passing) -> bool {
    false
}

impl Channel<Server> {
    pub fn with_server(habits: Habits, config: Config, data: &[u8]) -> Self {
        let mut server = Server::new(habits);
        server.objects.insert((0x2000, 0), data.to_vec());
        Self::new(server, config)
    }
}

impl<F: Far> Channel<F> {
    pub fn new(far: F, config: Config) -> Self {
        Self {
            now: Instant::from_millis(1_000),
            client: Client::new(NodeId::new(NODE).expect("a node-ID"), config),
            far,
            coming: VecDeque::new(),
            log: Vec::new(),
            logs: false,
            latency: Duration::from_micros(50),
        }
    }

    /// Everything that `lost` says is lost.
    pub fn run(
        &mut self,
        transfer: Transfer,
        write: &[u8],
        lost: &mut dyn FnMut(Passing) -> bool,
    ) -> (Result<Outcome, Failure>, Vec<u8>) {
        self.client.submit(transfer).expect("idle");
        let mut read = Vec::new();
        for _ in 0..10_000_000 {
            if let Some((at, passing)) = self.coming.front().copied()
                && at <= self.now
            {
                self.coming.pop_front();
                if !lost(passing) {
                    let id = Id::base(0x580 + u16::from(NODE));
                    self.client.receive(self.now, &Frame::full(id, passing.bytes));
                }
                continue;
            }
            match self.client.poll(self.now) {
                Action::Transmit(frame) => {
                    assert_eq!(frame.id(), Id::Base(0x600 + u16::from(NODE)));
                    let message: Message = frame.data().try_into().expect("8 bytes");
                    self.note(From::Client, &message);
                    self.now += FRAME;
                    let segment = self.far.in_block().0 && message[0] != 0x80;
                    if !lost(Passing { from: From::Client, segment, bytes: message }) {
                        self.answer(message);
                    }
                }
                Action::Fetch { offset, count } => {
                    assert!((1..=7).contains(&count));
                    let offset = offset as usize;
                    self.client.supply(self.now, &write[offset..offset + count]);
                }
                Action::Data(part) => read.extend_from_slice(&part),
                Action::Done(end) => return (end, read),
                Action::Idle => {
                    let due = self.client.poll_at().expect("something is due");
                    assert!(due > self.now, "polling would spin");
                    let next = self.coming.front().map(|(at, _)| *at);
                    self.now = next.map_or(due, |next| next.min(due));
                }
            }
        }
        panic!("it does not end");
    }

    fn note(&mut self, from: From, message: &[u8]) {
        if self.logs {
            self.log.push((from, message.to_vec()));
        }
    }

    fn answer(&mut self, message: Message) {
        let answers = self.far.take(self.now, message);
        let segment = self.far.in_block().1;
        for answer in answers {
            self.note(From::Server, &answer);
            let last = self.coming.back().map_or(self.now, |(at, _)| *at);
            let at = last.max(self.now + self.latency) + FRAME;
            self.coming.push_back((at, Passing { from: From::Server, segment, bytes: answer }));
        }
    }
}

/// Numbers that look random, from a seed.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    }

    /// So many of a thousand times.
    pub fn chance(&mut self, of_1000: u64) -> bool {
        self.next() % 1_000 < of_1000
    }

    pub fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| self.next() as u8).collect()
    }
}

//! Block transfers through the gateway: over a bus that loses frames, and with a node of another implementation.

mod common;
#[path = "../protocols/canopen/tests/common/zencan.rs"]
#[allow(dead_code, reason = "the tests of the protocol use the rest")]
mod zencan;

use std::collections::VecDeque;
use std::sync::mpsc;
use std::thread;

use common::can::{Adapter, Bus, await_open};
use common::client::Lines;
use common::wire::Wire;
use common::{Document, Gateway, target};
use puente_canopen::{Address, Frame};
use puente_cell::can::{Cell, Config, DriveConfig, Model};
use puente_line::Instant;
use zencan::{Domain, Peer};

/// An object of any length.
const DOMAIN: Address = Address::new(0x2000, 0);
/// Whose it is.
const NODE: u8 = 5;

/// Bytes in which a piece that is lacking, or comes twice, shows.
fn random(seed: u32, size: usize) -> Vec<u8> {
    let mut state = seed;
    let next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    std::iter::repeat_with(next).take(size).collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ")
}

/// A client that transfers in blocks, with a gateway at this bus.
fn rig<B: Bus>(bus: B) -> (Wire<Adapter<B>>, Gateway, Lines) {
    let adapter = Adapter::wire(bus);
    let gateway = Document::new().canopen("can", &adapter, "bitrate = 1000000\nheartbeat_ms = 0").start();
    await_open(&gateway);
    let mut client = Lines::connect(gateway.main);
    assert_eq!(client.ask("[1] set sdo_block 1"), "[1] OK");
    (adapter, gateway, client)
}

/// A bus that loses 1 % of all frames, and a node with this object. Frames follow each other eight times as fast as at
/// 1 Mbit/s, where the megabyte would take half a minute.
fn lossy(data: Vec<u8>) -> Cell {
    let node = DriveConfig::new(NODE, Model::Node).expect("a node-ID");
    let node = DriveConfig { domains: vec![(DOMAIN, data)], ..node };
    Cell::new(Config { drop: 0.01, ..Config::new(8_000_000) }.with(node))
}

/// An emulated board takes longer for it, and reads less.
#[test]
fn a_megabyte_is_read_while_1_percent_of_the_frames_is_lost() {
    let data = random(1, if target().is_board() { 20_000 } else { 1_000_000 });
    let (adapter, _gateway, mut client) = rig(lossy(data.clone()));
    // A block whose end is lost costs a time-out. The usual one of 500 ms: on a busy machine 50 ms have passed before an answer
    // had its turn, and an acknowledgement that is repeated for nothing is one out of sequence.
    let read = client.ask_long("[3] 5 r 0x2000 0");
    let end = read.get(read.len().saturating_sub(60)..);
    assert!(read == format!("[3] {}", hex(&data)), "it ends with {end:?}");
    let (totals, segments) = (adapter.device().bus.totals(), data.len().div_ceil(7) as u64);
    assert!(totals.frames > segments && totals.dropped > segments / 200, "{totals:?}");
}

/// As much as a client may write, again and again. A write whose first or last message is lost is answered by an error, and
/// is done again by the client, who alone knows whether it may be; none that is answered `OK` is wrong.
#[test]
fn long_values_are_written_while_1_percent_of_the_frames_is_lost() {
    let (adapter, _gateway, mut client) = rig(lossy(Vec::new()));
    assert_eq!(client.ask("[2] set sdo_timeout 200"), "[2] OK");
    let mut failed = 0;
    for round in 0..40 {
        let data = random(round, most());
        let command = format!("[3] 5 w 0x2000 0 hex {}", hex(&data));
        while client.ask(&command) != "[3] OK" {
            failed += 1;
            assert!(failed < 20, "most are not lost");
        }
        let device = adapter.device();
        let node = device.bus.node(NODE).expect("the node");
        assert!(node.object(DOMAIN.index, DOMAIN.sub) == data, "round {round}");
    }
    let totals = adapter.device().bus.totals();
    assert!(totals.dropped > totals.frames / 200, "{totals:?}");
}

/// Most bytes of a value that is written.
fn most() -> usize {
    if target().is_board() { 256 } else { 1024 }
}

/// zencan-node, on a bus of its own; and in a thread of its own, which it cannot leave.
struct Zencan {
    asks: mpsc::Sender<(Instant, Option<Frame>)>,
    answers: mpsc::Receiver<Vec<Frame>>,
    said: VecDeque<Frame>,
}

impl Zencan {
    /// With its object.
    fn start() -> (Self, &'static Domain) {
        let (asks, asked) = mpsc::channel();
        let (answer, answers) = mpsc::channel();
        let (tell, told) = mpsc::channel();
        thread::spawn(move || {
            let mut peer = Peer::new(NODE, [1, 2, 3, 4]);
            tell.send(peer.domain).expect("the test");
            for (now, frame) in asked {
                if answer.send(peer.take(now, Option::as_ref(&frame))).is_err() {
                    break;
                }
            }
        });
        (Self { asks, answers, said: VecDeque::new() }, told.recv().expect("a node"))
    }

    /// Its clock is slow: of its own it gives a client 25 ms, which is less than a busy machine may need.
    fn hear(&mut self, now: Instant, frame: Option<Frame>) {
        let now = Instant::from_micros(now.as_micros() / 100);
        self.asks.send((now, frame)).expect("a node");
        self.said.extend(self.answers.recv().expect("a node"));
    }
}

impl Bus for Zencan {
    fn send(&mut self, now: Instant, frame: &Frame) {
        self.hear(now, Some(*frame));
    }

    fn poll(&mut self, now: Instant) -> Option<Frame> {
        if self.said.is_empty() {
            self.hear(now, None);
        }
        self.said.pop_front()
    }

    fn poll_at(&self) -> Option<Instant> {
        (!self.said.is_empty()).then_some(Instant::ZERO)
    }
}

/// No size of a value that is read is a multiple of seven: of those zencan-node keeps the last segment to itself.
#[test]
fn objects_of_another_implementation_are_read_and_written() {
    let (node, domain) = Zencan::start();
    let (adapter, _gateway, mut client) = rig(node);
    let holds = || domain.0.lock().expect("a lock");
    let written = [1, 4, 5, 7, 8, 255, 256, 888, 889, 890, 1024].into_iter().filter(|size| *size <= most());
    for size in written.clone() {
        let data = random(size as u32, size);
        assert_eq!(client.ask(&format!("[2] 5 w 0x2000 0 hex {}", hex(&data))), "[2] OK", "{size}");
        assert!(*holds() == data, "{size}");
    }
    let longest = if target().is_board() { 890 } else { 100_001 };
    let read = [1, 4, 5, 8, 240, 888, 890, 1_780, 100_001].into_iter().filter(|size| *size <= longest);
    for size in read.clone() {
        *holds() = random(size as u32, size);
        let told = client.ask_long("[3] 5 r 0x2000 0");
        let end = told.get(told.len().saturating_sub(60)..);
        assert!(told == format!("[3] {}", hex(&holds())), "{size}: it ends with {end:?}");
    }
    let device = adapter.device();
    let begun =
        |first| device.frames.iter().filter(|frame| frame.data().starts_with(&[first, 0, 0x20, 0])).count();
    assert_eq!((begun(0xC6), begun(0xA4)), (written.count(), read.count()), "in blocks, each once");
    drop(device);
    assert_eq!(client.ask("[4] 5 r 0x2001 0"), "[4] ERROR:0x06020000 #Object does not exist.");
    assert_eq!(
        client.ask("[5] 5 w 0x1018 1 u32 7"),
        "[5] ERROR:0x06010002 #Attempt to write a read only object."
    );
}

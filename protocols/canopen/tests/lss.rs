//! The LSS master: against slaves built for it, and against zencan-node.

mod common;

use common::zencan::Peer;
use common::{any_frame, frame, ms};
use proptest::prelude::*;
use puente_canopen::lss::{
    Action, Busy, Command, Failure, Identity, Known, Master, Mode, Outcome, Part, Request, Response,
};
use puente_canopen::{Frame, Id};
use puente_line::{Duration, Instant};

const TIMEOUT: Duration = Duration::from_millis(10);

/// An LSS slave by the text of CiA 305, on raw bytes.
struct Slave {
    identity: [u32; 4],
    id: u8,
    configured: bool,
    selected: usize,
    position: u8,
}

impl Slave {
    fn new(identity: [u32; 4]) -> Self {
        Self { identity, id: 255, configured: false, selected: 0, position: 0 }
    }

    fn take(&mut self, frame: &Frame) -> Option<Frame> {
        assert_eq!(frame.id().raw(), 0x7E5);
        let bytes = frame.data();
        let word = u32::from_le_bytes([bytes[1], bytes[2], bytes[3], bytes[4]]);
        let answer = |bytes: &[u8]| {
            let mut answer = bytes.to_vec();
            answer.resize(8, 0);
            Frame::new(Id::base(0x7E4), &answer)
        };
        match bytes[0] {
            0x04 => {
                self.configured = bytes[1] == 1;
                None
            }
            first @ 0x40..=0x43 => {
                let part = usize::from(first - 0x40);
                let fits = self.identity[part] == word && (part == 0 || self.selected == part);
                self.selected = if fits { part + 1 } else { 0 };
                if self.selected < 4 {
                    return None;
                }
                self.configured = true;
                answer(&[0x44])
            }
            0x51 if self.id == 255 && !self.configured => {
                let (bit, part, next) = (bytes[5], bytes[6], bytes[7]);
                if bit == 0x80 {
                    self.position = 0;
                    return answer(&[0x4F]);
                }
                let mask = u32::MAX << bit;
                if self.position != part || self.identity[usize::from(part)] & mask != word & mask {
                    return None;
                }
                self.position = next;
                if bit == 0 && next < part {
                    self.configured = true;
                }
                answer(&[0x4F])
            }
            _ if !self.configured => None,
            0x11 => {
                let fits = matches!(bytes[1], 1..=127 | 255);
                if fits {
                    self.id = bytes[1];
                }
                answer(&[0x11, u8::from(!fits)])
            }
            0x13 => answer(&[0x13, u8::from(bytes[2] == 5)]),
            0x17 => answer(&[0x17, 255, 7]),
            first @ 0x5A..=0x5D => {
                let [a, b, c, d] = self.identity[usize::from(first - 0x5A)].to_le_bytes();
                answer(&[first, a, b, c, d])
            }
            0x5E => answer(&[0x5E, self.id]),
            _ => None,
        }
    }
}

/// Works a command off; each answer comes after a millisecond.
fn run(
    master: &mut Master,
    now: &mut Instant,
    command: Command,
    far: &mut dyn FnMut(Instant, &Frame) -> Vec<Frame>,
) -> Result<Outcome, Failure> {
    master.submit(command).expect("idle");
    for _ in 0..1_000 {
        match master.poll(*now) {
            Action::Transmit(frame) => {
                let answers = far(*now, &frame);
                *now += Duration::from_millis(1);
                for answer in answers {
                    master.receive(*now, &answer);
                }
            }
            Action::Done(end) => return end,
            Action::Idle => {
                let due = master.poll_at().expect("something is due");
                assert!(due > *now, "polling would spin");
                *now = due;
            }
        }
    }
    panic!("it does not end");
}

fn identity([vendor, product, revision, serial]: [u32; 4]) -> Identity {
    Identity { vendor, product, revision, serial }
}

#[test]
fn nodes_without_node_id_are_found_one_by_one() {
    let mut slaves = [
        Slave::new([0x1234_5678, 0, u32::MAX, 0x8000_0001]),
        Slave::new([0x1234_5678, 0, u32::MAX, 0x8000_0000]),
        Slave::new([0x1234_5679, 7, 1, 0]),
    ];
    let mut master = Master::new(TIMEOUT);
    let mut now = ms(0);
    let mut found = Vec::new();
    for id in 1.. {
        let mut all =
            |_: Instant, asked: &Frame| slaves.iter_mut().filter_map(|slave| slave.take(asked)).collect();
        match run(&mut master, &mut now, Command::Fastscan(Known::default()), &mut all) {
            Ok(Outcome::Identity(identity)) => found.push(identity),
            end => {
                assert_eq!(end, Err(Failure::Nobody));
                break;
            }
        }
        let done = Ok(Outcome::Done);
        assert_eq!(run(&mut master, &mut now, Command::InquireNodeId, &mut all), Ok(Outcome::NodeId(255)));
        assert_eq!(run(&mut master, &mut now, Command::ConfigureNodeId(id), &mut all), done);
        assert_eq!(run(&mut master, &mut now, Command::SwitchGlobal(Mode::Waiting), &mut all), done);
    }
    found.sort_by_key(|identity| (identity.vendor, identity.serial));
    let mut expected: Vec<_> = slaves.iter().map(|slave| identity(slave.identity)).collect();
    expected.sort_by_key(|identity| (identity.vendor, identity.serial));
    assert_eq!(found, expected);
    let mut ids: Vec<_> = slaves.iter().map(|slave| slave.id).collect();
    ids.sort_unstable();
    assert_eq!(ids, [1, 2, 3]);
}

#[test]
fn what_is_known_is_not_asked() {
    let mut slave = Slave::new([1, 2, 3, 4]);
    let mut asked = 0;
    let mut far = |_: Instant, frame: &Frame| {
        asked += 1;
        slave.take(frame).into_iter().collect()
    };
    let mut master = Master::new(TIMEOUT);
    let known = Known { vendor: Some(1), product: Some(2), revision: Some(3), serial: None };
    let end = run(&mut master, &mut ms(0), Command::Fastscan(known), &mut far);
    assert_eq!(end, Ok(Outcome::Identity(identity([1, 2, 3, 4]))));
    assert_eq!(asked, 1 + 3 + 33);
    let mut slave = Slave::new([1, 2, 3, 4]);
    let mut far = |_: Instant, frame: &Frame| slave.take(frame).into_iter().collect();
    let other = Known { vendor: Some(5), ..known };
    assert_eq!(run(&mut master, &mut ms(0), Command::Fastscan(other), &mut far), Err(Failure::Vanished));
}

#[test]
fn a_selected_node_is_configured() {
    let mut slave = Slave::new([1, 2, 3, 0xAABB_CCDD]);
    let mut far = |_: Instant, frame: &Frame| -> Vec<Frame> { slave.take(frame).into_iter().collect() };
    let mut master = Master::new(TIMEOUT);
    let mut now = ms(0);
    let mut run = |command| run(&mut master, &mut now, command, &mut far);
    assert_eq!(run(Command::Select(identity([1, 2, 3, 4]))), Err(Failure::Timeout));
    assert_eq!(run(Command::InquireNodeId), Err(Failure::Timeout), "it waits");
    assert_eq!(run(Command::Select(identity([1, 2, 3, 0xAABB_CCDD]))), Ok(Outcome::Done));
    assert_eq!(run(Command::Inquire(Part::Serial)), Ok(Outcome::Part(0xAABB_CCDD)));
    assert_eq!(run(Command::ConfigureNodeId(200)), Err(Failure::Refused { error: 1, vendor: 0 }));
    assert_eq!(run(Command::ConfigureBitTiming { table: 0, index: 0 }), Ok(Outcome::Done));
    assert_eq!(
        run(Command::ConfigureBitTiming { table: 0, index: 5 }),
        Err(Failure::Refused { error: 1, vendor: 0 })
    );
    assert_eq!(run(Command::Store), Err(Failure::Refused { error: 255, vendor: 7 }));
    assert_eq!(run(Command::ActivateBitTiming { delay: 500 }), Ok(Outcome::Done), "nobody answers this");
}

#[test]
fn messages_byte_by_byte() {
    let cases = [
        (Request::SwitchGlobal(Mode::Configuration), "04 01 00 00 00 00 00 00"),
        (Request::Select(Part::Serial, 0x1234_5678), "43 78 56 34 12 00 00 00"),
        (Request::ConfigureNodeId(5), "11 05 00 00 00 00 00 00"),
        (Request::ConfigureBitTiming { table: 0, index: 3 }, "13 00 03 00 00 00 00 00"),
        (Request::ActivateBitTiming { delay: 1_000 }, "15 E8 03 00 00 00 00 00"),
        (Request::Store, "17 00 00 00 00 00 00 00"),
        (Request::Fastscan { id: 0x8000_0000, bit: 30, part: 1, next: 1 }, "51 00 00 00 80 1E 01 01"),
        (Request::Inquire(Part::Vendor), "5A 00 00 00 00 00 00 00"),
        (Request::InquireNodeId, "5E 00 00 00 00 00 00 00"),
    ];
    for (request, bytes) in cases {
        assert_eq!(
            (request.frame(), Request::parse(&frame(0x7E5, bytes))),
            (frame(0x7E5, bytes), Some(request))
        );
    }
    let refused = Response::Configured { what: 0x11, error: 1, vendor: 0 };
    assert_eq!(refused.frame(), frame(0x7E4, "11 01 00 00 00 00 00 00"));
}

#[test]
fn zencan_is_found_and_given_a_node_id() {
    let mut peer = Peer::new(0, [0x0000_0360, 0xFFFF_0000, 1, 0x8765_4321]);
    let mut master = Master::new(TIMEOUT);
    let mut now = ms(1);
    let mut said = Vec::new();
    let mut far = |now: Instant, frame: &Frame| {
        let answers = peer.take(now, Some(frame));
        said.extend(answers.clone());
        answers
    };
    let end = run(&mut master, &mut now, Command::Fastscan(Known::default()), &mut far);
    assert_eq!(end, Ok(Outcome::Identity(identity([0x0000_0360, 0xFFFF_0000, 1, 0x8765_4321]))));
    assert_eq!(
        run(&mut master, &mut now, Command::Inquire(Part::Product), &mut far),
        Ok(Outcome::Part(0xFFFF_0000))
    );
    assert_eq!(run(&mut master, &mut now, Command::ConfigureNodeId(9), &mut far), Ok(Outcome::Done));
    assert_eq!(run(&mut master, &mut now, Command::SwitchGlobal(Mode::Waiting), &mut far), Ok(Outcome::Done));
    assert_eq!(peer.id(), 9);
    // Its first sign is a heartbeat, not the boot-up message of the standard.
    assert!(said.contains(&frame(0x709, "7F")), "{said:?}");
}

proptest! {
    #[test]
    fn any_identity_is_found(parts: [u32; 4]) {
        let mut slave = Slave::new(parts);
        let mut far = |_: Instant, frame: &Frame| {
            slave.take(frame).into_iter().collect()
        };
        let end = run(&mut Master::new(TIMEOUT), &mut ms(0), Command::Fastscan(Known::default()), &mut far);
        prop_assert_eq!(end, Ok(Outcome::Identity(identity(parts))));
    }

    #[test]
    fn nothing_disturbs_the_master(
        steps in prop::collection::vec((any_answer(), 0..30_u64, 0..5), 0..60),
    ) {
        let mut master = Master::new(TIMEOUT);
        let mut at = 0;
        let mut open = false;
        for (answer, pause, kind) in steps {
            let command = match kind {
                0 => Command::Fastscan(Known::default()),
                1 => Command::Select(Identity::default()),
                2 => Command::ConfigureNodeId(5),
                3 => Command::Inquire(Part::Vendor),
                _ => Command::SwitchGlobal(Mode::Waiting),
            };
            prop_assert_eq!(master.submit(command), if open { Err(Busy) } else { Ok(()) });
            open = true;
            at += pause;
            master.receive(ms(at), &answer);
            for polls in 0.. {
                prop_assert!(polls < 20, "it spins");
                match master.poll(ms(at)) {
                    Action::Transmit(said) => {
                        let request = Request::parse(&said).expect("it says what is understood");
                        prop_assert_eq!(request.frame(), said);
                    }
                    Action::Done(_) => {
                        prop_assert!(open);
                        open = false;
                    }
                    Action::Idle => break,
                }
            }
            prop_assert!(master.poll_at().is_none_or(|due| due > ms(at)));
            if let Some(response) = Response::parse(&answer) {
                prop_assert_eq!(Response::parse(&response.frame()), Some(response));
            }
            if let Some(request) = Request::parse(&answer) {
                prop_assert_eq!(Request::parse(&request.frame()), Some(request));
            }
        }
    }
}

fn any_answer() -> impl Strategy<Value = Frame> {
    let first = prop::sample::select(vec![0x44, 0x11, 0x4F, 0x5A, 0x5E, 0x13]);
    let id = prop::sample::select(vec![0x7E4, 0x7E5]);
    let lss = (id, first, any::<[u8; 7]>()).prop_map(|(id, first, [a, b, c, d, e, f, g])| {
        Frame::full(Id::base(id), [first, a, b, c, d, e, f, g])
    });
    prop_oneof![4 => lss, 1 => any_frame()]
}

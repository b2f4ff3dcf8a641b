//! SDO transfers over a bus that loses frames, with servers that err, and with frames from anywhere.

mod common;

use common::channel::{Channel, Passing, READ, READ_BLOCK, Random, keep, write};
use common::server::{Habits, Server};
use common::{any_frame, frame, ms};
use proptest::prelude::*;
use puente_canopen::sdo::{self, Abort, Action, Busy, Client, Config, Failure, Outcome, Transfer};
use puente_canopen::{Address, Frame, Id, NodeId};

/// The frames of a block of five, of which those are lost whose place in the conversation is named.
fn write_losing(places: &[usize]) -> (Result<Outcome, Failure>, Channel<Server>) {
    let data: Vec<u8> = (0..56).collect();
    let habits = Habits { block: 5, ..Habits::default() };
    let mut channel = Channel::with_server(habits, Config::DEFAULT, b"");
    let mut place = 0;
    let (end, _) = channel.run(write(data.len(), true), &data, &mut |_| {
        place += 1;
        places.contains(&place)
    });
    if end.is_ok() {
        assert_eq!(channel.far.written, [((0x2000, 0), data)]);
    } else {
        assert_eq!(channel.far.written, []);
    }
    (end, channel)
}

/// Request, response, five segments, acknowledgement, three segments, acknowledgement, end, response.
#[test]
fn what_is_lost_of_a_block_that_is_written() {
    let written = Ok(Outcome::Written);
    for place in (3..=7).chain(9..=11) {
        assert_eq!(write_losing(&[place]).0, written, "segment {place}");
    }
    assert_eq!(write_losing(&[3, 4, 5, 6]).0, written, "all but the last");
    assert_eq!(write_losing(&[3, 7]).0, written, "first and last");
    assert_eq!(write_losing(&[3, 7, 9]).0, written, "first and last, and the denial of the repeated last");
    // The acknowledgement of a block in the middle: nothing tells how much the server has.
    let (end, channel) = write_losing(&[8]);
    assert_eq!(end, Err(Failure::Position));
    assert!(!channel.far.written.contains(&((0x2000, 0), vec![])));
    assert_eq!(write_losing(&[12]).0, written, "the last acknowledgement: the end is understood");
    assert_eq!(write_losing(&[13]).0, written, "the end itself");
    let position = Err(Failure::Position);
    assert_eq!(
        write_losing(&[11, 13]).0,
        position,
        "the last segment, and the acknowledgement of the others"
    );
    // Written, but nobody knows: the repeated end is not understood.
    let data: Vec<u8> = (0..56).collect();
    let mut channel = Channel::with_server(Habits::default(), Config::DEFAULT, b"");
    let (end, _) = channel.run(write(56, true), &data, &mut |passing| passing.bytes[0] == 0xA1);
    assert_eq!(end, Err(Failure::Timeout { heard: None }));
    assert_eq!(channel.far.written.len(), 1);
    // Nothing is initiated twice.
    for place in [1, 2] {
        let (end, channel) = write_losing(&[place]);
        assert_eq!(end, Err(Failure::Timeout { heard: None }));
        assert_eq!(channel.far.aborts, [Abort::TIMEOUT.0]);
    }
}

#[test]
fn a_server_that_dies_is_given_up() {
    for (transfer, all) in [(READ, 1 + 3), (READ_BLOCK, 1 + 3), (write(4, false), 1), (write(9, true), 1)] {
        let mut channel = Channel::with_server(Habits::default(), Config::DEFAULT, &[1; 100]);
        channel.logs = true;
        let begun = channel.now;
        let (end, _) = channel.run(transfer, &[1; 100], &mut |_| true);
        assert_eq!(end, Err(Failure::Timeout { heard: None }));
        assert_eq!(channel.log.len(), all + 1, "{transfer:?}, and the abort");
        let took = channel.now.since(begun).as_millis() as usize;
        assert!((all * 500..all * 500 + 5).contains(&took), "{took}");
    }
    // In the middle of a transfer.
    for (transfer, after) in [(READ, 10), (write(100, false), 10), (READ_BLOCK, 10), (write(100, true), 10)] {
        let mut channel = Channel::with_server(Habits::default(), Config::DEFAULT, &[1; 100]);
        let mut passed = 0;
        let (end, _) = channel.run(transfer, &[1; 100], &mut |_| {
            passed += 1;
            passed > after
        });
        assert_eq!(end, Err(Failure::Timeout { heard: None }), "{transfer:?}");
    }
}

#[test]
fn the_servers_refusal_is_told() {
    let mut channel = Channel::with_server(Habits::default(), Config::DEFAULT, &[1; 100]);
    for block in [false, true] {
        let address = Address::new(0x2001, 0);
        for transfer in [Transfer::Upload { address, block }, Transfer::Download { address, size: 4, block }]
        {
            let (end, _) = channel.run(transfer, &[0; 4], &mut keep);
            assert_eq!(end, Err(Failure::Aborted(Abort::NO_OBJECT)));
        }
    }
    assert_eq!(channel.client.counters().aborted, 4);
    assert_eq!(channel.far.aborts, [], "a server that has aborted is not told");
}

fn client() -> Client {
    Client::new(NodeId::MIN, Config::DEFAULT)
}

#[test]
fn a_late_response_is_not_that_of_the_next_transfer() {
    let mut client = client();
    client.submit(write(2, false)).expect("idle");
    assert_eq!(client.submit(READ), Err(Busy));
    assert!(matches!(client.poll(ms(0)), Action::Fetch { .. }));
    client.supply(ms(0), &[6, 0]);
    assert!(matches!(client.poll(ms(0)), Action::Transmit(_)));
    assert_eq!(client.poll(ms(500)), Action::Transmit(frame(0x601, "80 00 20 00 00 00 04 05")));
    assert_eq!(client.poll(ms(500)), Action::Done(Err(Failure::Timeout { heard: None })));
    // The same object again: its response could not be told from the late one.
    client.submit(write(2, false)).expect("idle");
    assert_eq!((client.poll(ms(501)), client.poll_at()), (Action::Idle, Some(ms(1_000))));
    client.receive(ms(600), &frame(0x581, "60 00 20 00 00 00 00 00"));
    assert_eq!(client.counters().late, 1);
    assert!(matches!(client.poll(ms(600)), Action::Fetch { .. }), "what was owed has come");
    client.supply(ms(600), &[7, 0]);
    assert!(matches!(client.poll(ms(600)), Action::Transmit(_)));
    assert_eq!(client.poll(ms(600)), Action::Idle);
}

#[test]
fn responses_that_do_not_fit_are_passed_over() {
    let mut client = client();
    client.submit(READ).expect("idle");
    assert!(matches!(client.poll(ms(0)), Action::Transmit(_)));
    let strange = [
        "43 01 20 00 01 00 00 00",
        "43 00 20 01 01 00 00 00",
        "60 00 20 00 00 00 00 00",
        "80 01 20 00 00 00 02 06",
        // Of zencan-node, after the end of a block upload.
        "80 00 00 00 01 00 04 05",
        "43 00 20 00 01 00 00",
        "E0 00 20 00 00 00 00 00",
        "00 01 02 03 04 05 06 07",
    ];
    for bytes in strange {
        client.receive(ms(1), &frame(0x581, bytes));
        assert_eq!(client.poll(ms(1)), Action::Idle, "{bytes}");
    }
    client.receive(ms(1), &frame(0x582, "43 00 20 00 01 00 00 00"));
    assert_eq!((client.poll(ms(1)), client.counters().unpaired), (Action::Idle, 8));
    client.receive(ms(2), &frame(0x581, "4F 00 20 00 2A 00 00 00"));
    assert_eq!(client.poll(ms(2)), Action::Data([0x2A].into_iter().collect()));
    assert_eq!(client.poll(ms(2)), Action::Done(Ok(Outcome::Read { size: 1, checked: true })));
    client.submit(write(1, false)).expect("idle");
    let _ = client.poll(ms(2));
    client.supply(ms(2), &[1]);
    let _ = client.poll(ms(2));
    client.receive(ms(3), &frame(0x581, strange[0]));
    assert!(matches!(client.poll(ms(502)), Action::Transmit(_)));
    assert_eq!(client.poll(ms(502)), Action::Done(Err(Failure::Timeout { heard: Some(0x43) })));
}

/// What the client does about one response to the first messages of a transfer.
fn answered(transfer: Transfer, answers: &[&str]) -> Action {
    let mut client = client();
    client.submit(transfer).expect("idle");
    for answer in answers {
        loop {
            match client.poll(ms(1)) {
                Action::Fetch { count, .. } => client.supply(ms(1), &[0x55; 7][..count]),
                Action::Idle => break,
                Action::Done(end) => panic!("{end:?}"),
                Action::Transmit(_) | Action::Data(_) => {}
            }
        }
        client.receive(ms(2), &frame(0x581, answer));
    }
    loop {
        match client.poll(ms(2)) {
            Action::Transmit(_) | Action::Data(_) => {}
            other => return other,
        }
    }
}

#[test]
fn a_server_that_errs_is_told() {
    let failed = |failure| Action::Done(Err(failure));
    let begun = "41 00 20 00 08 00 00 00";
    let first = "00 01 02 03 04 05 06 07";
    assert_eq!(answered(READ, &[begun, first, first]), failed(Failure::Toggle));
    let size = |received| failed(Failure::Size { expected: 8, received });
    assert_eq!(answered(READ, &[begun, first, "11 08 09 00 00 00 00 00"]), size(14));
    assert_eq!(answered(READ, &[begun, "01 01 02 03 04 05 06 07"]), size(7));
    assert_eq!(
        answered(write(9, false), &["60 00 20 00 00 00 00 00", "30 00 00 00 00 00 00 00"]),
        failed(Failure::Toggle)
    );
    for block in [0, 128] {
        let answer = format!("A4 00 20 00 {block:02X} 00 00 00");
        assert_eq!(answered(write(9, true), &[&answer]), failed(Failure::BlockSize { received: block }));
    }
    let begun = "A4 00 20 00 7F 00 00 00";
    let sequence = failed(Failure::Sequence { sent: 2, received: 3 });
    assert_eq!(answered(write(9, true), &[begun, "A2 03 7F 00 00 00 00 00"]), sequence);
    let nothing = "A2 00 7F 00 00 00 00 00";
    assert_eq!(
        answered(write(9, true), &[begun, nothing, nothing, nothing, nothing]),
        failed(Failure::Stuck)
    );
    let begun = "C6 00 20 00 07 00 00 00";
    let crc = Failure::Crc { expected: sdo::crc(0, &[1, 2, 3, 4, 5, 6, 7]), received: 0x1234 };
    assert_eq!(
        answered(READ_BLOCK, &[begun, "81 01 02 03 04 05 06 07", "C1 34 12 00 00 00 00 00"]),
        failed(crc)
    );
}

/// Some servers acknowledge a segment out of order at once, not at the end of the block.
#[test]
fn an_early_acknowledgement_is_understood() {
    let mut client = client();
    client.submit(write(70, true)).expect("idle");
    let step = |client: &mut Client, at| match client.poll(at) {
        Action::Fetch { count, offset } => {
            client.supply(at, &vec![offset as u8; count]);
            client.poll(at)
        }
        other => other,
    };
    assert!(matches!(step(&mut client, ms(0)), Action::Transmit(_)));
    client.receive(ms(1), &frame(0x581, "A4 00 20 00 7F 00 00 00"));
    for _ in 0..5 {
        assert!(matches!(step(&mut client, ms(1)), Action::Transmit(_)));
    }
    // The third was lost; the fourth and fifth are strange to it.
    client.receive(ms(2), &frame(0x581, "A2 02 7F 00 00 00 00 00"));
    assert_eq!(client.poll(ms(2)), Action::Idle);
    client.receive(ms(3), &frame(0x581, "A2 00 7F 00 00 00 00 00"));
    assert_eq!((client.poll(ms(3)), client.poll_at()), (Action::Idle, Some(ms(13))));
    assert_eq!(step(&mut client, ms(13)), Action::Transmit(frame(0x601, "01 0E 0E 0E 0E 0E 0E 0E")));
}

#[test]
fn what_is_given_up() {
    let mut client = client();
    client.submit(READ).expect("idle");
    client.cancel(ms(0));
    assert_eq!(client.poll(ms(0)), Action::Done(Err(Failure::NotSent)));
    client.submit(READ).expect("idle");
    assert!(matches!(client.poll(ms(0)), Action::Transmit(_)));
    client.cancel(ms(1));
    assert_eq!(client.poll(ms(1)), Action::Transmit(frame(0x601, "80 00 20 00 21 00 00 08")));
    assert_eq!(client.poll(ms(1)), Action::Done(Err(Failure::Cancelled)));
    client.submit(write(9, false)).expect("idle");
    assert!(matches!(client.poll(ms(600)), Action::Transmit(_)));
    client.receive(ms(601), &frame(0x581, "60 00 20 00 00 00 00 00"));
    assert_eq!(client.poll(ms(601)), Action::Fetch { offset: 0, count: 7 });
    client.supply(ms(601), &[1; 6]);
    assert!(matches!(client.poll(ms(601)), Action::Transmit(_)));
    assert_eq!(client.poll(ms(601)), Action::Done(Err(Failure::Supply)));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    /// Whatever is lost: what ends well is right, and everything ends.
    #[test]
    fn what_ends_well_is_right(
        seed: u64, size in 0..3_000_usize, block in 1..=127_u8, own in 1..=127_u8, lost in 0..200_u64, kind in 0..4_usize,
        says_size: bool, hasty: bool,
    ) {
        let mut random = Random(seed);
        let data = random.bytes(size);
        let habits = Habits { block, says_size, hasty, ..Habits::default() };
        let config = Config { block: own, ..Config::DEFAULT };
        let before = if kind < 2 { data.clone() } else { vec![] };
        let mut channel = Channel::with_server(habits, config, &before);
        // A server that has not heard that a block is over takes what comes next for a segment of it.
        let mut lose = |passing: Passing| passing.bytes[0] != 0x80 && random.chance(lost);
        let transfer = [READ, READ_BLOCK, write(size, false), write(size, true)][kind];
        let (end, read) = channel.run(transfer, &data, &mut lose);
        match end {
            Ok(Outcome::Read { .. }) => prop_assert!(read == data),
            Ok(Outcome::Written) => prop_assert_eq!(&channel.far.written, &[((0x2000, 0), data.clone())]),
            Err(Failure::Timeout { .. } | Failure::Position | Failure::Stuck | Failure::Crc { .. }) => {}
            Err(Failure::Size { .. } | Failure::Sequence { .. } | Failure::Aborted(_)) => {}
            Err(other) => prop_assert!(false, "{other:?}"),
        }
        for (_, written) in &channel.far.written {
            prop_assert!(*written == data, "never half of it");
        }
        // The channel is as good as new.
        let (end, read) = channel.run(READ, b"", &mut keep);
        prop_assert!(end.is_ok(), "{:?}", end);
        let whole = kind < 2 || !channel.far.written.is_empty();
        prop_assert_eq!(read, if whole { data } else { vec![] });
    }

    /// Any frames in any order: no panic, no spinning, no more bytes asked for than there are.
    #[test]
    fn nothing_disturbs_a_client(
        kind in 0..4_usize, size in 0..40_usize,
        steps in prop::collection::vec((any_message(), 0..300_u64), 0..60),
    ) {
        let mut client = client();
        let mut at = 0;
        let mut open = false;
        for (message, pause) in steps {
            if !open {
                let transfer = [READ, READ_BLOCK, write(size, false), write(size, true)][kind];
                prop_assert!(client.submit(transfer).is_ok());
                open = true;
            }
            at += pause;
            client.receive(ms(at), &message);
            for polls in 0.. {
                prop_assert!(polls < 400, "it spins");
                match client.poll(ms(at)) {
                    Action::Fetch { offset, count } => {
                        prop_assert!(offset as usize + count <= size && count > 0);
                        client.supply(ms(at), &[0x33; 7]);
                    }
                    Action::Done(_) => {
                        prop_assert!(open);
                        open = false;
                    }
                    Action::Idle => break,
                    Action::Transmit(_) | Action::Data(_) => {}
                }
            }
            prop_assert_eq!(client.is_busy(), open);
            prop_assert!(client.poll_at().is_none_or(|due| due > ms(at)));
        }
    }
}

/// Often what a server says of the object.
fn any_message() -> impl Strategy<Value = Frame> {
    let of_the_object = (any::<u8>(), any::<[u8; 4]>()).prop_map(|(first, rest)| {
        let id = Id::base(0x581);
        Frame::full(id, [first, 0, 0x20, 0, rest[0], rest[1], rest[2], rest[3]])
    });
    let any = any::<[u8; 8]>().prop_map(|bytes| Frame::full(Id::base(0x581), bytes));
    prop_oneof![3 => of_the_object, 2 => any, 1 => any_frame()]
}

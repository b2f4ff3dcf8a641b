//! Every fault of a slave or line, in both framings: never a wrong value, and the next healthy unit is answered.

mod common;

use common::{End, Rig, config, micros};
use puente_modbus::{Counters, Evidence, FrameError, Mode, rtu};
use std::time::Duration;

const MODES: [Mode; 2] = [Mode::Rtu, Mode::Ascii];

/// A request, its reply, and the reply to the same function with another quantity, address or value.
struct Case {
    request: &'static [u8],
    reply: &'static [u8],
    other: &'static [u8],
}

const CASES: &[Case] = &[
    Case { request: &[1, 0, 0, 0, 9], reply: &[1, 2, 0xA5, 1], other: &[1, 1, 0x5A] },
    Case { request: &[2, 0, 0, 0, 1], reply: &[2, 1, 1], other: &[2, 2, 7, 7] },
    Case { request: &[3, 0, 7, 0, 1], reply: &[3, 2, 0x12, 0x34], other: &[3, 4, 0xBA, 0xD0, 0xBA, 0xD1] },
    Case { request: &[4, 0, 7, 0, 2], reply: &[4, 4, 0x12, 0x34, 0x56, 0x78], other: &[4, 2, 0xBA, 0xD0] },
    Case { request: &[5, 0, 1, 0xFF, 0], reply: &[5, 0, 1, 0xFF, 0], other: &[5, 0, 2, 0xFF, 0] },
    Case { request: &[6, 0, 0x25, 0, 0x64], reply: &[6, 0, 0x25, 0, 0x64], other: &[6, 0, 0x25, 0, 0x65] },
    Case { request: &[8, 0, 0, 0xA5, 0x37], reply: &[8, 0, 0, 0xA5, 0x37], other: &[8, 0, 0, 0xA5, 0x38] },
    Case { request: &[0x0F, 0, 0, 0, 9, 2, 0xFF, 1], reply: &[0x0F, 0, 0, 0, 9], other: &[0x0F, 0, 0, 0, 8] },
    Case {
        request: &[0x10, 0, 1, 0, 2, 4, 0, 7, 0, 8],
        reply: &[0x10, 0, 1, 0, 2],
        other: &[0x10, 0, 1, 0, 1],
    },
    Case {
        request: &[0x16, 0, 4, 0, 0xF2, 0, 0x25],
        reply: &[0x16, 0, 4, 0, 0xF2, 0, 0x25],
        other: &[0x16, 0, 4, 0, 0xF2, 0, 0x26],
    },
    Case {
        request: &[0x17, 0, 0, 0, 1, 0, 9, 0, 1, 2, 0, 7],
        reply: &[0x17, 2, 0, 5],
        other: &[0x17, 4, 0, 5, 0, 6],
    },
    Case {
        request: &[0x2B, 0x0E, 4, 0],
        reply: &[0x2B, 0x0E, 4, 0x81, 0, 0, 1, 0, 2, b'S', b'T'],
        other: &[0x2B, 0x0E, 4, 0x81, 0, 0, 1, 1, 2, b'S', b'T'],
    },
];

/// The reply comes so long after the request's end.
const DELAY: Duration = Duration::from_millis(8);

/// Runs `fault` for every case in both framings, then wants a healthy unit answered.
fn each(fault: impl Fn(&mut Rig, &Case)) {
    for mode in MODES {
        for case in CASES {
            let mut rig = Rig::new(config(mode));
            fault(&mut rig, case);
            let frame = rig.adu(2, &[3, 2, 0, 7]);
            let end = rig.exchange(2, &[3, 0, 9, 0, 1], &[(DELAY, frame)]);
            assert_eq!(end, End::Reply(vec![3, 2, 0, 7]), "after it, {mode:?} {:02X?}", case.request);
        }
    }
}

fn good(case: &Case) -> End {
    End::Reply(case.reply.to_vec())
}

#[test]
fn silent() {
    each(|rig, case| {
        assert_eq!(rig.exchange(1, case.request, &[]), End::NoReply(Evidence::Silence));
        assert_eq!(rig.master.counters().timeouts, 1);
    });
}

#[test]
fn late_with_another_quantity() {
    each(|rig, case| {
        // An earlier request timed out and its quarantine is over, when its reply comes into the next transaction.
        assert_eq!(rig.exchange(1, &[3, 0, 0, 0, 9], &[]), End::NoReply(Evidence::Silence));
        rig.now = rig.master.ready_at(1);
        let (late, true_one) = (rig.adu(1, case.other), rig.adu(1, case.reply));
        let script = [(DELAY, late.clone()), (2 * DELAY, true_one)];
        assert_eq!(rig.exchange(1, case.request, &script), good(case), "{:02X?}", case.request);
        let counters = rig.master.counters();
        assert_eq!((counters.wrong_length, counters.late), (1, 1));
        // Without the true reply.
        let end = rig.exchange(1, case.request, &[(DELAY, late)]);
        assert!(
            matches!(end, End::NoReply(Evidence::WrongLength { .. } | Evidence::WrongField { .. })),
            "{end:?}"
        );
    });
}

#[test]
fn late_in_quarantine() {
    each(|rig, case| {
        assert_eq!(rig.exchange(1, case.request, &[]), End::NoReply(Evidence::Silence));
        let late = rig.adu(1, case.reply);
        // Into the transaction of another unit.
        let true_one = rig.adu(2, case.reply);
        assert_eq!(rig.exchange(2, case.request, &[(DELAY, late), (2 * DELAY, true_one)]), good(case));
        let counters = rig.master.counters();
        assert_eq!((counters.wrong_unit, counters.late), (1, 1));
        assert!(rig.master.ready_at(1) <= rig.now, "it is available again");
    });
}

#[test]
fn late_where_the_quarantine_was_ended() {
    const JOG: &[u8] = &[6, 0x10, 0x24, 0, 1];
    const STOP: &[u8] = &[6, 0x10, 0x24, 0, 0];
    for mode in MODES {
        let mut rig = Rig::new(config(mode));
        assert_eq!(rig.exchange(1, JOG, &[]), End::NoReply(Evidence::Silence));
        assert!(rig.master.owes(1));
        rig.master.end_quarantine(1);
        assert!(rig.master.ready_at(1) <= rig.now);
        let (late, true_one) = (rig.adu(1, JOG), rig.adu(1, STOP));
        let end = rig.exchange(1, STOP, &[(DELAY, late), (2 * DELAY, true_one)]);
        assert_eq!(end, End::Reply(STOP.to_vec()), "{mode:?}");
        assert_eq!(rig.now, rig.sent[1].0 + rig.config.line.wire_time(rig.sent[1].1.len()) + 2 * DELAY);
        assert!(!rig.master.owes(1));
    }
}

#[test]
fn corrupt() {
    each(|rig, case| {
        let whole = rig.adu(1, case.reply);
        // Not its first byte: see `wrong_unit`. Not the delimiters of ASCII either.
        for at in 1..whole.len() - 2 {
            let mut frame = whole.clone();
            frame[at] ^= 0x01;
            let end = rig.exchange(1, case.request, &[(DELAY, frame.clone())]);
            assert!(
                matches!(end, End::NoReply(Evidence::Check { .. } | Evidence::Damaged(_))),
                "{end:?} with byte {at} of {:02X?}",
                case.reply
            );
            rig.now = rig.master.ready_at(1);
            // A good one behind it is taken.
            let script = [(DELAY, frame), (4 * DELAY, whole.clone())];
            assert_eq!(rig.exchange(1, case.request, &script), good(case));
        }
        let errors = rig.master.counters().check_errors;
        assert_eq!(errors as usize, 2 * (whole.len() - 3), "each is counted once");
    });
}

#[test]
fn corrupt_check() {
    let mut rig = Rig::new(config(Mode::Rtu));
    let end = rig.exchange(1, &[3, 0x10, 0, 0, 1], &[(DELAY, vec![1, 3, 2, 0, 0x37, 0x38, 0x52])]);
    assert_eq!(end, End::NoReply(Evidence::Check { expected: 0x92F9, received: 0x5238 }));
    let mut rig = Rig::new(config(Mode::Ascii));
    let end = rig.exchange(1, &[3, 0x10, 0, 0, 1], &[(DELAY, b":0103020037C4\r\n".to_vec())]);
    assert_eq!(end, End::NoReply(Evidence::Check { expected: 0xC3, received: 0xC4 }));
}

#[test]
fn truncated() {
    each(|rig, case| {
        let whole = rig.adu(1, case.reply);
        for length in 1..whole.len() {
            let end = rig.exchange(1, case.request, &[(DELAY, whole[..length].to_vec())]);
            assert_eq!(end, End::NoReply(Evidence::Damaged(FrameError::TooShort)), "{length} bytes");
            rig.now = rig.master.ready_at(1);
        }
        assert_eq!(rig.master.counters().check_errors as usize, whole.len() - 1);
    });
}

#[test]
fn wrong_unit() {
    each(|rig, case| {
        let (wrong, true_one) = (rig.adu(3, case.reply), rig.adu(1, case.reply));
        let end = rig.exchange(1, case.request, &[(DELAY, wrong.clone())]);
        assert_eq!(end, End::NoReply(Evidence::WrongUnit { expected: 1, received: 3 }));
        rig.now = rig.master.ready_at(1);
        let end = rig.exchange(1, case.request, &[(DELAY, [wrong, true_one].concat())]);
        assert_eq!(end, good(case), "the true one right behind it");
        assert_eq!(rig.master.counters().wrong_unit, 2);
    });
}

#[test]
fn wrong_function() {
    each(|rig, case| {
        let expected = case.request[0];
        let true_one = rig.adu(1, case.reply);
        let others = CASES.iter().filter(|other| other.request[0] != expected);
        for wrong in others.flat_map(|other| [other.reply.to_vec(), vec![other.request[0] | 0x80, 2]]) {
            let frame = rig.adu(1, &wrong);
            let end = rig.exchange(1, case.request, &[(DELAY, frame.clone())]);
            assert_eq!(end, End::NoReply(Evidence::WrongFunction { expected, received: wrong[0] }));
            rig.now = rig.master.ready_at(1);
            let end = rig.exchange(1, case.request, &[(DELAY, [frame, true_one.clone()].concat())]);
            assert_eq!(end, good(case));
        }
        assert_eq!(rig.master.counters().wrong_function as usize, 4 * (CASES.len() - 1));
    });
}

#[test]
fn wrong_byte_count() {
    for mode in MODES {
        for count in (0..=255_u8).filter(|count| *count != 2) {
            let mut rig = Rig::new(config(mode));
            // A valid check over a byte count that lies.
            let frame = rig.adu(1, &[3, count, 0x12, 0x34]);
            let end = rig.exchange(1, &[3, 0, 0, 0, 1], &[(DELAY, frame)]);
            match (mode, end) {
                (Mode::Ascii, End::NoReply(Evidence::WrongLength { expected: 4, .. })) => {}
                // The byte count says where an RTU frame ends, so that there is no valid one.
                (Mode::Rtu, End::NoReply(Evidence::Check { .. } | Evidence::Damaged(_))) => {}
                (_, end) => panic!("{end:?} with byte count {count}"),
            }
            let frame = rig.adu(2, &[3, 2, 0, 7]);
            let end = rig.exchange(2, &[3, 0, 9, 0, 1], &[(DELAY, frame)]);
            assert_eq!(end, End::Reply(vec![3, 2, 0, 7]));
        }
    }
}

#[test]
fn garbage_around() {
    let garbages: &[&[u8]] = &[
        &[0x00],
        &[0xFF],
        &[0x01],
        &[0x01, 0x03],
        &[0x55; 9],
        &[0x01, 0x03, 0xFA],
        &[0x01, 0x41, 0x00],
        &[0x00; 300],
        &[0xFF; 300],
        b":01",
    ];
    each(|rig, case| {
        for garbage in garbages {
            let frame = rig.adu(1, case.reply);
            let before = [garbage, frame.as_slice()].concat();
            let start = rig.now;
            assert_eq!(rig.exchange(1, case.request, &[(DELAY, before)]), good(case), "after {garbage:02X?}");
            // Where the garbage looks like a longer frame, it takes a silence to know better.
            let wire = rig.config.line.wire_time(rig.adu(1, case.request).len());
            let most = rig.config.line.wire_time(1) * 4 + wire + DELAY + rtu::t3_5(rig.config.line);
            assert!(rig.now.since(start) <= most, "after {garbage:02X?}");

            let behind = [frame.as_slice(), garbage].concat();
            assert_eq!(
                rig.exchange(1, case.request, &[(DELAY, behind)]),
                good(case),
                "before {garbage:02X?}"
            );
        }
        assert_eq!(rig.master.counters().timeouts, 0);
    });
}

#[test]
fn echoed_request() {
    each(|rig, case| {
        let (own, reply) = (rig.adu(1, case.request), rig.adu(1, case.reply));
        if case.request == case.reply {
            // Nothing tells the echo from the reply: documented at `Echo::Off`.
            return;
        }
        let script = [(Duration::ZERO, own.clone()), (DELAY, reply.clone())];
        assert_eq!(rig.exchange(1, case.request, &script), good(case));
        assert_eq!(rig.exchange(1, case.request, &[(DELAY, [own.clone(), reply].concat())]), good(case));
        assert_eq!(rig.exchange(1, case.request, &[(DELAY, own)]), End::NoReply(Evidence::Echo));
        assert_eq!(rig.master.counters().echoes, 3);
    });
}

#[test]
fn duplicate_reply() {
    each(|rig, case| {
        let reply = rig.adu(1, case.reply);
        assert_eq!(
            rig.exchange(1, case.request, &[(DELAY, [reply.clone(), reply.clone()].concat())]),
            good(case)
        );
        assert_eq!(rig.master.counters().late, 1);
        // The second one comes into the next transaction, of another quantity and of another unit.
        let request = [3, 0, 7, 0, 5];
        let other = [3, 10, 0, 1, 0, 2, 0, 3, 0, 4, 0, 5];
        for unit in [1, 2] {
            let frame = rig.adu(unit, &other);
            let end = rig.exchange(unit, &request, &[(micros(10), reply.clone()), (DELAY, frame)]);
            assert_eq!(end, End::Reply(other.to_vec()));
        }
    });
}

#[test]
fn reply_in_single_bytes() {
    each(|rig, case| {
        let step = rig.config.line.wire_time(1);
        let script: Vec<_> = (rig.adu(1, case.reply).iter().enumerate())
            .map(|(index, byte)| (DELAY + step * index as u32, vec![*byte]))
            .collect();
        assert_eq!(rig.exchange(1, case.request, &script), good(case));
        let expected = Counters { requests: 1, replies: 1, ..Counters::default() };
        assert_eq!(rig.master.counters(), expected);
    });
}

/// A frame inside the data of another is not looked at, as long as that one may be whole.
#[test]
fn frame_in_a_frame() {
    let mut rig = Rig::new(config(Mode::Rtu));
    let inner = rig.adu(1, &[3, 2, 0xBA, 0xD0]);
    let outer = [&[3, 10, 0, 0, 0][..], &inner].concat();
    let late = rig.adu(1, &outer);
    let true_one = rig.adu(1, &[3, 2, 0, 7]);
    for cut in 1..late.len() {
        rig.send(1, &[3, 0, 0, 0, 1]);
        rig.bytes(DELAY, &late[..cut]);
        rig.bytes(DELAY + micros(500), &late[cut..]);
        rig.bytes(2 * DELAY, &true_one);
        assert_eq!(rig.finish(), End::Reply(vec![3, 2, 0, 7]), "cut at {cut}");
    }
}

/// What came before a request cannot become its reply.
#[test]
fn halves_of_two_transactions_are_not_joined() {
    each(|rig, case| {
        let whole = rig.adu(1, case.reply);
        for cut in 1..whole.len() {
            let end = rig.exchange(1, case.request, &[(DELAY, whole[..cut].to_vec())]);
            assert!(matches!(end, End::NoReply(_)));
            rig.now = rig.master.ready_at(1);
            let end = rig.exchange(1, case.request, &[(DELAY, whole[cut..].to_vec())]);
            assert!(matches!(end, End::NoReply(_)), "cut at {cut}");
            rig.now = rig.master.ready_at(1);
        }
    });
}

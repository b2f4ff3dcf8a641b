//! The bytes of each fault.

use crate::{Rig, ms, thesis_line};
use puente_cell::{Config, Fault};
use puente_modbus::{Mode, ascii, rtu};

const REQUEST: &[u8] = &[0x03, 0x00, 0x25, 0, 2];
const GOOD: &[u8] = &[0x03, 4, 0, 100, 0, 0];

/// What comes back from unit 1 under a fault; the first request after it must be answered well.
fn under(fault: Fault, mode: Mode) -> Vec<u8> {
    let mut rig = Rig::of(mode);
    assert!(rig.cell.set_fault(1, fault.times(1)));
    let reply = rig.raw(&rig.frame(1, REQUEST));
    assert_eq!(rig.ask(1, REQUEST), GOOD);
    reply
}

fn good(mode: Mode) -> Vec<u8> {
    Rig::of(mode).frame(1, GOOD)
}

const MODES: [Mode; 2] = [Mode::Rtu, Mode::Ascii];

#[test]
fn silent_and_lost() {
    for mode in MODES {
        assert_eq!(under(Fault::Silent, mode), []);
        assert_eq!(under(Fault::Lost, mode), []);
    }
    let write = [0x06, 0, 0x25, 0, 9];
    for (fault, speed) in [(Fault::Silent, 100), (Fault::Lost, 9), (Fault::Exception(4), 100)] {
        let mut rig = Rig::of(Mode::Ascii);
        rig.cell.set_fault(1, fault.clone().times(1));
        rig.raw(&rig.frame(1, &write));
        assert_eq!(rig.read(1, 0x25), speed, "{fault:?}");
    }
}

#[test]
fn late() {
    // The first reply comes while the second request, of another quantity, is under way; or after the second reply.
    for (extra, late_first) in [(ms(495), true), (ms(600), false)] {
        let mut rig = Rig::of(Mode::Rtu);
        rig.cell.set_fault(1, Fault::Late(extra).times(1));
        rig.cell.receive(rig.now, &rig.frame(1, REQUEST));
        assert_eq!(rig.pass(ms(500)), []);
        rig.cell.receive(rig.now, &rig.frame(1, &[0x03, 0x00, 0x25, 0, 1]));
        let replies: Vec<u8> = rig.pass(ms(500)).into_iter().flat_map(|(_, piece)| piece).collect();
        let (late, next) = (rig.frame(1, GOOD), rig.frame(1, &[0x03, 2, 0, 100]));
        let expected = if late_first { [late, next] } else { [next, late] };
        assert_eq!(replies, expected.concat());
    }
}

#[test]
fn corrupt() {
    for mode in MODES {
        for seed in 0..500 {
            let mut rig = Rig::new(Config { seed, paced: false, ..Config::new(mode, thesis_line(), &[1]) });
            rig.cell.set_fault(1, Fault::Corrupt);
            let reply = rig.raw(&rig.frame(1, REQUEST));
            let good = good(mode);
            assert_eq!(reply.len(), good.len());
            assert_eq!(reply.iter().zip(&good).filter(|(got, good)| got != good).count(), 1);
            match mode {
                Mode::Rtu => assert!(rtu::parse(&reply).is_err(), "{reply:02X?}"),
                Mode::Ascii => assert!(ascii::parse(&reply).is_err(), "{reply:02X?}"),
            }
        }
    }
}

#[test]
fn wrong_frames_with_right_checks() {
    for mode in MODES {
        let frame = |unit, pdu: &[u8]| Rig::of(mode).frame(unit, pdu);
        assert_eq!(under(Fault::WrongUnit, mode), frame(2, GOOD));
        assert_eq!(under(Fault::WrongFunction, mode), frame(1, &[0x04, 4, 0, 100, 0, 0]));
        assert_eq!(under(Fault::WrongByteCount, mode), frame(1, &[0x03, 6, 0, 100, 0, 0]));
        assert_eq!(under(Fault::OtherQuantity, mode), frame(1, &[0x03, 6, 0, 100, 0, 0, 0, 0]));
        assert_eq!(under(Fault::Exception(6), mode), frame(1, &[0x83, 6]));
    }
    let mut rig = Rig::of(Mode::Ascii);
    rig.cell.set_fault(1, Fault::WrongByteCount);
    let write = [0x06, 0, 0x25, 0, 9];
    assert_eq!(rig.raw(&rig.frame(1, &write)), rig.frame(1, &[0x06, 0, 0x25, 0, 9, 0]));
}

#[test]
fn cut_doubled_and_surrounded() {
    for mode in MODES {
        let good = good(mode);
        let request = Rig::of(mode).frame(1, REQUEST);
        assert_eq!(under(Fault::Truncated, mode), good[..good.len() / 2]);
        assert_eq!(under(Fault::Echo, mode), [request, good.clone()].concat());
        assert_eq!(under(Fault::Duplicate, mode), [good.clone(), good.clone()].concat());
        let before = under(Fault::GarbageBefore, mode);
        let after = under(Fault::GarbageAfter, mode);
        assert!(before.ends_with(&good) && (1..=8).contains(&(before.len() - good.len())), "{before:02X?}");
        assert!(after.starts_with(&good) && (1..=8).contains(&(after.len() - good.len())), "{after:02X?}");
    }
}

#[test]
fn a_silence_parts_the_two_of_a_duplicate() {
    for paced in [true, false] {
        let mut rig = Rig::new(Config { paced, ..Config::new(Mode::Rtu, thesis_line(), &[1]) });
        rig.cell.set_fault(1, Fault::Duplicate);
        rig.cell.receive(rig.now, &rig.frame(1, REQUEST));
        let pieces = rig.pass(ms(200));
        let length = good(Mode::Rtu).len();
        let mut seen = 0;
        let first_of_second = pieces.iter().position(|(_, piece)| {
            seen += piece.len();
            seen > length
        });
        let at = first_of_second.expect("a second reply");
        let gap = pieces[at].0.since(pieces[at - 1].0);
        assert!(gap >= rtu::t3_5(thesis_line()), "{gap:?}");
    }
}

#[test]
fn faults_in_turn() {
    let mut rig = Rig::of(Mode::Ascii);
    let turn = Fault::Silent.times_then(1, Fault::Exception(6).times_then(2, Fault::Exception(5).times(1)));
    rig.cell.set_fault(1, turn);
    assert_eq!(rig.raw(&rig.frame(1, REQUEST)), []);
    assert_eq!(rig.ask(2, REQUEST), GOOD, "other drives are well");
    for expected in [&[0x83, 6], &[0x83, 6], &[0x83, 5], GOOD, GOOD] {
        assert_eq!(rig.ask(1, REQUEST), expected);
    }
}

#[test]
fn faults_are_reproducible() {
    let run = || {
        let mut rig = Rig::of(Mode::Rtu);
        rig.cell.set_fault(1, Fault::GarbageBefore);
        (0..20).map(|_| rig.raw(&rig.frame(1, REQUEST))).collect::<Vec<_>>()
    };
    assert_eq!(run(), run());
    assert!(run().windows(2).any(|pair| pair[0] != pair[1]));
}

//! When the master sends, and when it is done.

mod common;

use common::{End, Rig, adu, config, line, micros};
use puente_line::Instant;
use puente_modbus::{Action, Busy, Config, Echo, Evidence, Exception, FrameError, Master, Mode, rtu};
use std::time::Duration;

const READ: &[u8] = &[3, 0, 0, 0, 1];
const ANSWER: &[u8] = &[3, 2, 0x12, 0x34];
const WRITE: &[u8] = &[6, 0, 0x25, 0, 0x64];
const OPAQUE: &[u8] = &[0x41, 1, 2];
const MODES: [Mode; 2] = [Mode::Rtu, Mode::Ascii];

fn gap(config: &Config) -> Duration {
    match config.mode {
        Mode::Rtu => rtu::t3_5(config.line),
        Mode::Ascii => rtu::t1_5(config.line),
    }
}

fn wire(config: &Config, pdu: &[u8]) -> Duration {
    config.line.wire_time(adu(config.mode, 1, pdu).len())
}

fn answer() -> End {
    End::Reply(ANSWER.to_vec())
}

#[test]
fn a_reply_is_done_with_its_last_byte_and_the_next_request_waits_for_silence() {
    for mode in MODES {
        let config = config(mode);
        let mut rig = Rig::new(config);
        let start = rig.send(1, READ);
        let character = config.line.wire_time(1);
        let frame = rig.adu(1, ANSWER);
        let mut at = wire(&config, READ) + micros(8_000);
        for byte in &frame {
            at += character;
            rig.bytes(at, &[*byte]);
        }
        assert_eq!(rig.finish(), answer());
        assert_eq!(rig.now, start + at);
        let done = rig.now;
        assert_eq!(rig.send(1, READ), done + gap(&config), "{mode:?}");
    }
}

/// ESTUN drives ask for 4 characters where the standard has 3.5.
#[test]
fn a_longer_silence_than_the_standards_is_kept() {
    let base = config(Mode::Rtu);
    for (silence, kept) in [(base.line.wire_time(4), base.line.wire_time(4)), (Duration::ZERO, gap(&base))] {
        let mut rig = Rig::new(Config { silence, ..base });
        rig.send(1, READ);
        rig.bytes(wire(&base, READ), &adu(Mode::Rtu, 1, ANSWER));
        assert_eq!(rig.finish(), answer());
        let done = rig.now;
        assert_eq!(rig.send(1, READ), done + kept);
    }
}

#[test]
fn every_known_reply_is_done_with_its_last_byte() {
    let cases: &[(&[u8], &[u8])] = &[
        (&[1, 0, 0, 0, 9], &[1, 2, 0xFF, 1]),
        (&[2, 0, 0, 0, 1], &[2, 1, 1]),
        (READ, ANSWER),
        (READ, &[0x83, 2]),
        (&[4, 0, 0, 0, 2], &[4, 4, 0, 1, 0, 2]),
        (&[5, 0, 1, 0xFF, 0], &[5, 0, 1, 0xFF, 0]),
        (WRITE, WRITE),
        (WRITE, &[0x86, 3]),
        (&[8, 0, 0, 1, 2, 3, 4], &[8, 0, 0, 1, 2, 3, 4]),
        (&[8, 0, 0x0B, 0, 0], &[8, 0, 0x0B, 0x12, 0x34]),
        (&[0x0F, 0, 0, 0, 9, 2, 1, 1], &[0x0F, 0, 0, 0, 9]),
        (&[0x10, 0, 0, 0, 1, 2, 0, 7], &[0x10, 0, 0, 0, 1]),
        (&[0x11], &[0x11, 3, 1, 0xFF, 9]),
        (&[0x16, 0, 4, 0, 0xF2, 0, 0x25], &[0x16, 0, 4, 0, 0xF2, 0, 0x25]),
        (&[0x17, 0, 0, 0, 1, 0, 9, 0, 1, 2, 0, 7], &[0x17, 2, 0, 5]),
        (&[0x2B, 0x0E, 1, 0], &[0x2B, 0x0E, 1, 0x81, 0, 0, 2, 0, 1, b'a', 1, 2, b'b', b'c']),
        (OPAQUE, &[0xC1, 1]),
    ];
    for mode in MODES {
        for (request, reply) in cases {
            let mut rig = Rig::new(config(mode));
            let frame = rig.adu(1, reply);
            let start = rig.send(1, request);
            let after = wire(&rig.config, request) + micros(5_000);
            rig.bytes(after, &frame);
            assert_eq!(rig.finish(), End::Reply(reply.to_vec()), "{request:02X?}");
            assert_eq!(rig.now, start + after, "{request:02X?}");
        }
    }
}

#[test]
fn silence_ends_the_reply_to_an_opaque_function() {
    let mut rig = Rig::new(config(Mode::Rtu));
    let reply = [0x41, 9, 9, 9, 9];
    let frame = rig.adu(1, &reply);
    let start = rig.send(1, OPAQUE);
    // Torn apart by more than t3.5, as a USB adapter does.
    rig.bytes(micros(10_000), &frame[..4]);
    rig.bytes(micros(26_000), &frame[4..]);
    assert_eq!(rig.finish(), End::Reply(reply.to_vec()));
    assert_eq!(rig.now, start + micros(26_000) + rtu::t3_5(rig.config.line));

    // ASCII needs no silence.
    let mut rig = Rig::new(config(Mode::Ascii));
    let frame = rig.adu(1, &reply);
    let start = rig.send(1, OPAQUE);
    rig.bytes(micros(26_000), &frame);
    assert_eq!(rig.finish(), End::Reply(reply.to_vec()));
    assert_eq!(rig.now, start + micros(26_000));
}

#[test]
fn pauses_inside_a_reply_do_not_void_it() {
    for mode in MODES {
        let mut rig = Rig::new(config(mode));
        let frame = rig.adu(1, ANSWER);
        for cut in 1..frame.len() {
            rig.send(1, READ);
            rig.bytes(micros(20_000), &frame[..cut]);
            rig.bytes(micros(120_000), &frame[cut..]);
            assert_eq!(rig.finish(), answer(), "{mode:?} cut at {cut}");
        }
        assert_eq!(rig.master.counters().timeouts, 0);
    }
}

#[test]
fn a_reply_may_come_before_the_wire_time_has_passed() {
    for mode in MODES {
        let mut rig = Rig::new(config(mode));
        let frame = rig.adu(1, ANSWER);
        let start = rig.send(1, READ);
        rig.bytes(micros(50), &frame);
        assert_eq!(rig.finish(), answer());
        assert_eq!(rig.now, start + micros(50));
        assert_eq!(rig.send(1, READ), start + micros(50) + gap(&rig.config));
    }
}

#[test]
fn a_silent_unit_costs_one_timeout_and_is_quarantined_alone() {
    for mode in MODES {
        let mut rig = Rig::new(config(mode));
        let start = rig.send(1, READ);
        assert_eq!(rig.finish(), End::NoReply(Evidence::Silence));
        let deadline = start + wire(&rig.config, READ) + rig.config.reply_timeout;
        assert_eq!(rig.now, deadline);
        // Kept in milliseconds, rounded up.
        let ready = (deadline + rig.config.quarantine).as_micros().div_ceil(1000);
        assert_eq!(rig.master.ready_at(1), Instant::from_millis(ready));
        assert_eq!(rig.master.ready_at(2), Instant::ZERO);

        assert_eq!(rig.send(2, READ), deadline, "another unit is addressed at once");
        let frame = rig.adu(2, ANSWER);
        rig.bytes(micros(30_000), &frame);
        assert_eq!(rig.finish(), answer());
        assert_eq!(rig.send(1, READ), Instant::from_millis(ready));
    }
}

#[test]
fn a_late_reply_ends_the_quarantine_and_postpones_the_next_request() {
    for mode in MODES {
        let mut rig = Rig::new(config(mode));
        rig.send(1, READ);
        assert_eq!(rig.finish(), End::NoReply(Evidence::Silence));
        let frame = rig.adu(1, ANSWER);
        rig.bytes(micros(1_000), &frame);
        let late = rig.now + micros(1_000);
        rig.idle(late);
        assert_eq!(rig.master.ready_at(1), Instant::ZERO);
        assert_eq!(rig.master.counters().late, 1);
        assert_eq!(rig.send(1, READ), late + gap(&rig.config));
    }
}

#[test]
fn late_bytes_postpone_the_next_request_to_any_unit() {
    for mode in MODES {
        let mut rig = Rig::new(config(mode));
        rig.send(1, READ);
        assert_eq!(rig.finish(), End::NoReply(Evidence::Silence));
        let done = rig.now;
        // No byte may be more than the gap after the one before, or the line counts as silent.
        let step = gap(&rig.config) - micros(1);
        for index in 0..20 {
            rig.bytes(step * index, &[0x55]);
        }
        rig.idle(done);
        assert_eq!(rig.send(2, READ), done + step * 19 + gap(&rig.config), "{mode:?}");
    }
}

#[test]
fn a_line_error_is_activity() {
    let mut rig = Rig::new(config(Mode::Rtu));
    let now = rig.now;
    rig.master.line_error(now);
    assert_eq!(rig.send(1, READ), now + gap(&rig.config));
    assert_eq!(rig.master.counters().line_errors, 1);
}

#[test]
fn a_slave_gets_its_rest() {
    for mode in MODES {
        let mut rig = Rig::new(Config { rest: Duration::from_millis(30), ..config(mode) });
        let frame = rig.adu(1, ANSWER);
        rig.send(1, READ);
        rig.bytes(micros(20_000), &frame);
        assert_eq!(rig.finish(), answer());
        let done = rig.now;
        let ready = rig.master.ready_at(1);
        assert!(ready >= done + micros(30_000) && ready < done + micros(31_000));
        // Others need not wait for it.
        assert_eq!(rig.send(2, READ), done + gap(&rig.config));
        let frame = rig.adu(2, ANSWER);
        rig.bytes(micros(9_000), &frame);
        assert_eq!(rig.finish(), answer());
        assert_eq!(rig.send(1, READ), ready);
    }
}

#[test]
fn a_broadcast_is_done_after_the_turnaround() {
    for mode in MODES {
        let mut rig = Rig::new(config(mode));
        let start = rig.send(0, WRITE);
        assert_eq!(rig.finish(), End::Broadcast);
        assert_eq!(rig.now, start + wire(&rig.config, WRITE) + rig.config.turnaround);
        let done = rig.now;
        assert_eq!(rig.send(0, WRITE), done);
        let counters = rig.master.counters();
        assert_eq!((counters.requests, counters.timeouts), (2, 0));
    }
}

#[test]
fn a_reply_under_way_at_the_deadline_may_finish() {
    let mut rig = Rig::new(config(Mode::Rtu));
    let frame = rig.adu(1, ANSWER);
    let start = rig.send(1, READ);
    let deadline = wire(&rig.config, READ) + rig.config.reply_timeout;
    for (index, byte) in frame.iter().enumerate() {
        rig.bytes(deadline - micros(1_000) + micros(500) * index as u32, &[*byte]);
    }
    assert_eq!(rig.finish(), answer());
    assert_eq!(rig.now, start + deadline + micros(2_000));
}

/// Regression: a long reply whose last part was handed over 20 ms late was given up.
#[test]
fn an_ascii_reply_under_way_at_the_deadline_may_pause_up_to_the_limit() {
    let start_of = |frame: &[u8], rest_after| {
        let mut rig = Rig::new(config(Mode::Ascii));
        let start = rig.send(1, READ);
        let deadline = wire(&rig.config, READ) + rig.config.reply_timeout;
        rig.bytes(deadline - micros(1_000), &frame[..5]);
        rig.bytes(deadline + rest_after, &frame[5..]);
        (rig.finish(), rig.now, start + deadline)
    };
    let frame = adu(Mode::Ascii, 1, ANSWER);
    let (end, at, deadline) = start_of(&frame, micros(20_000));
    assert_eq!((end, at), (answer(), deadline + micros(20_000)));
    let (end, at, deadline) = start_of(&frame, Duration::from_secs(1));
    let longest = config(Mode::Ascii).line.wire_time(513);
    assert_eq!((end, at), (End::NoReply(Evidence::Damaged(FrameError::TooShort)), deadline + longest));
}

#[test]
fn a_babbling_line_does_not_hold_up_for_ever() {
    let mut rig = Rig::new(config(Mode::Rtu));
    let start = rig.send(1, READ);
    for index in 0..2_000 {
        rig.bytes(micros(1_000) * index, &[0x55]);
    }
    let End::NoReply(Evidence::Check { .. }) = rig.finish() else {
        panic!("no reply is in there");
    };
    let limit = wire(&rig.config, READ) + rig.config.reply_timeout + rig.config.line.wire_time(rtu::MAX_ADU);
    assert_eq!(rig.now, start + limit);
    // What is noise by now holds the next request up no longer.
    rig.master.submit(2, READ).expect("idle");
    assert_eq!(rig.master.poll(rig.now), Action::Transmit(&adu(Mode::Rtu, 2, READ)));
}

#[test]
fn a_request_that_waits_for_silence_can_be_taken_back() {
    let mut rig = Rig::new(config(Mode::Rtu));
    rig.master.receive(rig.now, &[0x55]);
    rig.master.submit(2, READ).expect("idle");
    assert_eq!(rig.master.poll(rig.now), Action::Idle);
    assert!(rig.master.withdraw());
    assert!(!rig.master.withdraw());
    assert_eq!(rig.master.submit(2, READ), Ok(()));
}

#[test]
fn noise_that_never_pauses_holds_a_request_up_for_the_longest_frame_at_most() {
    for (mode, longest) in [(Mode::Rtu, 256), (Mode::Ascii, 513)] {
        let config = config(mode);
        let character = config.line.wire_time(1);
        let mut rig = Rig::new(config);
        for at in 1..2_000 {
            rig.bytes(character * at, &[0xFF]);
        }
        let start = rig.now + character;
        rig.idle(start);
        let limit = config.line.wire_time(longest) + gap(&config);
        assert_eq!(rig.send(1, READ), start + limit, "{mode:?}");
        let reply = rig.adu(1, ANSWER);
        rig.bytes(wire(&config, READ), &reply);
        assert_eq!(rig.finish(), answer(), "{mode:?}: whoever answers is heard all the same");
    }
}

#[test]
fn one_request_at_a_time() {
    let mut master = Master::new(config(Mode::Rtu));
    let now = Instant::from_millis(1_000);
    assert_eq!(master.poll(now), Action::Idle);
    assert_eq!(master.poll_at(), None);
    assert_eq!(master.submit(1, READ), Ok(()));
    assert_eq!(master.submit(1, READ), Err(Busy));
    assert!(matches!(master.poll(now), Action::Transmit(_)));
    assert!(!master.withdraw(), "it is on the line");
    assert_eq!(master.submit(1, READ), Err(Busy));
    master.receive(now, &adu(Mode::Rtu, 1, ANSWER));
    assert_eq!(master.submit(1, READ), Err(Busy), "the outcome has not been fetched");
    assert!(matches!(master.poll(now), Action::Done(_)));
    assert_eq!(master.submit(1, READ), Ok(()));
}

#[test]
fn malformed_requests_are_not_sent() {
    for (pdu, exception) in [
        (&[][..], Exception::IllegalFunction),
        (&[0x83, 1], Exception::IllegalFunction),
        (&[3, 0, 0, 0, 126], Exception::IllegalDataValue),
        (&[0x41; 254], Exception::IllegalDataValue),
    ] {
        let mut rig = Rig::new(config(Mode::Rtu));
        rig.master.submit(1, pdu).expect("idle");
        assert_eq!(rig.finish(), End::NoReply(Evidence::Malformed(exception)));
        assert!(rig.sent.is_empty());
        assert_eq!(rig.master.ready_at(1), Instant::ZERO);
        assert_eq!(rig.master.counters().requests, 0);
    }
}

#[test]
fn a_stripped_echo_is_not_seen() {
    for (mode, echo) in MODES.into_iter().flat_map(|mode| [(mode, Echo::Strip), (mode, Echo::Verify)]) {
        let mut rig = Rig::new(Config { echo, ..config(mode) });
        let own = rig.adu(1, WRITE);
        let start = rig.send(1, WRITE);
        // The echo of a write looks like its reply, which comes right behind.
        rig.bytes(micros(1_000), &own);
        rig.bytes(micros(20_000), &own);
        assert_eq!(rig.finish(), End::Reply(WRITE.to_vec()));
        assert_eq!(rig.now, start + micros(20_000), "{mode:?} {echo:?}");
        assert_eq!(rig.master.counters().garbage_bytes, 0);

        rig.send(0, WRITE);
        let own = rig.adu(0, WRITE);
        rig.bytes(micros(1_000), &own);
        assert_eq!(rig.finish(), End::Broadcast);

        // The slave is dead: its echo is no reply.
        rig.send(1, WRITE);
        let own = rig.adu(1, WRITE);
        rig.bytes(micros(1_000), &own);
        assert_eq!(rig.finish(), End::NoReply(Evidence::Silence));

        // The adapter is dead.
        for (unit, heard) in [(2, 0), (2, 3), (0, 0)] {
            rig.send(unit, WRITE);
            let own = rig.adu(unit, WRITE);
            rig.bytes(micros(1_000), &own[..heard]);
            assert_eq!(rig.finish(), End::NoReply(Evidence::EchoMissing), "{mode:?} {echo:?}");
            rig.now = rig.master.ready_at(2).max(rig.now);
        }
    }
}

#[test]
fn a_wrong_echo_ends_the_transaction() {
    for mode in MODES {
        let mut rig = Rig::new(Config { echo: Echo::Verify, ..config(mode) });
        let own = rig.adu(1, WRITE);
        let start = rig.send(1, WRITE);
        let mut heard = own.clone();
        heard[3] ^= 0x10;
        rig.bytes(micros(1_000), &heard);
        rig.bytes(micros(2_000), &own);
        let differs = Evidence::EchoDiffers { expected: own[3], received: heard[3] };
        assert_eq!(rig.finish(), End::NoReply(differs));
        assert_eq!(rig.now, start + micros(1_000));
        // The slave may have heard it all the same, and may still answer.
        let deadline = start + wire(&rig.config, WRITE) + rig.config.reply_timeout;
        assert!(rig.master.ready_at(1) >= deadline + rig.config.quarantine);

        rig.send(0, WRITE);
        let start = rig.now;
        rig.bytes(micros(1_000), &[0xFF]);
        let End::NoReply(Evidence::EchoDiffers { received: 0xFF, .. }) = rig.finish() else {
            panic!("the broadcast was disturbed");
        };
        let until = start + wire(&rig.config, WRITE) + rig.config.turnaround;
        assert_eq!(rig.send(2, READ), until + gap(&rig.config), "the slaves get their turnaround");
    }
}

#[test]
fn line_errors_explain_damage() {
    let mut rig = Rig::new(config(Mode::Rtu));
    rig.send(1, READ);
    let now = rig.now + micros(9_000);
    rig.master.line_error(now);
    rig.master.receive(now, &[1, 3, 2, 0xFF]);
    assert_eq!(rig.finish(), End::NoReply(Evidence::Line));

    // A frame that stands in spite of them is the reply.
    rig.now = rig.master.ready_at(1);
    rig.send(1, READ);
    let now = rig.now + micros(9_000);
    rig.master.line_error(now);
    rig.master.receive(now, &adu(Mode::Rtu, 1, ANSWER));
    assert_eq!(rig.finish(), answer());
}

#[test]
fn force_listen_only_has_no_reply_but_may_be_refused() {
    let mut rig = Rig::new(config(Mode::Rtu));
    let request = [8, 0, 4, 0, 0];
    rig.send(1, &request);
    assert_eq!(rig.finish(), End::NoReply(Evidence::Silence));
    rig.now = rig.master.ready_at(1);
    rig.send(1, &request);
    let frame = rig.adu(1, &[0x88, 1]);
    rig.bytes(micros(9_000), &frame);
    assert_eq!(rig.finish(), End::Reply(vec![0x88, 1]));
}

#[test]
fn an_ascii_reply_may_pause_for_a_second() {
    let mut rig = Rig::new(Config { reply_timeout: Duration::from_secs(5), ..config(Mode::Ascii) });
    let frame = rig.adu(1, ANSWER);
    for (pause, end) in [(1_000, answer()), (1_001, End::NoReply(Evidence::Damaged(FrameError::TooShort)))] {
        rig.now = rig.master.ready_at(1).max(rig.now);
        rig.send(1, READ);
        rig.bytes(micros(20_000), &frame[..5]);
        rig.bytes(micros(20_000 + 1_000 * pause), &frame[5..]);
        assert_eq!(rig.finish(), end, "{pause} ms");
    }
}

#[test]
fn fast_lines_have_fixed_silences() {
    let mut rig = Rig::new(Config::new(Mode::Rtu, line(115_200, "8N1")));
    let frame = rig.adu(1, ANSWER);
    rig.send(1, READ);
    rig.bytes(micros(2_000), &frame);
    assert_eq!(rig.finish(), answer());
    let done = rig.now;
    assert_eq!(rig.send(1, READ), done + micros(1_750));
}

#[test]
fn a_master_is_small() {
    assert!(size_of::<Master>() <= 3_072, "{}", size_of::<Master>());
}

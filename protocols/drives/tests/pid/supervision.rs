//! What takes the current away.

use puente_drives::pid::{Cause, Command, Config, EncoderFault, Refused, State};
use puente_line::Instant;

use crate::{Rig, config, gains};

#[test]
fn a_stopped_axis_needs_communication_too() {
    let mut rig = Rig::enabled(config());
    rig.command(Command::Stop).expect("stop");
    rig.steps(1_000, 100);
    assert_eq!(rig.state(), State::Held);
    for _ in 0..99 {
        assert!(rig.step().enable);
    }
    rig.faults(Cause::Communication);
}

#[test]
fn set_points_must_keep_coming() {
    let mut rig = Rig::enabled(config());
    rig.steps(1_000, 600);
    // The last one came before the last step; 100 ms from it are fine.
    for _ in 0..99 {
        assert_eq!(rig.step().command, 0.5);
    }
    rig.command(gains(0.001, 0.0, 0.0)).expect("gains");
    rig.command(Command::SetPoint(600)).expect("just in time");
    for _ in 0..100 {
        assert_eq!(rig.step().command, 0.5);
    }
    rig.command(gains(0.001, 0.0, 0.0)).expect("gains are no set-point");
    rig.faults(Cause::Communication);
}

#[test]
fn an_enable_alone_does_not_last() {
    let mut rig = Rig::enabled(config());
    for _ in 0..99 {
        assert!(rig.step().enable);
    }
    rig.faults(Cause::Communication);
}

#[test]
fn the_amplifiers_fault_line() {
    let mut rig = Rig::enabled(config());
    rig.steps(10, 600);
    rig.amplifier_fault = true;
    rig.faults(Cause::Amplifier);
}

#[test]
fn a_following_error_that_lasts() {
    let mut rig = Rig::enabled(Config { following_error: 500, ..config() });
    rig.steps(1_000, 600);
    assert_eq!(rig.state(), State::Enabled, "500 counts are allowed");
    rig.steps(50, 601);
    assert_eq!(rig.state(), State::Enabled, "more are, for 50 ms");
    rig.steps(1, 600);
    rig.steps(50, 601);
    assert_eq!(rig.state(), State::Enabled, "counted anew");
    rig.command(Command::SetPoint(601)).expect("set-point");
    rig.faults(Cause::FollowingError);
    // A set-point far off in the other direction, as far as an i64 goes.
    let mut rig = Rig::enabled(config());
    rig.steps(50, i64::MIN);
    rig.command(Command::SetPoint(i64::MIN)).expect("set-point");
    rig.faults(Cause::FollowingError);
}

#[test]
fn an_axis_that_runs_away_or_does_not_move() {
    // The reference leaves at 10 counts a step, the axis goes the wrong way; or stays.
    for wrong in [-10, 0] {
        let mut rig = Rig::enabled(Config { speed: Some(10_000), ..config() });
        let mut position = 100;
        let mut steps = 0;
        while rig.state() == State::Enabled {
            position += wrong;
            rig.encoder = Ok((position & 0xFFFF) as u32);
            rig.steps(1, 1_000_000);
            steps += 1;
        }
        assert_eq!(rig.state(), State::Fault(Cause::FollowingError));
        assert_eq!(steps, if wrong == 0 { 200 } else { 100 } + 51, "the window of 2000 counts, and 50 ms");
    }
}

#[test]
fn encoder_faults() {
    for fault in [EncoderFault::Line, EncoderFault::Parity, EncoderFault::Edges, EncoderFault::Unread] {
        let mut rig = Rig::enabled(config());
        rig.steps(10, 600);
        rig.encoder = Err(fault);
        rig.faults(Cause::Encoder(fault));
        assert_eq!(rig.status().position, 100);
        assert_eq!(rig.command(Command::Enable), Err(Refused::Encoder(fault)));
        rig.encoder = Ok(100);
        rig.step();
        assert_eq!(rig.command(Command::Enable), Ok(()));
    }
    // A million counts a second are a thousand a step.
    let mut rig = Rig::enabled(Config { following_error: u32::MAX, ..config() });
    rig.encoder = Ok(1_100);
    assert!(rig.steps(1, 100).enable);
    rig.encoder = Ok(99);
    rig.faults(Cause::Encoder(EncoderFault::Jump));
    let mut rig = Rig::enabled(config());
    rig.encoder = Ok(0x1_0000);
    rig.faults(Cause::Encoder(EncoderFault::Width));
}

#[test]
fn a_clock_that_goes_back_or_stands_still_faults_nothing() {
    let mut rig = Rig::enabled(config());
    rig.steps(10, 600);
    rig.now = Instant::ZERO;
    for _ in 0..1_000 {
        assert!(rig.step().enable);
    }
}

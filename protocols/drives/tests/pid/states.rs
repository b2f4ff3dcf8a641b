//! What a module may be told in which state, and that it never jumps.

use std::time::Duration;

use puente_drives::pid::{
    BadConfig, Cause, Command, Config, Encoder, EncoderFault, Event, Module, Output, Refused, State, Width,
};

use crate::{Rig, config, gains};

#[test]
fn nothing_is_driven_before_an_enable() {
    let mut rig = Rig::new(config());
    assert_eq!(rig.command(Command::Enable), Err(Refused::Encoder(EncoderFault::Unread)));
    rig.encoder = Err(EncoderFault::Line);
    rig.step();
    assert_eq!(rig.command(Command::Enable), Err(Refused::Encoder(EncoderFault::Line)));
    rig.encoder = Ok(100);
    rig.step();
    assert_eq!(rig.command(Command::Enable), Err(Refused::Gains));
    rig.command(gains(0.0, 1.0, 1.0)).expect("gains");
    assert_eq!(rig.command(Command::Enable), Err(Refused::Gains), "Ki and Kd alone do not hold");
    rig.command(gains(0.1, 0.0, 0.0)).expect("gains");
    assert_eq!(rig.command(Command::SetPoint(500)), Err(Refused::State(State::Disabled)));
    assert_eq!(rig.command(Command::Stop), Ok(()));
    for _ in 0..1_000 {
        assert_eq!(rig.step(), Output { command: 0.0, enable: false, event: None });
    }
    assert_eq!(rig.state(), State::Disabled);
}

#[test]
fn the_axis_does_not_jump_when_enabled() {
    let mut rig = Rig::enabled(config());
    assert_eq!(rig.steps(50, 600), Output { command: 0.5, enable: true, event: None });
    rig.command(gains(0.001, 10.0, 0.0)).expect("gains");
    assert!(rig.steps(50, 600).command > 0.6, "the integral builds up");
    rig.command(Command::Disable).expect("disable");
    assert_eq!((rig.state(), rig.status().command), (State::Disabled, 0.0));
    assert_eq!(rig.step(), Output { command: 0.0, enable: false, event: None });
    // Pushed by hand meanwhile.
    for position in (100..20_000).step_by(100) {
        rig.encoder = Ok(position);
        rig.step();
    }
    rig.encoder = Ok(20_000);
    for _ in 0..10 {
        rig.step();
    }
    rig.command(Command::Enable).expect("enable");
    assert_eq!(rig.step(), Output { command: 0.0, enable: true, event: Some(Event::Enabled) });
    let status = rig.status();
    assert_eq!((status.position, status.set_point, status.reference), (20_000, 20_000, 20_000));
    for _ in 0..50 {
        assert_eq!(rig.step().command, 0.0, "nothing left of the integral or of the old set-point");
    }
}

#[test]
fn the_amplifier_has_its_time_to_start() {
    let mut rig = Rig::new(Config { start: Duration::from_millis(20), ..config() });
    rig.step();
    rig.command(gains(0.001, 0.0, 0.0)).expect("gains");
    // It has stored a fault, and forgets it only when it is enabled.
    rig.amplifier_fault = true;
    rig.command(Command::Enable).expect("enable");
    for at in 1..20 {
        rig.encoder = Ok(100 + at);
        assert_eq!(rig.step(), Output { command: 0.0, enable: true, event: None });
        assert_eq!(rig.command(Command::SetPoint(5_000)), Err(Refused::State(State::Starting)));
    }
    rig.amplifier_fault = false;
    assert_eq!(rig.step().event, Some(Event::Enabled));
    assert_eq!((rig.state(), rig.status().set_point), (State::Enabled, 119), "held from where it is then");
    // One that does not come up.
    rig.command(Command::Disable).expect("disable");
    rig.command(Command::Enable).expect("enable");
    rig.amplifier_fault = true;
    for _ in 1..20 {
        assert_eq!(rig.step().event, None);
    }
    rig.faults(Cause::Amplifier);
}

#[test]
fn a_stop_holds_the_axis_until_it_is_enabled_again() {
    let mut rig = Rig::enabled(config());
    rig.steps(10, 900);
    rig.encoder = Ok(300);
    rig.steps(10, 900);
    rig.command(Command::Stop).expect("stop");
    assert_eq!((rig.state(), rig.status().set_point), (State::Held, 300));
    assert_eq!(rig.command(Command::SetPoint(900)), Err(Refused::State(State::Held)));
    rig.encoder = Ok(310);
    let output = rig.steps(500, 900);
    assert!(
        output.enable && (output.command + 0.01).abs() < 1e-6,
        "back to where it was stopped: {output:?}"
    );
    rig.command(Command::Stop).expect("stop");
    assert_eq!(rig.status().set_point, 300, "a second stop holds no other place");
    rig.command(Command::Enable).expect("enable");
    assert_eq!((rig.state(), rig.status().set_point), (State::Enabled, 300));
    assert_eq!(rig.steps(1, 410).command, 0.1);
    // A stop while it starts.
    let mut rig = Rig::new(Config { start: Duration::from_millis(5), ..config() });
    rig.step();
    rig.command(gains(0.001, 0.0, 0.0)).expect("gains");
    rig.command(Command::Enable).expect("enable");
    rig.command(Command::Stop).expect("stop");
    rig.steps(10, 900);
    assert_eq!((rig.state(), rig.status().set_point), (State::Held, 100));
}

#[test]
fn gains_of_an_enabled_axis() {
    let mut rig = Rig::enabled(config());
    assert_eq!(rig.steps(1, 600).command, 0.5);
    rig.command(gains(0.0005, 0.0, 0.0)).expect("gains");
    assert_eq!(rig.steps(1, 600).command, 0.25);
    assert_eq!(rig.command(gains(0.0, 1.0, 0.0)), Err(Refused::Gains));
    assert_eq!(rig.steps(1, 600).command, 0.25, "the old ones stay");
}

#[test]
fn settings_out_of_their_ranges() {
    let good = Config::default();
    assert_eq!(good.check(), Ok(()));
    let second = Duration::from_secs(1);
    let bad = [
        ("rate", Config { rate: 0, ..good }),
        ("rate", Config { rate: 100_001, ..good }),
        ("top_speed", Config { top_speed: 0, ..good }),
        // 8 bits tell 127 counts forward from 129 backward: 1.27 million a second at 10 kHz.
        (
            "top_speed",
            Config { encoder: Encoder::Gray(Width::new(8).expect("width")), top_speed: 1_270_001, ..good },
        ),
        ("filter", Config { filter: second * 2, ..good }),
        ("limit", Config { limit: 0.0, ..good }),
        ("limit", Config { limit: 1.001, ..good }),
        ("limit", Config { limit: f32::NAN, ..good }),
        ("slew", Config { slew: Some(0.0), ..good }),
        ("slew", Config { slew: Some(f32::INFINITY), ..good }),
        ("slew", Config { slew: Some(f32::NAN), ..good }),
        ("speed", Config { speed: Some(0), ..good }),
        ("following_time", Config { following_time: second * 11, ..good }),
        ("communication", Config { communication: Duration::ZERO, ..good }),
        ("communication", Config { communication: Duration::MAX, ..good }),
        ("start", Config { start: second * 11, ..good }),
    ];
    for (name, config) in bad {
        assert_eq!(Module::new(config).map(|_| ()), Err(BadConfig(name)));
    }
    let edge = Config { encoder: Encoder::Gray(Width::new(8).expect("width")), top_speed: 1_270_000, ..good };
    assert_eq!(edge.check(), Ok(()));
}

#[test]
fn what_is_said_about_refusals() {
    let texts = [
        (Refused::State(State::Disabled), "the axis is disabled; enable it first"),
        (Refused::State(State::Held), "the axis is held; enable it first"),
        (Refused::State(State::Fault(Cause::Communication)), "fault: no set-points; disable the axis first"),
        (Refused::Encoder(EncoderFault::Line), "no position: encoder line dead"),
        (Refused::Gains, "Kp is 0: the axis would not be held"),
    ];
    for (refused, text) in texts {
        assert_eq!(refused.to_string(), text);
    }
    assert_eq!(State::Fault(Cause::Encoder(EncoderFault::Jump)).to_string(), "in fault: encoder jumped");
    assert_eq!(BadConfig("slew").to_string(), "slew is out of its range");
}

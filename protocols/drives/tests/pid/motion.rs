//! Positions, velocities and commands.

use std::time::Duration;

use puente_drives::pid::{Cause, Command, Config, Encoder, EncoderFault, State, Width, gray};

use crate::{Rig, config, gains};

#[test]
fn a_gray_encoder_over_its_end() {
    let width = Width::new(12).expect("width");
    let mut rig = Rig::new(Config { encoder: Encoder::Gray(width), ..config() });
    rig.encoder = Ok(gray::from_binary(4_000));
    rig.step();
    assert_eq!(rig.status().position, 4_000, "an absolute encoder knows where it is");
    rig.command(gains(0.001, 0.0, 0.0)).expect("gains");
    rig.command(Command::Enable).expect("enable");
    rig.step();
    for position in (4_000..12_000_i64).chain((-9_000..12_000).rev()) {
        rig.encoder = Ok(gray::from_binary((position & 0xFFF) as u32));
        assert_eq!(rig.steps(1, position + 100).command, 0.1);
        assert_eq!(rig.status().position, position);
    }
    // The wire of the highest bit breaks.
    rig.encoder = Ok(gray::from_binary(-9_000_i64 as u32 & 0xFFF) ^ 0x800);
    rig.step();
    assert_eq!(rig.state(), State::Fault(Cause::Encoder(EncoderFault::Jump)));
}

#[test]
fn velocity_and_its_filter() {
    let mut rig = Rig::new(config());
    for position in 0..10 {
        rig.encoder = Ok(100 + 3 * position);
        rig.step();
    }
    assert_eq!(rig.status().velocity, 3_000.0);
    // A filter of 3 ms at 1 kHz: each step makes up a quarter of what is missing.
    let mut rig = Rig::new(Config { filter: Duration::from_millis(3), ..config() });
    for (step, velocity) in [(0, 0.0), (4, 1_000.0), (8, 1_750.0), (12, 2_312.5)] {
        rig.encoder = Ok(100 + step);
        rig.step();
        assert_eq!(rig.status().velocity, velocity);
    }
}

#[test]
fn a_step_of_the_set_point_does_not_kick() {
    let mut rig = Rig::enabled(config());
    rig.command(gains(0.001, 0.0, 0.01)).expect("gains");
    assert_eq!(rig.steps(1, 600).command, 0.5, "Kp alone");
    // The same step of the measurement: Kp takes 0.01 off, Kd all the rest and more.
    rig.encoder = Ok(110);
    assert_eq!(rig.steps(1, 600).command, -1.0);
}

#[test]
fn limit_slew_sense_and_deadband() {
    let mut rig = Rig::enabled(Config { limit: 0.5, ..config() });
    assert_eq!([rig.steps(1, 1_900).command, rig.steps(1, -1_700).command], [0.5, -0.5]);
    let mut rig = Rig::enabled(Config { slew: Some(250.0), ..config() });
    let slewed: Vec<f32> = (0..6).map(|_| rig.steps(1, 1_100).command).collect();
    assert_eq!(slewed, [0.25, 0.5, 0.75, 1.0, 1.0, 1.0]);
    rig.amplifier_fault = true;
    rig.faults(Cause::Amplifier); // which does not slew
    let mut rig = Rig::enabled(Config { reversed: true, ..config() });
    assert_eq!(rig.steps(1, 600).command, -0.5);
    assert_eq!(rig.status().command, -0.5);
    let mut rig = Rig::enabled(Config { deadband: 5, ..config() });
    assert_eq!(
        [rig.steps(1, 105).command, rig.steps(1, 95).command, rig.steps(1, 106).command],
        [0.0, 0.0, 0.006]
    );
}

#[test]
fn the_reference_goes_at_its_speed() {
    let mut rig = Rig::enabled(Config { speed: Some(2_500), ..config() });
    let mut way = Vec::new();
    for _ in 0..5 {
        rig.steps(1, 110);
        way.push(rig.status().reference);
    }
    assert_eq!(way, [102, 105, 107, 110, 110]);
    assert_eq!(rig.status().set_point, 110);
}

//! Whatever happens.

use std::time::Duration;

use proptest::prelude::*;
use puente_drives::pid::{Command, Config, Encoder, EncoderFault, Event, Gains, Input, Module, State, Width};
use puente_line::Instant;

use crate::gains;

/// Anything that may happen to a module.
#[derive(Clone, Debug)]
enum Happening {
    Command(Command),
    Step { encoder: Result<u32, EncoderFault>, amplifier_fault: bool, micros: u64 },
}

fn happenings() -> impl Strategy<Value = Happening> {
    let gain = prop_oneof![Just(0.0), 0.0..1e-2_f32, 0.0..=Gains::MAX];
    let gains = prop::array::uniform3(gain).prop_map(|[kp, ki, kd]| gains(kp, ki, kd));
    let target = prop_oneof![-3_000..3_000_i64, any::<i64>()];
    let command = prop_oneof![
        gains,
        Just(Command::Enable),
        Just(Command::Enable),
        target.prop_map(Command::SetPoint),
        Just(Command::Disable),
        Just(Command::Stop),
    ];
    let sample = prop_oneof![0..2_000_u32, 0..2_000_u32, any::<u32>()].prop_map(Ok);
    let encoder = prop_oneof![20 => sample, 1 => Just(Err(EncoderFault::Line))];
    let step = (encoder, prop::bool::weighted(0.02), prop_oneof![Just(100), 0..200_000_u64])
        .prop_map(|(encoder, amplifier_fault, micros)| Happening::Step { encoder, amplifier_fault, micros });
    prop_oneof![1 => command.prop_map(Happening::Command), 2 => step]
}

proptest! {
    #[test]
    fn whatever_happens(
        happenings in prop::collection::vec(happenings(), 0..300),
        limit in 0.01..=1.0_f32,
        slew in prop::option::of(0.1..1e5_f32),
        speed in prop::option::of(1..10_000_000_u32),
        bits in 10..=32_u8,
        gray in any::<bool>(),
        deadband in 0..100_u32,
    ) {
        let width = Width::new(bits).expect("width");
        let encoder = if gray { Encoder::Gray(width) } else { Encoder::Binary(width) };
        let config = Config { limit, slew, speed, deadband, start: Duration::ZERO, ..Config::new(encoder) };
        let mut module = Module::new(config).expect("config");
        let mut again = module.clone();
        let mut now = Instant::from_millis(1);
        let mut last = module.step(Input { encoder: Ok(0), amplifier_fault: false, now });
        again.step(Input { encoder: Ok(0), amplifier_fault: false, now });
        for happening in happenings {
            match happening {
                Happening::Command(command) => {
                    let before = module.status();
                    let result = module.command(now, command);
                    prop_assert_eq!(result, again.command(now, command));
                    let after = module.status();
                    if result.is_err() {
                        prop_assert_eq!(before, after);
                    }
                    if matches!(before.state, State::Fault(_)) {
                        prop_assert!(after.state == before.state || after.state == State::Disabled);
                    }
                    if command == Command::Stop {
                        prop_assert!(after.state != State::Enabled);
                    }
                }
                Happening::Step { encoder, amplifier_fault, micros } => {
                    now += Duration::from_micros(micros);
                    let input = Input { encoder, amplifier_fault, now };
                    let before = module.status().state;
                    let output = module.step(input);
                    prop_assert_eq!(output, again.step(input), "the same inputs, the same outputs");
                    let status = module.status();
                    prop_assert!(output.command.abs() <= limit && status.velocity.is_finite());
                    prop_assert_eq!(output.command, status.command);
                    let enabled = matches!(status.state, State::Starting | State::Enabled | State::Held);
                    prop_assert_eq!(output.enable, enabled);
                    if !matches!(status.state, State::Enabled | State::Held) {
                        prop_assert_eq!(output.command, 0.0);
                    }
                    if enabled {
                        prop_assert!(encoder.is_ok() && (!amplifier_fault || status.state == State::Starting));
                        let change = (output.command - last.command).abs();
                        prop_assert!(change <= slew.unwrap_or(f32::MAX) * 1e-4 + 1e-6, "{}", change);
                    }
                    match output.event {
                        Some(Event::Fault(cause)) => prop_assert_eq!(status.state, State::Fault(cause)),
                        Some(Event::Enabled) => {
                            prop_assert_eq!(before, State::Starting);
                            prop_assert_eq!(status.set_point, status.position);
                        }
                        None => prop_assert!(before == status.state),
                    }
                    last = output;
                }
            }
        }
    }
}

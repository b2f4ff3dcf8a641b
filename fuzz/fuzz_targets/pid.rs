//! The PID module and its encoders: whatever comes, the command is within its limit, and 0 without current.
#![no_main]

use std::time::Duration;

use puente_drives::pid::ssi::{Format, Parity};
use puente_drives::pid::{
    Command, Config, Encoder, EncoderFault, Event, Gains, Input, Module, Quadrature, State, Width, gray,
};
use puente_line::Instant;

fn command(kind: u8, value: u32, more: u32) -> Option<Command> {
    let float = f32::from_bits;
    Some(match kind % 6 {
        0 => Command::Gains(Gains::new(float(value), float(more), float(value ^ more)).ok()?),
        1 => Command::SetPoint(i64::from(value) << 32 | i64::from(more)),
        2 => Command::SetPoint(i64::from(value.cast_signed())),
        3 => Command::Enable,
        4 => Command::Disable,
        _ => Command::Stop,
    })
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Some((head, rest)) = data.split_first_chunk::<8>() else { return };
    let Some(width) = Width::new(head[0]) else { return };
    let config = Config {
        rate: u32::from(head[1]) * 100,
        top_speed: u32::from(head[2]) << 12,
        limit: f32::from(head[3]) / 255.0,
        slew: (head[4] > 0).then(|| f32::from(head[4])),
        speed: (head[5] > 0).then(|| u32::from(head[5]) << 10),
        start: Duration::from_millis(u64::from(head[6])),
        deadband: u32::from(head[7] >> 2),
        reversed: head[7] & 1 != 0,
        ..Config::new(if head[7] & 2 != 0 { Encoder::Gray(width) } else { Encoder::Binary(width) })
    };
    let ssi = Format { width, parity: (head[7] & 4 != 0).then_some(Parity::Odd) };
    let mut tracks = Quadrature::new(false, false);
    let mut samples = 0;
    let Ok(mut module) = Module::new(config) else { return };
    let mut now = Instant::ZERO;
    for record in rest.as_chunks::<9>().0 {
        let [kind, a, b, c, d, e, f, g, h] = *record;
        let (value, more) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
        assert_eq!(gray::from_binary(gray::to_binary(value)), value);
        tracks.sample(a & 1 != 0, a & 2 != 0);
        samples += 1;
        assert!(tracks.position().abs() + i64::from(tracks.missed()) <= samples);
        if kind & 0x80 == 0 {
            if let Some(command) = command(kind, value, more) {
                let before = module.status();
                if module.command(now, command).is_err() {
                    assert_eq!(module.status(), before);
                }
            }
            continue;
        }
        let line = u64::from(value) | u64::from(more) << 32;
        let encoder = match kind & 7 {
            0 => Err(EncoderFault::Edges),
            1 => ssi.decode(line).inspect(|code| assert_eq!(ssi.encode(*code), line)),
            2 => Ok(value),
            _ => Ok(value & 0xFF & width.max()),
        };
        now += Duration::from_micros(u64::from(more & 0xFFFF));
        let output = module.step(Input { encoder, amplifier_fault: kind & 0x78 == 0, now });
        let status = module.status();
        assert!(output.command.abs() <= config.limit && status.velocity.is_finite());
        assert_eq!(output.enable, matches!(status.state, State::Starting | State::Enabled | State::Held));
        assert!(output.command == 0.0 || matches!(status.state, State::Enabled | State::Held));
        if let Some(Event::Fault(cause)) = output.event {
            assert_eq!(status.state, State::Fault(cause));
        }
    }
});

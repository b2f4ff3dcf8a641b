//! Whatever a drive says: no current without a preset, no fault reset unasked, no set-point without an edge.
#![no_main]

use puente_drives::cia402::homing::{self, Homing, Method};
use puente_drives::cia402::position::{self, Handshake, SetPoint};
use puente_drives::cia402::{Command, Controlword, Goal, Kind, Machine, Mode, Period, State, Statusword};
use puente_fuzz::Operands;
use puente_line::{Duration, Instant};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut operands = Operands(data);
    let mut machine = Machine::new();
    let mut handshake = Handshake::new();
    let mut homing = Homing::new(Duration::from_millis(500));
    let mut now = Instant::ZERO;
    let (mut preset, mut raised) = (false, false);
    while !operands.0.is_empty() {
        let kind = operands.byte();
        let word = u16::from_le_bytes([operands.byte(), operands.byte()]);
        now += operands.pause();
        let goals = [Goal::Off, Goal::Enabled, Goal::QuickStopped, Goal::Reset, Goal::Unpowered];
        match kind & 7 {
            goal @ 0..=4 if kind & 8 != 0 => {
                preset &= machine.goal() == goals[usize::from(goal)];
                machine.set_goal(goals[usize::from(goal)]);
            }
            5 => {
                machine.set_preset();
                preset = true;
            }
            6 => handshake.submit(SetPoint::absolute(i32::from(word))),
            7 => {
                if let Some(method) = Method::new(word as i8) {
                    homing.start(method);
                }
            }
            _ => {}
        }
        // Often a word of the table.
        let table = [0x0240, 0x0221, 0x0223, 0x0237, 0x0207, 0x0208, 0x0637, 0x1237];
        let status = Statusword(if kind & 0x80 == 0 { table[usize::from(kind >> 4 & 7)] } else { word });
        let state = status.state();
        preset &= state.is_none_or(|state| state == State::SwitchedOn);
        let advice = machine.advise(status);
        if state.is_some() {
            match advice.word.command(Controlword(0)) {
                Command::EnableOperation => assert!(preset || state == Some(State::OperationEnabled)),
                Command::FaultReset => assert_eq!(machine.goal(), Goal::Reset),
                _ => {}
            }
        }
        let offer = handshake.advise(status);
        if offer.bits & Controlword::MODE_4 != 0 && !raised {
            assert!(offer.target.is_some() && !status.has(Statusword::MODE_12));
        }
        raised = offer.bits & Controlword::MODE_4 != 0;
        let _: position::Progress = offer.progress;
        let _: homing::Progress = homing.advise(now, status).progress;
        if let Some(mode) = Mode::from_code(word as i8) {
            assert_eq!(mode.code(), word as i8);
        }
        if let Some(period) = Period::from_parts(kind, word as i8) {
            assert_eq!(Period::new(period.time()).map(Period::time), Some(period.time()));
        }
        assert!(Kind::I16.read(&word.to_le_bytes()).is_some_and(|value| Kind::I16.holds(value)));
    }
});

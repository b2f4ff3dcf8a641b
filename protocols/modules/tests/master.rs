//! A gateway's end alone: what it sends when its frame meets with something.

use std::time::Duration;

use puente_framed::frame::{self, MAX_FRAME};
use puente_framed::station;
use puente_line::{Instant, Settings};
use puente_modules::master::{Action, Axis, Config, Output};
use puente_modules::{Control, Form, Master, Setting};

/// A master with one axis, and its clock.
struct Rig {
    master: Master<1, 1, 1, MAX_FRAME>,
    now: Instant,
}

impl Rig {
    fn new() -> Self {
        let line = Settings { baud: 1_000_000, format: "8N1".parse().expect("format") };
        let config = Config { station: station::Config::new(1, line, 64), cycle: Duration::from_millis(5) };
        let now = Instant::from_millis(1_000);
        let axis = Axis { address: 17, form: Form::Text };
        Self { master: Master::new(config, [axis], now, 1), now }
    }

    fn want(&mut self, control: Control) {
        self.master.set(0, Output { control, ..Output::default() });
    }

    /// What it sends next.
    fn sends(&mut self) -> Vec<u8> {
        loop {
            match self.master.poll(self.now) {
                Action::Transmit(bytes) => return bytes.to_vec(),
                Action::Idle => self.now = self.master.poll_at().expect("a cycle").max(self.now),
                _ => {}
            }
        }
    }

    fn hear(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.now += Duration::from_micros(10);
            self.master.receive(self.now, *byte);
        }
    }
}

/// What a cycle's frame says to the axis.
fn control(bytes: &[u8]) -> Control {
    let frame = frame::parse(bytes).expect("a frame");
    let section = frame.section_for(17).expect("a section");
    Setting::parse(Form::Text, section.data).expect("a setting").order.expect("an order").control
}

/// A frame that collides says what is wanted when it goes again, not what was. Found by fuzzing.
#[test]
fn what_collides_goes_again_with_what_is_wanted_then() {
    let mut rig = Rig::new();
    rig.want(Control::Hold);
    let sent = rig.sends();
    assert_eq!(control(&sent), Control::Hold);
    rig.hear(&sent[..5]);
    // It is on the line.
    rig.want(Control::Off);
    assert_eq!(rig.master.poll(rig.now), Action::Idle);
    rig.hear(&[!sent[5]]);
    assert!(matches!(rig.master.poll(rig.now), Action::Jam(_)));
    assert_eq!(control(&rig.sends()), Control::Off);
}

/// What has come through says what was wanted; the next follows at once.
#[test]
fn a_stop_that_comes_too_late_for_a_frame_goes_with_the_next() {
    let mut rig = Rig::new();
    rig.want(Control::Hold);
    let sent = rig.sends();
    let begun = rig.now;
    rig.hear(&sent[..5]);
    rig.want(Control::Off);
    rig.hear(&sent[5..]);
    assert_eq!(control(&rig.sends()), Control::Off);
    assert!(rig.now.since(begun) < Duration::from_millis(2), "the cycle is 5 ms; nobody has answered");
}

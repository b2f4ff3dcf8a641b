//! A module on an axis of the table.

use std::time::Duration;

use puente_drives::pid::{self, BadConfig, EncoderFault, Status};
use puente_framed::frame::MAX_FRAME;
use puente_framed::{Random, arbiter, station};
use puente_line::Instant;
use puente_modules::Form;
use puente_modules::node::{self, Action};
use puente_shared_line::{Drive, Heard, Node};

use super::{Encoder, Trouble};
use crate::table::{AxisProfile, Feedback, Hardware, Plant};

/// A module looks at its axis at least so often. In between the axis waits; then it makes good all its steps, each at its
/// own time.
const LOOK: Duration = Duration::from_millis(1);

/// Commanders that a module keeps a window for, events in it, and the longest frame.
type End = node::Node<4, 4, MAX_FRAME>;

/// A module, and the axis that it is on.
#[derive(Clone, Debug)]
pub struct ModuleConfig {
    /// Its address, 1 to 254.
    pub address: u8,
    /// How what it is told is written.
    pub form: Form,
    /// Its axis.
    pub profile: AxisProfile,
    /// Its loop and its supervision.
    pub servo: pid::Config,
}

impl ModuleConfig {
    /// Text, an axis with the default profile, a reference that goes at half the axis' speed.
    pub fn new(address: u8) -> Self {
        let servo = pid::Config { speed: Some(50_000), ..pid::Config::default() };
        Self { address, form: Form::Text, profile: AxisProfile::default(), servo }
    }
}

/// A module on its axis: what the firmware of a real one runs, and a simulated plant.
pub struct Module {
    config: ModuleConfig,
    station: station::Config,
    end: End,
    servo: pid::Module,
    hardware: Hardware,
    random: Random,
    /// The loop has told something.
    told: bool,
    /// It was switched off: what it was sending ends.
    cut: bool,
}

impl Module {
    pub(super) fn new(config: ModuleConfig, manners: arbiter::Config, seed: u64) -> Result<Self, BadConfig> {
        let station = station::Config::new(config.address, manners.line, MAX_FRAME);
        let station = station::Config { arbiter: manners, silence: manners.gap, ..station };
        let mut random = Random::new(seed);
        Ok(Self {
            end: End::new(node::Config { station, form: config.form }, Instant::ZERO, draw(&mut random)),
            servo: pid::Module::new(config.servo)?,
            hardware: Hardware::new(&config.profile, &config.servo),
            config,
            station,
            random,
            told: false,
            cut: false,
        })
    }

    /// Lets the axis and the loop catch up with the time.
    pub(super) fn advance(&mut self, now: Instant) {
        self.hardware.advance(now, |input| {
            let output = self.servo.step(input);
            if let Some(event) = output.event {
                self.end.event(event);
                self.told = true;
            }
            output
        });
    }

    /// Something is wrong from now on, or no more.
    pub(super) fn suffer(&mut self, trouble: Trouble) {
        match trouble {
            Trouble::Encoder(Encoder::Sound) => self.hardware.set_feedback(Feedback::Sound),
            Trouble::Encoder(Encoder::Lost) => self.hardware.set_feedback(Feedback::Lost(EncoderFault::Line)),
            Trouble::Encoder(Encoder::Frozen) => self.hardware.freeze_encoder(),
            Trouble::Amplifier(fault) => self.hardware.plant_mut().set_fault(fault),
            Trouble::Torque(torque) => self.hardware.plant_mut().set_load(torque),
            Trouble::PowerCycle => self.restart(),
            // Of the station's place on the line.
            Trouble::Mute(_) | Trouble::Deaf(_) => {}
        }
    }

    fn restart(&mut self) {
        // It was good when the module was made.
        if let Ok(servo) = pid::Module::new(self.config.servo) {
            self.servo = servo;
        }
        let config = node::Config { station: self.station, form: self.config.form };
        self.end = End::new(config, self.hardware.now(), draw(&mut self.random));
        self.hardware.restart();
        self.cut = true;
    }

    /// What its loop is at.
    pub fn status(&self) -> Status {
        self.servo.status()
    }

    /// Its axis. An encoder that counts has its 0 where the axis was when the module was switched on.
    pub fn plant(&self) -> &Plant {
        self.hardware.plant()
    }

    /// Who commands it, or was the last to.
    pub fn commander(&self) -> Option<u8> {
        self.end.commander()
    }

    /// What its station has met on the line.
    pub fn statistics(&self) -> arbiter::Statistics {
        self.end.statistics()
    }
}

impl Node for Module {
    fn hear(&mut self, now: Instant, heard: Heard) {
        self.advance(now);
        match heard {
            Heard::Byte(byte) => self.end.receive(now, byte),
            Heard::Damaged => self.end.line_error(now),
        }
    }

    fn carrier(&mut self, now: Instant) {
        self.end.carrier(now);
    }

    fn poll(&mut self, now: Instant) -> Option<Drive> {
        if std::mem::take(&mut self.cut) {
            return Some(Drive::Discard);
        }
        self.advance(now);
        self.told = false;
        match self.end.poll(now, &mut self.servo) {
            Action::Transmit(bytes) => Some(Drive::Transmit(bytes.to_vec())),
            Action::Jam(bytes) => Some(Drive::Jam(bytes.to_vec())),
            Action::Idle => None,
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        if self.told || self.cut {
            return Some(Instant::ZERO);
        }
        let look = self.hardware.now() + LOOK;
        Some(self.end.poll_at().map_or(look, |at| at.min(look)))
    }
}

fn draw(random: &mut Random) -> u64 {
    u64::from(random.next()) << 32 | u64::from(random.next())
}

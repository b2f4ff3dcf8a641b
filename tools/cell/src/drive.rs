//! One simulated EDB drive: its registers over its motor.

use std::collections::BTreeMap;

use puente_drives::edb::{Monitor, Parameter, Status, register};
use puente_line::Instant;
use puente_modbus::Exception;

use crate::motor::{Motor, Power};
use crate::profile::Profile;

/// Speed difference within which the set speed counts as reached, r/min. Assumed.
const COIN_BAND: f64 = 10.0;

/// What a drive is set to before power-up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveConfig {
    /// Station address, 1 to 254.
    pub address: u8,
    /// What drive and motor are like.
    pub profile: Profile,
}

impl DriveConfig {
    /// A drive with the default profile.
    pub fn new(address: u8) -> Self {
        Self { address, profile: Profile::default() }
    }
}

/// The JOG registers 1023h to 1025h.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Jog {
    enable: bool,
    forward: bool,
    reverse: bool,
}

/// A simulated drive, powered up without alarm, servo off, at position 0.
///
/// Assumed behaviour, where no source was found: an alarm and the loss of mains reset the JOG registers, so that
/// clearing an alarm never starts a motor; enabling a drive that has an alarm or no mains answers exception 04; a
/// direction written while the servo is off is not kept; both directions at once mean stop; a write to a read-only
/// register answers exception 02; 1000h reads as the status word, whose WAIT means servo off. Parameters of unknown meaning take any value and are
/// 0 at power-up; a new value of Pn210 to Pn216 is stored but changes nothing.
#[derive(Clone, Debug)]
pub struct Drive {
    profile: Profile,
    parameters: Vec<u16>,
    jog: Jog,
    mains: bool,
    forward_prohibited: bool,
    reverse_prohibited: bool,
    alarm: u16,
    history: [u16; 10],
    io_signals: u16,
    motor: Motor,
    forced: BTreeMap<u16, u16>,
    now: Instant,
}

impl Drive {
    /// A drive as it is after power-up.
    pub fn new(config: &DriveConfig) -> Self {
        let mut parameters: Vec<u16> = (0..=config.profile.last_parameter)
            .map(|number| {
                Parameter::new(number).and_then(Parameter::info).and_then(|info| info.default).unwrap_or(0)
            })
            .collect();
        let mut preset = |parameter: Parameter, value| {
            if let Some(entry) = parameters.get_mut(usize::from(parameter.number())) {
                *entry = value;
            }
        };
        preset(Parameter::JOG_SPEED, config.profile.jog_speed);
        preset(Parameter::STATION, u16::from(config.address));
        Self {
            profile: config.profile,
            parameters,
            jog: Jog::default(),
            mains: true,
            forward_prohibited: false,
            reverse_prohibited: false,
            alarm: 0,
            history: [0; 10],
            io_signals: 0,
            motor: Motor::default(),
            forced: BTreeMap::new(),
            now: Instant::ZERO,
        }
    }

    /// Lets the motor move until `now`, in whole milliseconds of the clock.
    pub fn advance(&mut self, now: Instant) {
        let steps = (now.as_micros() / 1_000).saturating_sub(self.now.as_micros() / 1_000);
        for _ in 0..steps {
            if self.motor.at_rest(self.power()) {
                break;
            }
            self.motor.step(self.power(), &self.profile);
        }
        self.now = self.now.max(now);
    }

    /// What drive and motor are like.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// Speed of the motor, r/min.
    pub fn speed(&self) -> f64 {
        self.motor.speed
    }

    /// Position of the motor, pulses.
    pub fn position(&self) -> i32 {
        self.motor.position.floor() as i32
    }

    /// Makes the present position read `pulses`.
    pub fn set_position(&mut self, pulses: i32) {
        self.motor.set_position(pulses);
    }

    /// Whether the motor is under current.
    pub fn servo_on(&self) -> bool {
        self.jog.enable
    }

    /// The limit inputs: whether forward (P-OT) and reverse (N-OT) rotation are prohibited. At power-up both are free.
    pub fn set_limits(&mut self, forward_prohibited: bool, reverse_prohibited: bool) {
        self.forward_prohibited = forward_prohibited;
        self.reverse_prohibited = reverse_prohibited;
    }

    /// Switches the mains; without it the servo drops.
    pub fn set_mains(&mut self, present: bool) {
        self.mains = present;
        if !present {
            self.jog = Jog::default();
        }
    }

    /// Raises alarm `number`, or clears the present one with 0. An alarm drops the servo and enters the history.
    pub fn set_alarm(&mut self, number: u16) {
        self.alarm = number;
        if number != 0 {
            self.jog = Jog::default();
            self.history.rotate_right(1);
            self.history[0] = number;
        }
    }

    /// Makes `register` read `value` whatever the drive does, even where there is none, until it is released.
    pub fn force(&mut self, register: u16, value: u16) {
        self.forced.insert(register, value);
    }

    /// Takes back what [`Drive::force`] did.
    pub fn release(&mut self, register: u16) {
        self.forced.remove(&register);
    }

    /// The status word as the drive makes it, without [`Drive::force`].
    pub fn status(&self) -> Status {
        let ready = self.mains && self.alarm == 0;
        let stopped = self.motor.speed.abs() < 1.0;
        let reached = self.jog.enable && (self.motor.speed - self.target()).abs() <= COIN_BAND;
        let overload = self.motor.torque.abs() >= self.profile.max_torque;
        let bits = [
            (self.alarm != 0, Status::ALM),
            (ready, Status::S_RDY),
            (ready && !self.jog.enable, Status::WAIT),
            (reached, Status::COIN),
            (self.mains, Status::AC_IN),
            (overload, Status::PA_ST),
            (stopped, Status::TGON),
            (self.reverse_prohibited, Status::N_OT),
            (self.forward_prohibited, Status::P_OT),
        ];
        Status(bits.iter().filter(|(set, _)| *set).fold(0, |word, (_, bit)| word | bit))
    }

    /// The monitor block as the drive makes it, without [`Drive::force`].
    pub fn monitor(&self) -> Monitor {
        let turn = f64::from(self.profile.pulses_per_turn);
        Monitor {
            speed_feedback: self.motor.speed.round() as i16,
            speed_reference: if self.jog.enable { self.motor.reference.round() as i16 } else { 0 },
            torque_reference: self.motor.torque.round() as i16,
            internal_torque_reference: self.motor.torque.round() as i16,
            encoder_pulses: self.motor.position.rem_euclid(turn) as u16,
            position: self.position(),
            error_counter: self.motor.error.round() as i32,
            load_inertia: self.profile.load_inertia,
            alarm: self.alarm,
            ..Monitor::default()
        }
    }

    /// Value of a register; exception 02 where there is none.
    pub fn read(&self, address: u16) -> Result<u16, Exception> {
        if let Some(value) = self.forced.get(&address) {
            return Ok(*value);
        }
        if let Some(value) = self.parameters.get(usize::from(address)) {
            return Ok(*value);
        }
        if let Some(value) =
            offset(address, *register::ALARM_HISTORY.start()).and_then(|at| self.history.get(at))
        {
            return Ok(*value);
        }
        if let Some(at) = offset(address, register::SPEED_FEEDBACK).filter(|at| *at < Monitor::WORDS) {
            return Ok(self.monitor().words()[at]);
        }
        Ok(match address {
            register::SPEED_REFERENCE_OFFSET..=register::IV_OFFSET => 0,
            register::IO_SIGNALS => self.io_signals,
            register::STATUS | register::SEARCH => self.status().0,
            register::SOFTWARE_VERSION => self.profile.software_version,
            register::CPLD_VERSION => 0,
            register::MULTI_TURN => {
                (self.motor.position / f64::from(self.profile.pulses_per_turn)).floor() as i32 as u16
            }
            register::CLEAR_HISTORY | register::CLEAR_ALARM => 0,
            register::JOG_ENABLE => u16::from(self.jog.enable),
            register::JOG_FORWARD => u16::from(self.jog.forward),
            register::JOG_REVERSE => u16::from(self.jog.reverse),
            _ => return Err(Exception::IllegalDataAddress),
        })
    }

    /// Whether [`Drive::write`] may be tried: exception 02 where nothing can be written, 03 for a value out of range.
    pub fn check(&self, address: u16, value: u16) -> Result<(), Exception> {
        let range = match address {
            register::IO_SIGNALS => 0..=u16::MAX,
            register::CLEAR_HISTORY..=register::JOG_REVERSE => 0..=1,
            _ if usize::from(address) < self.parameters.len() => self.range(address),
            _ => return Err(Exception::IllegalDataAddress),
        };
        if range.contains(&value) { Ok(()) } else { Err(Exception::IllegalDataValue) }
    }

    /// Writes a register; exceptions as for [`Drive::check`], and 04 for an enable that cannot be executed.
    pub fn write(&mut self, address: u16, value: u16) -> Result<(), Exception> {
        self.check(address, value)?;
        let on = value != 0;
        match address {
            register::IO_SIGNALS => self.io_signals = value,
            register::CLEAR_HISTORY if on => self.history = [0; 10],
            register::CLEAR_ALARM if on => self.set_alarm(0),
            register::CLEAR_HISTORY | register::CLEAR_ALARM => {}
            register::JOG_ENABLE if on && !(self.mains && self.alarm == 0) => {
                return Err(Exception::ServerDeviceFailure);
            }
            register::JOG_ENABLE if on => self.jog.enable = true,
            register::JOG_ENABLE => self.jog = Jog::default(),
            register::JOG_FORWARD => self.jog.forward = on && self.jog.enable,
            register::JOG_REVERSE => self.jog.reverse = on && self.jog.enable,
            _ => {
                if let Some(parameter) = self.parameters.get_mut(usize::from(address)) {
                    *parameter = value;
                }
            }
        }
        Ok(())
    }

    fn range(&self, parameter: u16) -> std::ops::RangeInclusive<u16> {
        let info = Parameter::new(parameter).and_then(Parameter::info);
        let min = info.and_then(|info| info.min).unwrap_or(0);
        let max = info.and_then(|info| info.max).unwrap_or(u16::MAX);
        if parameter == Parameter::JOG_SPEED.number() { min..=self.profile.max_jog_speed } else { min..=max }
    }

    /// The speed that the JOG registers and limit inputs ask for, r/min.
    fn target(&self) -> f64 {
        let speed = self.parameters.get(usize::from(Parameter::JOG_SPEED.number())).copied().unwrap_or(0);
        match (self.jog.forward, self.jog.reverse) {
            (true, false) if !self.forward_prohibited => f64::from(speed),
            (false, true) if !self.reverse_prohibited => -f64::from(speed),
            _ => 0.0,
        }
    }

    fn power(&self) -> Power {
        if self.jog.enable { Power::On(self.target()) } else { Power::Off }
    }
}

fn offset(address: u16, base: u16) -> Option<usize> {
    address.checked_sub(base).map(usize::from)
}

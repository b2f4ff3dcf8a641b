//! Who may do what with a module.

use puente_drives::pid::{Command, Gains, Refused, State};
use puente_line::Instant;

use super::Loop;
use crate::{Control, Order, Refusal, Setting};

/// What a module knows of those who tell it something.
#[derive(Clone, Debug)]
pub(super) struct Authority {
    /// Whose Hold has put the module under current last.
    commander: Option<u8>,
    /// Another has said Hold since the commander did.
    stopped: bool,
    /// Who has said Off or Observe since his last Hold or Follow.
    edges: Stations,
    /// Whose last edge was not enough to put the module under current, and why.
    denied: Option<(u8, Refusal)>,
    /// Of the loop, once they are known.
    gains: Option<Gains>,
}

impl Authority {
    pub const fn new() -> Self {
        Self { commander: None, stopped: false, edges: Stations([0; 8]), denied: None, gains: None }
    }

    /// The commander, or the last one.
    pub const fn commander(&self) -> Option<u8> {
        self.commander
    }

    /// Does what a section with an order says, `None` where it makes no sense. Says why it has no effect, or not all.
    pub fn obey(
        &mut self,
        now: Instant,
        from: u8,
        setting: Option<Setting>,
        servo: &mut impl Loop,
    ) -> Option<Refusal> {
        let Some((setting, Order { control, .. })) =
            setting.and_then(|setting| Some((setting, setting.order?)))
        else {
            return Some(Refusal::Meaningless);
        };
        match control {
            Control::Observe => {
                self.edges.insert(from);
                None
            }
            Control::Off => {
                self.edges.insert(from);
                carry_out(servo, now, Command::Disable).err()
            }
            Control::Hold => self.hold(now, from, setting, servo).err(),
            Control::Follow => self.follow(now, from, setting, servo).err(),
        }
    }

    /// Does what a section of the thesis says: gains, and the set-point where the axis follows. Its LRC protects it too badly
    /// for an order to count.
    pub fn set(
        &mut self,
        now: Instant,
        from: u8,
        setting: Option<Setting>,
        servo: &mut impl Loop,
    ) -> Option<Refusal> {
        let Some(setting) = setting else {
            return Some(Refusal::Meaningless);
        };
        let state = servo.status().state;
        if is_under_current(state) && self.commander != Some(from) {
            return Some(Refusal::Commander);
        }
        let gains = self.set_gains(now, setting, servo);
        let set_point = match state {
            State::Enabled => go_to(servo, now, setting),
            State::Starting | State::Held => {
                refresh(servo, now);
                Ok(())
            }
            State::Disabled | State::Fault(_) => Ok(()),
        };
        set_point.and(gains).err()
    }

    fn hold(
        &mut self,
        now: Instant,
        from: u8,
        setting: Setting,
        servo: &mut impl Loop,
    ) -> Result<(), Refusal> {
        let edge = self.edges.remove(from);
        match servo.status().state {
            State::Fault(_) => Err(Refusal::Fault),
            State::Disabled if edge => {
                let outcome = self.enable(now, from, setting, servo);
                self.denied = outcome.err().map(|why| (from, why));
                outcome
            }
            State::Disabled => {
                let denied = self.denied.filter(|(denied, _)| *denied == from);
                Err(denied.map_or(Refusal::NoEdge, |(_, why)| why))
            }
            _ if self.commander == Some(from) => {
                self.stopped = false;
                carry_out(servo, now, Command::Stop)?;
                refresh(servo, now);
                self.set_gains(now, setting, servo)
            }
            _ => {
                self.stopped = true;
                carry_out(servo, now, Command::Stop)?;
                Err(Refusal::Commander)
            }
        }
    }

    /// Puts the module under current, held.
    fn enable(
        &mut self,
        now: Instant,
        from: u8,
        setting: Setting,
        servo: &mut impl Loop,
    ) -> Result<(), Refusal> {
        self.set_gains(now, setting, servo)?;
        carry_out(servo, now, Command::Enable)?;
        self.commander = Some(from);
        self.stopped = false;
        carry_out(servo, now, Command::Stop)
    }

    fn follow(
        &mut self,
        now: Instant,
        from: u8,
        setting: Setting,
        servo: &mut impl Loop,
    ) -> Result<(), Refusal> {
        self.edges.remove(from);
        let state = servo.status().state;
        match state {
            State::Fault(_) => return Err(Refusal::Fault),
            State::Disabled => return Err(Refusal::HoldFirst),
            _ if self.commander != Some(from) => return Err(Refusal::Commander),
            _ if self.stopped => {
                refresh(servo, now);
                return Err(Refusal::HoldFirst);
            }
            _ => {}
        }
        setting.counts().ok_or(Refusal::Meaningless)?;
        let gains = self.set_gains(now, setting, servo);
        if state != State::Enabled {
            carry_out(servo, now, Command::Enable)?;
        }
        go_to(servo, now, setting).and(gains)
    }

    /// Gives the loop its gains where they differ.
    fn set_gains(&mut self, now: Instant, setting: Setting, servo: &mut impl Loop) -> Result<(), Refusal> {
        let gains = Gains::new(setting.kp, setting.ki, setting.kd).map_err(|_| Refusal::Gains)?;
        if self.gains != Some(gains) {
            carry_out(servo, now, Command::Gains(gains))?;
            self.gains = Some(gains);
        }
        Ok(())
    }
}

const fn is_under_current(state: State) -> bool {
    matches!(state, State::Starting | State::Enabled | State::Held)
}

fn carry_out(servo: &mut impl Loop, now: Instant, command: Command) -> Result<(), Refusal> {
    servo.command(now, command).map_err(|why| match why {
        Refused::Encoder(_) => Refusal::NoPosition,
        Refused::Gains => Refusal::Gains,
        // A fault since the state was asked.
        Refused::State(_) => Refusal::Fault,
    })
}

/// A set-point, from the commander. An axis that is just starting takes none; the next comes soon.
fn go_to(servo: &mut impl Loop, now: Instant, setting: Setting) -> Result<(), Refusal> {
    let counts = setting.counts().ok_or(Refusal::Meaningless)?;
    match servo.command(now, Command::SetPoint(counts.into())) {
        Err(Refused::State(State::Starting)) | Ok(()) => Ok(()),
        Err(_) => Err(Refusal::Fault),
    }
}

/// The commander is there: a set-point counts as communication, and is not taken while the axis is held or starting.
fn refresh(servo: &mut impl Loop, now: Instant) {
    if matches!(servo.status().state, State::Starting | State::Held) {
        let _ = servo.command(now, Command::SetPoint(0));
    }
}

/// Some of the 256 addresses.
#[derive(Clone, Debug)]
struct Stations([u32; 8]);

impl Stations {
    fn insert(&mut self, address: u8) {
        if let Some(word) = self.0.get_mut(usize::from(address >> 5)) {
            *word |= 1 << (address & 31);
        }
    }

    /// Whether it was there.
    fn remove(&mut self, address: u8) -> bool {
        let Some(word) = self.0.get_mut(usize::from(address >> 5)) else {
            return false;
        };
        let there = *word >> (address & 31) & 1 == 1;
        *word &= !(1 << (address & 31));
        there
    }
}

//! What the replies say of axes, parameters and buses. The names of the fields are the interface, see docs/http.md.

mod axis;
mod bus;
mod group;

use core::fmt;

use puente_drives::edb::Parameter;
use puente_drives::pid;
use puente_line::millis;
use serde::{Serialize, Serializer};

use crate::clock;
use crate::settings::keeper::{Keeper, TRIAL};
pub(super) use axis::{Axis, Commanded, Findings, jog_rpm};
pub(super) use bus::Bus;
pub(super) use group::Group;

/// A value that is shown as the text it has for people.
pub(super) struct Text<T>(pub T);

impl<T: fmt::Display> Serialize for Text<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&self.0)
    }
}

/// A parameter.
#[derive(Serialize)]
pub(super) struct ParameterValue<'a> {
    axis: &'a str,
    parameter: Text<Parameter>,
    value: u16,
    unit: Option<&'static str>,
    name: Option<&'static str>,
    min: Option<u16>,
    max: Option<u16>,
    default: Option<u16>,
}

impl<'a> ParameterValue<'a> {
    pub(super) fn new(axis: &'a str, parameter: Parameter, value: u16) -> Self {
        let info = parameter.info();
        Self {
            axis,
            parameter: Text(parameter),
            value,
            unit: info.and_then(|info| info.unit),
            name: info.map(|info| info.name),
            min: info.and_then(|info| info.min),
            max: info.and_then(|info| info.max),
            default: info.and_then(|info| info.default),
        }
    }
}

/// Gains of a loop.
#[derive(Serialize)]
pub(super) struct Gains {
    kp: f32,
    ki: f32,
    kd: f32,
}

impl From<pid::Gains> for Gains {
    fn from(gains: pid::Gains) -> Self {
        Self { kp: gains.kp(), ki: gains.ki(), kd: gains.kd() }
    }
}

/// The settings in force: where they come from, and for how long they stay where nobody confirms them.
#[derive(Serialize)]
pub(super) struct ConfigState {
    settings: &'static str,
    trial_left_s: Option<u64>,
}

impl ConfigState {
    pub(super) fn new(keeper: &Keeper) -> Self {
        let left = keeper.trial_left(clock::now());
        Self { settings: keeper.source().name(), trial_left_s: left.map(|left| millis(left).div_ceil(1000)) }
    }
}

/// A change of the settings that has been accepted.
#[derive(Serialize)]
pub(super) struct Changed {
    restart: bool,
    confirm_within_s: Option<u64>,
}

impl Changed {
    pub(super) fn new(on_trial: bool) -> Self {
        Self { restart: true, confirm_within_s: on_trial.then_some(TRIAL.as_secs()) }
    }
}

#[cfg(test)]
mod tests;

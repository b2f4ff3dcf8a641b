//! The objects of a drive (CiA 402), and the manufacturer's.

use puente_canopen::Address;
use puente_canopen::sdo::Abort;
use puente_drives::cia402::homing::Method;
use puente_drives::cia402::object::{self as drive, Kind, Object};
use puente_drives::cia402::{Mode, Period, State, parameter_of_delta};

use super::Drive;
use crate::can::node::objects::Access::{Read, ReadMapped, Write, WriteMapped};
use crate::can::node::{Model, Objects};

/// What the drive does when its master is lost: 0 nothing, 1 fault, 2 no current, 3 quick stop.
pub const CONNECTION_OPTION: Object = Object::new(0x6007, 0, Kind::I16);
/// Velocity window and its time.
pub const VELOCITY_WINDOW: Object = Object::new(0x606D, 0, Kind::U16);
pub const VELOCITY_TIME: Object = Object::new(0x606E, 0, Kind::U16);
pub const TORQUE_DEMAND: Object = Object::new(0x6074, 0, Kind::I16);
pub const TORQUE_SLOPE: Object = Object::new(0x6087, 0, Kind::U32);
pub const FOLLOWING_ERROR: Object = Object::new(0x60F4, 0, Kind::I32);
/// Jog velocity of the Lexium, P4-05, r/min.
pub const JOG_SPEED: (u8, u8) = (4, 5);

/// Defaults of velocities and accelerations, *assumed* of all models: units are position units a second and a second squared.
const VELOCITY: i64 = 1_000_000;
const ACCELERATION: i64 = 10_000_000;

/// Defines all of them.
pub fn define(objects: &mut Objects, model: Model) {
    objects.object(drive::ERROR_CODE, ReadMapped, 0);
    objects.object(drive::CONTROLWORD, WriteMapped, 0);
    objects.object(drive::STATUSWORD, ReadMapped, 0);
    objects.object(CONNECTION_OPTION, Write, 1);
    options(objects);
    objects.object(drive::MODE, WriteMapped, 0);
    objects.object(drive::MODE_DISPLAY, ReadMapped, 0);
    actuals(objects);
    set_points(objects);
    homing(objects);
    interpolation(objects, model);
    objects.object(drive::SUPPORTED_MODES, Read, supported(model));
    match model {
        Model::Lexium23a => lexium(objects),
        Model::FestoCmms => festo(objects),
        Model::Generic | Model::Node => {}
    }
}

/// Option codes with their defaults.
fn options(objects: &mut Objects) {
    for (object, value) in [
        (drive::QUICK_STOP_OPTION, 2),
        (drive::SHUTDOWN_OPTION, 0),
        (drive::DISABLE_OPTION, 1),
        (drive::HALT_OPTION, 1),
        (drive::FAULT_OPTION, 2),
    ] {
        objects.object(object, Write, value);
    }
}

fn actuals(objects: &mut Objects) {
    for object in [
        drive::POSITION_DEMAND,
        drive::POSITION,
        drive::VELOCITY_DEMAND,
        drive::VELOCITY,
        TORQUE_DEMAND,
        drive::TORQUE,
        FOLLOWING_ERROR,
        drive::INPUTS,
    ] {
        objects.object(object, ReadMapped, 0);
    }
    // Windows: a turn of following error, a thousandth of a turn of standstill. All *assumed*.
    objects.object(drive::FOLLOWING_WINDOW, Write, 100_000);
    objects.object(drive::FOLLOWING_TIMEOUT, Write, 20);
    objects.object(drive::POSITION_WINDOW, Write, 100);
    objects.object(drive::POSITION_TIME, Write, 10);
    objects.object(VELOCITY_WINDOW, Write, 1_000);
    objects.object(VELOCITY_TIME, Write, 10);
}

fn set_points(objects: &mut Objects) {
    objects.object(drive::TARGET_TORQUE, WriteMapped, 0);
    objects.object(drive::TARGET_POSITION, WriteMapped, 0);
    objects.object(drive::TARGET_VELOCITY, WriteMapped, 0);
    objects.count(0x607D, 2);
    objects.object(drive::LIMIT_LOW, Write, 0);
    objects.object(drive::LIMIT_HIGH, Write, 0);
    objects.object(drive::POLARITY, Write, 0);
    objects.object(drive::MAX_PROFILE_VELOCITY, Write, 5 * VELOCITY);
    objects.object(drive::PROFILE_VELOCITY, WriteMapped, VELOCITY);
    objects.object(drive::PROFILE_ACCELERATION, WriteMapped, ACCELERATION);
    objects.object(drive::PROFILE_DECELERATION, WriteMapped, ACCELERATION);
    objects.object(drive::QUICK_STOP_DECELERATION, Write, 2 * ACCELERATION);
    objects.object(drive::MOTION_PROFILE, Write, 0);
    // Thousandths of the rated torque a second.
    objects.object(TORQUE_SLOPE, Write, 10_000);
}

fn homing(objects: &mut Objects) {
    objects.object(drive::HOME_OFFSET, Write, 0);
    // The negative limit switch, *assumed*: method 0 is none.
    objects.object(drive::HOMING_METHOD, WriteMapped, 17);
    objects.count(0x6099, 2);
    objects.object(drive::HOMING_FAST, Write, VELOCITY / 5);
    objects.object(drive::HOMING_SLOW, Write, VELOCITY / 50);
    objects.object(drive::HOMING_ACCELERATION, Write, ACCELERATION);
}

fn interpolation(objects: &mut Objects, model: Model) {
    let relative = model.profile().is_some_and(|profile| profile.interpolation.says_relative);
    let submode = model.profile().map_or(0, |profile| profile.interpolation.submode);
    objects.object(drive::INTERPOLATION_SUBMODE, Write, submode.into());
    objects.count(0x60C1, if relative { 2 } else { 1 });
    objects.object(drive::INTERPOLATION_SET_POINT, WriteMapped, 0);
    if relative {
        objects.object(drive::INTERPOLATION_RELATIVE, WriteMapped, 0);
    }
    objects.count(0x60C2, 2);
    objects.object(drive::PERIOD_VALUE, Write, 1);
    objects.object(drive::PERIOD_EXPONENT, Write, -3);
}

fn supported(model: Model) -> i64 {
    let has = |code: &i8| Mode::from_code(*code).is_some_and(|mode| model.has(mode));
    (1..=10_i8).filter(has).map(|code| 1_i64 << (code - 1)).sum()
}

/// A few parameters of the Lexium, where Delta's rule has them. The lengths are *assumed*; but for the jog velocity they do
/// nothing.
fn lexium(objects: &mut Objects) {
    let parameters: [(u8, u8, Kind, i64); 17] = [
        (1, 1, Kind::U16, 0x000B),
        (1, 44, Kind::U32, 128),
        (1, 45, Kind::U32, 10),
        (2, 10, Kind::U16, 0x0102),
        (2, 11, Kind::U16, 0x0100),
        (2, 12, Kind::U16, 0x0100),
        (2, 13, Kind::U16, 0x0100),
        (2, 14, Kind::U16, 0x0124),
        (2, 15, Kind::U16, 0x0122),
        (2, 16, Kind::U16, 0x0123),
        (2, 17, Kind::U16, 0x0121),
        (2, 30, Kind::U16, 0),
        (3, 1, Kind::U16, 0x0103),
        (3, 5, Kind::U16, 0),
        (4, 5, Kind::U16, 20),
        (5, 4, Kind::U16, 0),
        (5, 5, Kind::U32, 1_000),
    ];
    for (group, number, kind, value) in parameters {
        if let Some(Address { index, sub }) = parameter_of_delta(group, number) {
            objects.number(index, sub, kind, Write, value);
        }
    }
}

/// What the interpolation of Festo has besides: nothing but the order of 60C1h depends on it here.
fn festo(objects: &mut Objects) {
    objects.count(0x60C3, 2);
    objects.number(0x60C3, 1, Kind::U8, Write, 0);
    objects.number(0x60C3, 2, Kind::U8, Write, 1);
}

impl Drive {
    /// Whether a value may be written now; objects of the communication profile may.
    ///
    /// # Errors
    /// Why not.
    pub fn check(&self, objects: &Objects, address: Address, bytes: &[u8]) -> Result<(), Abort> {
        let value = |object: Object| object.kind.read(bytes).filter(|_| object.address == address);
        if let Some(code) = value(drive::MODE) {
            let mode = Mode::from_code(code as i8).filter(|mode| self.model.has(*mode));
            return mode.map(|_| ()).ok_or(Abort::VALUE);
        }
        if let Some(method) = value(drive::HOMING_METHOD) {
            let known = method != 0 && Method::new(method as i8).is_some_and(|method| method.number() > 0);
            return if known { Ok(()) } else { Err(Abort::VALUE) };
        }
        if matches!(address.index, 0x60C0 | 0x60C2) && self.interpolates() {
            return Err(Abort::DEVICE_STATE);
        }
        if let Some(submode) = value(drive::INTERPOLATION_SUBMODE) {
            let own = i64::from(self.profile.interpolation.submode);
            return if submode == own { Ok(()) } else { Err(Abort::VALUE) };
        }
        let period = match (value(drive::PERIOD_VALUE), value(drive::PERIOD_EXPONENT)) {
            (Some(new), _) => Period::from_parts(new as u8, objects.value(drive::PERIOD_EXPONENT) as i8),
            (_, Some(new)) => Period::from_parts(objects.value(drive::PERIOD_VALUE) as u8, new as i8),
            _ => return Ok(()),
        };
        period.map(|_| ()).ok_or(Abort::VALUE)
    }

    pub(super) fn interpolates(&self) -> bool {
        self.state == State::OperationEnabled && self.mode == Mode::InterpolatedPosition && self.active
    }
}

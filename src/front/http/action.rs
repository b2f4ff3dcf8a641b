//! What an axis can be told over HTTP, from the bodies of requests.

use puente_drives::cia402::Mode;
use puente_drives::cia402::homing::Method;
use puente_line::Duration;
use serde::Deserialize;

use super::api::json;
use super::problem::{HOLD_MS, Problem};
use super::resource::Command;
use crate::axis::{Axes, AxisError, Commander, Course, cia402};

/// What an axis is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Action {
    Jog(i32, Option<Duration>),
    /// Where to, hold time, and whether it only renews a move.
    Move(Course, Option<Duration>, bool),
    /// By which method, hold time, and whether it only renews a search.
    Home(Option<Method>, Option<Duration>, bool),
    Velocity(i32, Option<Duration>),
    Torque(i16, Option<Duration>),
    Mode(Mode, Option<Duration>),
    Stop,
    Enable,
    Disable,
    Clear,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JogBody {
    rpm: i32,
    hold_ms: Option<u32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MoveBody {
    position: i32,
    velocity: Option<u32>,
    hold_ms: Option<u32>,
    #[serde(default)]
    renew: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HomeBody {
    method: Option<i8>,
    hold_ms: Option<u32>,
    #[serde(default)]
    renew: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct VelocityBody {
    velocity: i32,
    hold_ms: Option<u32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TorqueBody {
    torque_permille: i16,
    hold_ms: Option<u32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ModeBody<'a> {
    mode: &'a str,
    hold_ms: Option<u32>,
}

impl Action {
    /// Understands a command with its body.
    pub(super) fn read(command: Command, body: &[u8]) -> Result<Self, Problem> {
        Ok(match command {
            Command::Jog => {
                let JogBody { rpm, hold_ms } = json(body, "{\"rpm\": 100, \"hold_ms\": 500}")?;
                Action::Jog(rpm, hold(hold_ms)?)
            }
            Command::Move => {
                let MoveBody { position, velocity, hold_ms, renew } =
                    json(body, "{\"position\": 1000, \"hold_ms\": 500}")?;
                Action::Move(Course { position, velocity }, hold(hold_ms)?, renew)
            }
            Command::Home => {
                let HomeBody { method, hold_ms, renew } = json(body, "{\"method\": 35, \"hold_ms\": 500}")?;
                let method =
                    method.map(|number| Method::new(number).ok_or(Problem::Homing(number))).transpose()?;
                Action::Home(method, hold(hold_ms)?, renew)
            }
            Command::Velocity => {
                let VelocityBody { velocity, hold_ms } = json(body, "{\"velocity\": 100, \"hold_ms\": 500}")?;
                Action::Velocity(velocity, hold(hold_ms)?)
            }
            Command::Torque => {
                let TorqueBody { torque_permille, hold_ms } =
                    json(body, "{\"torque_permille\": 100, \"hold_ms\": 500}")?;
                Action::Torque(torque_permille, hold(hold_ms)?)
            }
            Command::Mode => {
                let ModeBody { mode, hold_ms } = json(body, "{\"mode\": \"pv\", \"hold_ms\": 500}")?;
                Action::Mode(cia402::mode(mode).ok_or(Problem::Mode)?, hold(hold_ms)?)
            }
            Command::Stop => Action::Stop,
            Command::Enable => Action::Enable,
            Command::Disable => Action::Disable,
            Command::Clear => Action::Clear,
        })
    }

    /// Carries it out.
    pub(super) async fn carry_out(self, axes: &Axes, id: u8, by: Commander) -> Result<(), AxisError> {
        match self {
            Action::Jog(rpm, hold) => axes.jog(id, by, rpm, hold).await,
            Action::Move(course, hold, renew) => axes.move_to(id, by, course, hold, renew).await,
            Action::Home(method, hold, renew) => axes.home(id, by, method, hold, renew).await,
            Action::Velocity(velocity, hold) => axes.velocity(id, by, velocity, hold).await,
            Action::Torque(permille, hold) => axes.torque(id, by, permille, hold).await,
            Action::Mode(mode, hold) => axes.mode(id, by, mode, hold).await,
            Action::Stop => axes.stop(id, by).await,
            Action::Enable => axes.enable(id, by).await,
            Action::Disable => axes.disable(id, by).await,
            Action::Clear => axes.clear(id, by).await,
        }
    }
}

fn hold(ms: Option<u32>) -> Result<Option<Duration>, Problem> {
    match ms {
        None => Ok(None),
        Some(ms) if HOLD_MS.contains(&ms) => Ok(Some(Duration::from_millis(u64::from(ms)))),
        Some(ms) => Err(Problem::Hold(ms)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jog(body: &str) -> Result<(i32, Option<u32>), Problem> {
        json::<JogBody>(body.as_bytes(), "").map(|JogBody { rpm, hold_ms }| (rpm, hold_ms))
    }

    #[test]
    fn jog_bodies() {
        assert_eq!(jog("{\"rpm\":100,\"hold_ms\":500}"), Ok((100, Some(500))));
        assert_eq!(jog(" { \"hold_ms\" : null , \"rpm\" : -7 } \r\n"), Ok((-7, None)));
        assert_eq!(jog("{\"rpm\":100}"), Ok((100, None)));
        for bad in [
            "",
            "{}",
            "[]",
            "null",
            "100",
            "{\"rpm\":}",
            "{\"rpm\":\"100\"}",
            "{\"rpm\":1.5}",
            "{\"rpm\":1e2}",
            "{\"rpm\":100",
            "{\"rpm\":100}}",
            "{\"rpm\":100}{\"rpm\":5}",
            "{\"rpm\":2147483648}",
            "{\"rpm\":1,\"speed\":2}",
            "{\"rpm\":1,\"rpm\":2}",
            "{\"rpm\":1,\"hold_ms\":-1}",
            "{\"RPM\":1}",
            "{\"a\":[[[[[[[[[[[[[[[[[",
        ] {
            assert_eq!(jog(bad), Err(Problem::Json("")), "{bad}");
        }
    }

    #[test]
    fn hold_times_are_bounded() {
        assert_eq!(hold(None), Ok(None));
        assert_eq!(hold(Some(50)), Ok(Some(Duration::from_millis(50))));
        assert_eq!(hold(Some(5000)), Ok(Some(Duration::from_millis(5000))));
        for ms in [0, 49, 5001, u32::MAX] {
            assert_eq!(hold(Some(ms)), Err(Problem::Hold(ms)));
        }
    }

    #[test]
    fn bodies_of_cia_402() {
        let read = |command, body: &str| Action::read(command, body.as_bytes());
        let hold = Some(Duration::from_millis(500));
        assert_eq!(
            read(Command::Move, "{\"position\":5,\"velocity\":7,\"hold_ms\":500}"),
            Ok(Action::Move(Course { position: 5, velocity: Some(7) }, hold, false))
        );
        assert_eq!(read(Command::Home, "{}"), Ok(Action::Home(None, None, false)));
        assert_eq!(read(Command::Home, "{\"method\":35}"), Ok(Action::Home(Method::new(35), None, false)));
        assert_eq!(read(Command::Home, "{\"method\":0}"), Err(Problem::Homing(0)));
        assert_eq!(read(Command::Velocity, "{\"velocity\":-7}"), Ok(Action::Velocity(-7, None)));
        assert_eq!(read(Command::Torque, "{\"torque_permille\":100}"), Ok(Action::Torque(100, None)));
        assert_eq!(read(Command::Mode, "{\"mode\":\"pv\"}"), Ok(Action::Mode(Mode::ProfileVelocity, None)));
        assert_eq!(read(Command::Mode, "{\"mode\":\"fast\"}"), Err(Problem::Mode));
        assert!(matches!(read(Command::Torque, "{\"torque_permille\":40000}"), Err(Problem::Json(_))));
    }

    proptest::proptest! {
        #[test]
        fn any_body_is_read_without_panic(body in proptest::collection::vec(0..=255_u8, 0..64)) {
            for command in [Command::Jog, Command::Move, Command::Home, Command::Mode] {
                let _ = Action::read(command, &body);
            }
        }

        #[test]
        fn any_text_like_json_is_read_without_panic(body in "[\\[\\]{}\":,a-z0-9\\\\. u-]{0,64}") {
            let _ = jog(&body);
        }
    }
}

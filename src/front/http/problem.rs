//! What a request is refused with.

use core::fmt;

use puente_canopen::sdo::Failure;
use serde::{Serialize, Serializer};

use super::nodes::OBJECT;
use super::status::{self, Status};
use crate::axis::{AxisError, CanRefusal};
use crate::desk::CanFailure;
use crate::front::objects::{Failed, Hex, failure_code};
use crate::settings::keeper::TRIAL;
use crate::settings::{self, json};

/// Bounds of `hold_ms`, in ms.
pub(super) const HOLD_MS: core::ops::RangeInclusive<u32> = 50..=5000;

/// Why a request is refused. In JSON: `{"code": .., "message": ..}`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Problem {
    /// The head is no HTTP.
    Head(httparse::Error),
    /// The request contradicts itself or ends too early.
    Request(&'static str),
    /// The body is not the JSON object that is expected.
    Json(&'static str),
    /// A hold time out of [`HOLD_MS`].
    Hold(u32),
    /// The path names no parameter.
    Parameter(puente_drives::edb::BadParameter),
    /// No mode of a CiA 402 drive.
    Mode,
    /// No homing method.
    Homing(i8),
    /// A gain that no loop can work with.
    Gains(puente_drives::pid::BadGain),
    /// A page of another origin wants to act.
    Origin,
    /// Nothing has this path.
    NotFound,
    /// The path has other methods: these.
    Method(&'static str),
    /// The request did not come to its end in time.
    Timeout,
    /// The length of the body is not told beforehand.
    LengthRequired,
    /// The body is longer than this.
    BodyTooLarge(usize),
    /// The head is longer than what is kept of a client.
    HeadTooLarge,
    /// All places are taken: only stop and disable are served.
    Full,
    /// The axis refused, or its drive gave no reply.
    Axis(AxisError),
    /// The body is no settings document.
    Document(json::Error),
    /// Another client is changing the settings.
    Busy,
    /// The settings cannot be changed here.
    ReadOnly,
    /// Other settings are on trial.
    OnTrial,
    /// No settings are on trial.
    NoTrial,
    /// An axis may be in motion.
    Moving,
    /// The settings could not be kept.
    Flash,
    /// No CANopen bus has this name.
    UnknownBus,
    /// No node can have this node-ID.
    UnknownNode,
    /// The path names no object.
    Object,
    /// There is no such data type.
    Type,
    /// The body has no value of this data type.
    Value(&'static str),
    /// An object is longer than what can be told of it.
    ObjectTooLong,
    /// The body is no data sheet.
    Eds(puente_eds::Error),
    /// It is not a client's to send.
    Reserved(CanRefusal),
    /// The node refused, or gave no answer, or was not asked.
    Can(CanFailure),
}

impl Problem {
    pub(super) const fn status(&self) -> Status {
        match self {
            Problem::Head(_) | Problem::Request(_) | Problem::Json(_) => status::BAD_REQUEST,
            Problem::Hold(_) | Problem::Gains(_) | Problem::Parameter(_) | Problem::Document(_) => {
                status::BAD_REQUEST
            }
            Problem::Mode | Problem::Homing(_) => status::BAD_REQUEST,
            Problem::Origin => status::FORBIDDEN,
            Problem::NotFound => status::NOT_FOUND,
            Problem::Method(_) => status::METHOD_NOT_ALLOWED,
            Problem::Timeout => status::REQUEST_TIMEOUT,
            Problem::LengthRequired => status::LENGTH_REQUIRED,
            Problem::BodyTooLarge(_) => status::CONTENT_TOO_LARGE,
            Problem::HeadTooLarge => status::HEADERS_TOO_LARGE,
            Problem::Full | Problem::Busy => status::SERVICE_UNAVAILABLE,
            Problem::ReadOnly | Problem::OnTrial | Problem::NoTrial | Problem::Moving => status::CONFLICT,
            Problem::Flash => status::INTERNAL_ERROR,
            Problem::Axis(error) => axis_status(error),
            Problem::UnknownBus | Problem::UnknownNode => status::NOT_FOUND,
            Problem::Object | Problem::Type | Problem::Value(_) | Problem::Eds(_) => status::BAD_REQUEST,
            Problem::Reserved(_) => status::CONFLICT,
            Problem::ObjectTooLong => status::BAD_GATEWAY,
            Problem::Can(CanFailure::TooLong) => status::CONTENT_TOO_LARGE,
            Problem::Can(CanFailure::NotSent(_)) => status::SERVICE_UNAVAILABLE,
            Problem::Can(CanFailure::Sdo(Failure::Timeout { .. })) => status::GATEWAY_TIMEOUT,
            Problem::Can(CanFailure::Sdo(_)) => status::BAD_GATEWAY,
        }
    }

    /// The word that programs go by.
    pub(super) const fn code(&self) -> &'static str {
        match self {
            Problem::Head(_) | Problem::Request(_) => "bad-request",
            Problem::Json(_) => "bad-json",
            Problem::Hold(_) | Problem::Gains(_) | Problem::Homing(_) => "range",
            Problem::Mode => "mode",
            Problem::Parameter(_) => "parameter",
            Problem::Origin => "origin",
            Problem::NotFound => "not-found",
            Problem::Method(_) => "method",
            Problem::Timeout => "timeout",
            Problem::LengthRequired => "length-required",
            Problem::BodyTooLarge(_) | Problem::HeadTooLarge => "too-large",
            Problem::Document(json::Error::Version(_)) => BadSettings::CODE,
            Problem::Document(json::Error::Json(_)) => "bad-json",
            Problem::Busy => "busy",
            Problem::ReadOnly => "read-only",
            Problem::OnTrial => "on-trial",
            Problem::NoTrial => "no-trial",
            Problem::Moving => "moving",
            Problem::Flash => "flash",
            Problem::Full => "full",
            Problem::Axis(error) => error.code(),
            Problem::UnknownBus => "unknown-bus",
            Problem::UnknownNode => "unknown-node",
            Problem::Object => "object",
            Problem::Type => "type",
            Problem::Value(_) => "value",
            Problem::ObjectTooLong => "too-long",
            Problem::Eds(_) => "eds",
            Problem::Reserved(_) => "reserved",
            Problem::Can(failure) => failure_code(failure),
        }
    }
}

const fn axis_status(error: &AxisError) -> Status {
    use crate::desk::Failure;
    match error {
        AxisError::UnknownAxis | AxisError::Unsupported(_) => status::NOT_FOUND,
        AxisError::Leased(_) | AxisError::NotEnabled | AxisError::Alarm(_) => status::CONFLICT,
        AxisError::Fault(_) | AxisError::Refused(_) | AxisError::NoGains => status::CONFLICT,
        AxisError::DriveFault(_) | AxisError::Drive(..) | AxisError::Group => status::CONFLICT,
        AxisError::Node(_) => status::SERVICE_UNAVAILABLE,
        AxisError::Range { .. } | AxisError::GainDigits => status::BAD_REQUEST,
        AxisError::Failure(Failure::NotSent(_)) => status::SERVICE_UNAVAILABLE,
        AxisError::Failure(Failure::NoReply(_)) => status::GATEWAY_TIMEOUT,
        AxisError::Exception(_) => status::BAD_GATEWAY,
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Problem::Head(error) => write!(f, "this is no HTTP request: {error}"),
            Problem::Request(text) => f.write_str(text),
            Problem::Json(expected) => write!(f, "the body must be JSON as in {expected}"),
            Problem::Hold(ms) => {
                write!(f, "hold_ms {ms} is out of range {} to {}", HOLD_MS.start(), HOLD_MS.end())
            }
            Problem::Gains(error) => error.fmt(f),
            Problem::Mode => f.write_str("a mode is pp, pv, pt, hm, ip, csp, csv, cst or its number"),
            Problem::Homing(number) => write!(f, "{number} is no homing method"),
            Problem::Parameter(error) => error.fmt(f),
            Problem::Origin => f.write_str("only the gateway's own page may command axes from a browser"),
            Problem::NotFound => f.write_str("nothing has this path"),
            Problem::Method(allowed) => write!(f, "this path takes {allowed}"),
            Problem::Timeout => f.write_str("the request did not come to its end in time"),
            Problem::LengthRequired => f.write_str("the body needs a Content-Length"),
            Problem::BodyTooLarge(most) => write!(f, "the body may have at most {most} bytes"),
            Problem::HeadTooLarge => f.write_str("the head of the request is too long"),
            Problem::Full => {
                f.write_str("all places for clients are taken; only stop and disable are served")
            }
            Problem::Axis(AxisError::UnknownAxis) => {
                f.write_str("no axis has this name; GET /api/axes lists them")
            }
            Problem::Axis(error) => error.fmt(f),
            Problem::Document(error) => error.fmt(f),
            Problem::Busy => f.write_str("another client is changing the settings; try again"),
            Problem::ReadOnly => f.write_str("this gateway has no flash to keep settings in"),
            Problem::OnTrial => write!(
                f,
                "network settings are on trial; confirm them, or wait until they are taken back after {} s",
                TRIAL.as_secs()
            ),
            Problem::NoTrial => {
                f.write_str("no settings are on trial; they are confirmed, or were taken back")
            }
            Problem::Moving => f.write_str(
                "an axis is commanded, is being stopped or turns; settings are changed at standstill only",
            ),
            Problem::Flash => f.write_str("the flash failed; the settings are as before"),
            Problem::UnknownBus => f.write_str("no CANopen bus has this name; GET /api/buses lists them"),
            Problem::UnknownNode => f.write_str("node-IDs are 1 to 127; commands go to all with 0"),
            Problem::Object => {
                f.write_str("an object is its index in hexadecimal and its sub-index, as in 6041:0")
            }
            Problem::Type => f.write_str("there is no such data type; docs/http.md lists them"),
            Problem::Value(kind) => write!(f, "the body has no value of type {kind}"),
            Problem::ObjectTooLong => {
                write!(f, "the object has more than {OBJECT} bytes; read it in CiA 309-3")
            }
            Problem::Eds(error) => error.fmt(f),
            Problem::Reserved(refusal) => refusal.fmt(f),
            Problem::Can(failure) => failure.fmt(f),
        }
    }
}

/// What is wrong with a settings document.
pub(super) struct BadSettings<'a>(pub &'a settings::Problem);

impl BadSettings<'_> {
    const CODE: &'static str = "settings";
}

impl From<Failed> for Problem {
    fn from(failed: Failed) -> Self {
        match failed {
            Failed::Axis(error) => Problem::Axis(error),
            Failed::Reserved(refusal) => Problem::Reserved(refusal),
            Failed::Can(failure) => Problem::Can(failure),
        }
    }
}

impl From<CanFailure> for Problem {
    fn from(failure: CanFailure) -> Self {
        Problem::Can(failure)
    }
}

impl From<AxisError> for Problem {
    fn from(error: AxisError) -> Self {
        Problem::Axis(error)
    }
}

/// `{"code": .., "message": ..}`, and with the abort code where there is one.
#[derive(Serialize)]
#[serde(bound = "T: fmt::Display")]
struct Error<T> {
    code: &'static str,
    message: super::view::Text<T>,
    #[serde(skip_serializing_if = "Option::is_none")]
    abort: Option<super::view::Text<Hex<4>>>,
}

impl Serialize for Problem {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let abort = match self {
            Problem::Can(CanFailure::Sdo(Failure::Aborted(abort))) => {
                Some(super::view::Text(Hex(abort.0.to_be_bytes())))
            }
            _ => None,
        };
        Error { code: self.code(), message: super::view::Text(self), abort }.serialize(serializer)
    }
}

impl Serialize for BadSettings<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Error { code: Self::CODE, message: super::view::Text(self.0), abort: None }.serialize(serializer)
    }
}

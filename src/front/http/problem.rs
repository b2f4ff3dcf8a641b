//! What a request is refused with.

use core::fmt;

use serde::{Serialize, Serializer};

use super::head::MAX_BODY;
use super::status::{self, Status};
use crate::axis::AxisError;

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
    /// The body is longer than [`MAX_BODY`].
    BodyTooLarge,
    /// The head is longer than what is kept of a client.
    HeadTooLarge,
    /// All places are taken: only stop and disable are served.
    Full,
    /// The axis refused, or its drive gave no reply.
    Axis(AxisError),
}

impl Problem {
    pub(super) const fn status(&self) -> Status {
        match self {
            Problem::Head(_) | Problem::Request(_) | Problem::Json(_) => status::BAD_REQUEST,
            Problem::Hold(_) | Problem::Parameter(_) => status::BAD_REQUEST,
            Problem::Origin => status::FORBIDDEN,
            Problem::NotFound => status::NOT_FOUND,
            Problem::Method(_) => status::METHOD_NOT_ALLOWED,
            Problem::Timeout => status::REQUEST_TIMEOUT,
            Problem::LengthRequired => status::LENGTH_REQUIRED,
            Problem::BodyTooLarge => status::CONTENT_TOO_LARGE,
            Problem::HeadTooLarge => status::HEADERS_TOO_LARGE,
            Problem::Full => status::SERVICE_UNAVAILABLE,
            Problem::Axis(error) => axis_status(error),
        }
    }

    /// The word that programs go by.
    pub(super) const fn code(&self) -> &'static str {
        match self {
            Problem::Head(_) | Problem::Request(_) => "bad-request",
            Problem::Json(_) => "bad-json",
            Problem::Hold(_) => "range",
            Problem::Parameter(_) => "parameter",
            Problem::Origin => "origin",
            Problem::NotFound => "not-found",
            Problem::Method(_) => "method",
            Problem::Timeout => "timeout",
            Problem::LengthRequired => "length-required",
            Problem::BodyTooLarge | Problem::HeadTooLarge => "too-large",
            Problem::Full => "full",
            Problem::Axis(error) => error.code(),
        }
    }
}

const fn axis_status(error: &AxisError) -> Status {
    use crate::desk::Failure;
    match error {
        AxisError::UnknownAxis => status::NOT_FOUND,
        AxisError::Leased(_) | AxisError::NotEnabled | AxisError::Alarm(_) => status::CONFLICT,
        AxisError::Range { .. } => status::BAD_REQUEST,
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
            Problem::Parameter(error) => error.fmt(f),
            Problem::Origin => f.write_str("only the gateway's own page may command axes from a browser"),
            Problem::NotFound => f.write_str("nothing has this path"),
            Problem::Method(allowed) => write!(f, "this path takes {allowed}"),
            Problem::Timeout => f.write_str("the request did not come to its end in time"),
            Problem::LengthRequired => f.write_str("the body needs a Content-Length"),
            Problem::BodyTooLarge => write!(f, "the body may have at most {MAX_BODY} bytes"),
            Problem::HeadTooLarge => f.write_str("the head of the request is too long"),
            Problem::Full => {
                f.write_str("all places for clients are taken; only stop and disable are served")
            }
            Problem::Axis(AxisError::UnknownAxis) => {
                f.write_str("no axis has this name; GET /api/axes lists them")
            }
            Problem::Axis(error) => error.fmt(f),
        }
    }
}

impl From<AxisError> for Problem {
    fn from(error: AxisError) -> Self {
        Problem::Axis(error)
    }
}

impl Serialize for Problem {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Error<'a> {
            code: &'static str,
            message: super::view::Text<&'a Problem>,
        }
        Error { code: self.code(), message: super::view::Text(self) }.serialize(serializer)
    }
}

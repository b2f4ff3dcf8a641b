//! Status codes (RFC 9110, section 15).

/// A status code with its reason phrase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Status(pub u16, pub &'static str);

pub(super) const OK: Status = Status(200, "OK");
pub(super) const BAD_REQUEST: Status = Status(400, "Bad Request");
pub(super) const FORBIDDEN: Status = Status(403, "Forbidden");
pub(super) const NOT_FOUND: Status = Status(404, "Not Found");
pub(super) const METHOD_NOT_ALLOWED: Status = Status(405, "Method Not Allowed");
pub(super) const REQUEST_TIMEOUT: Status = Status(408, "Request Timeout");
pub(super) const CONFLICT: Status = Status(409, "Conflict");
pub(super) const LENGTH_REQUIRED: Status = Status(411, "Length Required");
pub(super) const CONTENT_TOO_LARGE: Status = Status(413, "Content Too Large");
pub(super) const HEADERS_TOO_LARGE: Status = Status(431, "Request Header Fields Too Large");
pub(super) const INTERNAL_ERROR: Status = Status(500, "Internal Server Error");
pub(super) const BAD_GATEWAY: Status = Status(502, "Bad Gateway");
pub(super) const SERVICE_UNAVAILABLE: Status = Status(503, "Service Unavailable");
pub(super) const GATEWAY_TIMEOUT: Status = Status(504, "Gateway Timeout");

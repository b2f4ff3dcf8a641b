//! The head of a request: what matters of it, and whether what follows can be told apart from the next request.

use super::problem::Problem;

/// Longest body but for a settings document, in bytes.
pub(super) const MAX_BODY: usize = 256;
/// Most header fields. Browsers send about 20.
const MAX_FIELDS: usize = 48;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Method {
    Get,
    Head,
    Post,
    Put,
    Delete,
    Other,
}

/// What matters of a request's head.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Head<'r> {
    pub method: Method,
    /// Path without query.
    pub path: &'r str,
    /// Bytes of the body that follows.
    pub body: usize,
    /// The client understands HTTP/1.1, and so chunks.
    pub chunks: bool,
    /// The client wants to go on after this request.
    pub keep_alive: bool,
    /// The client waits for leave to send its body.
    pub expects_continue: bool,
    /// A browser sent it for a page that does not come from here.
    pub foreign: bool,
    /// Who commands: a number made of the field `X-Client`.
    pub client: Option<u32>,
}

impl<'r> Head<'r> {
    /// The head that `bytes` begin with and its length, or none while it is incomplete.
    pub(super) fn parse(bytes: &'r [u8]) -> Result<Option<(Self, usize)>, Problem> {
        let mut fields = [httparse::EMPTY_HEADER; MAX_FIELDS];
        let mut request = httparse::Request::new(&mut fields);
        let length = match request.parse(bytes) {
            Ok(httparse::Status::Complete(length)) => length,
            Ok(httparse::Status::Partial) => return Ok(None),
            Err(httparse::Error::TooManyHeaders) => return Err(Problem::HeadTooLarge),
            Err(error) => return Err(Problem::Head(error)),
        };
        let fields = Fields::read(request.headers)?;
        let latest = request.version == Some(1);
        let head = Self {
            method: match request.method {
                Some("GET") => Method::Get,
                Some("HEAD") => Method::Head,
                Some("POST") => Method::Post,
                Some("PUT") => Method::Put,
                Some("DELETE") => Method::Delete,
                _ => Method::Other,
            },
            path: path(request.path.unwrap_or_default()),
            body: fields.length.unwrap_or(0),
            chunks: latest,
            keep_alive: latest && !fields.close,
            expects_continue: latest && fields.expects_continue,
            foreign: fields.origin.is_some_and(|origin| !same_origin(origin, fields.host)),
            client: fields.client.map(hash),
        };
        Ok(Some((head, length)))
    }
}

#[derive(Default)]
struct Fields<'a> {
    host: Option<&'a [u8]>,
    origin: Option<&'a [u8]>,
    length: Option<usize>,
    close: bool,
    expects_continue: bool,
    client: Option<&'a [u8]>,
}

impl<'a> Fields<'a> {
    /// Refuses what two readers could understand in two ways (RFC 9112, section 6.3).
    fn read(fields: &[httparse::Header<'a>]) -> Result<Self, Problem> {
        let mut found = Self::default();
        for field in fields {
            let is = |name: &str| field.name.eq_ignore_ascii_case(name);
            let value = field.value.trim_ascii();
            if is("host") {
                once(&mut found.host, value, "Host is given twice")?;
            } else if is("origin") {
                once(&mut found.origin, value, "Origin is given twice")?;
            } else if is("content-length") {
                once(&mut found.length, length(value)?, "Content-Length is given twice")?;
            } else if is("transfer-encoding") {
                return Err(Problem::LengthRequired);
            } else if is("connection") {
                found.close |= has(value, b"close");
            } else if is("expect") {
                found.expects_continue |= has(value, b"100-continue");
            } else if is("x-client") {
                found.client = Some(value);
            }
        }
        Ok(found)
    }
}

fn once<T>(place: &mut Option<T>, value: T, twice: &'static str) -> Result<(), Problem> {
    match place.replace(value) {
        None => Ok(()),
        Some(_) => Err(Problem::Request(twice)),
    }
}

fn has(list: &[u8], word: &[u8]) -> bool {
    list.split(|byte| *byte == b',').any(|item| item.trim_ascii().eq_ignore_ascii_case(word))
}

fn length(value: &[u8]) -> Result<usize, Problem> {
    if value.is_empty() || !value.iter().all(u8::is_ascii_digit) {
        return Err(Problem::Request("Content-Length is no number"));
    }
    let digit = |number: usize, digit: &u8| number.saturating_mul(10).saturating_add((digit - b'0').into());
    Ok(value.iter().fold(0, digit))
}

/// The path of a request target, which may come with the server's name before it and a query after it.
fn path(target: &str) -> &str {
    let target = match target.strip_prefix("http://") {
        Some(rest) => rest.find('/').and_then(|at| rest.get(at..)).unwrap_or("/"),
        None => target,
    };
    target.split(['?', '#']).next().unwrap_or_default()
}

/// Whether a page of this origin was fetched under the name that the request goes to.
fn same_origin(origin: &[u8], host: Option<&[u8]>) -> bool {
    // Behind a proxy that adds TLS the scheme differs.
    let authority = origin.strip_prefix(b"http://").or_else(|| origin.strip_prefix(b"https://"));
    matches!((authority, host), (Some(authority), Some(host)) if authority.eq_ignore_ascii_case(host))
}

/// FNV-1a, 32 bits.
pub(super) fn hash(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811C_9DC5, |hash, byte| (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193))
}

#[cfg(test)]
mod tests;

//! The answers to requests that were understood.

use embedded_io_async::Write;
use heapless::Vec;
use puente_drives::edb::Parameter;
use puente_line::Duration;
use serde::{Deserialize, Serialize};

use super::super::{Gateway, Guest};
use super::head::{Head, Method, hash};
use super::problem::{HOLD_MS, Problem};
use super::reply::{Reply, json};
use super::resource::{Command, Resource};
use super::{Fault, metrics, view};
use crate::axis::{Axis, AxisError, Commander};
use crate::clock;
use crate::desk::Holder;
use crate::port::limits::AXES;

/// Values of a drive that are not older than this are not read again.
const FRESH: Duration = Duration::from_millis(400);

/// Who asks, and what.
pub(super) struct Call<'a> {
    pub gateway: &'a Gateway,
    pub guest: Guest,
    pub head: &'a Head,
    pub body: &'a [u8],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JogBody {
    rpm: i32,
    hold_ms: Option<u32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ParameterBody {
    value: i32,
}

impl Call<'_> {
    /// Carries it out and sends the reply.
    pub(super) async fn answer<W: Write>(&self, reply: &mut Reply<'_, W>) -> Result<(), Fault> {
        let resource = self.resource()?;
        match resource {
            Resource::Asset(asset) => reply.asset(asset).await?,
            Resource::Axes => self.axes(reply).await?,
            Resource::Axis(name) => {
                let id = self.gateway.axes.find(name)?;
                let (error, axis) = (self.read(id).await, self.gateway.axes.get(id)?);
                reply.append(|room| json(room, &self.axis(id, axis, error))).await?;
                reply.finish().await?;
            }
            Resource::Command(name, command) => {
                let id = self.gateway.axes.find(name)?;
                self.command(id, command).await?;
                let known = self.gateway.axes.get(id)?.known();
                reply.value(&view::Commanded::new(name, known, self.gateway.axes.leased(id))).await?;
            }
            Resource::Parameter(name, parameter) => {
                let id = self.gateway.axes.find(name)?;
                let parameter = parameter.parse().map_err(Problem::Parameter)?;
                let value = self.parameter(id, parameter).await?;
                reply.value(&view::ParameterValue::new(name, parameter, value)).await?;
            }
            Resource::Buses => self.buses(reply).await?,
            Resource::Metrics => metrics::send(self.gateway, reply).await?,
        }
        Ok(())
    }

    /// What the path names, where this client may have it by this method.
    fn resource(&self) -> Result<Resource<'_>, Problem> {
        let path = self.head.path.as_deref();
        let resource = path.and_then(Resource::find);
        if self.guest.stop_only && !resource.is_some_and(|resource| resource.stops()) {
            return Err(Problem::Full);
        }
        let resource = resource.ok_or(Problem::NotFound)?;
        if !resource.takes(self.head.method) {
            return Err(Problem::Method(resource.methods()));
        }
        if self.head.foreign && matches!(self.head.method, Method::Post | Method::Put) {
            return Err(Problem::Origin);
        }
        Ok(resource)
    }

    /// HTTP users hold leases as themselves, not as one of their connections.
    fn commander(&self) -> Commander {
        let user = self.head.client.unwrap_or_else(|| hash(&self.guest.peer.ip));
        Commander { seat: self.guest.seat, holder: Holder::Http(user) }
    }

    async fn axes<W: Write>(&self, reply: &mut Reply<'_, W>) -> Result<(), Fault> {
        // All are read before any is told, so that the ages are right when the reply goes out.
        let mut errors = Vec::<_, AXES>::new();
        for (id, _) in self.gateway.axes.iter() {
            let _ = errors.push(self.read(id).await);
        }
        reply.put(format_args!("[")).await?;
        for ((id, axis), error) in self.gateway.axes.iter().zip(errors) {
            if id > 0 {
                reply.put(format_args!(",")).await?;
            }
            reply.append(|room| json(room, &self.axis(id, axis, error))).await?;
        }
        reply.put(format_args!("]")).await?;
        Ok(reply.finish().await?)
    }

    /// Reads the values of an axis anew where they are old; why that failed.
    async fn read(&self, id: u8) -> Option<AxisError> {
        self.gateway.axes.status(id, self.commander(), FRESH).await.err()
    }

    fn axis<'a>(&'a self, id: u8, axis: &'a Axis, error: Option<AxisError>) -> view::Axis<'a> {
        view::Axis::new(&view::Findings {
            now: clock::now(),
            spec: &axis.spec,
            drive: self.gateway.settings.axes.get(usize::from(id)).map_or("", |axis| axis.drive.name()),
            known: axis.known(),
            lease: self.gateway.axes.leased(id),
            event: self.gateway.axes.event(id),
            error,
        })
    }

    async fn command(&self, id: u8, command: Command) -> Result<(), Problem> {
        let (axes, by) = (&self.gateway.axes, self.commander());
        match command {
            Command::Jog => {
                let JogBody { rpm, hold_ms } = parse(self.body, "{\"rpm\": 100, \"hold_ms\": 500}")?;
                axes.jog(id, by, rpm, hold(hold_ms)?).await?;
            }
            Command::Stop => axes.stop(id, by).await?,
            Command::Enable => axes.enable(id, by).await?,
            Command::Disable => axes.disable(id, by).await?,
            Command::Clear => axes.clear(id, by).await?,
        }
        Ok(())
    }

    async fn parameter(&self, id: u8, parameter: Parameter) -> Result<u16, Problem> {
        let (axes, by) = (&self.gateway.axes, self.commander());
        if self.head.method != Method::Put {
            return Ok(axes.parameter(id, by, parameter).await?);
        }
        let ParameterBody { value } = parse(self.body, "{\"value\": 100}")?;
        let max = i32::from(u16::MAX);
        let word = u16::try_from(value).map_err(|_| AxisError::Range { value, min: 0, max })?;
        axes.set_parameter(id, by, parameter, word).await?;
        Ok(word)
    }

    async fn buses<W: Write>(&self, reply: &mut Reply<'_, W>) -> Result<(), Fault> {
        reply.put(format_args!("[")).await?;
        for (index, bus) in (0..).zip(&self.gateway.settings.buses) {
            if index > 0 {
                reply.put(format_args!(",")).await?;
            }
            reply.append(|room| open(room, &view::Bus::new(bus))).await?;
            reply.put(format_args!(",\"statistics\":")).await?;
            let statistics = || self.gateway.desk.statistics(index).unwrap_or_default();
            reply.append(|room| json(room, &view::Counted::new(&statistics()))).await?;
            reply.put(format_args!("}}")).await?;
        }
        reply.put(format_args!("]")).await?;
        Ok(reply.finish().await?)
    }
}

/// Writes an object whose end is left open, so that more members may follow.
fn open(room: &mut [u8], object: &impl Serialize) -> Option<usize> {
    json(room, object)?.checked_sub("}".len())
}

fn parse<'a, T: Deserialize<'a>>(body: &'a [u8], expected: &'static str) -> Result<T, Problem> {
    let (value, used) = serde_json_core::from_slice(body).map_err(|_| Problem::Json(expected))?;
    let rest = body.get(used..).unwrap_or_default();
    if rest.trim_ascii().is_empty() { Ok(value) } else { Err(Problem::Json(expected)) }
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
        parse::<JogBody>(body.as_bytes(), "").map(|JogBody { rpm, hold_ms }| (rpm, hold_ms))
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

    proptest::proptest! {
        #[test]
        fn any_body_is_read_without_panic(body in proptest::collection::vec(0..=255_u8, 0..64)) {
            let _ = parse::<JogBody>(&body, "");
            let _ = parse::<ParameterBody>(&body, "");
        }

        #[test]
        fn any_text_like_json_is_read_without_panic(body in "[\\[\\]{}\":,a-z0-9\\\\. u-]{0,64}") {
            let _ = jog(&body);
        }
    }
}

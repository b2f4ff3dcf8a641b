//! The answers to requests that were understood.

use embedded_io_async::Write;
use heapless::Vec;
use puente_drives::edb::Parameter;
use puente_drives::pid::Gains;
use puente_line::Duration;
use serde::Deserialize;

use super::super::system::System;
use super::super::{End, Gateway, Guest};
use super::action::Action;
use super::head::{Head, Method, hash};
use super::page::Asset;
use super::problem::Problem;
use super::reply::Reply;
use super::resource::Resource;
use super::{Fault, config, metrics, nodes, view};
use crate::axis::{AxisError, Commander};
use crate::clock;
use crate::desk::Holder;
use crate::port::journal;
use crate::port::limits::{AXES, JOURNAL_LINE};
use crate::settings::keeper::Lent;

/// Values of a drive that are not older than this are not read again.
const FRESH: Duration = Duration::from_millis(400);

// A line of the log fits an empty sheet.
const _: () = assert!(JOURNAL_LINE < super::reply::BODY);

/// What was asked for, in terms of this gateway: the request itself is not needed any more.
pub(super) enum Task {
    Asset(&'static Asset),
    Axes,
    Axis(u8),
    Command(u8, Action),
    Gains(u8),
    SetGains(u8, Gains),
    Parameter(u8, Parameter),
    SetParameter(u8, Parameter, u16),
    Group,
    Buses,
    Nodes(nodes::Task),
    System,
    Log,
    Metrics,
    Config,
    ConfigState,
    Change(Change),
}

/// What is done about the settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Change {
    /// The document on the form is put.
    Put,
    /// The factory settings are.
    Delete,
    Confirm,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GainsBody {
    kp: f32,
    ki: f32,
    kd: f32,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ParameterBody {
    value: i32,
}

/// Understands a request, where this client may have it.
pub(super) fn understand(
    gateway: &Gateway,
    guest: Guest,
    head: &Head<'_>,
    body: &[u8],
) -> Result<Task, Problem> {
    let resource = Resource::find(head.path);
    if guest.stop_only && !resource.is_some_and(|resource| resource.stops()) {
        return Err(Problem::Full);
    }
    let resource = resource.ok_or(Problem::NotFound)?;
    if !resource.takes(head.method) {
        return Err(Problem::Method(resource.methods()));
    }
    if head.foreign && matches!(head.method, Method::Post | Method::Put | Method::Delete) {
        return Err(Problem::Origin);
    }
    Ok(match resource {
        Resource::Asset(asset) => Task::Asset(asset),
        Resource::Axes => Task::Axes,
        Resource::Axis(name) => Task::Axis(gateway.axes.find(name)?),
        Resource::Command(name, command) => {
            Task::Command(gateway.axes.find(name)?, Action::read(command, body)?)
        }
        Resource::Gains(name) => {
            let id = gateway.axes.find(name)?;
            match head.method {
                Method::Put => Task::SetGains(id, gains(body)?),
                _ => Task::Gains(id),
            }
        }
        Resource::Parameter(name, parameter) => {
            let id = gateway.axes.find(name)?;
            let parameter = parameter.parse().map_err(Problem::Parameter)?;
            match head.method {
                Method::Put => Task::SetParameter(id, parameter, word(body)?),
                _ => Task::Parameter(id, parameter),
            }
        }
        Resource::Group => Task::Group,
        Resource::Buses => Task::Buses,
        Resource::Nodes(bus, path) => {
            let by = commander(guest, head);
            Task::Nodes(nodes::understand(gateway, by, bus, path, head.method, body)?)
        }
        Resource::System => Task::System,
        Resource::Log => Task::Log,
        Resource::Metrics => Task::Metrics,
        Resource::Config => match head.method {
            Method::Put => Task::Change(Change::Put),
            Method::Delete => Task::Change(Change::Delete),
            _ => Task::Config,
        },
        Resource::ConfigState => Task::ConfigState,
        Resource::Confirm => Task::Change(Change::Confirm),
    })
}

fn gains(body: &[u8]) -> Result<Gains, Problem> {
    let GainsBody { kp, ki, kd } = json(body, "{\"kp\": 0.02, \"ki\": 0.1, \"kd\": 0}")?;
    Gains::new(kp, ki, kd).map_err(Problem::Gains)
}

/// The new value of a parameter.
fn word(body: &[u8]) -> Result<u16, Problem> {
    let ParameterBody { value } = json(body, "{\"value\": 100}")?;
    let max = i32::from(u16::MAX);
    u16::try_from(value).map_err(|_| AxisError::Range { value, min: 0, max }.into())
}

/// HTTP users hold leases as themselves, not as one of their connections.
pub(super) fn commander(guest: Guest, head: &Head<'_>) -> Commander {
    let user = head.client.unwrap_or_else(|| hash(&guest.peer.ip));
    Commander { seat: guest.seat, holder: Holder::Http(user) }
}

/// Who is answered.
pub(super) struct Call<'a> {
    pub gateway: &'a Gateway,
    pub by: Commander,
}

impl Call<'_> {
    /// Carries a task out and sends the reply. A document that came with it is on the form.
    pub(super) async fn answer<W: Write>(
        &self,
        task: Task,
        form: Option<Lent<'_>>,
        reply: &mut Reply<'_, W>,
    ) -> Result<(), Fault> {
        match task {
            Task::Asset(asset) => reply.asset(asset).await?,
            Task::Axes => self.axes(reply).await?,
            Task::Axis(id) => {
                let error = self.read(id).await;
                self.axis(id, error, reply).await?;
                reply.finish().await?;
            }
            Task::Command(id, action) => {
                action.carry_out(&self.gateway.axes, id, self.by).await?;
                let axes = &self.gateway.axes;
                let commanded = view::Commanded::new(&axes.get(id)?.name, axes.known(id)?, axes.leased(id));
                reply.value(&commanded).await?;
            }
            Task::Gains(id) => {
                reply.value(&view::Gains::from(self.gateway.axes.gains(id)?)).await?;
            }
            Task::SetGains(id, gains) => {
                self.gateway.axes.set_gains(id, self.by, gains)?;
                reply.value(&view::Gains::from(gains)).await?;
            }
            Task::Parameter(id, parameter) => {
                let value = self.gateway.axes.parameter(id, self.by, parameter).await?;
                self.value(id, parameter, value, reply).await?;
            }
            Task::SetParameter(id, parameter, value) => {
                self.gateway.axes.set_parameter(id, self.by, parameter, value).await?;
                self.value(id, parameter, value, reply).await?;
            }
            Task::Group => {
                let axes = &self.gateway.axes;
                reply.value(&axes.group().map(|run| view::Group::new(axes, &run))).await?;
            }
            Task::Buses => self.buses(reply).await?,
            Task::Nodes(task) => self.nodes(task, reply).await?,
            Task::System => reply.value(&System(self.gateway)).await?,
            Task::Log => log(reply).await?,
            Task::Metrics => metrics::send(self.gateway, reply).await?,
            Task::Config => config::send(self.gateway.settings, reply).await?,
            Task::ConfigState => reply.value(&view::ConfigState::new(self.gateway.keeper)).await?,
            Task::Change(change) => config::change(self, change, form, reply).await?,
        }
        Ok(())
    }

    async fn value<W: Write>(
        &self,
        id: u8,
        parameter: Parameter,
        value: u16,
        reply: &mut Reply<'_, W>,
    ) -> Result<(), Fault> {
        let name = &self.gateway.axes.get(id)?.name;
        Ok(reply.value(&view::ParameterValue::new(name, parameter, value)).await?)
    }

    async fn axes<W: Write>(&self, reply: &mut Reply<'_, W>) -> Result<(), Fault> {
        // All are read before any is told, so that the ages are right when the reply goes out.
        let mut errors = Vec::<_, AXES>::new();
        for (id, _) in self.gateway.axes.iter() {
            let _ = errors.push(self.read(id).await);
        }
        reply.put(format_args!("[")).await?;
        for (id, error) in (0..).zip(&errors) {
            if id > 0 {
                reply.put(format_args!(",")).await?;
            }
            self.axis(id, *error, reply).await?;
        }
        reply.put(format_args!("]")).await?;
        Ok(reply.finish().await?)
    }

    /// Reads the values of an axis anew where they are old; why that failed.
    async fn read(&self, id: u8) -> Option<AxisError> {
        self.gateway.axes.status(id, self.by, FRESH).await.err()
    }

    async fn axis<W: Write>(
        &self,
        id: u8,
        error: Option<AxisError>,
        reply: &mut Reply<'_, W>,
    ) -> Result<(), Fault> {
        let view = self.view(id, error)?;
        Ok(reply.json(&view).await?)
    }

    fn view(&self, id: u8, error: Option<AxisError>) -> Result<view::Axis<'_>, AxisError> {
        let axes = &self.gateway.axes;
        Ok(view::Axis::new(&view::Findings {
            now: clock::now(),
            axis: axes.get(id)?,
            known: axes.known(id)?,
            lease: axes.leased(id),
            event: axes.event(id),
            error,
        }))
    }

    async fn buses<W: Write>(&self, reply: &mut Reply<'_, W>) -> Result<(), Fault> {
        reply.put(format_args!("[")).await?;
        for (index, bus) in (0..).zip(&self.gateway.settings.buses) {
            if index > 0 {
                reply.put(format_args!(",")).await?;
            }
            let desk = self.gateway.desk;
            let statistics = desk.statistics(index).unwrap_or_default();
            let cycles = desk.cycles(index).unwrap_or_default();
            let can = desk.can_statistics(clock::now(), index).unwrap_or_default();
            reply.json(&view::Bus::new(bus, &statistics, &cycles, desk.line_down(index), &can)).await?;
        }
        reply.put(format_args!("]")).await?;
        Ok(reply.finish().await?)
    }
}

/// The recent lines of the log, up to the one that was the last when it was asked for.
async fn log<W: Write>(reply: &mut Reply<'_, W>) -> Result<(), End> {
    reply.content_type("text/plain; charset=utf-8");
    let (mut mark, end) = (journal::Mark::default(), journal::end());
    while mark < end {
        reply.take(|room| journal::read(&mut mark, room)).await?;
    }
    reply.finish().await
}

pub(super) fn json<'a, T: Deserialize<'a>>(body: &'a [u8], expected: &'static str) -> Result<T, Problem> {
    let (value, used) = serde_json_core::from_slice(body).map_err(|_| Problem::Json(expected))?;
    nothing_after(body, used, expected)?;
    Ok(value)
}

/// Whether so many bytes are all of a body.
pub(super) fn nothing_after(body: &[u8], used: usize, expected: &'static str) -> Result<(), Problem> {
    let rest = body.get(used..).unwrap_or_default();
    if rest.trim_ascii().is_empty() { Ok(()) } else { Err(Problem::Json(expected)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    proptest::proptest! {
        #[test]
        fn any_body_is_read_without_panic(body in proptest::collection::vec(0..=255_u8, 0..64)) {
            let _ = json::<ParameterBody>(&body, "");
        }

    }
}

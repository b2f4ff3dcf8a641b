//! The settings: read, put, and confirmed.

use embedded_io_async::{Read, Write};
use serde::Serialize;

use super::super::End;
use super::super::inbox::Inbox;
use super::api::{Call, Change};
use super::problem::Problem;
use super::reply::Reply;
use super::{Fault, view};
use crate::settings::Settings;
use crate::settings::keeper::{Lent, Refusal};

impl From<Refusal> for Fault {
    /// What is wrong with a document is told in its own words before.
    fn from(refusal: Refusal) -> Self {
        Fault::Problem(match refusal {
            Refusal::Text(error) => Problem::Document(error),
            Refusal::ReadOnly => Problem::ReadOnly,
            Refusal::OnTrial => Problem::OnTrial,
            Refusal::NoTrial => Problem::NoTrial,
            Refusal::Moving => Problem::Moving,
            Refusal::Settings(_) | Refusal::Flash => Problem::Flash,
        })
    }
}

/// Receives a document of `length` bytes onto the form, which has room for it.
pub(super) async fn receive<'k, R: Read>(
    mut form: Lent<'k>,
    inbox: &mut Inbox<'_, R>,
    length: usize,
) -> Result<Lent<'k>, Fault> {
    loop {
        let missing = length - form.length();
        let here = inbox.data().len().min(missing);
        let count = form.append(inbox.data().get(..here).unwrap_or_default());
        inbox.consume(count);
        if count == missing {
            return Ok(form);
        }
        if inbox.ended() {
            return Err(Problem::Request("the request ends too early").into());
        }
        inbox.fill().await?;
    }
}

/// Sends the document. In pieces, for it may be longer than a sheet.
pub(super) async fn send<W: Write>(settings: &Settings, reply: &mut Reply<'_, W>) -> Result<(), End> {
    reply.put(format_args!("{{\"version\":{},\"net\":", settings.version)).await?;
    reply.json(&settings.net).await?;
    list(reply, "bus", &settings.buses).await?;
    list(reply, "axis", &settings.axes).await?;
    list(reply, "node", &settings.nodes).await?;
    reply.put(format_args!("}}")).await?;
    reply.finish().await
}

async fn list<W: Write>(reply: &mut Reply<'_, W>, key: &str, values: &[impl Serialize]) -> Result<(), End> {
    reply.put(format_args!(",\"{key}\":[")).await?;
    for (index, value) in values.iter().enumerate() {
        reply.put(format_args!("{}", if index > 0 { "," } else { "" })).await?;
        reply.json(value).await?;
    }
    reply.put(format_args!("]")).await
}

/// Changes the settings, where nobody's motion ends by it.
pub(super) async fn change<W: Write>(
    call: &Call<'_>,
    change: Change,
    form: Option<Lent<'_>>,
    reply: &mut Reply<'_, W>,
) -> Result<(), Fault> {
    let keeper = call.gateway.keeper;
    let mut form = form.or_else(|| keeper.lend()).ok_or(Problem::Busy)?;
    let drafted = match change {
        Change::Put => form.draft(call.gateway.settings),
        Change::Delete => form.draft_factory(call.gateway.settings),
        Change::Confirm => {
            form.confirm().await?;
            return Ok(reply.value(&view::ConfigState::new(keeper)).await?);
        }
    };
    let on_trial = match drafted {
        Err(Refusal::Settings(problem)) => return Ok(reply.bad_settings(&problem).await?),
        drafted => drafted?,
    };
    if call.gateway.axes.turning(call.by).await {
        return Err(Problem::Moving.into());
    }
    form.adopt().await?;
    reply.manner.keep_alive = false;
    reply.value(&view::Changed::new(on_trial)).await?;
    Err(End::Restart.into())
}

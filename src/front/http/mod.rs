//! HTTP/1.1: the page at `/`, the JSON interface under `/api`, and `/metrics`. docs/http.md tells what they say.

mod api;
mod head;
mod metrics;
mod page;
mod problem;
mod reply;
mod resource;
mod status;
mod view;

use embassy_time::{Duration, with_timeout};
use embedded_io_async::{Read, Write};
use heapless::Vec;

use super::inbox::Inbox;
use super::{End, Gateway, Guest, idle};
use api::Call;
use head::{Head, MAX_BODY, Method};
use problem::Problem;
use reply::{Manner, Reply};

/// A request that has begun must be whole within this time.
const WHOLE: Duration = Duration::from_secs(5);

/// Why a request is not answered as asked.
#[derive(Debug)]
enum Fault {
    /// The visit is over.
    End(End),
    /// It is refused.
    Problem(Problem),
}

impl From<End> for Fault {
    fn from(end: End) -> Self {
        Fault::End(end)
    }
}

impl<P: Into<Problem>> From<P> for Fault {
    fn from(problem: P) -> Self {
        Fault::Problem(problem.into())
    }
}

/// Answers one request after the other.
pub(super) async fn serve<R: Read, W: Write>(
    gateway: &Gateway,
    guest: Guest,
    mut inbox: Inbox<'_, R>,
    mut writer: W,
) -> End {
    loop {
        match exchange(gateway, guest, &mut inbox, &mut writer).await {
            Ok(()) => {}
            Err(end) => return end,
        }
    }
}

/// One request and its reply. An error ends the visit.
async fn exchange<R: Read, W: Write>(
    gateway: &Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
) -> Result<(), End> {
    await_request(gateway, inbox).await?;
    let request = with_timeout(WHOLE, read(inbox, writer)).await.unwrap_or(Err(Problem::Timeout.into()));
    let (head, body) = match request {
        Ok(request) => request,
        Err(Fault::End(end)) => return Err(end),
        Err(Fault::Problem(problem)) => {
            // Where the next request begins is unknown.
            let manner = Manner { chunks: true, body: true, keep_alive: false };
            Reply::new(writer, manner).problem(&problem).await?;
            return Err(End::Refused);
        }
    };
    let manner = Manner {
        chunks: head.chunks,
        body: head.method != Method::Head,
        keep_alive: head.keep_alive && !guest.stop_only,
    };
    let mut reply = Reply::new(writer, manner);
    match (Call { gateway, guest, head: &head, body: &body }).answer(&mut reply).await {
        Ok(()) => {}
        Err(Fault::End(end)) => return Err(end),
        Err(Fault::Problem(problem)) => reply.problem(&problem).await?,
    }
    if reply.manner.keep_alive { Ok(()) } else { Err(End::Closed) }
}

async fn await_request<R: Read>(gateway: &Gateway, inbox: &mut Inbox<'_, R>) -> Result<(), End> {
    while inbox.data().is_empty() {
        if inbox.ended() {
            return Err(End::Closed);
        }
        with_timeout(idle(gateway), inbox.fill()).await.unwrap_or(Err(End::Idle))?;
    }
    Ok(())
}

async fn read<R: Read, W: Write>(
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
) -> Result<(Head, Vec<u8, MAX_BODY>), Fault> {
    let head = loop {
        if let Some((head, length)) = Head::parse(inbox.data())? {
            inbox.consume(length);
            break head;
        }
        if inbox.full() {
            return Err(Problem::HeadTooLarge.into());
        }
        more(inbox).await?;
    };
    if head.expects_continue && inbox.data().len() < head.body {
        reply::send(writer, b"HTTP/1.1 100 Continue\r\n\r\n").await?;
    }
    let body = loop {
        if let Some(body) = inbox.data().get(..head.body) {
            break Vec::from_slice(body).unwrap_or_default();
        }
        more(inbox).await?;
    };
    inbox.consume(head.body);
    Ok((head, body))
}

async fn more<R: Read>(inbox: &mut Inbox<'_, R>) -> Result<(), Fault> {
    if inbox.ended() {
        return Err(Problem::Request("the request ends too early").into());
    }
    Ok(inbox.fill().await?)
}

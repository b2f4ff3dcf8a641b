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

use super::inbox::Inbox;
use super::{End, Gateway, Guest, idle};
use api::Call;
use head::{Head, Method};
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
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
) -> End {
    loop {
        if let Err(end) = exchange(gateway, guest, inbox, writer).await {
            return end;
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
    let head = match with_timeout(WHOLE, read(inbox, writer)).await.unwrap_or(Err(Problem::Timeout.into())) {
        Ok(head) => head,
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
    let body = inbox.data().get(..head.body).unwrap_or_default();
    match (Call { gateway, guest, head: &head, body }).answer(&mut reply).await {
        Ok(()) => {}
        Err(Fault::End(end)) => return Err(end),
        Err(Fault::Problem(problem)) => reply.problem(&problem).await?,
    }
    inbox.consume(head.body);
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

/// Reads the head, and waits until all of the body is in the inbox.
async fn read<R: Read, W: Write>(inbox: &mut Inbox<'_, R>, writer: &mut W) -> Result<Head, Fault> {
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
    while inbox.data().len() < head.body {
        more(inbox).await?;
    }
    Ok(head)
}

async fn more<R: Read>(inbox: &mut Inbox<'_, R>) -> Result<(), Fault> {
    if inbox.ended() {
        return Err(Problem::Request("the request ends too early").into());
    }
    Ok(inbox.fill().await?)
}

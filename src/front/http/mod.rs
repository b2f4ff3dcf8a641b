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
use super::{End, Gateway, Guest, idle, send};
use crate::axis::Commander;
use api::{Call, Task};
use head::{Head, Method};
use problem::Problem;
pub use reply::Sheets;
use reply::{Manner, Reply};

/// A request that has begun must be whole within this time.
const WHOLE: Duration = Duration::from_secs(5);

/// A browser leaves connections open that it does not need, so they are closed sooner than others.
const KEPT_OPEN: Duration = Duration::from_secs(15);

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
        match exchange(gateway, guest, inbox, writer).await {
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
    let taken = with_timeout(WHOLE, take(gateway, guest, inbox, writer)).await;
    let Request { manner, by, task } = match taken.unwrap_or(Err(Problem::Timeout.into())) {
        Ok(request) => request,
        Err(Fault::End(end)) => return Err(end),
        Err(Fault::Problem(problem)) => {
            // Where the next request begins is unknown.
            let manner = Manner { chunks: true, body: true, keep_alive: false };
            Reply::new(writer, &gateway.sheets, manner).problem(&problem).await?;
            return Err(End::Refused);
        }
    };
    let mut reply = Reply::new(writer, &gateway.sheets, manner);
    let answered = match task {
        Ok(task) => (Call { gateway, by }).answer(task, &mut reply).await,
        Err(problem) => Err(problem.into()),
    };
    match answered {
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
        with_timeout(idle(gateway).min(KEPT_OPEN), inbox.fill()).await.unwrap_or(Err(End::Idle))?;
    }
    Ok(())
}

/// A request that has arrived in whole.
struct Request {
    manner: Manner,
    by: Commander,
    task: Result<Task, Problem>,
}

/// How far a request has come.
enum Progress {
    /// It has so many bytes.
    Whole(Request, usize),
    /// Its client waits for leave to send the body.
    Expecting,
    /// More is to come.
    Partial,
}

/// Takes the next request out of the inbox as soon as it is whole.
async fn take<R: Read, W: Write>(
    gateway: &Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
) -> Result<Request, Fault> {
    let mut encouraged = false;
    loop {
        match progress(gateway, guest, inbox.data())? {
            Progress::Whole(request, length) => {
                inbox.consume(length);
                return Ok(request);
            }
            Progress::Expecting if !encouraged => {
                encouraged = true;
                send(writer, b"HTTP/1.1 100 Continue\r\n\r\n").await?;
            }
            Progress::Expecting | Progress::Partial => {}
        }
        if inbox.full() {
            return Err(Problem::HeadTooLarge.into());
        }
        if inbox.ended() {
            return Err(Problem::Request("the request ends too early").into());
        }
        inbox.fill().await?;
    }
}

fn progress(gateway: &Gateway, guest: Guest, data: &[u8]) -> Result<Progress, Problem> {
    let Some((head, length)) = Head::parse(data)? else {
        return Ok(Progress::Partial);
    };
    let whole = length + head.body;
    let Some(body) = data.get(length..whole) else {
        return Ok(if head.expects_continue { Progress::Expecting } else { Progress::Partial });
    };
    let manner = Manner {
        chunks: head.chunks,
        body: head.method != Method::Head,
        keep_alive: head.keep_alive && !guest.stop_only,
    };
    let task = api::understand(gateway, guest, &head, body);
    Ok(Progress::Whole(Request { manner, by: api::commander(guest, &head), task }, whole))
}

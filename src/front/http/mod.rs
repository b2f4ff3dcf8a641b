//! HTTP/1.1: the page at `/`, the JSON interface under `/api`, and `/metrics`. docs/http.md tells what they say.

mod action;
mod api;
mod config;
mod head;
mod metrics;
mod nodes;
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
use crate::settings::keeper::{DOCUMENT, Lent};
use api::{Call, Task};
use head::{Head, MAX_BODY, Method};
use problem::Problem;
pub(super) use reply::Lent as Sheet;
pub use reply::Sheets;
use reply::{Manner, Reply};
use resource::Resource;

/// A request that has begun must be whole within this time.
const WHOLE: Duration = Duration::from_secs(5);

/// A browser leaves connections open that it does not need, so they are closed sooner than others.
const KEPT_OPEN: Duration = Duration::from_secs(15);

const CONTINUE: &[u8] = b"HTTP/1.1 100 Continue\r\n\r\n";

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
    let Request { manner, by, task, form } = match taken.unwrap_or(Err(Problem::Timeout.into())) {
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
        Ok(task) => (Call { gateway, by }).answer(task, form, &mut reply).await,
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
struct Request<'g> {
    manner: Manner,
    by: Commander,
    task: Result<Task, Problem>,
    /// With the settings document, where one came with it.
    form: Option<Lent<'g>>,
}

/// How far a request has come.
enum Progress {
    /// It has so many bytes.
    Whole(Request<'static>, usize),
    /// It has so many bytes, and a document of so many follows, which is taken as it comes, and for which its client may
    /// wait for leave.
    Document(Request<'static>, usize, usize, bool),
    /// Its client waits for leave to send the body.
    Expecting,
    /// More is to come.
    Partial,
}

/// Takes the next request out of the inbox as soon as it is whole.
async fn take<'g, R: Read, W: Write>(
    gateway: &'g Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
) -> Result<Request<'g>, Fault> {
    let mut encouraged = false;
    loop {
        match progress(gateway, guest, inbox.data())? {
            Progress::Whole(request, length) => {
                inbox.consume(length);
                return Ok(request);
            }
            Progress::Document(request, head, body, expecting) => {
                let task = request.task?;
                inbox.consume(head);
                if expecting {
                    send(writer, CONTINUE).await?;
                }
                if let Task::Nodes(nodes::Task::Upload(whose)) = task {
                    let task = nodes::receive(gateway, whose, inbox, body).await?.map(Task::Nodes);
                    return Ok(Request { task, ..request });
                }
                let form = gateway.keeper.lend().ok_or(Problem::Busy)?;
                let form = Some(config::receive(form, inbox, body).await?);
                return Ok(Request { task: Ok(task), form, ..request });
            }
            Progress::Expecting if !encouraged => {
                encouraged = true;
                send(writer, CONTINUE).await?;
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
    let manner = Manner {
        chunks: head.chunks,
        body: head.method != Method::Head,
        keep_alive: head.keep_alive && !guest.stop_only,
    };
    let request = |body| Request {
        manner,
        by: api::commander(guest, &head),
        task: api::understand(gateway, guest, &head, body),
        form: None,
    };
    let document = match Resource::find(head.path) {
        _ if head.method != Method::Put => None,
        Some(Resource::Config) => Some(DOCUMENT),
        Some(Resource::Nodes(_, nodes::Path::Sheet(_))) => Some(nodes::EDS),
        _ => None,
    };
    let most = document.unwrap_or(MAX_BODY);
    if head.body > most {
        return Err(Problem::BodyTooLarge(most));
    }
    if document.is_some() {
        return Ok(Progress::Document(request(&[]), length, head.body, head.expects_continue));
    }
    let whole = length + head.body;
    Ok(match data.get(length..whole) {
        Some(body) => Progress::Whole(request(body), whole),
        None if head.expects_continue => Progress::Expecting,
        None => Progress::Partial,
    })
}

//! Async pumps: one task drives one sans-io master over one port.
//!
//! A pump takes its jobs from whoever implements [`Work`]; it knows nothing of clients.

pub mod canopen;
pub mod framed;
pub mod modbus;

use puente_drives::pid::Event;
use puente_line::Instant;
use puente_modbus::Outcome;
use puente_modules::master::{Output, Statistics};
use puente_modules::{Control, Report};

/// One request for the wire.
pub struct Job {
    /// What [`Work::finish`] is to be told.
    pub ticket: Ticket,
    /// Modbus address, 0 for a broadcast.
    pub unit: u8,
    /// What it need not wait for.
    pub haste: Haste,
}

/// What a job need not wait for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Haste {
    /// It waits for everything.
    None,
    /// It goes to a slave whose late reply is still waited for.
    InQuarantineToo,
}

/// Names a job between [`Work::next`] and [`Work::finish`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ticket(pub u16);

/// What there is to do.
pub enum Next {
    /// Send this.
    Job(Job),
    /// Nothing before this moment, or before [`Work::changed`].
    Wait(Option<Instant>),
}

/// How a job ended.
pub enum End<'a> {
    /// The master's verdict.
    Master(Outcome<'a>),
    /// The port is not there; nothing was sent.
    NotSent,
    /// The port failed while the request was being written: it may be on the wire, in part or whole.
    LineDown,
}

/// Where a pump gets its jobs, and tells how they ended.
pub trait Work {
    /// The next job whose unit may be addressed at `now`; `ready_at` tells from when on a unit may be.
    fn next(&self, now: Instant, ready_at: impl Fn(u8, Haste) -> Instant) -> Next;
    /// Shows the function code and data of a job.
    fn request<R>(&self, ticket: Ticket, f: impl FnOnce(&[u8]) -> R) -> R;
    /// Resolves when a job was added since the last call.
    async fn changed(&self);
    /// A job has ended.
    fn finish(&self, now: Instant, ticket: Ticket, end: End<'_>);
    /// What the master has counted so far.
    fn counted(&self, counters: puente_modbus::Counters);
    /// A sign of life: the pump gives the next one before `until`, or it hangs.
    fn alive(&self, until: Instant);
}

/// Frames of clients, which go on a framed bus beside what the master itself says.
pub trait Post {
    /// Shows the frame that waits for the line, if there is one and it may still go; `take` tells whether the master has
    /// taken it. To be called after [`Image::changed`], and whenever the master may take one.
    fn outgoing(&self, now: Instant, take: impl FnOnce(&[u8]) -> Taken);
    /// What has become of the frame that was taken last.
    fn posted(&self, outcome: Result<(), Undelivered>);
    /// A whole frame that is none of the master's own business.
    fn heard(&self, frame: &[u8]);
}

/// Whether a frame was taken for the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken {
    /// It was.
    Yes,
    /// It will be, when it is shown again.
    NotYet,
    /// It will never be.
    Never(Undelivered),
}

/// Why a client's frame was not sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Undelivered {
    /// The line did not take it.
    Line(puente_framed::arbiter::Failure),
    /// The port is not there, or failed.
    LineDown,
    /// It is longer than this gateway's frames may be.
    TooLong,
    /// A stop, or the end of the lease, came first.
    Stopped,
}

/// Where the pump of a cyclic bus finds what shall be, and tells what is. An axis is named by its place in the order of
/// the bus.
pub trait Image {
    /// What a drive is told.
    type Output;
    /// What it says.
    type Report;
    /// What is left of what was wanted of it.
    type Fall;

    /// Shows what is wanted of each axis now; until when, where motion ends by itself.
    fn outputs(&self, now: Instant, set: impl FnMut(usize, Self::Output)) -> Option<Instant>;
    /// An axis has reported; `current` if that answers what was shown last.
    fn reported(&self, now: Instant, place: usize, report: Self::Report, current: bool);
    /// What was wanted of an axis is not any more: it has lost its current by itself, or another has stopped it.
    fn fell(&self, now: Instant, place: usize, fall: Self::Fall);
    /// Resolves when what is wanted has changed since the last call.
    async fn changed(&self);
    /// Whether the port has failed.
    fn line(&self, down: bool);
    /// A sign of life: the pump gives the next one before `until`, or it hangs.
    fn alive(&self, until: Instant);
}

/// The [`Image`] of a framed bus, whose axes are PID modules.
pub trait Cycles: Image<Output = Output, Report = Report, Fall = Control> {
    /// An axis has told an event.
    fn happened(&self, place: usize, event: Event);
    /// What the master has counted so far.
    fn counted(&self, statistics: Statistics);
}

//! Async pumps: one task drives one sans-io master over one port.
//!
//! A pump takes its jobs from whoever implements [`Work`]; it knows nothing of clients.

pub mod modbus;

use puente_line::Instant;
use puente_modbus::{Outcome, Pdu};

/// One request for the wire.
pub struct Job {
    /// What [`Work::finish`] is to be told.
    pub ticket: Ticket,
    /// Modbus address, 0 for a broadcast.
    pub unit: u8,
    /// What it need not wait for.
    pub haste: Haste,
    /// Function code and data.
    pub pdu: Pdu,
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
#[allow(clippy::large_enum_variant, reason = "there is no heap, and it lives for a moment")]
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
    /// Resolves when a job was added since the last call.
    async fn changed(&self);
    /// A job has ended.
    fn finish(&self, now: Instant, ticket: Ticket, end: End<'_>);
    /// What the master has counted so far.
    fn counted(&self, counters: puente_modbus::Counters);
    /// A sign of life: the pump gives the next one before `until`, or it hangs.
    fn alive(&self, until: Instant);
}

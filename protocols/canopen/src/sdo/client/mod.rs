//! The client of one SDO server.

mod control;
mod download;
mod types;
mod upload;
mod work;

use heapless::Vec;
use puente_line::Instant;

pub use types::{Action, Busy, Config, Counters, Failure, Outcome, Transfer};

use super::{Abort, MAX_BLOCK, Request, Response, SEGMENT};
use crate::{Address, Frame, Id, NodeId};
use download::Download;
use upload::Upload;
use work::{Next, Step, Work};

/// The client of one SDO server: one transfer at a time, of any length, in any of the three protocols.
///
/// The data are the caller's: bytes to write are asked for as they are needed ([`Action::Fetch`]), bytes read are given as
/// they come ([`Action::Data`]), so that nothing here is as long as an object.
///
/// What keeps a response from being paired with another transfer: the object's address where a response has it, the
/// toggle bit, the sequence number, the CRC and the announced size; and after a response that did not come, a
/// [quarantine](Config::quarantine). Responses that do not fit are counted and passed over, for the true one may follow.
///
/// What is lost of a block is sent again (7.2.4.3.10, 7.2.4.3.14). A lost acknowledgement of a block that was *read* is
/// repeated, where CRC or size tell in the end whether that was right. One of a block that is *written* cannot be asked for
/// again: after a time-out the last segment is repeated, then the whole block, which makes a server that lacks something of
/// it acknowledge what it has. One that has acknowledged already has nothing to say, and the protocol has no way to tell
/// where it stands: such a transfer ends with [`Failure::Position`], at once or, where there is a CRC, at its end.
#[derive(Clone, Debug)]
pub struct Client {
    config: Config,
    /// COB-ID of what is sent.
    request: u16,
    /// COB-ID of what is heard.
    response: u16,
    state: State,
    address: Address,
    work: Work,
    /// When the response that is waited for is overdue.
    deadline: Instant,
    retries: u8,
    /// Something was asked again, and may be answered twice.
    repeated: bool,
    /// Nothing is sent that brings data.
    paused: bool,
    heard: Option<u8>,
    /// Told to the server before anything else.
    abort: Option<(Address, Abort)>,
    /// Bytes read that have not been given.
    portion: Vec<u8, SEGMENT>,
    quiet_until: Instant,
    /// The next message of the server ends the quarantine.
    owes_one: bool,
    counters: Counters,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Idle,
    /// Nothing has been sent.
    Queued,
    /// Something is to be sent.
    Ready,
    /// A response is due.
    Waiting,
    /// Nothing is sent until then: what the server says must die out.
    Settling {
        until: Instant,
    },
    /// The outcome has not been fetched.
    Finished(Result<Outcome, Failure>),
}

impl Client {
    /// A client of the first SDO server of a node.
    pub const fn new(node: NodeId, config: Config) -> Self {
        Self::with_ids(node.sdo_request(), node.sdo_response(), config)
    }

    /// A client of a server with other COB-IDs: those of what it is told, and of what it says.
    pub const fn with_ids(request: u16, response: u16, config: Config) -> Self {
        Self {
            config,
            request,
            response,
            state: State::Idle,
            address: Address::new(0, 0),
            work: Work::Upload(Upload::new(false)),
            deadline: Instant::ZERO,
            retries: 0,
            repeated: false,
            paused: false,
            heard: None,
            abort: None,
            portion: Vec::new(),
            quiet_until: Instant::ZERO,
            owes_one: false,
            counters: Counters {
                transfers: 0,
                completed: 0,
                aborted: 0,
                timeouts: 0,
                repeated: 0,
                late: 0,
                unpaired: 0,
            },
        }
    }

    /// Changes how the channel is worked, from the next response on.
    pub const fn set_config(&mut self, config: Config) {
        self.config = config;
    }

    /// Takes a transfer.
    ///
    /// # Errors
    /// `Busy` until the outcome of the last one has been fetched.
    pub fn submit(&mut self, transfer: Transfer) -> Result<(), Busy> {
        if self.state != State::Idle {
            return Err(Busy);
        }
        self.address = transfer.address();
        self.work = match transfer {
            Transfer::Upload { block, .. } => Work::Upload(Upload::new(block)),
            Transfer::Download { size, block, .. } => Work::Download(Download::new(size, block)),
        };
        self.retries = 0;
        self.repeated = false;
        self.paused = false;
        self.heard = None;
        self.portion.clear();
        self.state = State::Queued;
        Ok(())
    }

    /// Whether a transfer is in work or its outcome not fetched.
    pub fn is_busy(&self) -> bool {
        self.state != State::Idle
    }

    /// The bytes that [`Action::Fetch`] asks for. Fewer end the transfer with [`Failure::Supply`].
    pub fn supply(&mut self, now: Instant, bytes: &[u8]) {
        if let (State::Queued | State::Ready, Work::Download(download)) = (self.state, &mut self.work)
            && !download.supply(bytes)
        {
            self.give_up(now, Failure::Supply);
        }
    }

    /// Takes a frame of the bus.
    pub fn receive(&mut self, now: Instant, frame: &Frame) {
        let Some(data) = frame.data_of(self.response) else {
            return;
        };
        self.elapse(now);
        let expecting = match self.state {
            State::Waiting => true,
            // An acknowledgement may come early.
            State::Ready | State::Settling { .. } => matches!(self.work, Work::Download(_)),
            State::Idle | State::Queued | State::Finished(_) => false,
        };
        if !expecting {
            count(&mut self.counters.late);
            if self.owes_one {
                self.owes_one = false;
                self.quiet_until = now;
            }
            return;
        }
        let step = match self.take_abort(data) {
            Some(step) => step,
            None => match &mut self.work {
                Work::Upload(upload) => {
                    upload.receive(&self.config, self.address, data, &mut self.portion, &mut self.counters)
                }
                Work::Download(download) => {
                    let sending = self.state != State::Waiting;
                    download.receive(self.address, data, sending, &mut self.counters)
                }
            },
        };
        self.follow(now, step, data);
    }

    /// What the transfer has brought: [`Action::Data`] or [`Action::Done`]. For a caller that can send nothing now.
    pub fn brought(&mut self, now: Instant) -> Option<Action> {
        self.elapse(now);
        if !self.portion.is_empty() {
            return Some(Action::Data(core::mem::take(&mut self.portion)));
        }
        let State::Finished(end) = self.state else {
            return None;
        };
        self.state = State::Idle;
        Some(Action::Done(end))
    }

    /// What to do now.
    pub fn poll(&mut self, now: Instant) -> Action {
        self.elapse(now);
        if let Some((address, code)) = self.abort.take() {
            return Action::Transmit(self.frame(Request::Abort { address, code }.to_bytes()));
        }
        if let Some(brought) = self.brought(now) {
            return brought;
        }
        match self.state {
            State::Queued if now >= self.quiet_until => {
                let action = self.send(now);
                if self.state != State::Queued {
                    count(&mut self.counters.transfers);
                }
                action
            }
            State::Ready if !self.is_held() => self.send(now),
            _ => Action::Idle,
        }
    }

    /// When to poll again, besides after `submit`, `receive`, `supply` and `cancel`.
    pub fn poll_at(&self) -> Option<Instant> {
        if self.abort.is_some() || !self.portion.is_empty() {
            return Some(Instant::ZERO);
        }
        match self.state {
            State::Idle => None,
            State::Queued => Some(self.quiet_until),
            State::Ready if self.is_held() => None,
            State::Ready | State::Finished(_) => Some(Instant::ZERO),
            State::Waiting => Some(self.deadline),
            State::Settling { until } => Some(until),
        }
    }

    /// What has happened since start-up.
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    const fn is_held(&self) -> bool {
        self.paused && self.work.brings_data()
    }

    fn frame(&self, bytes: [u8; 8]) -> Frame {
        Frame::full(Id::base(self.request), bytes)
    }

    fn send(&mut self, now: Instant) -> Action {
        let next = match &mut self.work {
            Work::Upload(upload) => upload.next(&self.config, self.address),
            Work::Download(download) => download.next(self.address),
        };
        let bytes = match next {
            Next::Message(request) => request.to_bytes(),
            Next::Segment(segment) => segment.to_bytes(),
            Next::Fetch { offset, count } => return Action::Fetch { offset, count },
        };
        self.state = match &self.work {
            // The rest of a block goes out without waiting; the end of an upload has no response.
            Work::Download(download) if download.is_sending() => State::Ready,
            Work::Upload(upload) if upload.is_over() => {
                count(&mut self.counters.completed);
                State::Finished(upload.outcome())
            }
            _ => State::Waiting,
        };
        self.deadline = now + self.config.timeout;
        Action::Transmit(self.frame(bytes))
    }

    /// An abort of the server. One of another object belongs to another transfer: zencan-node 0.0.5 aborts 0000h:0 after
    /// each block upload, in answer to its end.
    fn take_abort(&mut self, data: &[u8]) -> Option<Step> {
        let &[first, ..] = data else {
            return None;
        };
        let Ok(Response::Abort { address, code }) = Response::parse(data) else {
            return None;
        };
        // In a block upload only this one byte is an abort; others are segments.
        if self.work.hears_segments() && first != 0x80 {
            return None;
        }
        Some(if address == self.address {
            Step::End(Err(self.work.aborted(code, self.heard)))
        } else {
            Step::Foreign
        })
    }

    fn follow(&mut self, now: Instant, step: Step, data: &[u8]) {
        match step {
            Step::Send => {
                self.retries = 0;
                self.state = State::Ready;
            }
            Step::Again if self.retries >= self.config.retries => self.give_up(now, Failure::Stuck),
            Step::Again => {
                self.retries += 1;
                self.state = State::Ready;
            }
            Step::Wait => {
                self.retries = 0;
                self.deadline = now + self.config.timeout;
            }
            Step::Skip => self.deadline = now + self.config.timeout,
            Step::Settle { progress } => {
                if !matches!(self.state, State::Settling { .. }) {
                    if !progress && self.retries >= self.config.retries {
                        return self.give_up(now, Failure::Stuck);
                    }
                    self.retries = if progress { 0 } else { self.retries + 1 };
                }
                self.state = State::Settling { until: now + SETTLE };
            }
            Step::Foreign => {
                count(&mut self.counters.unpaired);
                self.heard = data.first().copied();
            }
            Step::End(Err(Failure::Aborted(code))) => {
                count(&mut self.counters.aborted);
                self.state = State::Finished(Err(Failure::Aborted(code)));
            }
            Step::End(Err(failure)) => self.give_up(now, failure),
            Step::End(Ok(outcome)) => {
                count(&mut self.counters.completed);
                self.state = State::Finished(Ok(outcome));
            }
        }
    }

    fn elapse(&mut self, now: Instant) {
        if let State::Settling { until } = self.state
            && now >= until
        {
            self.state = State::Ready;
        }
        if self.state != State::Waiting || now < self.deadline {
            return;
        }
        self.retries = self.retries.saturating_add(1);
        let again = self.retries <= self.config.retries
            && match &mut self.work {
                Work::Upload(upload) => upload.again(),
                Work::Download(download) => download.again(),
            };
        if again {
            self.repeated = true;
            self.state = State::Ready;
            return;
        }
        count(&mut self.counters.timeouts);
        self.give_up(self.deadline, Failure::Timeout { heard: self.heard });
    }

    /// Ends the transfer and tells the server.
    fn give_up(&mut self, now: Instant, failure: Failure) {
        let known = self.state != State::Queued;
        self.portion.clear();
        if known {
            self.abort = Some((self.address, failure.code()));
            self.quiet_until = now + self.config.quarantine;
            // Of a block more may come.
            self.owes_one = !self.work.is_block();
        }
        self.state = State::Finished(Err(failure));
    }
}

/// How long sending waits after an acknowledgement that came early: what is under way must have arrived.
const SETTLE: core::time::Duration = core::time::Duration::from_millis(10);

fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}

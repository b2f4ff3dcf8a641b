//! Frames between clients and the first framed bus.
//!
//! Clients take turns to put a frame into the one outgoing place, in the order in which they came, and keep it until they
//! know what has become of the frame. What is heard on the bus for any address that a client has given as its own is kept
//! in a ring, which each client follows at its own pace; who is too slow is told how much it has lost.

mod heard;

use core::future::poll_fn;
use core::num::NonZeroU32;
use core::task::Poll;

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::mutex::{Mutex, MutexGuard};
use heapless::Vec;
use puente_framed::frame::{HEADER, MAX_FRAME};
use puente_framed::section::{NOBODY, Section, Sections, TRAILER};
use puente_line::Instant;

use super::seats::Seats;
use super::turn::{self, Which};
use super::{BusImage, Desk, Modules, Permits, State, Units};
use crate::bus::{Post, Taken, Undelivered};
use heard::{Heard, Mark, Next};

/// Bytes of a frame after its packet.
const AFTER: usize = 2;

/// The bytes of a frame.
pub type Frame = Vec<u8, MAX_FRAME>;
/// The outgoing frame. Whose turn it is has it to himself, then the pump.
pub(super) type Outgoing = Mutex<CriticalSectionRawMutex, Frame>;

/// What was counted of clients' frames, modulo 2^32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MailStatistics {
    /// Frames that were on the line.
    pub sent: u32,
    /// Frames that were not.
    pub undelivered: u32,
    /// Frames that were heard for a client.
    pub heard: u32,
    /// Frames that a client was too slow to take.
    pub lost: u32,
}

pub(super) struct Mail {
    /// The bus; none where there is no framed one.
    pub(super) bus: Option<u8>,
    heard: Heard,
    /// Clients that follow,
    followers: u8,
    /// and the addresses that any of them has given as its own.
    addresses: Units,
    outgoing: turn::Place<Result<(), Undelivered>>,
    statistics: MailStatistics,
}

impl Mail {
    pub(super) const fn new() -> Self {
        Self {
            bus: None,
            heard: Heard::new(),
            followers: 0,
            addresses: Units::none(),
            outgoing: turn::Place::new(),
            statistics: MailStatistics { sent: 0, undelivered: 0, heard: 0, lost: 0 },
        }
    }

    /// What has become of the frame that the pump has.
    fn end(&mut self, seats: &mut Seats, outcome: Result<(), Undelivered>) {
        if self.outgoing.end(seats, outcome) {
            let counter = match outcome {
                Ok(()) => &mut self.statistics.sent,
                Err(_) => &mut self.statistics.undelivered,
            };
            *counter = counter.wrapping_add(1);
        }
    }

    /// Keeps a frame whose checks held, if it is for any client.
    fn keep(&mut self, seats: &mut Seats, frame: &[u8]) {
        let packet = frame.get(HEADER..frame.len().saturating_sub(AFTER)).unwrap_or_default();
        let wanted = |section: Section<'_>| self.addresses.contains(section.address);
        if Sections::new(packet).any(wanted) {
            self.statistics.heard = self.statistics.heard.wrapping_add(1);
            self.heard.push(frame);
            // Each of them looks whether it is for it.
            seats.wake_all();
        }
    }
}

/// The outgoing place.
#[derive(Clone, Copy)]
struct Out;

impl Which for Out {
    type Outcome = Result<(), Undelivered>;

    fn place(self, state: &mut State) -> Option<(&mut turn::Place<Self::Outcome>, &mut Seats)> {
        Some((&mut state.mail.outgoing, &mut state.seats))
    }

    fn bus(self, state: &State) -> Option<u8> {
        state.mail.bus
    }
}

/// A client's turn to send a frame. The next client's begins when it is dropped. Then a frame that has not been taken for the
/// line is forgotten, except one that stops axes.
pub struct Turn<'d>(turn::Turn<'d, Out>);

impl Turn<'_> {
    /// The place for the frame. To be let go before the frame is sent.
    pub async fn frame(&self) -> MutexGuard<'_, CriticalSectionRawMutex, Frame> {
        self.0.desk.outgoing.lock().await
    }

    /// Gives the frame to the bus, which sends it while all permits hold; `stop` where it stops axes and moves none.
    pub fn send(&mut self, permits: Permits, stop: bool) {
        self.0.send(permits, stop);
    }

    /// Waits until the frame has been on the line, or never will.
    pub async fn outcome(&mut self) -> Result<(), Undelivered> {
        self.0.outcome().await
    }
}

impl Desk {
    /// Clients' frames go to this bus. Before anything else, after [`configure`](Desk::configure).
    pub fn send_frames_to(&self, bus: u8) {
        self.with(|state| state.mail.bus = Some(bus));
    }

    /// The framed bus that clients' frames go to, if there is one.
    pub fn framed_bus(&self) -> Option<u8> {
        self.with(|state| state.mail.bus)
    }

    /// What was counted of clients' frames.
    pub fn mail_statistics(&self) -> MailStatistics {
        self.with(|state| state.mail.statistics)
    }

    /// Waits for the turn of the client of a seat to send a frame: whoever came before goes first.
    pub async fn turn(&self, seat: u8) -> Turn<'_> {
        Turn(self.turn_at(Out, seat).await)
    }

    /// Follows the bus from now on, for the client of a seat.
    pub fn follow_bus(&self, seat: u8) -> Follower<'_> {
        let mark = self.with(|state| {
            state.mail.followers = state.mail.followers.saturating_add(1);
            state.mail.heard.end()
        });
        Follower { desk: self, seat, mark, addresses: Units::default() }
    }
}

/// A client that follows the bus.
pub struct Follower<'d> {
    desk: &'d Desk,
    seat: u8,
    mark: Mark,
    addresses: Units,
}

impl Follower<'_> {
    /// Frames for this address are for the client from now on.
    pub fn answer_to(&mut self, address: u8) {
        if matches!(address, NOBODY | TRAILER) || self.addresses.contains(address) {
            return;
        }
        self.addresses.insert(address);
        self.desk.with(|state| state.mail.addresses.insert(address));
    }

    /// Waits until there is something to read.
    pub async fn heard(&mut self) {
        let Self { desk, seat, mark, addresses } = self;
        poll_fn(|context| {
            desk.with(|state| match state.mail.heard.next(mark, addresses) {
                Some(_) => Poll::Ready(()),
                None => {
                    state.seats.register(*seat, context.waker());
                    Poll::Pending
                }
            })
        })
        .await
    }

    /// Copies the next frame to `buffer`, which has room for the longest, and tells how long it is; or how many frames this
    /// client has been too slow for.
    pub fn read(&mut self, buffer: &mut [u8]) -> Option<Result<usize, NonZeroU32>> {
        let Self { desk, mark, addresses, .. } = self;
        desk.with(|state| match state.mail.heard.read(mark, addresses, buffer)? {
            Next::Frame(length) => Some(Ok(length)),
            Next::Lost(lost) => {
                let counter = &mut state.mail.statistics.lost;
                *counter = counter.wrapping_add(lost.get());
                Some(Err(lost))
            }
        })
    }
}

impl Drop for Follower<'_> {
    fn drop(&mut self) {
        self.desk.with(|state| {
            state.mail.followers = state.mail.followers.saturating_sub(1);
            if state.mail.followers == 0 {
                state.mail.addresses = Units::default();
            }
        });
    }
}

impl Post for BusImage<'_, Modules> {
    fn outgoing(&self, now: Instant, take: impl FnOnce(&[u8]) -> Taken) {
        let ready = self.desk.with(|state| {
            let State { mail, seats, leases, .. } = state;
            let may = mail.bus == Some(self.bus) && mail.outgoing.take(leases, now)?;
            if !may {
                mail.end(seats, Err(Undelivered::Stopped));
            }
            Some(may)
        });
        if ready != Some(true) {
            return;
        }
        // Nobody else has it now.
        let taken = self.desk.outgoing.try_lock().map_or(Taken::NotYet, |frame| take(&frame));
        self.desk.with(|State { mail, seats, .. }| match taken {
            Taken::Yes => {}
            Taken::NotYet => mail.outgoing.give_back(seats),
            Taken::Never(why) => mail.end(seats, Err(why)),
        });
    }

    fn posted(&self, outcome: Result<(), Undelivered>) {
        let frame = self.desk.outgoing.try_lock();
        self.desk.with(|State { mail, seats, .. }| {
            if let (true, Ok(()), Ok(frame)) = (mail.outgoing.is_sending(), outcome, &frame) {
                // The station does not hear what it says itself, and another client may be whom it is for.
                mail.keep(seats, frame);
            }
            mail.end(seats, outcome);
        });
    }

    fn heard(&self, frame: &[u8]) {
        self.desk.with(|state| {
            if state.mail.bus == Some(self.bus) {
                state.mail.keep(&mut state.seats, frame);
            }
        });
    }
}

#[cfg(test)]
mod tests;

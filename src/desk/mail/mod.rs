//! Frames between clients and the first framed bus.
//!
//! Clients take turns to put a frame into the one outgoing place, in the order in which they came, and keep it until they
//! know what has become of the frame. What is heard on the bus for any address that a client has given as its own is kept
//! in a ring, which each client follows at its own pace; who is too slow is told how much it has lost.

mod heard;
mod turn;

use core::future::poll_fn;
use core::num::NonZeroU32;
use core::task::Poll;

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::mutex::Mutex;
use embassy_sync::waitqueue::WakerRegistration;
use heapless::{Deque, Vec};
use puente_framed::frame::{HEADER, MAX_FRAME};
use puente_framed::section::{NOBODY, Section, Sections, TRAILER};
use puente_line::Instant;

pub use turn::Turn;

use super::lease::AxisLease;
use super::{BusImage, Desk, Modules, Permit, Units};
use crate::bus::{Post, Taken, Undelivered};
use crate::port::limits::{AXES, SLOTS};
use heard::{Heard, Mark, Next};

/// Bytes of a frame after its packet.
const AFTER: usize = 2;

/// The bytes of a frame.
pub type Frame = Vec<u8, MAX_FRAME>;
/// The outgoing frame. Whose turn it is has it to himself, then the pump.
pub(super) type Place = Mutex<CriticalSectionRawMutex, Frame>;
/// What a frame needs in order to go: one for each axis that it moves.
pub type Permits = Vec<Permit, AXES>;

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
    /// Who waits for the outgoing place, by seat.
    queue: Deque<u8, SLOTS>,
    phase: Phase,
    permits: Permits,
    /// A client that waits for anything here, by seat.
    wakers: [WakerRegistration; SLOTS],
    statistics: MailStatistics,
}

/// What the outgoing place is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Free,
    /// Whose turn it is writes.
    Writing(u8),
    /// The frame waits for the pump.
    Ready(Sender),
    /// The pump has it.
    Sending(Sender),
    /// What has become of it.
    Ended(u8, Result<(), Undelivered>),
}

/// Who sends a frame: nobody where its client is gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Sender {
    seat: Option<u8>,
    /// The frame stops axes, and moves none: it goes even where its client is gone.
    stop: bool,
}

impl Mail {
    pub(super) const fn new() -> Self {
        Self {
            bus: None,
            heard: Heard::new(),
            followers: 0,
            addresses: Units::none(),
            queue: Deque::new(),
            phase: Phase::Free,
            permits: Vec::new(),
            wakers: [const { WakerRegistration::new() }; SLOTS],
            statistics: MailStatistics { sent: 0, undelivered: 0, heard: 0, lost: 0 },
        }
    }

    fn wake(&mut self, seat: u8) {
        if let Some(waker) = self.wakers.get_mut(usize::from(seat)) {
            waker.wake();
        }
    }

    fn register(&mut self, seat: u8, waker: &core::task::Waker) {
        if let Some(place) = self.wakers.get_mut(usize::from(seat)) {
            place.register(waker);
        }
    }

    /// The place is free for the next one.
    fn free(&mut self) {
        self.phase = Phase::Free;
        if let Some(seat) = self.queue.front().copied() {
            self.wake(seat);
        }
    }

    /// What has become of the frame that the pump has.
    fn end(&mut self, outcome: Result<(), Undelivered>) {
        let Phase::Sending(sender) = self.phase else { return };
        let counter = match outcome {
            Ok(()) => &mut self.statistics.sent,
            Err(_) => &mut self.statistics.undelivered,
        };
        *counter = counter.wrapping_add(1);
        match sender.seat {
            Some(seat) => {
                self.phase = Phase::Ended(seat, outcome);
                self.wake(seat);
            }
            None => self.free(),
        }
    }

    /// Whether the pump may have the frame now.
    fn take(&mut self, leases: &[AxisLease], now: Instant) -> bool {
        let Phase::Ready(sender) = self.phase else {
            return false;
        };
        self.phase = Phase::Sending(sender);
        let may = self.permits.iter().all(|permit| permit.commands(leases, now));
        if !may {
            self.end(Err(Undelivered::Stopped));
        }
        may
    }

    /// The pump could not use it yet.
    fn give_back(&mut self) {
        if let Phase::Sending(sender) = self.phase {
            if sender.seat.is_some() || sender.stop {
                self.phase = Phase::Ready(sender);
            } else {
                self.free();
            }
        }
    }

    /// Keeps a frame whose checks held, if it is for any client.
    fn keep(&mut self, frame: &[u8]) {
        let packet = frame.get(HEADER..frame.len().saturating_sub(AFTER)).unwrap_or_default();
        let wanted = |section: Section<'_>| self.addresses.contains(section.address);
        if Sections::new(packet).any(wanted) {
            self.statistics.heard = self.statistics.heard.wrapping_add(1);
            self.heard.push(frame);
            // Each of them looks whether it is for it.
            self.wakers.iter_mut().for_each(WakerRegistration::wake);
        }
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
                    state.mail.register(*seat, context.waker());
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
        let ready =
            self.desk.with(|state| state.mail.bus == Some(self.bus) && state.mail.take(&state.leases, now));
        if !ready {
            return;
        }
        // Nobody else has it now.
        let taken = self.desk.outgoing.try_lock().map_or(Taken::NotYet, |frame| take(&frame));
        self.desk.with(|state| match taken {
            Taken::Yes => {}
            Taken::NotYet => state.mail.give_back(),
            Taken::Never(why) => state.mail.end(Err(why)),
        });
    }

    fn posted(&self, outcome: Result<(), Undelivered>) {
        let frame = self.desk.outgoing.try_lock();
        self.desk.with(|state| {
            if let (Phase::Sending(_), Ok(()), Ok(frame)) = (state.mail.phase, outcome, &frame) {
                // The station does not hear what it says itself, and another client may be whom it is for.
                state.mail.keep(frame);
            }
            state.mail.end(outcome);
        });
    }

    fn heard(&self, frame: &[u8]) {
        self.desk.with(|state| {
            if state.mail.bus == Some(self.bus) {
                state.mail.keep(frame);
            }
        });
    }
}

#[cfg(test)]
mod tests;

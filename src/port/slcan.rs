//! An SLCAN adapter as a CAN port, whatever it is connected by.
//!
//! Nothing here runs by itself: the half that waits works for both, the other one waits for its turn.

use core::cell::RefCell;

use embassy_futures::select::{Either4, select, select4};
use embassy_sync::blocking_mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::mutex::Mutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Timer};
use heapless::Deque;
use puente_canopen::Frame;
use puente_line::Instant;
use puente_slcan::{Action, Busy, Client, Config, Event, Flags, Flow, Text};

use super::{CanCounters, CanEvent, CanPort, CanReader, CanState, CanWriter, NotTaken};
use crate::clock;

/// How long it takes until a connection is tried again.
const RETRY: Duration = Duration::from_secs(1);
/// Bytes that are read at once.
const CHUNK: usize = 256;

/// What an adapter is connected by. Both directions are used at once; a future that is dropped loses nothing.
pub trait Wire {
    /// Waits for a connection; false where there is none.
    async fn open(&self) -> bool;
    /// Reads what is there, and waits where nothing is; `None` where the connection is gone.
    async fn read(&self, buffer: &mut [u8]) -> Option<usize>;
    /// Writes as much as there is room for, and waits where there is none; `None` where the connection is gone.
    async fn write(&self, bytes: &[u8]) -> Option<usize>;
}

/// An adapter, with room for so many events that nobody has read yet.
pub struct Slcan<W, const EVENTS: usize> {
    wire: W,
    state: blocking_mutex::Mutex<CriticalSectionRawMutex, RefCell<State<EVENTS>>>,
    /// Held by the half that works.
    turn: Mutex<CriticalSectionRawMutex, ()>,
    /// There is an event.
    heard: Signal<CriticalSectionRawMutex, ()>,
    /// There may be room for a frame.
    room: Signal<CriticalSectionRawMutex, ()>,
    /// There is a frame to send.
    frame: Signal<CriticalSectionRawMutex, ()>,
}

struct State<const EVENTS: usize> {
    client: Client,
    connected: bool,
    /// What is being written, and how much of it is.
    outgoing: Text,
    written: usize,
    events: Deque<CanEvent, EVENTS>,
    /// Frames that found no room, and have not been told.
    lost: u32,
    state: CanState,
    /// It has not been told.
    changed: bool,
    counters: CanCounters,
}

impl<const EVENTS: usize> State<EVENTS> {
    /// The connection is there, or is not any more.
    fn connect(&mut self, connected: bool) {
        self.connected = connected;
        self.outgoing.clear();
        self.written = 0;
        if connected {
            self.client.connected();
        } else {
            self.client.disconnected();
            self.enter(CanState::Down);
        }
    }

    fn enter(&mut self, state: CanState) {
        self.changed |= state != self.state;
        self.state = state;
    }

    fn receive(&mut self, now: Instant, bytes: &[u8]) {
        for byte in bytes {
            if let Some(event) = self.client.receive(now, *byte) {
                self.take(event);
            }
        }
    }

    fn take(&mut self, event: Event) {
        match event {
            Event::Heard(frame) => {
                if self.events.push_back(CanEvent::Frame(frame)).is_err() {
                    self.lose(1);
                }
            }
            Event::Opened(flow) => {
                match flow {
                    Flow::Answered => log::info!("the SLCAN adapter is open"),
                    Flow::Silent => log::info!("the SLCAN adapter is open, and does not answer"),
                }
                self.enter(CanState::Active);
            }
            Event::Closed => {
                if self.state != CanState::Down {
                    log::error!("the SLCAN adapter is out of step; opening it again");
                }
                self.enter(CanState::Down);
            }
            Event::Off => {
                self.counters.bus_offs = self.counters.bus_offs.saturating_add(1);
                self.enter(CanState::Off);
            }
            // Whoever waits for it is woken by any step.
            Event::Room => {}
            Event::Flags(flags) => {
                if flags.any(Flags::OVERRUN | Flags::RECEIVE_FULL) {
                    self.lose(1);
                }
                self.enter(match flags {
                    _ if flags.any(Flags::PASSIVE) => CanState::Passive,
                    _ if flags.any(Flags::WARNING) => CanState::Warning,
                    _ => CanState::Active,
                });
            }
        }
    }

    fn lose(&mut self, count: u32) {
        self.lost = self.lost.saturating_add(count);
        self.counters.lost = self.counters.lost.saturating_add(count);
    }

    fn next_event(&mut self) -> Option<CanEvent> {
        // The state first: it says what the frames are worth.
        if core::mem::take(&mut self.changed) {
            return Some(CanEvent::State(self.state));
        }
        let event = self.events.pop_front();
        event.or_else(|| Some(core::mem::take(&mut self.lost)).filter(|lost| *lost > 0).map(CanEvent::Lost))
    }

    /// What the adapter's silence tells; false where that is nothing.
    fn expire(&mut self, now: Instant) -> bool {
        let event = self.client.expire(now);
        event.map(|event| self.take(event)).is_some()
    }

    /// What is to be written next, and until when to wait where that is nothing.
    fn next(&mut self, now: Instant) -> (Option<Text>, Option<Instant>) {
        if self.written == self.outgoing.len() {
            self.written = 0;
            self.outgoing = match self.client.poll(now) {
                Action::Transmit(text) => text,
                Action::Idle => Text::new(),
            };
        }
        let rest = self.outgoing.get(self.written..).unwrap_or_default();
        ((!rest.is_empty()).then(|| rest.iter().copied().collect()), self.client.poll_at())
    }
}

impl<W: Wire, const EVENTS: usize> Slcan<W, EVENTS> {
    /// An adapter; it is opened with its first use.
    pub(super) fn new(wire: W, config: Config) -> Self {
        let state = State {
            client: Client::new(config),
            connected: false,
            outgoing: Text::new(),
            written: 0,
            events: Deque::new(),
            lost: 0,
            state: CanState::Down,
            changed: false,
            counters: CanCounters::default(),
        };
        Self {
            wire,
            state: blocking_mutex::Mutex::new(RefCell::new(state)),
            turn: Mutex::new(()),
            heard: Signal::new(),
            room: Signal::new(),
            frame: Signal::new(),
        }
    }

    fn with<R>(&self, f: impl FnOnce(&mut State<EVENTS>) -> R) -> R {
        self.state.lock(|state| f(&mut state.borrow_mut()))
    }

    /// Does a step for both halves, once nobody else does one.
    async fn work(&self) {
        let _turn = self.turn.lock().await;
        self.step().await;
        self.heard.signal(());
        self.room.signal(());
    }

    async fn step(&self) {
        if !self.with(|state| state.connected) {
            if self.wire.open().await {
                self.with(|state| state.connect(true));
            } else {
                Timer::after(RETRY).await;
            }
            return;
        }
        if self.with(|state| state.expire(clock::now())) {
            // Whoever reads has to hear of it: nothing else may happen for ever.
            return;
        }
        let (text, until) = self.with(|state| state.next(clock::now()));
        let write = async {
            match &text {
                Some(text) => self.wire.write(text).await,
                None => core::future::pending().await,
            }
        };
        let mut buffer = [0; CHUNK];
        let until = until.filter(|_| text.is_none());
        let done = select4(self.wire.read(&mut buffer), write, clock::at(until), self.frame.wait()).await;
        match done {
            Either4::First(Some(count)) => {
                let bytes = buffer.get(..count).unwrap_or_default();
                self.with(|state| state.receive(clock::now(), bytes));
            }
            Either4::Second(Some(count)) => self.with(|state| state.written += count),
            Either4::First(None) | Either4::Second(None) => self.with(|state| state.connect(false)),
            Either4::Third(()) | Either4::Fourth(()) => {}
        }
    }
}

impl<W: Wire, const EVENTS: usize> CanPort for Slcan<W, EVENTS> {
    type Reader<'a>
        = Reader<'a, W, EVENTS>
    where
        Self: 'a;
    type Writer<'a>
        = Writer<'a, W, EVENTS>
    where
        Self: 'a;

    fn split(&mut self) -> (Self::Reader<'_>, Self::Writer<'_>) {
        (Reader(self), Writer(self))
    }
}

/// The receiving half.
pub struct Reader<'a, W, const EVENTS: usize>(&'a Slcan<W, EVENTS>);

impl<W: Wire, const EVENTS: usize> CanReader for Reader<'_, W, EVENTS> {
    async fn read(&mut self) -> CanEvent {
        loop {
            if let Some(event) = self.0.with(State::next_event) {
                return event;
            }
            select(self.0.heard.wait(), self.0.work()).await;
            // All there was until now is looked at next.
            self.0.heard.reset();
        }
    }

    fn counters(&self) -> CanCounters {
        self.0.with(|state| state.counters)
    }
}

/// The sending half.
pub struct Writer<'a, W, const EVENTS: usize>(&'a Slcan<W, EVENTS>);

impl<W: Wire, const EVENTS: usize> CanWriter for Writer<'_, W, EVENTS> {
    async fn write(&mut self, frame: &Frame) -> Result<(), NotTaken> {
        loop {
            match self.0.with(|state| state.client.submit(clock::now(), frame)) {
                Ok(()) => {
                    self.0.frame.signal(());
                    return Ok(());
                }
                Err(Busy::Closed) => return Err(NotTaken(CanState::Down)),
                Err(Busy::Full) => {
                    select(self.0.room.wait(), self.0.work()).await;
                    self.0.room.reset();
                }
            }
        }
    }

    /// What the adapter has already cannot be called back.
    fn discard(&mut self) {
        self.0.with(|state| state.client.discard());
    }
}

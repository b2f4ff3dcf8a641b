//! A network interface of Linux. Whoever looks after the system has set its bit rate, brought it up, and says whether it
//! comes back after bus-off (`restart-ms`).

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::rc::Rc;

use async_io::Async;
use embassy_time::{Duration, Timer};
use puente_canopen::Frame;
use puente_canopen::frame::{self, Id};
use socketcan::{
    CanDataFrame, CanFrame, CanRemoteFrame, CanSocket, EmbeddedFrame, ExtendedId, Socket, SocketOptions,
    StandardId,
};

use crate::port::{CanCounters, CanEvent, CanState, NotTaken};

const RETRY: Duration = Duration::from_secs(1);
/// How long a queue of the interface that is full is left alone.
const FULL: Duration = Duration::from_millis(1);
/// The queue of the interface is full: Linux does not wake who waits for that.
const ENOBUFS: i32 = 105;

// linux/can.h
const EXTENDED: u32 = 1 << 31;
const REMOTE: u32 = 1 << 30;
const ERROR: u32 = 1 << 29;

/// An interface.
pub(super) struct Socketcan {
    interface: String,
    socket: RefCell<Option<Rc<Async<CanSocket>>>>,
    events: RefCell<VecDeque<CanEvent>>,
    state: Cell<CanState>,
    counters: Cell<CanCounters>,
    /// The last failure has been told.
    told: Cell<bool>,
}

impl Socketcan {
    /// An interface; it is opened with its first use.
    pub(super) fn new(interface: String) -> Self {
        Self {
            interface,
            socket: RefCell::default(),
            events: RefCell::default(),
            state: Cell::default(),
            counters: Cell::default(),
            told: Cell::new(false),
        }
    }

    fn open(&self) -> io::Result<Rc<Async<CanSocket>>> {
        if let Some(socket) = &*self.socket.borrow() {
            return Ok(socket.clone());
        }
        let socket = CanSocket::open(&self.interface)?;
        socket.set_error_filter_accept_all()?;
        let socket = Rc::new(Async::new(socket)?);
        log::info!("CAN interface {} is open", self.interface);
        self.told.set(false);
        *self.socket.borrow_mut() = Some(socket.clone());
        self.enter(CanState::Active);
        Ok(socket)
    }

    fn lost(&self, error: &io::Error) {
        if !self.told.replace(true) {
            log::error!("CAN interface {}: {error}; trying again", self.interface);
        }
        *self.socket.borrow_mut() = None;
        self.enter(CanState::Down);
    }

    fn enter(&self, state: CanState) {
        if self.state.replace(state) != state {
            self.events.borrow_mut().push_back(CanEvent::State(state));
        }
    }

    pub(super) async fn read(&self) -> CanEvent {
        loop {
            if let Some(event) = self.events.borrow_mut().pop_front() {
                return event;
            }
            let heard = match self.open() {
                Ok(socket) => socket.read_with(CanSocket::read_raw_frame).await,
                Err(error) => Err(error),
            };
            match heard {
                Ok(raw) if raw.can_id & ERROR != 0 => self.error(raw.can_id, raw.data),
                Ok(raw) => {
                    if let Some(frame) = frame(raw.can_id, raw.can_dlc, &raw.data) {
                        return CanEvent::Frame(frame);
                    }
                }
                Err(error) => {
                    self.lost(&error);
                    // The event first, if there is one.
                    if self.events.borrow().is_empty() {
                        Timer::after(RETRY).await;
                    }
                }
            }
        }
    }

    /// An error frame.
    fn error(&self, class: u32, data: [u8; frame::MAX_DATA]) {
        let seen = Seen::of(class, data);
        let mut counters = self.counters.get();
        if let Some((tx, rx)) = seen.errors {
            (counters.tx_errors, counters.rx_errors) = (tx, rx);
        }
        if seen.state == Some(CanState::Off) {
            counters.bus_offs = counters.bus_offs.saturating_add(1);
        }
        if seen.lost {
            counters.lost = counters.lost.saturating_add(1);
            self.events.borrow_mut().push_back(CanEvent::Lost(1));
        }
        self.counters.set(counters);
        if let Some(state) = seen.state {
            self.enter(state);
        }
    }

    pub(super) async fn write(&self, frame: &Frame) -> Result<(), NotTaken> {
        let down = NotTaken(CanState::Down);
        let raw = raw(frame).ok_or(down)?;
        loop {
            if self.state.get() == CanState::Off {
                return Err(NotTaken(CanState::Off));
            }
            let socket = self.socket.borrow().clone().ok_or(down)?;
            match socket.write_with(|socket| socket.write_frame(&raw)).await {
                Ok(()) => return Ok(()),
                Err(error) if error.raw_os_error() == Some(ENOBUFS) => Timer::after(FULL).await,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => {
                    self.lost(&error);
                    return Err(down);
                }
            }
        }
    }

    pub(super) fn counters(&self) -> CanCounters {
        self.counters.get()
    }
}

/// A frame of the system, `None` where it is none that CAN has.
fn frame(id: u32, length: u8, data: &[u8; frame::MAX_DATA]) -> Option<Frame> {
    let name = if id & EXTENDED != 0 { Id::extended(id) } else { Id::base(id as u16) };
    if id & REMOTE != 0 {
        Some(Frame::remote(name, length))
    } else {
        Frame::new(name, data.get(..length.into())?)
    }
}

fn raw(frame: &Frame) -> Option<CanFrame> {
    let id: socketcan::Id = match frame.id() {
        Id::Base(id) => StandardId::new(id)?.into(),
        Id::Extended(id) => ExtendedId::new(id)?.into(),
    };
    if frame.is_remote() {
        CanRemoteFrame::new_remote(id, frame.length().into()).map(Into::into)
    } else {
        CanDataFrame::new(id, frame.data()).map(Into::into)
    }
}

/// What an error frame tells (`linux/can/error.h`).
#[derive(Debug, Default, PartialEq, Eq)]
struct Seen {
    state: Option<CanState>,
    /// Transmit and receive error counters.
    errors: Option<(u8, u8)>,
    /// The controller had no room for a frame.
    lost: bool,
}

impl Seen {
    const CONTROLLER: u32 = 0x004;
    const BUS_OFF: u32 = 0x040;
    const RESTARTED: u32 = 0x100;
    const COUNTERS: u32 = 0x200;

    fn of(class: u32, data: [u8; frame::MAX_DATA]) -> Self {
        let [_, problem, .., tx, rx] = data;
        let problem = if class & Self::CONTROLLER != 0 { problem } else { 0 };
        let state = if class & Self::BUS_OFF != 0 {
            Some(CanState::Off)
        } else if problem & 0x30 != 0 {
            Some(CanState::Passive)
        } else if problem & 0x0C != 0 {
            Some(CanState::Warning)
        } else if problem & 0x40 != 0 || class & Self::RESTARTED != 0 {
            Some(CanState::Active)
        } else {
            None
        };
        Self { state, errors: (class & Self::COUNTERS != 0).then_some((tx, rx)), lost: problem & 0x01 != 0 }
    }
}

#[cfg(test)]
mod tests {
    use socketcan::Frame as _;

    use super::*;

    /// The kernel of a machine that builds this may know no CAN, or no interface of this name: then that is told, the port is
    /// down, and nothing is taken.
    #[test]
    fn an_interface_that_is_not_there_is_told() {
        let port = Socketcan::new("puente-none0".into());
        assert!(port.open().is_err());
        let frame = Frame::remote(Id::base(1), 0);
        assert_eq!(async_io::block_on(port.write(&frame)), Err(NotTaken(CanState::Down)));
    }

    #[test]
    fn frames_are_those_of_the_system() {
        for ours in [
            Frame::new(Id::base(0x7FF), &[1, 2, 3]).expect("a frame"),
            Frame::new(Id::extended(0x1FFF_FFFF), &[]).expect("a frame"),
            Frame::remote(Id::base(0x701), 1),
            Frame::remote(Id::extended(5), 8),
        ] {
            let theirs = raw(&ours).expect("a frame");
            let mut data = [0; frame::MAX_DATA];
            data[..theirs.data().len()].copy_from_slice(theirs.data());
            assert_eq!(super::frame(theirs.id_word(), theirs.dlc() as u8, &data), Some(ours));
        }
        assert_eq!(super::frame(1, 9, &[0; 8]), None);
    }

    /// Classes and bits as `linux/can/error.h` has them.
    #[test]
    fn error_frames_tell_the_state() {
        let controller = |bits| Seen::of(0x2000_0004, [0, bits, 0, 0, 0, 0, 0, 0]).state;
        assert_eq!(controller(0x04), Some(CanState::Warning), "reception");
        assert_eq!(controller(0x08), Some(CanState::Warning), "transmission");
        assert_eq!(controller(0x10), Some(CanState::Passive), "reception");
        assert_eq!(controller(0x20), Some(CanState::Passive), "transmission");
        assert_eq!(controller(0x40), Some(CanState::Active));
        let off = Seen::of(0x2000_0240, [0, 0, 0, 0, 0, 0, 248, 3]);
        assert_eq!(off, Seen { state: Some(CanState::Off), errors: Some((248, 3)), lost: false });
        assert_eq!(Seen::of(0x2000_0100, [0; 8]).state, Some(CanState::Active), "restarted");
        assert!(Seen::of(0x2000_0004, [0, 1, 0, 0, 0, 0, 0, 0]).lost);
        assert_eq!(Seen::of(0x2000_0008, [0, 0xFF, 0, 0, 0, 0, 0, 0]), Seen::default(), "a protocol error");
    }
}

//! What a client is told unasked: frames in the mode of its last message, and what it has switched on in CiA 309-3.

use core::fmt::Write as _;
use core::future::poll_fn;
use core::pin::{Pin, pin};
use core::task::Poll;

use embassy_futures::select::{Either, Either3, select, select3};
use embedded_io_async::{Read, Write};
use heapless::String;
use puente_canopen::cob::Function;
use puente_canopen::manager::Event;
use puente_canopen::monitor::{self, Supervision};
use puente_canopen::{Frame, NodeId, sync};
use puente_cia309::indication::{Kinds, What};
use puente_cia309::{Error, Indication};
use puente_frametext::{Message, Mode};
use puente_line::Instant;

use super::super::inbox::Inbox;
use super::super::{End, send};
use super::{Client, Last};
use crate::clock;
use crate::desk::{self, CanFollower, Heard, Lost, Origin};
use crate::port::CanState;

/// Longest text of what is heard at once: two lines.
type News = String<160>;

/// A bus of which a client is told.
pub(super) struct Followed<'g> {
    bus: u8,
    net: u16,
    follower: CanFollower<'g>,
    events: Kinds,
    frames: Option<Mode>,
}

impl<'g> Client<'g> {
    /// Frames come back from the bus where the client's go, and from no other.
    pub(super) fn follow_frames(&mut self) {
        let (mode, bus) = match self.last {
            Last::Frame(mode) => (Some(mode), self.frame_bus()),
            Last::Cia309 | Last::Other => (None, None),
        };
        for followed in &mut self.followed {
            followed.frames = mode.filter(|_| Some(followed.bus) == bus);
        }
        if let (Some(mode), Some(bus)) = (mode, bus)
            && let Some(followed) = self.follow(bus)
        {
            followed.frames = Some(mode);
        }
        self.forget();
    }

    /// Switches on or off what is told of a bus.
    pub(super) fn follow_events(&mut self, bus: u8, kinds: Kinds, on: bool) {
        if let Some(followed) = self.follow(bus) {
            followed.events = followed.events.with(kinds, on);
        }
        self.forget();
    }

    /// The bus, followed from now on unless it is already; none where there is no such network.
    fn follow(&mut self, bus: u8) -> Option<&mut Followed<'g>> {
        let (_, net) = self.gateway.can_buses().find(|(other, _)| *other == bus)?;
        if !self.followed.iter().any(|followed| followed.bus == bus) {
            let follower = self.gateway.desk.follow_can(self.guest.seat, bus)?;
            let followed = Followed { bus, net, follower, events: Kinds::NONE, frames: None };
            // There is a place for every bus.
            let _ = self.followed.push(followed);
        }
        self.followed.iter_mut().find(|followed| followed.bus == bus)
    }

    /// Does not follow any more where nothing is told.
    fn forget(&mut self) {
        self.followed.retain(|followed| followed.frames.is_some() || !followed.events.is_none());
    }

    /// Waits for more from the client; end of the visit where nothing comes until some moment. Meanwhile it is told what is
    /// heard.
    pub(in crate::front) async fn listen<R: Read, W: Write>(
        &mut self,
        inbox: &mut Inbox<'_, R>,
        writer: &mut W,
        until: Instant,
    ) -> Result<(), End> {
        loop {
            let news = match select3(inbox.fill(), self.heard(), clock::at(Some(until))).await {
                Either3::First(filled) => return filled,
                Either3::Second(news) => news,
                Either3::Third(()) => return Err(End::Idle),
            };
            send(writer, news.as_bytes()).await?;
        }
    }

    /// Does some work. What arrives meanwhile is kept, and renews the client's leases.
    pub(super) async fn during<R: Read, T>(
        inbox: &mut Inbox<'_, R>,
        mut work: Pin<&mut impl Future<Output = T>>,
    ) -> Result<T, End> {
        loop {
            match select(work.as_mut(), inbox.fill()).await {
                Either::First(done) => return Ok(done),
                Either::Second(filled) => filled?,
            }
        }
    }

    /// Waits until something is heard that the client is to be told: the text. Loses nothing when dropped.
    async fn heard(&mut self) -> News {
        loop {
            let (at, heard) = next(&mut self.followed).await;
            let mut news = News::new();
            if let Some(followed) = self.followed.get(at) {
                followed.tell(&heard, &mut news);
            }
            if !news.is_empty() {
                return news;
            }
        }
    }
}

/// The next that is heard on any of the buses, and on which.
async fn next(followed: &mut [Followed<'_>]) -> (usize, Result<Heard, Lost>) {
    poll_fn(|context| {
        for (at, followed) in followed.iter_mut().enumerate() {
            if let Poll::Ready(heard) = pin!(followed.follower.heard()).poll(context) {
                return Poll::Ready((at, heard));
            }
        }
        Poll::Pending
    })
    .await
}

impl Followed<'_> {
    fn tell(&self, heard: &Result<Heard, Lost>, news: &mut News) {
        match heard {
            Ok(heard) => match &heard.what {
                desk::What::Frame { frame, origin } => self.frame(frame, *origin, news),
                desk::What::Node(node, event) => self.event(*node, event, news),
                desk::What::State(state) => self.state(*state, news),
                desk::What::Bus(_) => {}
            },
            Err(Lost(count)) => {
                self.indicate(What::Error(None, Error::Overflow), news);
                if self.frames.is_some() {
                    let _ =
                        write!(news, "error lost {count} frames came faster than this client takes them\r\n");
                }
            }
        }
    }

    fn frame(&self, frame: &Frame, origin: Origin, news: &mut News) {
        if let (Some(mode), Origin::Bus) = (self.frames, origin) {
            let _ = write!(news, "{}", Message(mode, frame));
        }
        if let Some(what) = of_frame(frame, origin == Origin::Bus) {
            self.indicate(what, news);
        }
    }

    fn state(&self, state: CanState, news: &mut News) {
        let error = match state {
            CanState::Active => Error::Active,
            CanState::Warning => return,
            CanState::Passive => Error::Passive,
            CanState::Off => Error::BusOff,
            CanState::Down => Error::Init,
        };
        self.indicate(What::Error(None, error), news);
    }

    fn event(&self, node: NodeId, event: &Event, news: &mut News) {
        let error = |error| Some(What::Error(Some(node), error));
        let state = |state| Some(What::State(node, state));
        let (first, second) = match event {
            Event::Emergency(emergency) => (Some(What::Emergency(node, *emergency)), None),
            Event::Monitor(event) => match *event {
                monitor::Event::BootUp => (Some(What::BootUp(node)), None),
                monitor::Event::Started(to) | monitor::Event::Resumed(to) => {
                    (error(Error::HeartbeatStarted), state(to))
                }
                monitor::Event::Changed { to, .. } => (state(to), None),
                monitor::Event::Lost(Supervision::Guarding { .. }) => (error(Error::ConnectionLost), None),
                monitor::Event::Lost(_) => (error(Error::HeartbeatLost), None),
                monitor::Event::Toggle => (error(Error::GuardingLost), None),
            },
            Event::Missing => (error(Error::ConnectionLost), None),
            Event::DuplicateId(_) => (Some(What::Duplicate(node)), None),
            Event::Booted | Event::Declined(..) | Event::NotBooted(_) => (None, None),
        };
        for what in first.into_iter().chain(second) {
            self.indicate(what, news);
        }
    }

    fn indicate(&self, what: What<'_>, news: &mut News) {
        if self.events.has(what.kind()) {
            // There is room for two.
            let _ = write!(news, "{}", Indication { net: self.net, what });
        }
    }
}

/// What is told of a frame: PDOs of nodes, and SYNC whoever gives it.
fn of_frame(frame: &Frame, of_a_node: bool) -> Option<What<'_>> {
    match Function::of(frame.id())? {
        Function::Sync => Some(What::Sync(sync::parse(puente_canopen::cob::SYNC, frame)?)),
        Function::Tpdo(number, node) if of_a_node && !frame.is_remote() => {
            Some(What::Pdo(node, number, frame.data()))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::boxed::Box;

    use embassy_futures::block_on;
    use puente_canopen::manager::Config;
    use puente_line::Duration;

    use super::*;
    use crate::bus::canopen::{Exchange, Room};
    use crate::desk::{BusSpec, CanBus, CanSpec, Desk, Units};

    /// All of them, also those that an SLCAN adapter tells by its flags alone or not at all.
    #[test]
    fn every_state_of_the_port_has_its_number() {
        let desk: &'static Desk = Box::leak(Box::new(const { Desk::new() }));
        let (queue_timeout, reply_timeout) = (Duration::ZERO, Duration::ZERO);
        desk.configure([BusSpec { units: Units::default(), queue_timeout, reply_timeout }], Duration::ZERO);
        let config = Config::new(NodeId::new(127).expect("a node-ID"));
        let room: &'static Room = Box::leak(Box::new(Room::new(config)));
        desk.add_can(CanSpec { bus: 0, net: 5, bitrate: 1_000_000, room });
        let bus = CanBus::new(desk, 0).expect("a bus");
        let follower = desk.follow_can(1, 0).expect("a bus");
        let mut followed = [Followed { bus: 0, net: 5, follower, events: Kinds::BUS, frames: None }];
        for (state, line) in [
            (CanState::Active, "5 0 ERROR 305 #CAN active.\r\n"),
            (CanState::Warning, ""),
            (CanState::Passive, "5 0 ERROR 300 #Error passive.\r\n"),
            (CanState::Off, "5 0 ERROR 301 #Bus off.\r\n"),
            (CanState::Down, "5 0 ERROR 304 #CAN init.\r\n"),
        ] {
            bus.state(clock::now(), state);
            let (at, heard) = block_on(next(&mut followed));
            let mut news = News::new();
            followed[at].tell(&heard, &mut news);
            assert_eq!(news, line);
        }
    }
}

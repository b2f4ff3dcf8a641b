//! Desk and pump of a CANopen bus together, with a port whose nodes answer at once.

use core::cell::{Cell, RefCell};
use core::future::Future;
use core::marker::PhantomData;
use std::collections::VecDeque;
use std::vec::Vec;

use embassy_futures::join::join;
use embassy_futures::select::{Either, select};
use embassy_futures::{block_on, yield_now};
use puente_canopen::manager::Config;
use puente_canopen::sdo::{Abort, Failure, Request, Response};
use puente_canopen::{Address, Id, cob};
use puente_line::Duration;

use super::*;
use crate::bus::canopen::{Setup, pump};
use crate::clock;
use crate::desk::{BusImage, BusSpec, Class, Holder, Permits, Servos, Units};
use crate::port::limits::SDO_DATA;
use crate::port::{CanCounters, CanEvent, CanPort, CanReader, CanWriter, NotTaken};

const VALUE: Address = Address::new(0x2000, 0);
/// Nobody has it.
const NOTHING: Address = Address::new(0x2001, 0);
/// As many bytes as [`LONG_SIZE`].
const LONG: Address = Address::new(0x2002, 0);
const LONG_SIZE: usize = 3 * SDO_DATA + 5;
/// Its node never answers.
const SILENT: u8 = 9;

/// A port at a bus whose nodes have the objects above.
#[derive(Default)]
struct Port {
    heard: RefCell<VecDeque<CanEvent>>,
    sent: RefCell<Vec<Frame>>,
    /// It takes nothing.
    full: Cell<bool>,
    /// What the last initiated transfer has still to give.
    rest: RefCell<VecDeque<u8>>,
}

impl Port {
    fn say(&self, event: CanEvent) {
        self.heard.borrow_mut().push_back(event);
    }

    fn answer(&self, frame: &Frame) {
        let Some(cob::Function::SdoRequest(node)) = cob::Function::of(frame.id()) else { return };
        if node.value() == SILENT {
            return;
        }
        use puente_canopen::sdo::{Initiate, Segment};
        let response = match Request::parse(frame.data()).expect("a request") {
            Request::InitiateUpload { address: VALUE } => {
                let data = [1, 2, 3, node.value()].into_iter().collect();
                Response::InitiateUpload { address: VALUE, data: Initiate::Expedited(data) }
            }
            Request::InitiateUpload { address: LONG } => {
                *self.rest.borrow_mut() = (0..LONG_SIZE).map(|number| number as u8).collect();
                let size = Some(LONG_SIZE as u32);
                Response::InitiateUpload { address: LONG, data: Initiate::Segmented { size } }
            }
            Request::UploadSegment { toggle } => {
                let mut rest = self.rest.borrow_mut();
                let count = rest.len().min(7);
                let data = rest.drain(..count).collect();
                Response::UploadSegment(Segment { toggle, last: rest.is_empty(), data })
            }
            Request::InitiateDownload { address: VALUE, .. } => Response::InitiateDownload { address: VALUE },
            Request::InitiateUpload { address } | Request::InitiateDownload { address, .. } => {
                Response::Abort { address, code: Abort::NO_OBJECT }
            }
            _ => return,
        };
        self.say(CanEvent::Frame(Frame::full(Id::base(node.sdo_response()), response.to_bytes())));
    }

    /// What has been sent so far besides the manager's boot-up.
    fn said(&self) -> Vec<Frame> {
        self.sent.borrow().iter().filter(|frame| frame.id() != Id::base(0x77F)).copied().collect()
    }

    /// The objects that were asked for so far.
    fn asked(&self) -> Vec<(u32, Request)> {
        let sent = self.sent.borrow();
        let requests = sent.iter().filter(|frame| frame.id().raw() >> 7 == 0x600 >> 7);
        requests
            .map(|frame| (frame.id().raw() & 0x7F, Request::parse(frame.data()).expect("a request")))
            .collect()
    }
}

impl CanPort for &Port {
    type Reader<'a>
        = &'a Port
    where
        Self: 'a;
    type Writer<'a>
        = &'a Port
    where
        Self: 'a;

    fn split(&mut self) -> (&Port, &Port) {
        (self, self)
    }
}

impl CanReader for &Port {
    async fn read(&mut self) -> CanEvent {
        loop {
            let event = self.heard.borrow_mut().pop_front();
            match event {
                Some(event) => return event,
                None => yield_now().await,
            }
        }
    }

    fn counters(&self) -> CanCounters {
        CanCounters { bus_offs: 7, ..CanCounters::default() }
    }
}

impl CanWriter for &Port {
    async fn write(&mut self, frame: &Frame) -> Result<(), NotTaken> {
        while self.full.get() {
            yield_now().await;
        }
        self.sent.borrow_mut().push(*frame);
        self.answer(frame);
        Ok(())
    }

    fn discard(&mut self) {}
}

struct Rig {
    desk: &'static Desk,
    room: &'static Room,
    port: Port,
}

fn node(id: u8) -> NodeId {
    NodeId::new(id).expect("a node-ID")
}

/// A bus whose port is up, and whose manager says nothing by itself but its boot-up and what `config` has.
fn rig(config: Config) -> Rig {
    let desk: &'static Desk = Box::leak(Box::new(const { Desk::new() }));
    let spec =
        BusSpec { units: Units::default(), queue_timeout: Duration::ZERO, reply_timeout: Duration::ZERO };
    desk.configure([spec], Duration::from_millis(250));
    let room: &'static Room = Box::leak(Box::new(Room::new(config)));
    desk.add_can(CanSpec { bus: 0, net: 5, bitrate: 1_000_000, room });
    let rig = Rig { desk, room, port: Port::default() };
    rig.port.say(CanEvent::State(CanState::Active));
    rig
}

fn quiet() -> Config {
    Config { heartbeat: Duration::ZERO, babble: 0, ..Config::new(node(127)) }
}

impl Rig {
    /// Runs the pump until `f` is done, which begins when the bus is up.
    fn run<T>(&self, f: impl Future<Output = T>) -> T {
        let clients = CanBus::new(self.desk, 0).expect("a bus");
        let image =
            BusImage::<Servos> { desk: self.desk, bus: 0, axes: heapless::Vec::new(), kind: PhantomData };
        let setup = Setup { room: self.room, sdo_timeout: Duration::from_millis(200) };
        let mut port = &self.port;
        let scenario = async {
            while !self.is_up() {
                yield_now().await;
            }
            f.await
        };
        match block_on(select(pump(&mut port, setup, &clients, &image), scenario)) {
            Either::First(never) => never,
            Either::Second(result) => result,
        }
    }

    fn is_up(&self) -> bool {
        self.desk.can_statistics(clock::now(), 0).is_some_and(|bus| bus.state == CanState::Active)
    }

    fn order(&self, seat: u8, id: u8, class: Class, transfer: SdoTransfer<'_>) -> SdoPending<'static> {
        let order = SdoOrder { seat, bus: 0, node: node(id), class, transfer, timeout: None };
        self.desk.sdo(clock::now(), order).expect("room")
    }

    fn read(&self, seat: u8, id: u8, address: Address) -> SdoPending<'static> {
        self.order(seat, id, Class::Free, SdoTransfer::Read { address, block: false })
    }
}

/// All of an object.
async fn whole(mut pending: SdoPending<'_>) -> Result<Vec<u8>, CanFailure> {
    let (mut all, mut part) = (Vec::new(), [0; 10]);
    loop {
        match pending.read(&mut part).await? {
            0 => return Ok(all),
            count => all.extend_from_slice(&part[..count]),
        }
    }
}

#[test]
fn objects_are_read_and_written_and_a_refusal_is_told() {
    let rig = rig(quiet());
    rig.run(async {
        assert_eq!(whole(rig.read(0, 2, VALUE)).await, Ok(vec![1, 2, 3, 2]));
        let refused = Err(CanFailure::Sdo(Failure::Aborted(Abort::NO_OBJECT)));
        let mut pending = rig.read(0, 2, NOTHING);
        assert_eq!(pending.read(&mut [0; 4]).await.map(|_| ()), refused);
        assert_eq!(pending.read(&mut [0; 4]).await.map(|_| ()), refused, "again");
        let write = |address, data| SdoTransfer::Write { address, data, block: false };
        assert_eq!(rig.order(0, 2, Class::Free, write(VALUE, &[5, 6])).written().await, Ok(()));
        assert_eq!(rig.order(0, 2, Class::Free, write(NOTHING, &[5])).written().await, refused);
        let (_, written) = rig.port.asked().remove(2);
        let Request::InitiateDownload { data, .. } = written else { panic!("{written:?}") };
        assert_eq!(data, puente_canopen::sdo::Initiate::Expedited([5, 6].into_iter().collect()));
        let most = [0; SDO_DATA + 1];
        let order = SdoOrder {
            seat: 0,
            bus: 0,
            node: node(2),
            class: Class::Free,
            transfer: write(VALUE, &most),
            timeout: None,
        };
        assert_eq!(rig.desk.sdo(clock::now(), order).err(), Some(CanFailure::TooLong));
    });
    let counted = rig.desk.can_statistics(clock::now(), 0).expect("a bus");
    assert_eq!((counted.sent, counted.received, counted.not_sent), (1 + 4, 4, 1));
    assert_eq!((counted.port.bus_offs, counted.manager.sdo.completed), (7, 2));
}

/// Whoever reads slowly makes the node wait, and loses nothing.
#[test]
fn an_object_longer_than_there_is_room_for_passes_through() {
    let rig = rig(quiet());
    rig.run(async {
        let pending = rig.read(0, 2, LONG);
        let enough = SDO_DATA / 7 + 2;
        let mut before = 0;
        // Until nothing comes any more.
        for _ in 0..1000 {
            yield_now().await;
            before = rig.port.asked().len();
        }
        assert!((2..=enough).contains(&before), "{before} requests for {SDO_DATA} bytes");
        let expected: Vec<u8> = (0..LONG_SIZE).map(|number| number as u8).collect();
        assert_eq!(whole(pending).await, Ok(expected));
    });
}

#[test]
fn clients_take_turns_at_a_node_and_stops_come_first() {
    let rig = rig(quiet());
    let address = |number: u16| Address::new(0x3000 + number, 0);
    rig.run(async {
        // All of them wait before the pump looks again.
        let busy = [1, 2, 3].map(|number| rig.read(1, 2, address(number)));
        let other = rig.read(2, 2, address(4));
        let third = rig.read(3, 2, address(5));
        let elsewhere = rig.read(1, 4, address(6));
        let stop = rig.order(4, 2, Class::Stop, SdoTransfer::Read { address: address(7), block: false });
        for pending in busy.into_iter().chain([other, third, elsewhere, stop]) {
            assert!(whole(pending).await.is_err());
        }
    });
    let order: Vec<_> = rig.port.asked().into_iter().filter(|(node, _)| *node == 2).collect();
    let order: Vec<_> = order
        .iter()
        .map(|(_, request)| match request {
            Request::InitiateUpload { address } => address.index - 0x3000,
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(order, [7, 1, 4, 5, 2, 3]);
}

#[test]
fn what_nobody_waits_for_is_not_sent_or_aborted_at_the_node() {
    let rig = rig(quiet());
    rig.run(async {
        let running = rig.read(1, SILENT, VALUE);
        let queued = rig.read(1, SILENT, NOTHING);
        while rig.port.asked().is_empty() {
            yield_now().await;
        }
        drop(queued);
        drop(running);
        while rig.port.asked().len() < 2 {
            yield_now().await;
        }
        // Another node is not concerned.
        assert!(whole(rig.read(1, 2, VALUE)).await.is_ok());
    });
    let asked = rig.port.asked();
    let [(9, first), (9, second), (2, _)] = &asked[..] else { panic!("{asked:?}") };
    assert_eq!(*first, Request::InitiateUpload { address: VALUE });
    assert!(matches!(second, Request::Abort { address: VALUE, .. }), "{second:?}");
    assert_eq!(rig.desk.can_statistics(clock::now(), 0).map(|bus| bus.waiting), Some(0));
}

#[test]
fn a_node_that_does_not_answer_is_told_and_costs_the_others_nothing() {
    let rig = rig(quiet());
    rig.run(async {
        let silent = whole(rig.read(1, SILENT, VALUE));
        let others = async {
            for _ in 0..50 {
                assert!(whole(rig.read(2, 3, VALUE)).await.is_ok());
            }
            rig.port.asked().iter().filter(|(node, _)| *node == u32::from(SILENT)).count()
        };
        let (silent, asked) = join(silent, others).await;
        assert_eq!(silent, Err(CanFailure::Sdo(Failure::Timeout { heard: None })));
        assert_eq!(asked, 1, "all of the others' came within its time");
    });
}

#[test]
fn a_permit_that_is_over_sends_nothing() {
    let rig = rig(quiet());
    rig.run(async {
        let permit = rig.desk.permit(clock::now(), 0, Holder::Connection(1)).expect("a permit");
        let write = SdoTransfer::Write { address: VALUE, data: &[1], block: false };
        let mut pending = rig.order(1, 2, Class::Guarded(permit), write);
        rig.desk.revoke(clock::now(), 0, Holder::Gateway).done();
        assert_eq!(pending.written().await, Err(CanFailure::NotSent(Reason::Stopped)));
        let permits: Permits = [permit].into_iter().collect();
        let frame = Frame::full(Id::base(0x202), [0; 8]);
        assert_eq!(rig.desk.send_frame(1, 0, &frame, permits, false).await, Err(Reason::Stopped));
        let nmt = rig.desk.nmt(clock::now(), 0, nmt::Command::Stop, Some(node(2)), &[permit]);
        assert_eq!(nmt, Err(Reason::Stopped));
    });
    assert_eq!(rig.port.said(), []);
}

#[test]
fn frames_of_a_client_are_seen_by_the_others_and_by_the_manager() {
    let rig = rig(quiet());
    rig.run(async {
        let mut own = rig.desk.follow_can(1, 0).expect("a bus");
        let mut other = rig.desk.follow_can(2, 0).expect("a bus");
        let frame = nmt::Sign { node: node(6), state: nmt::State::Operational, toggle: false }.frame();
        assert_eq!(rig.desk.send_frame(1, 0, &frame, Permits::new(), false).await, Ok(()));
        for follower in [&mut own, &mut other] {
            let heard = follower.heard().await.expect("nothing is lost").what;
            assert_eq!(heard, What::Frame { frame, origin: Origin::Client(1) });
            assert!(matches!(follower.heard().await, Ok(Heard { what: What::Node(..), .. })));
        }
        assert_eq!(rig.desk.node(0, node(6)).and_then(|status| status.state), Some(nmt::State::Operational));
        assert_eq!(rig.desk.nodes(0).map(|(node, _)| node.value()).collect::<Vec<_>>(), [6]);
        // One of the bus, and one of the gateway.
        let emergency = puente_canopen::emcy::Emergency { code: 0x8130, register: 1, vendor: [0; 5] };
        rig.port.say(CanEvent::Frame(emergency.frame(node(6))));
        let what =
            [other.heard().await, other.heard().await].map(|heard| heard.expect("nothing is lost").what);
        assert_eq!(what[0], What::Frame { frame: emergency.frame(node(6)), origin: Origin::Bus });
        assert_eq!(what[1], What::Node(node(6), puente_canopen::manager::Event::Emergency(emergency)));
        assert_eq!(
            rig.desk.emergencies(0, node(6)).iter().map(|(_, e)| e.code).collect::<Vec<_>>(),
            [0x8130]
        );
        rig.desk.nmt(clock::now(), 0, nmt::Command::Start, None, &[]).expect("room");
        let heard = other.heard().await.expect("nothing is lost").what;
        let frame = nmt::Command::Start.frame(None);
        assert_eq!(heard, What::Frame { frame, origin: Origin::Gateway });
    });
}

#[test]
fn a_slow_follower_is_told_what_it_has_lost_and_nobody_else_loses_it() {
    use crate::port::limits::CAN_HEARD;
    let rig = rig(quiet());
    let frame = |number: u16| Frame::new(Id::base(0x181), &number.to_le_bytes()).expect("a frame");
    let all = CAN_HEARD as u16 + 10;
    rig.run(async {
        let mut slow = rig.desk.follow_can(1, 0).expect("a bus");
        let mut quick = rig.desk.follow_can(2, 0).expect("a bus");
        for number in 0..all {
            rig.port.say(CanEvent::Frame(frame(number)));
            let heard = quick.heard().await.expect("nothing is lost").what;
            assert_eq!(heard, What::Frame { frame: frame(number), origin: Origin::Bus });
        }
        assert_eq!(slow.heard().await.map_err(|lost| lost.0.get()), Err(10));
        let heard = slow.heard().await.expect("this is there").what;
        assert_eq!(heard, What::Frame { frame: frame(10), origin: Origin::Bus });
        assert_eq!(rig.desk.can_statistics(clock::now(), 0).map(|bus| bus.lost), Some(10));
    });
}

#[test]
fn a_bus_that_is_off_or_down_is_told_and_takes_nothing() {
    let rig = rig(quiet());
    rig.run(async {
        let mut follower = rig.desk.follow_can(1, 0).expect("a bus");
        let mut running = rig.read(1, SILENT, VALUE);
        while rig.port.asked().is_empty() {
            yield_now().await;
        }
        rig.port.full.set(true);
        let frame = Frame::full(Id::base(0x123), [0; 8]);
        let waiting = rig.desk.send_frame(2, 0, &frame, Permits::new(), false);
        let off = async {
            for _ in 0..10 {
                yield_now().await;
            }
            rig.port.say(CanEvent::State(CanState::Off));
        };
        let (sent, ()) = join(waiting, off).await;
        assert_eq!(sent, Err(Reason::LineDown));
        assert_eq!(running.written().await, Err(CanFailure::Sdo(Failure::BusOff)));
        let order = SdoOrder {
            seat: 1,
            bus: 0,
            node: node(2),
            class: Class::Free,
            transfer: SdoTransfer::Read { address: VALUE, block: false },
            timeout: None,
        };
        let refused = rig.desk.sdo(clock::now(), order).err();
        assert_eq!(refused, Some(CanFailure::NotSent(Reason::LineDown)));
        let lss = rig.desk.lss(1, 0, lss::Command::InquireNodeId, None).await;
        assert_eq!(lss, Err(LssFailure::NotSent(Reason::LineDown)));
        let mut states = Vec::new();
        while let Some(heard) = follower.try_heard() {
            if let What::State(state) = heard.expect("nothing is lost").what {
                states.push(state);
            }
        }
        assert_eq!(states, [CanState::Off]);
        // And goes on when it is back.
        rig.port.full.set(false);
        rig.port.say(CanEvent::State(CanState::Active));
        while !rig.is_up() {
            yield_now().await;
        }
        assert!(whole(rig.read(1, 2, VALUE)).await.is_ok());
    });
}

#[test]
fn lss_clients_take_turns() {
    let rig = rig(Config { lss: Duration::from_millis(20), ..quiet() });
    rig.run(async {
        let ask = |seat| rig.desk.lss(seat, 0, lss::Command::InquireNodeId, None);
        let answers = async {
            while rig.port.said().is_empty() {
                yield_now().await;
            }
            let answer = Frame::full(Id::base(cob::LSS_SLAVE), [0x5E, 42, 0, 0, 0, 0, 0, 0]);
            rig.port.say(CanEvent::Frame(answer));
        };
        let ((first, second), ()) = join(join(ask(1), ask(2)), answers).await;
        assert_eq!(first, Ok(lss::Outcome::NodeId(42)));
        assert_eq!(second, Err(LssFailure::Lss(lss::Failure::Timeout)));
        assert_eq!(rig.port.said().len(), 2);
    });
}

/// Whoever goes in the middle of a long scan keeps nobody from the next command.
#[test]
fn an_lss_command_that_nobody_waits_for_is_given_up() {
    let rig = rig(quiet());
    rig.run(async {
        let hour = Some(Duration::from_secs(3_600));
        let scan = rig.desk.lss(1, 0, lss::Command::Fastscan(lss::Known::default()), hour);
        let gone = async {
            while rig.port.said().is_empty() {
                yield_now().await;
            }
        };
        assert!(matches!(select(scan, gone).await, Either::Second(())));
        let next = rig.desk.lss(2, 0, lss::Command::SwitchGlobal(lss::Mode::Waiting), None).await;
        assert_eq!(next, Ok(lss::Outcome::Done));
    });
}

/// A port that is full gives its first place to SYNC.
#[test]
fn sync_goes_before_what_waits_for_the_port() {
    let rig = rig(Config { sync: Duration::from_millis(2), ..quiet() });
    rig.run(async {
        while rig.port.said().is_empty() {
            yield_now().await;
        }
        rig.port.full.set(true);
        rig.desk.nmt(clock::now(), 0, nmt::Command::Start, None, &[]).expect("room");
        let before = rig.port.sent.borrow().len();
        let until = clock::now() + Duration::from_millis(10);
        while clock::now() < until {
            yield_now().await;
        }
        rig.port.full.set(false);
        let nmt = |frame: &Frame| frame.id() == Id::base(cob::NMT);
        while !rig.port.said().iter().any(nmt) {
            yield_now().await;
        }
        assert_eq!(rig.port.sent.borrow()[before].id(), Id::base(cob::SYNC));
    });
}

#[test]
fn a_bus_is_found_by_its_number() {
    let rig = rig(quiet());
    assert_eq!((rig.desk.net(5), rig.desk.net(6), rig.desk.net_of(0)), (Some(0), None, Some(5)));
    assert_eq!(rig.desk.can_buses(), [0]);
    assert!(rig.desk.follow_can(1, 1).is_none() && rig.desk.node(1, node(2)).is_none());
    assert_eq!(rig.desk.nodes(1).count(), 0);
}

//! A client's whole visit at the front, in memory: what it sends in which portions, and what it gets.

use std::cell::RefCell;
use std::convert::Infallible;
use std::future::{pending, poll_fn};
use std::pin::pin;
use std::rc::Rc;
use std::task::Poll;

use embassy_futures::select::{Either4, select4};
use embedded_io_async::{ErrorType, Read, Write};
use puente::axis::{Axes, AxisSpec, DriveSpec, edb, pid};
use puente::bus::{End, Image, Next, Post, Taken, Undelivered, Work};
use puente::desk::{BusImage, BusQueue, BusSpec, Desk, Modules};
use puente::front::Gateway;
use puente::port::{Door, Listener, Peer, Socket};
use puente::settings::keeper::{self, Source};
use puente::settings::{Bus, Framed, Protocol, Settings};
use puente_framed::{Frame, Kind, frame, section};
use puente_line::{Duration, Instant};
use puente_modbus::{Evidence, Outcome};
use puente_modules::Form;

/// One client: each portion is read at once, then it closes its side.
pub struct Client {
    door: Door,
    portions: Vec<Vec<u8>>,
    got: Rc<RefCell<Vec<u8>>>,
}

/// What a client sends ends with its last portion.
pub struct Sender<'c>(&'c mut Vec<Vec<u8>>);
/// Keeps all that a client gets.
pub struct Keeper<'c>(&'c RefCell<Vec<u8>>);

impl ErrorType for Sender<'_> {
    type Error = Infallible;
}

impl Read for Sender<'_> {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let Some(portion) = self.0.first_mut() else {
            return Ok(0);
        };
        let count = portion.len().min(buffer.len());
        buffer[..count].copy_from_slice(&portion[..count]);
        portion.drain(..count);
        if portion.is_empty() {
            self.0.remove(0);
        }
        Ok(count)
    }
}

impl ErrorType for Keeper<'_> {
    type Error = Infallible;
}

impl Write for Keeper<'_> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.0.borrow_mut().extend(bytes);
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl Socket for Client {
    type Error = Infallible;
    type Reader<'a> = Sender<'a>;
    type Writer<'a> = Keeper<'a>;

    fn peer(&self) -> Peer {
        Peer { ip: [127, 0, 0, 1], port: 1 }
    }

    fn door(&self) -> Door {
        self.door
    }

    fn split(&mut self) -> (Sender<'_>, Keeper<'_>) {
        (Sender(&mut self.portions), Keeper(&self.got))
    }

    async fn close(&mut self) {}

    fn abort(&mut self) {}
}

/// Lets the client in, and tells when its place is free again.
struct Place {
    client: Option<Client>,
    left: Rc<RefCell<bool>>,
}

impl Listener for Place {
    type Socket<'a> = Client;

    async fn accept(&mut self) -> Client {
        match self.client.take() {
            Some(client) => client,
            None => {
                *self.left.borrow_mut() = true;
                pending().await
            }
        }
    }
}

static DESK: Desk = Desk::new();
/// The framed bus.
const FRAMED: u8 = 1;

/// The gateway of all visits, with the factory settings, and a framed bus with one axis.
fn gateway() -> &'static Gateway {
    let mut settings = Settings::factory();
    let framed = Bus { protocol: Protocol::Framed(Framed::default()), ..settings.buses[0].clone() };
    settings.buses.push(Bus { name: "f".parse().expect("a name"), ..framed }).expect("room");
    let settings: &Settings = Box::leak(Box::new(settings));
    let buses = settings.buses.iter().map(|bus| BusSpec {
        units: bus.modbus().map(|modbus| modbus.units).unwrap_or_default(),
        queue_timeout: Duration::from_secs(3),
        reply_timeout: Duration::from_millis(500),
    });
    DESK.configure(buses, Duration::from_millis(250));
    DESK.send_frames_to(FRAMED);
    let axes = settings.axes.iter().map(|axis| AxisSpec {
        name: axis.name.clone(),
        bus: 0,
        bus_name: axis.bus.clone(),
        address: axis.address,
        drive: DriveSpec::Edb(edb::Spec { max_rpm: 3000, registers: Default::default() }),
    });
    DESK.add_cyclic(settings.axes.len() as u8, FRAMED, Default::default());
    let module = AxisSpec {
        name: "m".parse().expect("a name"),
        bus: FRAMED,
        bus_name: "f".parse().expect("a name"),
        address: 17,
        drive: DriveSpec::Pid(pid::Spec { form: Form::Text, within: Duration::from_millis(100) }),
    };
    let axes = axes.chain([module]);
    let axes = Axes::new(&DESK, axes);
    let keeper = keeper::Keeper::new(Box::leak(Box::default()), Source::Factory, None, false);
    Box::leak(Box::new(Gateway::new(settings, &DESK, axes, Box::leak(Box::new(keeper)))))
}

/// A bus without wire: each request is answered at once, with a plain reply or not at all.
async fn answer(desk: &'static Desk) {
    let queue = BusQueue { desk, bus: 0 };
    loop {
        let job = match queue.next(Instant::ZERO, |_, _| Instant::ZERO) {
            Next::Job(job) => job,
            Next::Wait(_) => {
                queue.changed().await;
                continue;
            }
        };
        let pdu = queue.request(job.ticket, <[u8]>::to_vec);
        let outcome = match pdu.as_slice() {
            [3 | 4, _, _, 0, count @ 1..=125] => {
                let mut reply = vec![pdu[0], count * 2];
                reply.resize(2 + usize::from(*count) * 2, 0);
                queue.finish(Instant::ZERO, job.ticket, End::Master(Outcome::Reply(&reply)));
                continue;
            }
            [6, ..] => Outcome::Reply(&pdu),
            _ => Outcome::NoReply(Evidence::Silence),
        };
        queue.finish(Instant::ZERO, job.ticket, End::Master(outcome));
    }
}

/// A framed bus without wire: each packet is whole and from somebody, is on the line or not, and is answered by a receipt.
async fn carry(desk: &'static Desk) {
    let image: BusImage<'_, Modules> =
        BusImage { desk, bus: FRAMED, axes: Default::default(), kind: std::marker::PhantomData };
    loop {
        let mut sent = Vec::new();
        image.outgoing(Instant::ZERO, |packet| {
            sent = packet.to_vec();
            Taken::Yes
        });
        if sent.is_empty() {
            image.changed().await;
            continue;
        }
        let Frame { origin, .. } = frame::parse(&sent).expect("a whole frame");
        assert_ne!(origin, 0, "a frame of nobody");
        let lrc = sent[sent.len() - 2];
        if lrc & 1 == 0 {
            image.posted(Err(Undelivered::LineDown));
            continue;
        }
        image.posted(Ok(()));
        let mut receipt = heapless::Vec::<u8, 32>::new();
        let body = [origin, 0, section::TERMINATOR];
        if frame::emit(&mut receipt, 17, Kind::Receipt { lrc }, &body).is_ok() {
            image.heard(&receipt);
        }
    }
}

/// What a client gets that sends these portions through this door, until the gateway has done with it.
pub fn visit(door: Door, portions: Vec<Vec<u8>>) -> Vec<u8> {
    static GATEWAY: std::sync::OnceLock<&'static Gateway> = std::sync::OnceLock::new();
    let gateway = *GATEWAY.get_or_init(gateway);
    let (got, left) = (Rc::default(), Rc::default());
    let client = Client { door, portions, got: Rc::clone(&got) };
    let mut place = Place { client: Some(client), left: Rc::clone(&left) };
    let free = poll_fn(|_| if *left.borrow() { Poll::Ready(()) } else { Poll::Pending });
    let all = select4(puente::front::serve(gateway, 0, &mut place), answer(&DESK), carry(&DESK), free);
    embassy_futures::block_on(async {
        match pin!(all).await {
            Either4::First(never) => never,
            Either4::Second(()) | Either4::Third(()) | Either4::Fourth(()) => {}
        }
    });
    got.take()
}

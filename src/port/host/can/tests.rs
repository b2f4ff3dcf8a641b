//! The ports against adapters that are threads of the test, and against the simulated bus.

use std::io::Write as _;
use std::net::{TcpListener, TcpStream};
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread;

use embassy_futures::select::{Either, select};
use embassy_time::{Duration, Timer, with_timeout};
use puente_canopen::{Id, NodeId, nmt};
use puente_cell::can::{DriveConfig, Model};
use puente_slcan::{Command, End, Lines, Reply};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use super::*;
use crate::port::CanState;

/// More than any step of a test takes.
const LIMIT: Duration = Duration::from_secs(20);

fn run<R>(future: impl Future<Output = R>) -> R {
    async_io::block_on(with_timeout(LIMIT, future)).expect("in time")
}

fn port(text: &str) -> Can {
    Can::new(CanSpec::parse(text, 500_000, || Config::new(500_000)).expect("a port"))
}

fn listen() -> (TcpListener, Can) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address");
    (listener, port(&format!("slcan:tcp:{address}")))
}

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::new(Id::base(id), data).expect("a frame")
}

/// What kind of adapter it is.
#[derive(Clone, Copy, PartialEq)]
enum Manners {
    /// It answers everything.
    Lawicel,
    /// It answers nothing.
    Silent,
    /// As Lawicel's, but it has no room for each frame when it is said first.
    Full,
}

/// An adapter: what it was told and obeyed goes to `told`. It ends with its connection, or where `until` says so.
fn adapter(
    mut stream: impl std::io::Read + std::io::Write,
    manners: Manners,
    told: &Sender<Command>,
    until: impl Fn(&Command) -> bool,
) {
    let (mut lines, mut open, mut refused) = (Lines::new(), false, Vec::new());
    let mut byte = [0];
    while let Ok(1) = stream.read(&mut byte) {
        let Some((End::Return, Some(line))) = lines.push(byte[0]) else { continue };
        let Ok(command) = Command::parse(line) else { panic!("{line:?}") };
        let again = manners == Manners::Full && !refused.contains(&command);
        let reply = match command {
            Command::Send(_) if again => {
                refused.push(command);
                Reply::Refused
            }
            Command::Send(_) if open => Reply::Taken { extended: false },
            Command::Flags if open => Reply::Flags(puente_slcan::Flags(0)),
            Command::Send(_) | Command::Flags => Reply::Refused,
            Command::Close if !open => Reply::Refused,
            _ => Reply::Done,
        };
        match command {
            Command::Open => open = true,
            Command::Close => open = false,
            _ => {}
        }
        if manners != Manners::Silent && stream.write_all(&reply.emit()).is_err() {
            return;
        }
        if reply == Reply::Refused || matches!(command, Command::Nothing | Command::Flags) {
            continue;
        }
        let end = until(&command);
        // The test may know enough.
        let _ = told.send(command);
        if command == Command::Open {
            // Each adapter says what is on its bus, and something that nobody understands.
            stream.write_all(b"t0010\r?!\rt7051051234\r").expect("said");
        }
        if end {
            return;
        }
    }
}

/// An adapter on a connection.
fn tcp(listener: TcpListener, manners: Manners) -> (Receiver<Command>, thread::JoinHandle<()>) {
    let (told, tells) = mpsc::channel();
    let thread = thread::spawn(move || {
        let (stream, _) = listener.accept().expect("the port");
        stream.set_nodelay(true).expect("a connection");
        adapter(stream, manners, &told, |_| false);
    });
    (tells, thread)
}

async fn until(reader: &mut Reader<'_>, state: CanState) {
    while reader.read().await != CanEvent::State(state) {}
}

/// Works for the port until something else is done.
async fn meanwhile<R>(reader: &mut Reader<'_>, future: impl Future<Output = R>) -> R {
    let reading = async {
        loop {
            reader.read().await;
        }
    };
    match select(reading, future).await {
        Either::First(never) => never,
        Either::Second(done) => done,
    }
}

/// Frames go out in order, whether the adapter answers, says nothing, or has no room at first.
fn sends(manners: Manners) {
    let (listener, mut can) = listen();
    let (told, thread) = tcp(listener, manners);
    let (mut reader, mut writer) = can.split();
    run(async {
        assert_eq!(writer.write(&frame(1, &[])).await, Err(NotTaken(CanState::Down)));
        let mut heard = Vec::new();
        while heard.len() < 3 {
            heard.push(reader.read().await);
        }
        // An adapter that says nothing is known to be open after that.
        heard.sort_by_key(|event| *event != CanEvent::State(CanState::Active));
        let stamped = frame(0x705, &[5]);
        assert_eq!(heard[0], CanEvent::State(CanState::Active));
        assert_eq!(heard[1..], [frame(1, &[]), stamped].map(CanEvent::Frame));
        for number in 0..50 {
            // Without anybody who reads: the writer works for itself.
            writer.write(&frame(0x602, &[number])).await.expect("taken");
        }
        meanwhile(&mut reader, async {
            let mut sent = Vec::new();
            while sent.len() < 50 {
                sent.extend(told.try_iter().filter_map(|told| match told {
                    Command::Send(frame) => Some(frame),
                    _ => None,
                }));
                Timer::after_millis(1).await;
            }
            let expected: Vec<_> = (0..50).map(|number| frame(0x602, &[number])).collect();
            assert_eq!(sent, expected);
        })
        .await;
    });
    drop(can);
    thread.join().expect("the adapter");
}

#[test]
fn an_adapter_that_answers_gets_frames_in_order() {
    sends(Manners::Lawicel);
}

#[test]
fn an_adapter_that_says_nothing_gets_them_too() {
    sends(Manners::Silent);
}

#[test]
fn an_adapter_that_has_no_room_gets_them_again() {
    sends(Manners::Full);
}

#[test]
fn an_adapter_is_closed_set_and_opened_in_this_order() {
    let (listener, mut can) = listen();
    let (told, thread) = tcp(listener, Manners::Lawicel);
    let (mut reader, _) = can.split();
    run(until(&mut reader, CanState::Active));
    let told: Vec<_> = told.try_iter().collect();
    assert_eq!(told, [Command::Rate(Rate::K500), Command::Open], "what is closed is not closed again");
    drop(can);
    thread.join().expect("the adapter");
}

/// The adapter is pulled and comes back: the port is down, then active again, and set and opened anew.
#[test]
fn an_adapter_that_was_pulled_is_opened_again() {
    let (listener, mut can) = listen();
    let (told, tells) = mpsc::channel();
    let thread = thread::spawn(move || {
        for _ in 0..2 {
            let (stream, _) = listener.accept().expect("the port");
            adapter(stream, Manners::Lawicel, &told, |command| matches!(command, Command::Send(_)));
        }
    });
    let (mut reader, mut writer) = can.split();
    run(async {
        for _ in 0..2 {
            until(&mut reader, CanState::Active).await;
            writer.write(&frame(1, b"bye")).await.expect("taken");
            until(&mut reader, CanState::Down).await;
            assert_eq!(writer.write(&frame(1, b"bye")).await, Err(NotTaken(CanState::Down)));
        }
    });
    let opened = tells.iter().filter(|told| *told == Command::Open).count();
    assert_eq!(opened, 2);
    thread.join().expect("the adapter");
}

/// A serial device: a pseudo-terminal.
#[test]
fn an_adapter_may_be_a_serial_device() {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo-terminal");
    grantpt(&master).expect("its other end");
    unlockpt(&master).expect("its other end");
    let path = ptsname(&master, Vec::new()).expect("a name").into_string().expect("text");
    let device = std::fs::File::from(master);
    let (told, tells) = mpsc::channel();
    let thread = thread::spawn(move || {
        adapter(device, Manners::Silent, &told, |command| matches!(command, Command::Send(_)));
    });
    let mut can = port(&format!("slcan:{path}"));
    let (mut reader, mut writer) = can.split();
    run(async {
        until(&mut reader, CanState::Active).await;
        writer.write(&frame(0x123, b"tty")).await.expect("taken");
        meanwhile(&mut reader, async {
            while !tells.try_iter().any(|told| told == Command::Send(frame(0x123, b"tty"))) {
                Timer::after_millis(1).await;
            }
        })
        .await;
    });
    thread.join().expect("the adapter");
}

/// Nobody reads: what is heard is kept as far as there is room, and the rest is counted.
#[test]
fn what_finds_no_room_is_counted() {
    const SENT: u32 = 1_000;
    let (listener, mut can) = listen();
    let thread = thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("the port");
        let reader = stream.try_clone().expect("a connection");
        let (told, tells) = mpsc::channel();
        thread::spawn(move || adapter(reader, Manners::Lawicel, &told, |_| false));
        while !matches!(tells.recv().expect("a frame"), Command::Send(_)) {}
        for _ in 0..SENT {
            stream.write_all(b"t0010\r").expect("said");
        }
        stream
    });
    let (mut reader, mut writer) = can.split();
    run(async {
        until(&mut reader, CanState::Active).await;
        let stream: TcpStream = {
            let sending = async {
                // The writer works for the port, and reads what nobody takes away.
                loop {
                    writer.write(&frame(1, &[])).await.expect("taken");
                    Timer::after_millis(1).await;
                    if thread.is_finished() {
                        break;
                    }
                }
            };
            sending.await;
            thread.join().expect("the adapter")
        };
        let (mut frames, mut lost) = (0, 0);
        while frames + lost < SENT {
            match reader.read().await {
                CanEvent::Frame(_) => frames += 1,
                CanEvent::Lost(count) => lost += count,
                CanEvent::State(_) => {}
            }
        }
        assert!(frames as usize >= EVENTS, "{frames}");
        assert_eq!(reader.counters().lost, lost);
        drop(stream);
    });
}

/// A node of the simulated cell boots, and obeys; no frame comes back to who sent it.
#[test]
fn the_simulated_cell_is_a_bus() {
    let cell = || Config::new(500_000).with(DriveConfig::new(5, Model::Node).expect("a node-ID"));
    let mut can = Can::new(CanSpec::parse("sim", 500_000, cell).expect("a port"));
    let (mut reader, mut writer) = can.split();
    run(async {
        assert_eq!(reader.read().await, CanEvent::State(CanState::Active));
        assert_eq!(reader.read().await, CanEvent::Frame(frame(0x705, &[0])), "boot-up");
        let node = NodeId::new(5).expect("a node-ID");
        let reset = nmt::Command::ResetNode.frame(Some(node));
        writer.write(&reset).await.expect("taken");
        assert_eq!(reader.read().await, CanEvent::Frame(frame(0x705, &[0])), "boot-up");
        assert_eq!(reader.counters(), CanCounters::default());
    });
}

#[test]
fn ports_have_names() {
    let good = ["sim", "slcan:/dev/ttyACM0", "slcan:tcp:localhost:29000"];
    assert!(good.iter().all(|port| check_can(port, 1_000_000).is_ok()));
    assert_eq!(check_can("socketcan:can0", 1_000_000).is_ok(), cfg!(target_os = "linux"));
    let bad =
        ["", "slcan:", "slcan:ttyACM0", "slcan:tcp:host", "slcan:tcp:host:0", "socketcan:", "/dev/ttyACM0"];
    for port in bad.into_iter().chain(["socketcan:sixteen-letters-", "socketcan:a/b", "can-1"]) {
        assert_eq!(check_can(port, 1_000_000), Err(BadPort::Can), "{port}");
    }
    assert_eq!(check_can("slcan:/dev/ttyACM0", 83_300), Err(BadPort::BitRate));
    assert_eq!(check_can("slcan:/dev/ttyACM0", 750_000), Ok(()));
}

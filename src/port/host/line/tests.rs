//! Both halves of a line at once.

use std::io::{Read as _, Write as _};
use std::net::{Shutdown, TcpListener, TcpStream};

use embassy_futures::join::join;
use embassy_futures::select::{Either, select};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use super::*;

/// More than any step of a test takes.
const LIMIT: Duration = Duration::from_secs(20);

fn run<R>(future: impl Future<Output = R>) -> R {
    async_io::block_on(with_timeout(LIMIT, future)).expect("in time")
}

fn settings() -> Settings {
    Settings { baud: 115_200, format: "8N1".parse().expect("a format") }
}

fn line(port: &str) -> Line {
    let cell = || Simulation::Modbus(puente_cell::Config::new(Mode::Rtu, settings(), &[1]));
    Line::new(LineSpec::parse(port, settings(), || Some(cell())).expect("a line"))
}

fn listen() -> (TcpListener, String) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address");
    (listener, format!("tcp:{address}"))
}

async fn read_exactly(reader: &mut Reader<'_>, count: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    while bytes.len() < count {
        let mut buffer = [0; 64];
        let length = reader.read(&mut buffer).await.expect("bytes");
        bytes.extend_from_slice(&buffer[..length]);
    }
    bytes
}

/// An end that gives back what it gets, until the other one goes.
fn echo(mut stream: TcpStream) {
    let mut buffer = [0; 64];
    while let Ok(count @ 1..) = stream.read(&mut buffer) {
        stream.write_all(&buffer[..count]).expect("echo");
    }
}

#[test]
fn one_half_waits_while_the_other_sends() {
    let (listener, port) = listen();
    let peer = std::thread::spawn(move || echo(listener.accept().expect("the line").0));
    let mut line = line(&port);
    let (mut reader, mut writer) = line.split();
    let (heard, sent) = run(join(read_exactly(&mut reader, 4), writer.write_all(b"echo")));
    sent.expect("sent");
    assert_eq!(heard, b"echo");
    drop(line);
    peer.join().expect("the peer");
}

#[test]
fn the_simulated_cell_answers_a_reader_that_was_there_first() {
    let mut line = line("sim");
    let (mut reader, mut writer) = line.split();
    // Read holding register 0 of drive 1.
    let request = [1, 3, 0, 0, 0, 1, 0x84, 0x0A];
    let send = async {
        // The reader waits already, without a time to wait for.
        Timer::after_millis(1).await;
        writer.write_all(&request).await
    };
    let (heard, sent) = run(join(read_exactly(&mut reader, 7), send));
    sent.expect("sent");
    assert_eq!(heard[..3], [1, 3, 2]);
}

/// What is lost is opened once, whichever half notices, and both go on with what is new.
#[test]
fn both_halves_outlast_the_loss_of_their_line() {
    let (listener, port) = listen();
    let peer = std::thread::spawn(move || {
        let (first, _) = listener.accept().expect("the line");
        first.shutdown(Shutdown::Both).expect("lost");
        drop(first);
        echo(listener.accept().expect("the line again").0);
        listener.set_nonblocking(true).expect("a listener");
        listener.accept().is_err()
    });
    let mut line = line(&port);
    let (mut reader, mut writer) = line.split();
    let mut buffer = [0; 64];
    let lost = run(reader.read(&mut buffer)).expect_err("nobody there");
    assert_eq!(lost.kind(), io::ErrorKind::UnexpectedEof);
    let (heard, sent) = run(join(read_exactly(&mut reader, 5), writer.write_all(b"again")));
    sent.expect("sent");
    assert_eq!(heard, b"again");
    drop(line);
    assert!(peer.join().expect("the peer"), "the line was opened a third time");
}

/// The writer's loss of an old connection does not take the new one away.
#[test]
fn a_late_error_of_the_old_connection_leaves_the_new_one_alone() {
    let (listener, port) = listen();
    let line = line(&port);
    let old = run(line.open()).expect("open");
    line.lost(&old, &io::ErrorKind::BrokenPipe.into());
    let new = run(line.open()).expect("open again");
    line.lost(&old, &io::ErrorKind::BrokenPipe.into());
    assert!(line.wire().is_some_and(|wire| wire.is(&new)));
    drop(listener);
}

#[test]
fn nothing_is_sent_where_the_line_is_not_there() {
    let (listener, port) = listen();
    drop(listener);
    let mut line = line(&port);
    let (mut reader, mut writer) = line.split();
    let mut buffer = [0; 1];
    let outcome = run(select(reader.read(&mut buffer), writer.write(b"x")));
    let Either::Second(Err(error)) = outcome else { panic!("{outcome:?}") };
    assert_eq!(error.kind(), io::ErrorKind::NotConnected);
}

/// A pseudo-terminal has not sent what its other end has no room for.
#[test]
fn what_a_device_has_not_sent_is_dropped() {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pty");
    grantpt(&master).expect("granted");
    unlockpt(&master).expect("unlocked");
    let path = ptsname(&master, Vec::new()).expect("a name").into_string().expect("text");
    let mut line = line(&path);
    let (_, mut writer) = line.split();
    let written = run(writer.write(&[b'x'; 20_000])).expect("sent");
    writer.discard();
    run(writer.write_all(b"jam")).expect("sent");
    let mut file = File::from(master);
    let mut got = Vec::new();
    while !got.ends_with(b"jam") {
        let mut buffer = [0; 4096];
        let count = file.read(&mut buffer).expect("bytes");
        got.extend_from_slice(&buffer[..count]);
    }
    assert!(got.len() < written, "{} of {written} bytes", got.len());
}

/// What is discarded of a simulated framed line is not heard, what was under way before is.
#[test]
fn a_simulated_framed_line_gives_back_what_is_sent() {
    // 1 ms a character.
    let settings = Settings { baud: 10_000, ..settings() };
    let cell = || Simulation::Framed(puente_cell::framed::Config::new(settings, &[17]));
    let mut line = Line::new(LineSpec::parse("sim", settings, || Some(cell())).expect("a line"));
    let (mut reader, mut writer) = line.split();
    run(writer.write_all(b"a")).expect("sent");
    assert_eq!(run(read_exactly(&mut reader, 1)), b"a");
    run(writer.write_all(&[b'b'; 60_000])).expect("sent");
    writer.discard();
    run(writer.write_all(b"jam")).expect("sent");
    let mut heard = Vec::new();
    while !heard.ends_with(b"jam") {
        heard.extend(run(read_exactly(&mut reader, 1)));
    }
    assert!(heard.len() < 60_000, "{}", heard.len());
}

//! What the gateway takes for an SLCAN adapter on TCP: it notes when SYNC comes, and what the drives are told and say.

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread;
use std::time::Instant;

/// What was on its way.
pub enum Passed {
    /// SYNC, given to the adapter then.
    Sync(Instant),
    /// A set-point to a drive (receive PDO 4).
    SetPoint,
    /// Status and position of a drive (transmit PDO 3).
    Answer,
}

/// An adapter with nothing behind it, which takes everything at once.
pub fn alone() -> Result<(SocketAddr, Receiver<Passed>), String> {
    serve(|mut stream, passed| {
        let mut lines = Lines::default();
        while let Some((now, bytes)) = read(&mut stream) {
            let mut answers = Vec::new();
            for line in lines.push(&bytes) {
                note(&line, now, &passed)?;
                answers.extend_from_slice(answer(&line));
            }
            stream.write_all(&answers).ok()?;
        }
        Some(())
    })
}

/// What is between the gateway and an adapter.
pub fn before(adapter: SocketAddr) -> Result<(SocketAddr, Receiver<Passed>), String> {
    serve(move |stream, passed| {
        let cell = TcpStream::connect(adapter).ok()?;
        cell.set_nodelay(true).ok()?;
        let back = (cell.try_clone().ok()?, stream.try_clone().ok()?, passed.clone());
        let back = thread::spawn(move || carry(back.0, back.1, &back.2));
        carry(stream, cell, &passed);
        // It has ended with its streams.
        let _ = back.join();
        Some(())
    })
}

/// Serves one connection after the other; it ends with whoever wants to know.
fn serve(
    mut connection: impl FnMut(TcpStream, Sender<Passed>) -> Option<()> + Send + 'static,
) -> Result<(SocketAddr, Receiver<Passed>), String> {
    let listener = TcpListener::bind("127.0.0.1:0").map_err(|error| error.to_string())?;
    let address = listener.local_addr().map_err(|error| error.to_string())?;
    let (sender, receiver) = mpsc::channel();
    thread::spawn(move || {
        while let Ok((stream, _)) = listener.accept() {
            if stream.set_nodelay(true).is_ok() {
                // What becomes of one is nothing to the next.
                let _ = connection(stream, sender.clone());
            }
        }
    });
    Ok((address, receiver))
}

/// Carries bytes until one side ends.
fn carry(mut from: TcpStream, mut to: TcpStream, passed: &Sender<Passed>) {
    let mut lines = Lines::default();
    while let Some((now, bytes)) = read(&mut from) {
        if to.write_all(&bytes).is_err() {
            break;
        }
        if lines.push(&bytes).iter().any(|line| note(line, now, passed).is_none()) {
            break;
        }
    }
    let _ = from.shutdown(Shutdown::Both);
    let _ = to.shutdown(Shutdown::Both);
}

fn read(stream: &mut TcpStream) -> Option<(Instant, Vec<u8>)> {
    let mut buffer = [0; 1024];
    let count = stream.read(&mut buffer).ok().filter(|count| *count > 0)?;
    Some((Instant::now(), buffer[..count].to_vec()))
}

/// Lines as they become whole.
#[derive(Default)]
struct Lines(Vec<u8>);

impl Lines {
    fn push(&mut self, bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut whole = Vec::new();
        for byte in bytes {
            match byte {
                b'\r' => whole.push(std::mem::take(&mut self.0)),
                byte => self.0.push(*byte),
            }
        }
        whole
    }
}

/// Tells of a frame; `None` where nobody wants to know any more.
fn note(line: &[u8], now: Instant, passed: &Sender<Passed>) -> Option<()> {
    // A refusal (bell) may stand before what was heard.
    let frame = line.iter().position(|byte| *byte == b't').and_then(|at| line.get(at..at + 4));
    let what = match frame {
        Some(b"t080") => Passed::Sync(now),
        Some([b't', b'5', b'0', b'2'..=b'4']) => Passed::SetPoint,
        Some([b't', b'3', b'8', b'2'..=b'4']) => Passed::Answer,
        _ => return Some(()),
    };
    passed.send(what).ok()
}

/// As the Lawicel adapters answer.
fn answer(line: &[u8]) -> &'static [u8] {
    match line.first() {
        Some(b't' | b'r') => b"z\r",
        Some(b'F') => b"F00\r",
        Some(b'V') => b"V1013\r",
        _ => b"\r",
    }
}

//! The request side of a serial line, for simulated slaves and tests.

use core::time::Duration;

use heapless::Deque;
use puente_line::{Instant, Settings};

use crate::length::{self, Length};
use crate::stream::Stream;
use crate::{Frame, FrameError, Mode, ascii, function, rtu};

/// Results that wait for [`Decoder::poll`]; the oldest is dropped for a fifth.
const QUEUE: usize = 4;

/// Finds request frames in a line's bytes: by decoded length for the functions with types, by silence for others, from CR LF in
/// ASCII. Garbage before a frame is passed over.
#[derive(Clone, Debug)]
pub struct Decoder {
    framing: Framing,
    gap: Duration,
    last: Instant,
    results: Deque<Result<Frame, FrameError>, QUEUE>,
}

#[derive(Clone, Debug)]
enum Framing {
    Rtu(Stream),
    Ascii(ascii::Decoder),
}

impl Decoder {
    /// A decoder for a line.
    pub fn new(mode: Mode, line: Settings) -> Self {
        let framing = match mode {
            Mode::Rtu => Framing::Rtu(Stream::new()),
            Mode::Ascii => Framing::Ascii(ascii::Decoder::new()),
        };
        Self { framing, gap: rtu::t3_5(line), last: Instant::ZERO, results: Deque::new() }
    }

    /// Takes what the line said.
    pub fn receive(&mut self, now: Instant, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        self.elapse(now);
        if let Framing::Rtu(stream) = &mut self.framing
            && now.since(self.last) > ascii::CHARACTER_TIMEOUT
        {
            // A request that was cut so long ago is never completed.
            stream.clear();
        }
        self.last = now;
        let mut frame = Frame::empty();
        for &byte in bytes {
            match &mut self.framing {
                Framing::Rtu(stream) => {
                    stream.push(byte);
                    while stream.next(lengths, &mut frame) {
                        keep(&mut self.results, Ok(frame.clone()));
                    }
                }
                Framing::Ascii(decoder) => {
                    if let Some(result) = decoder.push(now, byte) {
                        keep(&mut self.results, result);
                    }
                }
            }
        }
    }

    /// The next request, or why the bytes of a burst were none.
    pub fn poll(&mut self, now: Instant) -> Option<Result<Frame, FrameError>> {
        self.elapse(now);
        self.results.pop_front()
    }

    /// When to poll again.
    pub fn poll_at(&self) -> Option<Instant> {
        match &self.framing {
            _ if !self.results.is_empty() => Some(Instant::ZERO),
            Framing::Rtu(stream) if stream.is_unsettled() => Some(self.last + self.gap),
            _ => None,
        }
    }

    fn elapse(&mut self, now: Instant) {
        if let Framing::Rtu(stream) = &mut self.framing
            && stream.is_unsettled()
            && now >= self.last + self.gap
        {
            stream.silence();
            let mut frame = Frame::empty();
            while stream.next(lengths, &mut frame) {
                keep(&mut self.results, Ok(frame.clone()));
            }
            if let Some(error) = stream.damage() {
                keep(&mut self.results, Err(error));
            }
        }
    }
}

fn keep(results: &mut Deque<Result<Frame, FrameError>, QUEUE>, result: Result<Frame, FrameError>) {
    if results.is_full() {
        results.pop_front();
    }
    let _ = results.push_back(result);
}

fn lengths(adu: &[u8]) -> [Length; 2] {
    let pdu = adu.get(1..).unwrap_or(&[]);
    // Diagnostics have one word of data, but nothing in the frame says so.
    let other = match pdu {
        [function::DIAGNOSTICS, ..] => Length::Silence,
        _ => Length::Never,
    };
    [length::request(pdu), other]
}

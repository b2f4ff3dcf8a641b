//! A framed station as a node, with what it is for.

use puente_framed::Station;
use puente_framed::station::Action;
use puente_line::Instant;

use crate::heard::{Drive, Heard, Node};

/// What a station is for: where its frames come from, and what becomes of those it gets.
pub trait Application<const TO: usize, const FROM: usize, const W: usize, const M: usize, const N: usize> {
    /// Something has come, or is done: never `Transmit`, `Jam` or `Idle`.
    fn take(&mut self, now: Instant, action: Action<'_>);

    /// May give the station something to do.
    fn drive(&mut self, now: Instant, station: &mut Station<TO, FROM, W, M, N>);

    /// When to be asked again, besides after [`Application::take`].
    fn drive_at(&self) -> Option<Instant> {
        None
    }
}

/// A [`Station`] with its application.
pub struct Framed<A, const TO: usize, const FROM: usize, const W: usize, const M: usize, const N: usize> {
    /// What it is for.
    pub application: A,
    /// The station; after something was done to it, [`crate::Line::tell`] must have been called.
    pub station: Station<TO, FROM, W, M, N>,
}

impl<A, const TO: usize, const FROM: usize, const W: usize, const M: usize, const N: usize> Node
    for Framed<A, TO, FROM, W, M, N>
where
    A: Application<TO, FROM, W, M, N>,
{
    fn hear(&mut self, now: Instant, heard: Heard) {
        match heard {
            Heard::Byte(byte) => self.station.receive(now, byte),
            Heard::Damaged => self.station.line_error(now),
        }
    }

    fn carrier(&mut self, now: Instant) {
        self.station.carrier(now);
    }

    fn poll(&mut self, now: Instant) -> Option<Drive> {
        loop {
            self.application.drive(now, &mut self.station);
            match self.station.poll(now) {
                Action::Transmit(bytes) => return Some(Drive::Transmit(bytes.to_vec())),
                Action::Jam(bytes) => return Some(Drive::Jam(bytes.to_vec())),
                Action::Idle => return None,
                action => self.application.take(now, action),
            }
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        [self.station.poll_at(), self.application.drive_at()].into_iter().flatten().min()
    }
}

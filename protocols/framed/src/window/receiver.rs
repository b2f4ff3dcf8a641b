//! The receiving end of a window.

use heapless::Vec;
use puente_line::Instant;

use super::{Config, MAX_WINDOW};
use crate::{Class, Kind, Number, Random, Reason, Session};

/// The receiving end of a window: puts frames into their order.
#[derive(Clone, Debug)]
pub struct Receiver<const W: usize, const M: usize> {
    random: Random,
    /// Whose frames are taken.
    session: Option<Session>,
    /// To which the first frame of it will change.
    offered: Option<Session>,
    /// Number of the next frame to be delivered.
    next: Number,
    /// Frames from there on that have arrived, by number modulo `W`.
    frames: [Incoming<M>; W],
    /// Frames delivered since the last acknowledgement.
    unacknowledged: usize,
    /// When to acknowledge.
    acknowledge_at: Option<Instant>,
    /// The last opening is to be answered.
    consent: bool,
    /// What is to be refused.
    refusal: Option<(Reason, Session)>,
}

#[derive(Clone, Debug)]
struct Incoming<const M: usize> {
    arrived: bool,
    class: Class,
    body: Vec<u8, M>,
}

impl<const W: usize, const M: usize> Receiver<W, M> {
    /// Frames have their place by number modulo `W`.
    const PLACES: () = assert!(W.is_power_of_two() && W <= MAX_WINDOW, "a window is 1, 2, 4 or 8 frames");

    /// A receiver without a session.
    pub const fn new(seed: u64) -> Self {
        const { Self::PLACES };
        Self {
            random: Random::new(seed),
            session: None,
            offered: None,
            next: Number::ZERO,
            frames: [const { Incoming { arrived: false, class: Class::Data, body: Vec::new() } }; W],
            unacknowledged: 0,
            acknowledge_at: None,
            consent: false,
            refusal: None,
        }
    }

    /// The next frame in order, once.
    pub(crate) fn take(&mut self, config: &Config, now: Instant) -> Option<(Class, &[u8])> {
        let at = self.place(self.next);
        if !self.frames.get(at)?.arrived {
            return None;
        }
        self.next = self.next.plus(1);
        self.unacknowledged += 1;
        let soon = if self.unacknowledged * 2 >= W { now } else { now + config.acknowledge_after };
        self.acknowledge_by(soon);
        let frame = self.frames.get_mut(at)?;
        frame.arrived = false;
        Some((frame.class, &frame.body))
    }

    /// Whether [`Receiver::take`] has a frame.
    pub(crate) fn has_frame(&self) -> bool {
        self.frames.get(self.place(self.next)).is_some_and(|frame| frame.arrived)
    }

    /// The sender asks for a session.
    pub(crate) fn opened(&mut self, sender: u16) {
        // A repeated opening gets the same answer; only a frame of it shows that the answer has arrived.
        if self.offered.is_none_or(|offered| offered.sender != sender) {
            let receiver = (self.random.next() as u16).max(1);
            self.offered = Some(Session { sender, receiver });
        }
        self.consent = true;
    }

    /// A frame of a window has come.
    pub(crate) fn arrived(&mut self, now: Instant, number: Number, class: Class, of: Session, body: &[u8]) {
        if self.offered == Some(of) {
            self.begin(of);
        }
        if self.session != Some(of) {
            self.refusal = Some((Reason::Session, of));
            return;
        }
        let ahead = number.since(self.next);
        let place = self.place(number);
        let Some(frame) = self.frames.get_mut(place) else {
            return;
        };
        if usize::from(ahead) >= W || frame.arrived {
            // It comes again: the acknowledgement has been lost.
            return self.acknowledge_by(now);
        }
        match Vec::from_slice(body) {
            Ok(body) => *frame = Incoming { arrived: true, class, body },
            Err(_) => self.refusal = Some((Reason::TooLong, of)),
        }
        if ahead > 0 {
            // Something is missing, unless it has not been taken yet.
            self.acknowledge_by(now);
        }
    }

    /// What to put on the line now, if anything.
    pub(crate) fn next(&self, now: Instant) -> Option<Kind> {
        if let Some((reason, session)) = self.refusal {
            return Some(Kind::Refusal { reason, session });
        }
        if let (true, Some(session)) = (self.consent, self.offered) {
            return Some(Kind::Consent { session, window: W as u8 });
        }
        let session = self.session?;
        self.acknowledge_at.filter(|at| *at <= now)?;
        let held = (0..W as u8).filter(|ahead| {
            let place = self.place(self.next.plus(*ahead));
            self.frames.get(place).is_some_and(|frame| frame.arrived)
        });
        let held = held.fold(0, |bits, ahead| bits | 1 << ahead);
        Some(Kind::Acknowledgement { next: self.next.value() as u8, held, session })
    }

    /// What [`Receiver::next`] gave is on its way. Should it get lost there, the sender asks again.
    pub(crate) fn sent(&mut self, kind: Kind) {
        match kind {
            Kind::Refusal { .. } => self.refusal = None,
            Kind::Consent { .. } => self.consent = false,
            Kind::Acknowledgement { .. } => {
                self.acknowledge_at = None;
                self.unacknowledged = 0;
            }
            _ => {}
        }
    }

    /// What [`Receiver::next`] gave did not get onto the line.
    pub(crate) fn failed(&mut self, now: Instant, kind: Kind) {
        match kind {
            Kind::Consent { .. } => self.consent = self.offered.is_some(),
            Kind::Acknowledgement { .. } => self.acknowledge_by(now),
            _ => {}
        }
    }

    /// When [`Receiver::next`] has something.
    pub(crate) fn next_at(&self) -> Option<Instant> {
        if self.refusal.is_some() || self.consent { Some(Instant::ZERO) } else { self.acknowledge_at }
    }

    /// Whether nothing waits to be delivered or sent.
    pub(crate) fn is_idle(&self) -> bool {
        self.next_at().is_none() && !self.frames.iter().any(|frame| frame.arrived)
    }

    /// Leaves the last session for the one offered.
    fn begin(&mut self, session: Session) {
        self.session = Some(session);
        self.offered = None;
        self.consent = false;
        self.next = Number::ZERO;
        self.unacknowledged = 0;
        self.acknowledge_at = None;
        for frame in &mut self.frames {
            frame.arrived = false;
        }
    }

    fn acknowledge_by(&mut self, time: Instant) {
        self.acknowledge_at = Some(self.acknowledge_at.map_or(time, |at| at.min(time)));
    }

    fn place(&self, number: Number) -> usize {
        usize::from(number.value()) % W
    }
}

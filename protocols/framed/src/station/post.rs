//! Frames outside of any window.
//!
//! There is no queue, nor a buffer: a frame is taken when no other is in work.

use heapless::Vec;
use puente_line::Instant;

use super::{PostError, Sending, Station};
use crate::arbiter::Precedence;
use crate::frame::{self, EmitError, Frame, Kind};

impl<const TO: usize, const FROM: usize, const W: usize, const M: usize, const N: usize>
    Station<TO, FROM, W, M, N>
{
    /// Takes a frame outside of any window. It is sent once.
    ///
    /// # Errors
    /// `Busy`, `Unmade`.
    pub fn post(&mut self, now: Instant, kind: Kind, body: &[u8]) -> Result<(), PostError> {
        self.post_with(now, Precedence::Ordinary, kind, |buffer| {
            buffer.extend_from_slice(body).map_err(|_| EmitError::TooLong)
        })
    }

    /// Takes the bytes of a whole frame, for one who makes his own; from origin 0 it goes as one of this station. It is sent
    /// once.
    ///
    /// # Errors
    /// Any [`PostError`].
    pub fn post_frame(&mut self, now: Instant, bytes: &[u8]) -> Result<(), PostError> {
        let Frame { origin, kind, body } = frame::parse(bytes).map_err(PostError::NoFrame)?;
        let origin = if origin == 0 { self.config.address } else { origin };
        self.submit_post(now, Precedence::Ordinary, |buffer| frame::emit(buffer, origin, kind, body))
    }

    /// Takes a frame outside of any window, the sections of which `write` appends to the buffer. It is sent once.
    ///
    /// # Errors
    /// `Busy`, `Unmade`.
    pub fn post_with(
        &mut self,
        now: Instant,
        precedence: Precedence,
        kind: Kind,
        write: impl FnOnce(&mut Vec<u8, N>) -> Result<(), EmitError>,
    ) -> Result<(), PostError> {
        let origin = self.config.address;
        self.submit_post(now, precedence, |buffer| frame::build(buffer, origin, kind, write))
    }

    fn submit_post(
        &mut self,
        now: Instant,
        precedence: Precedence,
        write: impl FnOnce(&mut Vec<u8, N>) -> Result<(), EmitError>,
    ) -> Result<(), PostError> {
        if precedence == Precedence::Answer && self.can_answer() {
            self.step_back(now);
        }
        let taken = self.arbiter.submit(now, precedence, write);
        taken.map_err(|why| why.map_or(PostError::Busy, PostError::Unmade))?;
        self.sending = Sending::Post;
        Ok(())
    }

    /// Whether something can be posted.
    pub const fn is_free(&self) -> bool {
        !self.arbiter.is_busy()
    }

    /// Whether an answer can be posted. A frame of a window that is not on the line steps back for it.
    pub const fn can_answer(&self) -> bool {
        self.is_free() || (self.arbiter.is_waiting() && !matches!(self.sending, Sending::Post))
    }

    /// Whether what was posted is not on the line, for good or until its next attempt.
    pub const fn is_waiting(&self) -> bool {
        matches!(self.sending, Sending::Post) && self.arbiter.is_waiting()
    }

    /// Takes back what was posted and is not on the line; false where there is nothing. It is not reported then.
    pub fn withdraw(&mut self) -> bool {
        matches!(self.sending, Sending::Post) && self.arbiter.withdraw()
    }

    /// Puts another frame in the place of what was posted and is not on the line, as [`Station::post_with`] does; its
    /// back-off goes on. False where there is nothing. A frame that cannot be made is taken back, and not reported.
    pub fn repost(
        &mut self,
        now: Instant,
        kind: Kind,
        write: impl FnOnce(&mut Vec<u8, N>) -> Result<(), EmitError>,
    ) -> bool {
        let origin = self.config.address;
        // What collided may go again now.
        self.arbiter.elapse(now);
        let posted = matches!(self.sending, Sending::Post);
        posted && self.arbiter.rewrite(|buffer| frame::build(buffer, origin, kind, write))
    }

    /// The bytes of the frame last heard, until the next poll or byte.
    pub fn heard(&self) -> &[u8] {
        self.decoder.frame_bytes()
    }

    /// The bytes of the frame in work, or of the last one.
    pub fn sent(&self) -> &[u8] {
        self.arbiter.frame()
    }
}

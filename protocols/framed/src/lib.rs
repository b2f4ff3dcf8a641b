//! The framed RS-485 bus of the Querétaro platform: many stations on one pair, any of which may speak first.
//!
//! Sans-io: bytes and the time go in, bytes and results come out.
//!
//! - [`frame`], [`section`], [`Decoder`]: what is on the line.
//! - [`Arbiter`]: CSMA/CD. When to talk, and when to stop.
//! - [`window`]: frames that arrive once and in order, or are reported lost.
//! - [`Station`]: all of these together.
//!
//! # The frame
//! ```text
//! 7E | origin 1 | tag and length 2, big-endian | packet | LRC 1 | 0A
//! packet: DADR 1 | LEN 1 | DAT LEN | TMR 1, repeated
//! ```
//! Its source is clause 3.3.5 of the thesis on the platform, *the thesis* throughout this crate. What that leaves open is
//! decided so:
//!
//! - **Length** is that of the packet, 45 to 1530 bytes: six sections of 255. It needs 11 bits; the upper five of its two
//!   bytes are the *tag*, which is 0 in the thesis.
//! - **LRC** is the two's complement of the sum of the *packet*, as the thesis' `valueLRC(PKG, LEN)` and `send_frames` have
//!   it. The prose says only "the data". So nothing protects origin and length of a frame of the thesis, and of damaged
//!   packets one in 256 passes. (Its `csma_frame` takes the one's complement of another frame; its `send_frames` leaves the
//!   length out and puts a destination before the origin. The table of clause 3.3.5 decides.)
//! - **LEN** counts DAT alone ("the length of the data").
//! - **TMR** has no value in the thesis. We send [`section::TERMINATOR`] (assumed) and take any, but in tagged frames.
//! - **DADR 0** is nobody: such a section fills a packet up to 45 bytes. **DADR 255** is the frame itself, see below.
//!
//! # Tagged frames
//! Five bits are too few for a kind and a number, so the tag carries one of them and the packet the other:
//!
//! | tag | frame |
//! |--:|---|
//! | 0 | of the thesis: any number of destinations, no more check than the LRC |
//! | 1 | acknowledgement |
//! | 2 | negative acknowledgement |
//! | 3, 4, 5 | status, event, data outside of any window |
//! | 6, 7 | opening of a window, and the consent to it |
//! | 8-15 | reserved; no frame |
//! | 16-31 | one of a window: its number is the lower four bits |
//!
//! A window of 8 frames with selective repeat needs 16 numbers, on a line that keeps no frames back. The packet of a tagged
//! frame ends with a section that is the frame's own, its *trailer*:
//!
//! ```text
//! FF | 0A | detail 2 | session 4 | CRC 4 | 0D
//! ```
//! - *detail*: of a frame of a window its kind (3, 4, 5), and eight more bits of its number, so that one which was kept back
//!   after all, say by a serial server, is not taken for the sixteenth after it; of an acknowledgement the lower eight bits
//!   of the number expected next, and a bit for each from that on that is already there; of an acknowledgement to a frame of
//!   the thesis that frame's LRC and 0; of a negative acknowledgement the [`Reason`], numbered from 1 on, and 0; of the consent to a window its
//!   size and 0; 0 and 0 otherwise.
//! - *session*: see [`window`]; 0 outside of any.
//! - *CRC*: CRC-32C, big-endian, over everything from origin to session. It finds all of up to five wrong bits in frames of
//!   up to 655 bytes, of up to three in longer ones, and all but one in 2^32 of anything else.
//!
//! The first section of a tagged frame is addressed to its destination. It needs no 45 bytes, so that an acknowledgement is
//! one of 22: what asks for a least length is that a frame must not end before its sender has heard of a collision, and
//! that takes less than [`arbiter::Config::slot`], 8 characters unless set otherwise. A frame that ends with a trailer but
//! has tag 0 is damaged, for its LRC says nothing about its tag; therefore a frame of the thesis must not end so.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub mod arbiter;
mod decoder;
pub mod frame;
mod number;
mod random;
pub mod section;
pub mod station;
pub mod window;

pub use arbiter::Arbiter;
pub use decoder::Decoder;
pub use frame::{Class, Frame, FrameError, Kind, Reason, Session};
pub use number::Number;
pub use random::Random;
pub use station::Station;

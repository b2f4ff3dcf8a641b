//! What goes into a node and comes out of it.

use puente_drives::pid::{Command, Module, Refused, Status};
use puente_framed::station;
use puente_line::Instant;

use crate::Form;

/// How a node works.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Its station.
    pub station: station::Config,
    /// How settings for it are written.
    pub form: Form,
}

/// The position loop that a node serves: a [`Module`], or what stands for one that runs elsewhere. Each call is short, so
/// that a loop in an interrupt is held up for no longer than one of them takes.
pub trait Loop {
    /// [`Module::command`].
    ///
    /// # Errors
    /// As there; nothing has changed then.
    fn command(&mut self, now: Instant, command: Command) -> Result<(), Refused>;

    /// [`Module::status`].
    fn status(&self) -> Status;
}

impl Loop for Module {
    fn command(&mut self, now: Instant, command: Command) -> Result<(), Refused> {
        Module::command(self, now, command)
    }

    fn status(&self) -> Status {
        Module::status(self)
    }
}

/// What the caller has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action<'a> {
    /// Send these bytes, now and without a pause, and keep listening.
    Transmit(&'a [u8]),
    /// Stop sending, with the character that is under way, and send this instead.
    Jam(&'static [u8]),
    /// Nothing until something is heard, or the time of [`super::Node::poll_at`].
    Idle,
}

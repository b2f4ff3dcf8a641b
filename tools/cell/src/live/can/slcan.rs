//! The adapter's end of SLCAN.

use puente_canopen::{Frame, Id};
use puente_line::{Instant, millis};
use puente_slcan::{BusState, Command, End, Flags, Lines, Reply};

use super::AHEAD;
use crate::can::Cell;
use crate::can::bus::{Counters, Heard, State};

/// An adapter. The bit rate that it is told does not matter: the bus has its own.
#[derive(Default)]
pub struct Slcan {
    lines: Lines,
    open: bool,
    silent: bool,
    stamps: bool,
    /// What its client knows of the controller.
    told: Counters,
}

/// Milliseconds of a time stamp begin anew after a minute.
const MINUTE: u64 = 60_000;

impl Slcan {
    /// Takes a byte of the client.
    pub fn take(&mut self, byte: u8, cell: &mut Cell, port: usize, now: Instant, outbox: &mut Vec<u8>) {
        let Some((End::Return, line)) = self.lines.push(byte) else { return };
        let reply = match line.map(Command::parse) {
            Some(Ok(command)) => self.obey(command, cell, port, now),
            _ => Reply::Refused,
        };
        outbox.extend_from_slice(reply.emit().as_ref());
    }

    fn obey(&mut self, command: Command, cell: &mut Cell, port: usize, now: Instant) -> Reply {
        let allow = |right| if right { Reply::Done } else { Reply::Refused };
        match command {
            Command::Rate(_) | Command::Timing { .. } | Command::Code(_) | Command::Mask(_) => {
                allow(!self.open)
            }
            Command::Open | Command::Listen => {
                let closed = !self.open;
                if closed {
                    (self.open, self.silent) = (true, matches!(command, Command::Listen));
                }
                allow(closed)
            }
            Command::Close => {
                cell.discard(port);
                self.open = false;
                Reply::Done
            }
            Command::Send(frame) => self.send(frame, cell, port, now),
            Command::Flags => Reply::Flags(flags(cell.counters(port))),
            Command::Version => Reply::Version { hardware: 10, software: 13 },
            Command::Serial => Reply::Serial(*b"SIM1"),
            Command::Stamps(on) => {
                if !self.open {
                    self.stamps = on;
                }
                allow(!self.open)
            }
            Command::Nothing => Reply::Done,
        }
    }

    fn send(&mut self, frame: Frame, cell: &mut Cell, port: usize, now: Instant) -> Reply {
        if !self.open || self.silent || cell.pending(port) >= AHEAD {
            return Reply::Refused;
        }
        cell.send(now, port, &frame);
        Reply::Taken { extended: matches!(frame.id(), Id::Extended(_)) }
    }

    /// Tells how the controller is, where that has changed.
    pub fn look(&mut self, now: Counters, outbox: &mut Vec<u8>) {
        let told = states(std::mem::replace(&mut self.told, now), now);
        if self.open {
            outbox.extend(told.iter().flat_map(Reply::emit));
        }
    }

    /// A frame has been on the bus.
    pub fn tell(&mut self, heard: &Heard, outbox: &mut Vec<u8>) {
        if self.open {
            let stamp = (millis(heard.at.since(Instant::ZERO)) % MINUTE) as u16;
            let reply = Reply::Heard { frame: heard.frame, stamp: self.stamps.then_some(stamp) };
            outbox.extend_from_slice(reply.emit().as_ref());
        }
    }
}

/// What an adapter tells of its controller, whose counters were others `before`: the bus-off that is over already, too.
pub fn states(before: Counters, now: Counters) -> Vec<Reply> {
    let reply = |state, counters: Counters| {
        let (rx_errors, tx_errors) = (counters.receive(), counters.transmit());
        let state = match state {
            State::Active => BusState::Active,
            State::Warning => BusState::Warning,
            State::Passive => BusState::Passive,
            State::Off => BusState::Off,
        };
        Reply::State { state, rx_errors, tx_errors }
    };
    let missed = now.bus_offs() != before.bus_offs() && now.state() != State::Off;
    let known = if missed { State::Off } else { before.state() };
    let changed = known != now.state();
    missed
        .then(|| reply(State::Off, now))
        .into_iter()
        .chain(changed.then(|| reply(now.state(), now)))
        .collect()
}

/// Its status flags, as Lawicel's adapters have them: one that is off cannot be told from one that is warned.
pub fn flags(counters: Counters) -> Flags {
    Flags(match counters.state() {
        State::Active => 0,
        State::Warning | State::Off => Flags::WARNING,
        State::Passive => Flags::WARNING | Flags::PASSIVE,
    })
}

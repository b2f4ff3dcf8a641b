//! A door where the gateway is an SLCAN adapter on its first CANopen bus.

use embassy_futures::select::{Either3, select3};
use embedded_io_async::{Read, Write};
use puente_canopen::Id;
use puente_line::Instant;
use puente_slcan::{Command, Flags, Lines, Reply};

use super::super::inbox::Inbox;
use super::super::{End, Gateway, Guest, idle, send};
use crate::clock;
use crate::desk::{CanFollower, Heard, Lost, Origin, What};
use crate::port::CanState;
use crate::settings::ClientFrames;

/// Milliseconds that time stamps count to.
const MINUTE: u64 = 60_000;

/// The adapter as its client has set it up.
struct Adapter<'g> {
    gateway: &'g Gateway,
    guest: Guest,
    bus: u8,
    /// It is open.
    follower: Option<CanFollower<'g>>,
    /// The client wants to listen only.
    mute: bool,
    stamps: bool,
    /// Frames were lost since the client has asked last.
    lost: bool,
}

/// Serves a client until the visit is over.
pub(in crate::front) async fn serve<R: Read, W: Write>(
    gateway: &Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
) -> End {
    let Some((bus, _)) = gateway.can_buses().next() else {
        return End::Refused;
    };
    let mut adapter =
        Adapter { gateway, guest, bus, follower: None, mute: false, stamps: false, lost: false };
    adapter.attend(inbox, writer).await.unwrap_or_else(|end| end)
}

impl Adapter<'_> {
    async fn attend<R: Read, W: Write>(
        &mut self,
        inbox: &mut Inbox<'_, R>,
        writer: &mut W,
    ) -> Result<End, End> {
        let mut lines = Lines::new();
        let patience = puente_line::Duration::from_micros(idle(self.gateway).as_micros());
        loop {
            while let Some(byte) = inbox.data().first().copied() {
                inbox.consume(1);
                if let Some((_, line)) = lines.push(byte) {
                    let command = line.and_then(|line| Command::parse(line).ok());
                    let reply = self.obey(inbox.ended(), command).await;
                    send(writer, &reply.emit()).await?;
                }
            }
            if inbox.ended() {
                return Ok(End::Closed);
            }
            // Who listens need not speak.
            let until = if self.follower.is_none() { Some(clock::now() + patience) } else { None };
            match select3(inbox.fill(), heard(&mut self.follower), clock::at(until)).await {
                Either3::First(filled) => filled?,
                Either3::Second(heard) => self.tell(writer, heard).await?,
                Either3::Third(()) => return Ok(End::Idle),
            }
        }
    }

    async fn obey(&mut self, gone: bool, command: Option<Command>) -> Reply {
        let settings = self.gateway.settings.buses.get(usize::from(self.bus)).and_then(|bus| bus.canopen());
        match command {
            Some(Command::Nothing | Command::Code(_) | Command::Mask(_)) => Reply::Done,
            // The bus has its rate.
            Some(Command::Rate(rate)) if settings.is_some_and(|bus| rate.bits() == bus.bitrate) => {
                Reply::Done
            }
            Some(Command::Open | Command::Listen) => {
                self.mute = command == Some(Command::Listen);
                if self.follower.is_none() {
                    self.follower = self.gateway.desk.follow_can(self.guest.seat, self.bus);
                }
                Reply::Done
            }
            Some(Command::Close) => {
                self.follower = None;
                Reply::Done
            }
            Some(Command::Stamps(on)) => {
                self.stamps = on;
                Reply::Done
            }
            Some(Command::Send(frame)) => {
                let allowed = settings.is_some_and(|bus| bus.client_frames == ClientFrames::Write);
                if !allowed || self.mute || self.follower.is_none() {
                    return Reply::Refused;
                }
                match self.gateway.send_frame(self.guest, gone, self.bus, &frame).await {
                    Ok(()) => Reply::Taken { extended: matches!(frame.id(), Id::Extended(_)) },
                    Err(_) => Reply::Refused,
                }
            }
            Some(Command::Flags) => Reply::Flags(self.flags()),
            Some(Command::Version) => Reply::Version { hardware: 0x10, software: 0x10 },
            Some(Command::Serial) => Reply::Serial(*b"PUEN"),
            None | Some(Command::Rate(_) | Command::Timing { .. }) => Reply::Refused,
        }
    }

    fn flags(&mut self) -> Flags {
        let state =
            self.gateway.desk.can_statistics(clock::now(), self.bus).map(|statistics| statistics.state);
        let state = match state {
            Some(CanState::Active) => 0,
            Some(CanState::Warning) => Flags::WARNING,
            Some(CanState::Passive) => Flags::PASSIVE,
            _ => Flags::BUS_ERROR,
        };
        let lost = if core::mem::take(&mut self.lost) { Flags::OVERRUN } else { 0 };
        Flags(state | lost)
    }

    /// Tells of a frame that another station has sent, or that the gateway or another client has.
    async fn tell<W: Write>(&mut self, writer: &mut W, heard: Result<Heard, Lost>) -> Result<(), End> {
        match heard {
            Ok(Heard { at, what: What::Frame { frame, origin } })
                if origin != Origin::Client(self.guest.seat) =>
            {
                let stamp = self.stamps.then(|| stamp(at));
                send(writer, &Reply::Heard { frame, stamp }.emit()).await
            }
            Ok(_) => Ok(()),
            Err(_) => {
                self.lost = true;
                Ok(())
            }
        }
    }
}

fn stamp(at: Instant) -> u16 {
    (at.as_micros() / 1000 % MINUTE) as u16
}

/// What is heard next; nothing for a closed adapter.
pub(super) async fn heard(follower: &mut Option<CanFollower<'_>>) -> Result<Heard, Lost> {
    match follower {
        Some(follower) => follower.heard().await,
        None => core::future::pending().await,
    }
}

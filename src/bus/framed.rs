//! The pump of a framed bus: its cycle, and the frames of clients.

use embassy_futures::select::{Either4, select4};
use embassy_time::Timer;
use embedded_io_async::{Error, ErrorKind, Read, Write};
use puente_framed::station::PostError;
use puente_line::{Duration, Instant};
use puente_modules::Master;
use puente_modules::master::{Action, Axis, Config};

use super::{Image, Post, Taken, Undelivered};
use crate::clock;
use crate::port::limits::{AXES, FRAME, PEERS, WINDOW};
use crate::port::{LineReader, LineWriter, SerialLine};

/// Keeps a dead port from being asked in a tight loop.
const RETRY: embassy_time::Duration = embassy_time::Duration::from_millis(100);
/// The pump shows life so often,
const SIGN: Duration = Duration::from_millis(500);
/// and may be late by this: more than a pause of [`RETRY`], or than anything above it takes of the processor.
const LATE: Duration = Duration::from_millis(500);

/// What a pump works with.
pub struct Setup {
    /// How the master works, but for what the port takes.
    pub config: Config,
    /// The modules of the bus, in the order of the [`Image`].
    pub axes: heapless::Vec<Axis, AXES>,
    /// Differs from that of every other station, and from start to start.
    pub seed: u64,
}

type BusMaster = Master<AXES, PEERS, WINDOW, FRAME>;

/// What is being sent.
#[derive(Clone, Copy)]
enum Sending {
    Nothing,
    /// The master's frame, from here on.
    Frame(usize),
    Jam(&'static [u8]),
}

/// Keeps the axes of a bus as the `image` wants them, for ever, and tells it what they are at; between that it sends the
/// frames of clients. It listens while it talks.
pub async fn pump(line: &mut impl SerialLine, setup: Setup, image: &(impl Image + Post)) -> ! {
    let (mut reader, mut writer) = line.split();
    let mut config = setup.config;
    config.station.arbiter.latency = reader.latency();
    config.station.silence = config.station.arbiter.gap + reader.latency();
    let mut master = BusMaster::new(config, setup.axes, clock::now(), setup.seed);
    let mut sending = Sending::Nothing;
    let mut buffer = [0; 64];
    let mut down = false;
    loop {
        let now = clock::now();
        if reader.carrier() {
            master.carrier(now);
        }
        sending = act(&mut master, &mut writer, image, now, down, sending);
        image.outputs(now, |place, output| master.set(place, output));
        image.outgoing(now, |frame| post(&mut master, now, frame));
        let sign = now + SIGN;
        let wake = master.poll_at().map_or(sign, |wake| wake.min(sign));
        image.alive(sign + LATE);
        let rest = match sending {
            Sending::Nothing => &[],
            Sending::Frame(sent) => master.sending().get(sent..).unwrap_or_default(),
            Sending::Jam(rest) => rest,
        };
        let read = reader.read(&mut buffer);
        let failed =
            match select4(read, send(&mut writer, rest), clock::at(Some(wake)), image.changed()).await {
                Either4::First(Ok(count)) if count > 0 => {
                    for byte in buffer.get(..count).unwrap_or_default() {
                        let now = clock::now();
                        master.receive(now, *byte);
                        sending = act(&mut master, &mut writer, image, now, down, sending);
                    }
                    None
                }
                Either4::First(Ok(_)) => Some(ErrorKind::Other),
                Either4::First(Err(error)) => Some(error.kind()),
                Either4::Second(Ok(count)) => {
                    sending = sending.after(count, rest.len());
                    None
                }
                Either4::Second(Err(error)) => {
                    sending = Sending::Nothing;
                    Some(error.kind())
                }
                Either4::Third(()) | Either4::Fourth(()) => continue,
            };
        match failed {
            None => {}
            Some(ErrorKind::InvalidData) => master.line_error(clock::now()),
            // A port that is gone takes its time.
            Some(_) => Timer::after(RETRY).await,
        }
        let is_down = failed.is_some_and(|kind| kind != ErrorKind::InvalidData);
        if is_down != down {
            down = is_down;
            image.line(down);
        }
    }
}

impl Sending {
    /// What is left when `count` of `rest` bytes are on their way.
    fn after(self, count: usize, rest: usize) -> Self {
        match self {
            _ if count >= rest => Sending::Nothing,
            Sending::Nothing => Sending::Nothing,
            Sending::Frame(sent) => Sending::Frame(sent + count),
            Sending::Jam(bytes) => Sending::Jam(bytes.get(count..).unwrap_or_default()),
        }
    }
}

/// Hands on what there is to send; for ever where there is nothing.
async fn send<W: Write>(writer: &mut W, bytes: &[u8]) -> Result<usize, W::Error> {
    match bytes {
        [] => core::future::pending().await,
        bytes => writer.write(bytes).await,
    }
}

/// Hands a client's frame on.
fn post(master: &mut BusMaster, now: Instant, frame: &[u8]) -> Taken {
    match master.post(now, frame) {
        Ok(()) => Taken::Yes,
        Err(PostError::Busy) => Taken::NotYet,
        Err(PostError::NoFrame(_) | PostError::Unmade(_)) => Taken::Never(Undelivered::TooLong),
    }
}

/// Does what the master asks for until it is idle; what is to be sent then.
fn act(
    master: &mut BusMaster,
    writer: &mut impl LineWriter,
    image: &(impl Image + Post),
    now: Instant,
    down: bool,
    mut sending: Sending,
) -> Sending {
    loop {
        match master.poll(now) {
            Action::Idle => return sending,
            Action::Transmit(_) => sending = Sending::Frame(0),
            Action::Jam(jam) => {
                writer.discard();
                sending = Sending::Jam(jam);
            }
            Action::Reported { axis, report, current } => {
                image.reported(now, axis, report, current);
                image.counted(master.statistics());
            }
            Action::Missed { .. } => image.counted(master.statistics()),
            Action::Event { axis, event } => image.happened(axis, event),
            Action::Fell { axis, to } => image.fell(now, axis, to),
            Action::Heard(frame) => image.heard(frame),
            // Whatever the master makes of a port that is not there.
            Action::Posted(_) if down => image.posted(Err(Undelivered::LineDown)),
            Action::Posted(outcome) => image.posted(outcome.map_err(Undelivered::Line)),
        }
    }
}

//! The pump of a framed bus: its cycle, and the frames of clients.

use embassy_futures::select::{Either4, select4};
use embassy_time::Timer;
use embedded_io_async::{Error, ErrorKind, Read, Write};
use puente_framed::station::PostError;
use puente_line::{Duration, Instant};
use puente_modules::Master;
use puente_modules::master::{Action, Axis, Config};
use static_cell::StaticCell;

use super::{Cycles, Post, Taken, Undelivered};
use crate::clock;
use crate::port::limits::{AXES, FRAME, PEERS, WINDOW};
use crate::port::{LineReader, LineWriter, SerialLine};

/// Keeps a dead port from being asked in a tight loop.
const RETRY: embassy_time::Duration = embassy_time::Duration::from_millis(100);
/// The pump shows life so often,
const SIGN: Duration = Duration::from_millis(500);
/// and may be late by this: more than a pause of [`RETRY`], or than anything above it takes of the processor.
const LATE: Duration = Duration::from_millis(500);

/// A port that connects over a network tells within this time whether it can.
const OPEN: Duration = Duration::from_secs(4);

/// What a pump works with.
pub struct Setup {
    /// How the master works, but for what the port takes.
    pub config: Config,
    /// The modules of the bus, in the order of the [`Image`](super::Image).
    pub axes: heapless::Vec<Axis, AXES>,
    /// Differs from that of every other station, and from start to start.
    pub seed: u64,
    /// Where the master lives. No other pump has it.
    pub room: &'static Room,
}

type BusMaster = Master<AXES, PEERS, WINDOW, FRAME>;

/// Room for a master, too big for a stack.
pub type Room = StaticCell<BusMaster>;

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
pub async fn pump(line: &mut impl SerialLine, setup: Setup, image: &(impl Cycles + Post)) -> ! {
    let (mut reader, mut writer) = line.split();
    let master = start(setup, reader.latency());
    let mut sending = Sending::Nothing;
    let mut buffer = [0; 64];
    let mut down = open(&mut writer, image).await;
    let mut now = clock::now();
    loop {
        if reader.carrier() {
            master.carrier(now);
        }
        sending = act(master, &mut writer, image, now, down, sending);
        image.outputs(now, |place, output| master.set(place, output));
        image.outgoing(now, |frame| post(master, now, frame));
        let sign = now + SIGN;
        let wake = master.poll_at().map_or(sign, |wake| wake.min(sign));
        image.alive(clock::now() + SIGN + LATE);
        let rest = match sending {
            Sending::Nothing => &[],
            Sending::Frame(sent) => master.sending().get(sent..).unwrap_or_default(),
            Sending::Jam(rest) => rest,
        };
        let read = reader.read(&mut buffer);
        let next = select4(read, send(&mut writer, rest), clock::at(Some(wake)), image.changed()).await;
        let before = now;
        now = clock::now();
        let failed = match next {
            Either4::First(Ok(count)) if count > 0 => {
                now = heard(before, now, wake);
                for byte in buffer.get(..count).unwrap_or_default() {
                    master.receive(now, *byte);
                    sending = act(master, &mut writer, image, now, down, sending);
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
        if failed == Some(ErrorKind::InvalidData) {
            master.line_error(now);
            continue;
        }
        let is_down = failed.is_some();
        if is_down != down {
            down = is_down;
            image.line(down);
        }
        if down {
            // A port that is gone takes its time.
            Timer::after(RETRY).await;
            open(&mut writer, image).await;
            now = clock::now();
        }
    }
}

/// A master for a port that may be so late. It is made here, so that the pump does not keep the stack for that.
#[inline(never)]
fn start(setup: Setup, latency: Duration) -> &'static mut BusMaster {
    let Setup { mut config, axes, seed, room } = setup;
    config.station.arbiter.latency = latency;
    config.station.silence = config.station.arbiter.gap + latency;
    room.init_with(|| BusMaster::new(config, axes, clock::now(), seed))
}

/// When the master hears what has just been read. What is there when the time has come was there before: so the time goes
/// on when there is nothing left to be read, and a pump that is late takes its own echo for what it is. Not for ever, lest
/// a line that is never silent holds everything up.
fn heard(before: Instant, now: Instant, wake: Instant) -> Instant {
    let heard = now.min(wake.before()).max(before);
    if now.since(heard) < LATE { heard } else { now }
}

/// Waits until the port is open, and leaves it in peace while it opens. Tells whether that failed at first.
async fn open(writer: &mut impl LineWriter, image: &(impl Cycles + Post)) -> bool {
    let mut failed = false;
    loop {
        image.alive(clock::now() + OPEN + LATE);
        if writer.flush().await.is_ok() {
            return failed;
        }
        failed = true;
        image.line(true);
        image.outgoing(clock::now(), |_| Taken::Never(Undelivered::LineDown));
        Timer::after(RETRY).await;
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
    image: &(impl Cycles + Post),
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
            Action::Missed { .. } | Action::Failed => image.counted(master.statistics()),
            Action::Event { axis, event } => image.happened(axis, event),
            Action::Fell { axis, to } => image.fell(now, axis, to),
            Action::Heard(frame) => image.heard(frame),
            // Whatever the master makes of a port that is not there.
            Action::Posted(_) if down => image.posted(Err(Undelivered::LineDown)),
            Action::Posted(outcome) => image.posted(outcome.map_err(Undelivered::Line)),
        }
    }
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;

    use embassy_futures::select::select;
    use embassy_futures::yield_now;
    use embedded_io_async::ErrorType;
    use puente_drives::pid::Event;
    use puente_framed::station;
    use puente_modules::master::{Output, Statistics};
    use puente_modules::{Control, Form, Report};

    use super::super::Image;
    use super::*;

    /// A port that is opened by a flush which is not dropped before its end, and written to after that.
    struct Slow<'a> {
        open: &'a Cell<bool>,
        sent: &'a Cell<usize>,
    }

    struct Half<'a>(&'a Slow<'a>);

    impl ErrorType for Half<'_> {
        type Error = ErrorKind;
    }

    impl Read for Half<'_> {
        async fn read(&mut self, _: &mut [u8]) -> Result<usize, ErrorKind> {
            core::future::pending().await
        }
    }

    impl Write for Half<'_> {
        async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
            if !self.0.open.get() {
                return Err(ErrorKind::NotConnected);
            }
            self.0.sent.set(self.0.sent.get() + bytes.len());
            Ok(bytes.len())
        }

        async fn flush(&mut self) -> Result<(), ErrorKind> {
            let begun = clock::now();
            while clock::now() < begun + Duration::from_millis(30) {
                yield_now().await;
            }
            self.0.open.set(true);
            Ok(())
        }
    }

    impl LineReader for Half<'_> {}

    impl LineWriter for Half<'_> {
        fn discard(&mut self) {}
    }

    impl SerialLine for Slow<'_> {
        type Error = ErrorKind;
        type Reader<'a>
            = Half<'a>
        where
            Self: 'a;
        type Writer<'a>
            = Half<'a>
        where
            Self: 'a;

        fn split(&mut self) -> (Half<'_>, Half<'_>) {
            (Half(self), Half(self))
        }
    }

    /// One axis of which nothing is wanted; and the last sign of life.
    struct Nothing(Cell<Option<Instant>>);

    impl Image for Nothing {
        type Output = Output;
        type Report = Report;
        type Fall = Control;

        fn outputs(&self, _: Instant, mut set: impl FnMut(usize, Output)) -> Option<Instant> {
            set(0, Output::default());
            None
        }

        fn reported(&self, _: Instant, _: usize, _: Report, _: bool) {}

        fn fell(&self, _: Instant, _: usize, _: Control) {}

        async fn changed(&self) {
            core::future::pending().await
        }

        fn line(&self, _: bool) {}

        fn alive(&self, until: Instant) {
            self.0.set(Some(until));
        }
    }

    impl Cycles for Nothing {
        fn happened(&self, _: usize, _: Event) {}

        fn counted(&self, _: Statistics) {}
    }

    impl Post for Nothing {
        fn outgoing(&self, _: Instant, _: impl FnOnce(&[u8]) -> Taken) {}

        fn posted(&self, _: Result<(), Undelivered>) {}

        fn heard(&self, _: &[u8]) {}
    }

    /// The cycle is many times shorter than what this port takes to open.
    #[test]
    fn a_port_has_the_time_that_it_takes_to_open() {
        let line = puente_line::Settings { baud: 1_000_000, format: "8N1".parse().expect("a format") };
        let setup = Setup {
            config: Config { station: station::Config::new(1, line, 64), cycle: Duration::from_millis(2) },
            axes: [Axis { address: 17, form: Form::Text }].into_iter().collect(),
            seed: 1,
            room: Box::leak(Box::new(Room::new())),
        };
        let (opened, sent) = (Cell::new(false), Cell::new(0));
        let mut slow = Slow { open: &opened, sent: &sent };
        let image = Nothing(Cell::new(None));
        let before = clock::now();
        embassy_futures::block_on(select(pump(&mut slow, setup, &image), async {
            while sent.get() == 0 {
                yield_now().await;
            }
        }));
        assert!(opened.get());
        let word = image.0.get().expect("a sign of life").since(before);
        assert!(word >= SIGN + LATE, "{word:?}");
    }

    #[test]
    fn what_was_there_when_the_time_came_was_heard_before() {
        let at = Instant::from_millis;
        assert_eq!(heard(at(10), at(20), at(50)), at(20), "in time");
        assert_eq!(heard(at(10), at(200), at(50)), at(50).before(), "read late");
        assert_eq!(heard(at(10), at(200), at(5)), at(10), "the time never goes back");
        assert_eq!(heard(at(10), at(700), at(50)), at(700), "a line that is never silent");
    }
}

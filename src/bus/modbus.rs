//! The pump of a Modbus serial line, RTU or ASCII.

use embassy_futures::select::{Either3, select3};
use embassy_time::Timer;
use embedded_io_async::{Error, ErrorKind, Read};
use puente_line::{Duration, Instant};
use puente_modbus::{Action, Config, Master};

use super::{End, Haste, Next, Ticket, Work};
use crate::clock;
use crate::port::{LineReader, LineWriter, SerialLine};

/// Keeps a dead port from being asked in a tight loop.
const RETRY: embassy_time::Duration = embassy_time::Duration::from_millis(100);
/// An idle pump shows life so often,
const SIGN: Duration = Duration::from_millis(500);
/// and may be late by this: more than a pause of [`RETRY`], or than anything above it takes of the processor.
const LATE: Duration = Duration::from_millis(500);

/// Moves jobs from `work` over `line`, for ever.
pub async fn pump(line: &mut impl SerialLine, config: Config, work: &impl Work) -> ! {
    let (mut reader, mut writer) = line.split();
    let mut master = Master::new(config);
    let mut buffer = [0; 256];
    let mut current: Option<Ticket> = None;
    let longest = config.line.wire_time(puente_modbus::ascii::MAX_ADU);
    loop {
        let now = clock::now();
        match master.poll(now) {
            Action::Transmit(frame) => {
                work.alive(now + longest + LATE);
                if let Err(error) = send(&mut writer, frame).await {
                    master = Master::new(config);
                    let untouched = error.kind() == ErrorKind::NotConnected;
                    let end = if untouched { End::NotSent } else { End::LineDown };
                    finish(work, clock::now(), &mut current, end);
                    Timer::after(RETRY).await;
                }
                continue;
            }
            // The next job may follow at once.
            Action::Done(outcome) => {
                finish(work, now, &mut current, End::Master(outcome));
                work.counted(master.counters());
            }
            Action::Idle => {}
        }
        let mut wake = master.poll_at();
        if current.is_none() {
            let ready_at = |unit, haste| match haste {
                Haste::InQuarantineToo if master.owes(unit) => now,
                _ => master.ready_at(unit),
            };
            match work.next(now, ready_at) {
                Next::Job(job) => {
                    if job.haste == Haste::InQuarantineToo {
                        master.end_quarantine(job.unit);
                    }
                    // The master is idle here, so it cannot refuse.
                    if work.request(job.ticket, |pdu| master.submit(job.unit, pdu)).is_ok() {
                        current = Some(job.ticket);
                    } else {
                        work.finish(now, job.ticket, End::LineDown);
                    }
                    continue;
                }
                Next::Wait(at) => wake = [wake, at].into_iter().flatten().min(),
            }
        }
        let sign = now + SIGN;
        let wake = wake.map_or(sign, |wake| wake.min(sign));
        work.alive(sign + LATE);
        reader.expect(master.lacks());
        match select3(reader.read(&mut buffer), clock::at(Some(wake)), work.changed()).await {
            Either3::First(Ok(n)) if n > 0 => {
                // What is there when the time has come was there before.
                let heard = clock::now().min(wake.before()).max(now);
                master.receive(heard, buffer.get(..n).unwrap_or_default());
                if current.is_none() {
                    // Of what comes unasked nothing else tells.
                    work.counted(master.counters());
                }
            }
            Either3::First(read) => {
                master.line_error(clock::now());
                // A spoilt character is over; a port that is gone takes its time.
                if !matches!(read, Err(error) if error.kind() == ErrorKind::InvalidData) {
                    Timer::after(RETRY).await;
                }
            }
            Either3::Second(()) | Either3::Third(()) => {}
        }
    }
}

async fn send<W: LineWriter>(writer: &mut W, frame: &[u8]) -> Result<(), W::Error> {
    writer.write_all(frame).await?;
    writer.flush().await
}

fn finish(work: &impl Work, now: Instant, current: &mut Option<Ticket>, end: End<'_>) {
    if let Some(ticket) = current.take() {
        work.finish(now, ticket, end);
    }
}

#[cfg(test)]
mod tests {
    use core::cell::{Cell, RefCell};
    use core::convert::Infallible;
    use core::pin::pin;
    use core::task::{Context, Waker};

    use embedded_io_async::{ErrorType, Write};
    use puente_modbus::{Counters, Echo, Mode};

    use super::super::Job;
    use super::*;

    /// A line on which nothing is ever sent or received.
    struct Dead;

    /// Either of its halves.
    struct Half;

    impl ErrorType for Half {
        type Error = Infallible;
    }

    impl Read for Half {
        async fn read(&mut self, _: &mut [u8]) -> Result<usize, Infallible> {
            core::future::pending().await
        }
    }

    impl Write for Half {
        async fn write(&mut self, _: &[u8]) -> Result<usize, Infallible> {
            core::future::pending().await
        }

        async fn flush(&mut self) -> Result<(), Infallible> {
            Ok(())
        }
    }

    impl LineReader for Half {}

    impl LineWriter for Half {
        fn discard(&mut self) {}
    }

    impl SerialLine for Dead {
        type Error = Infallible;
        type Reader<'a> = Half;
        type Writer<'a> = Half;

        fn split(&mut self) -> (Half, Half) {
            (Half, Half)
        }
    }

    /// One job, or none; and the last sign of life.
    struct Work(RefCell<Option<Job>>, Cell<Option<Instant>>);

    impl super::Work for Work {
        fn next(&self, _: Instant, _: impl Fn(u8, Haste) -> Instant) -> Next {
            self.0.borrow_mut().take().map_or(Next::Wait(None), Next::Job)
        }

        fn request<R>(&self, _: Ticket, f: impl FnOnce(&[u8]) -> R) -> R {
            f(&[3, 0, 0, 0, 1])
        }

        async fn changed(&self) {
            core::future::pending().await
        }

        fn finish(&self, _: Instant, _: Ticket, _: End<'_>) {}

        fn counted(&self, _: Counters) {}

        fn alive(&self, until: Instant) {
            self.1.set(Some(until));
        }
    }

    /// Until when a pump that has no job, or one, says that it will show life again.
    fn word(job: Option<Job>) -> core::time::Duration {
        let line = puente_line::Settings { baud: 9600, format: "8O1".parse().expect("a format") };
        let none = Duration::ZERO;
        let config = Config {
            line,
            mode: Mode::Ascii,
            silence: none,
            reply_timeout: Duration::from_secs(60),
            turnaround: none,
            rest: none,
            quarantine: none,
            echo: Echo::Off,
        };
        let work = Work(RefCell::new(job), Cell::new(None));
        let mut dead = Dead;
        let before = clock::now();
        let mut pump = pin!(pump(&mut dead, config, &work));
        let mut poll = || assert!(pump.as_mut().poll(&mut Context::from_waker(Waker::noop())).is_pending());
        poll();
        // Longer than the line has to be silent before a frame.
        std::thread::sleep(Duration::from_millis(20));
        poll();
        work.1.get().expect("a sign of life").since(before)
    }

    /// Whoever waits for ever, for whatever it is, has said when that is too long.
    #[test]
    fn a_pump_says_until_when_it_shows_life_again() {
        let idle = word(None);
        assert!((SIGN + LATE..SIGN + LATE + Duration::from_secs(10)).contains(&idle), "{idle:?}");
        let sending = word(Some(Job { ticket: Ticket(0), unit: 1, haste: Haste::None }));
        // The longest frame has 513 characters of 11 bits.
        let least = Duration::from_micros(513 * 11 * 1_000_000 / 9600) + LATE;
        assert!((least..least + Duration::from_secs(10)).contains(&sending), "{sending:?}");
    }
}

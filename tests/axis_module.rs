//! The firmware of a PID interface module on the emulated board, a motor computed in place of encoder and amplifier: it is
//! commanded over its line, which ends here. `cargo xtask emulate --test` runs this file, and names the firmware in the
//! variable `PUENTE_MODULE_IMAGE`.

use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::LazyLock;
use std::thread;
use std::time::{Duration, Instant};

use puente_drives::pid::{Cause, Event, Gains, State};
use puente_emulator::{AMPLIFIER_FAULT, AXIS_MODULE, BUS, Emulator, SWITCH, Setup};
use puente_framed::{arbiter, frame, station};
use puente_line::Settings;
use puente_modules::master::{Action, Axis, Config, Master, Output};
use puente_modules::{Control, Form, Report};

/// Slow enough for the emulated UART to keep to its times, on a busy machine too.
const BAUD: u32 = 57_600;
/// In characters: 3.5 ms, and 17 ms.
const GAP: usize = 20;
const SLOT: usize = 100;
/// What QEMU may take.
const LATENCY: Duration = Duration::from_millis(20);
/// The switch, and the address that it makes.
const NUMBER: u8 = 1;
const ADDRESS: u8 = 17;
const LOST: State = State::Fault(Cause::Communication);
/// What anything may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(20);

/// A gateway's end of the line, and the line itself: the board hears what it sends.
struct Line {
    _board: Emulator,
    stream: TcpStream,
    master: Master<1, 2, 4, { frame::MAX_FRAME }>,
    report: Option<Report>,
    events: Vec<Event>,
}

fn now() -> puente_line::Instant {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    puente_line::Instant::from_micros(START.elapsed().as_micros() as u64)
}

impl Line {
    fn new(words: &[(u32, u32)]) -> Self {
        let image = std::env::var_os("PUENTE_MODULE_IMAGE").expect("PUENTE_MODULE_IMAGE names the firmware");
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port");
        let line = listener.local_addr().expect("its address");
        let mut setup = Setup { machine: AXIS_MODULE, user_network: false, ..Setup::new(image, line) };
        let [baud, gap, slot] = BUS;
        setup.words = vec![(SWITCH, NUMBER.into()), (baud, BAUD), (gap, GAP as u32), (slot, SLOT as u32)];
        setup.words.extend(words);
        let board = Emulator::start(&setup, |line| eprintln!("{line}")).expect("a board");
        let (stream, _) = listener.accept().expect("its line");
        stream.set_nodelay(true).and_then(|()| stream.set_nonblocking(true)).expect("options");
        let line = Settings { baud: BAUD, format: "8N1".parse().expect("a format") };
        let mut station = station::Config::new(1, line, frame::MAX_FRAME);
        station.arbiter.gap = line.wire_time(GAP);
        (station.arbiter.slot, station.arbiter.rest) = (line.wire_time(SLOT), line.wire_time(SLOT));
        station.arbiter.echo = arbiter::Echo::None;
        station.arbiter.latency = LATENCY;
        station.silence = station.arbiter.gap + LATENCY;
        let config = Config { station, cycle: Duration::from_millis(40) };
        let master = Master::new(config, [Axis { address: ADDRESS, form: Form::Text }], now(), 1);
        Self { _board: board, stream, master, report: None, events: Vec::new() }
    }

    fn set(&mut self, control: Control, set_point: i32) {
        let gains = Gains::new(5e-4, 0.0, 0.0).expect("gains");
        self.master.set(0, Output { control, gains, set_point });
    }

    /// Lets the line live, until a report is as it shall be.
    fn until(&mut self, what: &str, good: impl Fn(&Report) -> bool) -> Report {
        let deadline = Instant::now() + PATIENCE;
        self.report = None;
        while Instant::now() < deadline {
            self.live();
            if let Some(report) = self.report.take_if(|report| good(report)) {
                return report;
            }
        }
        panic!("{what}: {:?}, {:?}", self.report, self.master.statistics());
    }

    fn until_event(&mut self, event: Event) {
        let deadline = Instant::now() + PATIENCE;
        while !self.events.contains(&event) {
            assert!(Instant::now() < deadline, "{event:?}: {:?}", self.events);
            self.live();
        }
        self.events.clear();
    }

    /// A moment of it.
    fn live(&mut self) {
        let mut bytes = [0; 256];
        match self.stream.read(&mut bytes) {
            Ok(length) => {
                let heard = &bytes[..length];
                self.stream.write_all(heard).expect("the echo");
                for &byte in heard {
                    self.master.receive(now(), byte);
                    self.act();
                }
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => thread::sleep(Duration::from_micros(200)),
            Err(error) => panic!("{error}"),
        }
        self.act();
    }

    fn act(&mut self) {
        loop {
            match self.master.poll(now()) {
                Action::Transmit(bytes) => self.stream.write_all(bytes).expect("sent"),
                Action::Reported { report, .. } => self.report = Some(report),
                Action::Event { event, .. } => self.events.push(event),
                Action::Idle => return,
                _ => {}
            }
        }
    }

    /// Under current, held.
    fn enable(&mut self) {
        loop {
            self.set(Control::Off, 0);
            self.until("a module", |report| report.state == State::Disabled);
            self.set(Control::Hold, 0);
            let report = self.until("held", |report| matches!(report.state, State::Held | LOST));
            if report.state == State::Held {
                return;
            }
        }
    }

    /// Sends the axis somewhere, until a report is as it shall be. A computer that stops this program for 100 ms makes the
    /// module lose its current; then it is enabled again.
    fn go(&mut self, what: &str, set_point: i32, good: impl Fn(&Report) -> bool) -> Report {
        loop {
            self.set(Control::Follow, set_point);
            let report = self
                .until(what, |report| report.state == State::Enabled && good(report) || report.state == LOST);
            if report.state != LOST {
                return report;
            }
            self.enable();
        }
    }
}

#[test]
fn a_module_is_enabled_moves_and_loses_its_current_when_its_commander_is_silent() {
    let mut line = Line::new(&[]);
    line.enable();
    line.go("it arrives", 20_000, |report| (report.position - 20_000).abs() <= 2);
    // A way of ten seconds, with nobody who asks it to go on.
    line.go("it goes", 520_000, |report| report.position > 30_000 && report.velocity > 10_000.0);
    line.events.clear();
    line.set(Control::Observe, 0);
    line.until_event(Event::Fault(Cause::Communication));
    let still = line.until("it stands", |report| report.velocity.abs() < 1.0);
    assert_eq!((still.state, still.command), (LOST, 0.0));
    assert!(still.position < 500_000, "{still:?}");
    // It is acknowledged, and goes back.
    line.enable();
    line.go("it is back", 0, |report| report.position.abs() <= 2);
    line.set(Control::Off, 0);
    line.until("without current", |report| report.state == State::Disabled && report.command == 0.0);
}

#[test]
fn a_fault_of_the_amplifier_takes_the_current_away() {
    let mut line = Line::new(&[(AMPLIFIER_FAULT, 1)]);
    line.until("a module", |report| report.state == State::Disabled);
    line.set(Control::Hold, 0);
    line.until_event(Event::Fault(Cause::Amplifier));
    line.until("a fault", |report| report.state == State::Fault(Cause::Amplifier) && report.command == 0.0);
}

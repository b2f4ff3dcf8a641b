//! The lease: whoever commands motion and is gone, or says nothing, has its axis stopped, whatever else is going on.

mod common;

use std::io::Write;
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use common::client::{Lines, connect, reset};
use common::rig::{Flood, Rig};
use common::{MODES, ms, target, until};
use puente_modbus::Mode;

fn report(what: &str, mode: Mode, (before, late): (usize, Duration)) {
    println!("{what}, {mode:?}: stop on the wire after {late:?}, {before} frames before it");
    assert!(before <= target().frames_before_stop, "{what}, {mode:?}: {before} frames went before the stop");
}

/// The commander is a process of its own, which renews its lease of 5 s all the time: only its end can be why the axis
/// stops so soon.
#[test]
fn kill_9_of_the_commander_stops_the_axis_before_all_that_is_queued() {
    for mode in MODES {
        let rig = Rig::new(mode, 5000);
        let script =
            "printf 'axis x enable\\naxis x jog 100\\n'; while :; do echo feed; sleep 0.02 >/dev/null; done";
        let socket = connect(rig.gateway.main);
        let mut commander = Command::new("sh")
            .args(["-c", script])
            .stdin(Stdio::null())
            .stdout(Stdio::from(std::os::fd::OwnedFd::from(socket)))
            .spawn()
            .expect("a shell");
        until("x turns", || rig.turns());
        let flood = Flood::start(rig.gateway.main);
        assert!(rig.turns(), "the lease holds while the commander lives");
        let killed = Instant::now();
        commander.kill().expect("killed");
        commander.wait().expect("ended");
        let stop = rig.stop_after(killed);
        flood.end();
        report("kill -9", mode, stop);
        assert!(stop.1 < ms(2500), "not by the end of the lease");
        assert_eq!(rig.event(), "commander-disconnected");
    }
}

#[test]
fn closing_or_resetting_the_connection_stops_the_axis_before_all_that_is_queued() {
    for (what, end) in [("close", drop as fn(_)), ("reset", reset)] {
        let rig = Rig::new(Mode::Ascii, 5000);
        let (commander, _) = rig.jogging();
        let flood = Flood::start(rig.gateway.main);
        let closed = Instant::now();
        end(commander.stream());
        let stop = rig.stop_after(closed);
        flood.end();
        report(what, Mode::Ascii, stop);
        assert!(stop.1 < ms(2500), "not by the end of the lease");
        assert_eq!(rig.event(), "commander-disconnected");
    }
}

/// A half-open connection, of a client whose cable is cut, looks the same to the gateway: nothing comes, not even an end.
#[test]
fn a_commander_that_stays_but_says_nothing_has_its_axis_stopped_at_the_end_of_the_lease() {
    for mode in MODES {
        let rig = Rig::new(mode, 1000);
        let mut flood = None;
        let (mut commander, _) = rig.jogging();
        let mut fed = Instant::now();
        while flood.is_none() || fed.elapsed() < ms(50) {
            flood = flood.or_else(|| Some(Flood::start(rig.gateway.main)));
            commander.ok("feed");
            fed = Instant::now();
            thread::sleep(ms(60));
        }
        assert!(rig.turns(), "the lease holds while it is renewed");
        // The last word reached the gateway before its answer came.
        let stop = rig.stop_after(fed + ms(1000));
        assert_eq!(rig.event(), "lease-expired");
        if let Some(flood) = flood {
            flood.end();
        }
        report("silence", mode, stop);
        drop(commander);
    }
}

#[test]
fn any_word_of_the_commander_renews_its_lease() {
    let rig = Rig::new(Mode::Rtu, 250);
    let (mut commander, confirmed) = rig.jogging();
    while confirmed.elapsed() < ms(1000) {
        // Half a line is a sign of life too.
        let mut stream = commander.stream();
        stream.write_all(b"fe").expect("sent");
        thread::sleep(ms(50));
        stream.write_all(b"ed\r\n").expect("sent");
        commander = Lines::over(stream);
        assert_eq!(commander.line(), "ok");
        assert!(rig.turns());
    }
    assert_eq!(rig.event(), "none");
}

//! Axes with CiA 402 drives: commands, what ends a motion, and faults, with which the other axes go on.

mod common;

use std::process::{Command, Stdio};
use std::thread;

use common::can::Adapter;
use common::client::{connect, value};
use common::http::insist;
use common::servos::{AXES, Rig, drives, patient};
use common::{ms, until};
use puente_canopen::{Frame, Id};
use puente_cell::can::{Cell, DriveFault, Fault};
use puente_drives::cia402::State;
use serde_json::json;

/// What the gateway has told its drives.
impl Rig {
    /// Axes that move by set-points with every SYNC.
    fn cyclic(lease_ms: u32) -> Self {
        let adapter = Adapter::wire(Cell::new(drives()));
        let rig = Self::with(adapter, lease_ms, "sync_us = 10000", "cyclic = \"ip\"", patient);
        rig.are_present(&AXES);
        rig
    }

    /// What HTTP tells of the group.
    fn group(&self) -> serde_json::Value {
        insist(self.gateway.main, "GET /api/group", "").json()
    }

    /// Frames of the gateway so far.
    fn frames(&self) -> usize {
        self.adapter.device().frames.len()
    }

    /// A drive that followed set-points was told a quick stop, and no set-point after that.
    fn is_stopped(&self, id: u8) {
        until("it stands", || self.velocity(id) == 0.0);
        assert_ne!(self.state(id), State::OperationEnabled);
        let word = Id::base(0x200 + u16::from(id));
        let stop = |frame: &Frame| frame.id() == word && frame.data() == [2, 0];
        let told = self.adapter.device().frames.iter().rposition(stop).expect("a quick stop");
        assert_eq!(self.set_points(id, told), [0_i32; 0]);
    }

    /// Set-points of interpolated position that a node was told after so many frames.
    fn set_points(&self, id: u8, from: usize) -> Vec<i32> {
        let device = self.adapter.device();
        let own = device.frames[from..].iter().filter(|frame| frame.id() == Id::base(0x500 + u16::from(id)));
        own.filter_map(|frame| frame.data().first_chunk().map(|data| i32::from_le_bytes(*data))).collect()
    }

    fn position(&self, id: u8) -> f64 {
        self.adapter.device().bus.node(id).and_then(|node| node.drive()).expect("a drive").position()
    }

    /// SYNCs after so many frames, until all three drives have been told a quick stop.
    fn syncs_before_stops(&self, from: usize) -> usize {
        let stops = |frame: &Frame, id: u8| {
            let word = frame.data().first_chunk().map(|word| u16::from_le_bytes(*word));
            frame.id() == Id::base(0x200 + u16::from(id)) && word == Some(2)
        };
        let mut last = None;
        until("all are told to stop", || {
            let device = self.adapter.device();
            let after = &device.frames[from..];
            let told = AXES.map(|(_, id)| after.iter().position(|frame| stops(frame, id)));
            last = told.iter().all(Option::is_some).then(|| told.iter().flatten().max().copied()).flatten();
            last.is_some()
        });
        let device = self.adapter.device();
        let before = &device.frames[from..from + last.expect("a stop")];
        before.iter().filter(|frame| frame.id() == Id::base(0x80)).count()
    }
}

#[test]
fn an_axis_is_enabled_homed_moved_and_turned() {
    let rig = Rig::new(5_000);
    let mut client = rig.client();
    let before = rig.machine_position(2);
    client.error("axis u move 1000", "not-enabled");
    assert!(client.ok("axis u enable").ends_with("enabled=1"));
    let stands = rig.machine_position(2);
    assert!((stands - before).abs() < 2.0, "it jumped from {before} to {stands}");
    client.ok("axis u home 35");
    rig.becomes(&mut client, "u", "homed", "1");
    client.ok("axis u move 3000 20000");
    rig.becomes(&mut client, "u", "position", "3000");
    rig.becomes(&mut client, "u", "progress", "reached");
    // Nobody need show life for what has arrived.
    rig.becomes(&mut client, "u", "lease", "none");
    client.ok("axis u velocity -200");
    rig.becomes(&mut client, "u", "velocity", "-200");
    client.error("axis u mode csp", "no-mode");
    client.ok("axis u stop");
    client.error("axis u velocity 5", "not-enabled");
    client.ok("axis u enable");
    client.ok("axis u torque 0");
    client.ok("axis u disable");
    client.error("axis u jog 5", "unsupported");
    client.error("axis u gains 1 0 0", "unsupported");
}

#[test]
fn over_http() {
    let rig = Rig::new(5_000);
    let post = |path: &str, body| {
        insist(rig.gateway.main, &format!("POST /api/axes/{path}"), &format!("{body}")).json()
    };
    let get = || insist(rig.gateway.main, "GET /api/axes/v", "").json();
    assert_eq!(get()["profile"], json!("lexium23a"));
    assert_eq!(post("v/move", json!({"position": 5}))["error"]["code"], json!("not-enabled"));
    assert_eq!(post("v/enable", json!({}))["state"], json!("operation-enabled"));
    assert_eq!(post("v/home", json!({"method": 35, "hold_ms": 5000}))["axis"], json!("v"));
    until("it is at home", || get()["homed"] == json!(true));
    assert_eq!(
        post("v/move", json!({"position": 700, "velocity": 20000, "hold_ms": 5000}))["axis"],
        json!("v")
    );
    until("it arrives", || get()["position"] == json!(700) && get()["lease"].is_null());
    let metrics = insist(rig.gateway.main, "GET /metrics", "").body;
    for line in ["puente_axis_position_units{axis=\"v\"} 700", "puente_axis_fault{axis=\"v\"} 0"] {
        assert!(metrics.lines().any(|told| told == line), "{line}: {metrics}");
    }
    assert_eq!(post("v/velocity", json!({"velocity": 100, "hold_ms": 5000}))["mode"], json!("pv"));
    assert_eq!(post("v/mode", json!({"mode": "fast"}))["error"]["code"], json!("mode"));
    post("v/stop", json!({}));
    until("it stands", || get()["enabled"] == json!(false));
    assert_eq!(get()["online"], json!(true));
}

/// The commander is a process of its own, which shows life all the time: only its end can be why the axes stop.
#[test]
fn kill_9_of_the_commander_is_a_quick_stop_of_all_within_a_sync() {
    let rig = Rig::start(5_000, "sync_us = 20000", |document| document);
    rig.are_present(&AXES);
    let script = "for a in u v w; do echo axis $a enable; done; for a in u v w; do echo axis $a velocity 500; done; \
                  while :; do echo feed; sleep 0.02 >/dev/null; done";
    let mut commander = Command::new("sh")
        .args(["-c", script])
        .stdin(Stdio::null())
        .stdout(Stdio::from(std::os::fd::OwnedFd::from(connect(rig.gateway.main))))
        .spawn()
        .expect("a shell");
    for (_, id) in AXES {
        until("it turns", || rig.velocity(id) > 100.0);
    }
    let from = rig.frames();
    commander.kill().expect("killed");
    commander.wait().expect("ended");
    let syncs = rig.syncs_before_stops(from);
    // The lease is 250 SYNCs long.
    assert!(syncs <= 125, "{syncs} SYNCs before the stops");
    println!("quick stop of three axes {syncs} SYNCs of 20 ms after kill -9");
    let mut client = rig.client();
    for (axis, id) in AXES {
        until("it stands", || rig.velocity(id) == 0.0);
        rig.becomes(&mut client, axis, "event", "commander-disconnected");
    }
}

#[test]
fn a_commander_that_falls_silent_loses_all_axes_within_the_lease_and_one_sync() {
    let (lease_ms, sync_ms) = (600, 20);
    let rig = Rig::start(lease_ms, "sync_us = 20000", |document| document);
    rig.are_present(&AXES);
    let mut commander = rig.turning();
    commander.ok("feed");
    // Its last word was before this.
    let from = rig.frames();
    let syncs = rig.syncs_before_stops(from);
    assert!(syncs as u32 <= lease_ms / sync_ms + 1, "{syncs} SYNCs before the stops");
    for (axis, _) in AXES {
        rig.becomes(&mut commander, axis, "event", "lease-expired");
    }
}

#[test]
fn a_node_that_is_lost_is_told_and_stopped_when_it_is_back() {
    for guarded in [false, true] {
        let rig = Rig::start(5_000, "", |document| match guarded {
            true => document.node("can", 3, "guard_ms = 100\nlife_factor = 3"),
            false => document,
        });
        rig.are_present(&AXES);
        let mut commander = rig.turning();
        rig.suffer(3, Fault::Mute(true));
        rig.becomes(&mut commander, "v", "node", "lost");
        rig.becomes(&mut commander, "v", "event", "drive-lost");
        assert!(commander.error("axis v enable", "lost").contains("lost"));
        rig.go_on(&mut commander, &[AXES[0], AXES[2]]);
        rig.suffer(3, Fault::Mute(false));
        until("it is stopped", || {
            commander.ok("feed");
            rig.state(3) != State::OperationEnabled && rig.velocity(3) == 0.0
        });
        rig.go_on(&mut commander, &[AXES[0], AXES[2]]);
    }
}

#[test]
fn an_emergency_during_a_move_is_told_and_the_others_go_on() {
    let rig = Rig::new(5_000);
    let mut commander = rig.turning();
    rig.suffer(2, Fault::Drive(DriveFault::OverCurrent));
    rig.becomes(&mut commander, "u", "event", "drive-fault");
    let status = commander.ok("axis u status");
    assert_eq!(value(&status, "state"), Some("fault"), "{status}");
    assert!(status.contains("emergency=\""), "{status}");
    rig.go_on(&mut commander, &AXES[1..]);
    commander.error("axis u enable", "fault");
    commander.ok("axis u clear");
    commander.ok("axis u enable");
    rig.go_on(&mut commander, &AXES[1..]);
}

#[test]
fn an_sdo_server_that_is_dead_is_told_and_the_others_go_on() {
    let rig = Rig::new(5_000);
    let mut commander = rig.turning();
    commander.ok("axis v enable");
    rig.suffer(3, Fault::SdoDead(true));
    // What a move needs to know is in no PDO.
    let mut other = rig.client();
    let refused = thread::scope(|scope| {
        let moved = scope.spawn(|| other.ask("axis v move 100 500"));
        while !moved.is_finished() {
            rig.go_on(&mut commander, &[AXES[0], AXES[2]]);
            thread::sleep(ms(5));
        }
        moved.join().expect("an answer")
    });
    assert!(
        refused.starts_with("error drive axis v: ") && refused.contains("the node did not answer"),
        "{refused}"
    );
}

#[test]
fn a_drive_of_another_identity_is_refused_and_the_others_go_on() {
    let rig = Rig::start(5_000, "", |document| document.node("can", 3, "product = 0x12345678"));
    let others = [AXES[0], AXES[2]];
    rig.are_present(&others);
    let mut client = rig.client();
    rig.becomes(&mut client, "v", "node", "refused");
    client.error("axis v enable", "node-refused");
    for (axis, _) in others {
        client.ok(&format!("axis {axis} enable"));
    }
}

#[test]
fn a_node_that_babbles_and_one_that_is_bus_off_hold_nobody_up() {
    let rig = Rig::new(5_000);
    let mut commander = rig.turning();
    let babble = Frame::new(Id::base(0x7F0), &[]).expect("a frame");
    rig.suffer(4, Fault::Babble(babble, ms(100)));
    rig.go_on(&mut commander, &AXES[..2]);
    rig.suffer(4, Fault::BusOff);
    rig.go_on(&mut commander, &AXES[..2]);
    commander.ok("axis u stop");
    until("it stands", || {
        commander.ok("feed");
        rig.velocity(2) == 0.0
    });
}

#[test]
fn a_group_goes_through_its_stages_together() {
    let rig = Rig::new(5_000);
    assert_eq!(rig.group(), json!(null));
    let mut client = rig.client();
    // Home of w is far away: u and v wait for it.
    client.ok("group u,v,w home");
    let mut seen = Vec::new();
    until("all are at home", || {
        let status = client.ok("group status");
        let homed = AXES.map(|(_, id)| {
            rig.adapter.device().bus.node(id).and_then(|node| node.drive()).expect("a drive").is_homed()
        });
        let stage = value(&status, "stage").expect("a stage").to_owned();
        assert_ne!(stage, "failed", "{status}");
        assert!(stage != "done" || homed.iter().all(|homed| *homed), "{status}");
        if seen.last() != Some(&stage) {
            seen.push(stage.clone());
        }
        stage == "done"
    });
    assert!(seen.iter().any(|stage| stage == "homing"), "{seen:?}");
    client.ok("group u,v,w start pv");
    until("all are in the mode", || value(&client.ok("group status"), "stage") == Some("done"));
    for (axis, _) in AXES {
        rig.becomes(&mut client, axis, "mode", "pv");
    }
    client.ok("group u,v,w disable");
    for (_, id) in AXES {
        let off = matches!(rig.state(id), State::SwitchOnDisabled | State::ReadyToSwitchOn);
        assert!(off, "{}", rig.state(id));
    }
}

#[test]
fn one_that_fails_or_a_commander_that_is_gone_stops_the_group() {
    let rig = Rig::new(5_000);
    let mut client = rig.client();
    client.ok("group u,v,w home");
    until("they search", || {
        assert_ne!(value(&client.ok("group status"), "stage"), Some("done"));
        AXES.iter().all(|(_, id)| rig.velocity(*id) != 0.0)
    });
    let mut other = rig.client();
    assert!(other.ok("group status").contains("awaits=u,v,w"));
    let told = rig.group();
    assert_eq!((&told["axes"], &told["stage"]), (&json!(["u", "v", "w"]), &json!("homing")), "{told}");
    assert_eq!((&told["awaits"], &told["failed"]), (&told["axes"], &json!(null)), "{told}");
    other.error("group u,v home", "busy");
    rig.suffer(3, Fault::Drive(DriveFault::OverCurrent));
    until("it is told", || value(&other.ok("group status"), "stage") == Some("failed"));
    assert_eq!(value(&other.ok("group status"), "axis"), Some("v"));
    let told = rig.group();
    assert_eq!((&told["awaits"], &told["failed"]["axis"]), (&json!([]), &json!("v")), "{told}");
    assert_eq!(told["failed"]["error"]["code"], "fault", "{told}");
    for (_, id) in AXES {
        until("it stands", || rig.velocity(id) == 0.0);
        assert_ne!(rig.state(id), State::OperationEnabled);
    }
}

/// From one to the next, at most; and how much more or less that is than the time before.
fn steps(set_points: &[i32]) -> (u32, u32) {
    let most = |steps: &mut dyn Iterator<Item = u32>| steps.max().unwrap_or(0);
    let fast = most(&mut set_points.windows(2).map(|pair| pair[1].abs_diff(pair[0])));
    let hard = most(&mut set_points.windows(3).map(|next| (next[2] - next[1]).abs_diff(next[1] - next[0])));
    (fast, hard)
}

#[test]
fn a_cyclic_axis_moves_by_set_points_with_every_sync() {
    let rig = Rig::cyclic(5_000);
    let mut client = rig.client();
    let before = rig.position(2);
    client.ok("axis u enable");
    rig.becomes(&mut client, "u", "mode", "ip");
    assert!((rig.position(2) - before).abs() < 2.0, "it jumped from {before} to {}", rig.position(2));
    let told = rig.set_points(2, 0);
    assert!(told.iter().all(|told| (f64::from(*told) - before).abs() < 2.0), "{told:?}");
    client.ok("axis u home 35");
    rig.becomes(&mut client, "u", "homed", "1");
    let from = rig.frames();
    client.ok("axis u move 100000 200000");
    rig.becomes(&mut client, "u", "progress", "reached");
    rig.becomes(&mut client, "u", "position", "100000");
    // Nobody need show life for what has arrived.
    rig.becomes(&mut client, "u", "lease", "none");
    let set_points = rig.set_points(2, from);
    assert_eq!((set_points.first(), set_points.last()), (Some(&0), Some(&100_000)));
    // 0.2 Mu/s, and 10 Mu/s² as delivered, with a set-point each 10 ms.
    let (fast, hard) = steps(&set_points);
    assert!(fast <= 2_000 && hard <= 1_001, "{fast} {hard}: {set_points:?}");
    assert!(set_points.iter().filter(|told| (1..100_000).contains(*told)).count() >= 50, "{set_points:?}");
    // And back from there, on the way to another place.
    let from = rig.frames();
    client.ok("axis u move 400000 200000");
    until("it is on its way", || {
        client.ok("feed");
        rig.position(2) > 120_000.0
    });
    client.ok("axis u move 100 200000");
    rig.becomes(&mut client, "u", "position", "100");
    rig.becomes(&mut client, "u", "lease", "none");
    let (fast, hard) = steps(&rig.set_points(2, from));
    assert!(fast <= 2_000 && hard <= 1_001, "{fast} {hard}");
    // Other motions are the drive's own.
    client.ok("axis u velocity 500");
    rig.becomes(&mut client, "u", "mode", "pv");
    client.ok("axis u move 300 20000");
    rig.becomes(&mut client, "u", "position", "300");
    client.ok("axis u disable");
    assert!(matches!(rig.state(2), State::SwitchOnDisabled | State::ReadyToSwitchOn), "{}", rig.state(2));
}

#[test]
fn a_cyclic_axis_is_stopped_by_a_stop_and_by_the_end_of_the_lease() {
    let rig = Rig::cyclic(5_000);
    let mut client = rig.client();
    let mut commander = rig.client();
    for (axis, id) in [AXES[0], AXES[1]] {
        commander.ok(&format!("axis {axis} enable"));
        commander.ok(&format!("axis {axis} move 2000000000 20000"));
        until("it moves", || {
            commander.ok("feed");
            rig.velocity(id) > 1_000.0
        });
    }
    client.ok("axis u stop");
    rig.is_stopped(2);
    client.error("axis u move 5", "not-enabled");
    commander.ok("axis v status");
    assert!(rig.velocity(3) > 1_000.0, "the other goes on");
    drop(commander);
    rig.is_stopped(3);
    rig.becomes(&mut client, "v", "event", "commander-disconnected");
    // It moves again when it is enabled again, from where it stands.
    let from = rig.frames();
    client.ok("axis v enable");
    let stands = rig.position(3);
    let told = rig.set_points(3, from);
    assert!(told.iter().all(|told| (f64::from(*told) - stands).abs() < 2.0), "{stands}: {told:?}");
}

//! A gateway with three CiA 402 drives on a CAN bus.

use puente_cell::can::{Cell, Config, Drive, DriveConfig, Fault, Model};
use puente_drives::cia402::State;
use puente_line::Instant;
use serde_json::json;

use super::can::Adapter;
use super::client::{Lines, value};
use super::http::insist;
use super::wire::Wire;
use super::{Document, Gateway, until};

pub const AXES: [(&str, u8); 3] = [("u", 2), ("v", 3), ("w", 4)];

/// Axes u, v and w, which are nodes 2 to 4.
pub struct Rig {
    pub adapter: Wire<Adapter<Cell>>,
    pub gateway: Gateway,
}

/// A drive.
pub fn drive(id: u8) -> DriveConfig {
    DriveConfig::new(id, Model::Lexium23a).expect("a drive")
}

/// An adapter on a bus with the drives of all axes.
pub fn drives() -> Config {
    AXES.iter().fold(Config::new(1_000_000), |config, (_, id)| config.with(drive(*id)))
}

/// A machine that is held up takes no drive for lost.
pub fn patient(document: Document) -> Document {
    AXES.iter().fold(document, |document, (_, id)| document.node("can", *id, "heartbeat_ms = 1000"))
}

impl Rig {
    pub fn new(lease_ms: u32) -> Self {
        let rig = Self::start(lease_ms, "", patient);
        rig.are_present(&AXES);
        rig
    }

    /// With more keys of the bus, and more in the settings.
    pub fn start(lease_ms: u32, keys: &str, more: impl FnOnce(Document) -> Document) -> Self {
        Self::with(Adapter::wire(Cell::new(drives())), lease_ms, keys, "", more)
    }

    /// With this bus, and more keys of each axis.
    pub fn with(
        adapter: Wire<Adapter<Cell>>,
        lease_ms: u32,
        keys: &str,
        axis_keys: &str,
        more: impl FnOnce(Document) -> Document,
    ) -> Self {
        let document = Document::new().net(&format!("lease_ms = {lease_ms}")).canopen(
            "can",
            &adapter,
            &format!("bitrate = 1000000\n{keys}"),
        );
        let document = AXES
            .iter()
            .fold(document, |document, (name, id)| document.servo(name, "can", *id).axis_keys(axis_keys));
        let gateway = more(document).start();
        Self { adapter, gateway }
    }

    pub fn are_present(&self, axes: &[(&str, u8)]) {
        let mut client = self.client();
        for (axis, _) in axes {
            self.becomes(&mut client, axis, "node", "present");
        }
    }

    pub fn client(&self) -> Lines {
        Lines::connect(self.gateway.main)
    }

    /// A client that turns all three axes.
    pub fn turning(&self) -> Lines {
        let mut commander = self.client();
        for (axis, _) in AXES {
            commander.ok(&format!("axis {axis} enable"));
        }
        for (axis, _) in AXES {
            commander.ok(&format!("axis {axis} velocity 500"));
        }
        for (_, id) in AXES {
            until("it turns", || {
                commander.ok("feed");
                self.velocity(id) > 100.0
            });
        }
        commander
    }

    /// An axis that was stopped turns again: it may be stopped once more before.
    pub fn is_moved(&self, client: &mut Lines, axis: &str) {
        let mut ok = |command: &str| client.ask(&format!("axis {axis} {command}")).starts_with("ok");
        until("it is moved", || ok("clear") && ok("enable") && ok("velocity 500"));
    }

    /// The status of an axis comes to say this. Asking for it shows life.
    pub fn becomes(&self, client: &mut Lines, axis: &str, key: &str, what: &str) {
        until(what, || value(&client.ask(&format!("axis {axis} status")), key) == Some(what));
    }

    pub fn velocity(&self, id: u8) -> f64 {
        self.drive(id, Drive::velocity)
    }

    /// Of the machine, drive units.
    pub fn machine_position(&self, id: u8) -> f64 {
        self.drive(id, Drive::machine_position)
    }

    pub fn state(&self, id: u8) -> State {
        self.drive(id, Drive::state)
    }

    fn drive<R>(&self, id: u8, look: impl FnOnce(&Drive) -> R) -> R {
        look(self.adapter.device().bus.node(id).and_then(|node| node.drive()).expect("a drive"))
    }

    pub fn suffer(&self, id: u8, fault: Fault) {
        // At once: the past is over.
        assert!(self.adapter.device().bus.suffer(Instant::ZERO, id, fault), "a node");
    }

    /// The axes turn on, under the lease of this client.
    pub fn go_on(&self, commander: &mut Lines, axes: &[(&str, u8)]) {
        for (axis, id) in axes {
            let status = commander.ok(&format!("axis {axis} status"));
            assert_eq!(value(&status, "event"), Some("none"), "{status}");
            assert_eq!(value(&status, "state"), Some("operation-enabled"), "{status}");
            assert!(self.velocity(*id) > 100.0, "{axis}");
        }
    }

    /// All three axes are back, stand, and stay so until somebody moves them.
    pub fn comes_back(&self, client: &mut Lines) {
        for (axis, id) in AXES {
            self.becomes(client, axis, "node", "present");
            // The stop that could not be confirmed for long is the event then.
            let status = client.ok(&format!("axis {axis} status"));
            let event = value(&status, "event");
            assert!(matches!(event, Some("drive-lost" | "stop-unconfirmed")), "{status}");
            until("it stands, and has told so", || {
                let status = client.ok(&format!("axis {axis} status"));
                self.velocity(id) == 0.0 && value(&status, "state") != Some("operation-enabled")
            });
        }
        let before = AXES.map(|(_, id)| self.machine_position(id));
        for _ in 0..20 {
            for (axis, id) in AXES {
                let status = client.ok(&format!("axis {axis} status"));
                assert_ne!(value(&status, "state"), Some("operation-enabled"), "{status}");
                assert_eq!(value(&status, "lease"), Some("none"), "{status}");
                assert_eq!(self.velocity(id), 0.0, "{axis}");
            }
        }
        assert_eq!(AXES.map(|(_, id)| self.machine_position(id)), before);
        // Whoever has lost them has to keep still for a second.
        let mut next = self.client();
        for (axis, id) in AXES {
            self.is_moved(&mut next, axis);
            until("it turns", || {
                next.ok("feed");
                client.ok("feed");
                self.velocity(id) > 100.0
            });
        }
    }

    /// Everybody is refused with the cause, which lasts a second at a time: an adapter is opened again to see whether it is over.
    pub fn is_refused(&self, state: &str, commander: &mut Lines) {
        let mut other = self.client();
        let mut refused = |question: &str, answer: &str| {
            let mut told = String::new();
            until(question, || {
                other.ok("feed");
                told = commander.ask(question);
                told.starts_with(answer)
            });
            told
        };
        for (axis, _) in AXES {
            for command in ["status", "enable", "velocity 5", "move 5", "home", "stop"] {
                let told = refused(&format!("axis {axis} {command}"), "error not-sent ");
                assert!(told.contains("see to its adapter, cable and termination"), "{told}");
            }
        }
        until(state, || value(&commander.ask("bus can status"), "state") == Some(state));
        let mut refused =
            |question: &str, answer: &str| until(question, || commander.ask(question) == answer);
        refused("[1] 1 2 read 0x1000 0 u32", "[1] ERROR:301 #Bus off.");
        refused("[2] 1 2 start", "[2] ERROR:301 #Bus off.");
        let error = || insist(self.gateway.main, "GET /api/axes/u", "").json()["error"]["code"].clone();
        until("HTTP tells it", || error() == json!("not-sent"));
        let enabled = || insist(self.gateway.main, "POST /api/axes/u/enable", "{}").error();
        until("HTTP refuses", || enabled() == (503, "not-sent".into()));
    }
}

/// A second bus, with axis x, which is node 5 there.
pub struct Far(Wire<Adapter<Cell>>);

impl Far {
    pub fn new() -> Self {
        Self(Adapter::wire(Cell::new(Config::new(1_000_000).with(drive(5)))))
    }

    pub fn settings(&self, document: Document) -> Document {
        document.canopen("far", &self.0, "bitrate = 1000000\nnet = 2").servo("x", "far", 5)
    }

    fn velocity(&self) -> f64 {
        self.0.device().bus.node(5).and_then(|node| node.drive()).expect("a drive").velocity()
    }

    /// The axis is made to turn.
    pub fn turn(&self, commander: &mut Lines) {
        until("x is there", || value(&commander.ask("axis x status"), "node") == Some("present"));
        commander.ok("axis x enable");
        commander.ok("axis x velocity 500");
        until("x turns", || {
            commander.ok("feed");
            self.velocity() > 100.0
        });
    }

    /// It turns on.
    pub fn goes_on(&self, commander: &mut Lines) {
        let status = commander.ok("axis x status");
        assert_eq!(value(&status, "event"), Some("none"), "{status}");
        assert!(self.velocity() > 100.0, "{status}");
    }
}

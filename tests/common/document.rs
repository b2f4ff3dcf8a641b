//! The settings of a gateway that is to be started.

use std::fmt::Write as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use puente_line::Settings;
use puente_modbus::Mode;

use super::can::Adapter;
use super::table::Table;
use super::wire::{Place, Wire};
use super::{Gateway, board, target};

/// A settings document without what depends on the target: where its lines and its network are.
#[derive(Default)]
pub struct Document {
    net: String,
    buses: Vec<Bus>,
    axes: String,
}

struct Bus {
    place: Place,
    can: bool,
    live: Arc<AtomicBool>,
    keys: String,
}

impl Document {
    pub fn new() -> Self {
        Self::default()
    }

    /// With more keys of `[net]`.
    pub fn net(mut self, keys: &str) -> Self {
        self.net = self.net + keys + "\n";
        self
    }

    /// With a bus whose line is this wire, and `more` keys of it. The first bus of a board is on RS-485 a, the second on b.
    pub fn bus<D>(mut self, name: &str, mode: Mode, line: Settings, wire: &Wire<D>, more: &str) -> Self {
        let protocol = match mode {
            Mode::Rtu => "modbus-rtu",
            Mode::Ascii => "modbus-ascii",
        };
        let Settings { baud, format } = line;
        let mut keys = format!(
            "name = \"{name}\"\nprotocol = \"{protocol}\"\nbaud = {baud}\nformat = \"{format}\"\n{more}\n"
        );
        if !more.contains("reply_timeout_ms") {
            let _ = writeln!(keys, "reply_timeout_ms = {}", target().reply_timeout_ms);
        }
        self.buses.push(Bus { place: wire.place.clone(), can: false, live: wire.live.clone(), keys });
        self
    }

    /// With an EDB drive on a bus, and `more` keys of its axis.
    pub fn axis(mut self, name: &str, bus: &str, address: u8, more: &str) -> Self {
        let _ = write!(
            self.axes,
            "[[axis]]\nname = \"{name}\"\nbus = \"{bus}\"\ndrive = \"edb\"\naddress = {address}\n{more}\n"
        );
        self
    }

    /// With a framed bus on a connector of a line, and `more` keys of it.
    pub fn framed(self, name: &str, table: &Table, connector: usize, more: &str) -> Self {
        self.framed_at(name, table.line, table.connector(connector), more)
    }

    /// With a framed bus whose line is this wire.
    pub fn framed_wire<D>(self, name: &str, line: Settings, wire: &Wire<D>, more: &str) -> Self {
        self.framed_at(name, line, (wire.place.clone(), wire.live.clone()), more)
    }

    fn framed_at(
        mut self,
        name: &str,
        Settings { baud, format }: Settings,
        (place, live): (Place, Arc<AtomicBool>),
        more: &str,
    ) -> Self {
        let keys = format!(
            "name = \"{name}\"\nprotocol = \"framed\"\nbaud = {baud}\nformat = \"{format}\"\n{more}\n"
        );
        self.buses.push(Bus { place, can: false, live, keys });
        self
    }

    /// With a CANopen bus behind an SLCAN adapter, and `more` keys of it. The first one of a board is CAN 1, the second CAN 2.
    pub fn canopen<B>(mut self, name: &str, adapter: &Wire<Adapter<B>>, more: &str) -> Self {
        let keys = format!("name = \"{name}\"\nprotocol = \"canopen\"\n{more}\n");
        let (place, live) = (adapter.place.clone(), adapter.live.clone());
        self.buses.push(Bus { place, can: true, live, keys });
        self
    }

    /// With a PID module on a bus, and `more` keys of its axis.
    pub fn module(mut self, name: &str, bus: &str, address: u8, more: &str) -> Self {
        let _ = write!(
            self.axes,
            "[[axis]]\nname = \"{name}\"\nbus = \"{bus}\"\ndrive = \"pid\"\naddress = {address}\n{more}\n"
        );
        self
    }

    /// With a CiA 402 drive on a bus, a Lexium 23A.
    pub fn servo(mut self, name: &str, bus: &str, address: u8) -> Self {
        let _ = write!(
            self.axes,
            "[[axis]]\nname = \"{name}\"\nbus = \"{bus}\"\ndrive = \"cia402\"\nprofile = \"lexium23a\"\naddress = {address}\n"
        );
        self
    }

    /// With what the last axis has besides.
    pub fn axis_keys(mut self, keys: &str) -> Self {
        let _ = writeln!(self.axes, "{keys}");
        self
    }

    /// With what a node of a bus has besides.
    pub fn node(mut self, bus: &str, id: u8, keys: &str) -> Self {
        let _ = write!(self.axes, "[[node]]\nbus = \"{bus}\"\nid = {id}\n{keys}\n");
        self
    }

    /// Starts a gateway with it.
    pub fn start(self) -> Gateway {
        Gateway::start(&self)
    }

    /// Where its lines end, or else its CAN buses.
    pub(super) fn places(&self, can: bool) -> impl Iterator<Item = &Place> {
        self.buses.iter().filter(move |bus| bus.can == can).map(|bus| &bus.place)
    }

    /// What the host's gateway calls its ports.
    pub(super) fn host_ports(&self) -> Vec<String> {
        let prefix = |bus: &Bus| if bus.can { "slcan:" } else { "" };
        self.buses.iter().map(|bus| format!("{}{}", prefix(bus), bus.place.port())).collect()
    }

    /// What a board calls them.
    pub(super) fn board_ports(&self) -> Vec<String> {
        let (mut lines, mut cans) = (board::LINES.iter(), board::CANS.iter());
        let names = self.buses.iter().map(|bus| if bus.can { cans.next() } else { lines.next() });
        names.map(|name| (*name.expect("a board has two of each")).to_owned()).collect()
    }

    /// Puts the devices on its lines, where a board has had those of its factory.
    pub(super) fn go_live(&self) {
        self.buses.iter().for_each(|bus| bus.live.store(true, Ordering::Relaxed));
    }

    /// The whole of it, with the target's names of the lines.
    pub(super) fn text(&self, ports: &[String]) -> String {
        let mut text = format!("[net]\n{}", self.net);
        for (bus, port) in self.buses.iter().zip(ports) {
            let _ = writeln!(text, "[[bus]]\nport = \"{port}\"\n{}", bus.keys);
        }
        text + &self.axes
    }
}

//! The bus of a module: what the line says goes to a [`puente_modules::Node`], and what that wants goes onto the line.

use embassy_futures::select::{Either3, select3};
use embedded_io_async::Read;
use puente_framed::frame::MAX_FRAME;
use puente_framed::station;
use puente_line::Duration;
use puente_modules::Form;
use puente_modules::node::{self, Action};

use super::control::Control;
use crate::clock;
use crate::port::{AxisIo, Bus, LineReader, LineWriter, SerialLine};

/// Commanders that are told events at once, and events under way to each.
const PEERS: usize = 2;
const EVENTS: usize = 4;
/// An idle bus shows life so often.
const SIGN: Duration = Duration::from_millis(500);

type Node = node::Node<PEERS, EVENTS, MAX_FRAME>;

/// What a node goes by, but for what the port takes.
pub fn config(bus: Bus, address: u8, form: Form) -> node::Config {
    let mut station = station::Config::new(address, bus.line, MAX_FRAME);
    let slot = bus.line.wire_time(bus.slot);
    station.arbiter.gap = bus.line.wire_time(bus.gap);
    (station.arbiter.slot, station.arbiter.rest) = (slot, slot);
    node::Config { station, form }
}

/// Does what is said on the line, and tells what is asked, for ever.
pub async fn serve<A: AxisIo>(
    line: &mut impl SerialLine,
    mut config: node::Config,
    seed: u64,
    control: &Control<A>,
) -> ! {
    let (mut reader, mut writer) = line.split();
    let station = &mut config.station;
    station.arbiter.latency = reader.latency();
    // Characters that come while those before them are looked at are handed on together, and a little late.
    station.silence = station.arbiter.gap + station.arbiter.slot + reader.latency();
    let mut node = Node::new(config, clock::now(), seed);
    let mut buffer = [0; 64];
    loop {
        control.alive();
        if reader.carrier() {
            node.carrier(clock::now());
        }
        act(&mut node, &mut writer, control).await;
        let sign = clock::now() + SIGN;
        let wake = node.poll_at().map_or(sign, |wake| wake.min(sign));
        match select3(reader.read(&mut buffer), clock::at(Some(wake)), control.event()).await {
            Either3::First(Ok(length)) => {
                let now = clock::now();
                for &byte in buffer.get(..length).unwrap_or_default() {
                    node.receive(now, byte);
                    if node.is_pressing() {
                        act(&mut node, &mut writer, control).await;
                    }
                }
            }
            Either3::First(Err(_)) => node.line_error(clock::now()),
            Either3::Second(()) => {}
            Either3::Third(event) => node.event(event),
        }
    }
}

/// Does what the node wants, until it wants nothing.
async fn act<A: AxisIo>(node: &mut Node, writer: &mut impl LineWriter, mut control: &Control<A>) {
    loop {
        // What cannot be written is not heard either, which the node notices.
        let _ = match node.poll(clock::now(), &mut control) {
            Action::Transmit(bytes) => writer.write_all(bytes).await,
            Action::Jam(bytes) => {
                writer.discard();
                writer.write_all(bytes).await
            }
            Action::Idle => return,
        };
    }
}

//! Two gateways and three modules on one framed line: the end of one gateway stops its axes, and the other's do not notice.

mod common;

use std::time::Duration;

use common::client::{Lines, figure, value};
use common::table::{Connector, Table};
use common::{Document, Gateway, ms, target, until};
use puente_cell::framed::Config;
use puente_drives::pid::{Cause, State};
use puente_framed::arbiter;
use puente_line::Settings;

/// What the line is like, in characters where it does not say otherwise.
///
/// A gateway on this machine hears and talks a millisecond late, and up to a hundred where others keep the machine busy; an
/// emulated board is late with each character. So a gap is longer than a character is late as a rule, and a slot than an
/// echo ever is: one that does not come in time is a collision. A cycle has room for the frames of both and a rest of a
/// slot, and the modules wait for several: what is lost to the machine's load stops no axis.
const BAUD: u32 = 57_600;
const IPG: u16 = 60;
const SLOT: u16 = 900;
const CYCLE: Duration = ms(300);
/// How long a module goes without its commander.
const SUPERVISION: Duration = ms(2_000);

/// Counts a second, and where all axes are sent: further than they get while one gateway ends.
const SPEED: u32 = 5_000;
const TARGET: i32 = 50_000;

fn table() -> Table {
    let line = Settings { baud: BAUD, format: "8N1".parse().expect("a format") };
    let mut config = Config::new(line, &[17, 18, 19]);
    let characters = |count: u16| line.wire_time(count.into());
    config.manners = arbiter::Config {
        gap: characters(IPG),
        slot: characters(SLOT),
        rest: characters(SLOT),
        ..config.manners
    };
    for module in &mut config.modules {
        module.form = puente_modules::Form::Binary;
        module.servo.speed = Some(SPEED);
        module.servo.communication = SUPERVISION;
    }
    let first = if target().is_board() { Connector::Uart } else { Connector::Pty };
    Table::new(config, &[first, Connector::Pty])
}

/// A gateway of these axes.
fn document(table: &Table, connector: usize, axes: &[(&str, u8)]) -> Document {
    let (station, cycle) = (connector + 1, CYCLE.as_millis());
    let keys = format!("station = {station}\nipg = {IPG}\nslot = {SLOT}\ncycle_ms = {cycle}");
    let document = Document::new().net("lease_ms = 5000").framed("b", table, connector, &keys);
    axes.iter().fold(document, |document, (name, address)| {
        document.module(name, "b", *address, "payload = \"binary\"\ngains = [0.001, 0.0, 0.000002]")
    })
}

/// Both gateways, each with a client that has sent its axes to [`TARGET`].
struct Both {
    table: Table,
    gateways: [Gateway; 2],
    clients: [Lines; 2],
}

const AXES: [&[(&str, u8)]; 2] = [&[("x", 17), ("y", 18)], &[("z", 19)]];

impl Both {
    fn moving() -> Self {
        let table = table();
        let gateways =
            [document(&table, 0, AXES[0]).start(), Gateway::on_host(&document(&table, 1, AXES[1]))];
        let clients = gateways.each_ref().map(|gateway| Lines::connect(gateway.main));
        let mut both = Self { table, gateways, clients };
        for command in ["enable".to_owned(), format!("move {TARGET}")] {
            both.each(|client, name| {
                until("it is done", || client.ask(&format!("axis {name} {command}")).starts_with("ok"));
            });
        }
        for (_, address) in AXES.concat() {
            until("it moves", || both.table.position(address) > 500.0);
        }
        both
    }

    /// Does something with each axis.
    fn each(&mut self, mut act: impl FnMut(&mut Lines, &str)) {
        for (client, axes) in self.clients.iter_mut().zip(AXES) {
            axes.iter().for_each(|(name, _)| act(client, name));
        }
    }

    /// The gateway `dead` ends in the middle of the move.
    fn end(&mut self, dead: usize) {
        let alive = 1 - dead;
        let mut before = self.status(alive);
        self.gateways[dead].kill();
        // What it had sent is on the line.
        self.table.settle();
        let places = AXES[dead].iter().map(|(_, address)| (*address, self.table.position(*address)));
        let places: Vec<_> = places.collect();
        assert!(places.iter().all(|(_, place)| *place < f64::from(TARGET) / 2.0), "in time: {places:?}");
        until("its axes stand", || {
            before = self.undisturbed(alive, &before);
            places.iter().all(|(address, _)| self.stopped(*address))
        });
        // By their own supervision, and then by friction.
        let most = f64::from(SPEED) * (SUPERVISION.as_secs_f64() + 0.1);
        for (address, place) in places {
            let further = self.table.position(address) - place;
            assert!(further <= most, "{address}: {further} counts");
        }
        until("the other's arrive", || {
            before = self.undisturbed(alive, &before);
            AXES[alive]
                .iter()
                .all(|(_, address)| (self.table.position(*address) - f64::from(TARGET)).abs() < 20.0)
        });
        for (_, address) in AXES[dead] {
            assert!(self.stopped(*address), "for good");
        }
    }

    fn stopped(&self, address: u8) -> bool {
        self.table.of(address, |module| {
            module.status().state == State::Fault(Cause::Communication) && module.plant().velocity() == 0.0
        })
    }

    /// What a gateway says of its axes.
    fn status(&mut self, gateway: usize) -> Vec<String> {
        let client = &mut self.clients[gateway];
        AXES[gateway].iter().map(|(name, _)| client.ok(&format!("axis {name} status"))).collect()
    }

    /// The same, and that nothing has happened to them: they follow, and are never behind.
    fn undisturbed(&mut self, gateway: usize, before: &[String]) -> Vec<String> {
        let after = self.status(gateway);
        for (before, after) in before.iter().zip(&after) {
            assert_eq!(value(after, "state"), Some("following"), "{after}");
            assert_eq!(value(after, "event"), Some("none"), "{after}");
            let position = |status| value(status, "position").and_then(|text| text.parse::<i32>().ok());
            assert!(position(after) >= position(before).map(|position| position - 20), "{before}\n{after}");
            assert!(figure(after, "age_ms") < SUPERVISION.as_millis() as u64, "{after}");
        }
        after
    }
}

#[test]
fn the_end_of_the_first_gateway_stops_its_axes_alone() {
    Both::moving().end(0);
}

#[test]
fn the_end_of_the_second_gateway_stops_its_axis_alone() {
    Both::moving().end(1);
}

//! Whoever is on the line.

use puente_line::Instant;
use puente_shared_line::external::External;
use puente_shared_line::faulty::Babbler;
use puente_shared_line::talker::Talker;
use puente_shared_line::{Drive, Heard, Node};

use super::module::Module;

pub(super) enum Station {
    Module(Box<Module>),
    Rival(Box<Talker>),
    Babbler(Babbler),
    Outside(External),
}

/// The same call to whichever it is.
macro_rules! each {
    ($station:expr, $node:ident => $call:expr) => {
        match $station {
            Station::Module($node) => $call,
            Station::Rival($node) => $call,
            Station::Babbler($node) => $call,
            Station::Outside($node) => $call,
        }
    };
}

impl Node for Station {
    fn hear(&mut self, now: Instant, heard: Heard) {
        each!(self, node => node.hear(now, heard));
    }

    fn carrier(&mut self, now: Instant) {
        each!(self, node => node.carrier(now));
    }

    fn poll(&mut self, now: Instant) -> Option<Drive> {
        each!(self, node => node.poll(now))
    }

    fn poll_at(&self) -> Option<Instant> {
        each!(self, node => node.poll_at())
    }
}

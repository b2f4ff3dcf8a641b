//! What a drive moves: a carriage between two ends, with its switches.

use super::course::Point;

/// Seconds by which a servo lags behind its demand.
const LAG: f64 = 0.002;

/// An axis, in position units of the drive, from where the machine has its zero.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisConfig {
    /// Where it stands at first.
    pub start: f64,
    /// Where it cannot go on.
    pub ends: [f64; 2],
    /// From where on the limit switches are on: the negative one below, the positive one above.
    pub limits: [f64; 2],
    /// Where the home switch is on.
    pub home: [f64; 2],
    /// Position units of a turn; the index is where a turn begins.
    pub turn: f64,
    /// Acceleration that the rated torque brings about, units/s².
    pub rated: f64,
    /// Friction, a part of the rated torque.
    pub friction: f64,
}

impl Default for AxisConfig {
    /// 70 turns; the home switch near the negative limit.
    fn default() -> Self {
        Self {
            start: 20_000.0,
            ends: [-320_000.0, 6_720_000.0],
            limits: [-300_000.0, 6_700_000.0],
            home: [-150_000.0, -50_000.0],
            turn: 100_000.0,
            rated: 20_000_000.0,
            friction: 0.05,
        }
    }
}

/// Inputs of the drive (60FDh).
pub mod input {
    /// The negative limit switch.
    pub const NEGATIVE: u32 = 1;
    /// The positive limit switch.
    pub const POSITIVE: u32 = 2;
    /// The home switch.
    pub const HOME: u32 = 4;
}

/// The axis and its motor.
#[derive(Clone, Debug)]
pub struct Axis {
    config: AxisConfig,
    /// Where it is, from the machine's zero, and how fast.
    pub actual: Point,
    /// Of the rated torque.
    pub torque: f64,
    /// Something holds it.
    pub blocked: bool,
}

impl Axis {
    /// An axis at its start.
    pub fn new(config: AxisConfig) -> Self {
        let actual = Point { position: config.start, velocity: 0.0 };
        Self { config, actual, torque: 0.0, blocked: false }
    }

    /// The servo follows a demand that goes from a point to another in so many seconds: a lag of the first order, in closed
    /// form, so that it does not depend on how often it is looked at.
    pub fn follow(&mut self, from: Point, to: Point, acceleration: f64, seconds: f64) {
        let rate = (to.position - from.position) / seconds;
        let lag = rate * LAG;
        let rest = (self.actual.position - from.position + lag) * (-seconds / LAG).exp();
        let position = to.position - lag + rest;
        let arrived = to.velocity == 0.0 && (position - to.position).abs() < 0.01;
        let next = if arrived { to } else { Point { position, velocity: (to.position - position) / LAG } };
        self.move_to(next);
        let velocity = self.actual.velocity;
        let friction = if velocity == 0.0 { 0.0 } else { self.config.friction * velocity.signum() };
        self.torque = (acceleration / self.config.rated + friction).clamp(-3.0, 3.0);
    }

    /// A torque, of the rated one, pushes it for so many seconds, up to a velocity.
    pub fn push(&mut self, torque: f64, most: f64, seconds: f64) {
        self.torque = torque;
        let velocity = self.actual.velocity;
        let friction = self.config.friction;
        let against = if velocity != 0.0 { velocity.signum() } else { torque.signum() } * friction;
        let change = (torque - against) * self.config.rated * seconds;
        let held = velocity == 0.0 && torque.abs() <= friction;
        // Friction stops it, but does not turn it round.
        let stops = velocity * (velocity + change) < 0.0 && torque.abs() <= friction;
        let next = if held || stops { 0.0 } else { (velocity + change).clamp(-most, most) };
        let position = self.actual.position + (velocity + next) / 2.0 * seconds;
        self.move_to(Point { position, velocity: next });
    }

    /// Without current it coasts.
    pub fn coast(&mut self, seconds: f64) {
        self.push(0.0, f64::INFINITY, seconds);
    }

    fn move_to(&mut self, next: Point) {
        let before = self.actual.position;
        let [low, high] = self.config.ends;
        let position = if self.blocked { before } else { next.position.clamp(low, high) };
        let velocity = if position == next.position { next.velocity } else { 0.0 };
        self.actual = Point { position, velocity };
    }

    /// Position units of a turn.
    pub fn turn(&self) -> f64 {
        self.config.turn
    }

    /// Its switches.
    pub fn inputs(&self) -> u32 {
        let at = self.actual.position;
        let [negative, positive] = self.config.limits;
        let [from, to] = self.config.home;
        let bit = |on, bit| if on { bit } else { 0 };
        bit(at <= negative, input::NEGATIVE)
            | bit(at >= positive, input::POSITIVE)
            | bit((from..=to).contains(&at), input::HOME)
    }

    /// The place of the index that lies between two positions, if one does.
    pub fn index_between(&self, from: f64, to: f64) -> Option<f64> {
        let turn = self.config.turn;
        let index = if to > from { (from / turn).floor() + 1.0 } else { (from / turn).ceil() - 1.0 } * turn;
        let passed = if to > from { index <= to } else { index >= to && to < from };
        passed.then_some(index)
    }
}

//! How a demand goes: pieces of constant acceleration, in closed form.

/// Where a demand is, and how fast: position units, and per second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Position.
    pub position: f64,
    /// Velocity.
    pub velocity: f64,
}

impl Point {
    /// After so many seconds of an acceleration.
    fn after(self, seconds: f64, acceleration: f64) -> Self {
        Self {
            position: self.position + self.velocity * seconds + acceleration * seconds * seconds / 2.0,
            velocity: self.velocity + acceleration * seconds,
        }
    }
}

/// How fast a demand may change, all above 0, per second and per second squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Highest velocity.
    pub velocity: f64,
    /// Acceleration.
    pub acceleration: f64,
    /// Deceleration.
    pub deceleration: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    seconds: f64,
    acceleration: f64,
}

/// The way of a demand from where it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Course {
    from: Point,
    pieces: Vec<Piece>,
    /// Where it is in the end, from when on it goes on with its last velocity.
    to: Point,
}

impl Course {
    /// It stays.
    pub fn standing(position: f64) -> Self {
        let from = Point { position, velocity: 0.0 };
        Self { from, pieces: Vec::new(), to: from }
    }

    /// To a velocity, which it keeps.
    pub fn to_velocity(from: Point, velocity: f64, acceleration: f64, deceleration: f64) -> Self {
        let mut course = Self { from, pieces: Vec::new(), to: from };
        if from.velocity * velocity < 0.0 {
            course.change(0.0, deceleration);
        }
        let slower = velocity.abs() < course.to.velocity.abs();
        course.change(velocity, if slower { deceleration } else { acceleration });
        course
    }

    /// To a position, where it stands, or which it passes with `passing` (at least 0) towards it.
    pub fn to_position(from: Point, target: f64, limits: Limits, passing: f64) -> Self {
        let mut course = Self { from, pieces: Vec::new(), to: from };
        let stop = |at: Point| at.velocity * at.velocity.abs() / (2.0 * limits.deceleration);
        let way = target - (from.position + stop(from));
        let direction = if way < 0.0 { -1.0 } else { 1.0 };
        if from.velocity * direction < 0.0 {
            // It goes the wrong way, or is too fast to stop in time.
            course.change(0.0, limits.deceleration);
        } else if from.velocity.abs() > limits.velocity {
            course.change(direction * limits.velocity, limits.deceleration);
        }
        let (begin, a, d) = (course.to, limits.acceleration, limits.deceleration);
        let way = ((target - begin.position) * direction).max(0.0);
        let (v0, v1) = (begin.velocity.abs(), passing.min(limits.velocity));
        // Highest velocity of an acceleration with a deceleration right after it.
        let square = (2.0 * a * d * way + d * v0 * v0 + a * v1 * v1) / (a + d);
        let peak = square.max(0.0).sqrt().clamp(v0, limits.velocity.max(v0));
        course.change(direction * peak, a);
        let rest = (target - course.to.position) * direction - (peak * peak - v1 * v1).max(0.0) / (2.0 * d);
        if rest > 0.0 && peak > 0.0 {
            course.push(rest / peak, 0.0);
        }
        if v1 < peak {
            course.change(direction * v1, d);
        }
        course.to.position = target;
        course
    }

    /// To standstill.
    pub fn stop(from: Point, deceleration: f64) -> Self {
        Self::to_velocity(from, 0.0, deceleration, deceleration)
    }

    /// To a position in so many seconds, as straight as the positions are given; it stands there.
    pub fn straight(from: f64, target: f64, seconds: f64) -> Self {
        let velocity = (target - from) / seconds;
        let from = Point { position: from, velocity };
        let to = Point { position: target, velocity: 0.0 };
        Self { from, pieces: vec![Piece { seconds, acceleration: 0.0 }], to }
    }

    fn change(&mut self, velocity: f64, acceleration: f64) {
        let change = velocity - self.to.velocity;
        if change != 0.0 {
            self.push((change / acceleration).abs(), change.signum() * acceleration);
            self.to.velocity = velocity;
        }
    }

    fn push(&mut self, seconds: f64, acceleration: f64) {
        self.pieces.push(Piece { seconds, acceleration });
        self.to = self.to.after(seconds, acceleration);
    }

    /// Seconds until its end.
    pub fn seconds(&self) -> f64 {
        self.pieces.iter().map(|piece| piece.seconds).sum()
    }

    /// Where it ends.
    pub fn end(&self) -> Point {
        self.to
    }

    /// Where it is after so many seconds.
    pub fn at(&self, mut seconds: f64) -> Point {
        let mut point = self.from;
        for piece in &self.pieces {
            if seconds < piece.seconds {
                return point.after(seconds, piece.acceleration);
            }
            point = point.after(piece.seconds, piece.acceleration);
            seconds -= piece.seconds;
        }
        self.to.after(seconds, 0.0)
    }

    /// Its acceleration then.
    pub fn acceleration(&self, mut seconds: f64) -> f64 {
        for piece in &self.pieces {
            if seconds < piece.seconds {
                return piece.acceleration;
            }
            seconds -= piece.seconds;
        }
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { velocity: 1_000.0, acceleration: 2_000.0, deceleration: 4_000.0 };

    fn rest(position: f64) -> Point {
        Point { position, velocity: 0.0 }
    }

    #[test]
    fn a_trapezoid() {
        let course = Course::to_position(rest(0.0), 10_000.0, LIMITS, 0.0);
        // 0.5 s and 250 units up, 0.25 s and 125 units down, the rest at 1000.
        assert!((course.seconds() - (0.5 + 0.25 + 9_625.0 / 1_000.0)).abs() < 1e-9);
        assert_eq!(course.at(0.5), Point { position: 250.0, velocity: 1_000.0 });
        assert_eq!(course.at(100.0), rest(10_000.0));
        let back = Course::to_position(rest(10_000.0), 0.0, LIMITS, 0.0);
        assert_eq!(back.at(0.5), Point { position: 9_750.0, velocity: -1_000.0 });
        assert!((back.seconds() - course.seconds()).abs() < 1e-9);
    }

    #[test]
    fn a_triangle() {
        let course = Course::to_position(rest(0.0), 60.0, LIMITS, 0.0);
        // v² (1/2a + 1/2d) = 60: v = 400.
        let peak = course.at(0.2);
        assert!((peak.velocity - 400.0).abs() < 1e-6 && (peak.position - 40.0).abs() < 1e-6, "{peak:?}");
        assert!((course.seconds() - 0.3).abs() < 1e-9);
    }

    #[test]
    fn it_turns_round_and_slows_down() {
        let from = Point { position: 0.0, velocity: 800.0 };
        // It cannot stop before 80: 800²/8000.
        let course = Course::to_position(from, 10.0, LIMITS, 0.0);
        assert_eq!(course.at(0.2), rest(80.0));
        assert!((course.at(course.seconds()).position - 10.0).abs() < 1e-9);
        let fast = Point { position: 0.0, velocity: 2_000.0 };
        let course = Course::to_position(fast, 10_000.0, LIMITS, 0.0);
        assert!((course.at(0.25).velocity - 1_000.0).abs() < 1e-9);
        assert!((course.at(0.3).velocity - 1_000.0).abs() < 1e-9);
        assert_eq!(course.end(), rest(10_000.0));
    }

    #[test]
    fn it_passes_a_position() {
        let course = Course::to_position(rest(0.0), 5_000.0, LIMITS, 1_000.0);
        assert_eq!(course.end(), Point { position: 5_000.0, velocity: 1_000.0 });
        let after = course.at(course.seconds() + 0.1);
        assert!((after.position - 5_100.0).abs() < 1e-6);
    }

    #[test]
    fn velocities() {
        let from = Point { position: 0.0, velocity: -400.0 };
        let course = Course::to_velocity(from, 1_000.0, 2_000.0, 4_000.0);
        assert!((course.seconds() - (0.1 + 0.5)).abs() < 1e-9);
        assert_eq!(course.at(0.1).velocity, 0.0);
        assert_eq!(course.acceleration(0.05), 4_000.0);
        assert_eq!(course.acceleration(0.2), 2_000.0);
        assert_eq!(course.acceleration(1.0), 0.0);
        let slower = Course::to_velocity(Point { position: 0.0, velocity: 900.0 }, 100.0, 2_000.0, 4_000.0);
        assert!((slower.seconds() - 0.2).abs() < 1e-9, "decelerates");
        assert_eq!(Course::stop(from, 1_000.0).end(), rest(-80.0));
    }

    #[test]
    fn straight_lines() {
        let course = Course::straight(10.0, 20.0, 0.001);
        let half = course.at(0.0005);
        assert!((half.position - 15.0).abs() < 1e-9 && half.velocity == 10_000.0);
        assert_eq!(course.at(0.002), rest(20.0));
    }
}

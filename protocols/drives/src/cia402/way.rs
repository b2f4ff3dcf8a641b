//! The way to a position, a set-point a period: what a drive makes of a target by itself in profile position, made for it where
//! it takes set-points with every SYNC.
//!
//! Exact in whole numbers: the last set-point is the target, and on the way to a standstill the velocity falls by the
//! deceleration in each period. Positions and what is added to them are in 2^-32 position units.

use core::time::Duration;

/// Bits behind the point.
const POINT: u32 = 32;
/// No step is longer, so that nothing that is made of them overflows.
const MOST: u128 = 1 << 60;

/// How fast a way may be, position units per second and per second squared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Highest velocity.
    pub velocity: u32,
    /// Acceleration.
    pub acceleration: u32,
    /// Deceleration.
    pub deceleration: u32,
}

/// The same for one period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Steps {
    velocity: i64,
    acceleration: i64,
    deceleration: i64,
}

impl Steps {
    /// In periods of so long; of what is less than can be counted there is the least.
    pub fn new(limits: Limits, period: Duration) -> Self {
        const SECOND: u128 = 1_000_000;
        let micros = period.as_micros();
        let step = |value: u32, time: u128, unit: u128| {
            let step = (u128::from(value) << POINT).saturating_mul(time) / unit;
            step.clamp(1, MOST) as i64
        };
        let rate = |value| step(value, micros * micros, SECOND * SECOND);
        Self {
            velocity: step(limits.velocity, micros, SECOND),
            acceleration: rate(limits.acceleration),
            deceleration: rate(limits.deceleration),
        }
    }

    /// The highest velocity from which what is `far` can still be reached without passing it: a period with that, and then
    /// each with `deceleration` less.
    fn before(&self, far: u64) -> i64 {
        let rate = self.deceleration.unsigned_abs();
        if far <= rate {
            return far as i64;
        }
        // v (v + rate) = 2 rate far.
        let (rate, far) = (u128::from(rate), u128::from(far));
        let root = (rate * rate + 8 * rate * far).isqrt();
        ((root - rate) / 2).min(MOST) as i64
    }
}

/// Where it has come to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Way {
    position: i64,
    /// In the last period.
    velocity: i64,
}

impl Way {
    /// It stands.
    pub const fn standing(position: i32) -> Self {
        Self { position: (position as i64) << POINT, velocity: 0 }
    }

    /// Its set-point now, the nearest position.
    pub const fn set_point(&self) -> i32 {
        (self.position.saturating_add(1 << (POINT - 1)) >> POINT) as i32
    }

    /// Whether it stands.
    pub const fn stands(&self) -> bool {
        self.velocity == 0
    }

    /// Goes on for a period, towards a target. True when it is there, and stands.
    pub fn towards(&mut self, target: i32, steps: &Steps) -> bool {
        let target = i64::from(target) << POINT;
        if self.velocity == 0 && self.position == target {
            return true;
        }
        let backward = target < self.position || target == self.position && self.velocity < 0;
        let velocity = if backward { -self.velocity } else { self.velocity };
        let best = steps.before(target.abs_diff(self.position)).min(steps.velocity);
        // Away from the target it slows down, too.
        let rise = if velocity < 0 { steps.deceleration } else { steps.acceleration };
        let velocity = best.clamp(velocity - steps.deceleration, velocity.max(velocity + rise));
        self.go(if backward { -velocity } else { velocity });
        false
    }

    /// Slows down for a period. True when it stands.
    pub fn brake(&mut self, steps: &Steps) -> bool {
        let slower = self.velocity.abs() - steps.deceleration;
        self.go(slower.max(0) * self.velocity.signum());
        self.stands()
    }

    fn go(&mut self, velocity: i64) {
        self.velocity = velocity;
        self.position = self.position.saturating_add(velocity);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const MS: Duration = Duration::from_millis(1);
    const LIMITS: Limits = Limits { velocity: 1_000, acceleration: 2_000, deceleration: 4_000 };

    /// Periods to a target, and the highest velocity on the way, position units a second.
    fn follow(way: &mut Way, target: i32, steps: &Steps) -> (u32, f64) {
        let mut most = 0_f64;
        for periods in 0..1_000_000 {
            if way.towards(target, steps) {
                assert_eq!((way.set_point(), way.stands()), (target, true));
                return (periods, most);
            }
            most = most.max(way.velocity.unsigned_abs() as f64 / 2_f64.powi(32) * 1e3);
        }
        panic!("it does not arrive: {way:?}");
    }

    #[test]
    fn a_trapezoid_takes_the_time_that_it_should() {
        let steps = Steps::new(LIMITS, MS);
        let (periods, most) = follow(&mut Way::standing(-5_000), 5_000, &steps);
        // 0.5 s and 250 units up, 0.25 s and 125 units down, the rest at 1000.
        assert!((10_375..=10_378).contains(&periods), "{periods}");
        assert!((most - 1_000.0).abs() < 1e-3, "{most}");
    }

    #[test]
    fn a_triangle_does_not_get_so_fast() {
        let (periods, most) = follow(&mut Way::standing(0), 60, &Steps::new(LIMITS, MS));
        // v² (1/2a + 1/2d) = 60: v = 400.
        assert!((299..=303).contains(&periods), "{periods}");
        assert!((398.0..=400.5).contains(&most), "{most}");
    }

    #[test]
    fn another_target_on_the_way() {
        let steps = Steps::new(LIMITS, MS);
        let mut way = Way::standing(0);
        for _ in 0..1_000 {
            way.towards(10_000, &steps);
        }
        let turned_at = way.set_point();
        let mut farthest = turned_at;
        for _ in 0..260 {
            way.towards(0, &steps);
            farthest = farthest.max(way.set_point());
        }
        // 1000²/8000.
        assert!((farthest - turned_at - 125).abs() <= 1, "{}", farthest - turned_at);
        follow(&mut way, 0, &steps);
    }

    #[test]
    fn it_brakes() {
        let steps = Steps::new(LIMITS, MS);
        let mut way = Way::standing(0);
        for _ in 0..1_000 {
            way.towards(10_000, &steps);
        }
        let from = way.set_point();
        let periods = (1..).find(|_| way.brake(&steps)).expect("it stands");
        assert!((249..=251).contains(&periods), "{periods}");
        assert!((way.set_point() - from - 125).abs() <= 1);
    }

    #[test]
    fn the_ends_of_the_range() {
        let fast = Limits { velocity: u32::MAX, acceleration: u32::MAX, deceleration: u32::MAX };
        for period in [MS, Duration::from_secs(60)] {
            let steps = Steps::new(fast, period);
            let mut way = Way::standing(i32::MIN);
            follow(&mut way, i32::MAX, &steps);
            follow(&mut way, i32::MIN, &steps);
        }
    }

    proptest! {
        /// Whatever it was doing before, it never changes its velocity by more than it may, and arrives.
        #[test]
        fn it_keeps_its_limits_and_arrives(
            velocity in 1_000..2_000_000_u32,
            acceleration in 10_000..100_000_000_u32,
            deceleration in 10_000..100_000_000_u32,
            turns in proptest::collection::vec((-20_000..20_000_i32, 0..400_u32), 1..6),
            last in -20_000..20_000_i32,
        ) {
            let steps = Steps::new(Limits { velocity, acceleration, deceleration }, MS);
            let mut way = Way::standing(0);
            let go = |way: &mut Way, target| {
                let before = way.velocity;
                let there = way.towards(target, &steps);
                let (rise, fall) = (way.velocity - before, before - way.velocity);
                let backward = before < 0 || before == 0 && way.velocity < 0;
                let (faster, slower) = if backward { (fall, rise) } else { (rise, fall) };
                // Who turns round within a period does a part of each.
                let most = steps.acceleration.max(steps.deceleration);
                let turns = before.signum() * way.velocity.signum() < 0;
                assert!(faster <= steps.acceleration && slower <= if turns { most } else { steps.deceleration });
                assert!(way.velocity.abs() <= steps.velocity);
                there
            };
            for (target, periods) in turns {
                (0..periods).for_each(|_| { go(&mut way, target); });
            }
            prop_assert!((0..200_000).any(|_| go(&mut way, last)), "{way:?}");
            prop_assert_eq!((way.set_point(), way.stands()), (last, true));
        }
    }
}

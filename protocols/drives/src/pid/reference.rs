//! Where the axis is to be now, on its way to the set-point.

/// A position that goes to its target no faster than it may, in whole counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reference {
    at: i64,
    target: i64,
    /// What it may still go, in 2^-32 counts.
    rest: u32,
}

impl Reference {
    /// At rest.
    pub const fn at(position: i64) -> Self {
        Self { at: position, target: position, rest: 0 }
    }

    pub const fn set_target(&mut self, target: i64) {
        self.target = target;
    }

    pub const fn target(&self) -> i64 {
        self.target
    }

    pub const fn position(&self) -> i64 {
        self.at
    }

    /// Goes on by at most `step`, in 2^-32 counts.
    #[inline]
    pub fn step(&mut self, step: u64) {
        let step = step.saturating_add(u64::from(self.rest));
        let counts = (step >> 32) as i64;
        let way = self.target.saturating_sub(self.at);
        if way > counts {
            self.at += counts;
        } else if way < -counts {
            self.at -= counts;
        } else {
            self.at = self.target;
            self.rest = 0;
            return;
        }
        self.rest = step as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_of_a_count_a_step() {
        let mut reference = Reference::at(10);
        reference.set_target(12);
        for expected in [10, 10, 10, 11, 11, 11, 11, 12, 12, 12] {
            reference.step(1 << 30);
            assert_eq!(reference.position(), expected);
        }
        reference.set_target(11);
        for expected in [12, 12, 12, 11, 11] {
            reference.step(1 << 30);
            assert_eq!(reference.position(), expected, "backwards as slowly, with no step saved up");
        }
    }

    #[test]
    fn ends_of_the_range() {
        let mut reference = Reference::at(i64::MIN);
        reference.set_target(i64::MAX);
        reference.step(u64::MAX);
        assert_eq!(reference.position(), i64::MIN + i64::from(u32::MAX));
        let mut reference = Reference::at(i64::MAX - 1);
        reference.set_target(i64::MAX);
        reference.step(u64::MAX);
        assert_eq!(reference.position(), i64::MAX);
        reference.set_target(i64::MIN);
        reference.step(u64::MAX);
        assert_eq!(reference.position(), i64::MAX - i64::from(u32::MAX));
    }
}

//! Incremental encoders: two tracks, sampled.

/// What happened between two samples of the tracks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// Nothing, or back and forth between the samples.
    None,
    /// One count on: A leads B.
    Forward,
    /// One count back: B leads A.
    Backward,
    /// Both tracks have changed: at least one edge was missed, in a direction that the tracks do not tell.
    Missed,
}

/// Counts every edge of both tracks (x4).
///
/// Four counts a line of the disc. It must be sampled more often than the edges come; [`Quadrature::missed`] tells where
/// it was not, or where noise hit a track. The position is not guessed then: it is off by two, or by more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quadrature {
    phase: u8,
    position: i64,
    missed: u32,
}

impl Quadrature {
    /// A counter at position 0 that begins at these levels of the tracks.
    pub const fn new(a: bool, b: bool) -> Self {
        Self { phase: phase(a, b), position: 0, missed: 0 }
    }

    /// Takes a sample of the tracks.
    pub const fn sample(&mut self, a: bool, b: bool) -> Edge {
        let phase = phase(a, b);
        let turned = phase.wrapping_sub(self.phase) & 3;
        self.phase = phase;
        match turned {
            0 => Edge::None,
            1 => {
                self.position = self.position.wrapping_add(1);
                Edge::Forward
            }
            2 => {
                self.missed = self.missed.saturating_add(1);
                Edge::Missed
            }
            _ => {
                self.position = self.position.wrapping_sub(1);
                Edge::Backward
            }
        }
    }

    /// Counts since the start.
    pub const fn position(&self) -> i64 {
        self.position
    }

    /// How often both tracks changed at once. Every one of them leaves the position wrong.
    pub const fn missed(&self) -> u32 {
        self.missed
    }
}

/// The quarter of a line: 0 to 3, forward in this order of AB: 00, 10, 11, 01.
const fn phase(a: bool, b: bool) -> u8 {
    (b as u8) << 1 | (a as u8 ^ b as u8)
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;

    const FORWARD: [(bool, bool); 4] = [(false, false), (true, false), (true, true), (false, true)];

    /// The tracks at a position.
    fn tracks(position: i64) -> (bool, bool) {
        FORWARD[position.rem_euclid(4) as usize]
    }

    fn go(counter: &mut Quadrature, position: i64) -> Edge {
        let (a, b) = tracks(position);
        counter.sample(a, b)
    }

    #[test]
    fn a_line_is_four_counts_both_ways() {
        let mut counter = Quadrature::new(false, false);
        for position in 1..=8 {
            assert_eq!(go(&mut counter, position), Edge::Forward);
            assert_eq!(counter.position(), position);
        }
        for position in (-8..8).rev() {
            assert_eq!(go(&mut counter, position), Edge::Backward);
            assert_eq!(counter.position(), position);
        }
        assert_eq!(counter.missed(), 0);
    }

    #[test]
    fn reversal_within_a_line_loses_nothing() {
        let mut counter = Quadrature::new(false, false);
        for position in [1, 2, 1, 2, 3, 2, 1, 0, -1, 0, -1, -2, -3, -2, -1, 0] {
            assert!(matches!(go(&mut counter, position), Edge::Forward | Edge::Backward));
            assert_eq!(counter.position(), position);
        }
        // A track that trembles at one edge.
        for _ in 0..1_000 {
            assert_eq!(go(&mut counter, 1), Edge::Forward);
            assert_eq!(go(&mut counter, 1), Edge::None);
            assert_eq!(go(&mut counter, 0), Edge::Backward);
        }
        assert_eq!((counter.position(), counter.missed()), (0, 0));
    }

    #[test]
    fn all_16_transitions() {
        for from in 0..4 {
            for to in 0..4 {
                let (a, b) = tracks(from);
                let mut counter = Quadrature::new(a, b);
                let edge = go(&mut counter, to);
                let expected = match (to - from).rem_euclid(4) {
                    0 => (Edge::None, 0, 0),
                    1 => (Edge::Forward, 1, 0),
                    2 => (Edge::Missed, 0, 1),
                    _ => (Edge::Backward, -1, 0),
                };
                assert_eq!((edge, counter.position(), counter.missed()), expected, "{from} to {to}");
            }
        }
    }

    #[test]
    fn a_missed_edge_is_counted_and_not_guessed() {
        let mut counter = Quadrature::new(false, false);
        go(&mut counter, 1);
        assert_eq!(go(&mut counter, 3), Edge::Missed);
        assert_eq!((counter.position(), counter.missed()), (1, 1));
        assert_eq!(go(&mut counter, 4), Edge::Forward, "it counts on from where it is");
        assert_eq!(go(&mut counter, 2), Edge::Missed);
        assert_eq!((counter.position(), counter.missed()), (2, 2));
        // Three edges at once look like one backwards: why it must be sampled often enough.
        assert_eq!(go(&mut counter, 5), Edge::Backward);
    }

    proptest! {
        #[test]
        fn any_walk_by_single_counts(walk in prop::collection::vec(-1..=1_i64, 0..500)) {
            let mut counter = Quadrature::new(false, false);
            let mut truth = 0;
            for step in walk {
                truth += step;
                go(&mut counter, truth);
                prop_assert_eq!(counter.position(), truth);
            }
            prop_assert_eq!(counter.missed(), 0);
        }

        #[test]
        fn whatever_is_sampled_is_counted_or_missed(samples in prop::collection::vec(any::<(bool, bool)>(), 0..500)) {
            let mut counter = Quadrature::new(false, false);
            let mut last = (false, false);
            let (mut edges, mut missed) = (0, 0);
            for (a, b) in samples {
                match (a != last.0, b != last.1) {
                    (true, true) => missed += 1,
                    (true, false) | (false, true) => edges += 1,
                    (false, false) => {}
                }
                counter.sample(a, b);
                last = (a, b);
            }
            prop_assert_eq!(counter.missed(), missed);
            prop_assert!(counter.position().abs() <= edges);
            prop_assert_eq!((counter.position() - edges) % 2, 0);
        }
    }
}

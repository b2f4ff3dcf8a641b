//! One case: so many stations, such frames, such a load, for such a time.

use std::time::Duration;

use puente_framed::arbiter::{Config, Policy};
use puente_line::{Instant, Settings};
use puente_shared_line::talker::{Load, Talker, frame_of};
use puente_shared_line::{Line, Place};

use super::station::Station;

/// The whole cable, as a signal travels: about 100 m.
const CABLE: Duration = Duration::from_nanos(500);

/// Frames a station on average, over which fairness in the short run is taken.
pub const SHORT: u32 = 10;

/// What is measured.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    pub policy: Policy,
    pub stations: usize,
    /// Bytes of a frame.
    pub length: usize,
    /// Offered bits per bit of the line; none for saturation.
    pub offered: Option<f64>,
}

/// What was measured.
#[derive(Clone, Debug)]
pub struct Figures {
    /// Part of the time in which whole frames were on the line.
    pub throughput: f64,
    /// Ascending.
    pub delays: Vec<Duration>,
    /// Jain's index of the stations' frames: 1 where all had as many, 1/n where one had all.
    pub fairness: f64,
    /// The same over [`SHORT`] frames a station, on average.
    pub short_fairness: f64,
    pub collisions_per_frame: f64,
    /// Frames given up, and those that met a full queue, of all that came.
    pub failed: f64,
    pub rejected: f64,
}

/// Bits of a frame on the line.
pub fn frame_bits(line: Settings, length: usize) -> f64 {
    (length as u64 * u64::from(line.format.bits())) as f64
}

/// Runs a case for `time` on the line, after a tenth of it to settle.
pub fn measure(config: Config, case: Case, time: Duration) -> Result<Figures, String> {
    let config = Config { policy: case.policy, ..config };
    let mut line = Line::new(config.line, config.gap, 0.0, 0xB105);
    let load = case.offered.map_or(Load::Saturated, |offered| {
        let frame = frame_bits(config.line, case.length) / f64::from(config.line.baud);
        Load::Offered(Duration::from_secs_f64(frame * case.stations as f64 / offered))
    });
    for station in 0..case.stations {
        let seed = 0x5EED + 7_919 * station as u64;
        let frame = frame_of(station as u8 + 1, 17, case.length);
        let talker = Talker::new(config, frame, load, seed);
        let position = CABLE.mul_f64(station as f64 / case.stations.max(2).saturating_sub(1) as f64);
        let place = Place { position, ..Place::new(config.line) };
        line.join(Station::Talker(Box::new(talker)), place);
    }
    line.join(Station::listener(config.gap), Place::new(config.line));
    let settle = Instant::ZERO + time / 10;
    line.run_until(settle).map_err(|violation| violation.to_string())?;
    for station in 0..case.stations {
        if let Station::Talker(talker) = line.tell(station) {
            talker.seen.delays = Some(Vec::new());
        }
    }
    let mut seen = vec![counts(&line)];
    let frame = Duration::from_secs_f64(frame_bits(config.line, case.length) / f64::from(config.line.baud));
    let step =
        frame.mul_f64((case.stations as u32 * SHORT) as f64 / case.offered.map_or(1.0, |load| load.min(1.0)));
    while line.now() < settle + time {
        let next = line.now() + step;
        line.run_until(next.min(settle + time)).map_err(|violation| violation.to_string())?;
        seen.push(counts(&line));
    }
    figures(&line, config, case, time, &seen)
}

/// Of each station and, last, of the listener.
fn counts(line: &Line<Station>) -> Vec<Counts> {
    line.nodes()
        .map(|node| match node {
            Station::Talker(talker) => Counts {
                frames: talker.seen.sent,
                failed: talker.seen.failed,
                rejected: talker.seen.rejected,
                collisions: talker.statistics().collisions.into(),
            },
            Station::Listener { heard, .. } => Counts { frames: *heard, ..Counts::default() },
        })
        .collect()
}

#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    frames: u64,
    failed: u64,
    rejected: u64,
    collisions: u64,
}

/// From one moment to another, each station and the listener.
fn between(before: &[Counts], after: &[Counts]) -> Vec<Counts> {
    let each = before.iter().zip(after);
    each.map(|(before, after)| Counts {
        frames: after.frames - before.frames,
        failed: after.failed - before.failed,
        rejected: after.rejected - before.rejected,
        collisions: after.collisions - before.collisions,
    })
    .collect()
}

fn figures(
    line: &Line<Station>,
    config: Config,
    case: Case,
    time: Duration,
    seen: &[Vec<Counts>],
) -> Result<Figures, String> {
    let (Some(first), Some(last)) = (seen.first(), seen.last()) else {
        return Err("nothing was measured".into());
    };
    let each = between(first, last);
    let (listener, each) = each.split_last().ok_or("no listener")?;
    let sum = |what: fn(&Counts) -> u64| each.iter().map(what).sum::<u64>();
    let frames = sum(|counts| counts.frames);
    if frames.abs_diff(listener.frames) > 2 {
        return Err(format!("{frames} frames were sent, {} were understood", listener.frames));
    }
    let (failed, rejected) = (sum(|counts| counts.failed), sum(|counts| counts.rejected));
    let came = (frames + failed + rejected) as f64;
    let mut delays: Vec<Duration> = Vec::new();
    for node in line.nodes() {
        if let Station::Talker(talker) = node {
            delays.extend(talker.seen.delays.iter().flatten());
        }
    }
    delays.sort_unstable();
    let line_bits = time.as_secs_f64() * f64::from(config.line.baud);
    Ok(Figures {
        throughput: frames as f64 * frame_bits(config.line, case.length) / line_bits,
        delays,
        fairness: jain(each),
        short_fairness: short_fairness(seen),
        collisions_per_frame: sum(|counts| counts.collisions) as f64 / frames.max(1) as f64,
        failed: failed as f64 / came,
        rejected: rejected as f64 / came,
    })
}

fn short_fairness(seen: &[Vec<Counts>]) -> f64 {
    let spans = seen.windows(2).map(|pair| between(&pair[0], &pair[1]));
    let each: Vec<f64> = spans.map(|span| jain(&span[..span.len() - 1])).collect();
    each.iter().sum::<f64>() / each.len().max(1) as f64
}

/// (sum x)^2 / (n sum x^2) of the frames of each.
fn jain(shares: &[Counts]) -> f64 {
    let sum: f64 = shares.iter().map(|share| share.frames as f64).sum();
    let squares: f64 = shares.iter().map(|share| (share.frames as f64).powi(2)).sum();
    if squares == 0.0 { 1.0 } else { sum * sum / (shares.len() as f64 * squares) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fairness_goes_from_one_to_one_in_n() {
        let shares = |frames: [u64; 4]| frames.map(|frames| Counts { frames, ..Counts::default() });
        assert_eq!(jain(&shares([3, 3, 3, 3])), 1.0);
        assert_eq!(jain(&shares([3, 0, 0, 0])), 0.25);
    }
}

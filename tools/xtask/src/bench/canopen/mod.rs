//! Set-points with every SYNC on a simulated CAN bus, against what the bits take.
//!
//! All times are virtual, so that every machine measures the same.

mod page;
mod rig;

use std::time::Duration;

use puente_canopen::Frame;

use crate::Outcome;
use rig::{BITRATE, Buses, Figures, PERIOD, Rig};

/// Time of each row.
const TIME: Duration = Duration::from_secs(600);
/// The drives of one bus.
const AXES: [u8; 3] = [2, 3, 4];
/// Those of the other.
const MORE: [u8; 3] = [5, 6, 7];

/// A row of the page.
struct Row {
    name: &'static str,
    figures: Figures,
}

impl Row {
    /// Buses at once, each with axes that follow paths, for a time.
    fn measure<const N: usize>(
        buses: [(&'static str, &[u8], bool); N],
        time: Duration,
    ) -> Result<[Self; N], String> {
        let rigs = buses.iter().map(|(_, axes, client)| Rig::new(axes, *client)).collect::<Result<_, _>>()?;
        let mut figures = Buses::start(rigs)?.measure(time)?.into_iter();
        Ok(buses.map(|(name, ..)| Self { name, figures: figures.next().unwrap_or_default() }))
    }

    /// What is wrong with it.
    fn judge(&self, time: Duration) -> Result<(), String> {
        let Self { name, figures } = self;
        let cycles = time.div_duration_f64(PERIOD) as u64;
        if figures.cycles != cycles || figures.missed != 0 {
            return Err(format!("{name}: {} of {cycles} cycles, {} missed", figures.cycles, figures.missed));
        }
        if figures.bus.bits != figures.computed() {
            return Err(format!("{name}: {} bits, computed {}", figures.bus.bits, figures.computed()));
        }
        if figures.blocked > blocking() {
            return Err(format!("{name}: SYNC waited for {:?}", figures.blocked));
        }
        Ok(())
    }
}

/// What `bits` take on the bus.
fn wire(bits: u32) -> Duration {
    Duration::from_secs(1) * bits / BITRATE
}

/// A frame that has begun is not taken off the bus: so long whatever comes first waits at most, for the longest frame with all
/// its stuff bits.
fn blocking() -> Duration {
    wire(Frame::worst_bits(false, 8))
}

/// Bits of a cycle at most: SYNC, and of each axis a set-point of four bytes and an answer of six.
const fn worst_cycle(axes: u32) -> u32 {
    Frame::worst_bits(false, 0) + axes * (Frame::worst_bits(false, 4) + Frame::worst_bits(false, 6))
}

fn rows(time: Duration) -> Result<[Row; 4], String> {
    let [three] = Row::measure([("three axes", &AXES, false)], time)?;
    let [client] = Row::measure([("three axes, a client reads all the time", &AXES, true)], time)?;
    let six = [
        ("six axes on two buses at once: the first", &AXES[..], false),
        ("six axes on two buses at once: the second", &MORE, false),
    ];
    let [first, second] = Row::measure(six, time)?;
    Ok([three, client, first, second])
}

pub fn run() -> Outcome {
    let rows = rows(TIME)?;
    println!("{}", page::page(&rows));
    rows.iter().try_for_each(|row| row.judge(TIME))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Acceptance 4, in little; `cargo xtask bench canopen` has ten minutes of it.
    #[test]
    fn no_cycle_is_missed() {
        let time = Duration::from_secs(2);
        for row in rows(time).expect("measured") {
            row.judge(time).expect("as it should be");
            let figures = row.figures;
            assert_eq!(figures.set_points.frames, 3 * figures.cycles);
            assert_eq!(figures.answers.frames, 3 * figures.cycles);
            assert_eq!(figures.sync.frames, figures.cycles);
            let load = figures.load(figures.bus.bits);
            assert!((50.0..100.0).contains(&load), "{load}");
        }
    }

    /// A client has what is left of the bus, and the drives do not notice.
    #[test]
    fn a_client_waits_for_the_axes() {
        let [row] = Row::measure([("a client", &AXES, true)], Duration::from_secs(1)).expect("measured");
        assert!(row.figures.transfers > 500, "{}", row.figures.transfers);
    }
}

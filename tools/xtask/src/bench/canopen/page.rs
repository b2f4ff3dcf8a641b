//! The page.

use super::rig::{BITRATE, Figures, PAUSE, PERIOD};
use super::{Row, TIME, blocking, wire, worst_cycle};
use crate::bench::samples::ms;
use puente_canopen::Frame;

pub fn page(rows: &[Row]) -> String {
    format!(
        "# Set-points with every SYNC, measured\n\n\
         `cargo xtask bench canopen > docs/canopen-bench.md`\n\n\
         The gateway's end of `protocols/servos` and simulated Lexium 23A of `tools/cell` on its CAN bus: {BITRATE} bit/s, SYNC\n\
         each {} ms. Interpolated position: after each SYNC a set-point for each axis (receive PDO 4, 4 bytes, taken at the next\n\
         SYNC), and from each axis its status and position (transmit PDO 3, 6 bytes). A heartbeat of each node each second.\n\
         Times are virtual, {} s a row, the same on every machine. Frames take the bits they have: stuff bits, and the\n\
         intermission of 3 bits after each.\n\n\
         A cycle is *missed* when a set-point or an answer of an axis is not between its SYNC and the next, or is there twice.\n\
         The *load* is what the bus has counted; *computed* is the sum of the frames that its stations say they have sent.\n\
         The client asks again {} us after each answer. One that lost no time at all would leave the bus to nobody behind it:\n\
         heartbeats come last, and their nodes would be taken for lost.\n\n\
         | bus | cycles | missed | load | computed | busy after SYNC, at most | SYNC waited, at most | from SYNC to SYNC |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|\n{}\n\
         Six axes are driven at once in the same time: two buses, each with a master of its own, and SYNC of both in the same\n\
         moment.\n\n\
         ## Where the bits are\n\n\
         | bus | SYNC | set-points | answers | others | transfers of the client |\n\
         |---|--:|--:|--:|--:|--:|\n{}\n\
         ## Bounds\n\n\
         A frame that has begun is not taken off the bus. So SYNC, which is before all others but NMT, waits for one frame at\n\
         most: {} bits for 8 bytes with all their stuff bits and the intermission, {} ms. That takes a controller that lets SYNC\n\
         go before frames of its own that have not begun, as the mailboxes of the boards do (`src/port/can/mailboxes.rs`), and the\n\
         port here. In an adapter that sends in the order given SYNC waits for the frames there, too: one that has been put there\n\
         during the intermission goes first, 3 bits and then up to {} bits more. With one frame before it the\n\
         cycle of three axes takes {} bits and {} ms at most; one of six on a single bus would take {} bits, {} ms, which is why\n\
         they are on two.",
        ms(PERIOD),
        TIME.as_secs(),
        PAUSE.as_micros(),
        rows.iter().map(row).collect::<String>(),
        rows.iter().map(shares).collect::<String>(),
        Frame::worst_bits(false, 8),
        ms(blocking()),
        Frame::worst_bits(false, 8),
        worst_cycle(3),
        ms(blocking() + wire(worst_cycle(3))),
        worst_cycle(6),
        ms(wire(worst_cycle(6))),
    )
}

fn row(Row { name, figures }: &Row) -> String {
    let Figures { cycles, missed, .. } = figures;
    format!(
        "| {name} | {cycles} | {missed} | {:.2} % | {:.2} % | {} | {} | {} to {} |\n",
        figures.load(figures.bus.bits),
        figures.load(figures.computed()),
        ms(figures.busy),
        ms(figures.blocked),
        ms(figures.shortest),
        ms(figures.longest),
    )
}

fn shares(Row { name, figures }: &Row) -> String {
    let [sync, set_points, answers, others] =
        [figures.sync, figures.set_points, figures.answers, figures.others]
            .map(|share| format!("{:.2} %", figures.load(share.bits)));
    format!("| {name} | {sync} | {set_points} | {answers} | {others} | {} |\n", figures.transfers)
}

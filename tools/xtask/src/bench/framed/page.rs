//! The page.

use puente_modules::Form;

use super::rig::Measured;
use super::{AXES, Fastest, MOST, REPORT, TIME, first};
use crate::bench::samples::ms;

pub fn page(
    fastest: &[Fastest],
    default: &[Measured],
    shared: &[((u64, u64), Measured)],
) -> Result<String, String> {
    Ok(format!(
        "# The cycle on the framed bus, measured\n\n\
         `cargo xtask bench framed > docs/framed.md`\n\n\
         A gateway's end and modules' ends of `protocols/modules` on the simulated line of `tools/shared-line`: 1000000 baud\n\
         8N1, transceivers that turn around in 1 to 2 bit times, stations that notice a start bit. Times are virtual, {} s a\n\
         row, the same on every machine. The line stops the run when a station breaks a rule. Gains as in\n\
         `examples/tx8.toml`, set-points of six digits; all axes follow.\n\n\
         ## As fast as it goes\n\n\
         {AXES} axes, all asked in every cycle, one cycle after the other: a frame of the gateway and {AXES} reports of\n\
         {REPORT} characters. The *floor* is what the characters take, a gap of 2 characters before each frame, and the\n\
         deference of 2 more before the gateway's. At most {MOST} % above it is asked for. The thesis gives 1.94 ms for\n\
         sending to 3 axes and the ACK of each; its acknowledgements say nothing of the axis, these reports say state,\n\
         position, following error, velocity and command.\n\n\
         | payload | characters of the frame | characters, time | floor | cycle, mean | longest | above the floor | of 1.94 ms |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|\n{}\n\
         ## `cycle_ms = 2`\n\n\
         {AXES} axes; as many are asked in each cycle, in turn, as 80 % of it has room for, at least one. *Line in use* is\n\
         the part of the time in which there are characters on it.\n\n\
         | payload | cycle, mean | longest | reports a cycle | each axis every | line in use | overruns | missed |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|\n{}\n\
         ## Two gateways on one line\n\n\
         One with two axes, one with one, in text. Answers go after a gap, whatever else is waiting after 2 characters more:\n\
         so nobody talks into another's answers. A gateway that had to wait for the line keeps the distance from then on,\n\
         and one that has heard another within the last second lets it go first after each of its cycles.\n\n\
         | cycles wanted | cycles, mean | longest | collisions a cycle | reports missed | line in use |\n\
         |---|--:|--:|--:|--:|--:|\n{}",
        TIME.as_secs(),
        fastest.iter().map(fastest_row).collect::<Result<String, String>>()?,
        ["text", "binary"].iter().zip(default).map(default_row).collect::<Result<String, String>>()?,
        shared.iter().map(shared_row).collect::<String>().trim_end(),
    ))
}

fn fastest_row(row: &Fastest) -> Result<String, String> {
    Ok(format!(
        "| {} | {} | {} | {} | {} | {} | {:.1} % | {:.0} % |\n",
        if row.form == Form::Text { "text" } else { "binary" },
        row.figures.update,
        ms(row.characters()?),
        ms(row.floor()?),
        ms(row.figures.mean),
        ms(row.figures.longest),
        row.above()?,
        row.figures.mean.as_secs_f64() / 1.94e-3 * 100.0,
    ))
}

fn default_row((name, measured): (&&str, &Measured)) -> Result<String, String> {
    let figures = first(measured)?;
    Ok(format!(
        "| {name} | {} | {} | {:.2} | {} | {:.0} % | {} | {} |\n",
        ms(figures.mean),
        ms(figures.longest),
        figures.reports,
        ms(figures.mean.mul_f64(f64::from(AXES) / figures.reports)),
        measured.share * 100.0,
        figures.overruns,
        figures.missed,
    ))
}

fn shared_row((wanted, measured): &((u64, u64), Measured)) -> String {
    let of = |what: fn(&super::Figures) -> String| {
        measured.gateways.iter().map(what).collect::<Vec<_>>().join(", ")
    };
    format!(
        "| {} ms, {} ms | {} | {} | {} | {} | {:.0} % |\n",
        wanted.0,
        wanted.1,
        of(|figures| ms(figures.mean)),
        of(|figures| ms(figures.longest)),
        of(|figures| format!("{:.3}", f64::from(figures.collisions) / figures.cycles as f64)),
        of(|figures| figures.missed.to_string()),
        measured.share * 100.0,
    )
}

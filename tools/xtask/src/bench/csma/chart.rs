//! The chart of the page, as SVG.

use std::fmt::Write;

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 300.0;
const LEFT: f64 = 60.0;
const TOP: f64 = 40.0;
const BELOW: f64 = 60.0;
const BETWEEN: f64 = 40.0;

/// A curve: its name, its colour, whether it is dashed, its points.
pub struct Curve {
    pub name: String,
    pub colour: &'static str,
    pub dashed: bool,
    pub points: Vec<(f64, f64)>,
}

/// An axis: from where to where, its marks, and whether it is logarithmic.
pub struct Axis {
    pub title: &'static str,
    pub from: f64,
    pub to: f64,
    pub marks: &'static [f64],
    pub logarithmic: bool,
}

impl Axis {
    /// 0 to 1.
    fn place(&self, value: f64) -> f64 {
        let (from, to, value) = match self.logarithmic {
            true => (self.from.ln(), self.to.ln(), value.max(self.from).ln()),
            false => (self.from, self.to, value),
        };
        ((value - from) / (to - from)).clamp(0.0, 1.0)
    }
}

pub struct Plot {
    pub title: &'static str,
    pub x: Axis,
    pub y: Axis,
    pub curves: Vec<Curve>,
}

/// The plots beside each other.
pub fn draw(plots: &[Plot]) -> String {
    let rows = plots.iter().map(|plot| plot.curves.len()).max().unwrap_or(0) as f64;
    let width = plots.len() as f64 * (LEFT + WIDTH + BETWEEN);
    let height = TOP + HEIGHT + BELOW + 18.0 * rows;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
    );
    for (at, plot) in plots.iter().enumerate() {
        svg += &one(plot, LEFT + at as f64 * (LEFT + WIDTH + BETWEEN));
    }
    svg += "</svg>\n";
    svg
}

fn one(plot: &Plot, left: f64) -> String {
    let x = |value| left + plot.x.place(value) * WIDTH;
    let y = |value| TOP + (1.0 - plot.y.place(value)) * HEIGHT;
    let bottom = TOP + HEIGHT;
    let mut svg = String::new();
    // Writing to a `String` does not fail.
    let _ = writeln!(svg, "<text x=\"{left}\" y=\"24\" font-size=\"14\">{}</text>", plot.title);
    for &mark in plot.x.marks {
        let at = x(mark);
        let _ = writeln!(svg, "<path d=\"M{at:.1} {TOP}V{bottom}\" stroke=\"#dddddd\"/>");
        let _ =
            writeln!(svg, "<text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{mark}</text>", bottom + 16.0);
    }
    for &mark in plot.y.marks {
        let (at, right) = (y(mark), left + WIDTH);
        let _ = writeln!(svg, "<path d=\"M{left} {at:.1}H{right}\" stroke=\"#dddddd\"/>");
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{mark}</text>",
            left - 6.0,
            at + 4.0
        );
    }
    let _ = writeln!(
        svg,
        "<path d=\"M{left} {TOP}V{bottom}H{}\" fill=\"none\" stroke=\"#333333\"/>",
        left + WIDTH
    );
    let middle = left + WIDTH / 2.0;
    let _ = writeln!(
        svg,
        "<text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
        bottom + 36.0,
        plot.x.title
    );
    let (side, centre) = (left - 44.0, TOP + HEIGHT / 2.0);
    let _ = writeln!(
        svg,
        "<text x=\"{side}\" y=\"{centre}\" text-anchor=\"middle\" transform=\"rotate(-90 {side} {centre})\">{}</text>",
        plot.y.title
    );
    for (row, curve) in plot.curves.iter().enumerate() {
        let points: Vec<String> =
            curve.points.iter().map(|(px, py)| format!("{:.1},{:.1}", x(*px), y(*py))).collect();
        let style = format!(
            "fill=\"none\" stroke=\"{}\" stroke-width=\"2\"{}",
            curve.colour,
            if curve.dashed { " stroke-dasharray=\"6 4\"" } else { "" }
        );
        let _ = writeln!(svg, "<polyline points=\"{}\" {style}/>", points.join(" "));
        let at = bottom + BELOW + 18.0 * row as f64;
        let _ = writeln!(svg, "<path d=\"M{left} {at}h32\" {style}/>");
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{}\">{}</text>", left + 40.0, at + 4.0, curve.name);
    }
    svg
}

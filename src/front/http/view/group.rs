//! What is said of a group of axes.

use serde::{Serialize, Serializer};

use super::super::problem::Problem;
use super::Text;
use crate::axis::Axes;
use crate::axis::group::{Run, Set};
use crate::desk::Holder;

/// A group on its way, or the last one.
#[derive(Serialize)]
pub(in crate::front::http) struct Group<'a> {
    axes: Names<'a>,
    stage: &'static str,
    /// Those that have not ended the stage.
    awaits: Names<'a>,
    by: Text<Holder>,
    failed: Option<Failed<'a>>,
}

#[derive(Serialize)]
struct Failed<'a> {
    axis: &'a str,
    error: Problem,
}

/// The names of axes.
struct Names<'a>(&'a Axes, Set);

impl Serialize for Names<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.1.iter().map(|id| name(self.0, id)))
    }
}

impl<'a> Group<'a> {
    pub(in crate::front::http) fn new(axes: &'a Axes, run: &Run) -> Self {
        let awaited =
            if run.goes_on() { axes.awaited(run).fold(Set::default(), Set::with) } else { Set::default() };
        Self {
            axes: Names(axes, run.axes),
            stage: run.stage.name(),
            awaits: Names(axes, awaited),
            by: Text(run.by.holder),
            failed: run.failed.map(|(id, error)| Failed { axis: name(axes, id), error: error.into() }),
        }
    }
}

fn name(axes: &Axes, id: u8) -> &str {
    axes.get(id).map_or("?", |axis| &axis.name)
}

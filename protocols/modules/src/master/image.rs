//! The process image: what is wanted of each axis, and what is known of it.

use heapless::Vec;
use puente_drives::pid::{Gains, State};
use puente_framed::frame::EmitError;
use puente_framed::{Class, Frame, Kind, section};

use super::{Axis, Output};
use crate::setting::{self, MAX_DATA, MAX_SET_POINT};
use crate::{Control, Order, Report};

/// What is wanted of an axis, and what is known of it.
#[derive(Clone, Debug)]
pub(super) struct Image {
    pub axis: Axis,
    output: Output,
    /// The gains as they are sent; writing numbers takes its time.
    gains: Vec<u8, MAX_DATA>,
    /// It has been under current since it was to be.
    engaged: bool,
    /// It is asked in this cycle, and has not answered.
    pub ask: bool,
    /// What the cycle's frame says.
    sent: Told,
    /// What the frame said that asked it last, until it answers.
    asked: Option<Told>,
    /// Of what is wanted: it changes with control and gains.
    revision: u32,
}

/// What a frame says to an axis.
#[derive(Clone, Copy, Debug)]
struct Told {
    control: Control,
    revision: u32,
}

/// What an answer means.
#[derive(Clone, Copy, Debug)]
pub(super) struct Meaning {
    /// It answers a frame that said what is wanted now.
    pub current: bool,
    /// What is wanted from now on, where that has to change.
    pub fell: Option<Control>,
}

impl Image {
    pub fn new(axis: Axis) -> Self {
        let output = Output::default();
        let gains = written(axis, output.gains);
        let sent = Told { control: output.control, revision: 0 };
        Self { axis, output, gains, engaged: false, ask: false, sent, asked: None, revision: 0 }
    }

    pub const fn output(&self) -> Output {
        self.output
    }

    pub fn set(&mut self, output: Output) {
        if (self.output.control, self.output.gains) != (output.control, output.gains) {
            self.revision = self.revision.wrapping_add(1);
        }
        if self.output.gains != output.gains {
            self.gains = written(self.axis, output.gains);
        }
        self.output = Output { set_point: output.set_point.clamp(-MAX_SET_POINT, MAX_SET_POINT), ..output };
        self.engaged &= self.wants_current();
    }

    fn wants_current(&self) -> bool {
        matches!(self.output.control, Control::Hold | Control::Follow)
    }

    /// DAT of its section.
    pub fn data(&self, ask: bool) -> Vec<u8, MAX_DATA> {
        let order = Order { control: self.output.control, ask };
        let (mut data, set_point) = match self.wants_current() {
            true => (self.gains.clone(), self.output.set_point),
            // Nobody looks at them.
            false => (written(self.axis, Gains::default()), 0),
        };
        setting::push_rest(&mut data, self.axis.form, set_point, order);
        data
    }

    /// The cycle's frame says what is wanted now.
    pub fn written(&mut self) {
        self.sent = Told { control: self.output.control, revision: self.revision };
    }

    /// The cycle's frame, which asks it, is off the line.
    pub fn told(&mut self) {
        self.asked = Some(self.sent);
    }

    /// Whether it is yet to answer.
    pub fn owes(&self) -> bool {
        self.asked.is_some()
    }

    /// It has answered.
    pub fn reported(&mut self, report: Report) -> Meaning {
        let told = self.asked.take();
        let current = told.is_some_and(|told| told.revision == self.revision);
        let fell = told.and_then(|told| self.fell(told.control, report));
        Meaning { current, fell }
    }

    fn fell(&mut self, told: Control, report: Report) -> Option<Control> {
        if !self.wants_current() || !matches!(told, Control::Hold | Control::Follow) {
            return None;
        }
        let to = match report.state {
            State::Disabled | State::Fault(_) if self.engaged => Control::Observe,
            State::Held if (told, self.output.control) == (Control::Follow, Control::Follow) => Control::Hold,
            state => {
                self.engaged |= is_under_current(state);
                return None;
            }
        };
        self.set(Output { control: to, ..self.output });
        Some(to)
    }
}

/// The report that a frame is, of an axis that was asked.
pub(super) fn report_of(frame: &Frame<'_>, address: u8, axes: &[Image]) -> Option<(usize, Report)> {
    if frame.kind != Kind::Single(Class::Status) || frame.destination() != address {
        return None;
    }
    let asked = |image: &Image| image.axis.address == frame.origin && image.owes();
    let axis = axes.iter().position(asked)?;
    Some((axis, Report::parse(frame.section_for(address)?.data)?))
}

/// The sections of a cycle's frame.
pub(super) fn write<const N: usize>(axes: &[Image], body: &mut Vec<u8, N>) -> Result<(), EmitError> {
    for image in axes {
        section::push(body, image.axis.address, &image.data(image.ask))?;
    }
    Ok(())
}

/// Whether an axis is under current.
const fn is_under_current(state: State) -> bool {
    matches!(state, State::Starting | State::Enabled | State::Held)
}

/// Gains as they are sent; zeros where they cannot be.
fn written(axis: Axis, gains: Gains) -> Vec<u8, MAX_DATA> {
    let mut data = Vec::new();
    if setting::push_gains(&mut data, axis.form, gains).is_err() {
        data.clear();
        let _ = setting::push_gains(&mut data, axis.form, Gains::default());
    }
    data
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Form;

    fn wanted(control: Control, set_point: i32) -> Output {
        Output { control, set_point, ..Output::default() }
    }

    fn report() -> Report {
        let (position, following_error, velocity, command) = (0, 0, 0.0, 0.0);
        Report { state: State::Held, refused: None, position, following_error, velocity, command }
    }

    #[test]
    fn an_answer_is_current_if_its_frame_said_what_is_wanted_now() {
        let mut image = Image::new(Axis { address: 17, form: Form::Text });
        let answer = |image: &mut Image| image.reported(report()).current;
        image.set(wanted(Control::Hold, 0));
        image.written();
        image.told();
        assert!(answer(&mut image));
        assert!(!answer(&mut image), "nobody has asked");
        image.told();
        // There and back: the frame that has just gone may have been the last before it.
        image.set(wanted(Control::Off, 0));
        image.set(wanted(Control::Hold, 0));
        assert!(!answer(&mut image));
        image.told();
        assert!(!answer(&mut image), "the frame was made before");
        image.written();
        image.told();
        image.set(wanted(Control::Hold, 5));
        assert!(answer(&mut image), "a set-point does not count");
    }
}

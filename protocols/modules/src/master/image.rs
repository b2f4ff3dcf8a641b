//! One axis of the process image.

use heapless::Vec;
use puente_drives::pid::{Gains, State};

use super::{Axis, Output, is_under_current};
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
    pub sent: Control,
    /// What the frame said that asked it last, until it answers.
    pub asked: Option<Control>,
}

impl Image {
    pub fn new(axis: Axis) -> Self {
        let output = Output::default();
        let gains = written(axis, output.gains);
        Self { axis, output, gains, engaged: false, ask: false, sent: output.control, asked: None }
    }

    pub const fn output(&self) -> Output {
        self.output
    }

    pub fn set(&mut self, output: Output) {
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

    /// It has answered. Gives what is wanted now, where that has to change.
    pub fn reported(&mut self, report: Report) -> Option<Control> {
        let told = self.asked.take()?;
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
        self.output.control = to;
        self.engaged &= self.wants_current();
        Some(to)
    }
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

//! The user LED.

use embassy_stm32::gpio::{Level, Output};

/// LD2, green.
pub struct Lamp(pub(super) Output<'static>);

impl Lamp {
    /// Switches it on or off.
    pub fn show(&mut self, on: bool) {
        self.0.set_level(Level::from(on));
    }
}

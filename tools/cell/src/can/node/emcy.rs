//! What is wrong with a node, and how it says so (7.2.7).

use std::collections::VecDeque;
use std::time::Duration;

use puente_canopen::emcy::Emergency;
use puente_canopen::{Address, Frame, Id};
use puente_line::Instant;

use super::Objects;

const REGISTER: Address = Address::new(0x1001, 0);
const HISTORY: u16 = 0x1003;
const COB_ID: Address = Address::new(0x1014, 0);
const INHIBIT: Address = Address::new(0x1015, 0);

/// The bits of the error register.
pub mod register {
    /// Set with every error.
    pub const GENERIC: u8 = 0x01;
    /// Current.
    pub const CURRENT: u8 = 0x02;
    /// Voltage.
    pub const VOLTAGE: u8 = 0x04;
    /// Temperature.
    pub const TEMPERATURE: u8 = 0x08;
    /// Communication.
    pub const COMMUNICATION: u8 = 0x10;
    /// Device profile.
    pub const PROFILE: u8 = 0x20;
}

/// The errors of a node.
#[derive(Debug, Default)]
pub struct Errors {
    /// Errors that are not over: code and bit of the register.
    active: Vec<(u16, u8)>,
    queue: VecDeque<Emergency>,
    not_before: Instant,
}

impl Errors {
    /// Power-on: nothing is wrong.
    pub fn clear_all(&mut self) {
        *self = Self::default();
    }

    /// Whether an error is not over.
    pub fn is_active(&self, code: u16) -> bool {
        self.active.iter().any(|(active, _)| *active == code)
    }

    /// Something is wrong from now on; said once until it is over.
    pub fn raise(&mut self, objects: &mut Objects, code: u16, bit: u8, vendor: [u8; 5]) {
        if self.is_active(code) {
            return;
        }
        self.active.push((code, bit));
        self.tell(objects, code, vendor);
    }

    /// An error that is over at once, but is told.
    pub fn event(&mut self, objects: &mut Objects, code: u16, vendor: [u8; 5]) {
        self.tell(objects, code, vendor);
    }

    /// An error is over.
    pub fn clear(&mut self, objects: &mut Objects, code: u16) {
        if self.is_active(code) {
            self.active.retain(|(active, _)| *active != code);
            self.tell(objects, Emergency::RESET, [0; 5]);
        }
    }

    fn tell(&mut self, objects: &mut Objects, code: u16, vendor: [u8; 5]) {
        let bits = self.active.iter().fold(0, |bits, (_, bit)| bits | bit | register::GENERIC);
        objects.set(REGISTER, bits.into());
        self.queue.push_back(Emergency { code, register: bits, vendor });
        if code != Emergency::RESET {
            remember(objects, u32::from(code) | u32::from(vendor[0]) << 16 | u32::from(vendor[1]) << 24);
        }
    }

    /// The emergency message that may go out now.
    pub fn poll(&mut self, now: Instant, objects: &Objects) -> Option<Frame> {
        if now < self.not_before {
            return None;
        }
        let emergency = self.queue.pop_front()?;
        let cob_id = objects.get(COB_ID) as u32;
        self.not_before = now + Duration::from_micros(100 * objects.get(INHIBIT) as u64);
        (cob_id >> 31 == 0).then(|| Frame::full(Id::base(cob_id as u16), emergency.to_bytes()))
    }

    /// When one may go out.
    pub fn poll_at(&self) -> Option<Instant> {
        (!self.queue.is_empty()).then_some(self.not_before)
    }
}

/// Puts an error at the top of the history.
fn remember(objects: &mut Objects, error: u32) {
    let room = (1..).take_while(|sub| objects.read(Address::new(HISTORY, *sub)).is_ok()).count() as u8;
    for sub in (1..room).rev() {
        objects.set(Address::new(HISTORY, sub + 1), objects.get(Address::new(HISTORY, sub)));
    }
    objects.set(Address::new(HISTORY, 1), error.into());
    let count = Address::new(HISTORY, 0);
    objects.set(count, (objects.get(count) + 1).min(room.into()));
}

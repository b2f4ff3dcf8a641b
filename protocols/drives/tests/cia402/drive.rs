//! A drive by the tables of CiA 402, bit by bit: it shares nothing with the code that is tested.

/// Transitions by their numbers: state before, bits of the controlword that count, their values, state after. Bit 7 is the
/// edge of the fault reset.
const TRANSITIONS: [(u8, &str, u16, u16, &str); 16] = [
    (2, "switch on disabled", 0b0000_0111, 0b0110, "ready"),
    (3, "ready", 0b0000_1111, 0b0111, "switched on"),
    (4, "switched on", 0b0000_1111, 0b1111, "enabled"),
    (5, "enabled", 0b0000_1111, 0b0111, "switched on"),
    (6, "switched on", 0b0000_0111, 0b0110, "ready"),
    (7, "ready", 0b0000_0010, 0b0000, "switch on disabled"),
    (7, "ready", 0b0000_0110, 0b0010, "switch on disabled"),
    (8, "enabled", 0b0000_0111, 0b0110, "ready"),
    (9, "enabled", 0b0000_0010, 0b0000, "switch on disabled"),
    (10, "switched on", 0b0000_0010, 0b0000, "switch on disabled"),
    (10, "switched on", 0b0000_0110, 0b0010, "switch on disabled"),
    (11, "enabled", 0b0000_0110, 0b0010, "quick stop"),
    (12, "quick stop", 0b0000_0010, 0b0000, "switch on disabled"),
    (15, "fault", 0b1000_0000, 0b1000_0000, "switch on disabled"),
    (16, "quick stop", 0b0000_1111, 0b1111, "enabled"),
    // Not a transition: a place in the table keeps the drive where it is.
    (0, "", 0, 1, ""),
];

pub struct Drive {
    pub state: &'static str,
    pub control: u16,
    /// Bits of the statusword that the state does not tell.
    pub flags: u16,
    pub numbers: Vec<u8>,
    /// The cause of the fault is still there.
    pub broken: bool,
}

impl Drive {
    pub fn new(state: &'static str) -> Self {
        Self { state, control: 0, flags: 0x0200, numbers: Vec::new(), broken: false }
    }

    pub fn status(&self) -> u16 {
        let code = match self.state {
            "not ready" => 0x00,
            "switch on disabled" => 0x40,
            "ready" => 0x21,
            "switched on" => 0x23,
            "enabled" => 0x27,
            "quick stop" => 0x07,
            "fault reaction" => 0x0F,
            "fault" => 0x08,
            other => panic!("{other}"),
        };
        code | self.flags
    }

    pub fn write(&mut self, control: u16) {
        let edge = control & !self.control & 0x80;
        let seen = control & 0x7F | edge;
        self.control = control;
        if edge != 0 && self.state != "fault" {
            return;
        }
        let found =
            TRANSITIONS.iter().find(|(_, from, mask, value, _)| *from == self.state && seen & mask == *value);
        if let Some((number, _, _, _, to)) = found {
            if *number == 15 && self.broken {
                return;
            }
            self.numbers.push(*number);
            self.state = to;
        }
    }
}

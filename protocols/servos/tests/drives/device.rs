//! A CANopen drive, small and by the book: expedited SDO, PDOs as its dictionary says, the state machine of CiA 402 by its
//! tables, and motion that is no more than counting. It shares nothing with the code that is tested but frames.

use std::collections::BTreeMap;
use std::time::Duration;

use puente_canopen::{Frame, Id};
use puente_line::Instant;

#[path = "../../../drives/tests/cia402/drive.rs"]
#[allow(dead_code)]
mod table;

pub struct Device {
    pub id: u8,
    pub objects: BTreeMap<(u16, u8), Vec<u8>>,
    pub power: table::Drive,
    /// 0 off, 4 stopped, 5 operational, 127 pre-operational.
    pub nmt: u8,
    /// What it has to say.
    pub out: Vec<Frame>,
    /// What was written over SDO, in order.
    pub written: Vec<(u16, u8, i64)>,
    /// The controlwords that it was told.
    pub words: Vec<u16>,
    /// It was told to go under current without a preset.
    pub jumps: bool,
    /// A set-point was written since it was told to be without current.
    preset: bool,
    /// It says nothing, and hears nothing.
    pub dead: bool,
    /// It does not say when it stands in a quick stop.
    pub secretive: bool,
    /// It does not change its mode.
    pub stubborn: bool,
    /// How fast it goes now, units a tick.
    pub speed: i32,
    /// Where profile position is going.
    goal: i32,
    homing: u32,
    /// RPDOs that wait for SYNC.
    waiting: BTreeMap<u16, Vec<u8>>,
    /// The data of each TPDO when it was sent last, and when that was.
    sent: BTreeMap<u16, (Vec<u8>, Instant)>,
    beat: Instant,
    ack: bool,
    reached: bool,
    active: bool,
}

const RECEIVE: [&[u32]; 4] =
    [&[0x6040_0010], &[0x6040_0010, 0x6060_0008], &[0x6040_0010, 0x607A_0020], &[0x6040_0010, 0x60FF_0020]];
const TRANSMIT: [&[u32]; 4] =
    [&[0x6041_0010], &[0x6041_0010, 0x6061_0008], &[0x6041_0010, 0x6064_0020], &[0x6041_0010, 0x606C_0020]];

impl Device {
    pub fn new(id: u8) -> Self {
        let mut device = Self {
            id,
            objects: BTreeMap::new(),
            power: table::Drive::new("switch on disabled"),
            nmt: 0,
            out: Vec::new(),
            written: Vec::new(),
            words: Vec::new(),
            jumps: false,
            preset: false,
            dead: false,
            secretive: false,
            stubborn: false,
            speed: 0,
            goal: 0,
            homing: 0,
            waiting: BTreeMap::new(),
            sent: BTreeMap::new(),
            beat: Instant::ZERO,
            ack: false,
            reached: false,
            active: false,
        };
        device.boot();
        device
    }

    /// Power on, or a reset.
    pub fn boot(&mut self) {
        let position = self.get(0x6064, 0);
        self.objects.clear();
        for (index, sub, size, value) in [
            (0x1000, 0, 4, 0x0002_0192),
            (0x1017, 0, 2, 0),
            (0x1018, 1, 4, 0x80),
            (0x603F, 0, 2, 0),
            (0x6040, 0, 2, 0),
            (0x6041, 0, 2, 0),
            (0x6060, 0, 1, 0),
            (0x6061, 0, 1, 0),
            (0x6064, 0, 4, position),
            (0x606C, 0, 4, 0),
            (0x6071, 0, 2, 0),
            (0x607A, 0, 4, -7),
            (0x6081, 0, 4, 50),
            (0x6098, 0, 1, 17),
            (0x6099, 1, 4, 0),
            (0x6099, 2, 4, 0),
            (0x60C0, 0, 2, 0),
            (0x60C1, 1, 4, -9),
            (0x60C1, 2, 1, 1),
            (0x60C2, 1, 1, 1),
            (0x60C2, 2, 1, -3),
            (0x60FF, 0, 4, 0),
            (0x6502, 0, 4, 0x3ED),
        ] {
            self.objects.insert((index, sub), le(value, size));
        }
        let all = [(0x1400, 0x100, RECEIVE), (0x1800, 0x080, TRANSMIT)];
        for (number, (first, base, set)) in (0..4_u16).flat_map(|number| all.map(|each| (number, each))) {
            let cob = 0x8000_0000 | u32::from(base + 0x100 * (number + 1) + u16::from(self.id));
            self.objects.insert((first + number, 1), le(cob.into(), 4));
            self.objects.insert((first + number, 2), vec![255]);
            self.objects.insert((first + number, 3), vec![0, 0]);
            self.objects.insert((first + number, 5), vec![0, 0]);
            let mapped = set[usize::from(number)];
            self.objects.insert((first + 0x200 + number, 0), vec![mapped.len() as u8]);
            for (sub, entry) in (1..).zip(mapped) {
                self.objects.insert((first + 0x200 + number, sub), le((*entry).into(), 4));
            }
        }
        self.power = table::Drive::new("switch on disabled");
        self.nmt = 127;
        self.speed = 0;
        self.homing = 0;
        self.waiting.clear();
        self.sent.clear();
        (self.ack, self.reached, self.active) = (false, false, false);
        self.out.push(Frame::new(Id::base(0x700 + u16::from(self.id)), &[0]).expect("a frame"));
    }

    pub fn get(&self, index: u16, sub: u8) -> i64 {
        let Some(bytes) = self.objects.get(&(index, sub)) else { return 0 };
        let mut whole = if bytes.last().is_some_and(|last| last & 0x80 != 0) { [0xFF; 8] } else { [0; 8] };
        whole[..bytes.len()].copy_from_slice(bytes);
        i64::from_le_bytes(whole)
    }

    pub fn put(&mut self, index: u16, sub: u8, value: i64) {
        let Some(bytes) = self.objects.get_mut(&(index, sub)) else { return };
        let size = bytes.len();
        *bytes = le(value, size);
    }

    pub fn position(&self) -> i32 {
        self.get(0x6064, 0) as i32
    }

    pub fn is_enabled(&self) -> bool {
        self.power.state == "enabled"
    }

    /// A fault, with its emergency.
    pub fn fail(&mut self, code: u16) {
        self.power.state = "fault";
        self.put(0x603F, 0, code.into());
        self.emergency(code);
    }

    pub fn emergency(&mut self, code: u16) {
        let [low, high] = code.to_le_bytes();
        let data = [low, high, u8::from(code != 0), 0, 0, 0, 0, 0];
        self.out.push(Frame::new(Id::base(0x80 + u16::from(self.id)), &data).expect("a frame"));
    }

    pub fn hear(&mut self, frame: &Frame) {
        let Id::Base(id) = frame.id() else { return };
        let data = frame.data();
        if self.dead {
            return;
        }
        match id {
            0 if data[1] == self.id || data[1] == 0 => self.network(data[0]),
            0x080 if self.nmt == 5 => self.sync(),
            _ if id == 0x600 + u16::from(self.id) => self.sdo(data),
            _ if self.nmt == 5 => {
                for number in 0..4 {
                    if self.get(0x1400 + number, 1) as u32 & 0x8000_07FF == u32::from(id) {
                        if self.get(0x1400 + number, 2) == 1 {
                            self.waiting.insert(number, data.to_vec());
                        } else {
                            self.take(number, data);
                        }
                    }
                }
            }
            _ => {}
        }
    }

    fn network(&mut self, command: u8) {
        match command {
            1 => self.nmt = 5,
            2 => self.nmt = 4,
            0x80 => self.nmt = 127,
            _ => self.boot(),
        }
    }

    fn sync(&mut self) {
        for (number, data) in std::mem::take(&mut self.waiting) {
            self.take(number, &data);
        }
        for number in 0..4 {
            if self.get(0x1800 + number, 2) == 1 {
                self.transmit(number);
            }
        }
    }

    fn take(&mut self, number: u16, data: &[u8]) {
        let mut at = 0;
        for sub in 1..=self.get(0x1600 + number, 0) as u8 {
            let entry = self.get(0x1600 + number, sub) as u32;
            let size = (entry & 0xFF) as usize / 8;
            self.write((entry >> 16) as u16, (entry >> 8) as u8, &data[at..at + size]);
            at += size;
        }
    }

    fn transmit(&mut self, number: u16) {
        let cob = self.get(0x1800 + number, 1) as u32;
        if cob & 0x8000_0000 == 0 && self.nmt == 5 {
            let data = self.data(number);
            self.out.push(Frame::new(Id::base(cob as u16), &data).expect("a frame"));
        }
    }

    fn data(&self, number: u16) -> Vec<u8> {
        let entries = 1..=self.get(0x1A00 + number, 0) as u8;
        let entries = entries.map(|sub| self.get(0x1A00 + number, sub) as u32);
        let places = entries.map(|entry| ((entry >> 16) as u16, (entry >> 8) as u8));
        places.flat_map(|place| self.objects.get(&place).cloned().unwrap_or_default()).collect()
    }

    fn sdo(&mut self, data: &[u8]) {
        let (index, sub) = (u16::from_le_bytes([data[1], data[2]]), data[3]);
        let mut answer = [0, data[1], data[2], sub, 0, 0, 0, 0];
        let known = self.objects.get(&(index, sub)).cloned();
        match (data[0], known) {
            (0x80, _) => return,
            (_, None) => {
                answer[0] = 0x80;
                answer[4..].copy_from_slice(&0x0602_0000_u32.to_le_bytes());
            }
            (0x40, Some(bytes)) => {
                answer[0] = 0x43 | ((4 - bytes.len() as u8) << 2);
                answer[4..4 + bytes.len()].copy_from_slice(&bytes);
            }
            (_, Some(bytes)) => {
                assert_eq!(data[0], 0x23 | ((4 - bytes.len() as u8) << 2), "{index:04X}:{sub}");
                let size = bytes.len();
                self.write(index, sub, &data[4..4 + size]);
                self.written.push((index, sub, self.get(index, sub)));
                self.preset |= matches!(index, 0x6071 | 0x607A | 0x60C1 | 0x60FF);
                answer[0] = 0x60;
            }
        }
        self.out.push(Frame::full(Id::base(0x580 + u16::from(self.id)), answer));
    }

    fn write(&mut self, index: u16, sub: u8, data: &[u8]) {
        self.objects.insert((index, sub), data.to_vec());
        match index {
            0x6040 => self.control(),
            0x6060 if !self.stubborn => {
                self.objects.insert((0x6061, 0), data.to_vec());
                (self.ack, self.reached, self.active, self.homing) = (false, false, false, 0);
            }
            _ => {}
        }
    }

    fn control(&mut self) {
        let word = self.get(0x6040, 0) as u16;
        let rises = word & !self.power.control & 0x10 != 0;
        if word & 8 == 0 {
            self.preset &= self.words.last() == Some(&word);
        } else if matches!(self.get(0x6061, 0), 1 | 3 | 4 | 7 | 8) {
            self.jumps |= !self.preset;
        }
        self.words.push(word);
        self.power.write(word);
        if !self.is_enabled() {
            return;
        }
        match self.get(0x6061, 0) {
            1 if rises && !self.ack => {
                let target = self.get(0x607A, 0) as i32;
                self.goal = if word & 0x40 != 0 { self.goal + target } else { target };
                (self.ack, self.reached, self.active) = (true, false, true);
            }
            1 if word & 0x10 == 0 => self.ack = false,
            6 if rises => (self.homing, self.reached, self.ack) = (1, false, false),
            _ => {}
        }
    }

    fn to(&mut self, goal: i32) -> bool {
        let here = self.position();
        let step = (goal - here).clamp(-50, 50);
        self.put(0x6064, 0, (here + step).into());
        self.speed = step;
        step == 0
    }

    /// A tick of 1 ms.
    fn go(&mut self) {
        let word = self.get(0x6040, 0) as u16;
        let halted = word & 0x100 != 0;
        let before = self.speed;
        if self.power.state == "quick stop" || self.is_enabled() && halted {
            // It takes its time.
            self.speed = before / 2;
            self.put(0x6064, 0, i64::from(self.position() + self.speed));
            self.reached = self.speed == 0;
            self.ack &= self.get(0x6061, 0) != 7 || word & 0x10 != 0;
            return;
        }
        if !self.is_enabled() {
            self.speed = 0;
            return;
        }
        match self.get(0x6061, 0) {
            1 if self.active => {
                self.reached = self.to(self.goal);
                self.active = !self.reached;
            }
            3 => {
                self.speed = self.get(0x60FF, 0) as i32;
                self.put(0x6064, 0, i64::from(self.position() + self.speed));
                self.reached = true;
            }
            4 => self.speed = self.get(0x6071, 0) as i32 / 10,
            6 if self.homing > 0 && word & 0x10 != 0 => {
                self.homing += 1;
                if self.homing > 20 {
                    self.put(0x6064, 0, 0);
                    (self.ack, self.reached, self.homing) = (true, true, 0);
                }
            }
            7 => {
                self.ack = word & 0x10 != 0;
                if self.ack {
                    self.to(self.get(0x60C1, 1) as i32);
                }
            }
            8 => {
                self.ack = true;
                self.to(self.get(0x607A, 0) as i32);
            }
            _ => self.speed = 0,
        }
    }

    pub fn tick(&mut self, now: Instant) {
        self.go();
        let mode = self.get(0x6061, 0);
        let twelve = if mode == 3 { self.speed == 0 } else { self.ack };
        self.power.flags = 0x0200
            | if self.reached && !(self.secretive && self.power.state == "quick stop") { 0x0400 } else { 0 }
            | if twelve && matches!(mode, 1 | 3 | 6 | 7 | 8) { 0x1000 } else { 0 };
        let status = self.power.status();
        self.put(0x6041, 0, status.into());
        self.put(0x606C, 0, self.speed.into());
        let beat = Duration::from_millis(self.get(0x1017, 0) as u64);
        if !beat.is_zero() && now.since(self.beat) >= beat {
            self.beat = now;
            self.out.push(Frame::new(Id::base(0x700 + u16::from(self.id)), &[self.nmt]).expect("a frame"));
        }
        for number in 0..4 {
            if self.nmt != 5 || self.get(0x1800 + number, 2) == 1 {
                continue;
            }
            let data = self.data(number);
            let inhibit = Duration::from_micros(100 * self.get(0x1800 + number, 3) as u64);
            let event = Duration::from_millis(self.get(0x1800 + number, 5) as u64);
            let due = match self.sent.get(&number) {
                None => true,
                Some((last, at)) => {
                    *last != data && now.since(*at) >= inhibit || !event.is_zero() && now.since(*at) >= event
                }
            };
            if due {
                self.sent.insert(number, (data, now));
                self.transmit(number);
            }
        }
        if self.dead {
            self.out.clear();
        }
    }
}

fn le(value: i64, size: usize) -> Vec<u8> {
    value.to_le_bytes()[..size].to_vec()
}

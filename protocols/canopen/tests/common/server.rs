//! An SDO server by the text of CiA 301, 7.2.4, on raw bytes: it shares nothing with the client's code.

use std::collections::BTreeMap;

pub type Message = [u8; 8];

/// How this server likes it.
#[derive(Clone, Copy, Debug)]
pub struct Habits {
    /// Segments of a block that it takes.
    pub block: u8,
    pub crc: bool,
    /// It says how long its objects are.
    pub says_size: bool,
    /// Objects of up to four bytes are read at once.
    pub expedites: bool,
    /// It acknowledges at once when a segment is missing, as CANopenNode does, not at the end of the block; before the first
    /// segment it passes over all others.
    pub hasty: bool,
}

impl Default for Habits {
    fn default() -> Self {
        Self { block: 127, crc: true, says_size: true, expedites: true, hasty: false }
    }
}

#[derive(Clone, Debug, PartialEq)]
enum State {
    Idle,
    Download {
        toggle: u8,
        size: Option<usize>,
    },
    Upload {
        toggle: u8,
        at: usize,
    },
    /// Takes the segments of a block: so many have come in order.
    BlockDownload {
        came: u8,
        size: Option<usize>,
        crc: bool,
        block: u8,
    },
    /// All segments have come.
    BlockDownloadEnd {
        size: Option<usize>,
        crc: bool,
    },
    /// Waits to be started.
    BlockUploadStart {
        crc: bool,
        block: u8,
    },
    /// A block is out that begins at `at`; waits for its acknowledgement.
    BlockUpload {
        at: usize,
        sent: u8,
        crc: bool,
    },
    BlockUploadEnd,
}

pub struct Server {
    pub objects: BTreeMap<(u16, u8), Vec<u8>>,
    pub habits: Habits,
    state: State,
    mux: [u8; 3],
    gathered: Vec<u8>,
    /// Transfers that the client aborted, and why.
    pub aborts: Vec<u32>,
    /// Finished writes.
    pub written: Vec<((u16, u8), Vec<u8>)>,
}

/// Bit by bit: x^16 + x^12 + x^5 + 1, begins with 0.
fn crc(data: &[u8]) -> u16 {
    let mut crc = 0_u16;
    for byte in data {
        crc ^= u16::from(*byte) << 8;
        for _ in 0..8 {
            crc = if crc & 0x8000 != 0 { crc << 1 ^ 0x1021 } else { crc << 1 };
        }
    }
    crc
}

impl Server {
    pub fn new(habits: Habits) -> Self {
        Self {
            objects: BTreeMap::new(),
            habits,
            state: State::Idle,
            mux: [0; 3],
            gathered: Vec::new(),
            aborts: Vec::new(),
            written: Vec::new(),
        }
    }

    /// What comes next is a segment; what has just been said is one.
    pub fn in_block(&self) -> (bool, bool) {
        (matches!(self.state, State::BlockDownload { .. }), matches!(self.state, State::BlockUpload { .. }))
    }

    fn key(&self) -> (u16, u8) {
        (u16::from_le_bytes([self.mux[0], self.mux[1]]), self.mux[2])
    }

    fn abort(&mut self, code: u32) -> Vec<Message> {
        self.state = State::Idle;
        let code = code.to_le_bytes();
        vec![[0x80, self.mux[0], self.mux[1], self.mux[2], code[0], code[1], code[2], code[3]]]
    }

    fn addressed(&self, first: u8, rest: [u8; 4]) -> Vec<Message> {
        let [a, b, c] = self.mux;
        vec![[first, a, b, c, rest[0], rest[1], rest[2], rest[3]]]
    }

    fn store(&mut self) {
        let data = std::mem::take(&mut self.gathered);
        self.written.push((self.key(), data.clone()));
        self.objects.insert(self.key(), data);
        self.state = State::Idle;
    }

    /// What it answers.
    pub fn take(&mut self, m: Message) -> Vec<Message> {
        // An abort is 80h in every state: no segment has the number 0.
        if m[0] == 0x80 {
            self.aborts.push(u32::from_le_bytes([m[4], m[5], m[6], m[7]]));
            self.state = State::Idle;
            return vec![];
        }
        if let State::BlockDownload { came, size, crc, block } = self.state {
            return self.take_block_segment(m, came, size, crc, block);
        }
        match m[0] >> 5 {
            1 | 2 => self.initiate(m),
            5 if m[0] & 3 == 0 => self.initiate(m),
            6 if m[0] & 1 == 0 => self.initiate(m),
            _ => self.go_on(m),
        }
    }

    fn initiate(&mut self, m: Message) -> Vec<Message> {
        self.mux = [m[1], m[2], m[3]];
        self.gathered.clear();
        let said = u32::from_le_bytes([m[4], m[5], m[6], m[7]]) as usize;
        let Some(object) = self.objects.get(&self.key()).cloned() else {
            return self.abort(0x0602_0000);
        };
        match m[0] >> 5 {
            1 if m[0] & 2 != 0 => {
                let n = if m[0] & 1 != 0 { usize::from(m[0] >> 2 & 3) } else { 0 };
                self.gathered = m[4..8 - n].to_vec();
                self.store();
                self.addressed(0x60, [0; 4])
            }
            1 => {
                self.state = State::Download { toggle: 0, size: (m[0] & 1 != 0).then_some(said) };
                self.addressed(0x60, [0; 4])
            }
            2 if self.habits.expedites && (1..=4).contains(&object.len()) => {
                let mut data = [0; 4];
                data[..object.len()].copy_from_slice(&object);
                self.state = State::Idle;
                self.addressed(0x43 | ((4 - object.len()) as u8) << 2, data)
            }
            2 => {
                self.state = State::Upload { toggle: 0, at: 0 };
                match self.habits.says_size {
                    true => self.addressed(0x41, (object.len() as u32).to_le_bytes()),
                    false => self.addressed(0x40, [0; 4]),
                }
            }
            5 => {
                let block = m[4];
                if !(1..=127).contains(&block) {
                    return self.abort(0x0504_0002);
                }
                let crc = self.habits.crc && m[0] & 4 != 0;
                self.state = State::BlockUploadStart { crc, block };
                let sc = u8::from(self.habits.crc) << 2;
                match self.habits.says_size {
                    true => self.addressed(0xC2 | sc, (object.len() as u32).to_le_bytes()),
                    false => self.addressed(0xC0 | sc, [0; 4]),
                }
            }
            _ => {
                let crc = self.habits.crc && m[0] & 4 != 0;
                let size = (m[0] & 2 != 0).then_some(said);
                self.state = State::BlockDownload { came: 0, size, crc, block: self.habits.block };
                let sc = u8::from(self.habits.crc) << 2;
                self.addressed(0xA0 | sc, [self.habits.block, 0, 0, 0])
            }
        }
    }

    fn go_on(&mut self, m: Message) -> Vec<Message> {
        match (self.state.clone(), m[0] >> 5) {
            (State::Download { toggle, size }, 0) => {
                if m[0] >> 4 & 1 != toggle {
                    return self.abort(0x0503_0000);
                }
                let n = usize::from(m[0] >> 1 & 7);
                self.gathered.extend(&m[1..8 - n]);
                if m[0] & 1 != 0 {
                    if size.is_some_and(|size| size != self.gathered.len()) {
                        return self.abort(0x0607_0010);
                    }
                    self.store();
                } else {
                    self.state = State::Download { toggle: 1 - toggle, size };
                }
                vec![[0x20 | toggle << 4, 0, 0, 0, 0, 0, 0, 0]]
            }
            (State::Upload { toggle, at }, 3) => {
                if m[0] >> 4 & 1 != toggle {
                    return self.abort(0x0503_0000);
                }
                let object = &self.objects[&self.key()];
                let part = &object[at..object.len().min(at + 7)];
                let mut answer = [0; 8];
                answer[1..=part.len()].copy_from_slice(part);
                let last = at + 7 >= object.len();
                answer[0] = toggle << 4 | ((7 - part.len()) as u8) << 1 | u8::from(last);
                self.state = match last {
                    true => State::Idle,
                    false => State::Upload { toggle: 1 - toggle, at: at + 7 },
                };
                vec![answer]
            }
            (State::BlockDownloadEnd { size, crc: checks }, 6) if m[0] & 1 != 0 => {
                let n = usize::from(m[0] >> 2 & 7);
                self.gathered.truncate(self.gathered.len() - n);
                if checks && crc(&self.gathered) != u16::from_le_bytes([m[1], m[2]]) {
                    return self.abort(0x0504_0004);
                }
                if size.is_some_and(|size| size != self.gathered.len()) {
                    return self.abort(0x0607_0010);
                }
                self.store();
                vec![[0xA1, 0, 0, 0, 0, 0, 0, 0]]
            }
            (State::BlockUploadStart { crc, block }, 5) if m[0] & 3 == 3 => self.send_block(0, block, crc),
            (State::BlockUpload { at, sent, crc: checks }, 5) if m[0] & 3 == 2 => {
                let (acknowledged, block) = (m[1], m[2]);
                if acknowledged > sent {
                    return self.abort(0x0504_0003);
                }
                if !(1..=127).contains(&block) {
                    return self.abort(0x0504_0002);
                }
                let object = &self.objects[&self.key()];
                let at = at + 7 * usize::from(acknowledged);
                if acknowledged == sent && at >= object.len() {
                    let n = (at - object.len()) as u8;
                    let [low, high] = if checks { crc(object) } else { 0 }.to_le_bytes();
                    self.state = State::BlockUploadEnd;
                    return vec![[0xC1 | n << 2, low, high, 0, 0, 0, 0, 0]];
                }
                self.send_block(at, block, checks)
            }
            (State::BlockUploadEnd, 5) if m[0] & 3 == 1 => {
                self.state = State::Idle;
                vec![]
            }
            _ => self.abort(0x0504_0001),
        }
    }

    fn take_block_segment(
        &mut self,
        m: Message,
        mut came: u8,
        size: Option<usize>,
        crc: bool,
        block: u8,
    ) -> Vec<Message> {
        let (number, last) = (m[0] & 0x7F, m[0] & 0x80 != 0);
        let in_order = number == came + 1;
        if in_order {
            came = number;
            self.gathered.extend(&m[1..]);
        }
        let hasty = self.habits.hasty && !in_order;
        if hasty && (came == 0 || number == came) || !hasty && number < block && !last {
            self.state = State::BlockDownload { came, size, crc, block };
            return vec![];
        }
        // The end of the block: what has come in order is acknowledged.
        let next = self.habits.block;
        self.state = match last && in_order {
            true => State::BlockDownloadEnd { size, crc },
            false => State::BlockDownload { came: 0, size, crc, block: next },
        };
        vec![[0xA2, came, next, 0, 0, 0, 0, 0]]
    }

    fn send_block(&mut self, at: usize, block: u8, crc: bool) -> Vec<Message> {
        let object = &self.objects[&self.key()];
        let mut frames = Vec::new();
        let mut from = at;
        for number in 1..=block {
            let part = &object[from.min(object.len())..object.len().min(from + 7)];
            let last = from + 7 >= object.len();
            let mut frame = [0; 8];
            frame[0] = u8::from(last) << 7 | number;
            frame[1..=part.len()].copy_from_slice(part);
            frames.push(frame);
            from += 7;
            if last {
                break;
            }
        }
        self.state = State::BlockUpload { at, sent: frames.len() as u8, crc };
        frames
    }
}

//! The server.

mod block_download;
mod block_upload;
mod dictionary;
mod plain;

use core::time::Duration;

use puente_line::Instant;

use super::{Abort, Initiate, MAX_BLOCK, Request, Response};
use crate::{Address, Frame, Id, NodeId};
use block_download::BlockDownload;
use block_upload::BlockUpload;
pub use dictionary::Dictionary;
use plain::{Download, Upload};

/// So long a client may be silent in the middle of a transfer.
const PATIENCE: Duration = Duration::from_secs(3);

/// Eight bytes.
type Message = [u8; 8];

/// An SDO server: one transfer at a time, of any length, in any of the three protocols, with one [`Dictionary`], which has to
/// be the same in all calls.
///
/// A request that begins a transfer ends the one before it. Segments of a block that are missing are asked for again at the end
/// of the block. A segment or an end that comes a second time, because the answer to it was lost, is answered a second time.
#[derive(Clone, Debug)]
pub struct Server {
    /// COB-ID of what is heard.
    request: u16,
    /// COB-ID of what is said.
    response: u16,
    /// Segments of a block that is written.
    block: u8,
    address: Address,
    state: State,
    /// To be sent first.
    answer: Option<Message>,
    /// The end of the last block download, while nothing else has come.
    ended: Option<Message>,
    /// The client is overdue then.
    deadline: Instant,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum State {
    Idle,
    Upload(Upload),
    Download(Download),
    BlockUpload(BlockUpload),
    BlockDownload(BlockDownload),
}

/// What a message comes to.
enum Step {
    /// The transfer goes on, with an answer or without.
    Go(Option<Message>),
    /// It has ended well.
    End(Option<Message>),
    /// It has ended.
    Abort(Abort),
}

impl From<Abort> for Step {
    fn from(code: Abort) -> Self {
        Self::Abort(code)
    }
}

impl Server {
    /// The first server of a node.
    pub const fn new(node: NodeId) -> Self {
        Self::with_ids(node.sdo_request(), node.sdo_response())
    }

    /// A server with other COB-IDs: those of what it hears, and of what it says.
    pub const fn with_ids(request: u16, response: u16) -> Self {
        Self {
            request,
            response,
            block: MAX_BLOCK,
            address: Address::new(0, 0),
            state: State::Idle,
            answer: None,
            ended: None,
            deadline: Instant::ZERO,
        }
    }

    /// Segments of the blocks that are written from the next transfer on, brought into 1 to 127.
    pub const fn set_block(&mut self, segments: u8) {
        self.block = match segments {
            0 => 1,
            1..=MAX_BLOCK => segments,
            _ => MAX_BLOCK,
        };
    }

    /// Whether nothing is under way.
    pub fn is_idle(&self) -> bool {
        self.state == State::Idle && self.answer.is_none()
    }

    /// Whether what [`Server::poll`] gives is a segment of a block, of which many may follow.
    pub fn is_streaming(&self) -> bool {
        self.answer.is_none() && matches!(&self.state, State::BlockUpload(upload) if upload.is_sending())
    }

    /// Takes a frame of the bus.
    pub fn receive<D: Dictionary>(&mut self, now: Instant, frame: &Frame, dictionary: &mut D) {
        let Some(message) = frame.data_of(self.request).and_then(|data| Message::try_from(data).ok()) else {
            return;
        };
        self.deadline = now + PATIENCE;
        let ended = self.ended.take();
        let step = match &mut self.state {
            State::BlockDownload(download) if !is_abort(&message) => {
                download.receive(message, self.block, dictionary)
            }
            _ => self.take(message, ended, dictionary),
        };
        self.follow(step, message, dictionary);
    }

    /// The next frame to be sent.
    pub fn poll<D: Dictionary>(&mut self, now: Instant, dictionary: &mut D) -> Option<Frame> {
        if self.answer.is_none() {
            match &mut self.state {
                State::Idle => {}
                State::BlockUpload(upload) if upload.is_sending() => {
                    self.answer = upload.next(dictionary);
                    self.deadline = now + PATIENCE;
                }
                _ if now >= self.deadline => self.follow(Abort::TIMEOUT.into(), [0; 8], dictionary),
                _ => {}
            }
        }
        Some(Frame::full(Id::base(self.response), self.answer.take()?))
    }

    /// When there is something to be sent, or a client is overdue.
    pub fn poll_at(&self) -> Option<Instant> {
        match self.state {
            _ if self.answer.is_some() || self.is_streaming() => Some(Instant::ZERO),
            State::Idle => None,
            _ => Some(self.deadline),
        }
    }

    /// Ends what is under way without a word.
    pub fn reset<D: Dictionary>(&mut self, dictionary: &mut D) {
        self.close(dictionary);
        (self.answer, self.ended) = (None, None);
    }

    fn close<D: Dictionary>(&mut self, dictionary: &mut D) {
        if matches!(self.state, State::Download(_) | State::BlockDownload(_)) {
            dictionary.discard();
        }
        self.state = State::Idle;
    }

    fn follow<D: Dictionary>(&mut self, step: Step, message: Message, dictionary: &mut D) {
        match step {
            Step::Go(answer) => self.answer = answer,
            Step::End(answer) => {
                if matches!(self.state, State::BlockDownload(_)) {
                    self.ended = Some(message);
                }
                self.state = State::Idle;
                self.answer = answer;
            }
            Step::Abort(code) => {
                self.close(dictionary);
                self.answer = Some(Response::Abort { address: self.address, code }.to_bytes());
            }
        }
    }

    /// Takes a message that is no segment of a block.
    fn take<D: Dictionary>(&mut self, message: Message, ended: Option<Message>, dictionary: &mut D) -> Step {
        let Ok(request) = Request::parse(&message) else {
            return Abort::COMMAND.into();
        };
        match (request, &mut self.state) {
            (Request::Abort { .. }, _) => {
                self.close(dictionary);
                Step::End(None)
            }
            (Request::InitiateUpload { address }, _) => self.upload(address, dictionary),
            (Request::InitiateDownload { address, data }, _) => self.download(address, &data, dictionary),
            (Request::InitiateBlockUpload { address, crc, block, threshold }, _) => {
                self.block_upload(address, crc, block, threshold, dictionary)
            }
            (Request::InitiateBlockDownload { address, crc, size }, _) => {
                self.block_download(address, crc, size, dictionary)
            }
            (Request::UploadSegment { toggle }, State::Upload(upload)) => upload.next(toggle, dictionary),
            (Request::DownloadSegment(segment), State::Download(download)) => {
                download.receive(&segment, dictionary)
            }
            (request, State::BlockUpload(upload)) => upload.receive(&request, dictionary),
            (Request::EndBlockDownload { .. }, State::Idle) if ended == Some(message) => {
                self.ended = ended;
                Step::Go(Some(Response::EndBlockDownload.to_bytes()))
            }
            _ => Abort::COMMAND.into(),
        }
    }

    fn open<D: Dictionary>(&mut self, address: Address, dictionary: &mut D) {
        self.close(dictionary);
        self.address = address;
    }

    fn upload<D: Dictionary>(&mut self, address: Address, dictionary: &mut D) -> Step {
        self.open(address, dictionary);
        match dictionary.upload(address) {
            Ok(size) => self.plain_upload(size, dictionary),
            Err(code) => code.into(),
        }
    }

    fn plain_upload<D: Dictionary>(&mut self, size: u32, dictionary: &mut D) -> Step {
        let mut bytes = [0; 4];
        let data = match bytes.get_mut(..size as usize).filter(|bytes| !bytes.is_empty()) {
            Some(bytes) => {
                dictionary.read(0, bytes);
                Initiate::Expedited(bytes.iter().copied().collect())
            }
            None => {
                self.state = State::Upload(Upload::new(size));
                Initiate::Segmented { size: Some(size) }
            }
        };
        Step::Go(Some(Response::InitiateUpload { address: self.address, data }.to_bytes()))
    }

    fn download<D: Dictionary>(&mut self, address: Address, data: &Initiate, dictionary: &mut D) -> Step {
        self.open(address, dictionary);
        let (bytes, size): (&[u8], _) = match data {
            Initiate::Expedited(bytes) => (bytes, Some(bytes.len() as u32)),
            Initiate::Unsized(bytes) => {
                let length = dictionary.length(address).filter(|length| *length <= 4);
                (bytes.get(..length.unwrap_or(4) as usize).unwrap_or_default(), length)
            }
            Initiate::Segmented { size } => (&[], *size),
        };
        if let Err(code) = dictionary.download(address, size) {
            return code.into();
        }
        let answer = Some(Response::InitiateDownload { address }.to_bytes());
        self.state = State::Download(Download::new(size));
        if matches!(data, Initiate::Segmented { .. }) {
            return Step::Go(answer);
        }
        match dictionary.write(bytes).and_then(|()| dictionary.finish()) {
            Ok(()) => Step::End(answer),
            Err(code) => code.into(),
        }
    }

    fn block_upload<D: Dictionary>(
        &mut self,
        address: Address,
        crc: bool,
        block: u8,
        threshold: u8,
        dictionary: &mut D,
    ) -> Step {
        self.open(address, dictionary);
        if !(1..=MAX_BLOCK).contains(&block) {
            return Abort::BLOCK_SIZE.into();
        }
        match dictionary.upload(address) {
            // The client lets it be read the plain way.
            Ok(size) if threshold > 0 && size <= u32::from(threshold) => self.plain_upload(size, dictionary),
            Ok(size) => {
                self.state = State::BlockUpload(BlockUpload::new(size, block, crc));
                let answer = Response::InitiateBlockUpload { address, crc: true, size: Some(size) };
                Step::Go(Some(answer.to_bytes()))
            }
            Err(code) => code.into(),
        }
    }

    fn block_download<D: Dictionary>(
        &mut self,
        address: Address,
        crc: bool,
        size: Option<u32>,
        dictionary: &mut D,
    ) -> Step {
        self.open(address, dictionary);
        if let Err(code) = dictionary.download(address, size) {
            return code.into();
        }
        self.state = State::BlockDownload(BlockDownload::new(size, self.block, crc));
        let answer = Response::InitiateBlockDownload { address, crc: true, block: self.block };
        Step::Go(Some(answer.to_bytes()))
    }
}

/// An abort is 80h in every state: no segment has the number 0.
const fn is_abort(message: &Message) -> bool {
    matches!(message, [0x80, ..])
}

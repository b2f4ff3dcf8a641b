//! What a client and its transfers say to each other.

use super::super::{Abort, BlockSegment, Request};
use super::download::Download;
use super::upload::Upload;
use super::{Failure, Outcome};

/// The transfer.
#[derive(Clone, Debug)]
pub(super) enum Work {
    Upload(Upload),
    Download(Download),
}

/// What a message has led to.
pub(super) enum Step {
    /// The next is to be sent.
    Send,
    /// Nothing of a block arrived: the next is to be sent, but not for ever.
    Again,
    /// More is to come.
    Wait,
    /// More is to come; this was none of it.
    Skip,
    /// An acknowledgement came early: sending goes on after a while.
    Settle {
        /// Something of the block arrived.
        progress: bool,
    },
    /// Over.
    End(Result<Outcome, Failure>),
    /// Not for this transfer.
    Foreign,
}

/// What is to be sent.
pub(super) enum Next {
    Message(Request),
    Segment(BlockSegment),
    /// Bytes are lacking.
    Fetch {
        offset: u32,
        count: usize,
    },
}

impl Work {
    pub const fn is_block(&self) -> bool {
        match self {
            Self::Upload(upload) => upload.is_block(),
            Self::Download(download) => download.is_block(),
        }
    }

    pub const fn hears_segments(&self) -> bool {
        match self {
            Self::Upload(upload) => upload.hears_segments(),
            Self::Download(_) => false,
        }
    }

    /// Whether what is sent next brings data.
    pub const fn brings_data(&self) -> bool {
        match self {
            Self::Upload(upload) => upload.brings_data(),
            Self::Download(_) => false,
        }
    }

    /// The server aborted it.
    pub const fn aborted(&self, code: Abort, heard: Option<u8>) -> Failure {
        match self {
            Self::Upload(_) => Failure::Aborted(code),
            Self::Download(download) => download.aborted(code, heard),
        }
    }
}

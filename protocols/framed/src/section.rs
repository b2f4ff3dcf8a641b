//! `DADR LEN DAT TMR`: what a packet consists of.

/// Address of nobody: such a section only fills.
pub const NOBODY: u8 = 0;
/// Address of the frame itself: its trailer.
pub const TRAILER: u8 = 0xFF;
/// TMR as we send it; assumed, for the thesis names no value.
pub const TERMINATOR: u8 = 0x0D;
/// Bytes of a section besides its data.
pub const OVERHEAD: usize = 3;

/// What a packet says to one station.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Section<'a> {
    /// DADR, the station that this is for.
    pub address: u8,
    /// DAT.
    pub data: &'a [u8],
    /// TMR.
    pub terminator: u8,
}

/// The sections of a packet; ends early where bytes are no section.
#[derive(Clone, Debug)]
pub struct Sections<'a>(&'a [u8]);

impl<'a> Sections<'a> {
    /// The sections in `packet`.
    pub const fn new(packet: &'a [u8]) -> Self {
        Self(packet)
    }

    /// What is left after the sections taken so far.
    pub const fn rest(&self) -> &'a [u8] {
        self.0
    }
}

impl<'a> Iterator for Sections<'a> {
    type Item = Section<'a>;

    fn next(&mut self) -> Option<Section<'a>> {
        let (&[address, length], rest) = self.0.split_first_chunk()?;
        let (data, rest) = rest.split_at_checked(length.into())?;
        let (&terminator, rest) = rest.split_first()?;
        self.0 = rest;
        Some(Section { address, data, terminator })
    }
}

/// There is no room for a section, or its data is longer than 255 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoRoom;

impl core::fmt::Display for NoRoom {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("there is no room for the section, or its data is longer than 255 bytes")
    }
}

impl core::error::Error for NoRoom {}

/// Appends a section to a packet.
///
/// # Errors
/// `NoRoom`, with `packet` as it was.
pub fn push<const N: usize>(
    packet: &mut heapless::Vec<u8, N>,
    address: u8,
    data: &[u8],
) -> Result<(), NoRoom> {
    let length = u8::try_from(data.len()).map_err(|_| NoRoom)?;
    if packet.capacity() - packet.len() < data.len() + OVERHEAD {
        return Err(NoRoom);
    }
    // There is room for all of it.
    let _ = packet.extend_from_slice(&[address, length]);
    let _ = packet.extend_from_slice(data);
    let _ = packet.push(TERMINATOR);
    Ok(())
}

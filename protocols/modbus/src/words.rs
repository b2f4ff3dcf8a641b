//! Registers as they stand in a PDU.

/// 16-bit registers over their bytes, most significant byte first.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Words<'a>(&'a [[u8; 2]]);

impl<'a> Words<'a> {
    /// The registers in `bytes`; an odd last byte is left out.
    pub fn from_bytes(bytes: &'a [u8]) -> Self {
        Self(bytes.as_chunks().0)
    }

    /// The bytes of all registers.
    pub fn as_bytes(self) -> &'a [u8] {
        self.0.as_flattened()
    }

    /// Number of registers.
    pub fn len(self) -> usize {
        self.0.len()
    }

    /// Whether there is no register.
    pub fn is_empty(self) -> bool {
        self.0.is_empty()
    }

    /// Register `index`, counted from 0.
    pub fn get(self, index: usize) -> Option<u16> {
        self.0.get(index).map(|bytes| u16::from_be_bytes(*bytes))
    }

    /// All registers in order.
    pub fn iter(self) -> impl ExactSizeIterator<Item = u16> + Clone + 'a {
        self.0.iter().map(|bytes| u16::from_be_bytes(*bytes))
    }
}

impl core::fmt::Debug for Words<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

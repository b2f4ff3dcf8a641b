//! The MAC address of a board without one of its own.

/// A MAC address from the chip's 96-bit unique id: the same after every start, different on every chip with all
/// likelihood (46 bits of an FNV-1a hash). Locally administered and unicast (IEEE 802, clause 8.4: the two lowest bits
/// of the first octet), because nobody has bought an address block for it.
pub fn from_unique_id(id: &[u8; 12]) -> [u8; 6] {
    let hash = id.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    });
    let [h0, h1, h2, h3, h4, h5, h6, h7] = hash.to_be_bytes();
    [((h2 ^ h0) & !0b01) | 0b10, h3 ^ h1, h4, h5, h6, h7]
}

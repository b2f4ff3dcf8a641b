//! An address together with its network.

use core::fmt;
use core::net::Ipv4Addr;
use core::str::FromStr;

/// An IPv4 address and the length of its network part, written as in `192.168.1.111/24`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cidr {
    /// The address.
    pub address: Ipv4Addr,
    /// Bits of the network part, 0 to 32.
    pub prefix: u8,
}

/// A text that is no [`Cidr`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadCidr;

impl fmt::Display for BadCidr {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("expected an address and the bits of its network part, as in 192.168.1.111/24")
    }
}

impl Cidr {
    /// The bits that tell the hosts of a network apart.
    fn host_bits(self) -> u32 {
        u32::MAX.checked_shr(self.prefix.into()).unwrap_or_default()
    }

    /// Whether this is an address of the same network that a host can have: neither its first nor its last one.
    pub fn has_host(self, other: Ipv4Addr) -> bool {
        let host = other.to_bits() & self.host_bits();
        (other.to_bits() ^ self.address.to_bits()) & !self.host_bits() == 0
            && host != 0
            && host != self.host_bits()
    }
}

impl FromStr for Cidr {
    type Err = BadCidr;

    fn from_str(text: &str) -> Result<Self, BadCidr> {
        let (address, prefix) = text.split_once('/').ok_or(BadCidr)?;
        let prefix = prefix.parse().ok().filter(|prefix| *prefix <= 32).ok_or(BadCidr)?;
        Ok(Self { address: address.parse().map_err(|_| BadCidr)?, prefix })
    }
}

impl fmt::Display for Cidr {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.address, self.prefix)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts() {
        for text in ["192.168.1.111/24", "0.0.0.0/0", "255.255.255.255/32"] {
            assert_eq!(text.parse::<Cidr>().map(|cidr| cidr.to_string()), Ok(text.to_owned()));
        }
        for text in ["", "/", "192.168.1.111", "192.168.1.111/", "192.168.1.111/33", "192.168.1/24", "::1/64"]
        {
            assert_eq!(text.parse::<Cidr>(), Err(BadCidr), "{text}");
        }
    }

    #[test]
    fn hosts_of_a_network() {
        let cidr: Cidr = "192.168.1.111/24".parse().expect("a network");
        for (address, expected) in [
            ([192, 168, 1, 111], true),
            ([192, 168, 1, 1], true),
            ([192, 168, 1, 0], false),
            ([192, 168, 1, 255], false),
            ([192, 168, 2, 1], false),
        ] {
            assert_eq!(cidr.has_host(address.into()), expected, "{address:?}");
        }
        let all: Cidr = "10.0.0.1/0".parse().expect("a network");
        assert!(all.has_host([192, 168, 1, 1].into()) && !all.has_host([0, 0, 0, 0].into()));
        let one: Cidr = "10.0.0.1/32".parse().expect("a network");
        assert!(!one.has_host([10, 0, 0, 1].into()));
    }

    proptest::proptest! {
        #[test]
        fn any_text_is_read_without_panic(text in "[0-9./]{0,24}") {
            if let Ok(cidr) = text.parse::<Cidr>() {
                proptest::prop_assert_eq!(cidr.to_string().parse(), Ok(cidr));
            }
        }
    }
}

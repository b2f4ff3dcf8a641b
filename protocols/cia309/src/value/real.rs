//! Real numbers.

use core::fmt;
use core::str::FromStr;

use heapless::String;

/// A real number as C reads it, but for those in hex.
pub(super) fn parse<T: FromStr>(word: &[u8]) -> Option<T> {
    core::str::from_utf8(word).ok()?.parse().ok()
}

/// Shows a number, from the shortest text that reads as it again, in the form of C's `%g`: `0.5`, `100`, `1e+20`, `1.5e-07`.
/// `%g` itself, in CANopenNode, gives six digits.
pub(super) fn show(text: &str, f: &mut impl fmt::Write) -> fmt::Result {
    let (sign, text) = text.strip_prefix('-').map_or(("", text), |text| ("-", text));
    if !text.starts_with(|first: char| first.is_ascii_digit()) {
        return if text == "inf" { write!(f, "{sign}inf") } else { f.write_str("nan") };
    }
    f.write_str(sign)?;
    let (mantissa, power) = text.split_once('e').unwrap_or((text, "0"));
    let (whole, part) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let mut all = String::<24>::new();
    // There are 17 digits at most, and zeros that the smallest numbers without an exponent have.
    let _ = all.push_str(whole).and_then(|()| all.push_str(part));
    let digits = all.trim_start_matches('0');
    // Power of ten of the first digit.
    let first = power.parse().unwrap_or(0) + whole.len() as i32 - 1 - (all.len() - digits.len()) as i32;
    let digits = digits.trim_end_matches('0');
    let (count, zeros) = (digits.len(), "0000000000000000");
    match first {
        _ if count == 0 => f.write_str("0"),
        -4..0 => write!(f, "0.{}{digits}", zeros.get(..(-first - 1) as usize).unwrap_or_default()),
        0..16 => match digits.split_at_checked(first as usize + 1) {
            Some((whole, "")) => f.write_str(whole),
            Some((whole, part)) => write!(f, "{whole}.{part}"),
            None => write!(f, "{digits}{}", zeros.get(..first as usize + 1 - count).unwrap_or_default()),
        },
        _ => {
            let (whole, part) = digits.split_at_checked(1).unwrap_or((digits, ""));
            let point = if part.is_empty() { "" } else { "." };
            let sign = if first < 0 { '-' } else { '+' };
            write!(f, "{whole}{point}{part}e{sign}{:02}", first.unsigned_abs())
        }
    }
}

//! Numbers as C has them: `12`, `0x1F`, and octal with a zero before: `017`.

/// A number without a sign, or with a plus.
pub(crate) fn unsigned(word: &[u8]) -> Option<u64> {
    digits(word.strip_prefix(b"+").unwrap_or(word))
}

/// A number with or without a sign.
pub(crate) fn signed(word: &[u8]) -> Option<i64> {
    match word.strip_prefix(b"-") {
        Some(magnitude) => 0i64.checked_sub_unsigned(digits(magnitude)?),
        None => unsigned(word)?.try_into().ok(),
    }
}

fn digits(word: &[u8]) -> Option<u64> {
    let (radix, digits) = match word {
        [b'0', b'x' | b'X', hex @ ..] => (16, hex),
        [b'0', octal @ ..] if !octal.is_empty() => (8, octal),
        _ => (10, word),
    };
    if digits.is_empty() {
        return None;
    }
    digits.iter().try_fold(0u64, |number, digit| {
        let digit = char::from(*digit).to_digit(radix)?;
        number.checked_mul(u64::from(radix))?.checked_add(u64::from(digit))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_c() {
        assert_eq!(unsigned(b"0"), Some(0));
        assert_eq!(unsigned(b"4294967296"), Some(1 << 32));
        assert_eq!(unsigned(b"0xFfFF"), Some(65535));
        assert_eq!(unsigned(b"017"), Some(15));
        assert_eq!(unsigned(b"+5"), Some(5));
        assert_eq!(signed(b"-9223372036854775808"), Some(i64::MIN));
        assert_eq!(signed(b"-0x10"), Some(-16));
        for bad in [&b""[..], b"0x", b"09", b"1a", b"-", b"+", b"--1", b"18446744073709551616", b"1.5"] {
            assert_eq!(unsigned(bad), None);
            assert_eq!(signed(bad), None);
        }
        assert_eq!(unsigned(b"-1"), None);
        assert_eq!(signed(b"9223372036854775808"), None);
    }
}

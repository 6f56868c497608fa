//! Base64 (RFC 4648) as VTK uses it: several encodings may be concatenated, each with its padding.

const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// Encodes bytes as text.
pub(crate) fn encode(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let at = |n: usize| u32::from(three.get(n).copied().unwrap_or(0));
        let bits = at(0) << 16 | at(1) << 8 | at(2);
        for sextet in 0..4 {
            let known = sextet <= three.len();
            text.push(if known { char::from(ALPHABET[(bits >> (18 - 6 * sextet) & 63) as usize]) } else { '=' });
        }
    }
    text
}

/// Decodes text, ignoring white space; `None` for an invalid character.
pub(crate) fn decode(text: &[u8]) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3 + 3);
    let mut letters = text.iter().copied().filter(|b| !b.is_ascii_whitespace());
    while let Some(first) = letters.next() {
        let four = [first, letters.next()?, letters.next()?, letters.next()?];
        let mut bits = 0;
        for letter in four {
            bits = bits << 6 | u32::from(value(letter)?);
        }
        let padding = four.iter().filter(|b| **b == b'=').count();
        bytes.extend([(bits >> 16) as u8, (bits >> 8) as u8, bits as u8].iter().take(3_usize.saturating_sub(padding)));
    }
    Some(bytes)
}

fn value(letter: u8) -> Option<u8> {
    match letter {
        b'A'..=b'Z' => Some(letter - b'A'),
        b'a'..=b'z' => Some(letter - b'a' + 26),
        b'0'..=b'9' => Some(letter - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        b'=' => Some(0),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_examples_of_the_standard() {
        for (bytes, text) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(encode(bytes.as_bytes()), text);
            assert_eq!(decode(text.as_bytes()).unwrap(), bytes.as_bytes());
        }
        assert_eq!(decode(b"Zg==Zm9v").unwrap(), b"ffoo");
        assert_eq!(decode(b"Zg"), None);
        assert_eq!(decode(b"Zg*="), None);
    }

    proptest! {
        #[test]
        fn encoding_round_trips(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            prop_assert_eq!(decode(encode(&bytes).as_bytes()).unwrap(), bytes);
        }
    }
}

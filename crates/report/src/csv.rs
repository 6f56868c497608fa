//! Text of CSV files: a header line, commas, decimal points.
//!
//! # Sources
//! Y. Shafranovich, RFC 4180 (2005).

use std::borrow::Cow;

/// A field of a line; one with a comma, a quote or a line's end is put in quotes.
pub fn field(text: &str) -> Cow<'_, str> {
    if text.contains([',', '"', '\n', '\r']) {
        Cow::Owned(format!("\"{}\"", text.replace('"', "\"\"")))
    } else {
        Cow::Borrowed(text)
    }
}

/// A line of fields, with its end.
pub fn line<T: AsRef<str>>(fields: impl IntoIterator<Item = T>) -> String {
    let fields: Vec<String> = fields.into_iter().map(|text| field(text.as_ref()).into_owned()).collect();
    fields.join(",") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comma_or_a_quote_does_not_end_a_field() {
        assert_eq!(line(["a", "b, c", "say \"d\"", ""]), "a,\"b, c\",\"say \"\"d\"\"\",\n");
    }
}

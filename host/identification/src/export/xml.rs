//! Text inside of XML.

/// What a comment may hold: no two hyphens in a row, no control characters.
pub(super) fn comment(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in printable(text) {
        if c == '-' && safe.ends_with('-') {
            safe.push(' ');
        }
        safe.push(c);
    }
    safe
}

/// Text as the value of an attribute, or between tags.
pub(super) fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in printable(text) {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            c => safe.push(c),
        }
    }
    safe
}

fn printable(text: &str) -> impl Iterator<Item = char> {
    text.chars().map(|c| if c.is_control() { ' ' } else { c })
}

#[cfg(test)]
mod tests {
    #[test]
    fn text_cannot_end_what_it_stands_in() {
        assert_eq!(super::comment("a --b---c\n-->"), "a - -b- - -c - ->");
        assert_eq!(super::escaped("\"a\" <b> & c\td"), "&quot;a&quot; &lt;b&gt; &amp; c d");
    }
}

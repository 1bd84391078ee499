//! Writes HTML whose nesting is right by construction and in which every piece of text is escaped.
//!
//! Elements open and close around a closure, so a tag cannot be left open. The only text that goes out unescaped is
//! `&'static str` handed to [`Html::asset`], which user input cannot be.

use serde::Serialize;

/// A growing piece of HTML.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub struct Html {
    out: String,
}

impl Html {
    /// An empty piece.
    pub fn new() -> Self {
        Self::default()
    }

    /// The text written so far.
    pub fn into_string(self) -> String {
        self.out
    }

    /// `<name attributes…>` + what `inside` writes + `</name>`.
    pub fn element(&mut self, name: &'static str, attributes: &[(&'static str, &str)], inside: impl FnOnce(&mut Self)) {
        self.void(name, attributes);
        inside(self);
        self.out.push_str("</");
        self.out.push_str(name);
        self.out.push('>');
    }

    /// An element that holds only text.
    pub fn text_element(&mut self, name: &'static str, attributes: &[(&'static str, &str)], text: &str) {
        self.element(name, attributes, |h| h.text(text));
    }

    /// An element that has no end tag in HTML (`meta`, `br`, …).
    pub fn void(&mut self, name: &'static str, attributes: &[(&'static str, &str)]) {
        self.out.push('<');
        self.out.push_str(name);
        for (key, value) in attributes {
            self.out.push(' ');
            self.out.push_str(key);
            self.out.push_str("=\"");
            self.text(value);
            self.out.push('"');
        }
        self.out.push('>');
    }

    /// Text of any origin. `& < > " '` become references; control characters, which HTML does not allow, become U+FFFD.
    pub fn text(&mut self, text: &str) {
        for c in text.chars() {
            match c {
                '&' => self.out.push_str("&amp;"),
                '<' => self.out.push_str("&lt;"),
                '>' => self.out.push_str("&gt;"),
                '"' => self.out.push_str("&quot;"),
                '\'' => self.out.push_str("&#39;"),
                '\n' | '\t' => self.out.push(c),
                c if c.is_control() => self.out.push('\u{fffd}'),
                c => self.out.push(c),
            }
        }
    }

    /// Text of the program itself (style sheet, script), written as it is.
    pub fn asset(&mut self, text: &'static str) {
        self.out.push_str(text);
    }

    /// Another piece, whose text is escaped already.
    pub fn append(&mut self, other: &Self) {
        self.out.push_str(&other.out);
    }

    /// `value` as JSON inside `<script type="application/json">`, where references are not decoded: the characters that
    /// could end the element are written as JSON escapes instead.
    ///
    /// # Errors
    /// What `serde_json` says if `value` cannot be written as JSON.
    pub fn json(&mut self, value: &impl Serialize) -> Result<(), serde_json::Error> {
        let json = serde_json::to_string(value)?;
        self.void("script", &[("type", "application/json")]);
        for c in json.chars() {
            match c {
                '<' => self.out.push_str("\\u003c"),
                '>' => self.out.push_str("\\u003e"),
                '&' => self.out.push_str("\\u0026"),
                c => self.out.push(c),
            }
        }
        self.out.push_str("</script>");
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_attributes_are_escaped() {
        let mut h = Html::new();
        h.text_element("p", &[("title", "a\"b<c")], "<script>alert('x')&\0");
        assert_eq!(h.into_string(), "<p title=\"a&quot;b&lt;c\">&lt;script&gt;alert(&#39;x&#39;)&amp;\u{fffd}</p>");
    }

    #[test]
    fn json_cannot_end_its_script_element() {
        let mut h = Html::new();
        h.json(&"</script><!-- & -->").unwrap();
        let text = h.into_string();
        assert_eq!(text.matches("</script>").count(), 1);
        assert!(!text.contains("<!--"));
        let inner = &text["<script type=\"application/json\">".len()..text.len() - 9];
        assert_eq!(serde_json::from_str::<String>(inner).unwrap(), "</script><!-- & -->");
    }
}

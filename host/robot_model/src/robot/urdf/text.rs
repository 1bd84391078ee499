//! What a URDF's text says that no URDF can: macros that nobody expanded, and numbers that are none. The parser of the whole knows
//! neither their line nor their name.

use super::RobotError;

/// Elements whose attributes are numbers, their attributes, and how many numbers each has.
const NUMBERS: [(&str, &[&str], usize); 10] = [
    ("origin", &["xyz", "rpy"], 3),
    ("axis", &["xyz"], 3),
    ("limit", &["lower", "upper", "effort", "velocity"], 1),
    ("mass", &["value"], 1),
    ("inertia", &["ixx", "ixy", "ixz", "iyy", "iyz", "izz"], 1),
    ("dynamics", &["damping", "friction"], 1),
    ("box", &["size"], 3),
    ("cylinder", &["radius", "length"], 1),
    ("sphere", &["radius"], 1),
    ("mesh", &["scale"], 3),
];

/// Refuses the URDF in `text`, which was read from `file`, at the first place that is none.
pub(super) fn check(text: &str, file: &str) -> Result<(), RobotError> {
    for tag in Tags::of(text) {
        let at = |line: usize, what: String| format!("{file}, line {line}, {what}");
        let xacro =
            format!("the macros of xacro have not been expanded; run xacro first: xacro MODEL.urdf.xacro > {file}");
        if tag.name.starts_with("xacro:") {
            return Err(RobotError::invalid(at(tag.line, "element".to_owned()), format!("<{}>", tag.name), xacro));
        }
        for (line, name, value) in tag.attributes {
            let field = || at(line, format!("attribute {name} of <{}>", tag.name));
            if value.contains("${") || value.contains("$(") {
                return Err(RobotError::invalid(field(), format!("`{value}`"), xacro));
            }
            let numeric = NUMBERS.iter().find(|(element, names, _)| *element == tag.name && names.contains(&name));
            let Some((.., count)) = numeric else { continue };
            let numbers: Vec<&str> = value.split_whitespace().collect();
            let is_number = |text: &&str| text.parse::<f64>().is_ok_and(f64::is_finite);
            if numbers.len() == *count && numbers.iter().all(is_number) {
                continue;
            }
            let advice = match () {
                () if value.contains(',') => "numbers have a decimal point, and are separated by spaces",
                () if numbers.len() != *count && numbers.iter().all(is_number) => {
                    if *count == 3 {
                        "three numbers are wanted here"
                    } else {
                        "one number is wanted here"
                    }
                }
                () => "is not a number",
            };
            return Err(RobotError::invalid(field(), format!("`{value}`"), advice));
        }
    }
    Ok(())
}

/// An opening or empty tag.
struct Tag<'a> {
    name: &'a str,
    line: usize,
    /// Line, name, value.
    attributes: Vec<(usize, &'a str, &'a str)>,
}

/// The tags of a text; what is not well formed ends them, and is told by the parser of the whole.
struct Tags<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Tags<'a> {
    fn of(text: &'a str) -> Self {
        Self { text, at: 0 }
    }

    fn line(&self, at: usize) -> usize {
        1 + self.text[..at].matches('\n').count()
    }

    /// Goes behind the next `end`.
    fn skip(&mut self, end: &str) -> Option<()> {
        self.at += self.text[self.at..].find(end)? + end.len();
        Some(())
    }

    fn tag(&mut self) -> Option<Option<Tag<'a>>> {
        self.skip("<")?;
        let rest = &self.text[self.at..];
        for (start, end) in [("!--", "-->"), ("![CDATA[", "]]>"), ("?", "?>"), ("!", ">"), ("/", ">")] {
            if rest.starts_with(start) {
                self.skip(end)?;
                return Some(None);
            }
        }
        let line = self.line(self.at);
        let length = rest.find(|c: char| c.is_whitespace() || c == '>' || c == '/')?;
        let mut tag = Tag { name: &rest[..length], line, attributes: Vec::new() };
        self.at += length;
        loop {
            let rest = &self.text[self.at..];
            let trimmed = rest.trim_start_matches(|c: char| c.is_whitespace() || c == '/');
            self.at += rest.len() - trimmed.len();
            if trimmed.starts_with('>') {
                return Some(Some(tag));
            }
            let line = self.line(self.at);
            let (name, behind) = trimmed.split_once('=')?;
            let quoted = behind.trim_start();
            let quote = quoted.chars().next().filter(|c| *c == '"' || *c == '\'')?;
            let (value, behind) = quoted[1..].split_once(quote)?;
            tag.attributes.push((line, name.trim(), value));
            self.at = self.text.len() - behind.len();
        }
    }
}

impl<'a> Iterator for Tags<'a> {
    type Item = Tag<'a>;

    fn next(&mut self) -> Option<Tag<'a>> {
        loop {
            if let Some(tag) = self.tag()? {
                return Some(tag);
            }
        }
    }
}

//! Tables: typed columns, units below the heading, cells that say when they are out of bounds.

use super::bars::Tone;
use super::html::Html;

/// One column: its heading, its unit (may be empty) and how its cells are set.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Column {
    name: String,
    unit: String,
    number: bool,
}

/// One cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cell {
    text: String,
    tone: Tone,
}

impl Cell {
    /// A cell with a meaning beyond its text.
    pub fn toned(text: impl Into<String>, tone: Tone) -> Self {
        Self { text: text.into(), tone }
    }
}

impl<S: Into<String>> From<S> for Cell {
    fn from(text: S) -> Self {
        Self::toned(text, Tone::Plain)
    }
}

/// A table, built column by column and then row by row.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Table {
    columns: Vec<Column>,
    rows: Vec<Vec<Cell>>,
    caption: String,
}

impl Table {
    /// An empty table.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a column of words.
    #[must_use]
    pub fn words(mut self, name: impl Into<String>) -> Self {
        self.columns.push(Column { name: name.into(), unit: String::new(), number: false });
        self
    }

    /// Adds a column of numbers in that unit.
    #[must_use]
    pub fn numbers(mut self, name: impl Into<String>, unit: impl Into<String>) -> Self {
        self.columns.push(Column { name: name.into(), unit: unit.into(), number: true });
        self
    }

    /// A sentence below the table.
    #[must_use]
    pub fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    /// Adds a row; cells that are missing stay empty, cells without a column are not shown.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push(cells.into_iter().collect());
    }

    pub(super) fn write(&self, h: &mut Html) {
        h.element("div", &[("class", "table")], |h| {
            h.element("table", &[], |h| {
                h.element("thead", &[], |h| {
                    h.element("tr", &[], |h| self.columns.iter().for_each(|c| c.write(h)));
                });
                h.element("tbody", &[], |h| self.rows.iter().for_each(|r| self.write_row(h, r)));
            });
        });
        // Outside of the box, so that it does not scroll with a wide table.
        if !self.caption.is_empty() {
            h.text_element("p", &[("class", "below")], &self.caption);
        }
    }

    fn write_row(&self, h: &mut Html, row: &[Cell]) {
        h.element("tr", &[], |h| {
            for (i, column) in self.columns.iter().enumerate() {
                let (text, tone) = row.get(i).map_or(("", Tone::Plain), |c| (c.text.as_str(), c.tone));
                let class = format!("{} {}", column.class(), tone.class());
                h.text_element("td", &[("class", &class)], text);
            }
        });
    }
}

impl Column {
    fn class(&self) -> &'static str {
        if self.number { "number" } else { "words" }
    }

    fn write(&self, h: &mut Html) {
        h.element("th", &[("class", self.class()), ("scope", "col")], |h| {
            h.text(&self.name);
            if !self.unit.is_empty() {
                h.text_element("span", &[("class", "unit")], &self.unit);
            }
        });
    }
}

//! The page, its sections, and what they are made of: tables, charts, HTML.

mod bars;
mod decimate;
pub mod html;
mod plot;
mod scatter;
mod svg;
mod table;

pub use bars::{Bar, BarChart, Tone};
pub use decimate::decimate;
pub use plot::{Colour, LinePlot, Series, Stroke};
pub use scatter::Scatter;
pub use table::{Cell, Table};

use html::Html;

/// A whole page: title, one sentence that says what came out, facts, sections.
#[derive(Debug, Clone, Default)]
pub struct Page {
    title: String,
    lead: String,
    facts: Vec<(String, String)>,
    sections: Vec<Section>,
}

impl Page {
    /// A page of that title.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    /// The outcome in a sentence, below the title.
    #[must_use]
    pub fn lead(mut self, sentence: impl Into<String>) -> Self {
        self.lead = sentence.into();
        self
    }

    /// A line of the page's head: what was compared, with what, when.
    #[must_use]
    pub fn fact(mut self, name: impl Into<String>, value: impl Into<String>) -> Self {
        self.facts.push((name.into(), value.into()));
        self
    }

    /// Adds a section.
    pub fn push(&mut self, section: Section) {
        self.sections.push(section);
    }

    /// The page as one file: style, script and data inside, nothing loaded from anywhere.
    pub fn to_html(&self) -> String {
        let mut h = Html::new();
        h.asset("<!DOCTYPE html>\n");
        h.element("html", &[("lang", "en")], |h| {
            h.element("head", &[], |h| self.write_head(h));
            h.element("body", &[], |h| {
                h.element("main", &[], |h| self.write_body(h));
                h.element("script", &[], |h| {
                    h.asset("/*\n");
                    h.asset(UPLOT_LICENSE);
                    h.asset("*/\n");
                    h.asset(UPLOT_JS);
                    h.asset(PAGE_JS);
                });
            });
        });
        h.into_string()
    }

    fn write_head(&self, h: &mut Html) {
        h.void("meta", &[("charset", "utf-8")]);
        // The browser itself refuses whatever would have to be loaded.
        h.void(
            "meta",
            &[
                ("http-equiv", "Content-Security-Policy"),
                ("content", "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'"),
            ],
        );
        h.void("meta", &[("name", "viewport"), ("content", "width=device-width, initial-scale=1")]);
        h.text_element("title", &[], &self.title);
        h.element("style", &[], |h| {
            h.asset(UPLOT_CSS);
            h.asset("\n");
            h.asset(PAGE_CSS);
        });
    }

    fn write_body(&self, h: &mut Html) {
        h.text_element("h1", &[], &self.title);
        if !self.lead.is_empty() {
            h.text_element("p", &[("class", "lead")], &self.lead);
        }
        if !self.facts.is_empty() {
            h.element("dl", &[("class", "facts")], |h| {
                for (name, value) in &self.facts {
                    h.text_element("dt", &[], name);
                    h.text_element("dd", &[], value);
                }
            });
        }
        if self.sections.len() > 1 {
            h.element("nav", &[], |h| {
                for (i, section) in self.sections.iter().enumerate() {
                    h.text_element("a", &[("href", &format!("#section-{i}"))], &section.title);
                }
            });
        }
        for (i, section) in self.sections.iter().enumerate() {
            h.element("section", &[("id", &format!("section-{i}"))], |h| {
                h.text_element("h2", &[], &section.title);
                h.append(&section.body);
            });
        }
    }
}

/// A part of a page under one heading. What is added is written at once, so a section holds no data of a recording.
#[derive(Debug, Clone, Default)]
pub struct Section {
    title: String,
    body: Html,
}

impl Section {
    /// An empty section.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), body: Html::new() }
    }

    /// A paragraph.
    pub fn prose(&mut self, text: impl AsRef<str>) {
        self.body.text_element("p", &[], text.as_ref());
    }

    /// A heading inside the section.
    pub fn heading(&mut self, text: impl AsRef<str>) {
        self.body.text_element("h3", &[], text.as_ref());
    }

    /// A paragraph set apart, coloured by what it means.
    pub fn note(&mut self, tone: Tone, text: impl AsRef<str>) {
        let class = format!("note {}", tone.class());
        self.body.text_element("p", &[("class", &class)], text.as_ref());
    }

    /// A list of sentences.
    pub fn list<S: AsRef<str>>(&mut self, items: impl IntoIterator<Item = S>) {
        self.body.element("ul", &[], |h| {
            for item in items {
                h.text_element("li", &[], item.as_ref());
            }
        });
    }

    /// The few numbers that a reader should take home: name, value with its unit, meaning.
    pub fn figures<N: AsRef<str>, V: AsRef<str>>(&mut self, figures: impl IntoIterator<Item = (N, V, Tone)>) {
        self.body.element("div", &[("class", "figures")], |h| {
            for (name, value, tone) in figures {
                h.element("div", &[("class", tone.class())], |h| {
                    h.text_element("span", &[("class", "value")], value.as_ref());
                    h.text_element("span", &[("class", "name")], name.as_ref());
                });
            }
        });
    }

    /// A table.
    pub fn table(&mut self, table: &Table) {
        table.write(&mut self.body);
    }

    /// What `inside` adds, beside each other where the page is wide enough, else below each other.
    pub fn beside(&mut self, inside: impl FnOnce(&mut Self)) {
        let mut blocks = Section::default();
        inside(&mut blocks);
        self.body.element("div", &[("class", "beside")], |h| h.append(&blocks.body));
    }

    /// A line plot under its title.
    ///
    /// # Panics
    /// If two series of the plot differ in length.
    pub fn plot(&mut self, title: impl AsRef<str>, plot: LinePlot<'_>) {
        let data = plot.reduce();
        figure(&mut self.body, "plot", title.as_ref(), &data.caption, |h| {
            let class = if data.zoom.is_some() { "pair" } else { "pair single" };
            h.element("div", &[("class", class)], |h| {
                h.element("div", &[("class", "overview")], |_| {});
                if data.zoom.is_some() {
                    h.element("div", &[("class", "zoom")], |_| {});
                }
            });
            h.element("div", &[("class", "legend uplot")], |_| {});
            h.json(&data).expect("strings and numbers in a struct can always be written as JSON");
        });
    }

    /// A bar chart under its title.
    pub fn bars(&mut self, title: impl AsRef<str>, chart: &BarChart) {
        figure(&mut self.body, "bars", title.as_ref(), chart.caption_text(), |h| chart.write(h));
    }

    /// A scatter drawing under its title.
    pub fn scatter(&mut self, title: impl AsRef<str>, scatter: &Scatter) {
        figure(&mut self.body, "scatter", title.as_ref(), scatter.caption_text(), |h| scatter.write(h));
    }
}

fn figure(h: &mut Html, class: &str, title: &str, caption: &str, inside: impl FnOnce(&mut Html)) {
    h.element("figure", &[("class", class)], |h| {
        h.text_element("figcaption", &[("class", "above")], title);
        inside(h);
        if !caption.is_empty() {
            h.text_element("p", &[("class", "below")], caption);
        }
    });
}

// uPlot 1.6.32 as published; its licence travels in every page.
const UPLOT_JS: &str = include_str!("../assets/uplot-1.6.32/uPlot.iife.min.js");
const UPLOT_CSS: &str = include_str!("../assets/uplot-1.6.32/uPlot.min.css");
const UPLOT_LICENSE: &str = include_str!("../assets/uplot-1.6.32/LICENSE");
const PAGE_JS: &str = include_str!("../assets/page.js");
const PAGE_CSS: &str = include_str!("../assets/page.css");

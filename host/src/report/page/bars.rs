//! Bar charts: one row a candidate or a channel, lying, so that names stay readable.

use super::html::Html;
use super::svg::{Scale, coordinate, label, line, tick_label};
use crate::report::number::{percent, significant};

/// What a bar means to the reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tone {
    /// Nothing special.
    #[default]
    Plain,
    /// Accepted, passed, found.
    Good,
    /// Worth a look.
    Warning,
    /// Failed, out of bounds.
    Bad,
    /// Present for completeness.
    Muted,
}

impl Tone {
    pub(super) fn class(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Good => "good",
            Self::Warning => "warning",
            Self::Bad => "bad",
            Self::Muted => "muted",
        }
    }
}

/// One row of a bar chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Bar {
    label: String,
    value: f64,
    interval: Option<(f64, f64)>,
    tone: Tone,
}

impl Bar {
    /// A bar of that length.
    pub fn new(label: impl Into<String>, value: f64) -> Self {
        Self { label: label.into(), value, interval: None, tone: Tone::Plain }
    }

    /// The interval of the value, drawn as a whisker.
    #[must_use]
    pub fn interval(mut self, low: f64, high: f64) -> Self {
        self.interval = Some((low, high));
        self
    }

    /// What the bar means.
    #[must_use]
    pub fn tone(mut self, tone: Tone) -> Self {
        self.tone = tone;
        self
    }
}

/// Lying bars from zero (or from the left edge on a scale by decades), with an optional threshold.
#[derive(Debug, Clone, PartialEq)]
pub struct BarChart {
    x_label: String,
    bars: Vec<Bar>,
    threshold: Option<(f64, String)>,
    logarithmic: bool,
    shares: bool,
    caption: String,
}

impl BarChart {
    /// An empty chart; the label is of the form `quantity (unit)`.
    pub fn new(x_label: impl Into<String>) -> Self {
        Self {
            x_label: x_label.into(),
            bars: Vec::new(),
            threshold: None,
            logarithmic: false,
            shares: false,
            caption: String::new(),
        }
    }

    /// Adds a row.
    #[must_use]
    pub fn bar(mut self, bar: Bar) -> Self {
        self.bars.push(bar);
        self
    }

    /// Adds rows.
    #[must_use]
    pub fn bars(mut self, bars: impl IntoIterator<Item = Bar>) -> Self {
        self.bars.extend(bars);
        self
    }

    /// A dashed line across all rows with its name.
    #[must_use]
    pub fn threshold(mut self, value: f64, name: impl Into<String>) -> Self {
        self.threshold = Some((value, name.into()));
        self
    }

    /// Scale by decades, for scores that span several; values of zero or less have no bar.
    #[must_use]
    pub fn by_decades(mut self) -> Self {
        self.logarithmic = true;
        self
    }

    /// Values beside the bars in per cent.
    #[must_use]
    pub fn in_percent(mut self) -> Self {
        self.shares = true;
        self
    }

    /// A sentence below the chart.
    #[must_use]
    pub fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    pub(super) fn caption_text(&self) -> &str {
        &self.caption
    }

    fn scale(&self, layout: &Layout) -> Scale {
        let (left, right) = (layout.left, layout.right);
        let values = || {
            let ends = self.bars.iter().flat_map(|b| {
                let (low, high) = b.interval.unwrap_or((b.value, b.value));
                [b.value, low, high]
            });
            ends.chain(self.threshold.as_ref().map(|t| t.0)).filter(|v| v.is_finite())
        };
        let high = values().fold(f64::NEG_INFINITY, f64::max);
        if self.logarithmic {
            let low = values().filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min);
            if low.is_finite() && high > 0.0 {
                // From the decade below the least value, so that its bar still has a length.
                let first = 10f64.powf((low.log10() - 1e-9).floor());
                return Scale::logarithmic(first, high.max(first * 10.0) * 1.1, left, right);
            }
        }
        let low = values().fold(0.0, f64::min);
        let high = high.max(0.0);
        let room = 0.04 * (high - low);
        Scale::linear(if low < 0.0 { low - room } else { 0.0 }, if high > 0.0 { high + room } else { 0.0 }, left, right)
    }

    /// The chart twice: names beside the bars for a wide page, above them for a phone. The style sheet shows one.
    pub(super) fn write(&self, h: &mut Html) {
        self.write_as(h, &WIDE);
        self.write_as(h, &NARROW);
    }

    fn write_as(&self, h: &mut Html, layout: &Layout) {
        let scale = self.scale(layout);
        let top = if self.threshold.is_some() { TOP } else { TOP_WITHOUT };
        let bottom = top + layout.row * self.bars.len() as f64;
        let height = bottom + 44.0;
        h.element(
            "svg",
            &[
                ("class", layout.class),
                ("viewBox", &format!("0 0 {} {height}", layout.width)),
                ("role", "img"),
                ("aria-label", &self.x_label),
            ],
            |h| {
                let ticks = scale.ticks(layout.ticks);
                for &tick in ticks.iter().step_by(ticks.len().div_ceil(2 * layout.ticks).max(1)) {
                    let x = scale.px(tick);
                    line(h, if tick == 0.0 { "zero" } else { "grid" }, (x, top), (x, bottom));
                    label(h, "tick", "middle", (x, bottom + 16.0), &tick_label(tick));
                }
                for (row, bar) in self.bars.iter().enumerate() {
                    self.write_row(h, (layout, &scale), bar, top + layout.row * row as f64);
                }
                if let Some((value, name)) = &self.threshold {
                    let x = scale.px(*value);
                    line(h, "threshold", (x, top - 6.0), (x, bottom));
                    let anchor = if x > 0.6 * layout.width { "end" } else { "start" };
                    label(h, "threshold-label", anchor, (x, top - 10.0), name);
                }
                label(h, "axis", "middle", (layout.middle, bottom + 36.0), &self.x_label);
            },
        );
    }

    fn write_row(&self, h: &mut Html, (layout, scale): (&Layout, &Scale), bar: &Bar, top: f64) {
        let from = top + layout.name;
        let middle = (from + top + layout.row) / 2.0;
        if layout.name > 0.0 {
            label(h, "row", "start", (layout.left, from - 3.0), &bar.label);
        } else {
            label(h, "row", "end", (layout.left - 8.0, middle + 4.5), &bar.label);
        }
        let zero = if self.logarithmic { layout.left } else { scale.px(0.0) };
        let end = if bar.value.is_finite() { scale.px(bar.value) } else { zero };
        h.element(
            "rect",
            &[
                ("class", &format!("bar {}", bar.tone.class())),
                ("x", &coordinate(zero.min(end))),
                ("y", &coordinate(from + 3.0)),
                ("width", &coordinate((end - zero).abs())),
                ("height", &coordinate(layout.row - layout.name - 6.0)),
            ],
            |_| {},
        );
        if let Some((low, high)) = bar.interval.filter(|(low, high)| low.is_finite() && high.is_finite()) {
            let (a, b) = (scale.px(low), scale.px(high));
            line(h, "whisker", (a, middle), (b, middle));
            for x in [a, b] {
                line(h, "whisker", (x, middle - 4.0), (x, middle + 4.0));
            }
        }
        let value = if self.shares { percent(bar.value) } else { significant(bar.value, 3) };
        label(h, "value", "start", (layout.right + 8.0, middle + 4.5), &value);
    }
}

/// Where things are in a drawing, in pixels, which the page scales to its width.
struct Layout {
    class: &'static str,
    width: f64,
    /// Ends of the scale.
    left: f64,
    right: f64,
    /// Middle of the label below the scale.
    middle: f64,
    /// Height of a row.
    row: f64,
    /// Height of the name above the bar; zero where it stands beside the bar.
    name: f64,
    /// About so many ticks, and at most twice as many.
    ticks: usize,
}

const WIDE: Layout = Layout {
    class: "chart wide",
    width: 960.0,
    left: 250.0,
    right: 870.0,
    middle: 560.0,
    row: 22.0,
    name: 0.0,
    ticks: 6,
};
const NARROW: Layout = Layout {
    class: "chart narrow",
    width: 362.0,
    left: 14.0,
    right: 296.0,
    middle: 181.0,
    row: 36.0,
    name: 16.0,
    ticks: 4,
};
/// Room above the bars: for the threshold's name, where there is one.
const TOP: f64 = 26.0;
const TOP_WITHOUT: f64 = 6.0;

#[cfg(test)]
mod tests {
    use super::*;

    fn svg(chart: &BarChart) -> String {
        let mut h = Html::new();
        chart.write(&mut h);
        h.into_string()
    }

    #[test]
    fn scores_by_decades_with_a_threshold() {
        let chart = BarChart::new("score")
            .bar(Bar::new("base_bearing", 13_456.0).tone(Tone::Good))
            .bar(Bar::new("<none>", 0.0))
            .threshold(25.0, "1 in 1000")
            .by_decades();
        let text = svg(&chart);
        assert!(text.contains("&lt;none&gt;"));
        assert!(text.contains("1 in 1000"));
        assert!(text.contains(">1.35·10⁴<") || text.contains(">13456<"), "{text}");
        assert!(text.contains("class=\"bar good\""));
    }

    #[test]
    fn a_chart_of_nothing_and_of_nan_is_still_a_chart() {
        assert!(svg(&BarChart::new("x")).contains("</svg>"));
        let text = svg(&BarChart::new("x").bar(Bar::new("a", f64::NAN)).by_decades());
        assert!(!text.contains("NaN"), "{text}");
        let text = svg(&BarChart::new("x").bar(Bar::new("a", 0.3).interval(f64::NAN, 0.4)).in_percent());
        assert!(!text.contains("NaN") && text.contains(">30 %<"), "{text}");
    }
}

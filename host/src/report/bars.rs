//! Bar charts: one row a candidate or a channel, lying, so that names stay readable.

use super::html::Html;
use super::number::significant;
use super::svg::{Scale, coordinate, label, line, tick_label};

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
    caption: String,
}

impl BarChart {
    /// An empty chart; the label is of the form `quantity (unit)`.
    pub fn new(x_label: impl Into<String>) -> Self {
        Self { x_label: x_label.into(), bars: Vec::new(), threshold: None, logarithmic: false, caption: String::new() }
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

    /// A sentence below the chart.
    #[must_use]
    pub fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    pub(super) fn caption_text(&self) -> &str {
        &self.caption
    }

    fn scale(&self) -> Scale {
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
                return Scale::logarithmic(first, high.max(first * 10.0) * 1.1, BAR_LEFT, BAR_RIGHT);
            }
        }
        let low = values().fold(0.0, f64::min);
        let high = high.max(0.0);
        let room = 0.04 * (high - low);
        Scale::linear(
            if low < 0.0 { low - room } else { 0.0 },
            if high > 0.0 { high + room } else { 0.0 },
            BAR_LEFT,
            BAR_RIGHT,
        )
    }

    pub(super) fn write(&self, h: &mut Html) {
        let scale = self.scale();
        let bottom = TOP + ROW * self.bars.len() as f64;
        let height = bottom + 44.0;
        h.element(
            "svg",
            &[
                ("class", "chart"),
                ("viewBox", &format!("0 0 {WIDTH} {height}")),
                ("role", "img"),
                ("aria-label", &self.x_label),
            ],
            |h| {
                for tick in scale.ticks(6) {
                    let x = scale.px(tick);
                    line(h, "grid", (x, TOP), (x, bottom));
                    label(h, "tick", "middle", (x, bottom + 16.0), &tick_label(tick));
                }
                for (row, bar) in self.bars.iter().enumerate() {
                    self.write_row(h, &scale, bar, TOP + ROW * row as f64);
                }
                if let Some((value, name)) = &self.threshold {
                    let x = scale.px(*value);
                    line(h, "threshold", (x, TOP - 6.0), (x, bottom));
                    let anchor = if x > 0.75 * WIDTH { "end" } else { "start" };
                    label(h, "threshold-label", anchor, (x, TOP - 10.0), name);
                }
                let middle = (BAR_LEFT + BAR_RIGHT) / 2.0;
                label(h, "axis", "middle", (middle, bottom + 36.0), &self.x_label);
            },
        );
    }

    fn write_row(&self, h: &mut Html, scale: &Scale, bar: &Bar, top: f64) {
        let middle = top + ROW / 2.0;
        label(h, "row", "end", (BAR_LEFT - 8.0, middle + 4.5), &bar.label);
        let zero = if self.logarithmic { BAR_LEFT } else { scale.px(0.0) };
        let end = if bar.value.is_finite() { scale.px(bar.value) } else { zero };
        h.element(
            "rect",
            &[
                ("class", &format!("bar {}", bar.tone.class())),
                ("x", &coordinate(zero.min(end))),
                ("y", &coordinate(top + 3.0)),
                ("width", &coordinate((end - zero).abs())),
                ("height", &coordinate(ROW - 6.0)),
            ],
            |_| {},
        );
        if let Some((low, high)) = bar.interval {
            let (a, b) = (scale.px(low), scale.px(high));
            line(h, "whisker", (a, middle), (b, middle));
            for x in [a, b] {
                line(h, "whisker", (x, middle - 4.0), (x, middle + 4.0));
            }
        }
        label(h, "value", "start", (BAR_RIGHT + 8.0, middle + 4.5), &significant(bar.value, 3));
    }
}

/// Pixels of the drawing, which the page scales to its width.
const WIDTH: f64 = 960.0;
const BAR_LEFT: f64 = 250.0;
const BAR_RIGHT: f64 = 870.0;
const TOP: f64 = 26.0;
const ROW: f64 = 22.0;

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
    }
}

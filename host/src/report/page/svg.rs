//! What the SVG charts share: a scale with round ticks, and text that needs no measuring.

use super::html::Html;
use crate::report::number::significant;

/// Maps values to pixels, linearly or by decades.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    low: f64,
    high: f64,
    from_px: f64,
    to_px: f64,
    logarithmic: bool,
}

impl Scale {
    /// `low` becomes `from_px`, `high` becomes `to_px`. An empty range is opened by one unit around its value.
    pub(super) fn linear(low: f64, high: f64, from_px: f64, to_px: f64) -> Self {
        let (low, high) = if low < high { (low, high) } else { (low - 0.5, low + 0.5) };
        Self { low, high, from_px, to_px, logarithmic: false }
    }

    /// By decades; both ends must be positive, `low` less than `high`.
    pub(super) fn logarithmic(low: f64, high: f64, from_px: f64, to_px: f64) -> Self {
        Self { low, high, from_px, to_px, logarithmic: true }
    }

    /// Pixel of a value; what lies outside is drawn at the edge.
    pub(super) fn px(&self, value: f64) -> f64 {
        let share = if self.logarithmic {
            (value.max(self.low).ln() - self.low.ln()) / (self.high.ln() - self.low.ln())
        } else {
            (value - self.low) / (self.high - self.low)
        };
        self.from_px + share.clamp(0.0, 1.0) * (self.to_px - self.from_px)
    }

    /// About `count` round values within the range (all decades when logarithmic).
    pub(super) fn ticks(&self, count: usize) -> Vec<f64> {
        if self.logarithmic {
            let first = self.low.log10().ceil() as i32;
            let last = self.high.log10().floor() as i32;
            return (first..=last).map(|e| 10f64.powi(e)).collect();
        }
        let raw = (self.high - self.low) / count.max(1) as f64;
        let decade = 10f64.powf(raw.log10().floor());
        let step =
            [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * decade).find(|step| *step >= raw * 0.999).unwrap_or(raw);
        let first = (self.low / step).ceil() as i64;
        let last = (self.high / step).floor() as i64;
        (first..=last).map(|i| i as f64 * step).collect()
    }
}

/// A tick's label, without the tail of zeros that a fixed number of digits would leave.
pub(super) fn tick_label(value: f64) -> String {
    let text = significant(value, 6);
    match text.split_once('·') {
        Some((mantissa, power)) => format!("{}·{power}", trimmed(mantissa)),
        None => trimmed(&text).to_owned(),
    }
}

fn trimmed(number: &str) -> &str {
    if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { number }
}

/// A pixel coordinate, to a tenth.
pub(super) fn coordinate(px: f64) -> String {
    format!("{px:.1}")
}

/// A straight line of a style class.
pub(super) fn line(h: &mut Html, class: &str, from: (f64, f64), to: (f64, f64)) {
    h.element(
        "line",
        &[
            ("class", class),
            ("x1", &coordinate(from.0)),
            ("y1", &coordinate(from.1)),
            ("x2", &coordinate(to.0)),
            ("y2", &coordinate(to.1)),
        ],
        |_| {},
    );
}

/// Text of a style class whose anchor (`start`, `middle`, `end`) is at the point.
pub(super) fn label(h: &mut Html, class: &str, anchor: &str, at: (f64, f64), text: &str) {
    h.text_element(
        "text",
        &[("class", class), ("text-anchor", anchor), ("x", &coordinate(at.0)), ("y", &coordinate(at.1))],
        text,
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let ticks = Scale::linear(-0.013, 0.27, 0.0, 100.0).ticks(6);
        let labels: Vec<String> = ticks.iter().map(|t| tick_label(*t)).collect();
        assert_eq!(labels, ["0", "0.05", "0.1", "0.15", "0.2", "0.25"]);
        let decades = Scale::logarithmic(0.5, 2e4, 0.0, 1.0).ticks(5);
        assert_eq!(decades, [1.0, 10.0, 100.0, 1e3, 1e4]);
        assert_eq!(tick_label(2e6), "2·10⁶");
    }

    #[test]
    fn a_scale_keeps_to_its_pixels() {
        let scale = Scale::linear(1.0, 1.0, 10.0, 20.0);
        assert_eq!(scale.px(1.0), 15.0);
        assert_eq!(scale.px(99.0), 20.0);
        let log = Scale::logarithmic(1.0, 100.0, 0.0, 10.0);
        assert!((log.px(10.0) - 5.0).abs() < 1e-12);
        assert_eq!(log.px(-3.0), 0.0);
    }
}

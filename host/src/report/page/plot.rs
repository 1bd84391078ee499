//! Line plots over a common abscissa: several overlaid series, an overview and a zoom window beside it.
//!
//! A plot borrows its series and is reduced when it is added to a page: the samples that [`decimate`] keeps, each value
//! as a 16-bit step of its series' range (65,534 steps between the least and the greatest value; a screen has a few
//! hundred), base64 of little-endian words. The page's script decodes them and draws with uPlot.
//!
//! ```text
//!   x: x0 + f32[i]        y: low + step·(i16[i] + 32767), −32768 = no value
//! ```

use std::ops::Range;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;

use super::decimate::decimate;

/// Points that an overview keeps, about: three or four for each pixel of its width.
pub const DEFAULT_BUDGET: usize = 3000;

/// The least height of a plot; below it the curves of three axes run into one another.
const MIN_HEIGHT_PX: u32 = 180;

/// Which of the page's colours a series has. Axes 1, 2, 3 (and x, y, z) are red, green, blue; later axes follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colour {
    /// The colour of a joint or of a sensor's axis, counted from 0.
    Axis(usize),
    /// The colour of text, for what belongs to no axis.
    Neutral,
    /// What a model says before something was added to it.
    Before,
    /// What it says after.
    After,
}

/// How many colours the style sheet has for axes; further axes start again.
const AXIS_COLOURS: usize = 7;

impl Colour {
    /// The custom property of the style sheet.
    pub(super) fn variable(self) -> String {
        match self {
            Self::Axis(i) => format!("--axis-{}", i % AXIS_COLOURS + 1),
            Self::Neutral => "--ink".into(),
            Self::Before => "--before".into(),
            Self::After => "--after".into(),
        }
    }
}

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Stroke {
    /// Wide and pale, below the others: what was measured.
    Measured,
    /// Thin and full: what the model says, or a single curve.
    Line,
    /// Thin and full, each value held until the next: a duty.
    Held,
}

/// One curve of a plot.
#[derive(Debug, Clone)]
pub struct Series<'a> {
    label: String,
    colour: Colour,
    stroke: Stroke,
    values: &'a [f64],
}

impl<'a> Series<'a> {
    /// What was measured.
    pub fn measured(label: impl Into<String>, colour: Colour, values: &'a [f64]) -> Self {
        Self::new(label, colour, Stroke::Measured, values)
    }

    /// What the model says.
    pub fn line(label: impl Into<String>, colour: Colour, values: &'a [f64]) -> Self {
        Self::new(label, colour, Stroke::Line, values)
    }

    /// A quantity held from each sample to the next.
    pub fn held(label: impl Into<String>, colour: Colour, values: &'a [f64]) -> Self {
        Self::new(label, colour, Stroke::Held, values)
    }

    fn new(label: impl Into<String>, colour: Colour, stroke: Stroke, values: &'a [f64]) -> Self {
        Self { label: label.into(), colour, stroke, values }
    }
}

/// A line plot, borrowed from the data it shows.
#[derive(Debug, Clone)]
pub struct LinePlot<'a> {
    x: &'a [f64],
    x_label: String,
    y_label: String,
    series: Vec<Series<'a>>,
    zoom: Option<Range<f64>>,
    bands: Vec<Band>,
    group: Option<String>,
    zero_line: bool,
    height_px: u32,
    budget: usize,
    caption: String,
}

impl<'a> LinePlot<'a> {
    /// A plot over `x`, which ascends; the labels are of the form `quantity (unit)`. A NaN in a series is a gap.
    pub fn new(x: &'a [f64], x_label: impl Into<String>, y_label: impl Into<String>) -> Self {
        Self {
            x,
            x_label: x_label.into(),
            y_label: y_label.into(),
            series: Vec::new(),
            zoom: None,
            bands: Vec::new(),
            group: None,
            zero_line: false,
            height_px: 220,
            budget: DEFAULT_BUDGET,
            caption: String::new(),
        }
    }

    /// Adds a curve of the same length as `x`.
    #[must_use]
    pub fn series(mut self, series: Series<'a>) -> Self {
        self.series.push(series);
        self
    }

    /// Draws this range of `x` a second time beside the overview, every sample of it.
    #[must_use]
    pub fn zoom(mut self, range: Range<f64>) -> Self {
        self.zoom = Some(range);
        self
    }

    /// Names a range of `x` by a band behind the curves.
    #[must_use]
    pub fn band(mut self, range: Range<f64>, label: impl Into<String>) -> Self {
        self.bands.push(Band { from: range.start, to: range.end, label: label.into() });
        self
    }

    /// Plots of one group share the cursor and the range of `x` that the reader zooms to.
    #[must_use]
    pub fn group(mut self, name: impl Into<String>) -> Self {
        self.group = Some(name.into());
        self
    }

    /// Draws the line of zero where the range holds it.
    #[must_use]
    pub fn zero_line(mut self) -> Self {
        self.zero_line = true;
        self
    }

    /// Height of the drawing without its legend; at least 180 px.
    #[must_use]
    pub fn height_px(mut self, height: u32) -> Self {
        self.height_px = height.max(MIN_HEIGHT_PX);
        self
    }

    /// About how many points the overview keeps.
    #[must_use]
    pub fn budget(mut self, points: usize) -> Self {
        self.budget = points;
        self
    }

    /// A sentence below the plot.
    #[must_use]
    pub fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    /// Chooses the samples and encodes them.
    pub(super) fn reduce(mut self) -> PlotData {
        // What was measured lies below what is compared with it.
        self.series.sort_by_key(|s| u8::from(s.stroke != Stroke::Measured));
        let window = self
            .zoom
            .as_ref()
            .map(|zoom| self.x.partition_point(|&x| x < zoom.start)..self.x.partition_point(|&x| x <= zoom.end));
        let values: Vec<&[f64]> = self.series.iter().map(|s| s.values).collect();
        let kept = decimate(&values, self.budget, window.as_slice());
        let x0 = self.x.first().copied().unwrap_or(0.0);
        PlotData {
            x0,
            x: encode(kept.iter().map(|&k| (self.x[k] - x0) as f32), f32::to_le_bytes),
            series: self.series.iter().map(|s| quantise(s, &kept)).collect(),
            x_label: self.x_label,
            y_label: self.y_label,
            zoom: self.zoom.filter(|_| window.is_some_and(|w| w.len() > 1)).map(|z| [z.start, z.end]),
            bands: self.bands,
            group: self.group,
            zero: self.zero_line,
            height: self.height_px,
            caption: self.caption,
        }
    }
}

/// What the page carries of a plot; the script's side of it is `page.js`.
#[derive(Debug, Clone, Serialize)]
pub(super) struct PlotData {
    x0: f64,
    x: String,
    pub(super) series: Vec<SeriesData>,
    x_label: String,
    pub(super) y_label: String,
    pub(super) zoom: Option<[f64; 2]>,
    bands: Vec<Band>,
    group: Option<String>,
    zero: bool,
    height: u32,
    #[serde(skip)]
    pub(super) caption: String,
}

#[derive(Debug, Clone, Serialize)]
struct Band {
    from: f64,
    to: f64,
    label: String,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct SeriesData {
    pub(super) label: String,
    colour: String,
    stroke: Stroke,
    low: f64,
    step: f64,
    data: String,
}

/// The code that stands for "no value".
const MISSING: i16 = i16::MIN;
/// Steps between the least and the greatest value.
const STEPS: f64 = 65_534.0;

fn quantise(series: &Series<'_>, kept: &[usize]) -> SeriesData {
    let finite = || kept.iter().map(|&k| series.values[k]).filter(|v| v.is_finite());
    let low = finite().fold(f64::INFINITY, f64::min);
    let high = finite().fold(f64::NEG_INFINITY, f64::max);
    let (low, high) = if low <= high { (low, high) } else { (0.0, 0.0) };
    let step = (high - low) / STEPS;
    let code = |v: f64| -> i16 {
        if !v.is_finite() {
            MISSING
        } else if step > 0.0 {
            (((v - low) / step).round() - 32_767.0) as i16
        } else {
            -i16::MAX
        }
    };
    SeriesData {
        label: series.label.clone(),
        colour: series.colour.variable(),
        stroke: series.stroke,
        low,
        step,
        data: encode(kept.iter().map(|&k| code(series.values[k])), i16::to_le_bytes),
    }
}

fn encode<T, const N: usize>(values: impl Iterator<Item = T>, bytes: fn(T) -> [u8; N]) -> String {
    STANDARD.encode(values.flat_map(bytes).collect::<Vec<u8>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode_series(data: &SeriesData) -> Vec<f64> {
        STANDARD
            .decode(&data.data)
            .unwrap()
            .chunks_exact(2)
            .map(|b| match i16::from_le_bytes([b[0], b[1]]) {
                MISSING => f64::NAN,
                code => data.low + data.step * (f64::from(code) + 32_767.0),
            })
            .collect()
    }

    #[test]
    fn values_survive_to_a_step_of_their_range() {
        let x: Vec<f64> = (0..2000).map(|k| 10.0 + f64::from(k) * 1e-3).collect();
        let mut y: Vec<f64> = x.iter().map(|x| 3.0 * (7.0 * x).sin() - 1.0).collect();
        y[700] = f64::NAN;
        let constant = vec![0.25; 2000];
        let plot = LinePlot::new(&x, "time (s)", "rate (rad/s)")
            .series(Series::line("a", Colour::Axis(0), &y))
            .series(Series::measured("c", Colour::Axis(1), &constant))
            .reduce();
        assert_eq!(plot.series[0].label, "c", "measured is drawn first");
        assert!(decode_series(&plot.series[0]).iter().all(|v| *v == 0.25));
        let back = decode_series(&plot.series[1]);
        assert_eq!(back.len(), 2000);
        for (k, (a, b)) in y.iter().zip(&back).enumerate() {
            // atol: half a step of the range 6/65534.
            assert!((a - b).abs() <= 4.6e-5 || (k == 700 && b.is_nan()), "{k}: {a} {b}");
        }
        let xs = STANDARD.decode(&plot.x).unwrap();
        let last = f32::from_le_bytes(xs[xs.len() - 4..].try_into().unwrap());
        assert!((plot.x0 + f64::from(last) - x[1999]).abs() < 1e-6);
    }

    #[test]
    fn a_zoom_outside_the_data_is_dropped() {
        let x = [0.0, 1.0, 2.0];
        let plot = LinePlot::new(&x, "t", "y")
            .series(Series::line("a", Colour::Neutral, &x))
            .zoom(5.0..6.0)
            .height_px(20)
            .reduce();
        assert!(plot.zoom.is_none());
        assert_eq!(plot.height, MIN_HEIGHT_PX);
    }
}

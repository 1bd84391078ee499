//! A cloud of points with curves through it: a defect against its argument, an error against a parameter.

use std::collections::HashSet;

use super::html::Html;
use super::plot::Colour;
use super::svg::{Scale, coordinate, label, line, tick_label};

/// Points over an axis, and curves through them.
#[derive(Debug, Clone, PartialEq)]
pub struct Scatter {
    x_label: String,
    y_label: String,
    clouds: Vec<Layer>,
    curves: Vec<Layer>,
    caption: String,
}

#[derive(Debug, Clone, PartialEq)]
struct Layer {
    name: String,
    colour: Colour,
    points: Vec<(f64, f64)>,
}

impl Scatter {
    /// An empty drawing; labels are of the form `quantity (unit)`.
    pub fn new(x_label: impl Into<String>, y_label: impl Into<String>) -> Self {
        Self {
            x_label: x_label.into(),
            y_label: y_label.into(),
            clouds: Vec::new(),
            curves: Vec::new(),
            caption: String::new(),
        }
    }

    /// Adds points. Those that would cover one another on the page are drawn once; points that are not finite are left out.
    #[must_use]
    pub fn cloud(
        mut self,
        name: impl Into<String>,
        colour: Colour,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        self.clouds.push(Layer::new(name, colour, points));
        self
    }

    /// Adds a curve through the points in their order.
    #[must_use]
    pub fn curve(
        mut self,
        name: impl Into<String>,
        colour: Colour,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        self.curves.push(Layer::new(name, colour, points));
        self
    }

    /// A sentence below the drawing.
    #[must_use]
    pub fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    pub(super) fn caption_text(&self) -> &str {
        &self.caption
    }

    pub(super) fn write(&self, h: &mut Html) {
        let all = || {
            let layers = self.clouds.iter().chain(&self.curves);
            layers.flat_map(|l| l.points.iter().copied())
        };
        let x = spread(all().map(|p| p.0), LEFT, RIGHT);
        let y = spread(all().map(|p| p.1), BOTTOM, TOP);
        h.element(
            "svg",
            &[
                ("class", "chart"),
                ("viewBox", &format!("0 0 {WIDTH} {HEIGHT}")),
                ("role", "img"),
                ("aria-label", &format!("{} over {}", self.y_label, self.x_label)),
            ],
            |h| {
                for tick in x.ticks(8) {
                    let px = x.px(tick);
                    line(h, if tick == 0.0 { "zero" } else { "grid" }, (px, TOP), (px, BOTTOM));
                    label(h, "tick", "middle", (px, BOTTOM + 18.0), &tick_label(tick));
                }
                for tick in y.ticks(6) {
                    let px = y.px(tick);
                    line(h, if tick == 0.0 { "zero" } else { "grid" }, (LEFT, px), (RIGHT, px));
                    label(h, "tick", "end", (LEFT - 8.0, px + 4.0), &tick_label(tick));
                }
                for cloud in &self.clouds {
                    path(h, "cloud", cloud.colour, &cloud.dots(&x, &y));
                }
                for curve in &self.curves {
                    path(h, "curve", curve.colour, &curve.trace(&x, &y));
                }
                self.write_labels(h);
            },
        );
    }

    fn write_labels(&self, h: &mut Html) {
        label(h, "axis", "middle", ((LEFT + RIGHT) / 2.0, HEIGHT - 8.0), &self.x_label);
        label(h, "axis", "start", (8.0, TOP - 14.0), &self.y_label);
        let mut right = RIGHT;
        for (layer, class) in self.curves.iter().map(|l| (l, "curve")).chain(self.clouds.iter().map(|l| (l, "cloud"))) {
            // The width of a glyph is about 7 px at this size; exactness does not matter in a legend.
            let width = 7.0 * layer.name.chars().count() as f64;
            label(h, "legend", "end", (right, TOP - 14.0), &layer.name);
            let mark = right - width - 30.0;
            let d = if class == "curve" {
                format!("M{} {}h22", coordinate(mark), TOP - 18.0)
            } else {
                format!("M{} {}h0m8 3h0m8 -6h0", coordinate(mark + 3.0), TOP - 18.0)
            };
            path(h, class, layer.colour, &d);
            right = mark - 18.0;
        }
    }
}

impl Layer {
    fn new(name: impl Into<String>, colour: Colour, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let points = points.into_iter().filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
        Self { name: name.into(), colour, points }
    }

    /// One dot (a line of no length with round ends) for each 1.5 px cell that holds a point.
    fn dots(&self, x: &Scale, y: &Scale) -> String {
        let mut taken = HashSet::new();
        let mut d = String::new();
        for &(px, py) in &self.points {
            let (cx, cy) = (x.px(px), y.px(py));
            if taken.insert(((cx / 1.5) as i32, (cy / 1.5) as i32)) {
                d.push_str(&format!("M{cx:.1} {cy:.1}h0"));
            }
        }
        d
    }

    fn trace(&self, x: &Scale, y: &Scale) -> String {
        let mut d = String::new();
        for (i, &(px, py)) in self.points.iter().enumerate() {
            let command = if i == 0 { 'M' } else { 'L' };
            d.push_str(&format!("{command}{:.1} {:.1}", x.px(px), y.px(py)));
        }
        d
    }
}

fn path(h: &mut Html, class: &str, colour: Colour, d: &str) {
    let style = format!("stroke:var({})", colour.variable());
    h.element("path", &[("class", class), ("style", &style), ("d", d)], |_| {});
}

/// A scale over the values with a little room at both ends.
fn spread(values: impl Iterator<Item = f64>, from_px: f64, to_px: f64) -> Scale {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if low > high {
        return Scale::linear(0.0, 1.0, from_px, to_px);
    }
    let room = 0.03 * (high - low);
    Scale::linear(low - room, high + room, from_px, to_px)
}

const WIDTH: f64 = 960.0;
const HEIGHT: f64 = 360.0;
const LEFT: f64 = 80.0;
const RIGHT: f64 = 940.0;
const TOP: f64 = 40.0;
const BOTTOM: f64 = 300.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_cover_one_another_are_drawn_once() {
        let points = (0..100_000).map(|k| (f64::from(k % 100), f64::from(k % 100)));
        let scatter = Scatter::new("speed (rad/s)", "torque (N m)")
            .cloud("defect", Colour::Axis(1), points.chain([(f64::NAN, 1.0)]))
            .curve("<law>", Colour::Neutral, [(0.0, 0.0), (99.0, 99.0)]);
        let mut h = Html::new();
        scatter.write(&mut h);
        let text = h.into_string();
        assert_eq!(text.matches("h0").count(), 100 + 3, "a hundred dots, three in the legend");
        assert!(text.contains("&lt;law&gt;"));
        assert!(!text.contains("NaN"));
    }

    #[test]
    fn an_empty_drawing_still_has_axes() {
        let mut h = Html::new();
        Scatter::new("x", "y").write(&mut h);
        assert!(h.into_string().contains("class=\"tick\""));
    }
}

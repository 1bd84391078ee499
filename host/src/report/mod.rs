//! Self-contained HTML pages from results. No arithmetic that a result does not already hold.
//!
//! One file that opens anywhere, next year too: style, script ([uPlot](https://github.com/leeoniya/uPlot) 1.6.32, MIT)
//! and data are inside, and a content security policy forbids the browser to load anything. A [`Page`] holds
//! [`Section`]s of prose, [`Table`]s, line plots ([`LinePlot`]), bar charts ([`BarChart`]) and scatters ([`Scatter`]).
//! All text is escaped where it is written, see [`html`].
//!
//! ```
//! use host::report::{Colour, LinePlot, Page, Section, Series};
//! let (t, measured, predicted) = ([0.0, 0.1, 0.2], [0.0, 0.2, 0.1], [0.0, 0.19, 0.12]);
//! let mut section = Section::new("Free run");
//! section.plot(
//!     "Motor angle",
//!     LinePlot::new(&t, "time (s)", "angle (rad)")
//!         .series(Series::measured("yaw measured", Colour::Axis(0), &measured))
//!         .series(Series::line("yaw predicted", Colour::Axis(0), &predicted)),
//! );
//! let mut page = Page::new("Verification").lead("The model predicts the recording.");
//! page.push(section);
//! assert!(page.to_html().starts_with("<!DOCTYPE html>"));
//! ```

pub mod calibration;
pub mod demo;
pub mod diagnosis;
pub mod fleet;
pub mod number;
pub mod observation;

mod check;
mod page;
mod plan;
pub mod verification;

#[cfg(test)]
mod tests;

pub use check::check_page;
pub use page::{
    Bar, BarChart, Cell, Colour, LinePlot, Page, Scatter, Section, Series, Stroke, Table, Tone, decimate, html,
};
pub use plan::plan_page;

/// A result as JSON for people and programs, a line feed at the end.
///
/// # Errors
/// What cannot be written as JSON.
pub fn json<T: serde::Serialize + ?Sized>(result: &T) -> serde_json::Result<String> {
    Ok(serde_json::to_string_pretty(result)? + "\n")
}

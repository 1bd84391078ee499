//! Outliers: lone readings far from what their neighbours say. They are left out, as if the sensor had not been read.
//!
//! A fit by squares gives a reading that is 50 σ off the weight of 2,500 sound ones. So readings are compared with the median of their
//! neighbours in time (Hampel's identifier), first as they are, to keep gross ones out of the start values, then as residuals of a fit:
//!
//! ```text
//!   d_k = r_k − median(r_{k−3} … r_{k+3})         left out:  |d_k| > 6 s      (as they are: 20 s)
//!   s   = max(σ of the channel, a third of its step, 1.48 · median |d| of the 25 samples before, and of the 25 after)
//! ```
//!
//! The median follows whatever lasts for four samples. What a wrong model leaves, however large, is such a thing: it stays, and a diagnosis
//! finds it. Where a model error rings too fast for that, the distances around are large too, and s with them. Of Gaussian noise 6 σ is
//! passed once in 10⁹ readings: a clean recording loses nothing, and nothing has to be made good for what was left out. A resting encoder
//! repeats one reading for seconds and then shows the next: that is one step, half of what is allowed.

use std::cell::OnceCell;
use std::ops::Range;

use super::pushes;
use crate::calibrate::data::series::Series;
use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::Problem;
use solve::LeastSquares;
use solve::threads::both;

/// Neighbours on either side: of seven readings three may be wrong.
const NEIGHBOURS: usize = 3;
/// Distance of a residual that is an outlier.
const FAR: f64 = 6.0;
/// Distance of a reading that is one before there is any fit. Joints turn meanwhile: the median of a fast swing is a little off.
const GROSS: f64 = 20.0;
/// Samples on either side whose distances say what is usual here.
const AROUND: usize = 25;
/// Standard deviation of Gaussian noise over its median distance from zero.
const PER_MEDIAN: f64 = 1.4826;
/// Share of a sensor's step below which no scale falls.
const STEP_SHARE: f64 = 1.0 / 3.0;
/// A channel with a larger share of them than this has another trouble than outliers: all its readings stay.
const MOST_SHARE: f64 = 0.1;

/// How often a fit is looked at, the readings as they are first.
const LOOKS: usize = 5;

/// Readings that are left out, as `(stage, channel)`, channel by channel, and measured inputs that err by far, `(stage, joint, times)`.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Outliers {
    readings: Vec<(usize, usize)>,
    inputs: Vec<(usize, usize, f64)>,
}

impl Outliers {
    /// Readings that are far off before anything is known of the motion.
    fn gross(series: &Series) -> Self {
        let columns = (0..series.channels.len()).map(|channel| column(series, channel));
        Outliers::among(series, columns.collect(), GROSS, Ends::Left)
    }

    /// Outliers of the problem's readings at a fit.
    fn at<'m>(problem: &Problem<'m>, point: &Point<'m>, threads: usize) -> Self {
        let series = problem.series;
        // Of a part of all stages.
        let half = |stages: Range<usize>| {
            let mut residuals = vec![vec![f64::NAN; stages.len()]; series.channels.len()];
            let mut scratch = problem.scratch();
            for (i, k) in stages.enumerate() {
                problem.sensor_rows(point, k, &mut scratch, false, &mut |row| {
                    if let Some(channel) = row.channel {
                        residuals[channel][i] = row.residual;
                    }
                });
            }
            residuals
        };
        let middle = series.stages() / 2;
        let (mut residuals, rest) = both(threads, || half(0..middle), || half(middle..series.stages()));
        for (channel, rest) in residuals.iter_mut().zip(rest) {
            channel.extend(rest);
        }
        Outliers { inputs: pushes::pushes(problem, point), ..Outliers::among(series, residuals, FAR, Ends::Judged) }
    }

    fn among(series: &Series, columns: Vec<Vec<f64>>, far: f64, ends: Ends) -> Self {
        let mut readings = Vec::new();
        for (channel, (spec, values)) in series.channels.iter().zip(&columns).enumerate() {
            let least = spec.sigma.max(STEP_SHARE * step(&column(series, channel)));
            let before = readings.len();
            for run in &series.segments {
                let found = far_off(&values[run.clone()], far, least, ends);
                readings.extend(found.into_iter().map(|k| (run.start + k, channel)));
            }
            let valid = values.iter().filter(|value| value.is_finite()).count();
            if (readings.len() - before) as f64 > MOST_SHARE * valid as f64 {
                readings.truncate(before);
            }
        }
        Outliers { readings, inputs: Vec::new() }
    }

    /// The series without them.
    fn left_out_of(&self, series: &Series) -> Series {
        let mut series = series.clone();
        for (k, channel) in &self.readings {
            series.replace(*k, *channel, f64::NAN);
        }
        series.spread_inputs(&self.inputs);
        series
    }

    /// How many every channel has.
    pub fn by_channel(&self, channels: usize) -> Vec<usize> {
        let mut counts = vec![0; channels];
        for (_, channel) in &self.readings {
            counts[*channel] += 1;
        }
        counts
    }
}

/// A series, and what every look for outliers left of it.
pub(crate) struct Screened {
    all: Series,
    /// Whether outliers are looked for.
    judged: bool,
    looks: [OnceCell<(Outliers, Series)>; LOOKS],
}

impl Screened {
    /// `all`, without gross outliers if outliers are looked for.
    pub fn new(all: Series, judged: bool) -> Self {
        let screened = Screened { all, judged, looks: Default::default() };
        if judged {
            screened.leave_out(Outliers::gross(&screened.all));
        }
        screened
    }

    /// What the last look left.
    pub fn series(&self) -> &Series {
        self.last().map_or(&self.all, |(_, series)| series)
    }

    /// How many readings of every channel the last look left out.
    pub fn left_out(&self) -> Vec<usize> {
        let channels = self.all.channels.len();
        self.last().map_or_else(|| vec![0; channels], |(outliers, _)| outliers.by_channel(channels))
    }

    /// Looks at all readings at a fit to what the last look left. If other ones are outliers now, `problem` goes on without those.
    pub fn look<'m>(&'m self, problem: &mut Problem<'m>, point: &Point<'m>, threads: usize) -> bool {
        if !self.judged {
            return false;
        }
        problem.series = &self.all;
        let changed = self.leave_out(Outliers::at(problem, point, threads));
        problem.series = self.series();
        changed
    }

    /// Whether these are others than before, and there is room for another series.
    fn leave_out(&self, outliers: Outliers) -> bool {
        let same = self.last().map_or(outliers == Outliers::default(), |(before, _)| *before == outliers);
        let free = self.looks.iter().find(|look| look.get().is_none());
        let Some(look) = free.filter(|_| !same) else { return false };
        tracing::debug!(readings = outliers.readings.len(), inputs = outliers.inputs.len(), "outliers");
        let series = outliers.left_out_of(&self.all);
        look.set((outliers, series)).is_ok()
    }

    fn last(&self) -> Option<&(Outliers, Series)> {
        self.looks.iter().rev().find_map(OnceCell::get)
    }
}

fn column(series: &Series, channel: usize) -> Vec<f64> {
    (0..series.stages()).map(|k| series.measured(k)[channel]).collect()
}

/// The smallest difference between readings that follow each other: the sensor's step, if it has one that matters.
fn step(values: &[f64]) -> f64 {
    let differences = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|d| *d > 0.0);
    let least = differences.fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}

/// Where in a run values are further than `far` scales from the median around them, no scale below `least`.
fn far_off(values: &[f64], far: f64, least: f64, ends: Ends) -> Vec<usize> {
    let limit = far * least;
    // A median lies between its values: what is near all of its neighbours is near it, and most readings are.
    let near = |k: usize, other: Option<usize>| {
        other.and_then(|other| values.get(other)).is_none_or(|other| (values[k] - other).abs() <= limit)
    };
    let among_its_like = |k: usize| (1..=NEIGHBOURS).all(|by| near(k, k.checked_sub(by)) && near(k, Some(k + by)));
    // Distances are asked for where something is suspicious, and there again and again.
    let mut known = vec![None; values.len()];
    let mut distance = |k: usize| *known[k].get_or_insert_with(|| (values[k] - median_around(values, k, ends)).abs());
    let usual = |range: Range<usize>, distance: &mut dyn FnMut(usize) -> f64| {
        let mut around: Vec<f64> = range.map(distance).filter(|d| d.is_finite()).collect();
        if around.is_empty() { 0.0 } else { PER_MEDIAN * median(&mut around) }
    };
    let mut unusual = |k: usize| {
        let before = usual(k.saturating_sub(AROUND)..k, &mut distance);
        let after = usual(k + 1..(k + 1 + AROUND).min(values.len()), &mut distance);
        distance(k) > far * before.max(after)
    };
    (0..values.len())
        .filter(|&k| !among_its_like(k) && (values[k] - median_around(values, k, ends)).abs() > limit && unusual(k))
        .collect()
}

/// What is done at the ends of a run and beside missing readings, where a window has no other half.
#[derive(Clone, Copy, PartialEq)]
enum Ends {
    /// Nothing: readings grow there from sample to sample, and have no median on one side.
    Left,
    /// Residuals do not; the nearest ones make the window.
    Judged,
}

/// The median of a value and its neighbours. Before any fit as many on either side: what grows evenly is its own median.
fn median_around(values: &[f64], k: usize, ends: Ends) -> f64 {
    let at = |k: Option<usize>| k.and_then(|k| values.get(k)).copied().filter(|value| value.is_finite());
    let mut near = [values[k]; 2 * NEIGHBOURS + 1];
    let mut count = 1;
    for by in 1..=NEIGHBOURS {
        let pair = [at(k.checked_sub(by)), at(Some(k + by))];
        if ends == Ends::Left && pair.iter().any(Option::is_none) {
            continue;
        }
        for value in pair.into_iter().flatten() {
            near[count] = value;
            count += 1;
        }
    }
    median(&mut near[..count])
}

/// The median (of an even number of values the upper one), not a number where there is none; their order is lost.
fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { f64::NAN } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Robot;
    use rand::{RngExt, SeedableRng, rngs::StdRng};
    use rand_distr::{Distribution, StandardNormal};

    fn noise(seed: u64, count: usize) -> Vec<f64> {
        let mut rng = StdRng::seed_from_u64(seed);
        (0..count).map(|_| StandardNormal.sample(&mut rng)).collect()
    }

    fn outliers(residuals: &[f64]) -> Vec<usize> {
        far_off(residuals, FAR, 1.0, Ends::Judged)
    }

    #[test]
    fn two_percent_of_spikes_are_found_and_nothing_else() {
        let mut rng = StdRng::seed_from_u64(1);
        let mut residuals = noise(2, 50_000);
        let spoilt: Vec<usize> = (0..residuals.len()).filter(|_| rng.random_bool(0.02)).collect();
        for &k in &spoilt {
            residuals[k] += if rng.random_bool(0.5) { 50.0 } else { -50.0 };
        }
        assert!(spoilt.windows(2).any(|pair| pair[1] == pair[0] + 1), "neighbours among them");
        assert_eq!(outliers(&residuals), spoilt);
        residuals[10] = f64::NAN;
        assert!(!outliers(&residuals).contains(&10), "a reading that is missing");
    }

    #[test]
    fn what_lasts_is_no_outlier() {
        let mut residuals = noise(3, 20_000);
        assert!(outliers(&residuals).is_empty(), "noise alone");
        for (k, r) in residuals.iter_mut().enumerate() {
            *r += match k {
                2_000..2_004 => 40.0,                                       // four samples of a blow
                4_000..5_000 => 100.0,                                      // a wrong model for a second
                6_000..7_000 => 0.5 * (k - 6_000) as f64,                   // one that grows, and jumps back
                8_000..9_047 => 300.0 * (0.06 * (k - 8_000) as f64).sin(),  // a swing at 10 Hz
                10_000..11_047 => 30.0 * (0.9 * (k - 10_000) as f64).sin(), // ringing at 140 Hz
                _ => 0.0,
            };
        }
        assert_eq!(outliers(&residuals), [0; 0]);
    }

    #[test]
    fn an_encoder_at_rest_has_none_though_it_repeats_itself() {
        // σ is that of rounding; the reading stands still and hops now and then for a sample or more.
        let mut rng = StdRng::seed_from_u64(4);
        let rounding = 12f64.sqrt();
        let residuals: Vec<f64> = (0..20_000).map(|_| if rng.random_bool(0.03) { rounding } else { 0.0 }).collect();
        assert_eq!(outliers(&residuals), [0; 0]);
    }

    #[test]
    fn a_channel_of_spikes_alone_keeps_them() {
        let robot = Robot::builtin("one_joint").unwrap();
        let series = Series::made_up(&robot, 5_000, 100);
        let channels = series.channels.len();
        let mut columns = vec![noise(5, series.stages()); channels];
        for (column, sigma) in columns.iter_mut().zip(series.channels.iter().map(|spec| spec.sigma)) {
            column.iter_mut().for_each(|value| *value *= sigma);
        }
        let mut rng = StdRng::seed_from_u64(6);
        for (channel, share) in [(1, 0.05), (2, 0.2)] {
            for value in &mut columns[channel] {
                *value += if rng.random_bool(share) { 50.0 * series.channels[channel].sigma } else { 0.0 };
            }
        }
        // Readings that are random themselves have no step.
        let counts = Outliers::among(&series, columns, FAR, Ends::Judged).by_channel(channels);
        assert_eq!((counts[0], counts[2]), (0, 0));
        assert!((200..300).contains(&counts[1]), "{counts:?}");
    }
}

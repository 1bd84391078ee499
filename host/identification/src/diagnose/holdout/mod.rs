//! What models predict of a motion that no fit has seen, asked once, after the selection.
//!
//! ```text
//!   windows of the other motion, 10, 100 and 500 ms ahead, both models from past readings only
//!   joint gain = 1 − exp(½ mean ln((mse_extended + s²) / (mse_base + s²))) over all sensors and horizons        interval: blocks drawn whole, BCa
//! ```
//! s² is what the robot file's own `unmodelled_rad_s2` lets a sensor do over the horizon: of a link that is declared free no model can be judged there.
//! A sensor counts with the logarithm of its error, as in a Gaussian predictive score with its scale estimated (Gneiting and Raftery 2007): none outweighs
//! the others for its unit or its noise, and one that gets a little worse beside others that get much better does not decide.

pub mod judge;

use crate::calibrate::{Bench, CalibrateError, Series, Trial};
use crate::diagnose::axes::is_of;
use crate::diagnose::blocks::blocks;
use crate::diagnose::criteria::{self, LEAST_BLOCK, SAMPLES};
use crate::diagnose::interval::{Gain, bca};
use crate::diagnose::refit::samples_for;
use crate::diagnose::result::{ChannelGain, HorizonGain, OverTime};
use crate::effect::{Effect, Role};
use crate::model::Model;
use crate::recording::Recording;
use crate::robot::{ChannelKind, Robot};
use crate::verify::filter::ProcessNoise;
use crate::verify::{CalibratedModel, VerifyError, Windows, windows};

/// Blocks of the other motion: a block is as long as the longest horizon that counts at least, s.
const BLOCKS: f64 = 24.0;
const LEAST_BLOCK_S: f64 = 0.5;
/// Horizons up to this count for the joint gain, s: errors of longer ones are those of where a robot stops.
const LONGEST_S: f64 = 0.6;
/// The horizon that is shown over time, s.
pub const SHOWN_S: f64 = 0.5;

/// The predictions of one model of the other motion.
pub struct Predicted {
    /// Of each recording, by horizon.
    windows: Vec<Vec<Windows>>,
    /// Of each recording, the process noise under which the model makes it most likely.
    noise: Vec<ProcessNoise>,
    /// The model with what is each recording's own.
    own: Vec<Trial>,
}

impl Predicted {
    /// Of the first recording, half a second ahead.
    fn shown(&self) -> Option<&Windows> {
        self.windows.first()?.iter().find(|windows| (windows.horizon_s - SHOWN_S).abs() < 1e-9)
    }
}

/// The other motion.
pub struct Holdout<'a> {
    robot: &'a Robot,
    recordings: Vec<&'a Recording>,
    /// Blocks of each, from which what is its own is estimated.
    series: Vec<Series>,
}

impl<'a> Holdout<'a> {
    /// Of these recordings of the robot.
    pub fn new(robot: &'a Robot, recordings: &[&'a Recording]) -> Self {
        let samples = samples_for(Model::new(robot).layout().size(), SAMPLES);
        // Enough to see what is the recording's own.
        let part = |recording: &&'a Recording| {
            let series = Series::of(robot, &[recording]);
            let windows = blocks(&series, (samples, criteria::BLOCKS, 0), LEAST_BLOCK, || None);
            series.select(&windows).0
        };
        let series = recordings.iter().map(part);
        Holdout { robot, series: series.collect(), recordings: recordings.to_vec() }
    }

    /// What a trial predicts, with what is each recording's own set free: biases, zeros and what its laws have of their own in each recording. States are searched from those of
    /// another model, `near`, if there is one: such a model is predicted over the horizons of the joint gain alone, which is what it is compared by.
    ///
    /// # Errors
    /// As a calibration's or a verification's.
    pub fn predict(
        &self,
        bench: &Bench<'_>,
        trial: &Trial,
        effects: &[&'static Effect],
        near: Option<&Predicted>,
    ) -> Result<Predicted, HoldoutError> {
        let is_own = |name: &str| {
            let of_law = effects.iter().find(|effect| is_of(effect, name));
            match of_law {
                Some(effect) => effect.parameter(name).is_some_and(|p| p.role == Role::PerRecording),
                None => name.starts_with("zero"),
            }
        };
        let mut predicted = Predicted { windows: Vec::new(), noise: Vec::new(), own: Vec::new() };
        for (number, (recording, series)) in self.recordings.iter().zip(&self.series).enumerate() {
            let near_own = near.map(|near| &near.own[number]);
            let own = bench.of_others(series.clone()).with_own(trial, near_own, &is_own)?;
            let model = CalibratedModel::of_trial(bench.robot(), bench.preset(), &own)?;
            // A model that lacks something of another one has no less to account for.
            let least = near.map(|near| near.noise[number]);
            let longest_s = if near.is_some() { LONGEST_S } else { f64::INFINITY };
            let (windows, noise) = windows(&model, recording, longest_s, least, bench.settings.threads)?;
            tracing::trace!(noise.velocity_sigma, "filter of the other motion");
            predicted.windows.push(windows);
            predicted.noise.push(noise);
            predicted.own.push(own);
        }
        Ok(predicted)
    }

    /// The joint gain of `extended` over `base`.
    pub fn gain(&self, base: &Predicted, extended: &Predicted) -> Gain {
        let cells = self.cells(base, extended, |horizon_s| horizon_s <= LONGEST_S);
        joint(&cells)
    }

    /// The joint gain over each horizon.
    pub fn by_horizon(&self, base: &Predicted, extended: &Predicted) -> Vec<HorizonGain> {
        let mut horizons: Vec<f64> = base.windows.iter().flatten().map(|windows| windows.horizon_s).collect();
        horizons.sort_by(f64::total_cmp);
        horizons.dedup();
        let of =
            |own_s: f64| HorizonGain::of(own_s, joint(&self.cells(base, extended, |horizon_s| horizon_s == own_s)));
        horizons.into_iter().map(of).collect()
    }

    /// The gain by horizon and sensor.
    pub fn by_channel(&self, base: &Predicted, extended: &Predicted) -> Vec<ChannelGain> {
        let cells = self.cells(base, extended, |_| true);
        let of = |cell: &Cell| {
            let whole = cell.sum(0..cell.blocks.len());
            (whole[2] > 0.0 && whole[0] > 0.0).then(|| ChannelGain {
                horizon_s: cell.horizon_s,
                channel: cell.sensor.clone(),
                rmse_base: (whole[0] / whole[2]).sqrt(),
                rmse_extended: (whole[1] / whole[2]).sqrt(),
                gain: 1.0 - (whole[1] / whole[0]).sqrt(),
                ci95: bca(cell.blocks.len(), |blocks| {
                    let sums = cell.sum(blocks);
                    1.0 - (sums[1] / sums[0]).sqrt()
                }),
            })
        };
        cells.iter().filter_map(of).collect()
    }

    /// Root mean square of errors half a second ahead of every sensor, in its standard deviations.
    pub fn ahead_sigma(&self, predicted: &Predicted) -> Vec<(String, f64)> {
        let cells = self.cells(predicted, predicted, |horizon_s| (horizon_s - SHOWN_S).abs() < 1e-9);
        let of = |cell: &Cell| {
            let whole = cell.sum(0..cell.blocks.len());
            (whole[2] > 0.0).then(|| (cell.sensor.clone(), (whole[0] / whole[2]).sqrt() / cell.sigma))
        };
        cells.iter().filter_map(of).collect()
    }

    /// Measured and predicted half a second ahead, of every channel of the first recording.
    pub fn over_time(&self, base: &Predicted, extended: &Predicted) -> Vec<OverTime> {
        let Some(recording) = self.recordings.first() else { return Vec::new() };
        let Some((base, extended)) = base.shown().zip(extended.shown()) else { return Vec::new() };
        let pairs: Vec<(usize, usize)> = pairs(base, extended);
        let end = |start: usize| {
            let goal_s = recording.time_s(start) + SHOWN_S - 0.5 * recording.period_s;
            (start..recording.len()).find(|k| recording.time_s(*k) >= goal_s)
        };
        let of_channel = |(channel, of): (usize, &crate::recording::Channel)| {
            let mut shown = OverTime {
                channel: of.spec.name.clone(),
                unit: of.spec.unit.to_string(),
                t_s: Vec::new(),
                measured: Vec::new(),
                base: Vec::new(),
                extended: Vec::new(),
            };
            for (i, j) in &pairs {
                let Some(k) = end(base.starts[*i]) else { continue };
                let measured = of.values[k];
                if !measured.is_finite() {
                    continue;
                }
                shown.t_s.push(recording.time_s(k) - recording.time_s(0));
                shown.measured.push(measured);
                shown.base.push(measured - base.errors[channel][*i]);
                shown.extended.push(measured - extended.errors[channel][*j]);
            }
            shown
        };
        recording.channels.iter().enumerate().map(of_channel).collect()
    }

    /// Squares of both models' errors by block, of every sensor and each horizon that counts.
    fn cells(&self, base: &Predicted, extended: &Predicted, counts: impl Fn(f64) -> bool) -> Vec<Cell> {
        let mut cells: Vec<Cell> = Vec::new();
        let mut first_block = 0;
        for (number, recording) in self.recordings.iter().enumerate() {
            let duration_s = recording.time_s(recording.len() - 1) - recording.time_s(0);
            let block_s = (duration_s * self.recordings.len() as f64 / BLOCKS).max(LEAST_BLOCK_S);
            let blocks = (duration_s / block_s) as usize + 1;
            let sensors = sensors(recording);
            for (base, extended) in base.windows[number].iter().zip(&extended.windows[number]) {
                if !counts(base.horizon_s) {
                    continue;
                }
                let pairs = pairs(base, extended);
                for (sensor, channels) in &sensors {
                    let is_same = |cell: &&mut Cell| cell.sensor == *sensor && cell.horizon_s == base.horizon_s;
                    let place = match cells.iter_mut().find(is_same) {
                        Some(cell) => cell,
                        None => {
                            let sigma = recording.channels[channels[0]].spec.sigma;
                            let horizon_s = base.horizon_s;
                            let unmodelled = channels.iter().map(|channel| {
                                unmodelled_variance(self.robot, recording.channels[*channel].spec.kind, horizon_s)
                            });
                            let unmodelled = unmodelled.sum::<f64>() / channels.len() as f64;
                            cells.push(Cell {
                                sensor: sensor.clone(),
                                horizon_s,
                                sigma,
                                unmodelled,
                                blocks: Vec::new(),
                            });
                            let last = cells.len() - 1;
                            &mut cells[last]
                        }
                    };
                    place.blocks.resize(first_block + blocks, [0.0; 3]);
                    for (i, j) in &pairs {
                        let t_s = recording.time_s(base.starts[*i]) - recording.time_s(0);
                        let block = first_block + ((t_s / block_s) as usize).min(blocks - 1);
                        for channel in channels {
                            let (a, b) = (base.errors[*channel][*i], extended.errors[*channel][*j]);
                            if a.is_finite() && b.is_finite() {
                                let sums = &mut place.blocks[block];
                                *sums = [sums[0] + a * a, sums[1] + b * b, sums[2] + 1.0];
                            }
                        }
                    }
                }
            }
            first_block += blocks;
        }
        for cell in &mut cells {
            cell.blocks.resize(first_block, [0.0; 3]);
        }
        // Blocks in which nothing was predicted are none.
        let empty: Vec<bool> =
            (0..first_block).map(|block| cells.iter().all(|cell| cell.blocks[block][2] == 0.0)).collect();
        for cell in &mut cells {
            let mut block = 0;
            cell.blocks.retain(|_| {
                block += 1;
                !empty[block - 1]
            });
        }
        cells
    }
}

/// Why another motion cannot be predicted.
#[derive(Debug, thiserror::Error)]
pub enum HoldoutError {
    /// What is its own cannot be fitted.
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
    /// It cannot be predicted.
    #[error(transparent)]
    Verify(#[from] VerifyError),
}

/// One sensor over one horizon: squares of both models' errors and their number, by block.
struct Cell {
    sensor: String,
    horizon_s: f64,
    sigma: f64,
    /// Variance that the robot file's unmodelled accelerations have over the horizon.
    unmodelled: f64,
    blocks: Vec<[f64; 3]>,
}

impl Cell {
    fn sum(&self, blocks: impl Iterator<Item = usize>) -> [f64; 3] {
        blocks.fold([0.0; 3], |sum, block| {
            let own = self.blocks[block];
            [sum[0] + own[0], sum[1] + own[1], sum[2] + own[2]]
        })
    }
}

/// What accelerations of white noise, which the robot file declares unmodelled, do to a channel over a horizon of n periods T: σ_v = σ_a T a period, n σ_v² of a speed, n σ_v² h²/3 of a
/// position.
fn unmodelled_variance(robot: &Robot, kind: ChannelKind, horizon_s: f64) -> f64 {
    let period_s = robot.sample_period_s;
    let periods = horizon_s / period_s;
    let speed = |acceleration: f64| periods * (acceleration * period_s).powi(2);
    let position = |acceleration: f64| speed(acceleration) * horizon_s * horizon_s / 3.0;
    let of = |joint: usize| &robot.joints[joint].unmodelled;
    match kind {
        ChannelKind::MotorPosition { joint } => position(of(joint).motor.max(of(joint).link)),
        ChannelKind::LinkPosition { joint } => position(of(joint).link),
        ChannelKind::MotorSpeed { joint } => speed(of(joint).motor.max(of(joint).link)),
        ChannelKind::LinkSpeed { joint } => speed(of(joint).link),
        ChannelKind::GyroAxis { body, .. } => {
            (0..=body.min(robot.joints.len() - 1)).map(|joint| speed(of(joint).link)).sum()
        }
    }
}

fn joint(cells: &[Cell]) -> Gain {
    let blocks = cells.first().map_or(0, |cell| cell.blocks.len());
    let of = |blocks: &mut dyn Iterator<Item = usize>| {
        let drawn: Vec<usize> = blocks.collect();
        let (mut sum, mut count) = (0.0, 0);
        for cell in cells {
            let [base, extended, count_of] = cell.sum(drawn.iter().copied());
            let (base, extended) = (base + count_of * cell.unmodelled, extended + count_of * cell.unmodelled);
            if base > 0.0 && extended > 0.0 {
                sum += 0.5 * (extended / base).ln();
                count += 1;
            } else if extended.is_nan() {
                sum = f64::NAN;
            }
        }
        1.0 - (sum / f64::from(count.max(1))).exp()
    };
    Gain { share: of(&mut (0..blocks)), ci95: bca(blocks, of), blocks }
}

/// Places of the windows that both models have: either filter may have settled a little later.
fn pairs(base: &Windows, extended: &Windows) -> Vec<(usize, usize)> {
    let place = |k: &usize| extended.starts.binary_search(k).ok();
    base.starts.iter().enumerate().filter_map(|(i, k)| Some((i, place(k)?))).collect()
}

/// Sensors with their channels.
fn sensors(recording: &Recording) -> Vec<(String, Vec<usize>)> {
    let mut sensors: Vec<(String, Vec<usize>)> = Vec::new();
    for (channel, of) in recording.channels.iter().enumerate() {
        let name = match of.spec.kind {
            ChannelKind::GyroAxis { gyro, .. } => format!("gyro{}", gyro + 1),
            _ => of.spec.name.clone(),
        };
        match sensors.iter_mut().find(|(other, _)| *other == name) {
            Some((_, channels)) => channels.push(channel),
            None => sensors.push((name, vec![channel])),
        }
    }
    sensors
}

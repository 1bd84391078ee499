//! The filter tick by tick, as the device runs it.

use nalgebra::{DMatrix, DVector};
use observer::{Input, Observer, Sensors, TableModel, Watchdog};

use super::consistency::{Consistency, Counter};
use super::truth::TrueStates;
use super::{Numbers, ObserveError};
use crate::recording::Recording;

/// Time after a start that counts for no consistency, s: the start is a guess.
pub const SETTLING_S: f64 = 0.1;

/// A robot moves where a position that is read has gone further than its sensor's step in this time, s.
const MOTION_S: f64 = 0.1;

/// A sensor's step over its standard deviation, if rounding to that step is all its noise: √12. With other noise the step is smaller.
const STEP_PER_SIGMA: f64 = 3.464_101_615_137_754;

/// What the observer made of a recording, tick by tick.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Estimates {
    /// Time of each sample after the first one, s.
    pub t_s: Vec<f64>,
    /// `[state][k]`; NaN before the filter has started.
    pub states: Vec<Vec<f64>>,
    /// Their standard deviations.
    pub sigmas: Vec<Vec<f64>>,
    /// Normalised innovation squared over the readings taken in; NaN where there were none.
    pub nis_per_reading: Vec<f64>,
    /// The watchdog's level, 0 to 1.
    pub level: Vec<f64>,
    /// Times of events of the watchdog, s after the first sample.
    pub events_s: Vec<f64>,
    /// Times that the filter started.
    pub starts: usize,
    /// Readings left out because they stood alone.
    pub left_out: usize,
    /// Of the innovations while the robot moves. Of a robot at rest an encoder gives the same count or its neighbour, and its square is not χ².
    pub nis: Option<Consistency>,
    /// Of the state's true error.
    pub nees: Option<Consistency>,
}

/// Runs the filter that has room for the model.
pub(super) fn run(
    numbers: &Numbers,
    recording: &Recording,
    inputs: &[Vec<f64>],
    sensors: Sensors,
    truth: Option<&TrueStates>,
) -> Result<Estimates, ObserveError> {
    let table = numbers.table();
    // The numbers do not depend on the room.
    if table.states <= 24 && table.readings <= 16 {
        with_room::<24, 16>(numbers, recording, inputs, sensors, truth)
    } else {
        with_room::<64, 64>(numbers, recording, inputs, sensors, truth)
    }
}

fn with_room<const N: usize, const R: usize>(
    numbers: &Numbers,
    recording: &Recording,
    inputs: &[Vec<f64>],
    sensors: Sensors,
    truth: Option<&TrueStates>,
) -> Result<Estimates, ObserveError> {
    let table = numbers.table();
    let mut model = TableModel::new(table, vec![0.0_f32; table.memory()])?;
    let settings = numbers.settings(sensors);
    let readings_at = |k: usize| recording.channels.iter().map(|c| c.values[k] as f32).collect::<Vec<_>>();
    let mut observer = Observer::<f32, N, R>::new(&model, settings, &vec![f32::NAN; table.readings])?;
    let mut watchdog = Watchdog::default();
    let (mut nis, mut nees) = (Counter::default(), Counter::default());
    let mut found = Estimates {
        states: vec![Vec::with_capacity(recording.len()); table.states],
        sigmas: vec![Vec::with_capacity(recording.len()); table.states],
        ..Estimates::default()
    };
    let lag = (MOTION_S / recording.period_s).round() as usize;
    let read: Vec<(usize, f64)> = numbers.steps(STEP_PER_SIGMA).collect();
    for segment in recording.segments() {
        // Across a gap the input is not known: the filter starts anew.
        let mut started_s = None;
        for k in segment.clone() {
            let t_s = recording.time_s(k);
            found.t_s.push(t_s);
            let readings = readings_at(k);
            if started_s.is_none() && settings.can_start(&readings) {
                observer.restart(&readings);
                started_s = Some(t_s);
                found.starts += 1;
            }
            let Some(start_s) = started_s else {
                found.push(std::iter::repeat_n([f64::NAN; 2], table.states), f64::NAN, f64::from(watchdog.level()));
                continue;
            };
            let u: Vec<f32> = inputs.iter().map(|input| input[k] as f32).collect();
            let input = Input { u: &u, time_s: recording.motion_time_s(k) as f32 };
            let innovation = observer.update(&mut model, &readings, input);
            found.left_out += usize::from(innovation.left_out);
            if watchdog.look(innovation) {
                found.events_s.push(t_s);
            }
            let taken = usize::from(innovation.taken);
            let square = f64::from(innovation.nis);
            if t_s - start_s >= SETTLING_S {
                let is_moving = |(state, step): &(usize, f64)| {
                    let earlier = k.checked_sub(lag).and_then(|k| found.states[*state].get(k).copied());
                    earlier.is_some_and(|earlier| (f64::from(observer.state()[*state]) - earlier).abs() > *step)
                };
                if read.iter().any(is_moving) {
                    nis.add(square, taken);
                }
                if let Some((square, dof)) = truth.and_then(|truth| error_square(&observer, truth, k)) {
                    nees.add(square, dof);
                }
            }
            let covariance = observer.covariance();
            let of_state = |(i, x): (usize, &f32)| [f64::from(*x), f64::from(covariance.covariance(i, i)).sqrt()];
            let per_reading = if taken == 0 { f64::NAN } else { square / taken as f64 };
            found.push(observer.state().iter().enumerate().map(of_state), per_reading, f64::from(watchdog.level()));
            if !observer.is_sound() {
                started_s = None;
            } else if k + 1 < segment.end {
                observer.predict(&mut model, input, (recording.time_s(k + 1) - t_s) as f32);
            }
        }
    }
    if found.starts == 0 {
        return Err(ObserveError::NoStart);
    }
    (found.nis, found.nees) = (nis.result(), nees.result());
    Ok(found)
}

impl Estimates {
    fn push(&mut self, states: impl Iterator<Item = [f64; 2]>, nis_per_reading: f64, level: f64) {
        for ((value, sigma), of_state) in self.states.iter_mut().zip(&mut self.sigmas).zip(states) {
            value.push(of_state[0]);
            sigma.push(of_state[1]);
        }
        self.nis_per_reading.push(nis_per_reading);
        self.level.push(level);
    }
}

/// eᵀ P⁻¹ e of the states whose truth is known, and how many they are.
fn error_square<const N: usize, const R: usize>(
    observer: &Observer<'_, f32, N, R>,
    truth: &TrueStates,
    k: usize,
) -> Option<(f64, usize)> {
    let places = &truth.places;
    let error = DVector::from_fn(places.len(), |i, _| f64::from(observer.state()[places[i]]) - truth.values[i][k]);
    if error.iter().any(|error| error.is_nan()) {
        return None;
    }
    let factor = observer.covariance();
    // The factors are those of single precision. Their product is taken in double: it is nearly singular where gyros alone are read.
    let product = |i: usize, j: usize| {
        let term = |k: usize| f64::from(factor.u(i, k)) * f64::from(factor.d(k)) * f64::from(factor.u(j, k));
        (i.max(j)..factor.count()).map(term).sum::<f64>()
    };
    let covariance = DMatrix::from_fn(places.len(), places.len(), |i, j| product(places[i], places[j]));
    // In units of each state's own standard deviation, so that rounding stays relative.
    let scale = covariance.diagonal().map(|variance| variance.sqrt().recip());
    let correlation = DMatrix::from_fn(places.len(), places.len(), |i, j| scale[i] * covariance[(i, j)] * scale[j]);
    let error = error.component_mul(&scale);
    let square = correlation.cholesky().map_or(f64::INFINITY, |root| error.dot(&root.solve(&error)));
    Some((square, places.len()))
}

//! The filter: start, update by the readings of a tick, prediction to the next one.

use crate::factor::dot;
use crate::flow::{self, Shape};
use crate::{Factor, Input, Model, Real};

/// A reading further from its prediction than so many standard deviations stands alone, and is left out …
const OUTLIER_SIGMA: f64 = 6.0;

/// … but no more than so many in a row of one sensor: what lasts longer is an error of the model, or of the estimate.
const MOST_OUTLIERS: u8 = 3;

/// Share of a step's correction of third order that is taken for the standard deviation of the step's own error. On steps in which friction reverses
/// the error was 1 to 27 % of the correction. Half and double have not been tried.
const DOUBT: f64 = 0.5;

/// Which sensors are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sensors {
    /// Gyros, and nothing else; positions start from the encoders.
    Gyros,
    /// All but gyros.
    Encoders,
    /// All.
    Both,
}

/// What a component is known to be when the filter starts, of a robot at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start<T> {
    /// The reading that shows it; without it, or where it has no value, the component starts from `value`.
    pub reading: Option<u16>,
    /// In the component's unit.
    pub value: T,
    /// Standard deviation, in the component's unit.
    pub sigma: T,
}

/// The numbers of a filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings<'t, T> {
    /// The period that `process` is of, s.
    pub period_s: T,
    /// Standard deviation of each reading, in its unit.
    pub sigma: &'t [T],
    /// Whether each reading is of a gyro.
    pub is_gyro: &'t [bool],
    /// Standard deviation of what a step of one period misses of each component, in its unit.
    pub process: &'t [T],
    /// How each component starts.
    pub start: &'t [Start<T>],
    /// What is read.
    pub sensors: Sensors,
}

impl<T: Real> Settings<'_, T> {
    /// Whether these readings hold all that a start needs.
    pub fn can_start(&self, readings: &[T]) -> bool {
        let is_there = |place: u16| readings.get(usize::from(place)).is_some_and(|reading| !reading.is_nan());
        self.start.iter().all(|start| start.reading.is_none_or(is_there))
    }
}

/// Why there is no filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ObserverError {
    /// More than this build has room for.
    #[error(
        "the model has {states} states and {readings} readings, this observer has room for {room_states} and {room_readings}: build it with more"
    )]
    TooLarge {
        /// Of the model.
        states: usize,
        /// Of the model.
        readings: usize,
        /// Of this build.
        room_states: usize,
        /// Of this build.
        room_readings: usize,
    },
    /// Settings of another model.
    #[error(
        "the settings are not those of the model, which has {states} states and {readings} readings: make both from one calibration"
    )]
    OtherModel {
        /// Of the model.
        states: usize,
        /// Of the model.
        readings: usize,
    },
    /// A number that is none, or a standard deviation or a period that is not above zero.
    #[error("a standard deviation or a start value of the settings is no number, or not positive: calibrate again")]
    Number,
}

/// What the readings of a tick said of their prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation<T> {
    /// Normalised innovation squared: Σ ν²/S over the readings taken in. Of a true model χ² with `taken` degrees of freedom.
    pub nis: T,
    /// Readings taken in.
    pub taken: u16,
    /// Readings left out because they stand alone.
    pub left_out: u16,
}

/// An extended Kalman filter with room for `N` components and `R` readings.
#[derive(Debug, Clone)]
pub struct Observer<'t, T, const N: usize, const R: usize> {
    settings: Settings<'t, T>,
    moving: usize,
    states: usize,
    x: [T; N],
    /// What the last digit of x does not show.
    rest: [T; N],
    factor: Factor<T, N>,
    /// Variances by which constants have wandered since their last turn, and whose turn it is.
    owed: [T; N],
    turn: usize,
    outliers: [u8; R],
    /// ∂ẋ/∂x, Φ and room for it.
    a: [[T; N]; N],
    phi: [[T; N]; N],
    room: [[T; N]; N],
    /// What a model writes by rows.
    slopes: [[T; N]; N],
    y: [T; R],
    by_x: [[T; N]; R],
}

impl<'t, T: Real, const N: usize, const R: usize> Observer<'t, T, N, R> {
    /// A filter of a robot at rest with these readings (NaN: none).
    ///
    /// # Errors
    /// [`ObserverError`].
    pub fn new(model: &impl Model<T>, settings: Settings<'t, T>, readings: &[T]) -> Result<Self, ObserverError> {
        let (states, count) = (model.states(), model.readings());
        if states > N || count > R {
            return Err(ObserverError::TooLarge { states, readings: count, room_states: N, room_readings: R });
        }
        let of_states = settings.process.len() == states && settings.start.len() == states && model.moving() <= states;
        let of_readings = settings.sigma.len() == count && settings.is_gyro.len() == count && readings.len() == count;
        if !of_states || !of_readings {
            return Err(ObserverError::OtherModel { states, readings: count });
        }
        let (zero, infinite) = (T::of(0.0), T::of(f64::INFINITY));
        let is_positive = |value: &T| *value > zero && *value < infinite;
        let is_start = |start: &Start<T>| is_positive(&start.sigma) && start.value.abs() < infinite;
        let is_process = |sigma: &T| *sigma >= zero && *sigma < infinite;
        if !is_positive(&settings.period_s)
            || !settings.sigma.iter().all(is_positive)
            || !settings.process.iter().all(is_process)
            || !settings.start.iter().all(is_start)
        {
            return Err(ObserverError::Number);
        }
        let square = [[zero; N]; N];
        let mut observer = Self {
            settings,
            moving: model.moving(),
            states,
            x: [zero; N],
            rest: [zero; N],
            factor: Factor::diagonal(core::iter::empty()),
            owed: [zero; N],
            turn: model.moving(),
            outliers: [0; R],
            a: square,
            phi: square,
            room: square,
            slopes: square,
            y: [zero; R],
            by_x: [[zero; N]; R],
        };
        observer.restart(readings);
        Ok(observer)
    }

    /// Forgets everything: a robot at rest with these readings.
    pub fn restart(&mut self, readings: &[T]) {
        let zero = T::of(0.0);
        for (x, start) in self.x.iter_mut().zip(self.settings.start) {
            let read = start.reading.and_then(|place| readings.get(usize::from(place)).copied());
            *x = read.filter(|value| value.abs() < T::of(f64::INFINITY)).unwrap_or(start.value);
        }
        self.rest = [zero; N];
        self.owed = [zero; N];
        self.turn = self.moving;
        self.outliers = [0; R];
        self.factor = Factor::diagonal(self.settings.start.iter().map(|start| start.sigma));
    }

    /// The estimate: components that move, then constants.
    pub fn state(&self) -> &[T] {
        &self.x[..self.states]
    }

    /// The covariance of the estimate.
    pub fn covariance(&self) -> &Factor<T, N> {
        &self.factor
    }

    /// Whether the estimate is a number. If not, the filter has to be restarted.
    pub fn is_sound(&self) -> bool {
        self.state().iter().all(|x| x.abs() < T::of(f64::INFINITY)) && self.factor.is_sound()
    }

    /// Takes in the readings of a tick (NaN: none). `input` is in force after it, when late sensors are read.
    ///
    /// Readings are taken one by one, as their noise is independent; all are linearised at the prediction. S = h P hᵀ + r of each is given those
    /// before it, so that Σ ν²/S is the normalised innovation of all together.
    pub fn update(&mut self, model: &mut impl Model<T>, readings: &[T], input: Input<'_, T>) -> Innovation<T> {
        let (zero, n) = (T::of(0.0), self.states);
        let count = self.settings.sigma.len();
        let slopes = self.by_x.as_flattened_mut();
        model.readings_slopes(&self.x[..n], input, &mut self.y[..count], &mut slopes[..count * n]);
        let mut innovation = Innovation { nis: zero, taken: 0, left_out: 0 };
        let mut change = self.rest;
        let mut gain = [zero; N];
        let gate = T::of(OUTLIER_SIGMA * OUTLIER_SIGMA);
        for (i, reading) in readings.iter().take(count).enumerate() {
            let is_chosen = match self.settings.sensors {
                Sensors::Both => true,
                Sensors::Gyros => self.settings.is_gyro[i],
                Sensors::Encoders => !self.settings.is_gyro[i],
            };
            if !is_chosen || reading.is_nan() {
                continue;
            }
            let h = &slopes[i * n..(i + 1) * n];
            let variance = self.settings.sigma[i] * self.settings.sigma[i];
            let total = variance + self.factor.variance_of(h);
            let difference = *reading - self.y[i] - dot(h, &change);
            let share = difference / total;
            let square = difference * share;
            if square < gate {
                self.outliers[i] = 0;
            } else if self.outliers[i] < MOST_OUTLIERS {
                self.outliers[i] += 1;
                innovation.left_out += 1;
                continue;
            }
            innovation.nis += square;
            innovation.taken += 1;
            self.factor.take_in(variance, &mut gain);
            for (change, gain) in change[..n].iter_mut().zip(&gain) {
                *change += difference * *gain;
            }
        }
        for i in 0..n {
            let change = change[i] - self.rest[i];
            self.add(i, change);
        }
        innovation
    }

    /// Goes on by `dt_s` seconds with this input.
    ///
    /// With A = ∂f/∂x at the estimate, x(t + h) = x + δ + ε (M. Hochbruck, A. Ostermann, *Exponential integrators*, Acta Numerica 19, 2010: exprb32):
    /// ```text
    /// δ′ = A δ + f(x),   ε′ = A ε + (t/h)² d,   d = f(x + δ) − f(x) − A δ,   both from zero
    /// P ← Φ P Φᵀ + Q,   Φ = e^{A h},   Qᵢᵢ = σᵢ² h/period + (εᵢ/2)²
    /// ```
    /// δ alone is of second order, so that ε tells its error; where friction reverses within a step it is no longer small, and the filter believes
    /// the model less.
    pub fn predict(&mut self, model: &mut impl Model<T>, input: Input<'_, T>, dt_s: T) {
        let (zero, n, size) = (T::of(0.0), self.states, self.moving);
        let mut rates = [zero; N];
        let slopes = self.slopes.as_flattened_mut();
        model.rates_slopes(&self.x[..n], input, &mut rates[..size], &mut slopes[..size * size]);
        for i in 0..size {
            self.a[i][..size].copy_from_slice(&slopes[i * size..(i + 1) * size]);
        }
        let halvings = flow::halvings(&self.a, size, dt_s);
        let first = flow::response(&self.a, size, dt_s, halvings, (&rates, Shape::Constant));
        let mut end = self.x;
        for i in 0..size {
            end[i] += first[i];
        }
        let (mut missed, mut linear) = ([zero; N], [zero; N]);
        model.rates(&end[..n], input, &mut missed[..size]);
        flow::multiply(&self.a, size, &first, &mut linear);
        for i in 0..size {
            missed[i] = missed[i] - rates[i] - linear[i];
        }
        let second = flow::response(&self.a, size, dt_s, halvings, (&missed, Shape::Square));
        flow::transition(&self.a, size, dt_s, halvings, &mut self.phi, &mut self.room);
        let periods = dt_s / self.settings.period_s;
        let mut noise = [zero; N];
        for i in 0..n {
            let doubt = second[i] * T::of(DOUBT);
            noise[i] = self.settings.process[i] * self.settings.process[i] * periods + doubt * doubt;
        }
        self.factor.propagate(&self.phi, size, &noise);
        self.wander(&noise);
        for i in 0..size {
            self.add(i, first[i] + second[i]);
        }
    }

    /// Constants wander, one a tick by what all ticks since its last turn have added: a change of few parts in a million needs no haste.
    fn wander(&mut self, noise: &[T; N]) {
        for i in self.moving..self.states {
            self.owed[i] += noise[i];
        }
        if self.moving < self.states {
            self.factor.add_variance(self.turn, self.owed[self.turn]);
            self.owed[self.turn] = T::of(0.0);
            self.turn = if self.turn + 1 < self.states { self.turn + 1 } else { self.moving };
        }
    }

    /// xᵢ ← xᵢ + change, with what rounding loses kept for the next time (Kahan): a slow robot moves less in a tick than the last digit of its position.
    fn add(&mut self, i: usize, change: T) {
        let change = change + self.rest[i];
        let sum = self.x[i] + change;
        self.rest[i] = change - (sum - self.x[i]);
        self.x[i] = sum;
    }
}

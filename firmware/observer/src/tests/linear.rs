//! A linear system: the filter's covariance ends where the Riccati equation says, and its estimates are the Kalman filter's.

use std::{vec, vec::Vec};

use super::{Matrix, Normal, after_reading, after_step, matrix};
use crate::{Input, Model, Observer, ObserverError, Real, Sensors, Settings, Start};

const N: usize = 3;
const R: usize = 2;
const PERIOD_S: f64 = 1e-3;
const OMEGA: f64 = 40.0;
const DAMPING: f64 = 0.1;

/// x₀′ = x₁, x₁′ = −ω² x₀ − 2 D ω x₁ + u; y₀ = x₀ (encoder), y₁ = x₁ + x₂ (gyro with a bias).
struct Oscillator;

impl<T: Real> Model<T> for Oscillator {
    fn moving(&self) -> usize {
        2
    }

    fn states(&self) -> usize {
        N
    }

    fn inputs(&self) -> usize {
        1
    }

    fn readings(&self) -> usize {
        R
    }

    fn rates(&mut self, x: &[T], input: Input<'_, T>, xdot: &mut [T]) {
        xdot[0] = x[1];
        xdot[1] = T::of(-OMEGA * OMEGA) * x[0] + T::of(-2.0 * DAMPING * OMEGA) * x[1] + input.u[0];
    }

    fn rates_slopes(&mut self, x: &[T], input: Input<'_, T>, xdot: &mut [T], by_x: &mut [T]) {
        self.rates(x, input, xdot);
        by_x.copy_from_slice(&[0.0, 1.0, -OMEGA * OMEGA, -2.0 * DAMPING * OMEGA].map(T::of));
    }

    fn readings_slopes(&mut self, x: &[T], _: Input<'_, T>, y: &mut [T], by_x: &mut [T]) {
        y.copy_from_slice(&[x[0], x[1] + x[2]]);
        by_x.copy_from_slice(&[1.0, 0.0, 0.0, 0.0, 1.0, 1.0].map(T::of));
    }
}

const SIGMA: [f64; R] = [7e-5, 1.7e-3];
const PROCESS: [f64; N] = [1e-8, 2e-5, 1e-6];
const FIRST: [f64; N] = [0.01, 1.0, 0.01];

struct Numbers<T> {
    sigma: Vec<T>,
    process: Vec<T>,
    start: Vec<Start<T>>,
}

impl<T: Real> Numbers<T> {
    fn new() -> Self {
        let start = |i: usize| Start { reading: (i == 0).then_some(0), value: T::of(0.0), sigma: T::of(FIRST[i]) };
        Numbers {
            sigma: SIGMA.map(T::of).to_vec(),
            process: PROCESS.map(T::of).to_vec(),
            start: (0..N).map(start).collect(),
        }
    }

    fn settings(&self, sensors: Sensors) -> Settings<'_, T> {
        Settings {
            period_s: T::of(PERIOD_S),
            sigma: &self.sigma,
            is_gyro: &[false, true],
            process: &self.process,
            start: &self.start,
            sensors,
        }
    }
}

/// e^{A h} by its own formula.
fn transition() -> Matrix {
    let (decay, own) = (DAMPING * OMEGA, OMEGA * (1.0 - DAMPING * DAMPING).sqrt());
    let ((sin, cos), e) = ((own * PERIOD_S).sin_cos(), (-decay * PERIOD_S).exp());
    vec![
        vec![e * (cos + decay / own * sin), e * sin / own, 0.0],
        vec![-e * OMEGA * OMEGA / own * sin, e * (cos - decay / own * sin), 0.0],
        vec![0.0, 0.0, 1.0],
    ]
}

const H: [[f64; N]; R] = [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]];

/// P of the prediction that the Riccati equation P = Φ (P − P Hᵀ S⁻¹ H P) Φᵀ + Q is solved by, found by going on until nothing changes.
fn riccati(readings: &[usize]) -> Matrix {
    let mut p = matrix(N, |i, j| if i == j { FIRST[i] * FIRST[i] } else { 0.0 });
    for _ in 0..400_000 {
        let of_reading = |p: Matrix, i: &usize| after_reading(&p, &H[*i], SIGMA[*i].powi(2)).0;
        p = after_step(&readings.iter().fold(p, of_reading), &transition(), &PROCESS.map(|sigma| sigma * sigma));
    }
    p
}

/// The largest difference of the filter's own covariance, in shares of √(Pᵢᵢ Pⱼⱼ).
fn off_riccati<T: Real + Into<f64>>(sensors: Sensors, readings: &[usize]) -> f64 {
    let numbers = Numbers::<T>::new();
    let zero = T::of(0.0);
    let mut observer = Observer::<T, N, R>::new(&Oscillator, numbers.settings(sensors), &[zero; R]).unwrap();
    let input = Input { u: &[zero], time_s: zero };
    for _ in 0..60_000 {
        observer.update(&mut Oscillator, &[zero; R], input);
        observer.predict(&mut Oscillator, input, T::of(PERIOD_S));
    }
    let expected = riccati(readings);
    let mut worst: f64 = 0.0;
    for i in 0..N {
        for j in 0..N {
            let found: f64 = observer.covariance().covariance(i, j).into();
            worst = worst.max((found - expected[i][j]).abs() / (expected[i][i] * expected[j][j]).sqrt());
        }
    }
    worst
}

#[test]
fn the_covariance_solves_the_riccati_equation() {
    for (sensors, readings) in [(Sensors::Both, &[0, 1][..]), (Sensors::Gyros, &[1])] {
        let (double, single) = (off_riccati::<f64>(sensors, readings), off_riccati::<f32>(sensors, readings));
        std::println!("{sensors:?}: off the Riccati equation f64 {double:.1e}, f32 {single:.1e}");
        // Φ is a series of five terms, and a bias that wanders is found slowly.
        assert!(double < 1e-4 && single < 1e-3, "{sensors:?} {double:e} {single:e}");
    }
}

/// A scalar walk has a solution in closed form: the oscillator without its gyro forgets the bias, whose variance grows by Q a tick.
#[test]
fn a_constant_without_a_reading_wanders() {
    let numbers = Numbers::<f32>::new();
    let mut observer = Observer::<f32, N, R>::new(&Oscillator, numbers.settings(Sensors::Encoders), &[0.0; R]).unwrap();
    let input = Input { u: &[0.0], time_s: 0.0 };
    for _ in 0..1000 {
        observer.update(&mut Oscillator, &[0.0, 5.0], input);
        observer.predict(&mut Oscillator, input, PERIOD_S as f32);
    }
    let expected = FIRST[2].powi(2) + 1000.0 * PROCESS[2].powi(2);
    assert!((f64::from(observer.covariance().covariance(2, 2)) / expected - 1.0).abs() < 1e-4);
    assert_eq!(observer.state()[2], 0.0, "a gyro that is not read tells nothing");
}

/// Single precision against double over a minute of noise, in shares of the standard deviation that the filter itself tells.
#[test]
fn single_precision_estimates_as_double_does() {
    let (single, double) = (Numbers::<f32>::new(), Numbers::<f64>::new());
    let mut a = Observer::<f32, N, R>::new(&Oscillator, single.settings(Sensors::Both), &[0.0; R]).unwrap();
    let mut b = Observer::<f64, N, R>::new(&Oscillator, double.settings(Sensors::Both), &[0.0; R]).unwrap();
    let mut normal = Normal::of(5);
    let mut x = [0.0, 0.0, 0.01];
    let mut worst: f64 = 0.0;
    for k in 0..60_000 {
        let u = f64::from(f32::from(u16::from(k % 2000 < 1000))) * 20.0;
        // Readings that both precisions hold.
        let y = [x[0] + SIGMA[0] * normal.next(), x[1] + x[2] + SIGMA[1] * normal.next()].map(|y| y as f32);
        a.update(&mut Oscillator, &y, Input { u: &[u as f32], time_s: 0.0 });
        b.update(&mut Oscillator, &y.map(f64::from), Input { u: &[u], time_s: 0.0 });
        for i in 0..N {
            let sigma = b.covariance().covariance(i, i).sqrt();
            worst = worst.max((f64::from(a.state()[i]) - b.state()[i]).abs() / sigma);
        }
        a.predict(&mut Oscillator, Input { u: &[u as f32], time_s: 0.0 }, PERIOD_S as f32);
        b.predict(&mut Oscillator, Input { u: &[u], time_s: 0.0 }, PERIOD_S);
        let phi = transition();
        // The input's share by the equilibrium that it leads to.
        let rest = u / (OMEGA * OMEGA);
        let from = [x[0] - rest, x[1]];
        x = [
            rest + phi[0][0] * from[0] + phi[0][1] * from[1],
            phi[1][0] * from[0] + phi[1][1] * from[1] + PROCESS[1] * normal.next(),
            x[2],
        ];
    }
    std::println!("f32 apart from f64: {worst:.1e} standard deviations");
    assert!(worst < 0.05, "{worst:e}");
}

#[test]
fn settings_that_do_not_fit_are_refused() {
    let numbers = Numbers::<f32>::new();
    let settings = numbers.settings(Sensors::Both);
    let refused = |settings, readings: &[f32]| Observer::<f32, N, R>::new(&Oscillator, settings, readings).err();
    assert_eq!(refused(settings, &[0.0; R]), None);
    let other = ObserverError::OtherModel { states: N, readings: R };
    assert_eq!(refused(settings, &[0.0; 1]), Some(other));
    assert_eq!(refused(Settings { process: &[0.0; 2], ..settings }, &[0.0; R]), Some(other));
    assert_eq!(refused(Settings { sigma: &[0.0, 1.0], ..settings }, &[0.0; R]), Some(ObserverError::Number));
    assert_eq!(refused(Settings { period_s: f32::NAN, ..settings }, &[0.0; R]), Some(ObserverError::Number));
    let small = Observer::<f32, 2, R>::new(&Oscillator, settings, &[0.0; R]).err();
    assert!(matches!(small, Some(ObserverError::TooLarge { room_states: 2, .. })));
}

#[test]
fn readings_that_stand_alone_are_left_out_and_lasting_ones_are_not() {
    let numbers = Numbers::<f32>::new();
    let mut observer = Observer::<f32, N, R>::new(&Oscillator, numbers.settings(Sensors::Both), &[0.0; R]).unwrap();
    let input = Input { u: &[0.0], time_s: 0.0 };
    let mut tick = |encoder: f32| {
        let innovation = observer.update(&mut Oscillator, &[encoder, f32::NAN], input);
        observer.predict(&mut Oscillator, input, PERIOD_S as f32);
        (innovation.taken, innovation.left_out, observer.is_sound())
    };
    (0..2000).for_each(|_| assert_eq!(tick(0.0), (1, 0, true)));
    assert_eq!(tick(0.05), (0, 1, true));
    assert_eq!(tick(0.0), (1, 0, true));
    let lasting: Vec<_> = (0..5).map(|_| tick(0.05)).collect();
    assert_eq!(lasting, [(0, 1, true), (0, 1, true), (0, 1, true), (1, 0, true), (1, 0, true)]);
}

#[test]
fn more_room_gives_the_same_bytes() {
    let numbers = Numbers::<f32>::new();
    let mut small = Observer::<f32, N, R>::new(&Oscillator, numbers.settings(Sensors::Both), &[0.0; R]).unwrap();
    let mut large = Observer::<f32, 24, 16>::new(&Oscillator, numbers.settings(Sensors::Both), &[0.0; R]).unwrap();
    let mut normal = Normal::of(8);
    for _ in 0..5000 {
        let y = [0.01 * normal.next(), normal.next()].map(|y| y as f32);
        let input = Input { u: &[normal.next() as f32], time_s: 0.0 };
        let nis = [small.update(&mut Oscillator, &y, input).nis, large.update(&mut Oscillator, &y, input).nis];
        assert_eq!(nis[0].to_bits(), nis[1].to_bits());
        small.predict(&mut Oscillator, input, PERIOD_S as f32);
        large.predict(&mut Oscillator, input, PERIOD_S as f32);
    }
    let bits = |x: &[f32]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(small.state()), bits(large.state()));
}

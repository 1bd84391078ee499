//! Motions and their controllers. A controller maps encoder readings to inputs once a sample.

use std::f64::consts::TAU;

use host::robot::Robot;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// A controller, asked once a sample.
#[derive(Debug)]
pub enum Motion {
    /// Stages of commanded moves under a proportional controller.
    Stages(Stages),
    /// A reference that is followed by position and speed.
    Followed(Followed),
}

impl Motion {
    /// Its length, s.
    pub fn duration_s(&self) -> f64 {
        match self {
            Motion::Stages(stages) => stages.stages.iter().map(|stage| stage.duration_s).sum(),
            Motion::Followed(followed) => followed.duration_s,
        }
    }

    /// The inputs at a time for these encoder readings. Before its start the machine is held at zero.
    pub fn input(&mut self, time_s: f64, positions: &[f64]) -> Vec<f64> {
        match self {
            Motion::Stages(stages) => stages.input(time_s, positions),
            Motion::Followed(followed) => followed.input(time_s, positions),
        }
    }
}

/// Stages one after the other.
#[derive(Debug)]
pub struct Stages {
    stages: Vec<Stage>,
    /// Duty per rad of every joint.
    gain: Vec<f64>,
}

#[derive(Debug, Clone)]
struct Stage {
    duration_s: f64,
    action: Action,
}

#[derive(Debug, Clone)]
enum Action {
    Rest,
    /// To these positions; joints without one are held.
    Move {
        targets: Vec<Option<f64>>,
        ceiling: f64,
    },
    /// Sines of joints that differ in frequency.
    Sine {
        amplitude: f64,
        hertz: f64,
        ceiling: f64,
    },
    /// Duty that sweeps from 1.4 to 10 Hz on these joints.
    Chirp {
        joints: Vec<usize>,
        amplitude: f64,
    },
}

/// Steps of a commanded duty.
const DUTY_STEP: f64 = 1e-4;
/// Ends of a chirp, Hz, and the duty per rad that keeps its joint in the middle.
const CHIRP_HZ: [f64; 2] = [1.4, 10.0];
const CENTRING: f64 = 1.5;
/// Joints differ in frequency by this share from one to the next.
const SPREAD: f64 = 0.3;

impl Stages {
    /// Some 25 s for a robot like Doggy: rest, slow sines and moves, fast steps and a chirp of every joint, then of all. Targets and times vary by a
    /// tenth from one motion to the next.
    pub fn draw(robot: &Robot, rng: &mut ChaCha8Rng) -> Self {
        let n = robot.joints.len();
        let limit = |joint: usize| robot.joints[joint].limits[1];
        let mut vary = || 1.0 + rng.random_range(-0.1..0.1);
        let mut stages = vec![Stage { duration_s: 3.0, action: Action::Rest }];
        stages.push(Stage {
            duration_s: 5.0,
            action: Action::Sine { amplitude: 0.25, hertz: 0.35 * vary(), ceiling: 0.15 },
        });
        for signs in [[1.0, -1.0, 1.0], [-1.0, 1.0, 0.8], [0.0; 3]] {
            let targets = (0..n).map(|j| Some(0.55 * limit(j) * signs[j % 3] * vary())).collect();
            stages.push(Stage { duration_s: 1.4 * vary(), action: Action::Move { targets, ceiling: 0.15 } });
        }
        for joint in 0..n {
            for (share, ceiling) in [(0.55, 0.9), (-0.55, 0.9), (0.0, 0.5)] {
                let targets = (0..n).map(|j| (j == joint).then_some(share * limit(j))).collect();
                stages.push(Stage { duration_s: 0.6 * vary(), action: Action::Move { targets, ceiling } });
            }
            stages.push(Stage { duration_s: 1.5, action: Action::Chirp { joints: vec![joint], amplitude: 0.9 } });
        }
        for signs in [[0.4, -0.6, 0.6], [-0.4, -0.5, 0.5], [0.3, 0.5, -0.5], [0.0; 3]] {
            let targets = (0..n).map(|j| Some(limit(j) * signs[j % 3] * vary())).collect();
            stages.push(Stage { duration_s: 0.6 * vary(), action: Action::Move { targets, ceiling: 0.9 } });
        }
        stages.push(Stage { duration_s: 2.0, action: Action::Chirp { joints: (0..n).collect(), amplitude: 0.9 } });
        stages.push(Stage { duration_s: 0.8, action: Action::Move { targets: vec![Some(0.0); n], ceiling: 0.5 } });
        let gain = (0..n).map(|j| 1.8 / limit(j).max(0.6)).collect();
        Self { stages, gain }
    }

    fn input(&self, time_s: f64, positions: &[f64]) -> Vec<f64> {
        let mut begun_s = 0.0;
        let mut held: Vec<f64> = vec![0.0; positions.len()];
        for stage in &self.stages {
            let since_s = time_s - begun_s;
            if since_s < stage.duration_s {
                return self.of_stage(stage, since_s.max(0.0), &held, positions);
            }
            begun_s += stage.duration_s;
            if let Action::Move { targets, .. } = &stage.action {
                held.iter_mut().zip(targets).for_each(|(held, target)| *held = target.unwrap_or(*held));
            }
        }
        vec![0.0; positions.len()]
    }

    fn of_stage(&self, stage: &Stage, since_s: f64, held: &[f64], positions: &[f64]) -> Vec<f64> {
        let towards = |joint: usize, target: f64, ceiling: f64| {
            (self.gain[joint] * (target - positions[joint])).clamp(-ceiling, ceiling)
        };
        let duty = |joint: usize| match &stage.action {
            Action::Rest => 0.0,
            Action::Move { targets, ceiling } => targets[joint].map_or(0.0, |target| towards(joint, target, *ceiling)),
            Action::Sine { amplitude, hertz, ceiling } => {
                let hertz = hertz * (1.0 + SPREAD * joint as f64);
                towards(joint, amplitude * (TAU * hertz * since_s).sin(), *ceiling)
            }
            Action::Chirp { joints, amplitude } if joints.contains(&joint) => {
                let [from, to] = CHIRP_HZ.map(|hertz| hertz * (1.0 + 0.07 * joint as f64));
                let turns = from * since_s + 0.5 * (to - from) / stage.duration_s * since_s * since_s;
                (amplitude * (TAU * turns).sin() + CENTRING * (held[joint] - positions[joint])).clamp(-0.9, 0.9)
            }
            Action::Chirp { .. } => 0.0,
        };
        (0..positions.len()).map(|joint| (duty(joint) / DUTY_STEP).round() * DUTY_STEP).collect()
    }
}

/// A reference that a controller of position and speed follows on every axis.
#[derive(Debug)]
pub struct Followed {
    duration_s: f64,
    period_s: f64,
    axes: Vec<Axis>,
}

#[derive(Debug, Clone)]
struct Axis {
    /// Amplitude, rad/s of phase and phase of each sine.
    slow: Vec<[f64; 3]>,
    fast: Vec<[f64; 3]>,
    tuning: Tuning,
    /// Of the speed, filtered, and the position before.
    speed: f64,
    before: Option<f64>,
}

/// Tuning of one axis, in units of the input.
#[derive(Debug, Clone, Copy)]
pub struct Tuning {
    /// Input per acceleration.
    pub inertia: f64,
    /// Closed-loop bandwidth, rad/s.
    pub bandwidth: f64,
    /// Largest input.
    pub limit: f64,
    /// Amplitude of the whole reference, rad or m.
    pub amplitude: f64,
    /// The fastest sine, Hz.
    pub hertz: f64,
}

/// The share of the motion that is slow, and how long one part takes to fade into the other, s.
const SLOW_SHARE: f64 = 0.45;
const FADE_S: f64 = 0.5;
/// How long the reference takes to rise from zero, s.
const RISE_S: f64 = 1.0;
/// Time constant of the controller's estimate of speed, s.
const SPEED_FILTER_S: f64 = 3e-3;

impl Followed {
    /// Slow sines, then fast ones, another set on every axis.
    pub fn draw(robot: &Robot, duration_s: f64, tunings: &[Tuning], rng: &mut ChaCha8Rng) -> Self {
        let mut sines = |amplitude: f64, hertz: [f64; 2], count: usize| -> Vec<[f64; 3]> {
            let each = amplitude / (count as f64).sqrt();
            let logarithms = hertz[0].ln()..hertz[1].ln();
            (0..count)
                .map(|_| [each, TAU * rng.random_range(logarithms.clone()).exp(), rng.random_range(0.0..TAU)])
                .collect()
        };
        let axes = tunings.iter().map(|tuning| {
            let Tuning { amplitude, hertz, .. } = *tuning;
            Axis {
                slow: sines(amplitude, [0.06 * hertz, 0.2 * hertz], 3),
                fast: sines(0.4 * amplitude, [0.25 * hertz, hertz], 5),
                tuning: *tuning,
                speed: 0.0,
                before: None,
            }
        });
        Self { duration_s, period_s: robot.sample_period_s, axes: axes.collect() }
    }

    fn input(&mut self, time_s: f64, positions: &[f64]) -> Vec<f64> {
        let (period_s, split_s) = (self.period_s, SLOW_SHARE * self.duration_s);
        let inputs = self.axes.iter_mut().zip(positions).map(|(axis, position)| {
            let [target, rate, acceleration] = axis.reference(time_s, split_s);
            axis.estimate(*position, period_s);
            let Tuning { inertia, bandwidth, limit, .. } = axis.tuning;
            let correction = bandwidth * bandwidth * (target - position) + 1.6 * bandwidth * (rate - axis.speed);
            (inertia * (acceleration + correction)).clamp(-limit, limit)
        });
        inputs.collect()
    }
}

impl Axis {
    /// Position, speed and acceleration of the reference.
    fn reference(&self, time_s: f64, split_s: f64) -> [f64; 3] {
        let time_s = time_s.max(0.0);
        let sum = |sines: &[[f64; 3]]| {
            sines.iter().fold([0.0; 3], |[x, v, a], [amplitude, omega, phase]| {
                let (sin, cos) = (omega * time_s + phase).sin_cos();
                [x + amplitude * sin, v + amplitude * omega * cos, a - amplitude * omega * omega * sin]
            })
        };
        let (slow, fast) = (sum(&self.slow), sum(&self.fast));
        // It begins at rest; what that does to rate and acceleration is the controller's to correct.
        let share = (time_s / RISE_S).min(1.0);
        let rise = share * share * (3.0 - 2.0 * share);
        // The slow part keeps a share, so that fast moves visit the range.
        let fade = 1.0 / (1.0 + (-(time_s - split_s) / (0.2 * FADE_S)).exp());
        std::array::from_fn(|i| rise * (slow[i] * (1.0 - 0.3 * fade) + fast[i] * fade))
    }

    fn estimate(&mut self, position: f64, period_s: f64) {
        let difference = self.before.map_or(0.0, |before| (position - before) / period_s);
        self.before = Some(position);
        self.speed += (1.0 - (-period_s / SPEED_FILTER_S).exp()) * (difference - self.speed);
    }
}

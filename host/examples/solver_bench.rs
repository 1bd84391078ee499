//! How fast the calibration is, against the number of samples, threads and what the machine can do at all.
//!
//! ```sh
//! cargo run --release -p host --example solver_bench             # the table of the README
//! cargo run --release -p host --example solver_bench -- 100000   # these sizes only
//! ```
//!
//! Each size runs in a process of its own, on a simulated Doggy whose parameters lie around the identified ones of Table 1, started from
//! Table 1's guess: preset `paper` on one and two threads, preset `default` on two. The peak of arithmetic (a loop of multiply-adds) and of
//! memory (a copy) are measured in the same run; the share is that of the least arithmetic that the dense blocks of `paper` need.

use std::process::{Command, ExitCode};
use std::time::Instant;

use host::calibrate::{Preset, Status, calibrate};
use host::recording::{NO_PHASE, Recorder, Recording, Row, Session, Source, Tick};
use host::robot::Robot;
use host::simd::{LANES, Simd, Work, vectorised};
use host::simulate::{Plant, Truth};
use host::solve::levenberg::Settings;
use rand::{RngExt, SeedableRng, rngs::StdRng};
use rand_distr::{Distribution, StandardNormal};

const SIZES: [usize; 7] = [5_000, 20_000, 70_000, 100_000, 200_000, 500_000, 1_000_000];

/// Multiplications and additions of one sample and iteration: 12 states, 24 shared unknowns, all blocks dense, symmetry used.
const FLOP_PER_SAMPLE: f64 = 23_760.0;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.split_first() {
        Some((first, [samples])) if first == "--case" => samples.parse().map_or(ExitCode::FAILURE, case),
        _ => table(&arguments),
    }
}

/// Every size in a process of its own.
fn table(sizes: &[String]) -> ExitCode {
    let sizes: Vec<usize> =
        if sizes.is_empty() { SIZES.to_vec() } else { sizes.iter().filter_map(|size| size.parse().ok()).collect() };
    println!(
        "| samples | preset | threads | iterations | ms an iteration | whole, s | of all cores, s | share of peak | memory, MB | worst parameter |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for samples in sizes {
        let this = std::env::current_exe().expect("a running program has a path");
        let ended = Command::new(this).args(["--case", &samples.to_string()]).status();
        if !ended.is_ok_and(|status| status.success()) {
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

/// All runs of one size.
fn case(samples: usize) -> ExitCode {
    let robot = Robot::builtin("doggy").expect("doggy is built in");
    let (recording, truth) = simulated(&robot, samples);
    for (preset, threads) in [(Preset::Paper, 1), (Preset::Paper, 2), (Preset::Default, 2)] {
        reset_peak();
        let before = resident_mb("VmRSS");
        let (begin, cpu_s) = (Instant::now(), cpu_seconds());
        let settings = Settings { threads, ..Settings::default() };
        let found = match calibrate(&robot, &[&recording], preset, &settings, |_, _| {}) {
            Ok(found) => found,
            Err(error) => {
                eprintln!("{samples} samples: {error}");
                return ExitCode::FAILURE;
            }
        };
        let whole_s = begin.elapsed().as_secs_f64();
        let cpu_s = cpu_seconds() - cpu_s;
        let memory_mb = resident_mb("VmHWM") - before;
        let iteration_s =
            (found.seconds.linearise + found.seconds.factor + found.seconds.solve) / found.iterations as f64;
        let peak = peak_flops() * threads as f64;
        let share = FLOP_PER_SAMPLE * samples as f64 / iteration_s / peak;
        let worst = truth.iter().filter_map(|(name, value)| {
            let p = found.parameters.iter().find(|p| p.name == *name)?;
            Some((100.0 * (p.estimate / value - 1.0).abs(), name))
        });
        let (worst, name) = worst.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::NAN, &truth[0].0));
        let not = if found.status == Status::Converged { "" } else { " (not converged)" };
        println!(
            "| {samples} | {} | {threads} | {}{not} | {:.1} | {whole_s:.2} | {cpu_s:.2} | {:.0} % | {memory_mb:.0} | {name} {worst:.2} % |",
            if preset == Preset::Paper { "paper" } else { "default" },
            found.iterations,
            1e3 * iteration_s,
            100.0 * share,
        );
        eprintln!(
            "    start {:.3} s, linearise {:.3} s, factor {:.3} s, solve {:.3} s; machine: {:.1} GFLOP/s a core, copies {:.1} GB/s",
            found.seconds.start,
            found.seconds.linearise,
            found.seconds.factor,
            found.seconds.solve,
            peak_flops() * 1e-9,
            copy_rate() * 1e-9,
        );
    }
    ExitCode::SUCCESS
}

/// A recording of a robot that moves much: rest, slow moves, fast moves with chirps; and the true parameters of the dynamics.
fn simulated(robot: &Robot, samples: usize) -> (Recording, Vec<(&'static str, f64)>) {
    let mut rng = StdRng::seed_from_u64(1);
    let truth = Truth::drawn(robot, &mut rng);
    let mut plant = Plant::new(robot, &truth, Vec::new()).expect("no effect adds joints").with_step(5e-4);
    let mut recorder = Recorder::new(Session::of(robot.clone()));
    let channels = robot.channels();
    let mut duty = [0.0; 3];
    let mut target = [0.0; 3];
    for k in 0..samples {
        let mut noisy = |value: f64, sigma: f64| -> f64 {
            let noise: f64 = StandardNormal.sample(&mut rng);
            value + sigma * noise
        };
        let mut values = Vec::with_capacity(channels.len());
        for joint in 0..3 {
            values.push(noisy(plant.motor_position(joint), channels[joint].sigma));
        }
        for gyro in 0..2 {
            for (axis, rate) in plant.gyro_rate(gyro).into_iter().enumerate() {
                values.push(noisy(rate, channels[3 + 3 * gyro + axis].sigma));
            }
        }
        let row = Row {
            t_us: 1000 * k as u64,
            seq: k as u64,
            phase: NO_PHASE,
            tick: Tick::default(),
            duty: &duty,
            values: &values,
        };
        recorder.push(&row).expect("rows are in order");
        plant.advance(&duty, 1e-3);

        // Proportional control towards targets that jump, saturated at the stage's duty; a chirp on top in the fast stage.
        let time_s = 1e-3 * k as f64;
        let fast = (k / 5_000) % 3 != 0;
        for joint in 0..3 {
            let period = if fast { 350 } else { 1_500 };
            if (k + 137 * joint) % period == 0 {
                target[joint] = rng.random_range(-1.0..1.0) * if joint == 0 { 0.9 } else { 0.5 };
            }
            let limit = if fast { 0.9 } else { 0.15 };
            let sweep = 9.0 + 4.0 * (time_s * 0.7).sin();
            let chirp = if fast { 0.25 * (sweep * time_s * 2.0 + joint as f64).sin() } else { 0.0 };
            duty[joint] = (3.0 * (target[joint] - plant.motor_position(joint)) + chirp).clamp(-limit, limit);
            if k < 1_500 {
                duty[joint] = 0.0;
            }
        }
    }
    let source = Source { path: "simulated".into(), sha256: String::new() };
    let values = truth.values(robot);
    let dynamics =
        ["k_pwm", "k_mi", "b", "mu[1]", "mu[2]", "mu[3]", "k_s[1]", "k_s[2]", "k_s[3]", "d_s[1]", "d_s[2]", "d_s[3]"];
    let of = |name: &'static str| Some((name, values.iter().find(|value| value.name == name)?.value));
    (recorder.finish(source), dynamics.into_iter().filter_map(of).collect())
}

/// Multiply-adds of one core, flop/s: twelve sums, so that none waits for another.
fn peak_flops() -> f64 {
    const ROUNDS: usize = 2_000_000;
    struct Loop(f64, f64);
    impl Work for Loop {
        type Output = f64;
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> f64 {
            let (a, b) = (simd.splat(self.0), simd.splat(self.1));
            let mut sums = [simd.splat(1.0); 12];
            for _ in 0..ROUNDS {
                for sum in &mut sums {
                    *sum = simd.mul_add(*sum, a, b);
                }
            }
            let mut total = 0.0;
            for sum in sums {
                total += simd.store(sum)[0];
            }
            total
        }
    }
    let seconds = (0..5).map(|_| {
        let clock = Instant::now();
        std::hint::black_box(vectorised(std::hint::black_box(Loop(0.999, 1e-3))));
        clock.elapsed().as_secs_f64()
    });
    (2 * LANES * 12 * ROUNDS) as f64 / seconds.fold(f64::INFINITY, f64::min)
}

/// Bytes read and written by a copy, a second.
fn copy_rate() -> f64 {
    let from = vec![1.0f64; 8 << 20];
    let mut to = vec![0.0f64; from.len()];
    let seconds = (0..5).map(|_| {
        let clock = Instant::now();
        std::hint::black_box(&mut to).copy_from_slice(std::hint::black_box(&from));
        clock.elapsed().as_secs_f64()
    });
    (16 * from.len()) as f64 / seconds.fold(f64::INFINITY, f64::min)
}

/// Time that this process has had of all cores, s (to 10 ms); not a number where the system does not tell.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let behind_name = stat.rsplit(')').next().unwrap_or_default();
    let mut fields = behind_name.split_whitespace().skip(11).map_while(|field| field.parse::<f64>().ok());
    match (fields.next(), fields.next()) {
        (Some(user), Some(system)) => (user + system) / 100.0,
        _ => f64::NAN,
    }
}

/// Makes the peak of memory that of now, where the system can.
fn reset_peak() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// An entry of /proc/self/status, MB; not a number where there is none.
fn resident_mb(entry: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix(entry)?.strip_prefix(':'));
    let kilobytes = line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok());
    kilobytes.unwrap_or(f64::NAN) / 1024.0
}

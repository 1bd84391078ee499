//! How fast the calibration is, against the number of samples, threads and what the machine can do at all.
//!
//! ```sh
//! cargo run --release -p host --example solver_bench             # the table of the README
//! cargo run --release -p host --example solver_bench -- 100000   # these sizes only
//! ```
//!
//! Each size runs in a process of its own, on a simulated Doggy whose parameters lie around the identified ones of Table 1, started from
//! Table 1's guess: preset `paper` on one and two threads, preset `default` on two. The peak of arithmetic (a loop of multiply-adds) and of
//! memory (a copy) are measured in the same run; the share is that of the least arithmetic that the dense blocks of `paper` need where they are
//! factorised anew.

use std::process::{Command, ExitCode};
use std::time::Instant;

use host::calibrate::{Preset, Status, calibrate};
use host::recording::Recording;
use host::robot::Robot;
use host::simulate::{Direct, Options, SimulateError};
use solve::levenberg::Settings;
use solve::simd::{LANES, Simd, Work, vectorised};

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
        "| samples | preset | threads | iterations | of these by an old factor | ms an iteration | whole, s | of all cores, s | share of peak | memory, MB | worst parameter |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
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
    let (recording, truth) = match simulated(&robot, samples) {
        Ok(simulated) => simulated,
        Err(error) => {
            eprintln!("{samples} samples: {error}");
            return ExitCode::FAILURE;
        }
    };
    let samples = recording.len();
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
        let eliminations = found.factorisations as f64 / found.iterations as f64;
        let share = FLOP_PER_SAMPLE * samples as f64 * eliminations / iteration_s / peak;
        let worst = truth.iter().filter_map(|(name, value)| {
            let p = found.parameters.iter().find(|p| p.name == *name)?;
            Some((100.0 * (p.estimate / value - 1.0).abs(), name))
        });
        let (worst, name) = worst.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::NAN, &truth[0].0));
        let not = if found.status == Status::Converged { "" } else { " (not converged)" };
        println!(
            "| {samples} | {} | {threads} | {}{not} | {} | {:.1} | {whole_s:.2} | {cpu_s:.2} | {:.0} % | {memory_mb:.0} | {name} {worst:.2} % |",
            if preset == Preset::Paper { "paper" } else { "default" },
            found.iterations,
            found.iterations - found.factorisations,
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

/// Names and values of the dynamics' parameters.
type Dynamics = Vec<(&'static str, f64)>;

/// A recording of a motion that lasts as many ticks, and the truth.
fn simulated(robot: &Robot, samples: usize) -> Result<(Recording, Dynamics), SimulateError> {
    let options = Options { seed: 1, ..Options::new(robot.clone()) };
    let Direct { recording, truth, .. } = Direct::record(&options, &motion(samples))?;
    let dynamics =
        ["k_pwm", "k_mi", "b", "mu[1]", "mu[2]", "mu[3]", "k_s[1]", "k_s[2]", "k_s[3]", "d_s[1]", "d_s[2]", "d_s[3]"];
    let of = |name: &'static str| Some((name, truth.iter().find(|value| value.name == name)?.value));
    Ok((recording, dynamics.into_iter().filter_map(of).collect()))
}

/// A motion file of `duration_ms` for three joints: rest, then rounds of half a minute of slow and fast sines and of chirps, of each joint
/// and of all; longer rounds where there would be too many.
fn motion(duration_ms: usize) -> String {
    const ROUND_MS: usize = 30_000;
    const MOST_ROUNDS: usize = 15;
    let rest_ms = 1_500.min(duration_ms / 3);
    let rounds = (duration_ms / ROUND_MS).clamp(1, MOST_ROUNDS);
    let mut text = format!(
        "name = \"bench\"\nstages = [\"rest\", \"slow\", \"fast\"]\ngain = [1.8, 3.0, 3.0]\n\n\
         [[segments]]\nstage = 0\naction.zero = {{ duration_ms = {rest_ms} }}\n"
    );
    let sine = |ceiling: f64, amplitude: f64, hz: f64| {
        format!(
            "sine = {{ joints = [1, 2, 3], amplitude = {amplitude}, frequency_hz = {hz}, spread = 0.3, ceiling = {ceiling:?}"
        )
    };
    let chirp = |joints: &str, spread: f64| {
        format!(
            "chirp = {{ joints = {joints}, amplitude = 0.9, from_hz = 1.4, to_hz = 10.0, spread = {spread:?}, centring = 1.5"
        )
    };
    // Stage, what is done, and its share of a round in percent.
    let parts = [
        (1, sine(0.15, 0.25, 0.35), 30),
        (2, sine(0.9, 0.3, 0.8), 30),
        (2, chirp("[1]", 0.0), 8),
        (2, chirp("[2]", 0.0), 8),
        (2, chirp("[3]", 0.0), 8),
        (2, chirp("[1, 2, 3]", 0.07), 16),
    ];
    // Ends of the parts in whole milliseconds: together they last what was asked for.
    let whole = (duration_ms - rest_ms) as f64;
    let (mut shares, mut from_ms) = (0, 0);
    for _ in 0..rounds {
        for (stage, action, share) in &parts {
            shares += share;
            let to_ms = (whole * f64::from(shares) / (100 * rounds) as f64).round() as usize;
            let length_ms = to_ms - from_ms;
            from_ms = to_ms;
            text += &format!("\n[[segments]]\nstage = {stage}\naction.{action}, duration_ms = {length_ms} }}\n");
        }
    }
    text
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

//! The page of `host calibrate`, and its sections for pages that hold more.

use super::number::{percent, significant, with_error};
use super::{Bar, BarChart, Cell, Page, Section, Table, Tone};
use crate::calibrate::{Calibration, NoiseSource, ParameterEstimate, Preset, Status};
use crate::robot::Symbol;

/// The whole page.
pub fn page(calibration: &Calibration) -> Page {
    let mut page = Page::new(format!("Calibration of {}", calibration.robot)).lead(verdict(calibration));
    for used in &calibration.recordings {
        let gaps = match used.missing_ticks {
            0 => "no tick missing".to_owned(),
            n => format!("{n} ticks missing in {} gaps, where the chain of states is broken", used.gaps),
        };
        page = page.fact("recording", format!("{}: {} samples, {gaps}", used.path, used.samples));
    }
    page = page.fact("preset", preset(calibration.preset));
    if !calibration.extensions.is_empty() {
        page = page.fact("extended by", calibration.extensions.join(", "));
    }
    page.push(parameters(calibration, None));
    page.push(fit(calibration));
    page
}

fn verdict(calibration: &Calibration) -> String {
    let count = calibration.parameters.iter().filter(|p| p.identifiable).count();
    let all = calibration.parameters.len();
    match calibration.status {
        Status::Converged => {
            format!("The calibration converged: {count} of {all} parameters have an estimate with an interval.")
        }
        Status::Almost => {
            format!("The calibration came to rest just before its goal: {count} of {all} parameters are usable.")
        }
        Status::Unidentifiable => format!(
            "The calibration converged, but this motion does not show every parameter: {count} of {all} are determined, \
             the rest is listed below."
        ),
        Status::DoesNotFit => format!("The model does not fit: {}.", calibration.misfit.join("; ")),
        Status::NoProgress => "The calibration got stuck: the numbers below are no minimum. Do not use them.".into(),
        Status::IterationLimit => {
            "The calibration used up its iterations: the numbers below are no minimum. Do not use them.".into()
        }
    }
}

fn preset(preset: Preset) -> &'static str {
    match preset {
        Preset::Default => "default: Runge–Kutta steps, every gyro predicted from the state",
        Preset::Paper => "paper: Euler steps and the paper's noise, which bias friction and damping",
    }
}

/// The true value of a parameter by its name, where it is known.
pub type Truth<'a> = &'a dyn Fn(&str) -> Option<f64>;

/// Every parameter before and after with its interval. `truth` is the true value of a simulated robot's parameter.
pub fn parameters(calibration: &Calibration, truth: Option<Truth<'_>>) -> Section {
    let mut section = Section::new("Parameters");
    let usable = if calibration.status.is_usable() { Tone::Good } else { Tone::Bad };
    section.figures([
        ("iterations", calibration.iterations.to_string(), usable),
        ("computing time", format!("{} s", significant(calibration.seconds.total, 3)), Tone::Plain),
        ("χ² per degree of freedom", significant(2.0 * calibration.cost / calibration.dof, 4), Tone::Plain),
    ]);
    let mut table = Table::new().words("parameter").words("unit").numbers("start", "");
    if truth.is_some() {
        table = table.numbers("truth", "");
    }
    table = table.numbers("estimate", "± standard error").numbers("95 % interval", "");
    if truth.is_some() {
        table = table.numbers("error", "of the truth").numbers("", "standard errors");
    }
    for p in &calibration.parameters {
        let known = truth.map(|truth| truth(&p.name));
        let mut row: Vec<Cell> = vec![p.name.as_str().into(), p.unit.as_str().into(), significant(p.initial, 5).into()];
        row.extend(known.map(|known| known.map_or_else(String::new, |v| significant(v, 6)).into()));
        row.push(estimate(p));
        row.push(p.ci95.map_or_else(String::new, |[low, high]| interval(low, high, p.std_error)).into());
        if let Some(known) = known {
            let error = known.filter(|_| p.identifiable).map(|v| p.estimate - v);
            let share = error.zip(known).filter(|(_, v)| *v != 0.0).map(|(e, v)| e / v.abs());
            row.push(share.map_or_else(String::new, percent).into());
            let sigmas = error.zip(p.std_error).map(|(e, s)| (e / s).abs());
            let tone = sigmas.map_or(Tone::Plain, |s| if s <= 3.0 { Tone::Good } else { Tone::Warning });
            row.push(Cell::toned(sigmas.map_or_else(String::new, |s| format!("{s:.1}")), tone));
        }
        table.row(row);
    }
    section.table(&table.caption(
        "Torques, stiffness and damping are on the link side of the gear. R_imu is the turn of a gyro from its nominal \
         mounting, in rad about the body's axes.",
    ));
    if !calibration.unobservable.is_empty() {
        section.heading("What these recordings cannot tell");
        section.list(calibration.unobservable.iter().map(|u| {
            let names: Vec<String> = u.direction.iter().map(|(name, share)| with_share(name, *share)).collect();
            format!("{}: {}. It is held where it started.", names.join(" + "), u.reason)
        }));
    }
    section
}

/// A parameter's share of a direction; the whole of it needs no number.
fn with_share(name: &str, share: f64) -> String {
    if share > 0.995 { name.to_owned() } else { format!("{} {name}", significant(share, 2)) }
}

fn estimate(p: &ParameterEstimate) -> Cell {
    if p.identifiable {
        with_error(p.estimate, p.std_error).into()
    } else {
        Cell::toned(format!("{} (not shown by the data)", significant(p.estimate, 4)), Tone::Muted)
    }
}

fn interval(low: f64, high: f64, error: Option<f64>) -> String {
    // To the digits that the error gives the estimate.
    let end = |v: f64| with_error(v, error).split(" ±").next().unwrap_or_default().to_owned();
    format!("{} … {}", end(low), end(high))
}

/// How well the estimated states and parameters fit each channel.
pub fn fit(calibration: &Calibration) -> Section {
    let mut section = Section::new("Fit per channel");
    let estimated = calibration.noise_source == NoiseSource::Estimated;
    section.prose(if estimated {
        "What is left between the readings and the fitted motion, over the noise that was estimated from it. A ratio of 1 is right; \
         another one says that what is left is not noise of one size: the model misses something."
    } else {
        "What is left between the readings and the fitted motion. A ratio of 1 to the assumed noise is right; well \
         below 1 the states follow the noise, well above 1 the model misses something."
    });
    let (of_noise, over_noise) = match calibration.noise_source {
        NoiseSource::Estimated => ("estimated noise σ", "Residual over estimated noise"),
        NoiseSource::Fixed => ("assumed noise σ", "Residual over assumed noise"),
    };
    let mut table = Table::new()
        .words("channel")
        .words("unit")
        .numbers(of_noise, "")
        .numbers("residual", "rms")
        .numbers("", "% of the signal")
        .numbers("left out", "readings");
    let mut chart = BarChart::new(format!("{} (σ)", over_noise.to_lowercase())).threshold(1.0, "the noise");
    for (noise, fit) in calibration.noise.iter().zip(&calibration.fit) {
        let ratio = noise.chi2_per_dof.map(f64::sqrt);
        table.row([
            noise.channel.as_str().into(),
            noise.unit.as_str().into(),
            significant(noise.sigma, 3).into(),
            fit.rms.map_or_else(|| "no row".into(), |rms| significant(rms, 3)).into(),
            fit.nrmse.map_or_else(String::new, |n| percent(n).trim_end_matches(" %").to_owned()).into(),
            Cell::toned(noise.left_out.to_string(), if noise.left_out > 0 { Tone::Warning } else { Tone::Plain }),
        ]);
        if let Some(ratio) = ratio {
            let tone = if (0.7..1.3).contains(&ratio) { Tone::Good } else { Tone::Warning };
            chart = chart.bar(Bar::new(&noise.channel, ratio).tone(tone));
        }
    }
    section.bars(over_noise, &chart);
    section.table(&table.caption(
        "Readings left out stand alone, more than six standard deviations from what the model and their neighbours say.",
    ));
    process_noise(calibration, &mut section);
    section
}

/// What a step of the model misses, beside the channels' noise.
fn process_noise(calibration: &Calibration, section: &mut Section) {
    section.heading("What one step of the model misses");
    let mut table = Table::new()
        .words("state")
        .words("unit")
        .numbers("σ a step", "")
        .numbers("least", "the integration's own error")
        .numbers("χ² per degree of freedom", "");
    for noise in calibration.noise.iter().skip(calibration.fit.len()) {
        table.row([
            noise.channel.trim_start_matches("process.").into(),
            noise.unit.as_str().into(),
            significant(noise.sigma, 3).into(),
            noise.floor.map_or_else(String::new, |floor| significant(floor, 3)).into(),
            noise.chi2_per_dof.map_or_else(String::new, |chi2| significant(chi2, 3)).into(),
        ]);
    }
    section.table(&table.caption(match calibration.noise_source {
        NoiseSource::Estimated => {
            "Estimated with the rest: where σ is well above the least, something shakes the robot, or the model misses something."
        }
        NoiseSource::Fixed => "As the preset assumes.",
    }));
}

/// The paper's assumptions on the same recording: what they make of the parameters, beside the default's.
///
/// `period_s` is the time between samples, which Euler's damping is proportional to.
pub fn paper_beside_default(default: &Calibration, paper: &Calibration, period_s: f64) -> Section {
    let mut section = Section::new("The paper's assumptions on the same recording");
    section.prose(
        "The preset `paper` reproduces the paper's problem: explicit Euler steps of one sample and its loose process \
         noise. Both bias the result. Euler's method damps a spring by −k_s T_s, so the fit finds d_s too high by \
         about k_s T_s. The loose noise lets the states follow the gyros' noise and swallows friction: μ comes out low.",
    );
    let shares = |symbol: Symbol| {
        let of_symbol = default.parameters.iter().filter(move |p| p.name.split('[').next() == Some(symbol.name()));
        of_symbol
            .filter_map(|p| paper.parameter(&p.name).map(|other| percent(other.estimate / p.estimate - 1.0)))
            .collect::<Vec<_>>()
            .join(", ")
    };
    section.prose(format!(
        "Against the preset `default`, on this recording: μ {}, d_s {}.",
        shares(Symbol::Mu),
        shares(Symbol::DS)
    ));
    let symbol = |name: &str| name.split('[').next().unwrap_or(name).to_owned();
    let euler = |p: &ParameterEstimate| {
        let stiffness = p.name.replacen(Symbol::DS.name(), Symbol::KS.name(), 1);
        default.parameter(&stiffness).filter(|_| symbol(&p.name) == Symbol::DS.name()).map(|k| k.estimate * period_s)
    };
    let mut table = Table::new()
        .words("parameter")
        .words("unit")
        .numbers("default", "")
        .numbers("paper", "")
        .numbers("paper − default", "")
        .numbers("", "% of default")
        .numbers("k_s T_s", "what Euler adds to d_s");
    for p in &default.parameters {
        let Some(other) = paper.parameter(&p.name) else { continue };
        let sensor = ["bias", "R_imu"].iter().any(|s| symbol(&p.name).starts_with(s));
        if sensor || !p.identifiable {
            continue;
        }
        let difference = other.estimate - p.estimate;
        let share = difference / p.estimate.abs();
        let tone = if share.abs() > 0.05 { Tone::Warning } else { Tone::Plain };
        table.row([
            p.name.as_str().into(),
            p.unit.as_str().into(),
            with_error(p.estimate, p.std_error).into(),
            with_error(other.estimate, other.std_error).into(),
            Cell::toned(significant(difference, 3), tone),
            Cell::toned(percent(share).trim_end_matches(" %"), tone),
            euler(p).map_or_else(String::new, |v| significant(v, 3)).into(),
        ]);
    }
    section.table(&table.caption(format!(
        "The paper's preset ended {} after {} iterations; its errors do not know of its biases.",
        match paper.status {
            Status::Converged | Status::Unidentifiable => "converged",
            Status::Almost => "almost converged",
            Status::DoesNotFit => "without a fit",
            Status::NoProgress | Status::IterationLimit => "without convergence",
        },
        paper.iterations
    )));
    section
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::{ChannelFit, ChannelNoise, Seconds, Unobservable};
    use crate::robot::Robot;

    fn parameter(name: &str, estimate: f64, error: Option<f64>) -> ParameterEstimate {
        ParameterEstimate {
            name: name.into(),
            unit: "N m".into(),
            initial: 2.0,
            estimate,
            std_error: error,
            ci95: error.map(|e| [estimate - 1.96 * e, estimate + 1.96 * e]),
            identifiable: error.is_some(),
        }
    }

    fn calibration(parameters: Vec<ParameterEstimate>) -> Calibration {
        Calibration {
            robot: "doggy".into(),
            robot_toml: Robot::builtin("doggy").unwrap().toml().into(),
            preset: Preset::Default,
            noise_source: NoiseSource::Estimated,
            extensions: Vec::new(),
            recordings: Vec::new(),
            status: Status::Converged,
            iterations: 9,
            factorisations: 7,
            cost: 50.0,
            dof: 100.0,
            seconds: Seconds { start: 0.1, noise: 0.3, linearise: 0.4, factor: 0.6, solve: 0.5, total: 1.6 },
            parameters,
            unobservable: vec![Unobservable {
                direction: vec![("R_imu1[z]".into(), 1.0)],
                reason: "rigid base".into(),
            }],
            rotations: Default::default(),
            noise: vec![ChannelNoise {
                channel: "gyro1.x".into(),
                unit: "rad/s".into(),
                sigma: 1e-3,
                floor: None,
                freedom: Some(0.99),
                chi2_per_dof: Some(1.0),
                left_out: 0,
            }],
            misfit: Vec::new(),
            notes: Vec::new(),
            pushes: Vec::new(),
            scatter: None,
            fit: vec![ChannelFit { channel: "gyro1.x".into(), rms: Some(1e-3), nrmse: Some(0.01) }],
            first_states: Vec::new(),
            covariance: Default::default(),
            correlations: Vec::new(),
        }
    }

    fn html(section: Section) -> String {
        let mut page = Page::new("t");
        page.push(section);
        page.to_html()
    }

    #[test]
    fn the_page_says_what_is_known_and_what_is_not() {
        let cal = calibration(vec![parameter("mu[1]", 1.6224, Some(0.0017)), parameter("R_imu1[z]", 0.0, None)]);
        let text = page(&cal).to_html();
        assert!(text.contains("1.6224 ± 0.0017") && text.contains("1.6191 … 1.6257"));
        assert!(text.contains("(not shown by the data)"));
        assert!(text.contains("<li>R_imu1[z]: rigid base. It is held where it started."));
        assert!(text.contains("1 of 2 parameters"));
    }

    #[test]
    fn the_truth_of_a_simulated_robot_stands_beside_the_estimate() {
        let cal = calibration(vec![parameter("mu[1]", 1.6224, Some(0.0017)), parameter("b", 2.0, Some(0.1))]);
        let truth = |name: &str| (name == "mu[1]").then_some(1.6211);
        let text = html(parameters(&cal, Some(&truth)));
        assert!(text.contains(">1.62110<") && text.contains(">0.080 %<") && text.contains(">0.8<"), "{text}");
    }

    #[test]
    fn the_papers_bias_is_shown_with_its_cause() {
        let default =
            calibration(vec![parameter("k_s[1]", 448.2, Some(0.01)), parameter("d_s[1]", 1.4945, Some(3e-4))]);
        let paper = calibration(vec![parameter("k_s[1]", 446.4, Some(0.7)), parameter("d_s[1]", 1.932, Some(0.023))]);
        let period = 1e-3;
        let text = html(paper_beside_default(&default, &paper, period));
        // d_s is 0.438 too high; Euler at 1 ms adds k_s T_s = 0.448.
        assert!(text.contains(">0.438<") && text.contains(">0.448<") && text.contains(">29<"), "{text}");
    }
}

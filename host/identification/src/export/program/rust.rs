//! The model as a file of Rust: `no_std`, no allocation, generic over `f32` and `f64`.

use std::fmt::Write;

use super::text::{Syntax, statements};
use super::{Program, Sizes, head};
use crate::export::{ExportError, Exported, Loss, loss};
use crate::model::expression::Function;
use crate::model::{Expression, Integrator, MOST_PARTS, WHOLE};

/// The file, and what it keeps.
///
/// # Errors
/// A model that cannot be written down.
pub fn rust(exported: &Exported<'_>) -> Result<(String, Vec<Loss>), ExportError> {
    let program = Program::of(exported)?;
    let mut losses = loss::of_programs(exported);
    losses.push(Loss::approximate("f32", "seven digits; f64 has all"));
    Ok((file(exported, &program, &losses), losses))
}

struct Rust(Sizes);

impl Syntax for Rust {
    fn number(&self, value: f64) -> String {
        format!("T::of({value:?})")
    }

    fn call(&self, function: Function, operand: &str) -> String {
        let name = match function {
            Function::Sin => "sin",
            Function::Cos => "cos",
            Function::Exp => "exp",
            Function::Ln => "ln",
            Function::Tanh => "tanh",
            Function::Sqrt => "sqrt",
            Function::Abs => "abs",
        };
        format!("Real::{name}({operand})")
    }

    fn where_positive(&self, condition: &str, then: &str, otherwise: &str) -> String {
        format!("(if {condition} > T::of(0.0) {{ {then} }} else {{ {otherwise} }})")
    }

    fn name(&self, name: &str, value: &str) -> String {
        format!("let {name} = {value};")
    }

    fn variable(&self, place: usize) -> String {
        variable(self.0, place, "t")
    }
}

/// A variable by its place: x, u, p, then the time.
pub(super) fn variable(sizes: Sizes, place: usize, time: &str) -> String {
    let (inputs, parameters) = (sizes.states, sizes.states + sizes.inputs);
    match place {
        _ if place < inputs => format!("x[{place}]"),
        _ if place < parameters => format!("u[{}]", place - inputs),
        _ if place < sizes.columns() => format!("p[{}]", place - parameters),
        _ => time.to_owned(),
    }
}

/// Places of a Jacobian that are not zero, as `by_x[i][j]`, by the way in which a language writes them.
pub(super) fn jacobian(
    slopes: &[Expression],
    sizes: Sizes,
    is_zero: impl Fn(Expression) -> bool,
    place: impl Fn(&str, usize, usize, usize) -> String,
) -> Vec<(String, Expression)> {
    let blocks = [("by_x", sizes.states), ("by_u", sizes.inputs), ("by_p", sizes.parameters)];
    let mut places = Vec::new();
    for (row, of_row) in slopes.chunks(sizes.columns()).enumerate() {
        let mut rest = of_row;
        for (name, width) in blocks {
            let (block, behind) = rest.split_at(width);
            let filled = block.iter().enumerate().filter(|(_, slope)| !is_zero(**slope));
            places.extend(filled.map(|(column, slope)| (place(name, row, column, width), *slope)));
            rest = behind;
        }
    }
    places
}

const ARGUMENTS: &str = "    x: &[T; STATES],\n    u: &[T; INPUTS],\n    p: &[T; PARAMETERS],\n    t: T,\n";

fn file(exported: &Exported<'_>, program: &Program, losses: &[Loss]) -> String {
    let sizes = program.sizes;
    let mut text = String::new();
    for line in head::of_program(exported, losses) {
        let _ = writeln!(text, "{}", format!("//! {line}").trim_end());
    }
    text += "\n#![allow(clippy::all, clippy::pedantic, unused_parens, unused_variables, dead_code)]\n\npub use real::Real;\n\n";
    let constants = [
        ("STATES", sizes.states, "Components of the state x."),
        ("INPUTS", sizes.inputs, "Inputs u."),
        ("PARAMETERS", sizes.parameters, "Parameters p."),
        ("READINGS", sizes.readings, "Readings y."),
        (
            "PARTS",
            exported.parts(),
            "Most equal parts of a step of the sample period: near rest friction is too steep for fewer.",
        ),
    ];
    for (name, value, about) in constants {
        let _ = writeln!(text, "/// {about}\npub const {name}: usize = {value};");
    }
    let period_s = exported.calibrated.robot().sample_period_s;
    let _ = writeln!(text, "/// The sample period, s.\npub const SAMPLE_PERIOD_S: f64 = {period_s:?};");
    let quoted = |names: Vec<&str>| names.into_iter().map(|name| format!("{name:?}")).collect::<Vec<_>>();
    let numbers = |values: Vec<f64>| values.into_iter().map(|value| format!("{value:?}")).collect::<Vec<_>>();
    let parameters = &exported.parameters;
    let mut table = |about: &str, name: &str, kind: &str, items: Vec<String>| {
        let _ = write!(text, "/// {about}\npub const {name}: {kind} = [\n{}];\n", head::wrapped(items, "    "));
    };
    table(
        "Names of the states.",
        "STATE_NAMES",
        "[&str; STATES]",
        quoted(exported.states.iter().map(|s| &*s.name).collect()),
    );
    table(
        "Names of the parameters.",
        "PARAMETER_NAMES",
        "[&str; PARAMETERS]",
        quoted(parameters.iter().map(|p| &*p.name).collect()),
    );
    table(
        "Their calibrated values.",
        "CALIBRATED",
        "[f64; PARAMETERS]",
        numbers(parameters.iter().map(|p| p.value).collect()),
    );
    table(
        "Their standard errors; NaN where the recordings do not determine one.",
        "STD_ERRORS",
        "[f64; PARAMETERS]",
        parameters.iter().map(|p| p.std_error.map_or("f64::NAN".to_owned(), |error| format!("{error:?}"))).collect(),
    );
    table(
        "Names of the readings.",
        "READING_NAMES",
        "[&str; READINGS]",
        quoted(exported.readings.iter().map(|c| &*c.name).collect()),
    );
    table("Their standard deviations.", "SIGMAS", "[f64; READINGS]", numbers(exported.sigmas()));
    if let Some(covariance) = head::covariance(exported) {
        table(
            "Covariance of the parameters, by rows.",
            "COVARIANCE",
            "[f64; PARAMETERS * PARAMETERS]",
            numbers(covariance),
        );
    }
    text += "\n/// The calibrated parameters.\npub fn calibrated<T: Real>() -> [T; PARAMETERS] {\n    CALIBRATED.map(T::of)\n}\n";
    functions(&mut text, program);
    text += &step(exported);
    let real = observer::REAL_SOURCE;
    text += "\n/// Real numbers without the standard library.\npub mod real {\n";
    for line in real.lines() {
        let _ = writeln!(text, "{}", format!("    {line}").trim_end());
    }
    text + "}\n"
}

fn functions(text: &mut String, program: &Program) {
    let sizes = program.sizes;
    let places = |name: &str, values: &[Expression]| -> Vec<(String, Expression)> {
        values.iter().enumerate().map(|(i, value)| (format!("{name}[{i}]"), *value)).collect()
    };
    let is_zero = |expression: Expression| program.is_zero(expression);
    let slopes = |slopes: &[Expression]| {
        jacobian(slopes, sizes, is_zero, |name, row, column, _| format!("{name}[{row}][{column}]"))
    };
    let mut function = |about: &str, name: &str, outputs: &str, clear: &str, places: Vec<(String, Expression)>| {
        let _ = write!(text, "\n/// {about}\npub fn {name}<T: Real>(\n{ARGUMENTS}{outputs}) {{\n{clear}");
        for line in statements(program, &places, &Rust(sizes)) {
            let _ = writeln!(text, "    {line}");
        }
        text.push_str("}\n");
    };
    let clear = "    let zero = T::of(0.0);\n    by_x.iter_mut().for_each(|row| row.fill(zero));\n    by_u.iter_mut().for_each(|row| row.fill(zero));\n    by_p.iter_mut().for_each(|row| row.fill(zero));\n";
    let of_jacobian = |value: &str, rows: &str| {
        format!(
            "    {value}: &mut [T; {rows}],\n    by_x: &mut [[T; STATES]; {rows}],\n    by_u: &mut [[T; INPUTS]; {rows}],\n    by_p: &mut [[T; PARAMETERS]; {rows}],\n"
        )
    };
    function(
        "The state's rate of change, ẋ = f(x, u).",
        "rates",
        "    xdot: &mut [T; STATES],\n",
        "",
        places("xdot", &program.rates),
    );
    function(
        "The sensors' readings, without noise.",
        "readings",
        "    y: &mut [T; READINGS],\n",
        "",
        places("y", &program.readings),
    );
    let with = |value: &str, values: &[Expression], of: &[Expression]| [places(value, values), slopes(of)].concat();
    function(
        "The rates with their derivatives by state, inputs and parameters: `by_x[i][j]` = ∂ẋᵢ/∂xⱼ.",
        "rates_jacobian",
        &of_jacobian("xdot", "STATES"),
        clear,
        with("xdot", &program.rates, &program.rate_slopes),
    );
    function(
        "The readings with their derivatives.",
        "readings_jacobian",
        &of_jacobian("y", "READINGS"),
        clear,
        with("y", &program.readings, &program.reading_slopes),
    );
}

/// The estimator's step in terms of `rates`.
fn step(exported: &Exported<'_>) -> String {
    let (about, stages) = match exported.integrator() {
        Integrator::Euler => ("explicit Euler", "[(0.0, 1.0)]"),
        Integrator::RungeKutta4 => (
            "the classical Runge-Kutta method",
            "[(0.0, 1.0 / 6.0), (0.5, 1.0 / 3.0), (0.5, 1.0 / 3.0), (1.0, 1.0 / 6.0)]",
        ),
    };
    let rubbing = exported.rubbing();
    let lags: Vec<String> =
        head::lags(exported).iter().map(|(state, p, share)| format!("({state}, {p}, {share:?})")).collect();
    let count = lags.len();
    let lags = lags.join(", ");
    let relaxations = if count == 0 {
        ""
    } else {
        "        // Lagging gyros relax exactly towards what they measure, however fast.\n        for (first, told, share) in LAGS {\n            let constant = T::of(share) * p[told];\n            let ratio = part / constant;\n            let carried = Real::exp(-ratio);\n            for i in first..first + 3 {\n                next[i] = carried * from[i];\n                for (stage, weight) in relaxation(ratio).into_iter().take(STAGES.len()).enumerate() {\n                    next[i] += weight * (constant * rates_at[stage][i] + states_at[stage][i]);\n                }\n            }\n        }\n"
    };
    let mut text = format!(
        "
/// Stages of a step: how far along the last slope, and the weight of the slope.
const STAGES: [(f64, f64); {stages_count}] = {stages};
/// First states of gyros that lag, the parameters that tell their time constants, and what share of these they are.
const LAGS: [(usize, usize, f64); {count}] = [{lags}];

/// Joints whose friction parts steps near rest: their speed, half the slope of friction's sign, the rate at which it takes a speed, 1/s.
const RUBBING: [(usize, f64, f64); {rubbing_count}] = [{rubbing}];

/// Parts of a step: none is longer than the time in which friction, as steep as at the least speed of the step, would stop a joint, and in none the
/// argument of friction's sign changes by more than one near a reversal. Friction that does little in a step leaves it whole.
fn parts_of_step<T: Real>(x: &[T; STATES], xdot: &[T; STATES], h: T) -> usize {{
    let mut parts = 1;
    if RUBBING.into_iter().all(|(_, _, per_s)| T::of(per_s) * h <= T::of({WHOLE:?})) {{
        return parts;
    }}
    for (speed, half_slope, per_s) in RUBBING {{
        let (begin, change) = (x[speed], h * xdot[speed]);
        let end = begin + change;
        let nearer = if Real::abs(begin) < Real::abs(end) {{ Real::abs(begin) }} else {{ Real::abs(end) }};
        let least = if begin * end > T::of(0.0) {{ nearer }} else {{ T::of(0.0) }};
        let sign = Real::tanh(T::of(half_slope) * least);
        let slope = T::of(1.0) - sign * sign;
        let rate = T::of(per_s) * h * slope;
        let turn = T::of(half_slope) * Real::abs(change) * Real::sqrt(slope);
        while parts < {MOST_PARTS} && (T::of(parts as f64) < rate || T::of(parts as f64) < turn) {{
            parts *= 2;
        }}
    }}
    parts
}}

/// The state `h` seconds after `x` by {about}, in as many equal parts as friction needs; inputs and time are held.
pub fn step<T: Real>(
{ARGUMENTS}    h: T,
    next: &mut [T; STATES],
) {{
    let zero = T::of(0.0);
    let mut begin = [zero; STATES];
    rates(x, u, p, t, &mut begin);
    let parts = parts_of_step(x, &begin, h);
    let part = h / T::of(parts as f64);
    let mut from = *x;
    for _ in 0..parts {{
        let mut rates_at = [[zero; STATES]; STAGES.len()];
        let mut states_at = [from; STAGES.len()];
        *next = from;
        for (stage, (along, weight)) in STAGES.into_iter().enumerate() {{
            if stage > 0 {{
                for i in 0..STATES {{
                    states_at[stage][i] = from[i] + T::of(along) * part * rates_at[stage - 1][i];
                }}
            }}
            let mut xdot = [zero; STATES];
            rates(&states_at[stage], u, p, t, &mut xdot);
            for i in 0..STATES {{
                next[i] += T::of(weight) * part * xdot[i];
            }}
            rates_at[stage] = xdot;
        }}
{relaxations}        from = *next;
    }}
}}
",
        stages_count = stages.matches('(').count(),
        rubbing_count = rubbing.len(),
        rubbing = rubbing.iter().map(|r| format!("{r:?}")).collect::<Vec<_>>().join(", "),
    );
    if count > 0 {
        text += &format!(
            "
/// The weights of a step of a relaxing state, by stages: of a parabola through begin, middle and end.
fn relaxation<T: Real>(ratio: T) -> [T; 4] {{
    let number = T::of;
    let carried = Real::exp(-ratio);
    // 1 - exp(-x) without what cancels.
    let i0 = Real::tanh(ratio * number(0.5)) * (number(1.0) + carried);
    let i1 = number(1.0) - i0 / ratio;
    let i2 = number(1.0) - number(2.0) * i1 / ratio;
    {weights}
}}
",
            weights = match exported.integrator() {
                Integrator::Euler => "[i0, number(0.0), number(0.0), number(0.0)]",
                Integrator::RungeKutta4 => {
                    "let middle = number(2.0) * i1 - number(2.0) * i2;\n    [i0 - number(3.0) * i1 + number(2.0) * i2, middle, middle, number(2.0) * i2 - i1]"
                }
            }
        );
    }
    text
}

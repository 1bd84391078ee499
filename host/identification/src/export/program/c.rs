//! The model as C99: one file of code and one header, no allocation, with what CasADi asks of external functions.

use std::fmt::Write;

use super::rust::{jacobian, variable};
use super::text::{Syntax, statements};
use super::{Program, Sizes, head};
use crate::export::{ExportError, Exported, Loss, loss};
use crate::model::expression::Function;
use crate::model::{Expression, Integrator, MOST_PARTS, WHOLE};

/// A header and its code.
#[derive(Debug, Clone, PartialEq)]
pub struct CFiles {
    /// The header.
    pub header: String,
    /// The code, which includes it by the name that it was asked for.
    pub code: String,
}

/// The files, the header to be called `header_name`, and what they keep.
///
/// # Errors
/// A model that cannot be written down.
pub fn c(exported: &Exported<'_>, header_name: &str) -> Result<(CFiles, Vec<Loss>), ExportError> {
    let program = Program::of(exported)?;
    let losses = losses(exported);
    Ok((c_files(exported, &program, header_name), losses))
}

/// The files of a model that is written down already.
pub(in crate::export) fn c_files(exported: &Exported<'_>, program: &Program, header_name: &str) -> CFiles {
    CFiles { header: header(exported, program, &losses(exported)), code: code(exported, program, header_name) }
}

fn losses(exported: &Exported<'_>) -> Vec<Loss> {
    let mut losses = loss::of_programs(exported);
    losses.push(Loss::approximate("float", "seven digits, with -DMODEL_REAL=float; double has all"));
    losses
}

struct C(Sizes);

impl Syntax for C {
    fn number(&self, value: f64) -> String {
        format!("R({value:?})")
    }

    fn call(&self, function: Function, operand: &str) -> String {
        let name = match function {
            Function::Sin => "sin",
            Function::Cos => "cos",
            Function::Exp => "exp",
            Function::Ln => "log",
            Function::Tanh => "tanh",
            Function::Sqrt => "sqrt",
            Function::Abs => "fabs",
        };
        format!("{name}({operand})")
    }

    fn where_positive(&self, condition: &str, then: &str, otherwise: &str) -> String {
        format!("({condition} > R(0) ? {then} : {otherwise})")
    }

    fn name(&self, name: &str, value: &str) -> String {
        format!("const real {name} = {value};")
    }

    fn variable(&self, place: usize) -> String {
        variable(self.0, place, "t")
    }
}

/// A comment, safe from what would end it.
fn comment(lines: &[String]) -> String {
    let lines = lines.iter().map(|line| format!(" * {}", line.replace("*/", "* /")).trim_end().to_owned());
    format!("/*\n{}\n */\n", lines.collect::<Vec<_>>().join("\n"))
}

fn arguments(word: &str) -> String {
    format!("const {word} *x, const {word} *u, const {word} *p, {word} t")
}

fn header(exported: &Exported<'_>, program: &Program, losses: &[Loss]) -> String {
    let (name, sizes) = (exported.identifier(), program.sizes);
    let upper = name.to_uppercase();
    let real = format!("{name}_real");
    let arguments = arguments(&real);
    let mut text = comment(&head::of_program(exported, losses));
    let _ = write!(
        text,
        "#ifndef {upper}_MODEL_H\n#define {upper}_MODEL_H\n\n#ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n\
         #ifndef MODEL_REAL\n#define MODEL_REAL double\n#endif\ntypedef MODEL_REAL {real};\n\n\
         enum {{ {upper}_STATES = {}, {upper}_INPUTS = {}, {upper}_PARAMETERS = {}, {upper}_READINGS = {},\n       \
         /* most equal parts of a step of the sample period */ {upper}_PARTS = {} }};\n\
         /* the sample period, s */\n#define {upper}_SAMPLE_PERIOD_S {:?}\n\n",
        sizes.states,
        sizes.inputs,
        sizes.parameters,
        sizes.readings,
        exported.parts(),
        exported.calibrated.robot().sample_period_s,
    );
    let _ = write!(
        text,
        "extern const char *const {name}_state_names[{upper}_STATES];\n\
         extern const char *const {name}_parameter_names[{upper}_PARAMETERS + 1];\n\
         extern const char *const {name}_reading_names[{upper}_READINGS];\n\
         /* calibrated values of the parameters */\nextern const {real} {name}_calibrated[{upper}_PARAMETERS + 1];\n\
         /* their standard errors; -1 where the recordings do not determine one */\nextern const {real} {name}_std_errors[{upper}_PARAMETERS + 1];\n\
         /* standard deviations of the readings */\nextern const {real} {name}_sigmas[{upper}_READINGS];\n"
    );
    if head::covariance(exported).is_some() {
        let _ = writeln!(
            text,
            "/* covariance of the parameters, by rows */\nextern const {real} {name}_covariance[{upper}_PARAMETERS * {upper}_PARAMETERS];"
        );
    }
    let _ = write!(
        text,
        "\n/* The state's rate of change, xdot = f(x, u). */\nvoid {name}_rates({arguments}, {real} *xdot);\n\
         /* The sensors' readings, without noise. */\nvoid {name}_readings({arguments}, {real} *y);\n\
         /* The same with derivatives by rows: by_x[i * {upper}_STATES + j] = d xdot_i / d x_j, and by inputs and parameters. */\n\
         void {name}_rates_jacobian({arguments}, {real} *xdot, {real} *by_x, {real} *by_u, {real} *by_p);\n\
         void {name}_readings_jacobian({arguments}, {real} *y, {real} *by_x, {real} *by_u, {real} *by_p);\n\
         /* The state h seconds after x; inputs and time are held. */\nvoid {name}_step({arguments}, {real} h, {real} *next);\n\n\
         /* CasADi (double only): external(\"{name}_f\", library), a function of x, u, p, t that gives xdot, and {name}_h, that gives y;\n \
         * their Jacobians are found by their names. */\n\n\
         #ifdef __cplusplus\n}}\n#endif\n\n#endif\n"
    );
    text
}

fn code(exported: &Exported<'_>, program: &Program, header_name: &str) -> String {
    let (name, sizes) = (exported.identifier(), program.sizes);
    let upper = name.to_uppercase();
    let mut text = comment(&exported.origin());
    let _ = write!(
        text,
        "#include \"{header_name}\"\n\n#include <string.h>\n#include <tgmath.h>\n\ntypedef {name}_real real;\n#define R(number) ((real)(number))\n\n"
    );
    let parameters = &exported.parameters;
    let quoted = |names: Vec<&str>| names.into_iter().map(|name| format!("{name:?}")).collect::<Vec<_>>();
    let numbers = |values: Vec<f64>| values.into_iter().map(|value| format!("R({value:?})")).collect::<Vec<_>>();
    let mut table = |kind: &str, of: &str, size: &str, items: Vec<String>| {
        let _ = write!(text, "const {kind}{name}_{of}[{size}] = {{\n{}}};\n", head::wrapped(items, "    "));
    };
    // One entry more: C has no tables of nothing.
    let with = |mut items: Vec<String>, last: &str| {
        items.push(last.to_owned());
        items
    };
    let (states, all, readings) =
        (format!("{upper}_STATES"), format!("{upper}_PARAMETERS + 1"), format!("{upper}_READINGS"));
    table("char *const ", "state_names", &states, quoted(exported.states.iter().map(|s| &*s.name).collect()));
    table("char *const ", "parameter_names", &all, with(quoted(parameters.iter().map(|p| &*p.name).collect()), "0"));
    table("char *const ", "reading_names", &readings, quoted(exported.readings.iter().map(|c| &*c.name).collect()));
    table("real ", "calibrated", &all, with(numbers(parameters.iter().map(|p| p.value).collect()), "R(0)"));
    let errors = parameters.iter().map(|p| p.std_error.unwrap_or(-1.0)).collect();
    table("real ", "std_errors", &all, with(numbers(errors), "R(0)"));
    table("real ", "sigmas", &readings, numbers(exported.sigmas()));
    if let Some(covariance) = head::covariance(exported) {
        table("real ", "covariance", &format!("{upper}_PARAMETERS * {upper}_PARAMETERS"), numbers(covariance));
    }
    functions(&mut text, &name, program);
    text += &step(exported, &name);
    text += &casadi(&name, sizes);
    text
}

fn functions(text: &mut String, name: &str, program: &Program) {
    let sizes = program.sizes;
    let places = |name: &str, values: &[Expression]| -> Vec<(String, Expression)> {
        values.iter().enumerate().map(|(i, value)| (format!("{name}[{i}]"), *value)).collect()
    };
    let slopes = |slopes: &[Expression]| {
        let place = |name: &str, row: usize, column: usize, width: usize| format!("{name}[{}]", row * width + column);
        jacobian(slopes, sizes, |expression| program.is_zero(expression), place)
    };
    let arguments = arguments("real");
    let mut function = |of: &str, outputs: &str, clear: &str, places: Vec<(String, Expression)>| {
        let _ = write!(
            text,
            "\nvoid {name}_{of}({arguments}, {outputs}) {{\n{clear}    (void)x, (void)u, (void)p, (void)t;\n"
        );
        for line in statements(program, &places, &C(sizes)) {
            let _ = writeln!(text, "    {line}");
        }
        text.push_str("}\n");
    };
    let clear = |rows: usize| {
        let one = |of: &str, width: usize| format!("    memset({of}, 0, {} * sizeof(real));\n", rows * width);
        [one("by_x", sizes.states), one("by_u", sizes.inputs), one("by_p", sizes.parameters)].concat()
    };
    function("rates", "real *xdot", "", places("xdot", &program.rates));
    function("readings", "real *y", "", places("y", &program.readings));
    let with = |value: &str, values: &[Expression], of: &[Expression]| [places(value, values), slopes(of)].concat();
    function(
        "rates_jacobian",
        "real *xdot, real *by_x, real *by_u, real *by_p",
        &clear(sizes.states),
        with("xdot", &program.rates, &program.rate_slopes),
    );
    function(
        "readings_jacobian",
        "real *y, real *by_x, real *by_u, real *by_p",
        &clear(sizes.readings),
        with("y", &program.readings, &program.reading_slopes),
    );
}

/// The estimator's step in terms of the rates.
fn step(exported: &Exported<'_>, name: &str) -> String {
    let upper = name.to_uppercase();
    let (stages, weights) = match exported.integrator() {
        Integrator::Euler => ("{{0, 1}}", "R(1) - carried, 0, 0, 0"),
        Integrator::RungeKutta4 => (
            "{{0, R(1) / 6}, {R(0.5), R(1) / 3}, {R(0.5), R(1) / 3}, {1, R(1) / 6}}",
            "i0 - 3 * i1 + 2 * i2, 2 * i1 - 2 * i2, 2 * i1 - 2 * i2, 2 * i2 - i1",
        ),
    };
    let count = stages.matches(',').count().div_ceil(2);
    let lags = head::lags(exported);
    let relaxations = if lags.is_empty() {
        String::new()
    } else {
        let list: Vec<_> = lags.iter().map(|(state, p, share)| format!("{{{state}, {p}, R({share:?})}}")).collect();
        format!(
            "        /* Lagging gyros relax exactly towards what they measure, however fast. */
        static const struct {{ int first, told; real share; }} lags[{lag_count}] = {{{list}}};
        for (int lag = 0; lag < {lag_count}; ++lag) {{
            const real constant = lags[lag].share * p[lags[lag].told], ratio = part / constant, carried = exp(-ratio);
            const real i0 = tanh(ratio / 2) * (1 + carried), i1 = 1 - i0 / ratio, i2 = 1 - 2 * i1 / ratio;
            const real weights[4] = {{{weights}}};
            (void)i2;
            for (int i = lags[lag].first; i < lags[lag].first + 3; ++i) {{
                next[i] = carried * from[i];
                for (int s = 0; s < {count}; ++s) next[i] += weights[s] * (constant * rates_at[s][i] + states_at[s][i]);
            }}
        }}
",
            lag_count = lags.len(),
            list = list.join(", "),
        )
    };
    let rubbing = exported.rubbing();
    let list: Vec<_> =
        rubbing.iter().map(|(speed, slope, rate)| format!("{{{speed}, R({slope:?}), R({rate:?})}}")).collect();
    format!(
        "
/* Parts of a step: none is longer than the time in which friction, as steep as at the least speed of the step, would stop a joint, and in none
   the argument of friction's sign changes by more than one near a reversal. Friction that does little in a step leaves it whole. */
static int parts_of_step(const real *x, const real *xdot, real h) {{
    static const struct {{ int speed; real half_slope, per_s; }} rubbing[{rub_size}] = {{{rub_list}}};
    int parts = 1, whole = 1;
    for (int i = 0; i < {rub_count}; ++i) whole = whole && rubbing[i].per_s * h <= R({WHOLE:?});
    for (int i = 0; i < {rub_count} && !whole; ++i) {{
        const real begin = x[rubbing[i].speed], change = h * xdot[rubbing[i].speed], end = begin + change;
        const real least = begin * end > 0 ? (fabs(begin) < fabs(end) ? fabs(begin) : fabs(end)) : 0;
        const real sign = tanh(rubbing[i].half_slope * least), slope = 1 - sign * sign;
        const real rate = rubbing[i].per_s * h * slope, turn = rubbing[i].half_slope * fabs(change) * sqrt(slope);
        while (parts < {most} && (parts < rate || parts < turn)) parts *= 2;
    }}
    return parts;
}}

void {name}_step({arguments}, real h, real *next) {{
    static const real stages[{count}][2] = {stages};
    real from[{upper}_STATES], rates_at[{count}][{upper}_STATES], states_at[{count}][{upper}_STATES];
    {name}_rates(x, u, p, t, rates_at[0]);
    const int parts = parts_of_step(x, rates_at[0], h);
    const real part = h / parts;
    memcpy(from, x, sizeof from);
    for (int k = 0; k < parts; ++k) {{
        memcpy(next, from, sizeof from);
        for (int s = 0; s < {count}; ++s) {{
            for (int i = 0; i < {upper}_STATES; ++i)
                states_at[s][i] = s == 0 ? from[i] : from[i] + stages[s][0] * part * rates_at[s - 1][i];
            {name}_rates(states_at[s], u, p, t, rates_at[s]);
            for (int i = 0; i < {upper}_STATES; ++i) next[i] += stages[s][1] * part * rates_at[s][i];
        }}
{relaxations}        memcpy(from, next, sizeof from);
    }}
}}
",
        arguments = arguments("real"),
        rub_size = rubbing.len().max(1),
        rub_count = rubbing.len(),
        rub_list = if list.is_empty() { "{0, 0, 0}".to_owned() } else { list.join(", ") },
        most = MOST_PARTS,
    )
}

/// What CasADi asks of an external function: dense matrices by columns.
fn casadi(name: &str, sizes: Sizes) -> String {
    let mut text = String::from(
        "
/* CasADi's interface of external functions. Matrices are dense, by columns. */
#ifndef MODEL_NO_CASADI
",
    );
    let _ = write!(
        text,
        "static void by_columns(const real *by_rows, double *out, int rows, int columns) {{
    if (out)
        for (int i = 0; i < rows; ++i)
            for (int j = 0; j < columns; ++j) out[j * rows + i] = by_rows[i * columns + j];
}}
static const real *or_zeros(const double *given, real *own, int count) {{
    for (int i = 0; i < count; ++i) own[i] = given ? given[i] : 0;
    return own;
}}
"
    );
    let Sizes { states, inputs, parameters, readings } = sizes;
    // One place more: C has no tables of nothing.
    let take = format!(
        "    real x[{states}], u[{inputs}], p[{}], t;\n    or_zeros(arg[0], x, {states}), or_zeros(arg[1], u, {inputs}), or_zeros(arg[2], p, {parameters}), or_zeros(arg[3], &t, 1);\n    (void)iw, (void)w, (void)mem;\n",
        parameters + 1
    );
    let sparsity = |rows: usize, columns: usize| {
        let mut list = vec![rows, columns];
        list.push(1);
        list.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")
    };
    for (short, of, rows) in [("f", "rates", states), ("h", "readings", readings)] {
        let inputs_of = [(states, "x"), (inputs, "u"), (parameters, "p"), (1, "t")];
        let _ = write!(
            text,
            "int {name}_{short}(const double **arg, double **res, long long *iw, double *w, int mem) {{
{take}    real out[{rows}];
    {name}_{of}(x, u, p, t, out);
    by_columns(out, res[0], {rows}, 1);
    return 0;
}}
int jac_{name}_{short}(const double **arg, double **res, long long *iw, double *w, int mem) {{
{take}    static const real zeros[{rows}];
    real out[{rows}], by_x[{}], by_u[{}], by_p[{}];
    {name}_{of}_jacobian(x, u, p, t, out, by_x, by_u, by_p);
    by_columns(by_x, res[0], {rows}, {states}), by_columns(by_u, res[1], {rows}, {inputs}), by_columns(by_p, res[2], {rows}, {parameters});
    by_columns(zeros, res[3], {rows}, 1);
    return 0;
}}
",
            rows * states,
            rows * inputs,
            rows * parameters + 1,
        );
        let mut interface = |function: &str, ins: Vec<(usize, usize)>, outs: Vec<(usize, usize)>| {
            let _ = writeln!(text, "long long {function}_n_in(void) {{ return {}; }}", ins.len());
            let _ = writeln!(text, "long long {function}_n_out(void) {{ return {}; }}", outs.len());
            for (way, list) in [("in", &ins), ("out", &outs)] {
                let _ = writeln!(text, "const long long *{function}_sparsity_{way}(long long i) {{");
                let all: Vec<_> =
                    list.iter().map(|(rows, columns)| format!("{{{}}}", sparsity(*rows, *columns))).collect();
                let _ = writeln!(text, "    static const long long dense[{}][3] = {{{}}};", list.len(), all.join(", "));
                let _ = writeln!(text, "    return i >= 0 && i < {} ? dense[i] : 0;\n}}", list.len());
            }
        };
        let ins: Vec<_> = inputs_of.iter().map(|(count, _)| (*count, 1)).collect();
        interface(&format!("{name}_{short}"), ins.clone(), vec![(rows, 1)]);
        let jacobians = ins.iter().map(|(count, _)| (rows, *count)).collect();
        interface(&format!("jac_{name}_{short}"), [ins, vec![(rows, 1)]].concat(), jacobians);
    }
    text + "#endif\n"
}

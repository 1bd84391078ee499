//! The coordinates in which a law is fitted, and the parameters that are told of them.
//!
//! A wave A sin(x + φ) is fitted as a pair (A cos φ, A sin φ), a quantity that must stay positive as its logarithm, differences that add
//! up to nothing as all but the last. Results carry the names of the catalogue.

use crate::model::Quantity;
use crate::robot::{JointKind, Robot};

/// What a parameter belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Of {
    /// Everything.
    All,
    /// One joint, 0-based.
    Joint(usize),
    /// One gyro, 0-based.
    Gyro(usize),
    /// One axis of a gyro.
    GyroAxis(usize, usize),
    /// x or y of passive joints.
    Axis(usize),
}

impl Of {
    /// As in names of results.
    fn index(self) -> String {
        const AXES: [&str; 3] = ["x", "y", "z"];
        match self {
            Of::All => String::new(),
            Of::Joint(i) | Of::Gyro(i) => format!("[{}]", i + 1),
            Of::GyroAxis(gyro, axis) => format!("[{}.{}]", gyro + 1, AXES[axis]),
            Of::Axis(axis) => format!("[{}]", AXES[axis]),
        }
    }
}

/// One number that is fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct LawCoordinate {
    /// What it belongs to.
    pub of: Of,
    /// Where it starts.
    pub start: f64,
}

/// How a result follows from the coordinates of its law, by their index there.
#[derive(Debug, Clone, PartialEq)]
pub enum Form {
    /// z_i.
    Is(usize),
    /// e^z_i.
    Exp(usize),
    /// c e^z_i.
    Scaled(usize, f64),
    /// √(c² + s²) of c = A cos φ, s = A sin φ.
    Amplitude(usize, usize),
    /// φ = atan2(s, c).
    Phase(usize, usize),
    /// As an amplitude, with the sign of c: φ lies within a quarter turn.
    SignedAmplitude(usize, usize),
    /// Its φ = atan(s / c).
    SignedPhase(usize, usize),
    /// − Σ z over these.
    MinusSum(Vec<usize>),
    /// A number that is chosen, not fitted.
    Chosen(f64),
}

impl Form {
    /// Whether it is a number of its own, neither chosen nor what others leave.
    pub(crate) fn is_own(&self) -> bool {
        !matches!(self, Form::MinusSum(_) | Form::Chosen(_))
    }

    /// The value, and its derivatives by the coordinates.
    pub fn value(&self, z: &[f64]) -> (f64, Vec<(usize, f64)>) {
        match *self {
            Form::Is(i) => (z[i], vec![(i, 1.0)]),
            Form::Exp(i) => (z[i].exp(), vec![(i, z[i].exp())]),
            Form::Scaled(i, c) => (c * z[i].exp(), vec![(i, c * z[i].exp())]),
            Form::Amplitude(c, s) | Form::SignedAmplitude(c, s) => {
                let signed = matches!(self, Form::SignedAmplitude(..)) && z[c] < 0.0;
                // At zero the direction is not defined; any will do.
                let amplitude = z[c].hypot(z[s]).max(f64::MIN_POSITIVE) * if signed { -1.0 } else { 1.0 };
                (amplitude, vec![(c, z[c] / amplitude), (s, z[s] / amplitude)])
            }
            Form::Phase(c, s) | Form::SignedPhase(c, s) => {
                let square = (z[c] * z[c] + z[s] * z[s]).max(f64::MIN_POSITIVE);
                let signed = matches!(self, Form::SignedPhase(..)) && z[c] < 0.0;
                let phase = if signed { (-z[s]).atan2(-z[c]) } else { z[s].atan2(z[c]) };
                (phase, vec![(c, -z[s] / square), (s, z[c] / square)])
            }
            Form::MinusSum(ref list) => {
                (-list.iter().map(|&i| z[i]).sum::<f64>(), list.iter().map(|&i| (i, -1.0)).collect())
            }
            Form::Chosen(value) => (value, Vec::new()),
        }
    }
}

/// One number of the results.
#[derive(Debug, Clone, PartialEq)]
pub struct LawResult {
    /// `effect_id.parameter[axis]`.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
    /// How it follows from the coordinates.
    pub form: Form,
    /// What it can be in a robot.
    pub range: [f64; 2],
    /// Less is not told from this.
    pub finest: Option<f64>,
}

/// The parameters of one law.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    id: &'static str,
    /// How the robot's joints move; of one that is not listed, by turning.
    kinds: Vec<JointKind>,
    /// What is fitted.
    pub coordinates: Vec<LawCoordinate>,
    /// What is told.
    pub results: Vec<LawResult>,
}

impl Parameters {
    /// None yet, of the effect `id`.
    pub fn new(id: &'static str) -> Self {
        Parameters { id, kinds: Vec::new(), coordinates: Vec::new(), results: Vec::new() }
    }

    /// None yet, of the effect `id` on the joints of `robot`: units are given for joints that turn, and told in those of the joint.
    pub fn on(id: &'static str, robot: &Robot) -> Self {
        Parameters { kinds: robot.joints.iter().map(|joint| joint.kind).collect(), ..Parameters::new(id) }
    }

    /// None yet, of the same effect on the same joints.
    pub fn cleared(&self) -> Self {
        Parameters { coordinates: Vec::new(), results: Vec::new(), ..self.clone() }
    }

    fn coordinate(&mut self, of: Of, start: f64) -> usize {
        self.coordinates.push(LawCoordinate { of, start });
        self.coordinates.len() - 1
    }

    fn result(&mut self, symbol: &str, unit: &'static str, of: Of, form: Form) {
        let unit = match (of, &form) {
            (_, Form::Phase(..) | Form::SignedPhase(..)) => unit,
            (Of::Joint(joint), _) => self.kinds.get(joint).map_or(unit, |&kind| unit_at(kind, unit)),
            _ => unit,
        };
        let name = format!("{}.{symbol}{}", self.id, of.index());
        self.results.push(LawResult { name, unit, form, range: [f64::NEG_INFINITY, f64::INFINITY], finest: None });
    }

    /// Where a search goes no farther: for each coordinate that is a result itself and has a range with two ends, half its width beyond either;
    /// for each logarithm, a factor of two beyond either, and not below the finest that is told.
    pub(crate) fn bounds(&self) -> impl Iterator<Item = (usize, [f64; 2])> + '_ {
        self.results.iter().filter_map(|result| {
            let [low, high] = result.range;
            let beyond = 0.5 * (high - low);
            match result.form {
                Form::Is(i) if beyond.is_finite() => Some((i, [low - beyond, high + beyond])),
                Form::Exp(i) | Form::Scaled(i, _) if high.is_finite() => {
                    let least = (0.5 * low.max(0.0)).max(result.finest.unwrap_or(0.0));
                    let scale = if let Form::Scaled(_, scale) = result.form { scale } else { 1.0 };
                    Some((i, [(least / scale).ln(), (2.0 * high / scale).ln()]))
                }
                _ => None,
            }
        })
    }

    /// Says what the results of this symbol, or the one of this symbol and index, can be in a robot. A fit is free to leave the range, though not farther than half its width, or twice
    /// or half of it where the logarithm is fitted; a diagnosis then does not believe it.
    pub fn within(&mut self, symbol: &str, range: [f64; 2]) {
        self.of_symbol(symbol).for_each(|result| result.range = range);
    }

    /// Says what the finest value of a logarithm of this symbol is that readings tell anything of: a search stays above it, and ends there where the truth is
    /// finer, which is no reason not to believe it.
    pub fn no_finer(&mut self, symbol: &str, finest: f64) {
        self.of_symbol(symbol).for_each(|result| result.finest = Some(finest));
    }

    fn of_symbol(&mut self, symbol: &str) -> impl Iterator<Item = &mut LawResult> {
        let name = format!("{}.{symbol}", self.id);
        let is_of = move |result: &&mut LawResult| {
            result.name.strip_prefix(&name).is_some_and(|rest| rest.is_empty() || rest.starts_with('['))
        };
        self.results.iter_mut().filter(is_of)
    }

    /// A number as it is. Gives its coordinate.
    pub fn plain(&mut self, symbol: &str, unit: &'static str, of: Of, start: f64) -> usize {
        let i = self.coordinate(of, start);
        self.result(symbol, unit, of, Form::Is(i));
        i
    }

    /// A number that stays positive, fitted by its logarithm.
    pub fn positive(&mut self, symbol: &str, unit: &'static str, of: Of, start: f64) -> usize {
        let i = self.coordinate(of, start.ln());
        self.result(symbol, unit, of, Form::Exp(i));
        i
    }

    /// The same, told as `scale` times what is fitted; `start` is of what is told.
    pub fn scaled(&mut self, symbol: &str, unit: &'static str, of: Of, scale: f64, start: f64) -> usize {
        let i = self.coordinate(of, (start / scale).ln());
        self.result(symbol, unit, of, Form::Scaled(i, scale));
        i
    }

    /// Amplitude and phase, fitted as (A cos φ, A sin φ). Gives the first coordinate.
    pub fn wave(&mut self, amplitude: (&str, &'static str), phase: &str, of: Of, start: [f64; 2]) -> usize {
        let (c, s) = (self.coordinate(of, start[0]), self.coordinate(of, start[1]));
        self.result(amplitude.0, amplitude.1, of, Form::Amplitude(c, s));
        self.result(phase, "rad", of, Form::Phase(c, s));
        c
    }

    /// The same with an amplitude of either sign and a phase within a quarter turn.
    pub fn signed_wave(&mut self, amplitude: (&str, &'static str), phase: &str, of: Of, start: [f64; 2]) -> usize {
        let (c, s) = (self.coordinate(of, start[0]), self.coordinate(of, start[1]));
        self.result(amplitude.0, amplitude.1, of, Form::SignedAmplitude(c, s));
        self.result(phase, "rad", of, Form::SignedPhase(c, s));
        c
    }

    /// One number a joint of `joints`, all together zero: the last is less the sum of the others.
    pub fn balanced(&mut self, symbol: &str, unit: &'static str, joints: &[usize]) {
        let Some((last, others)) = joints.split_last() else { return };
        let free: Vec<usize> = others.iter().map(|&joint| self.plain(symbol, unit, Of::Joint(joint), 0.0)).collect();
        self.result(symbol, unit, Of::Joint(*last), Form::MinusSum(free));
    }

    /// A number that is chosen, not fitted.
    pub fn chosen(&mut self, symbol: &str, unit: &'static str, value: f64) {
        self.result(symbol, unit, Of::All, Form::Chosen(value));
    }

    /// Indices of the coordinates that belong to these.
    pub fn of(&self, wanted: impl Fn(Of) -> bool) -> Vec<usize> {
        (0..self.coordinates.len()).filter(|&i| wanted(self.coordinates[i].of)).collect()
    }

    /// Coordinates at which the results have these values (in their order).
    pub fn recall<T: Quantity>(&self, values: &[T]) -> Vec<T> {
        let mut z: Vec<T> = self.coordinates.iter().map(|coordinate| T::from(coordinate.start)).collect();
        for (pair, result) in self.results.iter().enumerate() {
            let value = values[pair];
            match result.form {
                Form::Is(i) => z[i] = value,
                Form::Exp(i) => z[i] = value.ln(),
                Form::Scaled(i, c) => z[i] = (value * c.recip()).ln(),
                // The phase follows its amplitude.
                Form::Amplitude(c, s) | Form::SignedAmplitude(c, s) => {
                    let (sin, cos) = values[pair + 1].sin_cos();
                    (z[c], z[s]) = (value * cos, value * sin);
                }
                Form::Phase(..) | Form::SignedPhase(..) | Form::MinusSum(_) | Form::Chosen(_) => {}
            }
        }
        z
    }
}

/// The unit at a joint of this kind of what has `unit` at one that turns.
pub fn unit_at(kind: JointKind, unit: &'static str) -> &'static str {
    match (kind, unit) {
        (JointKind::Revolute, unit) => unit,
        (_, "N m") => "N",
        (_, "1/(N m)") => "1/N",
        (_, "N m/rad") => "N/m",
        (_, "N m/rad^3") => "N/m^3",
        (_, "N m s/rad") => "N s/m",
        (_, "N m s^2/rad^2") => "N s^2/m^2",
        (_, "rad") => "m",
        (_, "rad/s") => "m/s",
        (_, unit) => unit,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all_forms() -> Parameters {
        let mut p = Parameters::new("some");
        p.plain("a", "1", Of::All, 0.0);
        p.positive("k", "1", Of::Axis(0), 2.0);
        p.wave(("A", "1"), "phi", Of::Joint(0), [0.0; 2]);
        p.signed_wave(("G", "1"), "q0", Of::Joint(1), [0.0; 2]);
        p.balanced("d", "1", &[0, 1, 2]);
        p
    }

    #[test]
    fn a_search_goes_a_little_farther_than_a_robot_can() {
        let mut p = all_forms();
        assert_eq!(p.bounds().count(), 0);
        p.within("a", [-1.0, 3.0]);
        p.within("k", [1e-3, 0.5]);
        let bounds: Vec<_> = p.bounds().collect();
        assert_eq!(bounds, [(0, [-3.0, 5.0]), (1, [0.5e-3_f64.ln(), 1.0_f64.ln()])]);
        // One end alone is none; a logarithm needs no lower one.
        p.within("a", [0.0, f64::INFINITY]);
        p.within("k", [0.0, 0.05]);
        let bounds: Vec<_> = p.bounds().collect();
        assert_eq!(bounds, [(1, [f64::NEG_INFINITY, 0.1_f64.ln()])]);
        p.no_finer("k", 6e-4);
        let bounds: Vec<_> = p.bounds().collect();
        assert_eq!(bounds, [(1, [6e-4_f64.ln(), 0.1_f64.ln()])]);
    }

    #[test]
    fn results_have_the_slopes_of_differences_and_are_recalled() {
        let p = all_forms();
        let z = [0.3, -0.7, 0.4, -1.1, -0.8, 0.2, 0.5, -0.1];
        assert_eq!(p.coordinates.len(), z.len());
        let values: Vec<f64> = p.results.iter().map(|r| r.form.value(&z).0).collect();
        for (a, b) in p.recall(&values).iter().zip(&z) {
            assert!((a - b).abs() < 1e-14, "{a} {b}");
        }
        for result in &p.results {
            let mut by = vec![0.0; z.len()];
            for (i, slope) in result.form.value(&z).1 {
                by[i] += slope;
            }
            for (i, by) in by.iter().enumerate() {
                let moved = |d: f64| {
                    let mut z = z;
                    z[i] += d;
                    result.form.value(&z).0
                };
                let expected = (moved(1e-6) - moved(-1e-6)) / 2e-6;
                assert!((by - expected).abs() < 1e-8, "{}: {by} against {expected}", result.name);
            }
        }
        let names: Vec<_> = p.results.iter().map(|r| r.name.as_str()).collect();
        assert_eq!(names[..3], ["some.a", "some.k[x]", "some.A[1]"]);
        assert_eq!(values[6..].iter().sum::<f64>(), 0.0, "differences add up to nothing");
    }
}

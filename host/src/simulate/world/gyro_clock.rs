//! What makes a simulated gyro a real one: it converts by its own clock, whatever the tick is, and its filter delays.
//!
//! ```text
//!   t_k                              t_{k+1}
//!   │ read      conversions ──┴──────┴──────┴──   period = nominal / (1 + error), from the start of the motion on
//!   ω ─▶ second-order low-pass ─▶ conversion + noise ─▶ word
//! ```

use std::f64::consts::{SQRT_2, TAU};

use rand::RngExt;

use crate::effect::{Hidden, Line, Physics};
use crate::robot::{Robot, Vector3};
use crate::simulate::noise::{Purpose, stream};

/// What the gyros of a simulated robot are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GyroChips {
    /// Each converts at the moment at which it is read, without a filter.
    #[default]
    Ideal,
    /// Each has a clock and a filter of its own, of which the device tells what a real one can.
    Real,
    /// The same with "data ready" not wired: the age of their words is unknown.
    Unstamped,
}

/// Error of a part's clock at most: data sheets tell one per cent over all temperatures.
const MOST_OFF: f64 = 5e-3;
/// What times are rounded by, in periods: of a run of an hour, in ns, 1e-10.
const ROUNDING: f64 = 1e-9;
/// Cut-off of the filters together, Hz: the interface filter's 400 Hz alone, or with what else the part has before it. The delays are
/// 0.56 to 1.0 ms.
const CUT_OFF_HZ: [f64; 2] = [225.0, 400.0];

/// The clock of one gyro.
#[derive(Debug, Clone)]
pub(in crate::simulate) struct GyroClock {
    /// True over nominal rate.
    rate: f64,
    /// Where its first conversion lies in a period.
    phase: f64,
    /// From when on it counts, ns.
    origin_ns: f64,
}

impl GyroClock {
    /// The clocks of a robot's gyros, as a seed draws them.
    pub fn drawn(robot: &Robot, seed: u64) -> Vec<Self> {
        let mut rng = stream(seed, Purpose::GyroClock);
        let clock = |_| {
            let (rate, phase) = (1.0 + rng.random_range(-MOST_OFF..MOST_OFF), rng.random_range(0.0..1.0));
            GyroClock { rate, phase, origin_ns: 0.0 }
        };
        robot.gyros().map(clock).collect()
    }

    /// A motion begins: what it records depends on nothing that was before.
    pub fn begin_motion(&mut self, now_ns: f64) {
        self.origin_ns = now_ns;
    }

    /// The first conversion after a moment, by the nominal period; ns.
    pub fn next_ns(&self, after_ns: f64, nominal_ns: u64) -> f64 {
        let period_ns = nominal_ns as f64 / self.rate;
        // A conversion at that moment is over, whatever its time was rounded to.
        let passed = ((after_ns - self.origin_ns) / period_ns - self.phase + ROUNDING).floor();
        self.origin_ns + (passed + 1.0 + self.phase) * period_ns
    }
}

/// The filters of a robot's gyros: ÿ = ωc² (ω − y) − √2 ωc ẏ on each axis.
#[derive(Debug)]
struct GyroFilter {
    /// ωc of every gyro, rad/s.
    cut_off: Vec<f64>,
}

/// The filters of a robot's gyros, as a seed draws them, in the plant.
pub(in crate::simulate) fn filter(robot: &Robot, seed: u64) -> Hidden {
    let mut rng = stream(seed, Purpose::GyroFilter);
    let cut_off = robot.gyros().map(|_| TAU * rng.random_range(CUT_OFF_HZ[0]..CUT_OFF_HZ[1])).collect();
    Hidden { id: "gyro_filter", values: Vec::new(), physics: Box::new(GyroFilter { cut_off }) }
}

impl Physics for GyroFilter {
    fn states(&self) -> usize {
        6 * self.cut_off.len()
    }

    fn state_rates(&self, own: &[f64], line: &Line<'_>, out: &mut [f64]) {
        for (gyro, cut_off) in self.cut_off.iter().enumerate() {
            for axis in 0..3 {
                let (y, v) = (6 * gyro + axis, 6 * gyro + 3 + axis);
                out[y] = own[v];
                out[v] = cut_off * (cut_off * (line.gyro_rates[gyro][axis] - own[y]) - SQRT_2 * own[v]);
            }
        }
    }

    fn gyro_rate(&self, own: &[f64], gyro: usize, _rate: Vector3) -> Vector3 {
        [own[6 * gyro], own[6 * gyro + 1], own[6 * gyro + 2]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conversions_come_by_the_parts_own_clock() {
        let clock = GyroClock { rate: 1.01, phase: 0.25, origin_ns: 7e6 };
        let period = 500_000.0 / 1.01;
        let mut at = 7e6;
        for n in 0..1000 {
            at = clock.next_ns(at, 500_000);
            // 1 ns: sums of 1000 periods.
            assert!((at - (7e6 + (f64::from(n) + 0.25) * period)).abs() < 1.0, "{n}: {at}");
            // Whatever lies before a conversion leads to it.
            assert!((clock.next_ns(at - 0.4 * period, 500_000) - at).abs() < 1.0);
        }
    }

    #[test]
    fn a_filter_delays_a_ramp_by_what_its_cut_off_says() {
        let robot = Robot::builtin("doggy").unwrap();
        let Hidden { physics, .. } = filter(&robot, 5);
        let mut own = vec![0.0; physics.states()];
        let mut rates = vec![0.0; own.len()];
        let h = 1e-5;
        for k in 0..2000 {
            let rate = [f64::from(k) * h; 3];
            let line = Line { joints: &[], motor_torque: &[], gyro_rates: &[rate; 2] };
            physics.state_rates(&own, &line, &mut rates);
            own.iter_mut().zip(&rates).for_each(|(own, rate)| *own += h * rate);
        }
        for gyro in 0..2 {
            let delay = 2000.0 * h - physics.gyro_rate(&own, gyro, [0.0; 3])[2];
            // √2 / ωc, and a step of the explicit integration.
            assert!((0.56e-3 - 2.0 * h..1.0e-3 + 2.0 * h).contains(&delay), "{delay}");
        }
    }
}

//! Parameters that noise in the states seems to show, and draws away from the truth.
//!
//! States and parameters are fitted together. What a joint does by noise alone then counts as motion that shows its belt, and the estimate is
//! not that of the likelihood of the readings, which has the states integrated out:
//!
//! ```text
//! −ln p(readings | p) = ½ Σ r² at the states that suit p  +  ½ ln |H_xx(p)|  + what does not depend on p
//! ```
//!
//! H_xx is the states' own block of the normal matrix. The fit by squares leaves this term out, and so errs by S⁻¹ ∂(½ ln |H_xx|)/∂p, S the
//! information of the parameters. A motion made for calibration shows every parameter so well that this is nothing. Where it does not, the slope
//! is measured. A parameter that errs by more than half a standard error has a wider interval, with room for the error; one that errs by more than
//! four, that owes the noise more than half of what seems known, or that the motion alone shows to worse than ± 50 %, is given no number.

use nalgebra::{DMatrix, DVector};

use crate::calibrate::identifiability::identify::Guess;
use crate::calibrate::identifiability::observability::Held;
use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::Problem;
use crate::calibrate::search::Found;
use solve::error::SolveError;
use solve::factor::Factor;
use solve::inverse::log_determinant_of_states;
use solve::{LeastSquares, Step};

/// Standard error of noise-free predictions, in units of the guess, up to which the motion itself shows a parameter well enough.
const OPEN: f64 = 0.01;
/// Variance at smoothed states over that of noise-free predictions, below which more than half of the information is noise.
const MOST_NOISE: f64 = 0.5;
/// Standard errors that an estimate may be drawn by before its interval has to tell.
const DRAWN: f64 = 0.5;
/// And before no interval around it means anything: the slope of the logarithm does not lead so far.
const TOO_FAR: f64 = 4.0;
/// Noise-free 95 % interval, in units of the guess, beyond which a drawn parameter has no number either.
const VAGUE: f64 = 0.5;

/// What noise in the states does to the results.
#[derive(Debug, Default)]
pub(crate) struct ByNoise {
    /// Parameters that are given no number.
    pub silent: Vec<Held>,
    /// Unknowns of the border and what their standard errors are to be multiplied by.
    pub wider: Vec<(usize, f64)>,
}

/// Parameters of `found` that are given no number, or a wider interval, for what noise in the states does to them.
///
/// How well the motion itself shows a parameter is judged by `by_motion`, the information of noise-free predictions under the noise that the robot
/// file and the preset tell: a model error makes the estimated noise large, but that is not for the motion to mend. Where the estimated noise is
/// the smaller one (a search that began under a poorer model's), predictions under that one judge it.
///
/// # Errors
/// As a factorisation's own.
pub(crate) fn shown_by_noise<'m>(
    problem: &Problem<'m>,
    found: &Found<'m>,
    by_motion: &[f64],
    threads: usize,
) -> Result<ByNoise, SolveError> {
    let point = &found.solution.point;
    // Where inputs are measurements, the motion is what the sensors saw whatever the parameters are, and the term belongs to no likelihood.
    if !problem.model.layout().inputs().is_empty() {
        return Ok(ByNoise::default());
    }
    let guess = Guess::new(problem, point, &found.noise_free);
    let covariance = |information: &[f64]| guess.scaled(information, &found.held).cholesky().map(|f| f.inverse());
    let claimed = covariance(&found.solution.information);
    let (Some(claimed), Some(noise_free), Some(by_motion)) =
        (claimed, covariance(&found.noise_free), covariance(by_motion))
    else {
        return Ok(ByNoise::default());
    };
    let is_open = |covariance: &DMatrix<f64>, i: usize| covariance[(i, i)] > OPEN * OPEN;
    let open: Vec<usize> =
        (0..claimed.nrows()).filter(|&i| is_open(&by_motion, i) && is_open(&noise_free, i)).collect();
    if open.is_empty() {
        return Ok(ByNoise::default());
    }
    let axes = guess.orthonormal(&found.held);
    let mut factor = Factor::new(problem)?;
    factor.factorise_somehow(problem, point, threads)?;
    let mut slope = DVector::zeros(claimed.nrows());
    for &i in &open {
        slope[i] = half_log_determinant_slope(
            problem,
            (point, &factor),
            (&guess, &axes),
            (i, claimed[(i, i)].sqrt()),
            threads,
        )?;
    }
    let drawn = &claimed * slope;
    let mut wider = Vec::new();
    let silent = open.into_iter().filter_map(|i| {
        let by = drawn[i] / claimed[(i, i)].sqrt();
        let noise = claimed[(i, i)] < MOST_NOISE * noise_free[(i, i)];
        tracing::debug!(
            i,
            claimed = claimed[(i, i)].sqrt(),
            noise_free = noise_free[(i, i)].sqrt(),
            by,
            "shown by noise?"
        );
        let wide = 1.96 * noise_free[(i, i)].sqrt();
        let within = if i < problem.border().dynamics {
            format!("± {:.0} %", 100.0 * wide)
        } else {
            format!("± {:.1e} rad", wide * guess.size[i])
        };
        let reason = if noise {
            format!("the motion shows it to {within} only; the rest of what seems known is noise")
        } else if by.abs() > TOO_FAR || by.abs() > DRAWN && wide > VAGUE {
            format!("the motion shows it to {within} only, and noise draws it {:.1} standard errors away", by.abs())
        } else {
            if by.abs() > DRAWN {
                wider.push((i, (1.0 + by * by).sqrt()));
            }
            return None;
        };
        let mut shares = vec![0.0; claimed.nrows()];
        shares[i] = 1.0;
        Some(Held { direction: shares.clone(), shares, reason, convention: false })
    });
    let silent = silent.filter(|silent| found.silent.iter().all(|known| known.shares != silent.shares)).collect();
    Ok(ByNoise { silent, wider })
}

/// ∂(½ ln |H_xx|) by parameter i alone, in units of the guess: a difference over a standard error `by` either way, the states
/// following it. What is held stays.
fn half_log_determinant_slope<'m>(
    problem: &Problem<'m>,
    (point, at): (&Point<'m>, &Factor),
    (guess, axes): (&Guess, &DMatrix<f64>),
    (i, by): (usize, f64),
    threads: usize,
) -> Result<f64, SolveError> {
    let mut direction = DVector::zeros(axes.nrows());
    direction[i] = by;
    direction -= axes * (axes.transpose() * &direction);
    if direction.norm() < 0.1 * by {
        return Ok(0.0);
    }
    let mut factor = Factor::new(problem)?;
    let mut half_log_determinant = |sign: f64| -> Result<f64, SolveError> {
        let mut step = Step::default();
        let border = guess.to_border(&(sign * &direction));
        at.back_substitute(&border, threads, &mut step);
        let mut moved = point.clone();
        problem.retract(point, &step, &mut moved);
        factor.factorise_somehow(problem, &moved, threads)?;
        Ok(0.5 * log_determinant_of_states(&factor))
    };
    Ok((half_log_determinant(1.0)? - half_log_determinant(-1.0)?) / (2.0 * by))
}

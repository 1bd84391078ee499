//! Does the base model fit at all? Only where it does may a diagnosis say that nothing is missing.

use crate::calibrate::{ChannelNoise, Status};
use crate::diagnose::result::{BaseFit, ChannelFit};

/// Predictions within so many standard deviations of a sensor are at its own noise: a half more than the noise of the reading itself, which the state that they start from adds.
pub const AT_NOISE: f64 = 1.5;

/// Figures of channels as results have them.
pub fn channel_fits(figures: Vec<(String, f64)>) -> Vec<ChannelFit> {
    figures.into_iter().map(|(channel, value)| ChannelFit { channel, value }).collect()
}

/// What the noise of the base calibration, its status, whether what it leaves is coloured, and its predictions say. `gains` tells whether any law or curve gains
/// out of sample. That nothing does is no fit where the calibration itself says that the model does not, or that what it misses scatters between blocks of time
/// more than white noise does: a misfit need not follow anything that was tried.
pub fn base_fit(
    noise: &[ChannelNoise],
    (status, is_coloured): (Status, bool),
    ahead: Vec<(String, f64)>,
    gains: bool,
) -> BaseFit {
    let of_channels = noise.iter().filter_map(|noise| {
        let value = noise.chi2_per_dof.filter(|value| value.is_finite())?;
        Some(ChannelFit { channel: noise.channel.clone(), value })
    });
    let ahead = channel_fits(ahead);
    let worst = ahead.iter().filter(|fit| fit.value.is_finite()).max_by(|a, b| a.value.total_cmp(&b.value));
    let at_noise = worst.is_some_and(|fit| fit.value <= AT_NOISE);
    let fits = at_noise || !gains && status != Status::DoesNotFit && !is_coloured;
    let far = worst.map_or_else(String::new, |worst| {
        format!(
            "half a second ahead it misses {} by {:.1} standard deviations of the sensor",
            worst.channel, worst.value
        )
    });
    let nothing = "othing that could be tried predicts other blocks of this motion better";
    let sentence = match (fits, gains) {
        (true, _) if at_noise => format!("The base model fits: {far}."),
        (true, _) if far.is_empty() => format!("N{nothing} than the base model."),
        (true, _) => format!("N{nothing} than the base model, but {far}."),
        (false, true) if far.is_empty() => "The base model does not fit.".to_string(),
        (false, true) => format!("The base model does not fit: {far}."),
        (false, false) if far.is_empty() => format!("The base model does not fit, but n{nothing} for sure."),
        (false, false) => format!("The base model does not fit: {far}. But n{nothing} for sure."),
    };
    BaseFit { fits, chi2_per_dof: of_channels.collect(), ahead_500ms_sigma: ahead, sentence }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_found_is_a_fit_only_where_the_calibration_fits_too() {
        let said = |calibration: (Status, bool), sigma: f64, gains: bool| {
            let fit = base_fit(&[], calibration, vec![("encoder1".to_owned(), sigma)], gains);
            (fit.fits, fit.sentence)
        };
        // White noise of the steps: how far predictions miss is what it adds up to.
        let (fits, sentence) = said((Status::Converged, false), 40.0, false);
        assert!(fits && sentence.starts_with("Nothing that could be tried"), "{sentence}");
        for misfit in [(Status::DoesNotFit, false), (Status::Converged, true)] {
            let (fits, sentence) = said(misfit, 40.0, false);
            assert!(!fits && sentence.starts_with("The base model does not fit: half"), "{sentence}");
            assert!(sentence.ends_with("for sure."), "{sentence}");
        }
        assert!(!said((Status::Converged, false), 40.0, true).0);
        // Predictions at the sensor's own noise are a fit, whatever else is said.
        assert!(said((Status::DoesNotFit, true), 1.2, true).0);
    }
}

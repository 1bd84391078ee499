//! Does the base model fit at all? Only where it does may a diagnosis say that nothing is missing.

use crate::calibrate::Calibration;
use crate::diagnose::result::{BaseFit, ChannelFit};

/// Predictions within so many standard deviations of a sensor are at its own noise: a half more than the noise of the reading itself, which the state that they start from adds.
pub const AT_NOISE: f64 = 1.5;

/// Figures of channels as results have them.
pub fn channel_fits(figures: Vec<(String, f64)>) -> Vec<ChannelFit> {
    figures.into_iter().map(|(channel, value)| ChannelFit { channel, value }).collect()
}

/// What the base calibration and its predictions say. `gains` tells whether any law or curve gains out of sample.
pub fn base_fit(calibration: &Calibration, ahead: Vec<(String, f64)>, gains: bool) -> BaseFit {
    let of_channels = calibration.noise.iter().filter_map(|noise| {
        let value = noise.chi2_per_dof.filter(|value| value.is_finite())?;
        Some(ChannelFit { channel: noise.channel.clone(), value })
    });
    let ahead = channel_fits(ahead);
    let worst = ahead.iter().filter(|fit| fit.value.is_finite()).max_by(|a, b| a.value.total_cmp(&b.value));
    let at_noise = worst.is_some_and(|fit| fit.value <= AT_NOISE);
    let fits = at_noise || !gains;
    let far = worst.map_or_else(String::new, |worst| {
        format!(
            "half a second ahead it misses {} by {:.1} standard deviations of the sensor",
            worst.channel, worst.value
        )
    });
    let sentence = match (at_noise, gains) {
        (true, _) => format!("The base model fits: {far}."),
        (false, false) if far.is_empty() => {
            "Nothing that could be tried predicts other blocks of this motion better than the base model.".to_string()
        }
        (false, false) => format!(
            "Nothing that could be tried predicts other blocks of this motion better than the base model, but {far}."
        ),
        (false, true) if far.is_empty() => "The base model does not fit.".to_string(),
        (false, true) => format!("The base model does not fit: {far}."),
    };
    BaseFit { fits, chi2_per_dof: of_channels.collect(), ahead_500ms_sigma: ahead, sentence }
}

//! How far predictions lie from measurements, in units, in sigmas and as a share of the signal.

use serde::{Deserialize, Serialize};

/// Error of a prediction of one channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelError {
    /// Name of the channel in results, as `gyro2.x`.
    pub channel: String,
    /// Unit of `rmse`.
    pub unit: String,
    /// Predictions compared.
    pub count: usize,
    /// Root of the mean squared difference measured − predicted. NaN (null in JSON) if nothing was compared.
    #[serde(with = "finite_or_null")]
    pub rmse: f64,
    /// `rmse` over the sensor's standard deviation; 1 is the sensor's noise alone.
    #[serde(with = "finite_or_null")]
    pub rmse_sigma: f64,
    /// `rmse` over the standard deviation of the measured values that were compared; 1 is no better than their mean.
    #[serde(with = "finite_or_null")]
    pub nrmse: f64,
}

/// Sums that an RMSE needs, one difference at a time.
#[derive(Debug, Clone, Copy, Default)]
pub struct Errors {
    count: usize,
    squares: f64,
    // Mean and spread of the measured values (Welford's recurrence: no cancellation for small signals on an offset).
    mean: f64,
    spread: f64,
}

impl Errors {
    /// Adds a pair. A measured NaN (no valid reading) does not count; a predicted one spoils the sum, as it should.
    pub fn add(&mut self, measured: f64, predicted: f64) {
        if measured.is_nan() {
            return;
        }
        let difference = measured - predicted;
        self.count += 1;
        self.squares += difference * difference;
        let from_mean = measured - self.mean;
        self.mean += from_mean / self.count as f64;
        self.spread += from_mean * (measured - self.mean);
    }

    /// Pairs so far.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Root mean square of the differences; NaN without any.
    pub fn rmse(&self) -> f64 {
        (self.squares / self.count as f64).sqrt()
    }

    /// [`Self::rmse`] over the standard deviation of the measured values; NaN where they do not vary.
    pub fn nrmse(&self) -> f64 {
        let deviation = (self.spread / self.count as f64).sqrt();
        if deviation > 0.0 { self.rmse() / deviation } else { f64::NAN }
    }

    /// As a result.
    pub fn of_channel(&self, channel: &str, unit: &str, sigma: f64) -> ChannelError {
        ChannelError {
            channel: channel.to_owned(),
            unit: unit.to_owned(),
            count: self.count,
            rmse: self.rmse(),
            rmse_sigma: self.rmse() / sigma,
            nrmse: self.nrmse(),
        }
    }
}

/// JSON has no NaN: null stands for it, both ways.
mod finite_or_null {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        value.is_finite().then_some(*value).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rmse_in_units_in_sigmas_and_as_a_share() {
        let mut errors = Errors::default();
        for k in 0..1000 {
            let measured = 5.0 + if k % 2 == 0 { 2.0 } else { -2.0 };
            errors.add(measured, measured + if k % 4 < 2 { 0.1 } else { -0.1 });
        }
        errors.add(f64::NAN, 1.0);
        let result = errors.of_channel("gyro1.x", "rad/s", 0.05);
        assert_eq!(result.count, 1000);
        // Exact but for rounding: rtol 1e-12.
        assert!((result.rmse - 0.1).abs() < 1e-13);
        assert!((result.rmse_sigma - 2.0).abs() < 1e-12);
        assert!((result.nrmse - 0.05).abs() < 1e-13);
    }

    #[test]
    fn nothing_compared_is_null_and_comes_back() {
        let empty = Errors::default().of_channel("a", "rad", 1.0);
        let json = serde_json::to_string(&empty).unwrap();
        assert!(json.contains("\"rmse\":null"), "{json}");
        let back: ChannelError = serde_json::from_str(&json).unwrap();
        assert!(back.rmse.is_nan() && back.count == 0);
    }
}

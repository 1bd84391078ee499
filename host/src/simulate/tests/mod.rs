mod direct;
mod effects;
mod plant;
mod port;
mod replay;

/// A fast motion of every joint: steps and a chirp at nine tenths of full duty.
fn fast_duty(joint: usize, t: f64) -> f64 {
    let step = if (t * 1.3 + 0.3 * joint as f64).sin() > 0.0 { 1.0 } else { -1.0 };
    let chirp = (std::f64::consts::TAU * (1.4 + 0.8 * t) * t + joint as f64).sin();
    (0.9 * if t % 2.0 < 1.0 { step } else { chirp } * 1e4).round() / 1e4
}

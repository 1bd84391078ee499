//! Transition matrices and responses of systems that have formulas.

use crate::flow::{Shape, halvings, response, transition};

const N: usize = 2;

/// x″ = −ω² x − 2 D ω x′ with ω, D and its e^{A h}.
fn oscillator(omega: f64, damping: f64, h: f64) -> ([[f64; N]; N], [[f64; N]; N]) {
    let (decay, own) = (damping * omega, omega * (1.0 - damping * damping).sqrt());
    let (sin, cos) = (own * h).sin_cos();
    let e = (-decay * h).exp();
    let phi = [
        [e * (cos + decay / own * sin), e * sin / own],
        [-e * omega * omega / own * sin, e * (cos - decay / own * sin)],
    ];
    ([[0.0, 1.0], [-omega * omega, -2.0 * decay]], phi)
}

#[test]
fn transitions_of_an_oscillator() {
    let h = 1e-3;
    // Slow, as a belt; as fast as the tick; three times as fast.
    for (omega, tolerance) in [(30.0, 1e-7), (900.0, 5e-2), (3000.0, 1e-1)] {
        let (a, expected) = oscillator(omega, 0.2, h);
        let count = halvings(&a, N, h);
        assert_eq!(count, if omega < 1000.0 { 0 } else { 2 });
        let (mut phi, mut room) = ([[f64::NAN; N]; N], [[f64::NAN; N]; N]);
        transition(&a, N, h, count, &mut phi, &mut room);
        for i in 0..N {
            for j in 0..N {
                // Positions in units of speed over ω.
                let scale = omega.powi(j as i32 - i as i32);
                assert!(((phi[i][j] - expected[i][j]) * scale).abs() < tolerance, "{omega}: {phi:?} {expected:?}");
            }
        }
    }
}

/// x′ = −λ x + g: (1 − e^{−λ h}) g/λ for a constant, and for g (t/h)² the integral ∫ e^{−λ (h−t)} g (t/h)² dt.
#[test]
fn responses_of_a_decay() {
    let h = 1e-3;
    for ratio in [0.01_f64, 0.5, 1.0, 8.0, 60.0] {
        let lambda = ratio / h;
        let a = [[-lambda, 0.0], [0.0, 0.0]];
        let count = halvings(&a, 1, h);
        let of = |shape| response(&a, 1, h, count, (&[3.0, 0.0], shape))[0];
        let constant = 3.0 * (1.0 - (-ratio).exp()) / lambda;
        assert!(
            (of(Shape::Constant) - constant).abs() < 4e-3 * constant,
            "{ratio}: {} {constant}",
            of(Shape::Constant)
        );
        let z = ratio;
        let exact = 3.0 * h * (1.0 / z - 2.0 / (z * z) + 2.0 / (z * z * z) * (1.0 - (-z).exp()));
        assert!((of(Shape::Square) - exact).abs() < 4e-3 * exact, "{ratio}: {} {exact}", of(Shape::Square));
    }
    let still = [[0.0; N]; N];
    assert_eq!(halvings(&still, N, h), 0);
    assert!((response(&still, N, h, 0, (&[3.0, 0.0], Shape::Square))[0] - h).abs() < 1e-15);
}

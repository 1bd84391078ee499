//! The functions that generated programs carry along, against the standard library's.

use observer::Real;

fn at_most<T: Real>(name: &str, found: T, expected: T, relative: f64) {
    let (apart, size) = ((found - expected).abs(), expected.abs());
    assert!(apart <= size * T::of(relative), "{name}");
}

#[test]
fn functions_are_those_of_the_standard_library() {
    for i in -60_000_i32..=60_000 {
        let slow = f64::from(i) * 1e-3;
        for x in [slow, slow * slow * slow * 1e-6, f64::from(i) * 0.37] {
            let digits = 6e-16;
            at_most("tanh", Real::tanh(x), x.tanh(), 9e-16);
            at_most("exp", Real::exp(x.clamp(-700.0, 700.0)), x.clamp(-700.0, 700.0).exp(), digits);
            // atol 3e-16 near zeros of sine and cosine, where angles themselves have no more digits
            assert!((Real::sin(x) - x.sin()).abs() <= 3e-16, "sin {x}");
            assert!((Real::cos(x) - x.cos()).abs() <= 3e-16, "cos {x}");
            if x != 0.0 {
                at_most("ln", Real::ln(x.abs()), x.abs().ln(), digits);
                at_most("sqrt", Real::sqrt(x.abs()), x.abs().sqrt(), digits);
            }
            let y = x as f32;
            let digits = 4e-7;
            at_most("tanh f32", Real::tanh(y), y.tanh(), digits);
            at_most("exp f32", Real::exp(y.clamp(-80.0, 80.0)), y.clamp(-80.0, 80.0).exp(), digits);
            if y.abs() < 1e3 {
                assert!((Real::sin(y) - y.sin()).abs() <= 3e-7 && (Real::cos(y) - y.cos()).abs() <= 3e-7, "{y}");
            }
            if y != 0.0 {
                at_most("ln f32", Real::ln(y.abs()), y.abs().ln(), digits);
                at_most("sqrt f32", Real::sqrt(y.abs()), y.abs().sqrt(), digits);
            }
        }
    }
    assert!(Real::sqrt(-1.0_f64).is_nan() && Real::ln(-1.0_f64).is_nan() && Real::sin(f64::NAN).is_nan());
    assert_eq!((Real::exp(-800.0_f64), Real::exp(800.0_f64), Real::tanh(50.0_f64)), (0.0, f64::INFINITY, 1.0));
}

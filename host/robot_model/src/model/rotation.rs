//! Rotations as the paper's ⊞-manifold, equations (16) and (17).

use nalgebra::{Matrix3, Rotation3, Vector3};

/// `R ⊞ δ = R Rot(δ)` with `Rot(δ) = exp δ×`, equation (16); δ in rad.
pub fn boxplus(rotation: &Matrix3<f64>, delta: &Vector3<f64>) -> Matrix3<f64> {
    rotation * Rotation3::from_scaled_axis(*delta).matrix()
}

/// `R₂ ⊟ R₁ = aRot(R₁⁻¹ R₂)`, equation (17): the δ with `R₁ ⊞ δ = R₂` and ‖δ‖ ≤ π, rad.
pub fn boxminus(to: &Matrix3<f64>, from: &Matrix3<f64>) -> Vector3<f64> {
    let relative = from.transpose() * to;
    // The unit quaternion keeps its accuracy where the trace does not: near no turn and near a half turn.
    nalgebra::UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(relative)).scaled_axis()
}

/// The slopes of `(R ⊞ d) ⊟ R₀` by d at d = 0, where `R ⊟ R₀ = δ`: the inverse right Jacobian of SO(3),
/// `I + ½ δ× + (1/θ² − (1 + cos θ) / (2 θ sin θ)) (δ×)²`, θ = ‖δ‖ < π.
pub fn boxminus_slopes(delta: &Vector3<f64>) -> Matrix3<f64> {
    let (angle, skew) = (delta.norm(), skew(delta));
    let second = if angle < 1e-3 {
        1.0 / 12.0 // the next term is θ²/720
    } else {
        1.0 / (angle * angle) - (1.0 + angle.cos()) / (2.0 * angle * angle.sin())
    };
    Matrix3::identity() + 0.5 * skew + second * skew * skew
}

/// The nearest rotation to a matrix that rounding has moved off SO(3).
pub fn orthonormalised(matrix: &Matrix3<f64>) -> Matrix3<f64> {
    let svd = matrix.svd(true, true);
    match (svd.u, svd.v_t) {
        (Some(u), Some(v_t)) => u * v_t,
        // Both factors were asked for, so nalgebra returns both.
        _ => *matrix,
    }
}

/// The cross-product matrix: `skew(v) u = v × u`.
pub fn skew(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn boxminus_undoes_boxplus(a in prop::array::uniform3(-3.0f64..3.0), d in prop::array::uniform3(-1.8f64..1.8)) {
            let from = boxplus(&Matrix3::identity(), &Vector3::from(a));
            let delta = Vector3::from(d);
            prop_assume!(delta.norm() < std::f64::consts::PI - 1e-6);
            let to = boxplus(&from, &delta);
            // atol 1e-9 rad: close to a half turn the axis is found from differences
            prop_assert!((boxminus(&to, &from) - delta).norm() < 1e-9);
            prop_assert!((to * to.transpose() - Matrix3::identity()).norm() < 1e-14);
            prop_assert!((to.determinant() - 1.0).abs() < 1e-14);
        }

        #[test]
        fn boxminus_slopes_are_those_of_differences(a in prop::array::uniform3(-1.5f64..1.5), d in prop::array::uniform3(-1.0f64..1.0)) {
            let (delta, d) = (Vector3::from(a), Vector3::from(d) * 1e-6);
            let to = boxplus(&Matrix3::identity(), &delta);
            let moved = |by: &Vector3<f64>| boxminus(&boxplus(&to, by), &Matrix3::identity());
            let difference = 0.5 * (moved(&d) - moved(&-d));
            // third order of 1e-6 rad, and rounding
            prop_assert!((difference - boxminus_slopes(&delta) * d).norm() < 1e-13);
        }

        #[test]
        fn skew_is_the_derivative_of_boxplus(v in prop::array::uniform3(-3.0f64..3.0), d in prop::array::uniform3(-1.0f64..1.0)) {
            let (v, d) = (Vector3::from(v), Vector3::from(d) * 1e-6);
            let moved = boxplus(&Matrix3::identity(), &d) * v - v;
            // second order of 1e-6 rad
            prop_assert!((moved + skew(&v) * d).norm() < 1e-11);
        }
    }

    #[test]
    fn orthonormalised_is_a_rotation_close_by() {
        let rotation = boxplus(&Matrix3::identity(), &Vector3::new(0.3, -0.2, 1.1));
        let moved = rotation + Matrix3::from_fn(|i, j| 1e-7 * (i as f64 - 2.0 * j as f64));
        let back = orthonormalised(&moved);
        assert!((back * back.transpose() - Matrix3::identity()).norm() < 1e-14);
        assert!((back - rotation).norm() < 1e-6);
    }
}

//! Checks of single numbers, vectors and rotations; each names the field it refuses.

use super::super::vector::{IDENTITY, cross, determinant, dot, norm, normalised};
use super::super::{JointKind, Matrix3, RobotError, Vector3};
use super::{Checked, ROUNDING};

/// The field of the right unit for this kind of joint, `{at}_rad` or `{at}_m`.
pub(super) fn by_kind<V>(kind: JointKind, rad: Option<V>, m: Option<V>, at: &str, advice: &str) -> Checked<V> {
    let (value, stray, unit) = match kind {
        JointKind::Revolute => (rad, m.is_some().then_some("_m"), "_rad"),
        JointKind::Prismatic => (m, rad.is_some().then_some("_rad"), "_m"),
    };
    pick(value, stray, format!("{at}{unit}"), |stray| format!("{at}{stray}"), advice)
}

/// As [`by_kind`] with both field names given.
pub(super) fn by_kind_with<V>(
    kind: JointKind,
    rad: (Option<V>, &str),
    m: (Option<V>, &str),
    at: &str,
    advice: &str,
) -> Checked<V> {
    let ((value, name), (stray, stray_name)) = match kind {
        JointKind::Revolute => (rad, m),
        JointKind::Prismatic => (m, rad),
    };
    let stray = stray.is_some().then_some(stray_name);
    pick(value, stray, format!("{at}.{name}"), |stray| format!("{at}.{stray}"), advice)
}

fn pick<V>(
    value: Option<V>,
    stray: Option<&str>,
    field: String,
    path: impl Fn(&str) -> String,
    advice: &str,
) -> Checked<V> {
    if let Some(stray) = stray {
        let advice = format!("this joint is of the other kind; use {field}");
        return Err(RobotError::invalid(path(stray), "given", advice));
    }
    value.ok_or_else(|| RobotError::invalid(field, "missing", advice))
}

pub(super) fn identifier(field: &str, name: &str) -> Checked<()> {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.is_empty() || name.len() > 32 || !name.chars().all(plain) {
        let advice = "use 1 to 32 letters, digits, '_' or '-'";
        return Err(RobotError::invalid(field, format!("{name:?}"), advice));
    }
    Ok(())
}

pub(super) fn finite(field: &str, values: &[f64]) -> Checked<()> {
    if values.iter().any(|value| !value.is_finite()) {
        return Err(RobotError::invalid(field, format!("{values:?}"), "must be finite numbers"));
    }
    Ok(())
}

pub(super) fn positive(field: &str, value: f64, advice: &str) -> Checked<()> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(RobotError::invalid(field, value, format!("must be a positive number; {advice}")))
}

pub(super) fn not_negative(field: &str, value: f64, advice: &str) -> Checked<()> {
    if value.is_finite() && value >= 0.0 {
        return Ok(());
    }
    Err(RobotError::invalid(field, value, format!("must be zero or positive; {advice}")))
}

pub(super) fn within(field: &str, value: f64, low: f64, high: f64, advice: &str) -> Checked<()> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(RobotError::invalid(field, value, format!("must lie between {low} and {high}; {advice}")))
}

pub(super) fn unit_vector(field: &str, v: Vector3) -> Checked<Vector3> {
    finite(field, &v)?;
    if (norm(v) - 1.0).abs() > ROUNDING {
        return Err(RobotError::invalid(field, format!("{v:?}"), format!("has length {}, must be 1", norm(v))));
    }
    Ok(normalised(v))
}

/// A proper rotation within [`ROUNDING`], made exact by Gram–Schmidt.
pub(super) fn rotation(field: &str, m: Matrix3) -> Checked<Matrix3> {
    for row in &m {
        finite(field, row)?;
    }
    for i in 0..3 {
        for j in 0..3 {
            if (dot(m[i], m[j]) - IDENTITY[i][j]).abs() > ROUNDING {
                let advice = "is not a rotation: rows must have length 1 and stand at right angles";
                return Err(RobotError::invalid(field, format!("{m:?}"), advice));
            }
        }
    }
    if determinant(&m) < 0.0 {
        let advice = "is a reflection (determinant −1); one row or column has the wrong sign";
        return Err(RobotError::invalid(field, format!("{m:?}"), advice));
    }
    let x = normalised(m[0]);
    let z = normalised(cross(x, m[1]));
    Ok([x, cross(z, x), z])
}

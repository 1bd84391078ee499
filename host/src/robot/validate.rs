//! From the tables of a description file to a [`Robot`]: every number is looked at once, here.

use super::chain::MAX_JOINTS;
use super::file::{
    BodyTable, FrictionLaw, FrictionTable, InputTable, JointTable, ParameterTable, RobotFile, SensorKind, SensorTable,
    StartOrFixed,
};
use super::vector::{IDENTITY, cross, determinant, dot, norm, normalised};
use super::{
    Body, Encoder, Friction, Gyro, Input, InputUnit, Joint, JointKind, Matrix3, Parameter, ParameterSpec, Robot,
    RobotError, Sensor, Symbol, Tachometer, Vector3,
};

type Checked<T> = Result<T, RobotError>;

/// Robots have one to seven driven joints; passive ones are added to the chain by effects.
const MAX_DRIVEN_JOINTS: usize = 7;
const _: () = assert!(MAX_DRIVEN_JOINTS < MAX_JOINTS);

/// How far an axis or rotation may be from unit length and right angles: the rounding of a hand-written file.
const ROUNDING: f64 = 1e-3;

pub(super) fn robot(file: RobotFile, text: &str) -> Checked<Robot> {
    identifier("name", &file.name)?;
    within("sample_period_s", file.sample_period_s, 1e-4, 0.1, "give the period of the control loop in seconds")?;
    for (axis, g) in file.gravity_m_s2.iter().enumerate() {
        within(&format!("gravity_m_s2[{}]", axis + 1), *g, -100.0, 100.0, "give an acceleration in m/s²")?;
    }
    if file.joint.is_empty() || file.joint.len() > MAX_DRIVEN_JOINTS {
        let advice = format!("a robot has 1 to {MAX_DRIVEN_JOINTS} joints, one [[joint]] table each");
        return Err(RobotError::invalid("joint", file.joint.len(), advice));
    }
    let joints = file.joint.iter().enumerate().map(|(i, table)| joint(i, table)).collect::<Checked<Vec<_>>>()?;
    for (i, joint) in joints.iter().enumerate() {
        if joints[..i].iter().any(|earlier| earlier.name == joint.name) {
            let advice = "another joint has this name; sensors name joints, so names differ";
            return Err(RobotError::invalid(format!("joint[{}].name", i + 1), &joint.name, advice));
        }
    }
    let input = input(&file.input, &joints)?;
    let mut parameters = joint_parameters(&file, &joints, input.unit)?;
    let mut sensors = Vec::with_capacity(file.sensor.len());
    for (i, table) in file.sensor.iter().enumerate() {
        let at = format!("sensor[{}]", i + 1);
        let sensor = sensor(&at, table, &joints, file.sample_period_s)?;
        if sensors.iter().any(|earlier| same_place(earlier, &sensor)) {
            let advice = "this joint has such a sensor already";
            return Err(RobotError::invalid(at, format!("{} on {}", table.kind.name(), table.joint), advice));
        }
        sensors.push(sensor);
    }
    parameters.extend(gyro_parameters(&sensors));
    Ok(Robot {
        name: file.name,
        description: file.description,
        sample_period_s: file.sample_period_s,
        input,
        coriolis: file.coriolis,
        gravity_m_s2: file.gravity_m_s2,
        joints,
        sensors,
        parameters,
        toml: text.to_owned(),
    })
}

fn joint(index: usize, table: &JointTable) -> Checked<Joint> {
    let at = format!("joint[{}]", index + 1);
    identifier(&format!("{at}.name"), &table.name)?;
    let kind = table.kind;
    let limits =
        by_kind(kind, table.limits_rad, table.limits_m, &format!("{at}.limits"), "give the allowed [lowest, highest]")?;
    if !(limits[0].is_finite() && limits[1].is_finite() && limits[0] < limits[1]) {
        let advice = "give [lowest, highest] with lowest < highest";
        return Err(RobotError::invalid(format!("{at}.limits"), format!("{limits:?}"), advice));
    }
    positive(&format!("{at}.gear"), table.gear, "give motor radians per radian (or metre) of the link")?;
    finite(&format!("{at}.origin_m"), &table.origin_m)?;
    Ok(Joint {
        name: table.name.clone(),
        kind,
        axis: unit_vector(&format!("{at}.axis"), table.axis)?,
        origin_m: table.origin_m,
        rotation: rotation(&format!("{at}.rotation"), table.rotation.unwrap_or(IDENTITY))?,
        limits,
        gravity: table.gravity,
        transmission: table.transmission,
        friction: friction(&format!("{at}.friction"), kind, &table.friction)?,
        gear: table.gear,
        body: body(&format!("{at}.body"), &table.body)?,
    })
}

fn friction(at: &str, kind: JointKind, table: &FrictionTable) -> Checked<Friction> {
    if table.law == FrictionLaw::None {
        let given = [table.speed.is_some(), table.slope_s_rad.is_some(), table.slope_s_m.is_some()];
        if given.contains(&true) {
            return Err(RobotError::invalid(at, "law = \"none\"", "leave speed and slope out, there is no friction"));
        }
        return Ok(Friction::None);
    }
    let advice = "give the slope κ of τ_f = 2 μ (1 / (1 + exp(−κ v)) − 1/2); the paper has 400 s/rad";
    let slope_s = by_kind_with(kind, (table.slope_s_rad, "slope_s_rad"), (table.slope_s_m, "slope_s_m"), at, advice)?;
    positive(&format!("{at}.slope"), slope_s, advice)?;
    Ok(table.with_slope(slope_s))
}

fn body(at: &str, table: &BodyTable) -> Checked<Body> {
    not_negative(&format!("{at}.mass_kg"), table.mass_kg, "give the mass in kg")?;
    finite(&format!("{at}.centre_m"), &table.centre_m)?;
    let i = table.inertia_kg_m2;
    let tensor = [[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]];
    for row in &tensor {
        finite(&format!("{at}.inertia_kg_m2"), row)?;
    }
    physical_inertia(&format!("{at}.inertia_kg_m2"), &tensor)?;
    Ok(Body { mass_kg: table.mass_kg, centre_m: table.centre_m, inertia_kg_m2: tensor })
}

/// A body of positive density has principal moments that are positive and of which none exceeds the sum of the others.
fn physical_inertia(at: &str, tensor: &Matrix3) -> Checked<()> {
    let matrix = nalgebra::Matrix3::from_fn(|i, j| tensor[i][j]);
    let moments = matrix.symmetric_eigenvalues();
    let (smallest, largest, sum) = (moments.min(), moments.max(), moments.sum());
    // Rounding of the file; thin rods and flat plates lie on the boundary.
    let slack = ROUNDING * largest.abs();
    if smallest < -slack || 2.0 * largest - sum > slack {
        let value = format!("principal moments {:.6e}, {:.6e}, {:.6e} kg m²", moments[0], moments[1], moments[2]);
        let advice = "no body has such an inertia: each principal moment lies between zero and the sum of the other \
                      two; check units, signs, and that it is about the centre of mass";
        return Err(RobotError::invalid(at, value, advice));
    }
    Ok(())
}

fn input(table: &InputTable, joints: &[Joint]) -> Checked<Input> {
    let scale = match (table.unit, table.supply_v) {
        (InputUnit::Duty, Some(volts)) => {
            positive("input.supply_v", volts, "give the supply voltage in V")?;
            volts
        }
        (InputUnit::Duty, None) => {
            return Err(RobotError::invalid(
                "input.supply_v",
                "missing",
                "a duty needs the supply voltage it is part of",
            ));
        }
        (_, Some(volts)) => {
            return Err(RobotError::invalid(
                "input.supply_v",
                volts,
                "only a duty needs a supply voltage; leave it out",
            ));
        }
        (_, None) => 1.0,
    };
    let wrong = match table.unit {
        InputUnit::NewtonMetre => joints.iter().position(|joint| joint.kind == JointKind::Prismatic),
        InputUnit::Newton => joints.iter().position(|joint| joint.kind == JointKind::Revolute),
        _ => None,
    };
    if let Some(joint) = wrong {
        let advice = format!("joint {} does not take this unit: newton_metre turns, newton slides", joint + 1);
        return Err(RobotError::invalid("input.unit", format!("{:?}", table.unit), advice));
    }
    Ok(Input { unit: table.unit, scale })
}

fn joint_parameters(file: &RobotFile, joints: &[Joint], unit: InputUnit) -> Checked<Vec<ParameterSpec>> {
    let mut specs = Vec::new();
    for symbol in Symbol::OF_JOINTS {
        let name = symbol.name();
        let users: Vec<usize> = (0..joints.len()).filter(|&j| symbol.enters(&joints[j], unit)).collect();
        let shared = entry(&file.parameters, symbol);
        for (j, table) in file.joint.iter().enumerate() {
            let field = format!("joint[{}].parameters.{name}", j + 1);
            match entry(&table.parameters, symbol) {
                Some(_) if shared.is_some() => {
                    let advice = "given under [parameters] for all joints as well; keep one of them";
                    return Err(RobotError::invalid(field, "given twice", advice));
                }
                Some(_) if !users.contains(&j) => {
                    let advice = "the equations of this joint (input unit, transmission, friction) have no such \
                                  parameter; leave it out";
                    return Err(RobotError::invalid(field, "given", advice));
                }
                Some(given) => {
                    let value = parameter(&field, symbol, given, &joints[j])?;
                    let unit = symbol.unit(joints[j].kind);
                    specs.push(ParameterSpec {
                        name: format!("{name}[{}]", j + 1),
                        symbol,
                        joints: vec![j],
                        unit,
                        value,
                    });
                }
                None if users.contains(&j) && shared.is_none() => {
                    let advice = format!(
                        "missing: give `{name} = {{ start = … }}` or `{{ fixed = … }}` here, or once for all joints under [parameters]"
                    );
                    return Err(RobotError::invalid(field, "nothing", advice));
                }
                None => {}
            }
        }
        if let Some(given) = shared {
            let field = format!("parameters.{name}");
            let Some(&first) = users.first() else {
                let advice = "no joint's equations (input unit, transmission, friction) have it; leave it out";
                return Err(RobotError::invalid(field, "given", advice));
            };
            if users.iter().any(|&j| joints[j].kind != joints[first].kind) {
                let advice = "joints that turn and joints that slide cannot share it; give it under [joint.parameters]";
                return Err(RobotError::invalid(field, "shared", advice));
            }
            let value = parameter(&field, symbol, given, &joints[first])?;
            let unit = symbol.unit(joints[first].kind);
            specs.push(ParameterSpec { name: name.to_owned(), symbol, joints: users, unit, value });
        }
    }
    Ok(specs)
}

fn entry(table: &ParameterTable, symbol: Symbol) -> Option<StartOrFixed<f64>> {
    match symbol {
        Symbol::KPwm => table.k_pwm,
        Symbol::KT => table.k_t,
        Symbol::KMi => table.k_mi,
        Symbol::B => table.b,
        Symbol::Mu => table.mu,
        Symbol::KS => table.k_s,
        Symbol::DS => table.d_s,
        Symbol::Bias { .. } | Symbol::Misalignment { .. } => None,
    }
}

fn parameter(field: &str, symbol: Symbol, given: StartOrFixed<f64>, joint: &Joint) -> Checked<Parameter> {
    let (start, free) = start_or_fixed(field, given)?;
    let bound = if symbol.may_be_zero(joint) { not_negative } else { positive };
    let advice = "this parameter's sign is fixed by physics";
    bound(field, start, advice)?;
    let simulated = given.simulated.unwrap_or(start);
    bound(&format!("{field}.simulated"), simulated, advice)?;
    Ok(Parameter { start, free, simulated })
}

fn start_or_fixed<V>(field: &str, given: StartOrFixed<V>) -> Checked<(V, bool)> {
    match (given.start, given.fixed) {
        (Some(value), None) => Ok((value, true)),
        (None, Some(value)) => Ok((value, false)),
        (Some(_), Some(_)) => Err(RobotError::invalid(field, "start and fixed", "give one of the two")),
        (None, None) => {
            Err(RobotError::invalid(field, "{}", "give `{ start = … }` to estimate it or `{ fixed = … }` if known"))
        }
    }
}

fn gyro_parameters(sensors: &[Sensor]) -> Vec<ParameterSpec> {
    let gyros = || {
        sensors.iter().filter_map(|sensor| match sensor {
            Sensor::Gyro(gyro) => Some(gyro),
            _ => None,
        })
    };
    let spec = |symbol: Symbol, gyro: usize, axis: usize, value: Parameter| ParameterSpec {
        name: format!("{}{}[{}]", symbol.name(), gyro + 1, ["x", "y", "z"][axis]),
        symbol,
        joints: Vec::new(),
        unit: symbol.unit(JointKind::Revolute),
        value,
    };
    let mut specs = Vec::new();
    for (gyro, g) in gyros().enumerate() {
        for axis in 0..3 {
            let value =
                Parameter { start: g.bias_rad_s[axis], free: g.bias_free, simulated: g.bias_simulated_rad_s[axis] };
            specs.push(spec(Symbol::Bias { gyro, axis }, gyro, axis, value));
        }
    }
    for (gyro, g) in gyros().enumerate() {
        for axis in 0..3 {
            let value = Parameter { start: 0.0, free: g.rotation_free, simulated: 0.0 };
            specs.push(spec(Symbol::Misalignment { gyro, axis }, gyro, axis, value));
        }
    }
    specs
}

fn sensor(at: &str, table: &SensorTable, joints: &[Joint], period_s: f64) -> Checked<Sensor> {
    let Some(joint) = joints.iter().position(|joint| joint.name == table.joint) else {
        let known = joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>().join(", ");
        return Err(RobotError::invalid(
            format!("{at}.joint"),
            &table.joint,
            format!("no such joint; there are {known}"),
        ));
    };
    let kind = joints[joint].kind;
    let period_us = period_s * 1e6;
    within(&format!("{at}.offset_us"), table.offset_us, 0.0, period_us, "the sensor is read within the tick")?;
    let offset_s = table.offset_us * 1e-6;
    let allowed: &[&str] = match table.kind {
        SensorKind::MotorEncoder | SensorKind::LinkEncoder => &["counts_per_turn", "sigma_rad", "sigma_m"],
        SensorKind::Tachometer => &["side", "sigma_rad_s", "sigma_m_s"],
        SensorKind::Gyro => &["rotation", "bias_rad_s", "sigma_rad_s", "range_rad_s"],
    };
    if let Some(stray) = given_fields(table).find(|field| !allowed.contains(field)) {
        let advice = format!("a {} has no such field; it takes {}", table.kind.name(), allowed.join(", "));
        return Err(RobotError::invalid(format!("{at}.{stray}"), "given", advice));
    }
    let noise = "give the standard deviation of one reading";
    match table.kind {
        SensorKind::MotorEncoder | SensorKind::LinkEncoder => {
            let sigma = by_kind(kind, table.sigma_rad, table.sigma_m, &format!("{at}.sigma"), noise)?;
            positive(&format!("{at}.sigma"), sigma, noise)?;
            if table.counts_per_turn == Some(0) {
                return Err(RobotError::invalid(format!("{at}.counts_per_turn"), 0, "count all four edges of a turn"));
            }
            if table.kind == SensorKind::LinkEncoder && kind == JointKind::Prismatic && table.counts_per_turn.is_some()
            {
                let advice = "a sliding link makes no turns; leave it out";
                return Err(RobotError::invalid(format!("{at}.counts_per_turn"), "given", advice));
            }
            let encoder = Encoder { joint, counts_per_turn: table.counts_per_turn, sigma, offset_s };
            Ok(if table.kind == SensorKind::MotorEncoder {
                Sensor::MotorEncoder(encoder)
            } else {
                Sensor::LinkEncoder(encoder)
            })
        }
        SensorKind::Tachometer => {
            let fields = ((table.sigma_rad_s, "sigma_rad_s"), (table.sigma_m_s, "sigma_m_s"));
            let sigma = by_kind_with(kind, fields.0, fields.1, at, noise)?;
            positive(&format!("{at}.sigma"), sigma, noise)?;
            let Some(side) = table.side else {
                let advice = "say whose speed it measures: \"motor\" or \"link\"";
                return Err(RobotError::invalid(format!("{at}.side"), "missing", advice));
            };
            Ok(Sensor::Tachometer(Tachometer { joint, side, sigma, offset_s }))
        }
        SensorKind::Gyro => gyro(at, table, joint, offset_s),
    }
}

fn gyro(at: &str, table: &SensorTable, body: usize, offset_s: f64) -> Checked<Sensor> {
    let missing = |field: &str, advice: &str| RobotError::invalid(format!("{at}.{field}"), "missing", advice);
    let given = table.rotation.ok_or_else(|| {
        missing("rotation", "give `{ start = [[…], […], […]] }`, the nominal rotation from body to sensor axes")
    })?;
    let (nominal, rotation_free) = start_or_fixed(&format!("{at}.rotation"), given)?;
    if given.simulated.is_some() {
        let advice = "a simulated sensor is mounted within a few degrees of its nominal rotation; leave it out";
        return Err(RobotError::invalid(format!("{at}.rotation.simulated"), "given", advice));
    }
    let given = table
        .bias_rad_s
        .ok_or_else(|| missing("bias_rad_s", "give `{ start = [0.0, 0.0, 0.0] }` if nothing is known"))?;
    let (bias_rad_s, bias_free) = start_or_fixed(&format!("{at}.bias_rad_s"), given)?;
    finite(&format!("{at}.bias_rad_s"), &bias_rad_s)?;
    let bias_simulated_rad_s = given.simulated.unwrap_or(bias_rad_s);
    finite(&format!("{at}.bias_rad_s.simulated"), &bias_simulated_rad_s)?;
    let noise = "give the standard deviation of one reading in rad/s";
    let sigma_rad_s = table.sigma_rad_s.ok_or_else(|| missing("sigma_rad_s", noise))?;
    positive(&format!("{at}.sigma_rad_s"), sigma_rad_s, noise)?;
    if let Some(range) = table.range_rad_s {
        positive(&format!("{at}.range_rad_s"), range, "give the full scale in rad/s")?;
    }
    Ok(Sensor::Gyro(Gyro {
        body,
        rotation: rotation(&format!("{at}.rotation"), nominal)?,
        rotation_free,
        bias_rad_s,
        bias_free,
        bias_simulated_rad_s,
        sigma_rad_s,
        range_rad_s: table.range_rad_s,
        offset_s,
    }))
}

fn given_fields(table: &SensorTable) -> impl Iterator<Item = &'static str> {
    [
        (table.counts_per_turn.is_some(), "counts_per_turn"),
        (table.sigma_rad.is_some(), "sigma_rad"),
        (table.sigma_m.is_some(), "sigma_m"),
        (table.sigma_rad_s.is_some(), "sigma_rad_s"),
        (table.sigma_m_s.is_some(), "sigma_m_s"),
        (table.side.is_some(), "side"),
        (table.rotation.is_some(), "rotation"),
        (table.bias_rad_s.is_some(), "bias_rad_s"),
        (table.range_rad_s.is_some(), "range_rad_s"),
    ]
    .into_iter()
    .filter_map(|(given, field)| given.then_some(field))
}

fn same_place(a: &Sensor, b: &Sensor) -> bool {
    match (a, b) {
        (Sensor::MotorEncoder(a), Sensor::MotorEncoder(b)) | (Sensor::LinkEncoder(a), Sensor::LinkEncoder(b)) => {
            a.joint == b.joint
        }
        (Sensor::Tachometer(a), Sensor::Tachometer(b)) => a.joint == b.joint && a.side == b.side,
        // A body may carry several gyros.
        _ => false,
    }
}

/// The field of the right unit for this kind of joint, `{at}_rad` or `{at}_m`.
fn by_kind<V>(kind: JointKind, rad: Option<V>, m: Option<V>, at: &str, advice: &str) -> Checked<V> {
    let (value, stray, unit) = match kind {
        JointKind::Revolute => (rad, m.is_some().then_some("_m"), "_rad"),
        JointKind::Prismatic => (m, rad.is_some().then_some("_rad"), "_m"),
    };
    pick(value, stray, format!("{at}{unit}"), |stray| format!("{at}{stray}"), advice)
}

/// As [`by_kind`] with both field names given.
fn by_kind_with<V>(
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

fn identifier(field: &str, name: &str) -> Checked<()> {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.is_empty() || name.len() > 32 || !name.chars().all(plain) {
        let advice = "use 1 to 32 letters, digits, '_' or '-'";
        return Err(RobotError::invalid(field, format!("{name:?}"), advice));
    }
    Ok(())
}

fn finite(field: &str, values: &[f64]) -> Checked<()> {
    if values.iter().any(|value| !value.is_finite()) {
        return Err(RobotError::invalid(field, format!("{values:?}"), "must be finite numbers"));
    }
    Ok(())
}

fn positive(field: &str, value: f64, advice: &str) -> Checked<()> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(RobotError::invalid(field, value, format!("must be a positive number; {advice}")))
}

fn not_negative(field: &str, value: f64, advice: &str) -> Checked<()> {
    if value.is_finite() && value >= 0.0 {
        return Ok(());
    }
    Err(RobotError::invalid(field, value, format!("must be zero or positive; {advice}")))
}

fn within(field: &str, value: f64, low: f64, high: f64, advice: &str) -> Checked<()> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(RobotError::invalid(field, value, format!("must lie between {low} and {high}; {advice}")))
}

fn unit_vector(field: &str, v: Vector3) -> Checked<Vector3> {
    finite(field, &v)?;
    if (norm(v) - 1.0).abs() > ROUNDING {
        return Err(RobotError::invalid(field, format!("{v:?}"), format!("has length {}, must be 1", norm(v))));
    }
    Ok(normalised(v))
}

/// A proper rotation within [`ROUNDING`], made exact by Gram–Schmidt.
fn rotation(field: &str, m: Matrix3) -> Checked<Matrix3> {
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

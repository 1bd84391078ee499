//! From the tables of a description file to a [`Robot`]: every number is looked at once, here.

mod checks;
mod import;
mod sensors;

use super::chain::MAX_JOINTS;
use super::file::{
    BodyTable, FrictionLaw, FrictionTable, InputTable, JointTable, ParameterTable, RobotFile, StartOrFixed,
};
use super::vector::{IDENTITY, norm};
use super::{
    Body, Friction, Input, InputNoise, InputUnit, Joint, JointKind, Matrix3, Parameter, ParameterSpec, Robot,
    RobotError, Side, Symbol, Transmission, Unmodelled,
};
use checks::{by_kind, by_kind_with, finite, identifier, not_negative, positive, rotation, unit_vector, within};
use sensors::{encoder_parameters, gyro_parameters, lag_parameters, same_place, sensor};

type Checked<T> = Result<T, RobotError>;

/// Robots have one to seven driven joints; passive ones are added to the chain by effects.
const MAX_DRIVEN_JOINTS: usize = 7;
const _: () = assert!(MAX_DRIVEN_JOINTS < MAX_JOINTS);

/// How far an axis or rotation may be from unit length and right angles: the rounding of a hand-written file.
const ROUNDING: f64 = 1e-3;

/// No body, and no way from joint to joint, is so long, m: cranes and the largest arms have 10. Halved, they are refused; doubled, a part of 30 mm
/// passes that is given in millimetres.
const MOST_LENGTH_M: f64 = 20.0;
/// Share of a link's inertia that is left where the links behind it move freely: less is rounding.
const LEAST_INERTIA: f64 = 1e-9;

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
    parameters.extend(encoder_parameters(&sensors, &joints));
    parameters.extend(lag_parameters(&sensors));
    parameters.extend(gyro_parameters(&sensors));
    let mut robot = Robot {
        name: file.name,
        description: file.description,
        sample_period_s: file.sample_period_s,
        input,
        coriolis: file.coriolis,
        gravity_m_s2: file.gravity_m_s2,
        joints,
        sensors,
        parameters,
        import: None,
        toml: text.to_owned(),
    };
    free_links(&robot)?;
    robot.import = file.import.as_ref().map(|table| import::import(table, &robot)).transpose()?;
    Ok(robot)
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
    if norm(table.origin_m) > MOST_LENGTH_M {
        let value = format!("{:?}", table.origin_m);
        return Err(RobotError::invalid(format!("{at}.origin_m"), value, MILLIMETRES));
    }
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
        unmodelled: unmodelled(&at, table)?,
    })
}

fn unmodelled(at: &str, table: &JointTable) -> Checked<Unmodelled> {
    let stray = match table.kind {
        JointKind::Revolute => table.unmodelled_m_s2.map(|_| ("unmodelled_m_s2", "unmodelled_rad_s2")),
        JointKind::Prismatic => table.unmodelled_rad_s2.map(|_| ("unmodelled_rad_s2", "unmodelled_m_s2")),
    };
    if let Some((stray, right)) = stray {
        return Err(RobotError::invalid(
            format!("{at}.{stray}"),
            "given",
            format!("give `{right}` at this kind of joint"),
        ));
    }
    let given = table.unmodelled_rad_s2.or(table.unmodelled_m_s2).unwrap_or_default();
    let advice = "give the standard deviation of the acceleration that the model does not explain";
    let field = if table.kind == JointKind::Revolute { "unmodelled_rad_s2" } else { "unmodelled_m_s2" };
    for (side, value) in [("link", given.link), ("motor", given.motor)] {
        not_negative(&format!("{at}.{field}.{side}"), value, advice)?;
    }
    if given.motor > 0.0 && table.transmission == Transmission::Rigid {
        let advice = "the motor of a rigid joint moves as its link does: give it as `link`";
        return Err(RobotError::invalid(format!("{at}.{field}.motor"), given.motor, advice));
    }
    Ok(given)
}

fn friction(at: &str, kind: JointKind, table: &FrictionTable) -> Checked<Friction> {
    if table.law == FrictionLaw::None {
        let given =
            [table.speed.is_some(), table.acts.is_some(), table.slope_s_rad.is_some(), table.slope_s_m.is_some()];
        if given.contains(&true) {
            return Err(RobotError::invalid(
                at,
                "law = \"none\"",
                "leave speed, acts and slope out, there is no friction",
            ));
        }
        return Ok(Friction::None);
    }
    if table.acts == Some(Side::Link) && table.speed == Some(Side::Motor) {
        let advice = "friction that holds the link back takes the link's speed; leave speed out";
        return Err(RobotError::invalid(format!("{at}.speed"), "motor", advice));
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
    believable_size(at, table.mass_kg, table.centre_m, &tensor)?;
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

const MILLIMETRES: &str = "no robot is so large: millimetres and grams? Lengths are in m (mm / 1000), masses in kg (g / 1000), inertias in kg m² \
                           (kg mm² / 1e6, g mm² / 1e9)";

/// A body is not larger than any robot, by its centre and by its radius of gyration.
fn believable_size(at: &str, mass_kg: f64, centre_m: [f64; 3], tensor: &Matrix3) -> Checked<()> {
    let largest = nalgebra::Matrix3::from_fn(|i, j| tensor[i][j]).symmetric_eigenvalues().max();
    let away_m = norm(centre_m);
    let gyration_m = if mass_kg > 0.0 { (largest.max(0.0) / mass_kg).sqrt() } else { 0.0 };
    if away_m.max(gyration_m) <= MOST_LENGTH_M {
        return Ok(());
    }
    let value = format!("inertia of {largest} kg m², mass of {mass_kg} kg, centre {away_m} m from the joint");
    Err(RobotError::invalid(at, value, MILLIMETRES))
}

/// A link on a spring moves by its own inertia: none may be without, however the links behind it move.
fn free_links(robot: &Robot) -> Checked<()> {
    let joints = robot.joints.len();
    let start = |symbol, joint| robot.joint_parameter(symbol, joint).map_or(0.0, |spec| spec.value.start);
    let mut chain = robot.chain();
    for joint in 0..joints {
        for symbol in Symbol::OF_BODIES {
            chain = chain.with_moment(joint, symbol, start(symbol, joint));
        }
    }
    let middle: Vec<f64> = robot.joints.iter().map(|joint| 0.5 * (joint.limits[0] + joint.limits[1])).collect();
    let mut m = vec![0.0; joints * joints];
    chain.mass_matrix(&middle, &mut m);
    let is_rigid = |joint: usize| robot.joints[joint].transmission == Transmission::Rigid;
    // The motor of a rigid joint moves with its link, and may be all its inertia.
    for joint in (0..joints).filter(|&joint| is_rigid(joint)) {
        m[joint * joints + joint] += start(Symbol::B, joint);
    }
    // Eliminated from the outermost link inwards, each pivot is what a joint feels while those behind it are free.
    for last in (0..joints).rev() {
        let (pivot, own) = (m[last * joints + last], m[last * joints + last].abs());
        let whole = (0..joints).map(|j| m[j * joints + j].abs()).fold(own, f64::max);
        if pivot.is_nan() || pivot <= LEAST_INERTIA * whole {
            if is_rigid(last) {
                return Ok(()); // told by the calibration, which may find it
            }
            let advice = "a link behind a spring needs an inertia: give its body mass and inertia, J = { start = … } under [joint.parameters], or \
                          transmission = \"rigid\"";
            let value = format!("no inertia that moves joint `{}` on its spring", robot.joints[last].name);
            return Err(RobotError::invalid(format!("joint[{}].body", last + 1), value, advice));
        }
        for i in 0..last {
            for j in 0..last {
                m[i * joints + j] -= m[i * joints + last] * m[last * joints + j] / pivot;
            }
        }
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
    let noise = match table.sigma {
        None => Input::usual_noise(table.unit),
        Some(0.0) => InputNoise::None,
        Some(sigma) => {
            positive(
                "input.sigma",
                sigma,
                "give the standard deviation in the input's unit, or 0 where it is a command",
            )?;
            InputNoise::Known(sigma)
        }
    };
    Ok(Input { unit: table.unit, scale, noise })
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
                None if users.contains(&j) && shared.is_none() && !symbol.is_optional() => {
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
        Symbol::V => table.v,
        Symbol::O => table.o,
        Symbol::J => table.j,
        Symbol::FirstMoment { axis: 0 } => table.mx,
        Symbol::FirstMoment { axis: 1 } => table.my,
        Symbol::FirstMoment { .. } => table.mz,
        Symbol::Bias { .. } | Symbol::Misalignment { .. } | Symbol::Lag { .. } | Symbol::Zero | Symbol::ScaleError => {
            None
        }
    }
}

fn parameter(field: &str, symbol: Symbol, given: StartOrFixed<f64>, joint: &Joint) -> Checked<Parameter> {
    let (start, free) = start_or_fixed(field, given)?;
    let simulated = given.simulated.unwrap_or(start);
    if symbol.has_either_sign() {
        finite(field, &[start, simulated])?;
        return Ok(Parameter { start, free, simulated });
    }
    let bound = if symbol.may_be_zero(joint) { not_negative } else { positive };
    let advice = "this parameter's sign is fixed by physics";
    bound(field, start, advice)?;
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

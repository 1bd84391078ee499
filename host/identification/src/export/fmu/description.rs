//! modelDescription.xml: variables with units and start values, what depends on what, and what the model loses.

use std::collections::BTreeSet;
use std::fmt::Write;

use super::sources::{References, Sources};
use super::unit::base_unit;
use crate::export::loss::xml_head;
use crate::export::program::head_of_program;
use crate::export::xml::escaped;
use crate::export::{Exported, Loss, Program};
use crate::model::Expression;
use crate::model::expression::Node;

/// The file. Its comment lists the losses.
pub(super) fn model_description(
    exported: &Exported<'_>,
    program: &Program,
    sources: &Sources,
    losses: &[Loss],
) -> String {
    let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!--\n");
    text += &xml_head(exported, losses);
    let robot = exported.calibrated.robot();
    let (identifier, period_s) = (&sources.identifier, robot.sample_period_s);
    let description = match exported.warning() {
        Some(warning) => format!("WARNING: {warning}. {}", robot.description),
        None => robot.description.clone(),
    };
    let able = "canGetAndSetFMUState=\"true\" canSerializeFMUState=\"true\" providesDirectionalDerivatives=\"true\" providesAdjointDerivatives=\"true\"";
    let _ = write!(
        text,
        "-->\n<fmiModelDescription fmiVersion=\"3.0\" modelName=\"{}\" instantiationToken=\"{}\" description=\"{}\"\n    \
         generationTool=\"host {}\" variableNamingConvention=\"flat\">\n  \
         <ModelExchange modelIdentifier=\"{identifier}\" {able}/>\n  \
         <CoSimulation modelIdentifier=\"{identifier}\" {able}\n      canHandleVariableCommunicationStepSize=\"true\" fixedInternalStepSize=\"{period_s}\"/>\n",
        escaped(&robot.name),
        sources.token,
        escaped(&description),
        env!("CARGO_PKG_VERSION"),
    );
    let variables = variables(exported, References::of(program.sizes));
    text += "  <UnitDefinitions>\n";
    for unit in variables.iter().filter_map(|variable| variable.unit()).collect::<BTreeSet<_>>() {
        let name = escaped(unit);
        let _ = match base_unit(unit) {
            Some(base) => writeln!(text, "    <Unit name=\"{name}\"><BaseUnit{base}/></Unit>"),
            None => writeln!(text, "    <Unit name=\"{name}\"/>"),
        };
    }
    let _ = write!(
        text,
        "  </UnitDefinitions>\n  <LogCategories>\n    <Category name=\"logStatusError\"/>\n  </LogCategories>\n  \
         <DefaultExperiment startTime=\"0\" stopTime=\"5\" stepSize=\"{period_s}\"/>\n  <ModelVariables>\n"
    );
    variables.iter().for_each(|variable| variable.write(&mut text));
    text += "  </ModelVariables>\n  <ModelStructure>\n";
    structure(&mut text, program);
    text += "  </ModelStructure>\n</fmiModelDescription>\n";
    text
}

/// The page of `documentation/`: where the model comes from, what it keeps, every number.
pub(super) fn page(exported: &Exported<'_>, losses: &[Loss]) -> String {
    let name = escaped(&exported.calibrated.robot().name);
    let mut text = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head><meta charset=\"utf-8\"><title>{name}</title></head>\n<body>\n<h1>{name}</h1>\n<pre>\n"
    );
    for line in head_of_program(exported, losses) {
        let _ = writeln!(text, "{}", escaped(&line));
    }
    text += "</pre>\n</body>\n</html>\n";
    text
}

/// A variable of the standard, a Float64.
struct Variable {
    reference: usize,
    name: String,
    /// Causality, variability and, where it has one, how it starts.
    kind: &'static str,
    unit: String,
    start: Option<f64>,
    derivative_of: Option<usize>,
    description: String,
}

impl Variable {
    /// None of what is of no unit.
    fn unit(&self) -> Option<&str> {
        Some(&*self.unit).filter(|unit| !unit.is_empty())
    }

    fn write(&self, text: &mut String) {
        let _ = write!(
            text,
            "    <Float64 name=\"{}\" valueReference=\"{}\" {}",
            escaped(&self.name),
            self.reference,
            self.kind
        );
        if let Some(unit) = self.unit() {
            let _ = write!(text, " unit=\"{}\"", escaped(unit));
        }
        if let Some(start) = self.start {
            let _ = write!(text, " start=\"{start:?}\"");
        }
        if let Some(state) = self.derivative_of {
            let _ = write!(text, " derivative=\"{state}\"");
        }
        let _ = writeln!(text, " description=\"{}\"/>", escaped(&self.description));
    }
}

/// All variables in the order of their references. Readings and parameters are called as in CAL.json.
fn variables(exported: &Exported<'_>, references: References) -> Vec<Variable> {
    let robot = exported.calibrated.robot();
    let variable = |reference, name: String, kind, unit: &str, description: String| Variable {
        reference,
        name,
        kind,
        unit: unit.to_owned(),
        start: None,
        derivative_of: None,
        description,
    };
    let mut all = vec![variable(
        references.time,
        "time".to_owned(),
        "causality=\"independent\" variability=\"continuous\"",
        "s",
        "since the start of the motion, for what drifts".to_owned(),
    )];
    let side = "on the link side of the gears";
    all.extend(exported.states.iter().enumerate().map(|(i, state)| Variable {
        start: Some(0.0),
        ..variable(
            references.states + i,
            format!("x.{}", state.name),
            "causality=\"output\" variability=\"continuous\" initial=\"exact\"",
            own_unit(state.unit),
            format!("state, {side}"),
        )
    }));
    all.extend(exported.states.iter().enumerate().map(|(i, state)| Variable {
        derivative_of: Some(references.states + i),
        ..variable(
            references.rates + i,
            format!("der(x.{})", state.name),
            "causality=\"local\" variability=\"continuous\" initial=\"calculated\"",
            &rate_unit(own_unit(state.unit)),
            "rate of a state".to_owned(),
        )
    }));
    all.extend(robot.joints.iter().enumerate().map(|(i, joint)| Variable {
        start: Some(0.0),
        ..variable(
            references.inputs + i,
            format!("u{}", i + 1),
            "causality=\"input\" variability=\"continuous\"",
            robot.input.unit.symbol(),
            match robot.input.unit.symbol() {
                "" => format!("duty of joint {}, -1 to 1", joint.name),
                _ => format!("input of joint {}", joint.name),
            },
        )
    }));
    all.extend(exported.readings.iter().zip(exported.sigmas()).enumerate().map(|(i, (channel, sigma))| {
        let late =
            if channel.offset_s == 0.0 { String::new() } else { format!(", {} s after the state", channel.offset_s) };
        variable(
            references.readings + i,
            channel.name.clone(),
            "causality=\"output\" variability=\"continuous\" initial=\"calculated\"",
            channel.unit,
            format!("reading without noise; its standard deviation is {sigma:.3e}{late}"),
        )
    }));
    all.extend(exported.parameters.iter().enumerate().map(|(i, parameter)| Variable {
        start: Some(parameter.value),
        ..variable(
            references.parameters + i,
            parameter.name.clone(),
            "causality=\"parameter\" variability=\"tunable\" initial=\"exact\"",
            &parameter.unit,
            match parameter.std_error {
                Some(error) => format!("± {error:.2e}"),
                None => "NOT IDENTIFIED by the recordings".to_owned(),
            },
        )
    }));
    all
}

/// None of a state that has no unit with a name.
fn own_unit(unit: &'static str) -> &'static str {
    if base_unit(unit).is_some() { unit } else { "" }
}

/// The unit of a rate.
fn rate_unit(unit: &str) -> String {
    match unit {
        "" => String::new(),
        "rad/s" => "rad/s^2".to_owned(),
        "m/s" => "m/s^2".to_owned(),
        unit => format!("{unit}/s"),
    }
}

/// Outputs and rates with all that they are computed from, but for parameters; what is computed at the start.
fn structure(text: &mut String, program: &Program) {
    let (sizes, references) = (program.sizes, References::of(program.sizes));
    let unknown = |text: &mut String, element: &str, reference: usize, of: Option<Expression>| {
        let _ = write!(text, "    <{element} valueReference=\"{reference}\"");
        let depends = match of {
            Some(root) => dependencies(program, root),
            // A state as an output is itself.
            None => vec![reference],
        };
        let list = depends.iter().map(usize::to_string).collect::<Vec<_>>().join(" ");
        let _ = writeln!(text, " dependencies=\"{list}\"/>");
    };
    for i in 0..sizes.states {
        unknown(text, "Output", references.states + i, None);
    }
    for (i, reading) in program.readings.iter().enumerate() {
        unknown(text, "Output", references.readings + i, Some(*reading));
    }
    for (i, rate) in program.rates.iter().enumerate() {
        unknown(text, "ContinuousStateDerivative", references.rates + i, Some(*rate));
    }
    let computed = (0..sizes.states).map(|i| references.rates + i);
    for reference in computed.chain((0..sizes.readings).map(|i| references.readings + i)) {
        let _ = writeln!(text, "    <InitialUnknown valueReference=\"{reference}\"/>");
    }
}

/// The references of states, inputs and time that an expression needs.
fn dependencies(program: &Program, root: Expression) -> Vec<usize> {
    let (sizes, references) = (program.sizes, References::of(program.sizes));
    let needed = program.needed([root]).into_iter().filter_map(|of| match program.node(of) {
        Node::Variable(place) => Some(references.of_variable(sizes, place as usize)),
        _ => None,
    });
    needed.filter(|reference| *reference < references.parameters).collect::<BTreeSet<_>>().into_iter().collect()
}

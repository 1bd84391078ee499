//! The C of an FMU: the model, the interface over it, the standard's headers, and what tools must know to compile them.

use std::fmt::Write;

use sha2::{Digest, Sha256};

use crate::export::program::{Sizes, c_files};
use crate::export::{Exported, Program};

/// Leaves out what only CasADi asks for.
pub(super) const DEFINITION: &str = "MODEL_NO_CASADI";

const STANDARD: [(&str, &str); 3] = [
    ("fmi3Functions.h", include_str!("standard/fmi3Functions.h")),
    ("fmi3FunctionTypes.h", include_str!("standard/fmi3FunctionTypes.h")),
    ("fmi3PlatformTypes.h", include_str!("standard/fmi3PlatformTypes.h")),
];
const INTERFACE: [(&str, &str); 6] = [
    ("fmu_instance.h", include_str!("interface/fmu_instance.h")),
    ("fmu_instance.c", include_str!("interface/fmu_instance.c")),
    ("fmu_variables.c", include_str!("interface/fmu_variables.c")),
    ("fmu_model_exchange.c", include_str!("interface/fmu_model_exchange.c")),
    ("fmu_co_simulation.c", include_str!("interface/fmu_co_simulation.c")),
    ("fmu_absent.c", include_str!("interface/fmu_absent.c")),
];

/// The files of the folder `sources`, and by which names they are known.
#[derive(Debug)]
pub(super) struct Sources {
    /// The model's identifier in C: the name of the binary.
    pub identifier: String,
    /// What binds description and binary: it follows from the model's code.
    pub token: String,
    /// Names and texts.
    pub files: Vec<(String, String)>,
}

/// References of the standard to variables: the first one of each kind.
#[derive(Debug, Clone, Copy)]
pub(super) struct References {
    pub time: usize,
    pub states: usize,
    pub rates: usize,
    pub inputs: usize,
    pub readings: usize,
    pub parameters: usize,
    /// How many there are.
    pub all: usize,
}

impl References {
    pub(super) fn of(sizes: Sizes) -> Self {
        let states = 1;
        let rates = states + sizes.states;
        let inputs = rates + sizes.states;
        let readings = inputs + sizes.inputs;
        let parameters = readings + sizes.readings;
        References { time: 0, states, rates, inputs, readings, parameters, all: parameters + sizes.parameters }
    }

    /// The reference of a place among the program's variables x, u, p, t.
    pub(super) fn of_variable(self, sizes: Sizes, place: usize) -> usize {
        let (inputs, parameters) = (sizes.states, sizes.states + sizes.inputs);
        match place {
            _ if place < inputs => self.states + place,
            _ if place < parameters => self.inputs + place - inputs,
            _ if place < sizes.columns() => self.parameters + place - parameters,
            _ => self.time,
        }
    }
}

impl Sources {
    /// Of a model.
    pub(super) fn of(exported: &Exported<'_>, program: &Program) -> Self {
        let identifier = exported.identifier();
        let model = c_files(exported, program, &format!("{identifier}.h"));
        let mut files = vec![(format!("{identifier}.c"), model.code), (format!("{identifier}.h"), model.header)];
        files.extend(INTERFACE.iter().chain(&STANDARD).map(|(name, text)| ((*name).to_owned(), (*text).to_owned())));
        let token = token(&files);
        files.push(("fmu_model.h".to_owned(), names(&identifier, &token, program.sizes)));
        Sources { identifier, token, files }
    }

    /// The names of what is compiled.
    pub(super) fn units(&self) -> impl Iterator<Item = &str> {
        self.files.iter().map(|(name, _)| name.as_str()).filter(|name| name.ends_with(".c"))
    }

    /// buildDescription.xml.
    pub(super) fn build_description(&self) -> String {
        let mut text = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiBuildDescription fmiVersion=\"3.0\">\n  \
             <BuildConfiguration modelIdentifier=\"{}\">\n    <SourceFileSet language=\"C99\">\n",
            self.identifier
        );
        for unit in self.units() {
            let _ = writeln!(text, "      <SourceFile name=\"{unit}\"/>");
        }
        let _ = write!(
            text,
            "      <PreprocessorDefinition name=\"{DEFINITION}\" value=\"1\"/>\n    </SourceFileSet>\n    \
             <Library name=\"m\" external=\"true\" description=\"mathematical functions, where C keeps them apart\"/>\n  \
             </BuildConfiguration>\n</fmiBuildDescription>\n"
        );
        text
    }
}

/// A token that is another one for any other model.
fn token(files: &[(String, String)]) -> String {
    let mut digest = Sha256::new();
    for (name, text) in files {
        digest.update(name);
        digest.update([0]);
        digest.update(text);
        digest.update([0]);
    }
    let hex = digest.finalize().iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    });
    format!("{{{}-{}-{}-{}-{}}}", &hex[..8], &hex[8..12], &hex[12..16], &hex[16..20], &hex[20..32])
}

/// The header by which the interface, which is the same for every model, finds this one.
fn names(identifier: &str, token: &str, sizes: Sizes) -> String {
    let upper = identifier.to_uppercase();
    let mut text = format!(
        "/* The model behind the interface: its names, its sizes, the first value reference of each kind. */\n#ifndef FMU_MODEL_H\n#define FMU_MODEL_H\n\n\
         #include \"{identifier}.h\"\n\n#define INSTANTIATION_TOKEN \"{token}\"\n#define SAMPLE_PERIOD_S {upper}_SAMPLE_PERIOD_S\n\n"
    );
    let _ = writeln!(text, "typedef {identifier}_real model_real;");
    for function in ["rates", "readings", "rates_jacobian", "readings_jacobian", "step", "calibrated"] {
        let _ = writeln!(text, "#define model_{function} {identifier}_{function}");
    }
    // Several models may be linked into one program, where FMI3_FUNCTION_PREFIX tells their functions apart.
    for shared in ["refuse", "admits", "changed", "values", "slopes", "all_finite"] {
        let _ = writeln!(text, "#define fmu_{shared} {identifier}_fmu_{shared}");
    }
    let References { time, states, rates, inputs, readings, parameters, all } = References::of(sizes);
    let _ = write!(
        text,
        "\nenum {{ STATES = {upper}_STATES, INPUTS = {upper}_INPUTS, PARAMETERS = {upper}_PARAMETERS, READINGS = {upper}_READINGS }};\n\
         enum {{ OF_TIME = {time}, OF_STATES = {states}, OF_RATES = {rates}, OF_INPUTS = {inputs}, OF_READINGS = {readings},\n       \
         OF_PARAMETERS = {parameters}, REFERENCES = {all} }};\n\n#endif\n"
    );
    text
}

//! The merged calibrations as CSV: a row a calibration, group and fleet.

use csv::Writer;

use crate::fleet::Fleet;

/// `kind,name,robot,status,samples,chi2,dof,p_value`, then for every parameter of any of them its estimate and, behind `±`, its standard
/// error. What one does not have is empty.
///
/// # Errors
/// None that text in memory could meet.
pub fn csv(fleet: &Fleet) -> Result<Vec<u8>, csv::Error> {
    let mut names: Vec<&str> = Vec::new();
    let groups = || fleet.groups.iter().chain(&fleet.fleets);
    let of_entries = fleet.calibrations.iter().flat_map(|entry| &entry.estimates.names);
    for name in of_entries.chain(groups().flat_map(|group| group.merged.parameters.iter().map(|p| &p.name))) {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    let mut table = Writer::from_writer(Vec::new());
    let head = ["kind", "name", "robot", "status", "samples", "chi2", "dof", "p_value"].map(str::to_owned);
    table
        .write_record(head.into_iter().chain(names.iter().flat_map(|name| [name.to_string(), format!("± {name}")])))?;
    // What stands in front, and what there is to say of a parameter.
    let mut row = |front: [String; 8], number: &dyn Fn(&str) -> Option<(f64, f64)>| {
        let cells = names.iter().flat_map(|name| match number(name) {
            Some((value, error)) => [value.to_string(), error.to_string()],
            None => [String::new(), String::new()],
        });
        table.write_record(front.into_iter().chain(cells))
    };
    let none = String::new;
    for entry in &fleet.calibrations {
        let is_out = fleet.left_out.iter().any(|left| left.path == entry.path);
        let kind = if is_out { "left_out" } else { "calibration" }.to_owned();
        let status = serde_json::to_string(&entry.status).unwrap_or_default().trim_matches('"').to_owned();
        let (path, robot, samples) = (entry.path.clone(), entry.robot.clone(), entry.samples.to_string());
        let estimates = &entry.estimates;
        row([kind, path, robot, status, samples, none(), none(), none()], &|name| {
            let i = estimates.names.iter().position(|own| own == name)?;
            Some((estimates.values[i], estimates.covariance[i][i].sqrt()))
        })?;
    }
    for (kind, group) in fleet.groups.iter().map(|g| ("group", g)).chain(fleet.fleets.iter().map(|g| ("fleet", g))) {
        let merged = &group.merged;
        let status = if merged.consistent { "consistent" } else { "inconsistent" }.to_owned();
        let (chi2, dof) = (merged.chi2.to_string(), merged.dof.to_string());
        let p_value = merged.p_value.map_or_else(none, |p| p.to_string());
        row([kind.to_owned(), group.name.clone(), none(), status, none(), chi2, dof, p_value], &|name| {
            let parameter = merged.parameters.iter().find(|parameter| parameter.name == name)?;
            Some(parameter.best(merged.consistent))
        })?;
    }
    table.into_inner().map_err(|error| error.into_error().into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::Status;
    use crate::fleet::{By, Entry, Estimates, Group, LeftOut, Merged};

    #[test]
    fn a_table_reads_as_it_was_written() {
        let estimates = |name: &str, value: f64| Estimates {
            names: vec![name.to_owned()],
            units: vec!["kg".to_owned()],
            values: vec![value],
            covariance: vec![vec![0.25]],
        };
        let entry = |path: &str, estimates: Estimates| Entry {
            path: path.to_owned(),
            group: "arm".to_owned(),
            robot: "arm, left".to_owned(),
            extensions: Vec::new(),
            status: Status::Converged,
            samples: 100,
            recordings: Vec::new(),
            estimates,
        };
        let (one, other) = (estimates("k_s[1]", 7.5), estimates("b[1]", 0.1));
        let merged = Merged::of(&[&one]);
        let fleet = Fleet {
            by: By::Robot,
            calibrations: vec![entry("a \"good\", short\none", one), entry("b.json", other)],
            left_out: vec![LeftOut { path: "b.json".to_owned(), reason: "it is another one".to_owned() }],
            groups: vec![Group { name: "arm, left".to_owned(), members: Vec::new(), merged }],
            fleets: Vec::new(),
        };
        let text = csv(&fleet).unwrap();
        let mut table = csv::Reader::from_reader(text.as_slice());
        let head = table.headers().unwrap().clone();
        assert_eq!(head.iter().skip(7).collect::<Vec<_>>(), ["p_value", "k_s[1]", "± k_s[1]", "b[1]", "± b[1]"]);
        let rows: Vec<Vec<String>> =
            table.records().map(|row| row.unwrap().iter().map(str::to_owned).collect()).collect();
        let row = |cells: [&str; 12]| cells.map(str::to_owned).to_vec();
        assert_eq!(
            rows,
            [
                row([
                    "calibration",
                    "a \"good\", short\none",
                    "arm, left",
                    "converged",
                    "100",
                    "",
                    "",
                    "",
                    "7.5",
                    "0.5",
                    "",
                    "",
                ]),
                row(["left_out", "b.json", "arm, left", "converged", "100", "", "", "", "", "", "0.1", "0.5"]),
                row(["group", "arm, left", "", "consistent", "", "0", "0", "", "7.5", "0.5", "", ""]),
            ]
        );
    }
}

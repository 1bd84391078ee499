//! Many calibrations as one table: means over recordings of a robot, and over robots.
//!
//! ```text
//! CAL.json, one a process ─▶ Entry ─┬─▶ groups: one robot, several recordings ─▶ merged ─┬─▶ fleet: one kind of robot,
//!                                   │      same parameters? (χ²)                         │      several robots, spread?
//!                                   └─▶ left out: with the reason                        └─▶ a CSV, Markdown, a page
//! ```
//!
//! What is merged are the parameters that the robots share: gyro biases belong to one recording and are left out.

mod merge;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::calibrate::{Calibration, Status};

pub use merge::{Estimates, Merged, MergedParameter};

/// How calibrations are grouped before robots are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum By {
    /// The robot's name in the description.
    #[default]
    Robot,
    /// The folder that the result lies in: one folder a robot, where many have the same description.
    Folder,
}

/// TABLE.json: the result of `host table`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fleet {
    /// Grouping.
    pub by: By,
    /// Every calibration that was given and could be read.
    pub calibrations: Vec<Entry>,
    /// Files that went into no mean, with the reason.
    pub left_out: Vec<LeftOut>,
    /// Calibrations of one robot, merged.
    pub groups: Vec<Group>,
    /// Groups of one kind of robot, merged; only where there are several groups of a kind.
    pub fleets: Vec<Group>,
}

/// One calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Its file.
    pub path: String,
    /// The group that it belongs to.
    pub group: String,
    /// Name of the robot in the description.
    pub robot: String,
    /// Ids of effects that extend the base model.
    pub extensions: Vec<String>,
    /// How it ended.
    pub status: Status,
    /// Samples of all its recordings.
    pub samples: usize,
    /// Its recordings.
    pub recordings: Vec<String>,
    /// Identifiable parameters that recordings share.
    pub estimates: Estimates,
}

/// A file that went into no mean.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// The file.
    pub path: String,
    /// Why.
    pub reason: String,
}

/// Calibrations, or groups, that were merged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Group {
    /// Its name: the robot's, the folder's; that of a fleet is the robot's. Effects stand behind it.
    pub name: String,
    /// What was merged: files, or names of groups.
    pub members: Vec<String>,
    /// The means.
    pub merged: Merged,
}

impl Fleet {
    /// Merges the calibrations of these files; what could not be read is given as the text of the error.
    pub fn new(files: Vec<(PathBuf, Result<Calibration, String>)>, by: By) -> Self {
        let mut fleet =
            Self { by, calibrations: Vec::new(), left_out: Vec::new(), groups: Vec::new(), fleets: Vec::new() };
        let mut usable = Vec::new();
        let mut seen = BTreeSet::new();
        for (path, read) in files {
            let leave_out = |reason: String| LeftOut { path: path.display().to_string(), reason };
            let calibration = match read {
                Ok(calibration) => calibration,
                Err(reason) => {
                    fleet.left_out.push(leave_out(reason));
                    continue;
                }
            };
            let entry = Entry::new(&path, &calibration, by);
            let kind = (entry.group.clone(), kind(&calibration));
            let twice = calibration.recordings.iter().find(|used| seen.contains(&(kind.clone(), used.sha256.clone())));
            if calibration.status == Status::DoesNotFit {
                fleet.left_out.push(leave_out(format!("the model does not fit: {}", calibration.misfit.join("; "))));
            } else if !calibration.status.is_usable() {
                fleet.left_out.push(leave_out("the calibration did not converge".to_owned()));
            } else if let Some(used) = twice {
                let reason = format!("its recording {} went into another calibration already", used.path);
                fleet.left_out.push(leave_out(reason));
            } else if entry.estimates.names.is_empty() {
                fleet.left_out.push(leave_out("it gives no parameter a number".to_owned()));
            } else {
                seen.extend(calibration.recordings.iter().map(|used| (kind.clone(), used.sha256.clone())));
                usable.push((kind, entry.clone()));
            }
            fleet.calibrations.push(entry);
        }
        fleet.merge(&usable);
        fleet
    }

    fn merge(&mut self, usable: &[((String, String), Entry)]) {
        let kinds: BTreeSet<&(String, String)> = usable.iter().map(|(kind, _)| kind).collect();
        let mut by_robot: Vec<(String, Group)> = Vec::new();
        for kind in kinds {
            let members: Vec<&Entry> = usable.iter().filter(|(of, _)| of == kind).map(|(_, entry)| entry).collect();
            let estimates: Vec<&Estimates> = members.iter().map(|entry| &entry.estimates).collect();
            let name = match self.by {
                By::Robot => kind.1.clone(),
                By::Folder => format!("{}: {}", kind.0, kind.1),
            };
            let merged = Merged::of(&estimates);
            let group = Group { name, members: members.iter().map(|entry| entry.path.clone()).collect(), merged };
            by_robot.push((kind.1.clone(), group));
        }
        let robots: BTreeSet<&String> = by_robot.iter().map(|(robot, _)| robot).collect();
        for robot in robots {
            let groups: Vec<&Group> = by_robot.iter().filter(|(of, _)| of == robot).map(|(_, group)| group).collect();
            if groups.len() > 1 {
                let estimates: Vec<Estimates> = groups.iter().map(|group| group.merged.estimates()).collect();
                let merged = Merged::of(&estimates.iter().collect::<Vec<_>>());
                let members = groups.iter().map(|group| group.name.clone()).collect();
                self.fleets.push(Group { name: robot.clone(), members, merged });
            }
        }
        self.groups = by_robot.into_iter().map(|(_, group)| group).collect();
    }
}

/// The robot with what extends its model: parameters of other models do not mean the same.
fn kind(calibration: &Calibration) -> String {
    let preset = match calibration.preset {
        crate::calibrate::Preset::Default => String::new(),
        other => format!(", preset {}", format!("{other:?}").to_lowercase()),
    };
    let extensions: String = calibration.extensions.iter().map(|id| format!(" + {id}")).collect();
    format!("{}{extensions}{preset}", calibration.robot)
}

impl Entry {
    fn new(path: &Path, calibration: &Calibration, by: By) -> Self {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let group = match by {
            By::Robot => calibration.robot.clone(),
            By::Folder => folder.map_or(".".to_owned(), |folder| folder.display().to_string()),
        };
        Self {
            path: path.display().to_string(),
            group,
            robot: calibration.robot.clone(),
            extensions: calibration.extensions.clone(),
            status: calibration.status,
            samples: calibration.recordings.iter().map(|used| used.samples).sum(),
            recordings: calibration.recordings.iter().map(|used| used.path.clone()).collect(),
            estimates: Estimates::of(calibration),
        }
    }
}

//! Every constant that decides something, with its meaning and what its value was chosen on.
//!
//! They were chosen on EMPS, KUKA KR300 and the recordings of an independent simulator. The population that has to judge them is the wrong-world study
//! (`cargo run --release -p tests --bin wrong_world`); half and twice of each have not been counted on it yet (`host/doc/diagnosis.md`).
//!
//! Where a constant says what half and twice of it do, decisions of logged diagnoses were taken again one by one (`cargo run -p tests --bin decisions -- LOG…`). The logs are of
//! five diagnoses: viscous friction as an outsider (`hidden --kind outsiders --effects viscous_friction`, seeds 1 and 2, and seed 1 with `motor_mismatch` in the catalogue), EMPS, and the recording
//! `dirty_outsider`. That is a small population, and no study.

/// Blocks of time that a diagnosis looks at. The scatter between them is the only error model, so there must be enough of them for an interval (eight)
/// and each must be long against the correlation of residuals.
pub const BLOCKS: usize = 30;

/// Of the blocks, those that are taken where the base model fits the whole recording worst; the others are spread evenly. An event lasts for one block, and
/// saturation for a few.
pub const WORST_BLOCKS: usize = 4;

/// Samples of all blocks together of a robot of [`STATES`] states; a recording of up to three times as many is looked at whole.
pub const SAMPLES: usize = 8_000;

/// Noise of steps so many times what steps have at least, from which on events are looked for in what the greater part of the recording leaves, and from which on a misfit that no
/// curve shows has its place by the steps that err most.
pub const WRONG: f64 = 3.0;

/// Samples of all blocks that a scan looks at.
pub const SCAN_SAMPLES: usize = 6_000;

/// States of the robot that the numbers of samples are given for: cost goes with the square of the states.
pub const STATES: usize = 12;

/// Fewest samples of a block.
pub const LEAST_BLOCK: usize = 40;

/// Share of recordings without an effect in which any law of the catalogue may pass the scan's test.
///
/// 17 of 19 accepted laws stay; as many at half and at twice: the two others have p = 0.4.
pub const LEVEL: f64 = 0.01;

/// Share of white noise in which any law would be refitted at all. Of 10 accepted laws none is lost at half.
pub const SIEVE: f64 = 0.05;

/// Laws that are refitted in each round, the best of the scan, and at most so many more that are collinear with the best or act on the same quantity.
///
/// Of 10 accepted laws half of it loses 2, and twice gains none: all were among the first three of the scan.
pub const REFITTED: usize = 5;
/// See [`REFITTED`].
pub const RIVALS_REFITTED: usize = 2;

/// A law whose score is less than this share of the best one's waits for the next round. Of 10 accepted laws none is lost at twice.
pub const PROMISING: f64 = 0.1;

/// A law whose score is less than this share of what a law has to gain to be a finding is not refitted.
///
/// Counted on five logged diagnoses (the recordings `dirty_outsider` and `dirty_hysteresis`, KUKA, and a two-link arm from MuJoCo twice): of 11 laws that were accepted
/// beside others the least score is 0.49 of that, then 0.71. None is lost at half; twice of it loses that one, four times both.
pub const TANGENT: f64 = 0.25;

/// A refit that after a few iterations saves less than this share of what the best one so far does, and does not fall fast, is given up: it is no rival.
pub const LEAST_OF_BEST: f64 = 0.5;

/// A refit ends with the step that adds less than this share to what its law saves: a third of [`RIVAL_SHARE`], within which rivals are told apart by something else.
pub const ENOUGH_OF_SAVED: f64 = 0.01;

/// |cos| of projected columns from which on two laws may stand for each other.
pub const COLLINEAR: f64 = 0.9;

/// Curves that gain less than this share of what the base model leaves unexplained have no line in the result; a law that gains less of what is explained with it is no finding.
pub const LEAST_SHARE: f64 = 0.02;

/// A law is named where it gains at least this share of what the best of the curves gains that stand for it: they are on its row, or beside them less than this share of its score is left.
///
/// 10 of 13 laws are covered; at half 12, two of which are `stribeck` for viscous friction that is not in the catalogue; at twice 6: EMPS loses its friction by direction (0.58), its delay (0.60) and its ripple (0.96).
pub const COVERED: f64 = 0.5;

/// Rivals whose gains differ by less than this share are told apart by plausibility and parsimony.
pub const RIVAL_SHARE: f64 = 0.03;

/// Most findings.
pub const MOST_FINDINGS: usize = 6;

/// The name goes to a law whose weight is at least this among its rivals. Of 10 accepted laws none has a weight between half of it and it; one has less than all.
pub const WEIGHT: f64 = 0.9;

/// Standard deviations on the logarithmic scale beyond which a size is called implausible.
pub const IMPLAUSIBLE: f64 = 3.0;

/// Fewest blocks of an interval.
pub const LEAST_BLOCKS: usize = 8;

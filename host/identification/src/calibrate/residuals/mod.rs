//! Rows of the least-squares problem and what they are weighted by: the one meaning of a sensor's row and of a step of the model.

pub(crate) mod chained;
pub(crate) mod law_rows;
pub(crate) mod noise;
pub(crate) mod point;
pub(crate) mod preset;
pub(crate) mod problem;
pub(crate) mod rigid_base;
pub(crate) mod robot_scale;
pub(crate) mod row;
pub(crate) mod row_plan;
pub(crate) mod stage_quads;
pub(crate) mod triple;
pub(crate) mod wide;

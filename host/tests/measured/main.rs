//! Stories about measured machines: the program's figures beside the published ones. The data are read from `REALDATA_DIR`.

mod bam;
mod dfki;
mod emps;
mod files;
mod kuka;
#[path = "../program/mod.rs"]
mod program;

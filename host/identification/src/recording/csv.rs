//! Recordings as tables, for other programs. `import` reads them back.
//!
//! What a table cannot carry (motion, phases, flags, balance, handshake) is lost.

use std::io::{self, Write};

use super::Recording;

/// Writes the table with a header and one row a sample; missing ticks are missing rows, invalid readings empty fields.
///
/// Every number is the shortest decimal that reads back as the same `f64`, so a table that is imported again gives the
/// same numbers, bit for bit.
///
/// # Errors
/// Those of `out`.
pub fn write<W: Write>(mut out: W, recording: &Recording) -> io::Result<W> {
    writeln!(out, "{}", recording.robot.columns().join(","))?;
    for k in 0..recording.len() {
        write!(out, "{}", recording.t_us[k])?;
        for duty in &recording.duty {
            write!(out, ",{}", duty[k])?;
        }
        for channel in &recording.channels {
            match channel.values[k] {
                value if value.is_nan() => write!(out, ",")?,
                value => write!(out, ",{value}")?,
            }
        }
        writeln!(out)?;
    }
    out.flush()?;
    Ok(out)
}

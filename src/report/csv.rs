use crate::correct::{Row, Status};
use crate::text::number::write_fixed;
use std::io::{self, Write};

/// The report's header (INTERFACE.md, Report).
pub const CSV_HEADER: &str = "target,line,name,status,x_mm,y_mm,z_mm,error_x_mm,error_y_mm,error_z_mm,error_mm,\
error_rx_deg,error_ry_deg,error_rz_deg,error_normal_mm,correction_x_mm,correction_y_mm,correction_z_mm,\
correction_rx_deg,correction_ry_deg,correction_rz_deg,remaining_mm,fx_n,fy_n,fz_n,sigma_mm\n";

/// Decimals: a tenth of a micrometre, more where only the order of magnitude is of interest.
const POSITION: usize = 4;
const ERROR: usize = 6;
const ANGLE: usize = 7;
const FORCE: usize = 3;

/// Writes report rows, one a target.
///
/// # Errors
/// What `out` reports.
pub fn write_csv(rows: &[Row], out: &mut impl Write) -> io::Result<()> {
    out.write_all(CSV_HEADER.as_bytes())?;
    out.write_all(&csv_rows(rows))
}

/// The rows alone, one line a target.
#[must_use]
pub fn csv_rows(rows: &[Row]) -> Vec<u8> {
    let mut line = Vec::with_capacity(256 * rows.len());
    for row in rows {
        let status = match row.status {
            Status::Ok => "ok",
            Status::Air => "air",
            Status::Kept(_) => "kept",
        };
        let name = row.name.as_deref().unwrap_or("");
        write_whole(&mut line, row.target);
        line.push(b',');
        write_whole(&mut line, row.line);
        for text in [name, status] {
            line.push(b',');
            line.extend_from_slice(text.as_bytes());
        }
        let groups: [(&[f64], usize); 8] = [
            (&row.position_mm, POSITION),
            (&row.error_mm, ERROR),
            (&[row.error_norm_mm()], ERROR),
            (&row.error_deg, ANGLE),
            (&[row.error_normal_mm], ERROR),
            (&row.correction_mm, ERROR),
            (&row.correction_deg, ANGLE),
            (&[row.remaining_norm_mm()], ERROR),
        ];
        for (values, decimals) in groups.into_iter().chain([(&row.force_n[..], FORCE)]) {
            for &value in values {
                line.push(b',');
                write_fixed(&mut line, value, decimals);
            }
        }
        line.push(b',');
        if let Some(sigma) = row.sigma_mm {
            write_fixed(&mut line, sigma, ERROR);
        }
        line.push(b'\n');
    }
    line
}

fn write_whole(line: &mut Vec<u8>, value: u32) {
    write_fixed(line, f64::from(value), 0);
}

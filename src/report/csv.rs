use crate::correct::{Row, Status};
use crate::text::number;
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

/// Numbers that every row has.
const NUMBERS: usize = 21;
/// Of each, its decimals.
const DECIMALS: [usize; NUMBERS] = [
    POSITION, POSITION, POSITION, ERROR, ERROR, ERROR, ERROR, ANGLE, ANGLE, ANGLE, ERROR, ERROR, ERROR, ERROR, ANGLE,
    ANGLE, ANGLE, ERROR, FORCE, FORCE, FORCE,
];
/// In rows of eight.
const BLOCKS: usize = NUMBERS.div_ceil(8);
const ROW: number::Row<BLOCKS> = number::Row::new(&DECIMALS);

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
    let mut fields = number::Fields::new();
    for row in rows {
        let status = match row.status {
            Status::Ok => "ok",
            Status::Air => "air",
            Status::Kept(_) => "kept",
        };
        for whole in [row.target, row.line] {
            number::write_whole(&mut line, whole);
            line.push(b',');
        }
        for text in [row.name.as_deref().unwrap_or(""), status] {
            line.extend_from_slice(text.as_bytes());
            line.push(b',');
        }
        let values = numbers(row);
        if ROW.read(&values, &mut fields) {
            take(&mut fields);
            line.extend_from_slice(fields.take());
        } else {
            append_plain(&mut line, &values);
        }
        if let Some(sigma) = row.sigma_mm {
            number::write_fixed(&mut line, sigma, ERROR);
        }
        line.push(b'\n');
    }
    line
}

/// Numbers between status and sigma.
type Numbers = [[f64; 8]; BLOCKS];

fn numbers(row: &Row) -> Numbers {
    let [x, y, z] = row.position_mm;
    let [ex, ey, ez] = row.error_mm;
    let [erx, ery, erz] = row.error_deg;
    let [cx, cy, cz] = row.correction_mm;
    let [crx, cry, crz] = row.correction_deg;
    let [fx, fy, fz] = row.force_n;
    let (error, normal, remaining) = (row.error_norm_mm(), row.error_normal_mm, row.remaining_norm_mm());
    [
        [x, y, z, ex, ey, ez, error, erx],
        [ery, erz, normal, cx, cy, cz, crx, cry],
        [crz, remaining, fx, fy, fz, 0.0, 0.0, 0.0],
    ]
}

/// Takes the numbers: what [`append_plain`] writes.
fn take(fields: &mut number::Fields<BLOCKS>) {
    (0..3).for_each(|i| fields.push::<POSITION>(i));
    (3..7).for_each(|i| fields.push::<ERROR>(i));
    (7..10).for_each(|i| fields.push::<ANGLE>(i));
    (10..14).for_each(|i| fields.push::<ERROR>(i));
    (14..17).for_each(|i| fields.push::<ANGLE>(i));
    fields.push::<ERROR>(17);
    (18..21).for_each(|i| fields.push::<FORCE>(i));
}

fn append_plain(line: &mut Vec<u8>, values: &Numbers) {
    for (&value, decimals) in values.as_flattened().iter().zip(DECIMALS) {
        number::write_fixed(line, value, decimals);
        line.push(b',');
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rows_have_the_same_digits_either_way(
            values in any::<[i32; NUMBERS]>(),
            bits in prop::collection::vec(0..32, NUMBERS),
        ) {
            // Digits below 10^9, next to none of them close to a tie; half of them small.
            let mut rows = [[0.0; 8]; BLOCKS];
            for (i, (value, bits)) in values.iter().zip(&bits).enumerate() {
                let ten = 10_f64.powi(i32::try_from(DECIMALS[i]).unwrap());
                rows.as_flattened_mut()[i] = 0.4 * f64::from(value >> bits) / ten;
            }
            let (mut fields, mut plain) = (number::Fields::new(), Vec::new());
            prop_assume!(ROW.read(&rows, &mut fields));
            take(&mut fields);
            append_plain(&mut plain, &rows);
            prop_assert_eq!(String::from_utf8_lossy(fields.take()), String::from_utf8_lossy(&plain));
        }

        #[test]
        fn numbers_that_need_a_closer_look_get_it(value in any::<f64>(), halves in -3000..3000_i32, at in 0..NUMBERS) {
            for value in [value, f64::from(halves) / 2.0 / 10_f64.powi(i32::try_from(DECIMALS[at]).unwrap()), f64::NAN, 1e9, -0.0] {
                let mut rows = [[0.0; 8]; BLOCKS];
                rows.as_flattened_mut()[at] = value;
                let (mut fields, mut plain) = (number::Fields::new(), Vec::new());
                if ROW.read(&rows, &mut fields) {
                    take(&mut fields);
                    append_plain(&mut plain, &rows);
                    prop_assert_eq!(String::from_utf8_lossy(fields.take()), String::from_utf8_lossy(&plain));
                }
            }
        }
    }
}

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
const TENS: [f64; NUMBERS] = number::tens(DECIMALS);

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
    let mut fields = Fields::new();
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
        match number::scaled_row(&values, &TENS) {
            Some(digits) => {
                take(&mut fields, &values, &digits);
                line.extend_from_slice(fields.take());
            }
            None => append_plain(&mut line, &values),
        }
        if let Some(sigma) = row.sigma_mm {
            number::write_fixed(&mut line, sigma, ERROR);
        }
        line.push(b'\n');
    }
    line
}

/// The numbers between status and sigma.
fn numbers(row: &Row) -> [f64; NUMBERS] {
    let [x, y, z] = row.position_mm;
    let [ex, ey, ez] = row.error_mm;
    let [erx, ery, erz] = row.error_deg;
    let [cx, cy, cz] = row.correction_mm;
    let [crx, cry, crz] = row.correction_deg;
    let [fx, fy, fz] = row.force_n;
    let (error, normal, remaining) = (row.error_norm_mm(), row.error_normal_mm, row.remaining_norm_mm());
    [x, y, z, ex, ey, ez, error, erx, ery, erz, normal, cx, cy, cz, crx, cry, crz, remaining, fx, fy, fz]
}

/// Room for the numbers.
type Fields = number::Fields<{ number::Fields::<0>::size(NUMBERS) }>;

/// Takes the numbers, given their digits: what [`append_plain`] writes.
fn take(fields: &mut Fields, values: &[f64; NUMBERS], digits: &[u64; NUMBERS]) {
    fn group<const DECIMALS: usize>(fields: &mut Fields, values: &[f64], digits: &[u64]) {
        for (value, digits) in values.iter().zip(digits) {
            fields.push::<DECIMALS>(*value, *digits);
        }
    }
    group::<POSITION>(fields, &values[..3], &digits[..3]);
    group::<ERROR>(fields, &values[3..7], &digits[3..7]);
    group::<ANGLE>(fields, &values[7..10], &digits[7..10]);
    group::<ERROR>(fields, &values[10..14], &digits[10..14]);
    group::<ANGLE>(fields, &values[14..17], &digits[14..17]);
    group::<ERROR>(fields, &values[17..18], &digits[17..18]);
    group::<FORCE>(fields, &values[18..], &digits[18..]);
}

fn append_plain(line: &mut Vec<u8>, values: &[f64; NUMBERS]) {
    for (&value, decimals) in values.iter().zip(DECIMALS) {
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
            // Digits below 10^9, next to none of them close to a tie.
            let values = std::array::from_fn(|i| 0.4 * f64::from(values[i] >> bits[i]) / TENS[i]);
            let digits = number::scaled_row(&values, &TENS);
            prop_assume!(digits.is_some());
            let (mut fast, mut plain) = (Fields::new(), Vec::new());
            take(&mut fast, &values, &digits.unwrap());
            append_plain(&mut plain, &values);
            prop_assert_eq!(String::from_utf8_lossy(fast.take()), String::from_utf8_lossy(&plain));
        }
    }
}

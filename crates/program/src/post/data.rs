//! Declarations, as RAPID aggregates.

use super::names::predefined_speed;
use crate::EXTERNAL_AXES;
use crate::{Confdata, ToolData, WobjData};
use deflex_text::number::{Digits, Fixed, Row, write_fixed, write_whole};

/// Decimals of millimetres: below the spacing of single precision at 1 m (1.2e-4 mm).
const MM: usize = 4;
/// Decimals of quaternion components: 3e-6 mm at 300 mm.
const QUAT: usize = 8;
/// Smallest mass of a tool that a controller accepts, kg: that of its own tool0.
const LEAST_MASS_KG: f64 = 0.001;

/// `[a,b,c]`
pub(super) fn list(out: &mut Vec<u8>, values: &[f64], decimals: usize) {
    out.push(b'[');
    for (i, value) in values.iter().enumerate() {
        if i > 0 {
            out.push(b',');
        }
        write_fixed(out, *value, decimals);
    }
    out.push(b']');
}

/// `[[x,y,z],[q1,q2,q3,q4]]`
fn frame(out: &mut Vec<u8>, mm: &[f64; 3], quat: &[f64; 4]) {
    out.push(b'[');
    list(out, mm, MM);
    out.push(b',');
    list(out, quat, QUAT);
    out.push(b']');
}

/// A robtarget: `[[x,y,z],[q1,q2,q3,q4],[cf1,cf4,cf6,cfx],[9E9,…]]`
pub(super) fn robtarget(
    out: &mut Vec<u8>,
    mm: &[f64; 3],
    quat: &[f64; 4],
    conf: Confdata,
    external: &[Option<f64>; EXTERNAL_AXES],
) {
    const ROW: Row<1> = Row::new(&[MM, MM, MM, QUAT, QUAT, QUAT, QUAT]);
    let ([x, y, z], [q1, q2, q3, q4]) = (*mm, *quat);
    let mut digits = [Digits::default()];
    if ROW.read(&[[x, y, z, q1, q2, q3, q4, 0.0]], &mut digits) {
        let [digits] = digits;
        let (mut text, mut len) = ([b'['; 8 * Fixed::SIZE], 2);
        for i in 0..7 {
            let Some(place) = text[len..].first_chunk_mut() else { unreachable!("there is room for eight") };
            len += if i < 3 { digits.put::<MM>(i, place) } else { digits.put::<QUAT>(i, place) };
            if i == 2 {
                text[len - 1..len + 2].copy_from_slice(b"],[");
                len += 2;
            }
        }
        text[len - 1] = b']';
        out.extend_from_slice(&text[..len]);
    } else {
        frame(out, mm, quat);
        out.pop();
    }
    out.push(b',');
    quarters(out, conf);
    if external.iter().all(Option::is_none) {
        return out.extend_from_slice(b",[9E9,9E9,9E9,9E9,9E9,9E9]]");
    }
    for (i, position) in external.iter().enumerate() {
        out.extend_from_slice(if i == 0 { b",[" } else { b"," });
        match position {
            Some(position) => write_fixed(out, *position, MM),
            None => out.extend_from_slice(b"9E9"),
        }
    }
    out.extend_from_slice(b"]]");
}

/// `[cf1,cf4,cf6,cfx]`
fn quarters(out: &mut Vec<u8>, conf: Confdata) {
    out.push(b'[');
    for (i, quarter) in [conf.cf1, conf.cf4, conf.cf6, conf.cfx].into_iter().enumerate() {
        if i > 0 {
            out.push(b',');
        }
        if quarter < 0 {
            out.push(b'-');
        }
        match quarter.unsigned_abs() {
            one @ 0..=9 => out.push(b"0123456789"[one as usize]),
            more => write_whole(out, more),
        }
    }
    out.push(b']');
}

pub(super) fn tooldata(out: &mut Vec<u8>, name: &str, data: &ToolData) {
    // A controller refuses a tool without mass: mass and centre of gravity are then those of tool0.
    let massless = data.mass_kg <= 0.0;
    let (mass, cog) = if massless { (LEAST_MASS_KG, [0.0, 0.0, 0.001]) } else { (data.mass_kg, data.cog_mm) };
    out.extend_from_slice(format!("  PERS tooldata {name}:=[{},", truth(data.robhold)).as_bytes());
    frame(out, &data.tcp_mm, &data.tcp_quat);
    out.extend_from_slice(b",[");
    write_fixed(out, mass, MM);
    out.push(b',');
    list(out, &cog, MM);
    out.extend_from_slice(b",[1,0,0,0],0,0,0]];\n");
}

/// `unit` is the mechanical unit that is its user frame; empty for none.
pub(super) fn wobjdata(out: &mut Vec<u8>, name: &str, data: &WobjData, unit: &str) {
    out.extend_from_slice(
        format!("  PERS wobjdata {name}:=[{},{},\"{unit}\",", truth(data.robhold), truth(data.fixed)).as_bytes(),
    );
    frame(out, &data.uframe_mm, &data.uframe_quat);
    out.push(b',');
    frame(out, &data.oframe_mm, &data.oframe_quat);
    out.extend_from_slice(b"];\n");
}

/// `[v_tcp,500,5000,1000]`; the other three are those of every predefined speed.
pub(super) fn speeddata(out: &mut Vec<u8>, mm_s: f64) {
    out.push(b'[');
    write_fixed(out, mm_s, MM);
    out.extend_from_slice(b",500,5000,1000]");
}

/// Declares those of `speeds` that have no predefined name, each once. Returns the names by speed.
pub(super) fn speeds(out: &mut Vec<u8>, speeds: &[f64]) -> Vec<(f64, String)> {
    let mut named: Vec<(f64, String)> = Vec::new();
    for &mm_s in speeds {
        let known = |(v, _): &(f64, String)| (v - mm_s).abs() < super::names::SAME_SPEED;
        if predefined_speed(mm_s).is_some() || named.iter().any(known) || mm_s.is_nan() || mm_s <= 0.0 {
            continue;
        }
        let name = format!("vFeed{}", named.len() + 1);
        out.extend_from_slice(format!("  CONST speeddata {name}:=").as_bytes());
        speeddata(out, mm_s);
        out.extend_from_slice(b";\n");
        named.push((mm_s, name));
    }
    named
}

fn truth(value: bool) -> &'static str {
    if value { "TRUE" } else { "FALSE" }
}

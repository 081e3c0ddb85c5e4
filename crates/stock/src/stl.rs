//! STL files, binary and text: triangles.

use nalgebra::Vector3;

/// Bytes of the header of a binary file, and of each triangle (a normal, three corners, two bytes without a meaning).
const HEADER: usize = 80;
const TRIANGLE: usize = 50;

/// Why a file is not STL.
///
/// # Examples
/// ```
/// use deflex_stock::{StlError, read_stl};
///
/// assert_eq!(read_stl(b"a drawing").expect_err("not a mesh"), StlError::Neither);
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StlError {
    /// It is too short or too long.
    #[error("{found} bytes, but {triangles} triangles take {expected}")]
    Length {
        /// Number of triangles that the file states.
        triangles: usize,
        /// Its length, bytes.
        found: usize,
        /// The length for this number of triangles, bytes.
        expected: usize,
    },
    /// It is neither binary nor text.
    #[error("this is not an STL file, neither text (`solid …`) nor binary")]
    Neither,
    /// Text that is not understood.
    #[error("line {line}: expected {expected}")]
    Text {
        /// Number of the line, from 1.
        line: usize,
        /// The word that was expected.
        expected: &'static str,
    },
}

/// Reads the triangles of an STL file in millimetres; corners in m.
///
/// # Errors
/// The file is not STL, or is cut off.
///
/// # Examples
/// ```
/// use deflex_stock::read_stl;
///
/// let text = b"solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 10 0 0\nvertex 0 10 0\nendloop\nendfacet\nendsolid s\n";
/// assert_eq!(read_stl(text).expect("text form")[0][1].x, 0.01); // m
/// ```
pub fn read_stl(bytes: &[u8]) -> Result<Vec<[Vector3<f64>; 3]>, StlError> {
    // Binary files may begin with `solid` too, so the length decides.
    let stated = bytes.get(HEADER..HEADER + 4).and_then(|stated| <[u8; 4]>::try_from(stated).ok());
    let triangles = stated.map(|stated| u32::from_le_bytes(stated) as usize);
    let expected = triangles.map(|triangles| HEADER + 4 + TRIANGLE * triangles);
    if expected == Some(bytes.len()) {
        return Ok(binary(&bytes[HEADER + 4..]));
    }
    if bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) {
        return text(bytes);
    }
    match triangles.zip(expected) {
        Some((triangles, expected)) => Err(StlError::Length { triangles, found: bytes.len(), expected }),
        None => Err(StlError::Neither),
    }
}

fn binary(bytes: &[u8]) -> Vec<[Vector3<f64>; 3]> {
    let number = |at: &[u8]| f64::from(f32::from_le_bytes([at[0], at[1], at[2], at[3]]));
    let corner = |at: &[u8]| Vector3::new(number(at), number(&at[4..]), number(&at[8..])) * 1e-3;
    bytes.chunks_exact(TRIANGLE).map(|one| [corner(&one[12..]), corner(&one[24..]), corner(&one[36..])]).collect()
}

/// Reads the text form, of which only the corners are needed: three for each facet.
fn text(bytes: &[u8]) -> Result<Vec<[Vector3<f64>; 3]>, StlError> {
    let mut triangles = Vec::new();
    let mut corners: Vec<Vector3<f64>> = Vec::new();
    for (i, row) in bytes.split(|b| *b == b'\n').enumerate() {
        let fail = |expected| StlError::Text { line: i + 1, expected };
        let row = std::str::from_utf8(row).unwrap_or_default();
        let mut words = row.split_ascii_whitespace();
        match words.next().map(str::to_ascii_lowercase).as_deref() {
            Some("vertex") => {
                let mut number = || words.next().and_then(|word| word.parse::<f64>().ok());
                let corner = number().zip(number()).zip(number());
                let ((x, y), z) = corner.ok_or_else(|| fail("`vertex` with three numbers"))?;
                corners.push(Vector3::new(x, y, z) * 1e-3);
            }
            Some("endfacet") => {
                let three = <[Vector3<f64>; 3]>::try_from(std::mem::take(&mut corners));
                triangles.push(three.map_err(|_| fail("three corners before `endfacet`"))?);
            }
            _ => {}
        }
    }
    Ok(triangles)
}

//! The files from which a result was made.

use serde::Serialize;
use sha2::{Digest, Sha256};
use std::io::{self, Read};

/// Version of deflex, as it stands in results.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// A file from which a result was made, with its hash. `sha256sum` shows whether it has changed since.
///
/// # Examples
/// ```
/// use deflex_report::Origin;
///
/// let origin = Origin::of("part.mod", b"MODULE A");
/// assert_eq!(origin.sha256, Origin::read("part.mod", &b"MODULE A"[..])?.sha256);
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Origin {
    /// As the user typed it.
    pub path: String,
    /// SHA-256 of its bytes, in hexadecimal.
    pub sha256: String,
}

impl Origin {
    /// From the content of a file in memory.
    #[must_use]
    pub fn of(path: &str, bytes: &[u8]) -> Self {
        Self { path: path.to_owned(), sha256: hexadecimal(&Sha256::digest(bytes)) }
    }

    /// From the content of a file, which is read in parts.
    ///
    /// # Errors
    /// Those of `input`.
    pub fn read(path: &str, mut input: impl Read) -> io::Result<Self> {
        let (mut hash, mut block) = (Sha256::new(), vec![0; 64 * 1024]);
        loop {
            match input.read(&mut block)? {
                0 => return Ok(Self { path: path.to_owned(), sha256: hexadecimal(&hash.finalize()) }),
                count => hash.update(&block[..count]),
            }
        }
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::Origin;

    #[test]
    fn hashes_are_those_of_fips_180() {
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(Origin::of("a", b"abc").sha256, abc);
        assert_eq!(Origin::read("a", &b"abc"[..]).unwrap(), Origin::of("a", b"abc"));
    }
}

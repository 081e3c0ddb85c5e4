//! What a result was made from.

use serde::Serialize;
use sha2::{Digest, Sha256};
use std::io::{self, Read};

/// Version of deflex, as results name it.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// A file that a result was made from, as it was then: `sha256sum` tells whether it still is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Origin {
    /// As the user typed it.
    pub path: String,
    /// SHA-256 of its bytes, in hexadecimal.
    pub sha256: String,
}

impl Origin {
    /// A file that is held.
    #[must_use]
    pub fn of(path: &str, bytes: &[u8]) -> Self {
        Self { path: path.to_owned(), sha256: hexadecimal(&Sha256::digest(bytes)) }
    }

    /// A file that is read for it.
    ///
    /// # Errors
    /// What `input` reports.
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

//! What deflex leaves alone although it could be known.

/// Constructs of which less is corrected than could be; said. One that is mended comes off the list, or the test fails.
pub const LEFT: &[&str] = &["displacement on and off", "target assigned after its use"];

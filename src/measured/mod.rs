//! measured.

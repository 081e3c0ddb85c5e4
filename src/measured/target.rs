//! How a row of a table names its target.

/// The target to which a row belongs.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum TargetRef {
    /// 1-based ordinal among the executed motions.
    Ordinal(u32),
    /// Name of a declared robtarget that the program visits once, as written.
    Name(String),
}

//! How a row of a table names its target.

/// The target to which a row belongs.
///
/// # Examples
/// ```
/// use deflex_measured::{Table, TargetRef};
/// use deflex_text::Source;
///
/// let table = Table::read(&Source::new("measured.csv", "target,x_mm,y_mm,z_mm\np10,10.02,0,-2\n"))?;
/// assert_eq!(table.rows[0].target, Some(TargetRef::Name("p10".to_owned())));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TargetRef {
    /// 1-based ordinal among the executed motions.
    Ordinal(u32),
    /// Name of a declared robtarget that the program visits once, as written.
    Name(String),
}

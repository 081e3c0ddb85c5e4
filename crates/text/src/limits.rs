//! Upper bounds for what deflex reads and computes. The size of the work is determined before memory is allocated. If it
//! exceeds a bound, the run stops with an error that says what to change. The code, the messages and the table in
//! `docs/limits-and-safety.md` take all bounds from here.

/// An upper bound for a count.
///
/// # Examples
/// ```
/// use deflex_text::limits::{ALL, ARRAY_ROWS};
///
/// for bound in ALL {
///     println!("{}: at most {}", bound.what, bound.most);
/// }
/// assert!(ARRAY_ROWS.exceeded(1e6).is_none());
/// assert!(ARRAY_ROWS.exceeded(1e9).is_some_and(|message| message.contains("100000000")));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Bound {
    /// What is counted.
    pub what: &'static str,
    /// The most that deflex accepts.
    pub most: u64,
    /// What to change beyond it.
    pub help: &'static str,
}

impl Bound {
    /// The message for a count that exceeds the bound; `None` if it does not. NaN counts as exceeding it.
    #[must_use]
    pub fn exceeded(&self, count: f64) -> Option<String> {
        let within = count <= self.most as f64;
        (!within).then(|| format!("{}: {count:.0} are more than the {} that deflex accepts", self.what, self.most))
    }
}

/// Lines through the blank on which a simulation stores the stock. With this many lines, a simulation takes about a minute
/// on two cores, and about 220 bytes of memory for each line.
pub const STOCK_LINES: Bound = Bound {
    what: "lines of the stock ([stock] resolution_mm over its box)",
    most: 20_000_000,
    help: "give a larger `resolution_mm`, or a smaller blank",
};

/// Motions that a RAPID program with loops executes. Equal motions are stored only once. The bound distinguishes an endless
/// loop from a long one within minutes.
pub const RUN_MOTIONS: Bound = Bound {
    what: "motions that a RAPID program runs through in its loops",
    most: 20_000_000,
    help: "split the program, or bound its loops",
};

/// Triangles of a mesh. A binary STL file with this many has 250 MB.
pub const STL_TRIANGLES: Bound =
    Bound { what: "triangles of an STL file", most: 5_000_000, help: "export the mesh with a coarser tolerance" };

/// Largest distance of a mesh's corner from the origin, mm. It is larger than any machine. At this distance, numbers of
/// single precision have steps of about a hundredth of a millimetre.
pub const STL_REACH_MM: Bound = Bound {
    what: "coordinates of an STL file, mm",
    most: 100_000,
    help: "export the mesh in millimetres, near the origin of the stock's work object",
};

/// External axes that a program can move.
pub const EXTERNAL_AXES: usize = 6;

/// Mechanical units (tracks and positioners) of a cell. Each has at least one of the six external axes of a controller.
pub const UNITS: Bound = Bound {
    what: "units ([[unit]]) of a cell",
    most: EXTERNAL_AXES as u64,
    help: "each unit has an external axis of its own, eax_a to eax_f: remove the others",
};

/// Tools of a cell, and also its work objects. No tool magazine holds as many.
pub const FRAMES: Bound = Bound {
    what: "tools, or work objects, of a cell",
    most: 10_000,
    help: "keep only those that the programs of this cell use",
};

/// Columns of a measured file or of a table of forces.
pub const COLUMNS: Bound =
    Bound { what: "columns of a table", most: 10_000, help: "keep only the columns that docs/formats.md lists" };

/// Rows of a measured file. An identification holds all of them in memory, about 2 kB each.
pub const MEASURED_ROWS: Bound = Bound {
    what: "rows of a measured file",
    most: 1_000_000,
    help: "keep every second row or fewer, or omit some of the runs: neighbouring rows hardly differ",
};

/// Joints of a robot description (URDF), and also its links. An arm has about a dozen of each.
pub const URDF_JOINTS: Bound = Bound {
    what: "joints, or links, of a robot description",
    most: 10_000,
    help: "give the description of the arm alone",
};

/// Size of a file that is held in memory as a whole, bytes: of cells, tables and meshes, and of programs that cannot be read
/// in parts.
pub const FILE_BYTES: Bound = Bound {
    what: "bytes of a file that is held as a whole",
    most: 2 << 30,
    help: "split the file, or check that it is the right one",
};

/// Rows of an array in a call from Python. The poses that such a call returns need 13 GB.
pub const ARRAY_ROWS: Bound =
    Bound { what: "rows of an array", most: 100_000_000, help: "call it with parts of the array" };

/// All bounds, in the order of the table in `docs/limits-and-safety.md`.
pub const ALL: [Bound; 11] = [
    STOCK_LINES, RUN_MOTIONS, STL_TRIANGLES, STL_REACH_MM, UNITS, FRAMES, COLUMNS, MEASURED_ROWS, URDF_JOINTS,
    FILE_BYTES, ARRAY_ROWS,
];

#[cfg(test)]
mod tests {
    use super::STOCK_LINES;

    #[test]
    fn a_count_that_is_no_number_is_beyond_every_bound() {
        assert_eq!(STOCK_LINES.exceeded(2e7), None);
        for count in [2e7 + 1.0, f64::INFINITY, f64::NAN] {
            assert!(STOCK_LINES.exceeded(count).is_some(), "{count}");
        }
    }
}

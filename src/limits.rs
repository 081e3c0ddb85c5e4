//! The bounds of what deflex reads and computes. Work is sized before memory is allocated: beyond a bound there is an error that says
//! what to change. This is their one list: code, messages and the table in `docs/limits-and-safety.md` take them from here.

/// A bound.
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
    /// The message for an input beyond the bound; `None` within it. A count that is not a number is beyond it.
    #[must_use]
    pub fn exceeded(&self, count: f64) -> Option<String> {
        let within = count <= self.most as f64;
        (!within).then(|| format!("{}: {count:.0} are more than the {} that deflex accepts", self.what, self.most))
    }
}

/// Lines through the blank: a simulation of as many takes a minute on two cores, and some 220 bytes a line.
pub const STOCK_LINES: Bound = Bound {
    what: "lines of the stock ([stock] resolution_mm over its box)",
    most: 20_000_000,
    help: "give a larger `resolution_mm`, or a smaller blank",
};

/// Motions that a RAPID program with loops runs through, where those that are alike are held once: a loop that never ends is
/// distinguished from a long one within minutes.
pub const RUN_MOTIONS: Bound = Bound {
    what: "motions that a RAPID program runs through in its loops",
    most: 20_000_000,
    help: "split the program, or bound its loops",
};

/// Triangles of a mesh: a file of 250 MB.
pub const STL_TRIANGLES: Bound =
    Bound { what: "triangles of an STL file", most: 5_000_000, help: "export the mesh with a coarser tolerance" };

/// How far a corner of a mesh may lie from the origin, mm: a hundred metres are more than any machine; single precision has steps
/// of a hundredth of a millimetre there.
pub const STL_REACH_MM: Bound = Bound {
    what: "coordinates of an STL file, mm",
    most: 100_000,
    help: "export the mesh in millimetres, near the origin of the stock's work object",
};

/// External axes that a program can move.
pub const EXTERNAL_AXES: usize = 6;

/// Units of a cell: a controller has six external axes, and each unit one of its own.
pub const UNITS: Bound = Bound {
    what: "units ([[unit]]) of a cell",
    most: EXTERNAL_AXES as u64,
    help: "each unit has an external axis of its own, eax_a to eax_f: remove the others",
};

/// Tools of a cell, and work objects too: more than any magazine holds.
pub const FRAMES: Bound = Bound {
    what: "tools, or work objects, of a cell",
    most: 10_000,
    help: "leave those that the programs of this cell use",
};

/// Columns of a measured file or of a table of forces.
pub const COLUMNS: Bound =
    Bound { what: "columns of a table", most: 10_000, help: "leave the columns that docs/formats.md lists" };

/// Rows of a measured file: an identification holds all of them in memory, some 2 kB each.
pub const MEASURED_ROWS: Bound = Bound {
    what: "rows of a measured file",
    most: 1_000_000,
    help: "thin the rows out, or leave some of the runs out: neighbouring rows say nearly the same",
};

/// Joints of a robot description, and links too: an arm has a dozen.
pub const URDF_JOINTS: Bound = Bound {
    what: "joints, or links, of a robot description",
    most: 10_000,
    help: "give the description of the arm alone",
};

/// A file that is held as a whole, bytes: cells, tables, meshes, and programs that cannot be read in parts.
pub const FILE_BYTES: Bound =
    Bound { what: "bytes of a file that is held as a whole", most: 2 << 30, help: "split the file, or name another" };

/// Rows of an array that Python hands over: 13 GB of poses come back for them.
pub const ARRAY_ROWS: Bound =
    Bound { what: "rows of an array", most: 100_000_000, help: "call it with parts of the array" };

/// All of them, in the order of the table.
pub const ALL: [Bound; 11] = [
    STOCK_LINES,
    RUN_MOTIONS,
    STL_TRIANGLES,
    STL_REACH_MM,
    UNITS,
    FRAMES,
    COLUMNS,
    MEASURED_ROWS,
    URDF_JOINTS,
    FILE_BYTES,
    ARRAY_ROWS,
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

//! The system that wrote the file, and the conventions that follow from it.

/// CAM systems that are distinguished, because their arcs, axes or frames differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Dialect {
    Nx,
    Makino,
    Catia,
    Creo,
    SolidWorks,
    CamWorks,
    Autodesk,
    #[default]
    Unknown,
}

/// Texts in the files of each system, the surest first.
const TRACES: [(&[u8], Dialect); 16] = [
    (b"APTCL-SPEC,MAKINO", Dialect::Makino),
    (b"CATIA APT VERSION", Dialect::Catia),
    (b"$$*CATIA0", Dialect::Catia),
    (b"PRO/CLFILE", Dialect::Creo),
    (b"$$-> ", Dialect::Creo),
    (b"REMARK -> ", Dialect::Creo),
    (b"OPFEATSTART", Dialect::CamWorks),
    (b"CSI_", Dialect::SolidWorks),
    (b"TRNTYP", Dialect::SolidWorks),
    (b"MOVARC", Dialect::Autodesk),
    (b"AUTODESK", Dialect::Autodesk),
    (b"TOOL PATH/", Dialect::Nx),
    (b"END-OF-PATH", Dialect::Nx),
    (b"TLDATA/", Dialect::Nx),
    (b"PAINT/", Dialect::Nx),
    (b"TLON,GOFWD/", Dialect::Catia),
];

/// Bytes of the head in which the texts are searched for.
const HEAD: usize = 16 * 1024;

impl Dialect {
    pub(super) fn detect(bytes: &[u8]) -> Self {
        let head = bytes[..bytes.len().min(HEAD)].to_ascii_uppercase();
        let found = |trace: &[u8]| memchr::memmem::find(&head, trace).is_some();
        TRACES.iter().find(|(trace, _)| found(trace)).map_or(Self::Unknown, |&(_, dialect)| dialect)
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Nx => "nx",
            Self::Makino => "makino",
            Self::Catia => "catia",
            Self::Creo => "creo",
            Self::SolidWorks => "solidworks",
            Self::CamWorks => "camworks",
            Self::Autodesk => "autodesk",
            Self::Unknown => "cl",
        }
    }

    /// Whether the axis of `CIRCLE` is for clockwise travel: in files of NX and MAKINO, and in any file with their eleven values (tolerances
    /// and cutter after the radius).
    pub(super) fn clockwise(self, values: usize) -> bool {
        matches!(self, Self::Nx | Self::Makino) || values >= 11
    }

    /// Whether the files of the system show that it prints the axis of `CIRCLE` in one sense only.
    pub(super) fn prints_circles_of_its_own(self) -> bool {
        matches!(self, Self::Nx | Self::Makino | Self::Creo | Self::SolidWorks | Self::CamWorks)
    }

    /// Whether positions are printed in the last frame (`MSYS`, CATIA matrix), and not in one frame for the file.
    pub(super) fn positions_follow_frame(self) -> bool {
        matches!(self, Self::Nx | Self::Catia)
    }
}

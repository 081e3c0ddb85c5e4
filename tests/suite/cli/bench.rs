//! A folder with a small program, its cell and its forces; and the binary in it.

use assert_cmd::Command;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Three cutting moves and an approach by joints.
pub(crate) const PROGRAM: &str = "\
MODULE Part
  PERS tooldata tMill:=[TRUE,[[0,0,310],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];
  PERS wobjdata wPart:=[FALSE,TRUE,\"\",[[1000,-400,700],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PROC main()
    MoveJ [[0,0,100],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v200,fine,tMill\\WObj:=wPart;
    MoveL [[0,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\\WObj:=wPart;
    MoveL [[50,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,z1,tMill\\WObj:=wPart;
    MoveL [[100,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\\WObj:=wPart;
  ENDPROC
ENDMODULE
";

pub(crate) const CL: &str = "\
UNITS/MM
FEDRAT/600,MMPM
RAPID
GOTO/0,0,100,0,0,1
GOTO/0,0,0,0,0,1
GOTO/50,0,0,0,0,1
GOTO/100,0,0,0,0,1
FINI
";

pub(crate) const CELL: &str = "\
[robot]
model = \"irb6660-205-1.9\"

[robot.stiffness]
joint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]

[controller]
compensates = []

[tools.tMill]
tcp_mm = [0, 0, 310]
tcp_quat = [1, 0, 0, 0]

[wobjs.wPart]
uframe_mm = [1000, -400, 700]
uframe_quat = [1, 0, 0, 0]

[cl]
tool = \"tMill\"
wobj = \"wPart\"
spin = \"fixed\"

[cut]
force = \"constant\"
force_n = [120, -260, 410]
frame = \"wobj\"
";

/// The same cell with a cutter and a stock, `keys` saying which: forces follow from what is met.
pub(crate) fn cell_with_stock(keys: &str) -> String {
    let rest = CELL.split("[cut]").next().unwrap_or_default();
    format!(
        "{rest}[cut]\nforce = \"mechanistic\"\n[cut.engagement]\nmode = \"stock\"\nfeed_per_tooth_mm = 0.05\n\
         [cut.coefficients]\nmaterial = \"al7075\"\n[tools.tMill.cutter]\ndiameter_mm = 20\ncorner_radius_mm = 2\n\
         teeth = 2\nhelix_deg = 30\n[stock]\n{keys}\n"
    )
}

pub(crate) struct Bench {
    folder: TempDir,
}

impl Bench {
    /// `part.mod`, `part.apt` and `cell.toml`.
    pub(crate) fn new() -> Self {
        let bench = Self { folder: TempDir::new().unwrap() };
        bench.write("part.mod", PROGRAM).write("part.apt", CL).write("cell.toml", CELL);
        bench
    }

    pub(crate) fn write(&self, name: &str, text: impl AsRef<[u8]>) -> &Self {
        std::fs::write(self.path(name), text).unwrap();
        self
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn read(&self, name: &str) -> String {
        String::from_utf8(std::fs::read(self.path(name)).unwrap()).unwrap()
    }

    /// The hash of a file, which the reports of what was made from it have.
    pub(crate) fn hash(&self, name: &str) -> String {
        deflex::report::Origin::of(name, &std::fs::read(self.path(name)).unwrap()).sha256
    }

    /// Names of everything in a folder, temporary files too.
    pub(crate) fn names(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(folder)).unwrap();
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// Runs `deflex` with arguments set apart by blanks.
    pub(crate) fn run(&self, arguments: &str) -> Ran {
        self.run_with(arguments, "")
    }

    pub(crate) fn run_with(&self, arguments: &str, stdin: &str) -> Ran {
        let output = deflex(self.folder.path()).args(arguments.split_whitespace()).write_stdin(stdin).output().unwrap();
        Ran {
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }
}

pub(crate) struct Ran {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Ran {
    #[track_caller]
    pub(crate) fn exits(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "stdout:\n{}\nstderr:\n{}", self.stdout, self.stderr);
        self
    }
}

pub(crate) fn deflex(folder: &Path) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("deflex"));
    command.current_dir(folder).env("NO_COLOR", "1").env("COLUMNS", "100");
    command
}

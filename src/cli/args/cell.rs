//! Commands on cells and robots, and on deflex itself.

use clap::{Args, Subcommand, ValueHint};
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(in crate::cli) struct Init {
    /// Built-in robot to start from
    #[arg(long, value_name = "MODEL", conflicts_with = "urdf")]
    pub(in crate::cli) robot: Option<String>,
    /// Robot description to take the kinematics from (xacro expanded)
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) urdf: Option<PathBuf>,
    /// Backup of an ABB controller: robot, base, axis limits, mechanical units, tools and work objects
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath, conflicts_with = "urdf")]
    pub(in crate::cli) backup: Option<PathBuf>,
    /// Last link of the description; without it `tool0`, `flange`, or the end of the only chain of six joints
    #[arg(long, value_name = "LINK", requires = "urdf")]
    pub(in crate::cli) tip: Option<String>,
    /// Show the built-in robots: all, or those of a maker or with a name such as "kr240"
    #[arg(long, value_name = "FILTER", num_args = 0..=1, default_missing_value = "")]
    pub(in crate::cli) list: Option<String>,
    /// Cell file to write; without it stdout
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) output: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("which").required(true).args(["joints", "target"]))]
pub(in crate::cli) struct Pose {
    /// Cell file
    #[arg(long, value_name = "CELL", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) cell: PathBuf,
    /// Axis angles, degrees: prints the TCP
    #[arg(long, value_name = "J1,…,J6", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    pub(in crate::cli) joints: Vec<f64>,
    /// TCP: prints all axis angles that reach it. x,y,z in mm, then q1,q2,q3,q4, or A,B,C in degrees (W,P,R for a FANUC)
    #[arg(long, value_name = "X,Y,Z,…", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    pub(in crate::cli) target: Vec<f64>,
    /// Where the cell's mechanical units stand: positions of eax_a, eax_b, … (mm, degrees); 0 without it
    #[arg(long, value_name = "E1,…", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    pub(in crate::cli) external: Vec<f64>,
    /// Tool of the cell; without it the flange
    #[arg(long, value_name = "NAME")]
    pub(in crate::cli) tool: Option<String>,
    /// Work object of the cell in which the pose of the TCP is given; without it the world
    #[arg(long, value_name = "NAME")]
    pub(in crate::cli) wobj: Option<String>,
    /// The answer as JSON; `-` or nothing for stdout
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) json: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(in crate::cli) struct Studio {
    /// Folder to show; no file outside of it is read or written
    #[arg(default_value = ".", value_hint = ValueHint::DirPath)]
    pub(in crate::cli) folder: PathBuf,
    /// Port on the loopback address; without it a free one
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(in crate::cli) port: Option<u16>,
    /// Print the address and start no browser
    #[arg(long)]
    pub(in crate::cli) no_browser: bool,
}

#[derive(Debug, Args)]
pub(in crate::cli) struct Generate {
    /// What to make
    #[command(subcommand)]
    pub(in crate::cli) what: Generated,
}

#[derive(Debug, Subcommand)]
pub(in crate::cli) enum Generated {
    /// Completions for a shell, on stdout
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Manual pages, one per command, into a folder
    Man {
        /// Folder to write to
        #[arg(value_hint = ValueHint::DirPath)]
        dir: PathBuf,
    },
}

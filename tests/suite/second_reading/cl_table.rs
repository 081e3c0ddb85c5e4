//! Constructs of CL/APT data with what the manuals say of them, a few statements each.
//!
//! A path is written as moves apart by `;`: position, then where it matters the tool axis, `r` for rapid travel, `f=` feed in
//! mm/s, `arc=` centre and turn in degrees about the tool axis (right hand).

/// What a file must come to.
#[derive(Clone, Copy, Debug)]
pub enum Expect {
    /// This path.
    Path(&'static str),
    /// Nothing is written.
    Refused,
    /// This path, or nothing.
    Either(&'static str),
    /// This path, and a word of these statements' lines.
    Listed(&'static str, &'static [u32]),
    /// Holes at x, y with mouth and bottom: each is drilled, and nothing travels sideways below its mouth; or nothing is written.
    Holes(&'static [[f64; 4]]),
}

use Expect::{Either, Holes, Listed, Path, Refused};

pub struct Cut {
    pub name: &'static str,
    /// Statements after `UNITS/MM` and `FEDRAT/600,MMPM`, which are lines 1 and 2.
    pub text: &'static str,
    pub expect: Expect,
}

const fn cut(name: &'static str, text: &'static str, expect: Expect) -> Cut {
    Cut { name, text, expect }
}

pub const CUTS: &[Cut] = &[
    cut("GOTO with three numbers", "GOTO/10,20,30\nGOTO/20,20,30", Path("10,20,30 0,0,1;20,20,30 0,0,1 f=10")),
    cut(
        "GOTO with six numbers",
        "GOTO/10,20,30,0,0.6,0.8\nGOTO/20,20,30,0,0,1",
        Path("10,20,30 0,0.6,0.8;20,20,30 0,0,1"),
    ),
    cut(
        "GOTO with nine numbers",
        "GOTO/10,20,30,0,0,1,0,0.6,0.8\nGOTO/20,20,30,0,0.6,0.8,0,0,1",
        Path("10,20,30 0,0,1;20,20,30 0,0.6,0.8"),
    ),
    cut("GOTO with nine numbers after MULTAX", "MULTAX/ON\nGOTO/10,20,30,0,0,1,1,0,0", Path("10,20,30 0,0,1")),
    cut("GOTO with nine numbers, continued", "GOTO/10,20,30,$\n0,0,1,$\n0,0.6,0.8", Path("10,20,30 0,0,1")),
    cut("GOTO with four numbers", "GOTO/10,20,30\nGOTO/10,20,30,40", Refused),
    cut("GOTO with seven numbers", "GOTO/10,20,30\nGOTO/10,20,30,0,0,1,5", Refused),
    cut("GOTO with two numbers", "GOTO/10,20,30\nGOTO/10,25", Either("10,20,30;10,25,30")),
    cut("GOTO to a name", "GOTO/10,20,30\nGOTO/P1", Refused),
    cut("GOTO with blanks", "GOTO / 10. , 20 , .5\n  GOTO/20,-.5,1.0E1", Path("10,20,0.5;20,-0.5,10")),
    cut("GOTO in lower case", "goto/10,20,30", Path("10,20,30")),
    cut("GOTO split within a number", "GOTO/10,20,3$\n0.25", Path("10,20,30.25")),
    cut("axis printed to four digits", "GOTO/10,20,30,0,0.5999,0.7999", Path("10,20,30 0,0.59993,0.80005")),
    cut("axis of no length", "GOTO/10,20,30\nGOTO/10,20,30,0,0,0", Refused),
    cut("TLAXIS", "TLAXIS/0,0.6,0.8\nGOTO/10,20,30", Path("10,20,30 0,0.6,0.8")),
    cut(
        "TLAXIS between",
        "GOTO/10,20,30,0,0,1\nTLAXIS/0,0.6,0.8\nGOTO/20,20,30",
        Path("10,20,30 0,0,1;20,20,30 0,0.6,0.8"),
    ),
    cut("MULTAX without a number", "MULTAX\nGOTO/10,20,30,0,0.6,0.8", Path("10,20,30 0,0.6,0.8")),
    cut(
        "NX's axis is modal",
        "TOOL PATH/A,TOOL,B\nGOTO/10,20,30,0,0.6,0.8\nGOTO/20,20,30",
        Path("10,20,30 0,0.6,0.8;20,20,30 0,0.6,0.8"),
    ),
    cut("FROM moves nothing", "FROM/0,0,50\nGOTO/10,20,30", Path("10,20,30")),
    cut("FROM with an axis", "FROM/0,0,50,0,0,1\nGOTO/10,20,30,0,0.6,0.8", Path("10,20,30 0,0.6,0.8")),
    cut("GODLTA", "GOTO/10,20,30\nGODLTA/1,2,-3\nGODLTA/0,0,3", Path("10,20,30;11,22,27;11,22,30")),
    cut("GODLTA along the axis", "GOTO/10,20,30,0,0.6,0.8\nGODLTA/5", Path("10,20,30 0,0.6,0.8;10,23,34 0,0.6,0.8")),
    cut("GODLTA after FROM", "FROM/0,0,50\nGODLTA/1,2,-3\nGOTO/10,20,30", Path("1,2,47;10,20,30")),
    cut("GODLTA from nowhere", "GODLTA/1,2,-3\nGOTO/10,20,30", Refused),
    cut(
        "GODLTA in rapid travel",
        "GOTO/10,20,30\nRAPID\nGODLTA/0,0,20\nGODLTA/1,0,0",
        Path("10,20,30;10,20,50 r;11,20,50 f=10"),
    ),
    cut(
        "GODLTA under a turned axis",
        "TLAXIS/0,0.6,0.8\nGOTO/10,20,30\nGODLTA/1,0,0",
        Path("10,20,30 0,0.6,0.8;11,20,30 0,0.6,0.8"),
    ),
    cut(
        "RAPID for one position",
        "GOTO/10,20,30\nRAPID\nGOTO/10,20,50\nGOTO/20,20,50",
        Path("10,20,30;10,20,50 r;20,20,50 f=10"),
    ),
    cut("RAPID twice", "RAPID\nRAPID\nGOTO/10,20,50\nGOTO/20,20,50", Path("10,20,50 r;20,20,50 f=10")),
    cut("RAPID at the end", "GOTO/10,20,50\nRAPID\nFINI", Path("10,20,50")),
    cut("RAPID does not reach beyond FROM", "RAPID\nGOTO/10,20,50\nGOTO/20,20,30", Path("10,20,50 r;20,20,30 f=10")),
    cut("GOHOME with a place", "GOTO/10,20,30\nGOHOME/0,0,100", Either("10,20,30;0,0,100")),
    cut("GOHOME", "GOTO/10,20,30\nGOHOME\nGOTO/20,20,30", Refused),
    cut("FEDRAT MMPM first", "FEDRAT/MMPM,300\nGOTO/10,20,30\nGOTO/20,20,30", Path("10,20,30;20,20,30 f=5")),
    cut("FEDRAT IPM", "FEDRAT/60,IPM\nGOTO/10,20,30\nGOTO/20,20,30", Path("10,20,30;20,20,30 f=25.4")),
    cut("FEDRAT IPS", "FEDRAT/1,IPS\nGOTO/10,20,30\nGOTO/20,20,30", Either("10,20,30;20,20,30 f=25.4")),
    cut("FEDRAT MMPS", "FEDRAT/12,MMPS\nGOTO/10,20,30\nGOTO/20,20,30", Either("10,20,30;20,20,30 f=12")),
    cut("FEDRAT FPM", "FEDRAT/3,FPM\nGOTO/10,20,30\nGOTO/20,20,30", Either("10,20,30;20,20,30 f=15.24")),
    cut("FEDRAT MPM", "FEDRAT/1.2,MPM\nGOTO/10,20,30\nGOTO/20,20,30", Either("10,20,30;20,20,30 f=20")),
    cut("FEDRAT INVERS", "FEDRAT/3,INVERS\nGOTO/10,20,30\nGOTO/20,20,30", Refused),
    cut("FEDRAT INVERSE", "FEDRAT/INVERSE,AUTO\nGOTO/10,20,30\nGOTO/20,20,30", Refused),
    cut("FEDRAT of an unknown unit", "FEDRAT/3,XPY\nGOTO/10,20,30\nGOTO/20,20,30", Refused),
    cut(
        "FEDRAT MMPR",
        "SPINDL/RPM,1200,CLW\nFEDRAT/0.5,MMPR\nGOTO/10,20,30\nGOTO/20,20,30",
        Path("10,20,30;20,20,30 f=10"),
    ),
    cut(
        "FEDRAT IPR",
        "SPINDL/600,RPM,CLW\nFEDRAT/0.1,IPR\nGOTO/10,20,30\nGOTO/20,20,30",
        Path("10,20,30;20,20,30 f=25.4"),
    ),
    cut(
        "FEDRAT PERREV",
        "SPINDL/1200\nFEDRAT/0.5,PERREV\nGOTO/10,20,30\nGOTO/20,20,30",
        Path("10,20,30;20,20,30 f=10"),
    ),
    cut(
        "FEDRAT per revolution, spindle later",
        "FEDRAT/0.5,MMPR\nSPINDL/1200,RPM,CLW\nGOTO/10,20,30\nGOTO/20,20,30",
        Path("10,20,30;20,20,30 f=10"),
    ),
    cut("FEDRAT per revolution without a spindle", "FEDRAT/0.5,MMPR\nGOTO/10,20,30\nGOTO/20,20,30", Refused),
    cut("FEDRAT without a unit", "FEDRAT/300\nGOTO/10,20,30\nGOTO/20,20,30", Path("10,20,30;20,20,30 f=5")),
    cut("FEDRAT PERMIN", "FEDRAT/300,PERMIN\nGOTO/10,20,30\nGOTO/20,20,30", Path("10,20,30;20,20,30 f=5")),
    cut("FEDRAT of nothing", "FEDRAT/0,MMPM\nGOTO/10,20,30\nGOTO/20,20,30", Refused),
    cut(
        "feed back after RAPID",
        "FEDRAT/300,MMPM\nGOTO/10,20,30\nRAPID\nGOTO/10,20,60\nGOTO/20,20,30",
        Path("10,20,30;10,20,60 r;20,20,30 f=5"),
    ),
    cut(
        "inches",
        "UNITS/INCHES\nFEDRAT/60,PERMIN\nGOTO/1,2,3\nGOTO/2,2,3",
        Path("25.4,50.8,76.2;50.8,50.8,76.2 f=25.4"),
    ),
    cut("inches from the middle on", "GOTO/10,20,30\nUNITS/INCHES\nGOTO/1,2,3", Either("10,20,30;25.4,50.8,76.2")),
    cut("MODE/INCR", "GOTO/10,20,30\nMODE/INCR\nGOTO/1,0,0\nGOTO/1,0,0", Either("10,20,30;11,20,30;12,20,30")),
    cut(
        "MODE/INCR and back",
        "GOTO/10,20,30\nMODE/INCR\nGOTO/1,0,0\nMODE/ABSOL\nGOTO/20,20,30",
        Either("10,20,30;11,20,30;20,20,30"),
    ),
    cut("MODE/ABSOL", "MODE/ABSOL\nGOTO/10,20,30", Path("10,20,30")),
    cut("SET/MODE,INCR", "GOTO/10,20,30\nSET/MODE,INCR\nGOTO/1,0,0", Either("10,20,30;11,20,30")),
    cut("SET/MODE,ABSOL", "SET/MODE,ABSOL\nGOTO/10,20,30", Path("10,20,30")),
    cut("CUTCOM/LEFT", "GOTO/10,20,30\nCUTCOM/LEFT\nGOTO/20,20,30\nCUTCOM/OFF\nGOTO/30,20,30", Refused),
    cut("CUTCOM/RIGHT with a register", "GOTO/10,20,30\nCUTCOM/RIGHT,5\nGOTO/20,20,30", Refused),
    cut("CUTCOM/ON", "GOTO/10,20,30\nCUTCOM/ON\nGOTO/20,20,30", Refused),
    cut("CUTCOM/ADJUST", "GOTO/10,20,30\nCUTCOM/ADJUST,3\nGOTO/20,20,30", Refused),
    cut("CUTCOM/ON in a plane", "GOTO/10,20,30\nCUTCOM/ON,LEFT,XYPLAN\nGOTO/20,20,30", Refused),
    cut("CUTCOM/OFF", "CUTCOM/OFF\nGOTO/10,20,30", Path("10,20,30")),
    cut("HEAD/2", "GOTO/10,20,30\nHEAD/2\nGOTO/20,20,30", Refused),
    cut("HEAD/1", "HEAD/1\nGOTO/10,20,30", Either("10,20,30")),
    cut("LOADTL once", "LOADTL/1\nGOTO/10,20,30", Path("10,20,30")),
    cut("LOADTL twice the same", "LOADTL/1\nGOTO/10,20,30\nLOADTL/1\nGOTO/20,20,30", Path("10,20,30;20,20,30")),
    cut("LOADTL of another tool", "LOADTL/1\nGOTO/10,20,30\nLOADTL/2\nGOTO/20,20,30", Refused),
    cut(
        "LOADTL with its length",
        "LOADTL/1,LENGTH,120,ADJUST,1\nGOTO/10,20,30\nLOADTL/2,LENGTH,80,ADJUST,2\nGOTO/20,20,30",
        Refused,
    ),
    cut("LOAD/TOOL of another tool", "LOAD/TOOL,1\nGOTO/10,20,30\nLOAD/TOOL,2,ADJUST,2\nGOTO/20,20,30", Refused),
    cut("TOOLNO of another tool", "TOOLNO/1,MILL\nGOTO/10,20,30\nTOOLNO/2,MILL\nGOTO/20,20,30", Refused),
    cut("TURRET of another tool", "TURRET/1\nGOTO/10,20,30\nTURRET/2\nGOTO/20,20,30", Refused),
    cut("another tool after the last position", "LOADTL/1\nGOTO/10,20,30\nLOADTL/2\nFINI", Either("10,20,30")),
    cut("CUTTER twice the same", "CUTTER/10,1\nGOTO/10,20,30\nCUTTER/10,1\nGOTO/20,20,30", Path("10,20,30;20,20,30")),
    cut("another CUTTER", "CUTTER/10\nGOTO/10,20,30\nCUTTER/25\nGOTO/20,20,30", Refused),
    cut("SELECT/TOOL ahead", "LOADTL/1\nSELECT/TOOL,2\nGOTO/10,20,30", Path("10,20,30")),
    cut(
        "SPINDL",
        "SPINDL/RPM,9000,CLW\nGOTO/10,20,30\nSPINDL/OFF\nGOTO/20,20,30",
        Listed("10,20,30;20,20,30", &[3, 5]),
    ),
    cut("COOLNT", "COOLNT/ON\nGOTO/10,20,30\nCOOLNT/OFF", Listed("10,20,30", &[3, 5])),
    cut("STOP", "GOTO/10,20,30\nSTOP\nGOTO/20,20,30", Listed("10,20,30;20,20,30", &[4])),
    cut("OPSTOP", "GOTO/10,20,30\nOPSTOP\nGOTO/20,20,30", Listed("10,20,30;20,20,30", &[4])),
    cut("DELAY", "GOTO/10,20,30\nDELAY/2\nGOTO/20,20,30", Listed("10,20,30;20,20,30", &[4])),
    cut(
        "DELAY in revolutions",
        "SPINDL/600\nGOTO/10,20,30\nDELAY/5,REV\nGOTO/20,20,30",
        Listed("10,20,30;20,20,30", &[5]),
    ),
    cut("AUXFUN", "GOTO/10,20,30\nAUXFUN/8\nGOTO/20,20,30", Listed("10,20,30;20,20,30", &[4])),
    cut("INSERT", "GOTO/10,20,30\nINSERT M08\nGOTO/20,20,30", Listed("10,20,30;20,20,30", &[4])),
    cut("CLAMP", "GOTO/10,20,30\nCLAMP/ON\nGOTO/20,20,30", Listed("10,20,30;20,20,30", &[4])),
    cut("RETRCT", "GOTO/10,20,30\nRETRCT\nGOTO/20,20,30", Refused),
    cut("RETRCT/TOOL", "GOTO/10,20,30\nRETRCT/TOOL\nGOTO/20,20,30", Refused),
    cut("RETRCT with an amount", "GOTO/10,20,30\nRETRCT/50\nGOTO/20,20,30", Either("10,20,30;10,20,80 r;20,20,30")),
    cut("GOCLER", "GOTO/10,20,30\nGOCLER\nGOTO/20,20,30", Refused),
    cut("GOCLER with a height", "GOTO/10,20,30\nGOCLER/60\nGOTO/20,20,30", Either("10,20,30;10,20,60 r;20,20,30")),
    cut("CALLSUB", "GOTO/10,20,30\nCALLSUB/5\nGOTO/20,20,30", Refused),
    cut("DEFSUB and CALLSUB", "GOTO/10,20,30\nDEFSUB/5\nGOTO/20,20,30\nENDSUB\nCALLSUB/5", Refused),
    cut("PROBE", "GOTO/10,20,30\nPROBE/ON\nGOTO/20,20,30\nPROBE/OFF", Refused),
    cut("THREAD", "GOTO/10,20,30\nTHREAD/TURN\nGOTO/20,20,30", Refused),
    cut("TRANS", "TRANS/0,0,100\nGOTO/10,20,30", Either("10,20,130")),
    cut("TRANS of nothing", "TRANS/0,0,0\nGOTO/10,20,30", Either("10,20,30")),
    cut("ORIGIN of nothing", "ORIGIN/0,0,0\nGOTO/10,20,30", Either("10,20,30")),
    cut("COPY", "INDEX/1\nGOTO/10,20,30\nCOPY/1,TRANSL,50,0,0,1", Either("10,20,30;60,20,30")),
    cut("ROTABL", "GOTO/10,20,30\nROTABL/90,BAXIS\nGOTO/20,20,30", Refused),
    cut("ROTABL of nothing", "ROTABL/0,BAXIS\nGOTO/20,20,30", Either("20,20,30")),
    cut("ROTHED", "GOTO/10,20,30\nROTHED/30,AAXIS\nGOTO/20,20,30", Refused),
    cut("NURBS", "GOTO/10,20,30\nNURBS/3,4\nKNOT/0,0,0,1,1,1\nCNTRL/10,20,30\nCNTRL/20,20,30", Refused),
    cut("PPRINT with a position in it", "PPRINT GOTO/1,2,3\nPPRINT/'GOTO/4,5,6'\nGOTO/10,20,30", Path("10,20,30")),
    cut("REMARK with a position in it", "REMARK GOTO/1,2,3\nGOTO/10,20,30", Path("10,20,30")),
    cut("comment with a position in it", "$$ GOTO/1,2,3\nGOTO/10,20,30 $$ GOTO/4,5,6", Path("10,20,30")),
    cut("comment after a continuation", "GOTO/10,$ the first\n20,30", Path("10,20,30")),
    cut("CLRSRF", "CLRSRF/0,0,1,50\nGOTO/10,20,30", Path("10,20,30")),
    cut("tolerances", "INTOL/0.01\nOUTTOL/0.01\nLINTOL/ON\nGOTO/10,20,30", Path("10,20,30")),
    cut("an unknown word with numbers", "GOTO/10,20,30\nFOOBAR/1,2,3\nGOTO/20,20,30", Refused),
    cut("APT source", "P1=POINT/1,2,3\nGOTO/P1\nGOFWD/L1,PAST,L2", Refused),
    cut("FINI with junk after it", "GOTO/10,20,30\nFINI\nGOTO/99,99,99", Either("10,20,30")),
    cut(
        "NX's arc is clockwise about its axis",
        "TOOL PATH/A,TOOL,B\nGOTO/20,20,30,0,0,1\nCIRCLE/20,30,30,0,0,1,10,0.06,0.5,10,0\nGOTO/10,30,30",
        Path("20,20,30;10,30,30 arc=20,30,30,-90"),
    ),
    cut(
        "NX's arc about an axis downwards",
        "TOOL PATH/A,TOOL,B\nGOTO/20,20,30,0,0,1\nCIRCLE/20,30,30,0,0,-1,10,0.06,0.5,10,0\nGOTO/30,30,30",
        Path("20,20,30;30,30,30 arc=20,30,30,90"),
    ),
    cut(
        "NX's arc of three quarters",
        "TOOL PATH/A,TOOL,B\nGOTO/20,20,30,0,0,1\nCIRCLE/20,30,30,0,0,1,10,0.06,0.5,10,0\nGOTO/30,30,30",
        Path("20,20,30;30,30,30 arc=20,30,30,-270"),
    ),
    cut(
        "Creo's arc is right-handed",
        "$$-> MFGNO / X\nGOTO/20,20,30\nCIRCLE/20,30,30,0,0,1,10\nGOTO/30,30,30",
        Path("20,20,30;30,30,30 arc=20,30,30,90"),
    ),
    cut(
        "Creo's arc with points on its way",
        "$$-> MFGNO / X\nGOTO/20,20,30\nCIRCLE/20,30,30,0,0,1,10\nGOTO/30,30,30,20,40,30",
        Either("20,20,30;20,40,30 arc=20,30,30,180"),
    ),
    cut(
        "sense that the points contradict",
        "$$-> MFGNO / X\nGOTO/20,20,30\nCIRCLE/20,30,30,0,0,1,10\nGOTO/12.9289,22.9289,30\nGOTO/10,30,30",
        Either("20,20,30;10,30,30 arc=20,30,30,-90"),
    ),
    cut(
        "whole circle",
        "TOOL PATH/A,TOOL,B\nGOTO/20,20,30,0,0,1\nCIRCLE/20,30,30,0,0,-1,10,0.06,0.5,10,0\nGOTO/20,20,30",
        Either("20,20,30;20,20,30 arc=20,30,30,360"),
    ),
    cut(
        "CIRCLE and GODLTA",
        "TOOL PATH/A,TOOL,B\nGOTO/20,20,30,0,0,1\nCIRCLE/20,30,30,0,0,-1,10,0.06,0.5,10,0\nGODLTA/10,10,0",
        Either("20,20,30;30,30,30 arc=20,30,30,90"),
    ),
    cut(
        "CIRCLE with an end off it",
        "TOOL PATH/A,TOOL,B\nGOTO/20,20,30,0,0,1\nCIRCLE/20,30,30,0,0,-1,10,0.06,0.5,10,0\nGOTO/35,30,30",
        Refused,
    ),
    cut(
        "CIRCLE with a start off it",
        "TOOL PATH/A,TOOL,B\nGOTO/15,20,30,0,0,1\nCIRCLE/20,30,30,0,0,-1,10,0.06,0.5,10,0\nGOTO/30,30,30",
        Refused,
    ),
    cut(
        "CIRCLE without an end",
        "TOOL PATH/A,TOOL,B\nGOTO/20,20,30,0,0,1\nCIRCLE/20,30,30,0,0,-1,10,0.06,0.5,10,0\nFINI",
        Refused,
    ),
    cut(
        "CIRCLE from nowhere",
        "TOOL PATH/A,TOOL,B\nCIRCLE/20,30,30,0,0,-1,10,0.06,0.5,10,0\nGOTO/30,30,30,0,0,1",
        Refused,
    ),
    cut(
        "MOVARC",
        "GOTO/20,20,30\nMOVARC/20,30,30,0,0,1,10,ANGLE,90\nGOTO/30,30,30",
        Path("20,20,30;30,30,30 arc=20,30,30,90"),
    ),
    cut(
        "CATIA's arc",
        "GOTO/20,20,30\nAUTOPS\nINDIRV/1,0,0\nTLON,GOFWD/(CIRCLE/20,30,30,$\n10),ON,(LINE/20,30,30,30,30,30)",
        Path("20,20,30;30,30,30 arc=20,30,30,90"),
    ),
    cut(
        "CATIA's arc the other way",
        "GOTO/20,20,30\nAUTOPS\nINDIRV/-1,0,0\nTLON,GOFWD/(CIRCLE/20,30,30,$\n10),ON,(LINE/20,30,30,10,30,30)",
        Path("20,20,30;10,30,30 arc=20,30,30,-90"),
    ),
    cut(
        "CYCLE/DRILL",
        "GOTO/10,20,50\nCYCLE/DRILL,DEPTH,10,MMPM,100,CLEAR,3\nGOTO/10,20,30\nGOTO/30,20,30\nCYCLE/OFF\nGOTO/10,20,50",
        Holes(&[[10.0, 20.0, 30.0, 20.0], [30.0, 20.0, 30.0, 20.0]]),
    ),
    cut(
        "CYCLE/DRILL by position",
        "GOTO/10,20,50\nCYCLE/DRILL,10,100,MMPM,3\nGOTO/10,20,30\nGOTO/30,20,30\nCYCLE/OFF\nGOTO/10,20,50",
        Holes(&[[10.0, 20.0, 30.0, 20.0], [30.0, 20.0, 30.0, 20.0]]),
    ),
    cut(
        "CYCLE of Creo",
        "GOTO/10,20,50\nCYCLE / DRILL, DEPTH, 10.000000, MMPM, 100.000000, CLEAR, 3.000000\nGOTO/10,20,30\nGOTO/30,20,30\nCYCLE/OFF\nGOTO/10,20,50",
        Holes(&[[10.0, 20.0, 30.0, 20.0], [30.0, 20.0, 30.0, 20.0]]),
    ),
    cut(
        "CYCLE of NX",
        "TOOL PATH/A,TOOL,B\nGOTO/10,20,50,0,0,1\nCYCLE/DRILL,RAPTO,3.0,FEDTO,-10.0,RTRCTO,20.0,MMPM,100.0\nGOTO/10,20,30\nGOTO/30,20,30\nCYCLE/OFF\nGOTO/10,20,50",
        Holes(&[[10.0, 20.0, 30.0, 20.0], [30.0, 20.0, 30.0, 20.0]]),
    ),
    cut(
        "CYCLE/DEEP",
        "GOTO/10,20,50\nCYCLE/DEEP,DEPTH,10,STEP,4,MMPM,100,CLEAR,3\nGOTO/10,20,30\nCYCLE/OFF\nGOTO/10,20,50",
        Holes(&[[10.0, 20.0, 30.0, 20.0]]),
    ),
    cut(
        "CYCLE/BORE with a dwell",
        "GOTO/10,20,50\nCYCLE/BORE,DEPTH,10,MMPM,100,CLEAR,3,DWELL,1\nGOTO/10,20,30\nCYCLE/OFF\nGOTO/10,20,50",
        Holes(&[[10.0, 20.0, 30.0, 20.0]]),
    ),
    cut(
        "CYCLE/TAP",
        "SPINDL/300,RPM,CLW\nGOTO/10,20,50\nCYCLE/TAP,DEPTH,10,MMPM,100,CLEAR,3\nGOTO/10,20,30\nCYCLE/OFF\nGOTO/10,20,50",
        Refused,
    ),
    cut(
        "CYCLE of an unknown kind",
        "GOTO/10,20,50\nCYCLE/SPECIAL,3,4\nGOTO/10,20,30\nCYCLE/OFF\nGOTO/10,20,50",
        Refused,
    ),
    cut("CYCLE/OFF alone", "CYCLE/OFF\nGOTO/10,20,30", Path("10,20,30")),
    cut(
        "CYCLE/ON again",
        "GOTO/10,20,50\nCYCLE/DRILL,DEPTH,10,MMPM,100,CLEAR,3\nGOTO/10,20,30\nCYCLE/OFF\nGOTO/30,20,50\nCYCLE/ON\nGOTO/30,20,30\nCYCLE/OFF\nGOTO/10,20,50",
        Holes(&[[10.0, 20.0, 30.0, 20.0], [30.0, 20.0, 30.0, 20.0]]),
    ),
    cut(
        "RAPID before a cycle's hole",
        "GOTO/10,20,50\nCYCLE/DRILL,DEPTH,10,MMPM,100,CLEAR,3\nRAPID\nGOTO/10,20,30\nCYCLE/OFF\nGOTO/10,20,50",
        Holes(&[[10.0, 20.0, 30.0, 20.0]]),
    ),
    cut(
        "GODLTA in a cycle",
        "GOTO/10,20,50\nCYCLE/DRILL,DEPTH,10,MMPM,100,CLEAR,3\nGOTO/10,20,30\nGODLTA/20,0,0\nCYCLE/OFF\nGOTO/10,20,50",
        Holes(&[[10.0, 20.0, 30.0, 20.0], [30.0, 20.0, 30.0, 20.0]]),
    ),
];

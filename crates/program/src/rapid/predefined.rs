//! The list of what RAPID's predefined instructions and functions may change, as far as it decides where the tool goes.
//!
//! Source: ABB, *Technical reference manual: RAPID Instructions, Functions and Data types* (3HAC050917-001), each name's own
//! page: its arguments (which of them are `VAR`, `PERS` or `INOUT`) and its effect on frames and displacement. An unlisted
//! name may change anything. `docs/soundness.md` repeats these lists.

use super::lasting::Lasting;

impl Instruction {
    /// The state that it leaves in force.
    pub(super) fn lasting(self) -> Option<Lasting> {
        Some(match self {
            Self::DisplacementOn | Self::DisplacementOff => Lasting::Displacement,
            Self::AxisOffsetSet | Self::AxisOffsetOn | Self::AxisOffsetOff => Lasting::AxisOffset,
            Self::UnitOn | Self::UnitOff => Lasting::Units,
            Self::SoftOn | Self::SoftOff => Lasting::Softness,
            Self::Velocity => Lasting::Speed,
            Self::ArcMode => Lasting::Arcs,
            Self::Configuration => Lasting::Configuration,
            _ => return None,
        })
    }
}

/// What an instruction may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Instruction {
    /// Neither data nor frames.
    Nothing,
    /// The data in its arguments, and no other.
    Arguments,
    /// The data that its optional arguments name (`\\TimeFlag`), and no other.
    Options,
    /// The same, after its condition holds: if it does not hold yet, something else changes the data that it names.
    Waits,
    /// Its first argument, by a number: `Incr`, `Decr`, `Add`, `Clear`.
    Steps,
    /// Switches program displacement on.
    DisplacementOn,
    /// Switches it off.
    DisplacementOff,
    /// Lets axes yield to forces.
    SoftOn,
    /// Makes them stiff again.
    SoftOff,
    /// States the load that the robot grips.
    Load,
    /// Changes the programmed speeds.
    Velocity,
    /// States how the tool turns on arcs.
    ArcMode,
    /// States whether joint motions go to the programmed configuration.
    Configuration,
    /// Sets the offset of external axes.
    AxisOffsetSet,
    /// Sets it from the present positions.
    AxisOffsetOn,
    /// Switches it off.
    AxisOffsetOff,
    /// Activates a mechanical unit.
    UnitOn,
    /// Deactivates a mechanical unit, which then keeps its position.
    UnitOff,
    /// Moves external axes only.
    MovesAxes,
    /// Data named by a string.
    DataByName,
    /// Moves, but to no robtarget that the program states.
    Moves,
    /// Forgets the motions that have not ended: the robot stands somewhere on its way.
    ClearsPath,
    /// Ends the cycle.
    Ends,
    /// Raises an error.
    Raises,
}

impl Instruction {
    /// Whether it may raise an error: the manual names none for the instructions that switch displacement.
    pub(super) fn may_fail(self) -> bool {
        !matches!(
            self,
            Self::DisplacementOn
                | Self::DisplacementOff
                | Self::SoftOn
                | Self::SoftOff
                | Self::Load
                | Self::Velocity
                | Self::ArcMode
                | Self::Configuration
                | Self::AxisOffsetSet
                | Self::AxisOffsetOn
                | Self::AxisOffsetOff
                | Self::Ends
        )
    }
}

/// Instructions that change neither data nor frames.
pub(super) const NOTHING: &[&str] = &[
    "AccSet", "ActEventBuffer", "AliasIOReset", "Break", "CamFlush", "CamRequestImage", "CamSetProgramMode",
    "CheckProgRef", "ClearIOBuff", "Close", "CloseDir", "ConfL", "CopyFile", "CornerPathWarning", "CorrClear",
    "CorrDiscon", "CorrWrite", "DeactEventBuffer", "DitherAct", "DitherDeact", "EGMReset", "EraseModule", "ErrLog",
    "ErrWrite", "HollowWristReset", "IDelete", "IDisable", "IEnable", "InvertDO", "IODisable", "IOEnable", "ISleep",
    "IWatch", "Load", "MakeDir", "MechUnitLoad", "MotionProcessModeSet", "MotionSup", "PathAccLim", "PathLengthReset",
    "PathLengthStart", "PathLengthStop", "PathRecStart", "PathRecStop", "PathResol", "PulseDO", "RemoveDir",
    "RemoveFile", "RenameFile", "Reset", "ResetPPMoved", "ResetRetryCount", "RestoPath", "Rewind", "RMQEmptyQueue",
    "Save", "SCWrite", "Set", "SetAO", "SetDO", "SetGO", "SetSysData", "SiConnect", "SingArea", "SkipWarn",
    "SocketBind", "SocketClose", "SocketConnect", "SocketListen", "SocketSend", "SocketSendTo", "SpeedLimAxis",
    "SpeedLimCheckPoint", "SpyStart", "SpyStop", "StartMove", "StartMoveRetry", "Stop", "StopMove", "StopMoveReset",
    "StorePath", "SyncMoveOff", "SyncMoveOn", "SyncMoveResume", "SyncMoveSuspend", "SyncMoveUndo", "SystemStopAction",
    "TestSignDefine", "TestSignReset", "TextTabInstall", "TPErase", "TPShow", "TPWrite", "TuneReset", "TuneServo",
    "UIMsgWrite", "UIShow", "UnLoad", "WaitRob", "WaitSyncTask", "WaitTime", "WorldAccLim", "Write", "WriteAnyBin",
    "WriteBin", "WriteBlock", "WriteStrBin", "WriteVar", "WriteVarArr", "WZDisable", "WZEnable",
];

/// Instructions that change data in their arguments, and no other data.
pub(super) const ARGUMENTS: &[&str] = &[
    "AliasIO", "BitClear", "BitSet", "BookErrNo", "CamGetResult", "CancelLoad", "ClearRawBytes", "ClkReset",
    "ClkStart", "ClkStop", "CopyRawBytes", "CorrCon", "EGMGetId", "FitCircle", "GetDataVal", "GetJointData",
    "GetSysData", "GetTrapData", "ICap", "IError", "IPers", "IRMQMessage", "ISignalAI", "ISignalAO", "ISignalDI",
    "ISignalDO", "ISignalGI", "ISignalGO", "ITimer", "IVarValue", "LoadId", "MToolRotCalib", "MToolTCPCalib", "Open",
    "OpenDir", "PackDNHeader", "PackRawBytes", "ReadAnyBin", "ReadBlock", "ReadCfgData", "ReadErrData", "ReadRawBytes",
    "ReadVarArr", "RMQFindSlot", "RMQGetMessage", "RMQGetMsgData", "RMQGetMsgHeader", "RMQReadWait", "RMQSendMessage",
    "RMQSendWait", "SetDataSearch", "SocketAccept", "SocketCreate", "SocketReceive", "SocketReceiveFrom", "StartLoad",
    "SToolRotCalib", "SToolTCPCalib", "TPReadDnum", "TPReadFK", "TPReadNum", "TriggCheckIO", "TriggDataCopy",
    "TriggDataReset", "TriggEquip", "TriggInt", "TriggIO", "TriggRampAO", "TriggSpeed", "TriggStopProc", "TryInt",
    "UnpackRawBytes", "WaitLoad", "WaitTestAndSet", "WriteRawBytes", "WZBoxDef", "WZCylDef", "WZDOSet", "WZFree",
    "WZHomeJointDef", "WZLimJointDef", "WZLimSup", "WZSphDef",
];

/// Instructions that change data in optional arguments, and no other data.
pub(super) const OPTIONS: &[&str] = &["UIMsgBox", "WaitAI", "WaitAO", "WaitDI", "WaitDO", "WaitGI", "WaitGO"];

/// Instructions of these lists that show their arguments to people, and give them to nothing else. What `Write` and the like write can be read
/// by programs and other machines.
pub(super) const SHOWING: &[&str] = &["ErrLog", "ErrWrite", "TPWrite", "UIMsgBox", "UIMsgWrite"];

/// Instructions with an effect of their own.
const OWN: &[(&str, Instruction)] = &[
    ("ActUnit", Instruction::UnitOn),
    ("Add", Instruction::Steps),
    ("CirPathMode", Instruction::ArcMode),
    ("Clear", Instruction::Steps),
    ("ClearPath", Instruction::ClearsPath),
    ("ConfJ", Instruction::Configuration),
    ("DeactUnit", Instruction::UnitOff),
    ("Decr", Instruction::Steps),
    ("EOffsOff", Instruction::AxisOffsetOff),
    ("EOffsOn", Instruction::AxisOffsetOn),
    ("EOffsSet", Instruction::AxisOffsetSet),
    ("ErrRaise", Instruction::Raises),
    ("ExitCycle", Instruction::Ends),
    ("GripLoad", Instruction::Load),
    ("Incr", Instruction::Steps),
    ("MoveExtJ", Instruction::MovesAxes),
    ("PathRecMoveBwd", Instruction::Moves),
    ("PathRecMoveFwd", Instruction::Moves),
    ("PDispOff", Instruction::DisplacementOff),
    ("PDispOn", Instruction::DisplacementOn),
    ("PDispSet", Instruction::DisplacementOn),
    ("RaiseToUser", Instruction::Raises),
    ("SetAllDataVal", Instruction::DataByName),
    ("SetDataVal", Instruction::DataByName),
    ("SoftAct", Instruction::SoftOn),
    ("SoftDeact", Instruction::SoftOff),
    ("SpeedRefresh", Instruction::Velocity),
    ("VelSet", Instruction::Velocity),
    ("WaitUntil", Instruction::Waits),
];

/// Functions that change nothing.
pub(super) const FUNCTIONS: &[&str] = &[
    "Abs", "AbsDnum", "ACos", "AInput", "AOutput", "ArgName", "ASin", "ATan", "ATan2", "BitAnd", "BitAndDnum",
    "BitCheck", "BitCheckDnum", "BitLSh", "BitLShDnum", "BitNeg", "BitNegDnum", "BitOr", "BitOrDnum", "BitRSh",
    "BitRShDnum", "BitXOr", "BitXOrDnum", "ByteToStr", "CalcJointT", "CalcRobT", "CalcRotAxFrameZ", "CalcRotAxisFrame",
    "CDate", "CJointT", "ClkRead", "CorrRead", "Cos", "CPos", "CRobT", "CrossProd", "CSpeedOverride", "CTime", "CTool",
    "CWObj", "DecToHex", "DefAccFrame", "DefDFrame", "DefFrame", "Dim", "DInput", "Distance", "DnumToNum", "DnumToStr",
    "DotProd", "DOutput", "EulerZYX", "EventType", "ExecHandler", "ExecLevel", "Exp", "FileSize", "FileTime",
    "FileTimeDnum", "FSSize", "GetMecUnitName", "GetMotorTorque", "GetServiceInfo", "GetSignalOrigin", "GetSysInfo",
    "GetTaskName", "GetTime", "GInput", "GInputDnum", "GOutput", "GOutputDnum", "HexToDec", "IndInpos", "IndSpeed",
    "IOUnitState", "IsFile", "IsMechUnitActive", "IsPers", "IsStopMoveAct", "IsStopStateEvent", "IsSyncMoveOn",
    "IsSysId", "IsVar", "Max", "MaxRobReach", "MaxRobSpeed", "Min", "MirPos", "ModExist", "ModTime", "ModTimeDnum",
    "MotionPlannerNo", "NonMotionMode", "NOrient", "NumToDnum", "NumToStr", "Offs", "OpMode", "OrientZYX", "ORobT",
    "ParIdPosValid", "ParIdRobValid", "PathLengthGet", "PathLevel", "PathRecValidBwd", "PathRecValidFwd", "PFRestart",
    "PoseInv", "PoseMult", "PoseVect", "Pow", "PowDnum", "PPMovedInManMode", "Present", "ProgMemFree", "RawBytesLen",
    "ReadBin", "ReadMotor", "ReadNum", "ReadStr", "ReadStrBin", "ReadVar", "RelTool", "RemainingRetries", "RobName",
    "RobOS", "Round", "RoundDnum", "RunMode", "Sin", "SocketGetStatus", "SocketPeek", "Sqrt", "SqrtDnum", "StrDigCalc",
    "StrDigCmp", "StrFind", "StrLen", "StrMap", "StrMatch", "StrMemb", "StrOrder", "StrPart", "StrToByte", "Tan",
    "TaskIsActive", "TaskIsExecuting", "TaskRunMec", "TaskRunRob", "TasksInSync", "TestDI", "TestSignRead", "TextGet",
    "TextTabFreeToUse", "TextTabGet", "TriggDataValid", "Trunc", "TruncDnum", "Type", "UIClientExist", "ValidIO",
    "ValToStr", "VectMagn",
];

/// The functions among these that raise no error, whatever their arguments.
pub(super) const NEVER_FAILING: &[&str] = &[
    "Abs", "AbsDnum", "ACos", "ASin", "ATan", "ATan2", "CDate", "CJointT", "ClkRead", "Cos", "CPos", "CRobT",
    "CrossProd", "CTime", "CTool", "CWObj", "Dim", "Distance", "DotProd", "EulerZYX", "Exp", "GetTime", "Max", "Min",
    "NOrient", "Offs", "OpMode", "OrientZYX", "PoseInv", "PoseMult", "PoseVect", "Present", "RelTool", "RobOS",
    "Round", "RoundDnum", "RunMode", "Sin", "StrLen", "Tan", "Trunc", "TruncDnum", "VectMagn",
];

/// Functions that also write to an argument, and change nothing else.
pub(super) const WRITING_FUNCTIONS: &[&str] = &[
    "GetNextMechUnit", "GetNextSym", "ReadDir", "StrToVal", "TestAndSet", "UIAlphaEntry", "UIDnumEntry", "UIDnumTune",
    "UIListView", "UIMessageBox", "UINumEntry", "UINumTune",
];

/// Whether a list, sorted without regard to case, contains a name.
fn has(sorted: &[&str], name: &[u8]) -> bool {
    sorted.binary_search_by(|known| order(known.as_bytes(), name)).is_ok()
}

fn order(a: &[u8], b: &[u8]) -> std::cmp::Ordering {
    let lower = u8::to_ascii_lowercase;
    a.iter().map(lower).cmp(b.iter().map(lower))
}

/// What a predefined instruction may change; `None` for an unknown name.
pub(super) fn instruction(name: &[u8]) -> Option<Instruction> {
    if has(NOTHING, name) {
        return Some(Instruction::Nothing);
    }
    if has(ARGUMENTS, name) {
        return Some(Instruction::Arguments);
    }
    if has(OPTIONS, name) {
        return Some(Instruction::Options);
    }
    OWN.iter().find(|(own, _)| own.as_bytes().eq_ignore_ascii_case(name)).map(|own| own.1)
}

/// Whether an instruction only shows its arguments.
pub(super) fn shows(name: &[u8]) -> bool {
    has(SHOWING, name)
}

/// Whether a statement is an instruction that changes nothing.
pub(super) fn harmless(statement: &[u8]) -> bool {
    let name = &statement[..statement.iter().position(|b| !b.is_ascii_alphanumeric()).unwrap_or(statement.len())];
    // A unit is active until it is deactivated, so activating it again changes nothing.
    match instruction(name) {
        Some(Instruction::Nothing | Instruction::UnitOn) => true,
        Some(Instruction::Options | Instruction::Waits) => !statement.contains(&b'\\'),
        _ => false,
    }
}

/// What a predefined function may change in addition to its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Function {
    Nothing,
    Arguments,
}

/// What a predefined function may change; `None` for an unknown name.
pub(super) fn function(name: &[u8]) -> Option<Function> {
    if has(FUNCTIONS, name) {
        Some(Function::Nothing)
    } else {
        has(WRITING_FUNCTIONS, name).then_some(Function::Arguments)
    }
}

/// Whether a function never raises an error.
pub(super) fn never_fails(name: &[u8]) -> bool {
    has(NEVER_FAILING, name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_sorted_and_found_whatever_the_case() {
        for list in [NOTHING, ARGUMENTS, OPTIONS, SHOWING, FUNCTIONS, NEVER_FAILING, WRITING_FUNCTIONS] {
            let wrong = list.windows(2).find(|pair| order(pair[0].as_bytes(), pair[1].as_bytes()).is_ge());
            assert_eq!(wrong, None);
        }
        assert_eq!(instruction(b"TPWRITE"), Some(Instruction::Nothing));
        assert_eq!(instruction(b"pdispon"), Some(Instruction::DisplacementOn));
        assert_eq!(instruction(b"SpindleOn"), None);
        assert_eq!(function(b"OFFS"), Some(Function::Nothing));
        assert_eq!(function(b"strtoval"), Some(Function::Arguments));
        assert_eq!(function(b"Probe"), None);
    }

    /// The page of the docs names what this file does.
    #[test]
    fn the_page_on_soundness_has_the_same_lists() {
        let page = include_str!("../../../../docs/soundness.md");
        for (title, list) in [
            ("Instructions that change nothing", NOTHING),
            ("Instructions that change only what they are given", ARGUMENTS),
            ("Instructions that change only what their optional arguments name", OPTIONS),
            ("Instructions that only show what they are given", SHOWING),
            ("Functions that change nothing", FUNCTIONS),
            ("Functions that never fail", NEVER_FAILING),
            ("Functions that change only what they are given", WRITING_FUNCTIONS),
        ] {
            let section = page.split(&format!("### {title}\n")).nth(1).unwrap_or_else(|| panic!("no section {title}"));
            let section = section.split("\n#").next().unwrap();
            let names: Vec<&str> = section.split('`').skip(1).step_by(2).collect();
            assert_eq!(names, list, "{title}");
        }
        for (name, _) in OWN {
            assert!(page.contains(&format!("`{name}`")), "{name}");
        }
    }
}

//! Modules, routines, statements and expressions as parsed.

use std::rc::Rc;

#[derive(Clone, Debug)]
pub enum Expr {
    Num(f64),
    Str(String),
    Bool(bool),
    Data(Data),
    Call(String, Vec<Arg>),
    Aggregate(Vec<Expr>),
    Unary(&'static str, Box<Expr>),
    Binary(&'static str, Box<Expr>, Box<Expr>),
}

/// Data, an element or a component of it.
#[derive(Clone, Debug)]
pub struct Data {
    pub name: String,
    pub steps: Vec<Part>,
}

#[derive(Clone, Debug)]
pub enum Part {
    Element(Vec<Expr>),
    Component(String),
}

#[derive(Clone, Debug)]
pub struct Arg {
    /// Optional argument's name; a required one has none.
    pub option: Option<String>,
    /// A switch has none.
    pub value: Option<Expr>,
    /// `\Name?parameter`: given where the parameter is.
    pub conditional: bool,
}

pub type Block = Rc<Vec<Stmt>>;

#[derive(Debug)]
pub struct Stmt {
    pub line: u32,
    pub kind: Kind,
}

#[derive(Debug)]
pub enum Kind {
    Assign(Data, Expr),
    Call(String, Vec<Arg>),
    Late(Expr, Vec<Arg>),
    If(Vec<(Expr, Block)>, Block),
    For { name: String, from: Expr, to: Expr, step: Option<Expr>, body: Block },
    While(Expr, Block),
    Test(Expr, Vec<(Vec<Expr>, Block)>, Block),
    Label(String),
    Goto(String),
    Return(Option<Expr>),
    Raise(Option<Expr>),
    Retry,
    TryNext,
    Exit,
    Connect(Data, String),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    Const,
    Var,
    Pers,
}

#[derive(Debug)]
pub struct Declaration {
    pub local: bool,
    pub storage: Storage,
    pub ty: String,
    pub name: String,
    pub dims: Vec<Expr>,
    pub value: Option<Expr>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    In,
    Reference,
    Switch,
}

#[derive(Debug)]
pub struct Parameter {
    pub name: String,
    pub ty: String,
    pub mode: Mode,
    pub optional: bool,
}

#[derive(Debug)]
pub struct Routine {
    pub name: String,
    pub local: bool,
    /// Of a function's value; a procedure or trap has none.
    pub ty: Option<String>,
    pub parameters: Vec<Parameter>,
    pub data: Vec<Declaration>,
    pub body: Block,
    pub handler: Option<(Vec<Expr>, Block)>,
}

#[derive(Debug, Default)]
pub struct Module {
    pub name: String,
    pub data: Vec<Declaration>,
    pub routines: Vec<Rc<Routine>>,
    /// RECORD name, components as (name, type).
    pub records: Vec<(String, Vec<(String, String)>)>,
}

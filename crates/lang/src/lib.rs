//! Reads robot programs and says which numbers of the text decide where each motion goes, in every run.
//!
//! A front end ([`urscript`], [`inform`], [`tp`]) turns text into one intermediate representation ([`ir`]), every node with its span. One
//! abstract run ([`run`]) follows it with values that are known, with the literal tokens that they come from and how, or unknown,
//! with a reason ([`value`]). What a branch, a loop or a routine that is not given could change is unknown afterwards, so that what is
//! known holds in every run that a controller could make. A language's own semantics are its [`Dialect`](dialect::Dialect).
//!
//! ```
//! let text = b"def part():\n  movel(p[0.5, 0.1, 0.2, 0, 3.14, 0], a=1.2, v=0.025)\nend\n";
//! let program = deflex_lang::urscript::read(&[text], 1).unwrap();
//! let outcome = deflex_lang::run::run(&program, &deflex_lang::urscript::UrScript).unwrap();
//! assert_eq!(outcome.motions.len(), 1);
//! // The x coordinate is the token at these bytes, as it is written.
//! let x = outcome.motions[0].to.pose().unwrap().affine(0).unwrap();
//! assert_eq!(&text[program.tokens[x.token.0 as usize].span.range()], b"0.5");
//! ```

mod cursor;
pub mod dialect;
pub mod flow;
pub mod inform;
pub mod ir;
mod lexeme;
mod reason;
pub mod run;
pub mod shared;
mod span;
mod store;
pub mod tp;
pub mod urscript;
pub mod value;
#[doc(hidden)]
pub mod walk;

pub use reason::Reason;
pub use span::Span;

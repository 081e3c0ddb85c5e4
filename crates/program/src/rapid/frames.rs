//! Tools and work objects that modules declare, whether a program uses them or not.

use super::eval::Scope;
use super::runner::Runner;
use super::symbols::Content;
use crate::{Tool, Wobj, intern};
use deflex_text::{Source, decode};
use std::sync::Arc;

/// Tooldata and wobjdata of modules, each read by itself, in their order; a name that comes again is left out, and so is what
/// is not of numbers. Modules that cannot be read have none.
#[must_use]
#[doc(hidden)]
pub fn declared_frames(sources: &[Source]) -> (Vec<Tool>, Vec<Wobj>) {
    let (mut tools, mut wobjs): (Vec<Tool>, Vec<Wobj>) = (Vec::new(), Vec::new());
    for source in sources.iter().filter(|source| super::refuse(source).is_none()) {
        let Ok(file) = super::syntax::parse(source, 0) else { continue };
        let files = [file];
        let (of_file, objects) = Runner::new(std::slice::from_ref(source), &files, 1).declared();
        for tool in of_file {
            intern(&mut tools, &tool, |known, tool| known.name.eq_ignore_ascii_case(&tool.name));
        }
        for wobj in objects {
            intern(&mut wobjs, &wobj, |known, wobj| known.name.eq_ignore_ascii_case(&wobj.name));
        }
    }
    (tools, wobjs)
}

impl Runner<'_> {
    fn declared(&mut self) -> (Vec<Tool>, Vec<Wobj>) {
        let (mut tools, mut wobjs) = (Vec::new(), Vec::new());
        for at in 0..self.symbols.data {
            let variable = &self.symbols.variables[at];
            let Content::Declared(initial) = variable.content else { continue };
            let (name, kind, module) = (Arc::clone(&variable.name), Arc::clone(&variable.kind), variable.module);
            if !matches!(&*kind, b"TOOLDATA" | b"WOBJDATA") {
                continue;
            }
            let value = self.evaluate(Scope { source: 0, module, local: false, running: false }, initial);
            if let Some(data) = value.tool() {
                tools.push(Tool { name, data: Some(data.normalised()) });
            } else if let Some(data) = value.wobj() {
                let unit = value.wobj_unit().map(|unit| decode(unit).as_ref().into());
                wobjs.push(Wobj { name, data: Some(data.normalised()), unit });
            }
        }
        (tools, wobjs)
    }
}

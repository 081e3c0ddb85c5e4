//! The modules of `--context`.

use super::read::{all, sources};
use super::text::Text;
use deflex::cell::Cell;
use deflex::program::Language;
use deflex::text::{Diagnostic, Source};
use std::borrow::Cow;
use std::path::PathBuf;

/// Context modules, read once for all programs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Context {
    sources: Vec<Source>,
}

impl From<Vec<Source>> for Context {
    fn from(sources: Vec<Source>) -> Self {
        Self { sources }
    }
}

impl Context {
    pub(crate) fn read(paths: &[PathBuf]) -> Result<Self, Vec<Diagnostic>> {
        Ok(Self { sources: sources(paths)? })
    }

    /// The modules, in the order in which they were given.
    pub(crate) fn sources(&self) -> &[Source] {
        &self.sources
    }

    /// The modules, other inputs that are read with a program, and declarations of the routines that the cell lists as free of motions.
    pub(crate) fn with(
        &self,
        others: &[Text],
        language: Language,
        cell: Option<&Cell>,
    ) -> Result<Cow<'_, [Source]>, Vec<Diagnostic>> {
        let is_new = |text: &&Text| self.sources.iter().all(|known| known.name != text.name());
        let of_job = all(others.iter().filter(is_new).map(|text| text.clone().read()))?;
        let harmless = cell.map_or_else(Vec::new, |cell| cell.controller.declarations(language));
        Ok(match [of_job, harmless].concat() {
            more if more.is_empty() => Cow::Borrowed(&self.sources),
            more => Cow::Owned([self.sources.clone(), more].concat()),
        })
    }
}

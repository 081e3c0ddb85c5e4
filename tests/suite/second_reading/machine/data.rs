//! Data: declarations, names, elements and components.

use super::super::tree::{Data, Declaration, Expr, Mode, Part};
use super::super::value::{Val, components};
use super::{Binding, Cell, Frames, Machine, Place, Ran, Stop, Storage, error_number};
use std::rc::Rc;

impl Machine<'_> {
    pub(super) fn declare(&mut self, module: usize, d: &Declaration) -> usize {
        self.cells.push(Cell {
            name: d.name.clone(),
            ty: d.ty.clone(),
            dims: d.dims.len(),
            storage: d.storage,
            local: d.local,
            module,
            value: None,
            init: Some(Rc::new((d.dims.clone(), d.value.clone()))),
        });
        self.cells.len() - 1
    }

    /// Components of a record type.
    pub fn components(&self, ty: &str) -> Vec<(String, String)> {
        let own = self.modules.iter().flat_map(|m| &m.records).find(|(name, _)| name == ty);
        own.map_or_else(
            || components(ty).iter().map(|(name, ty)| ((*name).to_owned(), (*ty).to_owned())).collect(),
            |(_, components)| components.clone(),
        )
    }

    pub fn blank(&self, ty: &str) -> Val {
        match ty {
            "BOOL" => Val::Bool(false),
            "STRING" => Val::Str(String::new()),
            _ => {
                let components = self.components(ty);
                if components.is_empty() {
                    return Val::Num(0.0);
                }
                Val::List(components.iter().map(|(_, ty)| self.blank(ty)).collect())
            }
        }
    }

    /// Value of module or routine data, computed at the first use.
    pub(super) fn ready(&mut self, cell: usize) -> Ran<()> {
        let Some(init) = self.cells[cell].init.take() else { return Ok(()) };
        let (ty, module) = (self.cells[cell].ty.clone(), self.cells[cell].module);
        self.calls.push(Frames { module, routine: String::new(), names: Vec::new(), handler: None, error: None });
        let value = match &init.1 {
            Some(expr) => self.eval(expr, &ty),
            None => {
                let mut value = self.blank(&ty);
                for dim in init.0.iter().rev() {
                    let n = self.eval(dim, "NUM")?.num()? as usize;
                    if n > 10_000 {
                        return Err(Stop::Broken("array too large".into()));
                    }
                    value = Val::List(vec![value; n]);
                }
                Ok(value)
            }
        };
        self.calls.pop();
        self.cells[cell].value = Some(value?);
        Ok(())
    }

    pub(super) fn binding(&self, name: &str) -> Option<Binding> {
        let call = self.calls.last()?;
        if let Some((_, binding)) = call.names.iter().rev().find(|(known, _)| known == name) {
            return Some(binding.clone());
        }
        let of = |own: bool| {
            self.cells.iter().position(|c| {
                c.name == name && c.module != usize::MAX && if own { c.module == call.module } else { !c.local }
            })
        };
        let cell = of(true).or_else(|| of(false))?;
        Some(Binding::Data(self.whole(cell)))
    }

    pub fn whole(&self, cell: usize) -> Place {
        Place { cell, path: Vec::new(), ty: self.cells[cell].ty.clone(), dims: self.cells[cell].dims }
    }

    /// Whether an optional parameter is given.
    pub fn present(&self, name: &str) -> bool {
        !matches!(self.binding(name), Some(Binding::Absent) | None)
    }

    /// Whether program data or a parameter has the name.
    pub fn is_bound(&self, name: &str) -> bool {
        self.binding(name).is_some()
    }

    /// Module and name of the routine that runs.
    pub fn current(&self) -> (usize, String) {
        self.calls.last().map_or((0, String::new()), |call| (call.module, call.routine.clone()))
    }

    pub(super) fn absent(&self, expr: &Expr) -> bool {
        matches!(expr, Expr::Data(data) if data.steps.is_empty() && matches!(self.binding(&data.name), Some(Binding::Absent)))
    }

    /// Where data stands; `None` where no program data has the name.
    pub fn place(&mut self, data: &Data) -> Ran<Option<Place>> {
        let mut place = match self.binding(&data.name) {
            Some(Binding::Data(place)) => place,
            Some(Binding::Absent) => return Err(Stop::Broken(format!("{} is not given", data.name))),
            Some(Binding::Given) => return Err(Stop::Broken(format!("{} is a switch", data.name))),
            None => return Ok(None),
        };
        self.ready(place.cell)?;
        for step in &data.steps {
            match step {
                Part::Element(indices) => {
                    for index in indices {
                        let i = self.eval(index, "NUM")?.num()?;
                        if place.dims == 0 {
                            return Err(Stop::Broken(format!("{} is no array", data.name)));
                        }
                        let cell = &self.cells[place.cell].value;
                        let size = cell.as_ref().map_or(Ok(0), |v| v.part(&place.path)?.list().map(<[Val]>::len))?;
                        if i < 1.0 || i > size as f64 {
                            return Err(Stop::Raise(error_number("ERR_OUTOFBND").unwrap_or(0)));
                        }
                        place.path.push(i as usize - 1);
                        place.dims -= 1;
                    }
                }
                Part::Component(name) => {
                    let components = self.components(&place.ty);
                    let at = components.iter().position(|(known, _)| known == name);
                    let at = at.ok_or_else(|| format!("{} has no {name}", place.ty))?;
                    place.path.push(at);
                    place.ty = components[at].1.clone();
                }
            }
        }
        Ok(Some(place))
    }

    pub fn read(&mut self, place: &Place) -> Ran<Val> {
        self.ready(place.cell)?;
        let value = self.cells[place.cell].value.as_ref().ok_or_else(|| "no value".to_owned())?;
        Ok(value.part(&place.path)?.clone())
    }

    pub fn write(&mut self, place: &Place, value: Val) -> Ran<()> {
        self.ready(place.cell)?;
        let cell = &mut self.cells[place.cell];
        if cell.storage == Storage::Const {
            return Err(Stop::Broken(format!("{} is a constant", cell.name)));
        }
        if let Val::Str(text) = &value
            && text.len() > 80
        {
            return Err(Stop::Broken("string too long".into()));
        }
        *cell.value.as_mut().ok_or_else(|| "no value".to_owned())?.part_mut(&place.path)? = value;
        Ok(())
    }

    /// A value that stands in no program data, of a parameter's or routine's.
    pub(super) fn fresh(&mut self, name: &str, ty: &str, dims: usize, storage: Storage, value: Val) -> Place {
        self.cells.push(Cell {
            name: name.to_owned(),
            ty: ty.to_owned(),
            dims,
            storage,
            local: true,
            // No name finds it but the call's own.
            module: usize::MAX,
            value: Some(value),
            init: None,
        });
        self.whole(self.cells.len() - 1)
    }

    pub(super) fn bind(&mut self, name: &str, ty: &str, mode: Mode, value: &Expr) -> Ran<Binding> {
        if mode == Mode::Reference
            && let Expr::Data(data) = value
            && let Some(place) = self.place(data)?
        {
            return Ok(Binding::Data(place));
        }
        let dims = match value {
            Expr::Data(data) => self.place(data)?.map_or(0, |place| place.dims),
            _ => 0,
        };
        let copied = self.eval(value, ty)?;
        Ok(Binding::Data(self.fresh(name, ty, dims, Storage::Var, copied)))
    }
}

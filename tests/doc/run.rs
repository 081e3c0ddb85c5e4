// The program and the cell of `samples/slot`. Examples in the documentation of `deflex::session` include this block as their first line.
{
    let cell = deflex::session::CellFile::read("samples/slot/cell.toml".as_ref())?;
    let program = deflex::session::ProgramFiles::read(&["samples/slot/slot.mod".into()], &[], None)?;
    (program, deflex::session::Run::new(cell.into()))
}

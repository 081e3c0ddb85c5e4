// The program and the cell of `samples/slot`. Examples in the documentation of the crates include this block as their first, hidden line.
{
    let text = std::fs::read("../../samples/slot/cell.toml")?;
    (include!("program.rs"), deflex_cell::Cell::read(&deflex_text::Source::new("cell.toml", text))?)
}

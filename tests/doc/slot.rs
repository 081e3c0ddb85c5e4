// The program and the cell of `samples/slot`. Examples in the documentation of the crates include this block as their first, hidden line.
{
    let read = |name: &str| std::fs::read(format!("../../samples/slot/{name}")).map(|bytes| deflex_text::Source::new(name, bytes));
    (deflex_program::rapid::read(vec![read("slot.mod")?], vec![])?, deflex_cell::Cell::read(&read("cell.toml")?)?)
}

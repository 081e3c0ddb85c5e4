// The cell, the program and the measured rows of `samples/closed-loop`. Examples in the documentation include this block as their first line.
{
    let read = |name: &str| {
        let text = std::fs::read(format!("../../samples/closed-loop/{name}")).expect("a sample");
        deflex_text::Source::new(name, text)
    };
    let program = deflex_program::rapid::read(vec![read("part.mod")], vec![]).expect("a program");
    let cell = deflex_cell::Cell::read(&read("cell.toml")).expect("a cell");
    (cell, program, deflex_measured::Table::read(&read("measured.csv")).expect("a table"))
}

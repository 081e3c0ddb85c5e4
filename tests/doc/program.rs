// The program of `samples/slot`. Examples in the documentation of the crates include this block as their first, hidden line.
{
    let text = std::fs::read("../../samples/slot/slot.mod").expect("a sample");
    deflex_program::rapid::read(vec![deflex_text::Source::new("slot.mod", text)], vec![]).expect("a program")
}

// The CL data of `samples/blade`. Examples in the documentation of the crates include this block as their first, hidden line.
{
    use deflex_program::cl::{self, ClOptions, Units};
    let options = ClOptions { units: Some(Units::Millimetre), any_tool: true, ..ClOptions::default() };
    let text = std::fs::read("../../samples/blade/blade.aptsource").expect("a sample");
    cl::read(deflex_text::Source::new("blade.aptsource", text), &options).expect("a program")
}

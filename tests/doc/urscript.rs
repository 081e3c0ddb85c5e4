// A program in URScript, and its run. Examples in the documentation of `deflex-lang` include this block as their first, hidden line.
{
    let text = b"def part():\n  movel(p[0.5, 0.1, 0.2, 0, 3.14, 0], a=1.2, v=0.025)\nend\n";
    let program = deflex_lang::urscript::read(&[text], 1).unwrap();
    let outcome = deflex_lang::run::run(&program, &deflex_lang::urscript::UrScript).unwrap();
    (text, program, outcome)
}

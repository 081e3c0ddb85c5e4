//! Reads the usual positions, `GOTO/x,y,z` or `GOTO/x,y,z,i,j,k` and no more, without tokens.

use super::lex::{Lexer, Record, RecordKind, RecordStart};
use super::modal::Xyz;
use super::motion::axis;
use super::reader::Reader;
use deflex_text::Span;
use deflex_text::number::read_leading;

/// Numbers of a position with its axis.
const NUMBERS: usize = 6;

/// A record that is only a position.
struct Position {
    record: Record,
    xyz: Xyz,
    printed: [f64; 3],
    axis: Option<[f64; 3]>,
    /// The position before the end of its line.
    after: RecordStart,
}

impl Position {
    /// The record on the line after a position, if the next line is available too.
    fn read(bytes: &[u8], place: RecordStart) -> Option<Self> {
        let end = |at: usize| match bytes.get(at..)? {
            [b'\n', ..] => Some(at + 1),
            [b'\r', b'\n', ..] => Some(at + 2),
            _ => None,
        };
        let start = end(place.at)?;
        let mut at = start + bytes[start..].strip_prefix(b"GOTO/").map(|_| "GOTO/".len())?;
        let (mut spans, mut values) = ([Span::default(); NUMBERS], [0.0; NUMBERS]);
        let mut count = 0;
        loop {
            let number = read_leading(&bytes[at..])?;
            *spans.get_mut(count)? = Span::new(at, at + number.len());
            values[count] = number.value;
            count += 1;
            at += number.len();
            if bytes.get(at) != Some(&b',') {
                break;
            }
            at += 1;
        }
        end(at)?;
        let line = place.line + 1;
        let [x, y, z, printed @ ..] = values;
        let axis = match count {
            3 => None,
            NUMBERS => Some(axis(printed)?),
            _ => return None,
        };
        Some(Self {
            record: Record { kind: RecordKind::Statement, span: Span::new(start, at), line },
            xyz: [spans[0], spans[1], spans[2]],
            printed: [x, y, z],
            axis,
            after: RecordStart { at, line },
        })
    }
}

impl Reader {
    /// Reads the next record if it is only a position and has no further meaning, like [`Reader::take`].
    pub(super) fn take_plain(&mut self, lexer: &mut Lexer) -> bool {
        let plain = self.pending.is_none() && self.checked.is_none() && !self.cycle.is_active();
        if !plain || self.units.is_none() || lexer.is_cards() {
            return false;
        }
        let Some(position) = Position::read(lexer.bytes(), lexer.place()) else { return false };
        lexer.go_on(position.after);
        self.literal_targets += 1;
        self.understood += 1;
        self.modal.axis = position.axis.unwrap_or_else(|| self.axis_where_none_is_printed());
        self.arrive(position.record, position.xyz, position.printed, true);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::lex::Lexer;
    use super::super::reader::Reader;
    use crate::cl::ClOptions;
    use deflex_text::Source;
    use proptest::prelude::*;

    fn line() -> impl Strategy<Value = String> {
        let number = prop_oneof![
            12 => "-?[0-9]{1,4}\\.[0-9]{1,6}",
            1 => prop::sample::select(vec!["0", ".5", "5.", "+1.25", "1.5E1", "x", "1 ", "1$", "", "1.2.3"]).prop_map(str::to_owned),
        ];
        let axis =
            prop::sample::select(vec![",0.0,0.0,1.0", ",0,-0.6,0.8", "", "", ",0,0,2", ",0.6,0.8", ",1,2,3,0,0,1"]);
        let word = prop_oneof![30 => Just("GOTO/"), 1 => prop::sample::select(vec!["goto/", "GOTO /", " GOTO/", "FROM/", "N10 GOTO/"])];
        let point = (word, prop::array::uniform3(number), axis)
            .prop_map(|(word, [x, y, z], axis)| format!("{word}{x},{y},{z}{axis}"));
        let others = prop::sample::select(vec![
            "RAPID", "FEDRAT/100,MMPM", "UNITS/INCHES", "$$ a comment", "", "CIRCLE/0,0,0,0,0,1,5", "COPY/1",
            "CUTCOM/LEFT", "PPRINT/DEFLEX AIR",
        ]);
        prop_oneof![8 => point, 1 => others.prop_map(str::to_owned)]
    }

    proptest! {
        #[test]
        fn plain_positions_are_read_as_all_records_are(
            unit in any::<bool>(),
            lines in prop::collection::vec(line(), 1..60),
            end in prop::sample::select(vec!["\n", "\r\n", "\r", "\n\n", "\r\r\n"]),
        ) {
            let text = [if unit { "UNITS/MM" } else { "" }, &lines.join(end), "FINI"].join(end);
            let mut came = Vec::new();
            for plain in [true, false] {
                let (mut reader, mut lexer) = (Reader::new(text.as_bytes(), &ClOptions::default()), Lexer::new(text.as_bytes(), 0));
                let mut tokens = Vec::new();
                loop {
                    if plain && reader.take_plain(&mut lexer) {
                        continue;
                    }
                    let Some(record) = lexer.next(&mut tokens) else { break };
                    reader.take(lexer.bytes(), record, &tokens);
                    if reader.no_unit.is_some() {
                        break;
                    }
                }
                reader.end();
                let program = reader.program(Source::new("x.cl", text.as_bytes()));
                came.push(format!("{program:?} {reader:?}"));
            }
            prop_assert_eq!(&came[0], &came[1]);
        }
    }
}

//! RAPID text to tokens with their lines. A mark (`! deflex air`) becomes a call; other comments go.

#[derive(Clone, Debug, PartialEq)]
pub enum Token {
    Word(String),
    Num(f64),
    Str(String),
    Sign(&'static str),
    End,
}

const SIGNS: [&str; 25] = [
    ":=", "<>", "<=", ">=", "[", "]", "(", ")", "{", "}", ",", ";", ":", "\\", "+", "-", "*", "/", "=", "<", ">", ".",
    "|", "?", "%",
];

pub fn tokens(text: &str) -> Result<Vec<(Token, u32)>, String> {
    let bytes: Vec<char> = text.chars().collect();
    let (mut out, mut i, mut line) = (Vec::new(), 0, 1);
    'next: while i < bytes.len() {
        let c = bytes[i];
        if c == '\n' {
            line += 1;
        }
        if c.is_whitespace() {
            i += 1;
        } else if c == '!' {
            let from = i + 1;
            while i < bytes.len() && bytes[i] != '\n' {
                i += 1;
            }
            let comment: String = bytes[from..i].iter().collect();
            if let ["deflex", mark @ ("air" | "cut")] = comment.split_whitespace().collect::<Vec<_>>()[..] {
                out.push((Token::Word(format!("MARK_{}", mark.to_uppercase())), line));
                out.push((Token::Sign(";"), line));
            }
        } else if c == '"' {
            let mut s = String::new();
            i += 1;
            loop {
                match bytes.get(i) {
                    Some('"') if bytes.get(i + 1) == Some(&'"') => i += 1,
                    Some('"') => break,
                    Some(_) => {}
                    None => return Err("open string".into()),
                }
                s.push(bytes[i]);
                i += 1;
            }
            i += 1;
            out.push((Token::Str(s), line));
        } else if c.is_ascii_digit() || c == '.' && bytes.get(i + 1).is_some_and(char::is_ascii_digit) {
            let from = i;
            while i < bytes.len()
                && (bytes[i].is_ascii_digit()
                    || bytes[i] == '.'
                    || bytes[i].eq_ignore_ascii_case(&'e')
                    || matches!(bytes[i], '+' | '-') && bytes[i - 1].eq_ignore_ascii_case(&'e'))
            {
                i += 1;
            }
            let number: String = bytes[from..i].iter().collect();
            out.push((Token::Num(number.parse().map_err(|_| format!("number {number}"))?), line));
        } else if c.is_alphabetic() || c == '_' {
            let from = i;
            while i < bytes.len() && (bytes[i].is_alphanumeric() || bytes[i] == '_') {
                i += 1;
            }
            out.push((Token::Word(bytes[from..i].iter().collect::<String>().to_uppercase()), line));
        } else {
            for sign in SIGNS {
                if bytes[i..].iter().zip(sign.chars()).filter(|(a, b)| **a == *b).count() == sign.len() {
                    out.push((Token::Sign(sign), line));
                    i += sign.len();
                    continue 'next;
                }
            }
            return Err(format!("line {line}: unexpected {c}"));
        }
    }
    out.push((Token::End, line));
    Ok(out)
}

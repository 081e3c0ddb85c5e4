//! Fewer lines that still show what was found.

/// Whether all routines that generated programs have of their own are there where they are called.
pub fn whole(modules: &[String]) -> bool {
    let text = modules.concat();
    ["r0", "r1", "r2", "rv1", "rv2", "rv3", "rN", "f1", "f2", "f3", "tr"].iter().all(|name| {
        let declared = |head: &str| text.contains(&format!("{head} {name}"));
        let words = || text.split(|c: char| !c.is_alphanumeric());
        declared("PROC")
            || declared("num")
            || declared("wobjdata")
            || declared("robtarget")
            || declared("TRAP")
            || !words().any(|word| word == *name)
    })
}

/// Fewer lines that still do it.
pub fn minimised(modules: &[String], still: impl Fn(&[String]) -> bool) -> Vec<String> {
    let mut best: Vec<Vec<String>> = modules.iter().map(|m| m.lines().map(str::to_owned).collect()).collect();
    let join = |m: &[Vec<String>]| m.iter().map(|lines| lines.join("\n") + "\n").collect::<Vec<_>>();
    let mut size = best.iter().map(Vec::len).max().unwrap_or(1) / 2;
    loop {
        let mut smaller = false;
        for m in 0..best.len() {
            let mut at = 0;
            while at < best[m].len() {
                let mut tried = best.clone();
                let end = (at + size).min(tried[m].len());
                tried[m].drain(at..end);
                if still(&join(&tried)) {
                    best = tried;
                    smaller = true;
                } else {
                    at += 1.max(size / 2);
                }
            }
        }
        // A block's two ends at a time.
        if size <= 1 {
            for m in 0..best.len() {
                let mut a = 0;
                'next: while a < best[m].len() {
                    for b in a + 1..best[m].len() {
                        let mut tried = best.clone();
                        tried[m].remove(b);
                        tried[m].remove(a);
                        if still(&join(&tried)) {
                            best = tried;
                            smaller = true;
                            continue 'next;
                        }
                    }
                    a += 1;
                }
            }
        }
        if size > 1 {
            size /= 2;
        } else if !smaller {
            return join(&best);
        }
    }
}

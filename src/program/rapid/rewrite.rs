//! Wanted poses into edits on number tokens; all else byte for byte.

use super::{Layout, Site, SiteKind, turn};
use crate::program::{Change, Goal, Insert, Program, RewriteOptions, Rewritten};
use crate::text::{Edit, Span, number};
use std::collections::BTreeMap;

/// Users of one literal agree when their wanted numbers print the same: half a digit of four decimals, mm.
const AGREE_MM: f64 = 5e-5;
/// The same for quaternion components.
const AGREE_QUAT: f64 = 5e-9;

pub(in crate::program) fn rewrite(
    program: &Program,
    layout: &Layout,
    changes: &[Option<Change>],
    inserts: &[Insert],
    options: &RewriteOptions,
) -> Rewritten {
    let mut pen =
        Pen { program, options, edits: vec![Vec::new(); program.written], printed: vec![None; layout.sites.len()] };
    let mut kept = Vec::new();
    let mut users: Vec<Vec<usize>> = vec![Vec::new(); layout.sites.len()];
    for (i, &site) in layout.site_of.iter().enumerate() {
        if let Some(users) = users.get_mut(site as usize) {
            users.push(i);
        }
    }
    // Literals first: what stands on them follows.
    let mut clones: BTreeMap<usize, (usize, Vec<usize>)> = BTreeMap::new();
    for (s, site) in layout.sites.iter().enumerate().filter(|(_, site)| site.kind == SiteKind::Robtarget) {
        let Some(first) = users[s].iter().find_map(|&i| changes[i].as_ref()) else { continue };
        if users[s].iter().all(|&i| changes[i].as_ref().is_some_and(|change| agree(first, change))) {
            pen.literal(s, site, first);
        } else if options.allow_clones
            && users[s].iter().all(|&i| layout.to_arg[i].is_some() && program.targets[i].name.is_some())
        {
            clones.insert(s, (s, users[s].clone()));
        } else {
            kept.extend(
                users[s].iter().filter(|&&i| changes[i].is_some()).map(|&i| (i, "used with different corrections")),
            );
        }
    }
    let mut cloned: BTreeMap<usize, ([f64; 3], [f64; 4])> = BTreeMap::new();
    for (s, users) in clones.values() {
        pen.clone_literal(layout, &layout.sites[*s], users, changes, &mut cloned);
    }
    for (s, site) in layout.sites.iter().enumerate().filter(|(_, site)| site.kind != SiteKind::Robtarget) {
        let base = site.base.and_then(|base| layout.sites.iter().position(|b| (b.source, b.position[0].start) == base));
        let wanted: Vec<Option<[f64; 3]>> =
            users[s].iter().map(|&i| changes[i].as_ref().map(|c| c.position_mm)).collect();
        let moved = base.is_some_and(|base| pen.printed[base].is_some());
        let first = wanted.iter().flatten().next().copied().or_else(|| {
            // Not changed itself, but its base is: hold where it was.
            users[s].first().filter(|_| moved).and_then(|&i| position(&program.targets[i].goal))
        });
        let Some(first) = first else { continue };
        let same = wanted.iter().flatten().all(|w| (0..3).all(|k| (w[k] - first[k]).abs() <= AGREE_MM));
        if let (true, Some(base)) = (same, base) {
            let (from, quat) = pen.held(base, &layout.sites[base]);
            pen.offset(s, site, first, from, &quat);
        } else {
            kept.extend(users[s].iter().map(|&i| (i, "used with different corrections")));
        }
    }
    let written =
        (0..program.targets.len()).map(|i| cloned.get(&i).copied().unwrap_or_else(|| pen.seen(layout, i))).collect();
    let inserted = pen.insert(layout, inserts);
    for edits in &mut pen.edits {
        edits.sort_by_key(|edit| (edit.span.start, edit.span.end));
    }
    kept.sort_unstable();
    Rewritten { edits: pen.edits, written, inserted, kept }
}

fn position(goal: &Goal) -> Option<[f64; 3]> {
    match goal {
        Goal::Pose { position_mm, .. } => Some(*position_mm),
        _ => None,
    }
}

fn agree(a: &Change, b: &Change) -> bool {
    let near = |a: &[f64], b: &[f64], tolerance: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance);
    let quats = match (&a.quat, &b.quat) {
        (Some(a), Some(b)) => near(a, b, AGREE_QUAT) || near(a, &b.map(|q| -q), AGREE_QUAT),
        (None, None) => true,
        _ => false,
    };
    near(&a.position_mm, &b.position_mm, AGREE_MM) && quats && a.conf == b.conf
}

/// A value as the controller holds it.
fn single(value: f64) -> f64 {
    #[allow(clippy::cast_possible_truncation)]
    let held = value as f32;
    f64::from(held)
}

/// Position and orientation as printed, not yet rounded to single precision.
type Printed = ([f64; 3], [f64; 4]);

struct Pen<'a> {
    program: &'a Program,
    options: &'a RewriteOptions,
    edits: Vec<Vec<Edit>>,
    /// What each edited site says now.
    printed: Vec<Option<Printed>>,
}

impl Pen<'_> {
    fn token(&self, source: usize, span: Span) -> &[u8] {
        self.program.sources[source].slice(span)
    }

    /// Replaces one number; returns what is printed there now.
    fn number(&mut self, source: usize, span: Span, value: f64, least: usize) -> f64 {
        let old = self.token(source, span).to_vec();
        let compact: Vec<u8> = old.iter().copied().filter(|b| !b.is_ascii_whitespace()).collect();
        let decimals = number::decimals(&compact).max(least);
        let mut new = Vec::with_capacity(16);
        number::write_fixed(&mut new, value, decimals);
        let printed = number::read(&new).unwrap_or(value);
        let before = number::read(&compact);
        // Equal as numbers, so that 0 and −0 are the same.
        if before.is_some_and(|before| (before - printed).abs() <= 0.0) {
            return printed;
        }
        if old.first() == Some(&b'+') && new.first() != Some(&b'-') {
            new.insert(0, b'+');
        }
        self.edits[source].push(Edit { span, content: new });
        printed
    }

    fn literal(&mut self, index: usize, site: &Site, change: &Change) {
        let position = std::array::from_fn(|k| {
            self.number(site.source, site.position[k], change.position_mm[k], self.options.position_decimals)
        });
        let quat = match (change.quat, site.quat) {
            (Some(wanted), Some(tokens)) => {
                let wanted = same_hemisphere(wanted, &site.written_quat);
                std::array::from_fn(|k| self.number(site.source, tokens[k], wanted[k], self.options.quat_decimals))
            }
            _ => site.written_quat,
        };
        if let (Some(conf), Some(tokens)) = (change.conf, site.conf) {
            for (token, value) in tokens.into_iter().zip([conf.cf1, conf.cf4, conf.cf6, conf.cfx]) {
                self.number(site.source, token, f64::from(value), 0);
            }
        }
        self.printed[index] = Some((position, quat));
    }

    /// What a literal says now, as the controller holds it.
    fn held(&self, index: usize, site: &Site) -> Printed {
        let (position, quat) = self.printed[index].unwrap_or((site.written_mm, site.written_quat));
        (position.map(single), normalised(quat.map(single)))
    }

    /// Offs and RelTool: the three numbers from where the base stands now.
    fn offset(&mut self, index: usize, site: &Site, wanted: [f64; 3], from: [f64; 3], quat: &[f64; 4]) {
        let shift = std::array::from_fn(|k| wanted[k] - from[k]);
        let shift = match site.kind {
            SiteKind::RelTool => turn(&[quat[0], -quat[1], -quat[2], -quat[3]], shift),
            _ => shift,
        };
        let printed = std::array::from_fn(|k| {
            self.number(site.source, site.position[k], shift[k], self.options.position_decimals)
        });
        self.printed[index] = Some((printed, site.written_quat));
    }

    /// Pose of a target as the controller will hold it.
    fn seen(&self, layout: &Layout, i: usize) -> Printed {
        let as_written = || match self.program.targets[i].goal {
            Goal::Pose { position_mm, quat, .. } => (position_mm.map(single), normalised(quat.map(single))),
            _ => ([0.0; 3], [1.0, 0.0, 0.0, 0.0]),
        };
        let Some(site) = layout.sites.get(layout.site_of[i] as usize) else { return as_written() };
        if site.kind == SiteKind::Robtarget {
            return self.held(layout.site_of[i] as usize, site);
        }
        let base = site.base.and_then(|base| layout.sites.iter().position(|b| (b.source, b.position[0].start) == base));
        let Some(base) = base else { return as_written() };
        let (from, quat) = self.held(base, &layout.sites[base]);
        let d = self.printed[layout.site_of[i] as usize].map_or(site.written_mm, |p| p.0).map(single);
        let shift = if site.kind == SiteKind::RelTool { turn(&quat, d) } else { d };
        (std::array::from_fn(|k| from[k] + shift[k]), quat)
    }

    /// Gives every user of a declared target but the first a declaration of its own.
    fn clone_literal(
        &mut self,
        layout: &Layout,
        site: &Site,
        users: &[usize],
        changes: &[Option<Change>],
        written: &mut BTreeMap<usize, Printed>,
    ) {
        let source = &self.program.sources[site.source];
        let Some(name) = users.first().and_then(|&i| self.program.targets[i].name.clone()) else { return };
        let line_start =
            source.bytes[..site.position[0].start as usize].iter().rposition(|&b| b == b'\n').map_or(0, |p| p + 1);
        let from = site.position[0].start as usize;
        let end = source.bytes[from..].iter().position(|&b| b == b';').map_or(source.bytes.len(), |p| from + p + 1);
        let declaration = source.bytes[line_start..end].to_vec();
        let line_end: &[u8] = if source.bytes[end..].starts_with(b"\r\n") { b"\r\n" } else { b"\n" };
        let mut text = Vec::new();
        for (n, &i) in users.iter().enumerate() {
            let Some(change) = &changes[i] else { continue };
            let clone = format!("{name}_d{}", n + 1);
            let mut copy = declaration.clone();
            let Some(at) = find(&copy, name.as_bytes()) else { continue };
            // Numbers from the back, so that earlier offsets stay.
            let quat = change.quat.map_or(site.written_quat, |q| same_hemisphere(q, &site.written_quat));
            let mut numbers: Vec<(Span, f64, usize)> =
                (0..3).map(|k| (site.position[k], change.position_mm[k], self.options.position_decimals)).collect();
            if let (Some(tokens), Some(_)) = (site.quat, change.quat) {
                numbers.extend((0..4).map(|k| (tokens[k], quat[k], self.options.quat_decimals)));
            }
            let mut printed = (change.position_mm, quat);
            for (k, (span, value, least)) in numbers.into_iter().enumerate().rev() {
                let range = span.start as usize - line_start..span.end as usize - line_start;
                let mut new = Vec::new();
                number::write_fixed(&mut new, value, number::decimals(&copy[range.clone()]).max(least));
                let value = number::read(&new).unwrap_or(value);
                if k < 3 {
                    printed.0[k] = value
                } else {
                    printed.1[k - 3] = value
                }
                copy.splice(range, new);
            }
            copy.splice(at..at + name.len(), clone.bytes());
            text.extend_from_slice(line_end);
            text.extend_from_slice(&copy);
            if let Some(span) = layout.to_arg[i] {
                let user = usize::from(self.program.targets[i].source);
                self.edits[user].push(Edit { span, content: clone.into_bytes() });
            }
            written.insert(i, (printed.0.map(single), normalised(printed.1.map(single))));
        }
        self.edits[site.source].push(Edit { span: Span::new(end, end), content: text });
    }

    /// New linear moves before their targets' instructions.
    fn insert(&mut self, layout: &Layout, inserts: &[Insert]) -> Vec<Printed> {
        let mut out = Vec::with_capacity(inserts.len());
        for insert in inserts {
            let target = &self.program.targets[insert.before];
            let source_index = usize::from(target.source);
            let source = &self.program.sources[source_index];
            let text = source.slice(target.span);
            // The instruction without its target: name, then what follows the first argument.
            let open = text.iter().position(|b| b.is_ascii_whitespace()).unwrap_or(text.len());
            let after = match layout.to_arg[insert.before] {
                Some(span) => span.end as usize - target.span.start as usize,
                None => matching(text, open),
            };
            let quat = normalised(insert.quat);
            let mut line = text[..open].to_vec();
            line.extend_from_slice(b" [[");
            let mut printed = (insert.position_mm, quat);
            for k in 0..3 {
                let start = line.len();
                number::write_fixed(&mut line, insert.position_mm[k], self.options.position_decimals);
                printed.0[k] = number::read(&line[start..]).unwrap_or(insert.position_mm[k]);
                line.push(b',');
            }
            line.pop();
            line.extend_from_slice(b"],[");
            for k in 0..4 {
                let start = line.len();
                number::write_fixed(&mut line, quat[k], self.options.quat_decimals);
                printed.1[k] = number::read(&line[start..]).unwrap_or(quat[k]);
                line.push(b',');
            }
            line.pop();
            let conf = match target.goal {
                Goal::Pose { conf: Some(c), .. } => format!("],[{},{},{},{}]", c.cf1, c.cf4, c.cf6, c.cfx),
                _ => "],[0,0,0,0]".to_owned(),
            };
            line.extend_from_slice(conf.as_bytes());
            line.extend_from_slice(b",[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]]");
            line.extend(without_stop(&text[after.min(text.len())..]));
            line.push(b';');
            let start = target.span.start as usize;
            let line_start = source.bytes[..start].iter().rposition(|&b| b == b'\n').map_or(0, |p| p + 1);
            let crlf = source.bytes[..start].windows(2).rev().find(|w| w[1] == b'\n').is_some_and(|w| w[0] == b'\r');
            line.extend_from_slice(if crlf { b"\r\n" } else { b"\n" });
            let indent: Vec<u8> =
                source.bytes[line_start..start].iter().copied().take_while(u8::is_ascii_whitespace).collect();
            line.extend_from_slice(&indent);
            self.edits[source_index].push(Edit { span: Span::new(start, start), content: line });
            out.push((printed.0.map(single), normalised(printed.1.map(single))));
        }
        out
    }
}

/// Index behind the bracketed argument that starts at or after `from`.
fn matching(text: &[u8], from: usize) -> usize {
    let mut depth = 0usize;
    for (i, b) in text.iter().enumerate().skip(from) {
        match b {
            b'[' | b'(' => depth += 1,
            b']' | b')' => {
                depth = depth.saturating_sub(1);
                if depth == 0 {
                    return i + 1;
                }
            }
            b',' if depth == 0 => return i,
            _ => {}
        }
    }
    text.len()
}

/// The rest of an instruction with a stop point made a fly-by: the stop belongs to the last piece.
fn without_stop(rest: &[u8]) -> Vec<u8> {
    match find(&rest.to_ascii_lowercase(), b",fine,") {
        Some(at) => [&rest[..at], b",z0,", &rest[at + 6..]].concat(),
        None => rest.to_vec(),
    }
}

fn find(text: &[u8], wanted: &[u8]) -> Option<usize> {
    text.windows(wanted.len().max(1)).position(|window| window.eq_ignore_ascii_case(wanted))
}

fn normalised(quat: [f64; 4]) -> [f64; 4] {
    let norm = quat.iter().map(|q| q * q).sum::<f64>().sqrt();
    if norm > 0.0 { quat.map(|q| q / norm) } else { [1.0, 0.0, 0.0, 0.0] }
}

fn same_hemisphere(quat: [f64; 4], like: &[f64; 4]) -> [f64; 4] {
    let quat = normalised(quat);
    let dot: f64 = quat.iter().zip(like).map(|(a, b)| a * b).sum();
    if dot < 0.0 { quat.map(|q| -q) } else { quat }
}

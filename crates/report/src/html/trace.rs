//! A path of any length in bounded memory: the level of detail of a page.

use deflex_correct::RowNames;
use deflex_text::number::write_fixed;
use serde_json::{Value, json};
use std::sync::Arc;

/// Columns of numbers: the number of decimals, which is that of the CSV report, so that a page shows the same digits, and
/// the names of the columns.
pub(super) type Channels = &'static [(usize, &'static [&'static str])];

/// One column of numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Channel {
    key: &'static str,
    decimals: usize,
}

/// The columns one by one.
pub(super) fn channels(channels: Channels) -> impl Iterator<Item = Channel> {
    channels.iter().flat_map(|(decimals, keys)| keys.iter().map(|key| Channel { key, decimals: *decimals }))
}

/// One target as it is put into a [`Trace`].
#[derive(Clone, Debug)]
pub(super) struct Sample {
    /// Ordinal, rising from sample to sample.
    pub(super) target: u32,
    /// Line in the program or the table.
    pub(super) line: u32,
    /// Name of the target, if it has one.
    pub(super) name: Option<Arc<str>>,
    /// The tool, and the work object in whose frame the position is, if the rows state them.
    pub(super) names: Option<Arc<RowNames>>,
    /// Result of the target, in one or two words.
    pub(super) status: &'static str,
    /// One number for each channel; a number that is not finite means an absent value.
    pub(super) values: Vec<f64>,
    /// Sizes of which the largest are kept at every level of detail.
    pub(super) peaks: [f64; 2],
}

/// A sample in fixed point.
#[derive(Clone, Debug)]
struct Kept {
    target: u32,
    line: u32,
    name: Option<Arc<str>>,
    names: Option<Arc<RowNames>>,
    status: &'static str,
    values: Vec<i32>,
    peaks: [f64; 2],
}

/// Marks an absent value.
const ABSENT: i32 = i32::MIN;

/// Largest number of stretches on a page with one path. A stretch has three samples. With 45 columns in base64, a name
/// of 32 letters and a quoted line for each sample, a page stays below 5 MB.
pub(super) const MOST_STRETCHES: usize = 3584;

/// Length of a quoted line, in characters: enough for a RAPID instruction with its target written out.
const QUOTED: usize = 160;

/// Samples of a path, which are thinned as the path grows.
///
/// The path is cut into stretches of 1, 2, 4, … samples: each keeps its first sample and those with the largest
/// [`Sample::peaks`]. When there are too many stretches, neighbours are merged. Memory is bounded by the number of
/// stretches, and what is kept depends on the samples alone.
#[derive(Clone, Debug)]
pub(super) struct Trace {
    channels: Arc<[Channel]>,
    most: usize,
    /// Number of samples in a stretch.
    stride: usize,
    count: usize,
    stretches: Vec<Stretch>,
    last: Option<Kept>,
    /// The quoted line of each kept sample, after [`Trace::quote`].
    quotes: Vec<String>,
}

#[derive(Clone, Debug)]
struct Stretch {
    first: Kept,
    /// The samples with the largest peaks; `None` if it is the first sample.
    peaks: [Option<Kept>; 2],
}

impl Stretch {
    fn peak(&self, i: usize) -> &Kept {
        self.peaks[i].as_ref().unwrap_or(&self.first)
    }

    /// Replaces peaks by those of a later sample that are larger.
    fn take(&mut self, later: &Kept) {
        for i in 0..self.peaks.len() {
            if later.peaks[i] > self.peak(i).peaks[i] {
                self.peaks[i] = Some(later.clone());
            }
        }
    }

    fn merge(&mut self, later: &Self) {
        for i in 0..self.peaks.len() {
            if later.peak(i).peaks[i] > self.peak(i).peaks[i] {
                self.peaks[i] = Some(later.peak(i).clone());
            }
        }
    }
}

impl Trace {
    /// An empty path that keeps at most `most` stretches (at least 2, an even number).
    pub(super) fn new(all: &[Channels], most: usize) -> Self {
        Self::of(all.iter().copied().flat_map(channels).collect(), most.max(2).next_multiple_of(2))
    }

    fn of(channels: Arc<[Channel]>, most: usize) -> Self {
        Self { channels, most, stride: 1, count: 0, stretches: Vec::new(), last: None, quotes: Vec::new() }
    }

    /// An empty path with the same channels and limits.
    pub(super) fn emptied(&self) -> Self {
        Self::of(Arc::clone(&self.channels), self.most)
    }

    /// Adds the next sample.
    pub(super) fn push(&mut self, sample: Sample) {
        let fixed = |(channel, value): (&Channel, f64)| fixed(value, channel.decimals);
        let kept = Kept {
            target: sample.target,
            line: sample.line,
            name: sample.name,
            names: sample.names,
            status: sample.status,
            values: self.channels.iter().zip(sample.values).map(fixed).collect(),
            peaks: sample.peaks,
        };
        if self.count.is_multiple_of(self.stride) && self.stretches.len() == self.most {
            self.coarsen();
        }
        match self.stretches.last_mut() {
            Some(stretch) if !self.count.is_multiple_of(self.stride) => stretch.take(&kept),
            _ => self.stretches.push(Stretch { first: kept.clone(), peaks: [None, None] }),
        }
        self.last = Some(kept);
        self.count += 1;
    }

    fn coarsen(&mut self) {
        let merge = |pair: &[Stretch]| {
            let mut both = pair[0].clone();
            pair[1..].iter().for_each(|later| both.merge(later));
            both
        };
        self.stretches = self.stretches.chunks(2).map(merge).collect();
        self.stride *= 2;
    }

    fn kept(&self) -> Vec<&Kept> {
        let mut all: Vec<&Kept> = Vec::with_capacity(2 * self.stretches.len() + 1);
        for stretch in &self.stretches {
            let mut group = vec![&stretch.first];
            group.extend(stretch.peaks.iter().flatten());
            group.sort_by_key(|kept| kept.target);
            all.extend(group);
        }
        all.extend(&self.last);
        all.dedup_by_key(|kept| kept.target);
        all
    }

    /// Quotes the line of the program at every kept sample. Call it after all samples have been added. `line_of` gives
    /// the text from the target's ordinal and the line's number, and is called in running order.
    pub(super) fn quote(&mut self, mut line_of: impl FnMut(u32, u32) -> Option<String>) {
        let quote = |kept: &Kept| line_of(kept.target, kept.line).map_or_else(String::new, |line| quoted(&line));
        self.quotes = self.kept().into_iter().map(quote).collect();
    }

    /// The columns for the page: little-endian 32-bit integers in base64, to be divided by 10^decimals. A column with a
    /// single value is that value.
    pub(super) fn json(&self) -> Value {
        let kept = self.kept();
        let column = |decimals: usize, values: &mut dyn Iterator<Item = i32>| {
            let values: Vec<i32> = values.collect();
            if let [first, rest @ ..] = &values[..]
                && !rest.is_empty()
                && rest.iter().all(|value| value == first)
            {
                return json!({ "decimals": decimals, "all": first });
            }
            let bytes: Vec<u8> = values.into_iter().flat_map(i32::to_le_bytes).collect();
            json!({ "decimals": decimals, "data": base64(&bytes) })
        };
        let mut columns = serde_json::Map::new();
        columns.insert("target".to_owned(), column(0, &mut kept.iter().map(|k| k.target.cast_signed())));
        columns.insert("line".to_owned(), column(0, &mut kept.iter().map(|k| k.line.cast_signed())));
        for (i, channel) in self.channels.iter().enumerate() {
            if kept.iter().any(|k| k.values[i] != ABSENT) {
                let column = column(channel.decimals, &mut kept.iter().map(|k| k.values[i]));
                columns.insert(channel.key.to_owned(), column);
            }
        }
        let (statuses, status) = words(kept.iter().map(|k| k.status));
        let (names, name) = words(kept.iter().map(|k| k.name.as_deref().unwrap_or("")));
        columns.insert("status".to_owned(), column(0, &mut status.into_iter()));
        columns.insert("name".to_owned(), column(0, &mut name.into_iter()));
        let named = |names: &Arc<RowNames>| [&*names.tool, &*names.wobj].join(", ");
        let frames: Vec<String> = kept.iter().map(|k| k.names.as_ref().map_or_else(String::new, named)).collect();
        let (frames_named, frames) = words(frames.iter().map(String::as_str));
        columns.insert("frames".to_owned(), column(0, &mut frames.into_iter()));
        // The targets of a loop share a line, so each text is stored once.
        let (quotes, quote) = words(self.quotes.iter().map(String::as_str));
        if quote.len() == kept.len() {
            columns.insert("quote".to_owned(), column(0, &mut quote.into_iter()));
        }
        json!({
            "count": self.count, "kept": kept.len(), "stride": self.stride, "columns": columns,
            "statuses": statuses, "names": names, "frame_names": frames_named, "quotes": quotes,
        })
    }
}

/// A line of a program as a page quotes it: without blanks at its ends, and shortened to a readable length.
fn quoted(line: &str) -> String {
    let line = line.trim().replace(char::is_control, " ");
    match line.char_indices().nth(QUOTED) {
        Some((end, _)) => format!("{}…", &line[..end]),
        None => line,
    }
}

/// Distinct words in the order met, and the index of each.
fn words<'a>(all: impl Iterator<Item = &'a str>) -> (Vec<&'a str>, Vec<i32>) {
    let mut known = std::collections::HashMap::new();
    let mut list = Vec::new();
    let mut index = |word: &'a str| {
        *known.entry(word).or_insert_with(|| {
            list.push(word);
            i32::try_from(list.len() - 1).unwrap_or(i32::MAX)
        })
    };
    let indices = all.map(&mut index).collect();
    (list, indices)
}

/// The digits that the CSV report prints, as an integer; [`ABSENT`] if they do not fit.
fn fixed(value: f64, decimals: usize) -> i32 {
    if !value.is_finite() {
        return ABSENT;
    }
    let mut text = Vec::new();
    write_fixed(&mut text, value, decimals);
    text.retain(|&b| b != b'.');
    std::str::from_utf8(&text).ok().and_then(|digits| digits.parse().ok()).unwrap_or(ABSENT)
}

/// Base64 as in RFC 4648, with padding.
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().fold(0_u32, |word, &b| word << 8 | u32::from(b)) << (8 * (3 - chunk.len()));
        for i in 0..4 {
            let letter = LETTERS[(word >> (18 - 6 * i) & 63) as usize];
            out.push(if i <= chunk.len() { char::from(letter) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CHANNELS: Channels = &[(6, &["error_mm"])];

    fn trace(values: &[f64], most: usize) -> Trace {
        let mut trace = Trace::new(&[CHANNELS], most);
        for (i, &value) in values.iter().enumerate() {
            let target = i as u32 + 1;
            let values = vec![value];
            trace.push(Sample {
                target,
                line: target,
                name: None,
                names: None,
                status: "ok",
                values,
                peaks: [value, -value],
            });
        }
        trace
    }

    #[test]
    fn base64_is_that_of_rfc_4648() {
        for (plain, coded) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }

    #[test]
    fn figures_are_those_of_the_csv() {
        assert_eq!([fixed(-0.123_456_6, 6), fixed(12.5, 4), fixed(-1e-9, 6)], [-123_457, 125_000, 0]);
        assert_eq!([fixed(f64::NAN, 6), fixed(1e9, 6)], [ABSENT, ABSENT]);
    }

    #[test]
    fn a_short_path_is_kept_whole() {
        let trace = trace(&[0.3, 0.1, 0.2], 4);
        let targets: Vec<u32> = trace.kept().iter().map(|k| k.target).collect();
        assert_eq!((trace.stride, targets), (1, vec![1, 2, 3]));
    }

    #[test]
    fn kept_samples_are_quoted_in_running_order() {
        let mut trace = trace(&[0.3, 0.1, 0.2, 0.9, 0.5, 0.4], 2);
        let mut marked = Vec::new();
        trace.quote(|target, line| {
            marked.push((target, line));
            (target != 4)
                .then(|| format!("\tMoveL p{target}, {}\u{1};  ", "x".repeat(if target == 1 { 200 } else { 0 })))
        });
        let kept: Vec<(u32, u32)> = trace.kept().iter().map(|k| (k.target, k.line)).collect();
        assert_eq!(marked, kept);
        assert_eq!(trace.quotes[0], format!("MoveL p1, {}…", "x".repeat(QUOTED - 10)));
        let json = trace.json();
        assert_eq!(json["quotes"][1], "MoveL p2,  ;");
        assert!(json["columns"]["quote"].is_object() && kept.iter().any(|(target, _)| *target == 4));
    }

    proptest! {
        #[test]
        fn ends_and_extremes_stay_in_bounded_memory(values in prop::collection::vec(-1.0..1.0_f64, 1..400), half in 1..20_usize) {
            let trace = trace(&values, 2 * half);
            let kept = trace.kept();
            prop_assert!(trace.stretches.len() <= 2 * half);
            prop_assert!(kept.windows(2).all(|pair| pair[0].target < pair[1].target));
            prop_assert_eq!((kept[0].target, kept[kept.len() - 1].target), (1, values.len() as u32));
            for extreme in [values.iter().copied().fold(-2.0, f64::max), values.iter().copied().fold(2.0, f64::min)] {
                prop_assert!(kept.iter().any(|k| k.values[0] == fixed(extreme, 6)));
            }
            // No stretch of the path is passed over.
            prop_assert!(kept.windows(2).all(|pair| (pair[1].target - pair[0].target) as usize <= trace.stride));
        }
    }
}

//! Reads the times that instruments write: seconds, `09:05:00`, `2026-11-24T09:05:00Z`.

use std::cell::Cell;
use std::str::FromStr;
use toml::value::{Datetime, Offset};

const DAY_S: f64 = 86_400.0;

/// The notation of times in a file: that of the first time. Another notation later is an error.
#[derive(Debug, Default)]
pub(super) struct Clock(Cell<Option<Met>>);

#[derive(Clone, Copy, Debug)]
enum Met {
    /// Seconds from an arbitrary zero of the instrument.
    Seconds,
    /// Times of day: the last one, and 24 h for each midnight since the first one, s.
    Day { last: f64, midnights: f64 },
    /// Dates with times of day.
    Date,
}

impl Met {
    fn in_words(self) -> &'static str {
        match self {
            Self::Seconds => "seconds",
            Self::Day { .. } => "times of day without a date",
            Self::Date => "dates with times of day",
        }
    }
}

impl Clock {
    /// The time in a cell, s: from midnight for times of day, from 1970 for dates. `None` if the text is neither.
    ///
    /// # Errors
    /// Earlier times had another notation. The text lacks the subject of its sentence.
    pub(super) fn time(&self, text: &str) -> Option<Result<f64, String>> {
        let time = Moment::read(text)?;
        let now = if time.date { Met::Date } else { Met::Day { last: time.s, midnights: 0.0 } };
        Some(self.agreed(now).map(|met| match met {
            Met::Day { last, midnights } if !time.date => {
                // Instruments write rows in order, apart from a few seconds. A time that is more than half a day
                // earlier is therefore after midnight.
                let midnights = if time.s < last - 0.5 * DAY_S { midnights + DAY_S } else { midnights };
                self.0.set(Some(Met::Day { last: time.s, midnights }));
                time.s + midnights
            }
            _ => time.s,
        }))
    }

    /// Records that the file's times are seconds.
    ///
    /// # Errors
    /// Those of [`Clock::time`].
    pub(super) fn seconds(&self) -> Result<(), String> {
        self.agreed(Met::Seconds).map(|_| ())
    }

    fn agreed(&self, now: Met) -> Result<Met, String> {
        let met = self.0.get().unwrap_or(now);
        if std::mem::discriminant(&met) != std::mem::discriminant(&now) {
            return Err(format!("is one of {}, and times before are {}", now.in_words(), met.in_words()));
        }
        self.0.set(Some(met));
        Ok(met)
    }
}

/// A time of day, with or without a date.
struct Moment {
    s: f64,
    date: bool,
}

impl Moment {
    fn read(text: &str) -> Option<Self> {
        let (day, time) = match text.split_once(['T', 't', ' ']) {
            Some((day, time)) => (Some(day), time.trim()),
            None => (None, text),
        };
        // RFC 3339 requires two digits for hours, but clocks often write one.
        let hours = time.find(':')?;
        let time = format!("{}{}", if hours == 1 { "0" } else { "" }, time.replace(',', "."));
        let whole = if time.bytes().filter(|byte| *byte == b':').count() == 1 { format!("{time}:00") } else { time };
        let text = day.map_or_else(|| whole.clone(), |day| format!("{day}T{whole}"));
        let found = Datetime::from_str(&text).ok()?;
        let time = found.time?;
        let second = f64::from(time.second.unwrap_or(0)) + 1e-9 * f64::from(time.nanosecond.unwrap_or(0));
        let mut s = 3600.0 * f64::from(time.hour) + 60.0 * f64::from(time.minute) + second;
        if let Some(Offset::Custom { minutes }) = found.offset {
            s -= 60.0 * f64::from(minutes);
        }
        if let Some(date) = found.date {
            s += DAY_S * days_since_1970(i64::from(date.year), i64::from(date.month), i64::from(date.day));
        }
        Some(Self { s, date: found.date.is_some() })
    }
}

/// Number of days in the Gregorian calendar. Years are counted from March, so that the leap day is the last day of a
/// year.
fn days_since_1970(year: i64, month: i64, day: i64) -> f64 {
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let days = 365 * year + year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    (days + (153 * month + 2) / 5 + day - 719_469) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(texts: &[&str]) -> Vec<f64> {
        let clock = Clock::default();
        texts.iter().map(|text| clock.time(text).unwrap().unwrap()).collect()
    }

    #[test]
    fn clocks_count_on_past_midnight() {
        assert_eq!(times(&["09:05:00", "9:05:01,5", "09:06"]), [32700.0, 32701.5, 32760.0]);
        assert_eq!(times(&["23:59:59", "00:00:01.250"]), [86399.0, 86401.25]);
    }

    #[test]
    fn dates_are_seconds_since_1970() {
        // date -u -d … +%s
        assert_eq!(times(&["1970-01-01T00:00:00Z", "2000-02-29 12:00:00"]), [0.0, 951_825_600.0]);
        assert_eq!(times(&["2026-11-24T09:05:00.5+01:00", "2026-12-31T23:59:59Z"]), [1_795_507_500.5, 1_798_761_599.0]);
    }

    #[test]
    fn one_file_has_one_form_of_times() {
        let clock = Clock::default();
        assert!(clock.time("12.5").is_none() && clock.time("25:00:00").is_none() && clock.time("a:b").is_none());
        clock.time("09:05:00").unwrap().unwrap();
        assert!(clock.seconds().unwrap_err().contains("times of day"));
        assert!(clock.time("2026-11-24T09:05:00Z").unwrap().is_err());
    }
}

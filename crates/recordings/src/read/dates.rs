//! Times written as dates in the form of ISO 8601, such as `2023-11-14T22:13:20.5Z`.

use chrono::{DateTime, NaiveDateTime};

/// An instant, and whether the text says its zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Date {
    /// Since 1970 \[ns\]; of a text without a zone as if that were UTC.
    pub(super) since_1970_ns: i64,
    pub(super) has_zone: bool,
}

impl Date {
    /// Reads a date with a time of day, `T` or a blank between the two, with or without a zone; none where it is none, or is
    /// outside the years 1678 to 2261.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        // The shortest is `2023-11-14T22:13:20`.
        let (day, of_day) = text.split_at_checked(10).filter(|(day, _)| day.as_bytes()[4] == b'-')?;
        let of_day = of_day.strip_prefix(['T', 't', ' '])?.replacen(',', ".", 1);
        let text = format!("{day}T{of_day}").replace('z', "Z");
        if let Ok(local) = NaiveDateTime::parse_from_str(&text, "%Y-%m-%dT%H:%M:%S%.f") {
            return Some(Self { since_1970_ns: local.and_utc().timestamp_nanos_opt()?, has_zone: false });
        }
        let text = text.strip_suffix('Z').map_or_else(|| text.clone(), |before| format!("{}+00:00", before.trim_end()));
        let zoned = DateTime::parse_from_str(&text, "%Y-%m-%dT%H:%M:%S%.f%#z").ok()?;
        Some(Self { since_1970_ns: zoned.timestamp_nanos_opt()?, has_zone: true })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_read_to_the_nanosecond() {
        let at = |text: &str| Date::parse(text).map(|date| (date.since_1970_ns, date.has_zone));
        let start = 1_700_000_000_000_000_000;
        for (text, expected) in [
            ("2023-11-14T22:13:20Z", (start, true)),
            ("2023-11-14 22:13:20.123456789z", (start + 123_456_789, true)),
            ("2023-11-14T23:13:20.5+01:00", (start + 500_000_000, true)),
            ("2023-11-14T23:13:20,5+0100", (start + 500_000_000, true)),
            ("2023-11-14T21:13:20-01", (start, true)),
            (" 2023-11-14 22:13:20.000000001 ", (start + 1, false)),
            ("1969-12-31T23:59:59.999999999Z", (-1, true)),
        ] {
            assert_eq!(at(text), Some(expected), "{text}");
        }
    }

    #[test]
    fn what_is_no_date_with_a_time_is_not_read() {
        for text in [
            "",
            "12:00:01",
            "2023-11-14",
            "2023-13-14T00:00:00Z",
            "14-11-2023 22:13:20",
            "2023-11-14T25:00:00",
            "ä234-11-14T",
            "2023-11-14T22:13:20 Mars",
            "9999-01-01T00:00:00Z",
        ] {
            assert_eq!(Date::parse(text), None, "{text}");
        }
    }
}

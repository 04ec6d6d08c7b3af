//! Numbers with units on the command line.

use std::{ops::RangeInclusive, time::Duration};

/// A number and the first of `units` that the text ends with, multiplied by that unit's factor.
fn number(text: &str, units: &[(&str, f64)]) -> Option<f64> {
    let (number, factor) = units.iter().find_map(|(name, factor)| Some((text.strip_suffix(name)?, factor)))?;
    number.trim_end().parse().ok().map(|number: f64| number * factor)
}

/// Parses "90s", "5m" or "1.5h".
pub(super) fn duration(text: &str) -> Result<Duration, String> {
    let expected = "expected a time such as 90s, 5m or 1.5h";
    match number(text, &[("s", 1.0), ("m", 60.0), ("h", 3600.0)]) {
        Some(seconds) if seconds > 0.0 && seconds <= 1e7 => Ok(Duration::from_secs_f64(seconds)),
        Some(_) => Err(format!("not between 0 and 2777 hours, {expected}")),
        None if text.parse::<f64>().is_ok() => Err(format!("no unit, {expected}")),
        None => Err(expected.into()),
    }
}

/// Parses "500", "500kB", "2MB" or "1.5GB".
pub(super) fn bytes(text: &str) -> Result<u64, String> {
    let number = number(text, &[("GB", 1e9), ("MB", 1e6), ("kB", 1e3), ("B", 1.0), ("", 1.0)]);
    let number = number.filter(|n| (0.0..=1e15).contains(n));
    number.map(|n| n as u64).ok_or_else(|| "expected a number of bytes such as 500kB or 2MB".into())
}

/// A parser of "7000", "7k" or "1.5M" within `range`.
pub(super) fn count(range: RangeInclusive<u32>) -> impl Fn(&str) -> Result<u32, String> + Clone {
    let limits = match (range.start(), range.end()) {
        (least, &u32::MAX) => format!("of at least {least}"),
        (least, most) => format!("from {least} to {most}"),
    };
    move |text| {
        let number = number(text, &[("k", 1e3), ("M", 1e6), ("", 1.0)]);
        // 2.3k is off by a rounding.
        let whole =
            number.filter(|n| (n - n.round()).abs() <= 1e-9 * n.abs() && (0.0..=f64::from(u32::MAX)).contains(n));
        let whole = whole.map(|n| n.round() as u32).filter(|n| range.contains(n));
        whole.ok_or_else(|| format!("expected a whole number {limits}, such as 7000 or 7k"))
    }
}

/// Parses "0.1" or "10%" within `range`.
pub(super) fn share(range: RangeInclusive<f64>) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| {
        let number = number(text, &[("%", 0.01), ("", 1.0)]).filter(|n| range.contains(n));
        number.ok_or_else(|| format!("expected a number from {} to {}, or percent", range.start(), range.end()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_units() {
        let seconds = |text| duration(text).map(|d| d.as_secs_f64()).ok();
        assert_eq!([seconds("90s"), seconds("5m"), seconds("1.5h")].map(Option::unwrap), [90.0, 300.0, 5400.0]);
        for bad in ["", "s", "0", "90", "-1m", "nans", "infs", "1e9h", "5x"] {
            assert_eq!(seconds(bad), None, "{bad}");
        }
        assert_eq!(duration("5").unwrap_err(), "no unit, expected a time such as 90s, 5m or 1.5h");
    }

    #[test]
    fn bytes_have_units() {
        let right = ["2MB", "500kB", "1.5 GB", "7B", "12"].map(|text| bytes(text).ok());
        assert_eq!(right, [2_000_000, 500_000, 1_500_000_000, 7, 12].map(Some));
        assert_eq!(["-1MB", "2TB", "", "NaN", "1e9GB"].map(|text| bytes(text).ok()), [None; 5]);
    }

    #[test]
    fn counts_are_whole() {
        let parse = count(1..=2_000_000);
        let right = ["7000", "7k", "2.3k", "1.5M", "1e5", "1"].map(|text| parse(text).ok());
        assert_eq!(right, [7000, 7000, 2300, 1_500_000, 100_000, 1].map(Some));
        for bad in ["", "k", "0", "-1", "1.5", "0.0001k", "3M", "nan", "inf", "7kk", "7 thousand"] {
            assert!(parse(bad).is_err(), "{bad}");
        }
        assert_eq!(parse("3M").unwrap_err(), "expected a whole number from 1 to 2000000, such as 7000 or 7k");
        assert_eq!(count(1..=u32::MAX)("0").unwrap_err(), "expected a whole number of at least 1, such as 7000 or 7k");
    }

    #[test]
    fn shares_may_be_percent() {
        let parse = share(0.0..=10.0);
        assert_eq!(["0.1", "10%", "0", "1000 %"].map(|text| parse(text).ok()), [0.1, 0.1, 0.0, 10.0].map(Some));
        assert!(["", "%", "11", "1001%", "-1%", "nan"].iter().all(|text| parse(text).is_err()));
    }
}

//! Writes a long table in CSV: `t_s,id,x,y,z`, and if known `vx,vy,vz` and `radius`.
//!
//! Each number has the fewest digits that give the same bits when read back.

use std::fs::File;
use std::io::{BufWriter, Write};

use super::ExportError;
use super::source::{Column, ExportInfo, Source};

/// Smallest epoch that a reader restores from absolute times \[s\].
const EPOCH_FROM_S: i64 = 1_000_000;

pub(super) fn write(source: &Source<'_>, info: &ExportInfo, file: &mut File) -> Result<Option<String>, ExportError> {
    let names = info.names.iter().map(|name| quoted(name)).collect::<Result<Vec<_>, _>>()?;
    let (epoch_s, rest_ns) = (info.clock.epoch_ns / 1_000_000_000, info.clock.epoch_ns % 1_000_000_000);
    let absolute = epoch_s >= EPOCH_FROM_S && rest_ns == 0;
    let epoch_s = if absolute { epoch_s } else { 0 };
    let mut out = BufWriter::new(file);
    let columns: Vec<&Column> = info.position_columns().iter().chain(info.optional_columns()).collect();
    out.write_all(b"t_s,id")?;
    columns.iter().try_for_each(|column| write!(out, ",{}", column.name))?;
    for column in info.extra.columns() {
        write!(out, ",{}", quoted(&column)?)?;
    }
    let mut cells = Vec::new();
    out.write_all(b"\n")?;
    source.each_instant(|instant, channels| {
        let time = instant.first().map_or_else(String::new, |first| time_text(epoch_s, first.time_s));
        for (row, sample) in instant.iter().enumerate() {
            write!(out, "{time},{}", names[sample.vehicle])?;
            for column in &columns {
                match (column.of)(sample) {
                    Some(number) => write!(out, ",{number:?}")?,
                    None => out.write_all(b",")?,
                }
            }
            cells.clear();
            info.extra.cells(channels, row, &mut cells);
            for cell in &cells {
                if cell.is_finite() { write!(out, ",{cell:?}") } else { out.write_all(b",") }?;
            }
            out.write_all(b"\n")?;
        }
        Ok(())
    })?;
    out.flush()?;
    let lost = info.clock.epoch_ns != 0 && !absolute;
    Ok(lost.then(|| format!("the table does not contain its epoch: times count from {} ns", info.clock.epoch_ns)))
}

/// Formats an absolute time in decimal digits; the whole seconds are added exactly. The epoch is after 1970, or 0 for
/// none.
fn time_text(epoch_s: i64, time_s: f64) -> String {
    if epoch_s == 0 {
        return format!("{time_s:?}");
    }
    let digits = time_s.abs().to_string();
    let (whole, fraction) = digits.split_once('.').unwrap_or((&digits, "0"));
    let whole = whole.parse::<i64>().ok();
    let (whole, fraction) = if time_s >= 0.0 {
        (whole.and_then(|whole| epoch_s.checked_add(whole)), fraction.to_owned())
    } else {
        let (borrowed_s, rest) = complement_of_fraction(fraction);
        (whole.and_then(|whole| epoch_s.checked_sub(whole + borrowed_s)), rest)
    };
    match whole {
        Some(whole @ 0..) => format!("{whole}.{fraction}"),
        _ => format!("{:?}", time_s + epoch_s as f64),
    }
}

/// Returns `1 - 0.decimals` as a borrowed second and the ten's complement of the digits; 0 and "0" if all digits are 0.
fn complement_of_fraction(decimals: &str) -> (i64, String) {
    let digits = decimals.trim_end_matches('0').as_bytes();
    let Some((last, leading)) = digits.split_last() else { return (0, "0".to_owned()) };
    let nines = leading.iter().map(|digit| char::from(b'0' + b'9' - digit));
    (1, nines.chain([char::from(b'0' + (b'0' + 10 - last))]).collect())
}

/// Quotes a name as a CSV field if needed.
fn quoted(name: &str) -> Result<String, ExportError> {
    if name.is_empty() || name.trim() != name || name.contains(['\n', '\r']) {
        return Err(ExportError::Name(name.to_owned()));
    }
    if name.contains([',', '"', ';', '\t']) {
        return Ok(format!("\"{}\"", name.replace('"', "\"\"")));
    }
    Ok(name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::time_text;

    #[test]
    fn times_after_an_epoch_keep_their_digits() {
        assert_eq!(time_text(1_700_000_000, 12.345_678_901), "1700000012.345678901");
        assert_eq!(time_text(1_700_000_000, 1e-7), "1700000000.0000001");
        assert_eq!(time_text(0, 0.1), "0.1");
        assert_eq!(time_text(1_700_000_000, -2.123_456_789_012), "1699999997.876543210988");
        assert_eq!(time_text(1_700_000_000, -5e-8), "1699999999.99999995");
        assert_eq!(time_text(1_700_000_000, -3.0), "1699999997.0");
        assert_eq!(time_text(0, -0.0), "-0.0");
    }
}

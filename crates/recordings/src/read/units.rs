//! Units of length and velocity in the names of columns.

/// Names of units of length, and their size \[m\].
const LENGTHS_M: [(&[&str], f64); 10] = [
    (&["m", "meter", "meters", "metre", "metres"], 1.0),
    (&["dm"], 0.1),
    (&["cm", "centimeter", "centimeters", "centimetre", "centimetres"], 0.01),
    (&["mm", "millimeter", "millimeters", "millimetre", "millimetres"], 0.001),
    (&["um", "µm", "μm"], 1e-6),
    (&["km", "kilometer", "kilometers", "kilometre", "kilometres"], 1000.0),
    (&["in", "inch", "inches"], 0.0254),
    (&["ft", "foot", "feet"], 0.3048),
    (&["yd", "yard", "yards"], 0.9144),
    (&["nmi"], 1852.0),
];

/// Names of times by which a length is divided, and their size \[s\].
const TIMES_S: [(&[&str], f64); 4] =
    [(&["s", "sec", "second"], 1.0), (&["ms"], 0.001), (&["min", "minute"], 60.0), (&["h", "hr", "hour"], 3600.0)];

/// Units that an unbracketed end may say, as in `vx_m_s` and `x_mm`.
const VELOCITY_ENDS: [&str; 6] = ["m_s", "cm_s", "mm_s", "km_s", "km_h", "ft_s"];
const LENGTH_ENDS: [&str; 6] = ["m", "dm", "cm", "mm", "km", "ft"];

fn size(names: &[(&[&str], f64)], name: &str) -> Option<f64> {
    names.iter().find(|(known, _)| known.contains(&name)).map(|(_, size)| *size)
}

/// The size of a unit of length \[m\], or of velocity \[m/s\]; none where it is neither.
pub(super) fn size_of(unit: &str, velocity: bool) -> Option<f64> {
    let unit = unit.trim().to_lowercase();
    if !velocity {
        return size(&LENGTHS_M, &unit);
    }
    match unit.as_str() {
        "mps" => return Some(1.0),
        "kmh" | "kph" => return Some(1.0 / 3.6),
        _ => {}
    }
    let per = |separator| unit.split_once(separator);
    let (length, time) = per("/").or_else(|| per("_")).or_else(|| per(" per "))?;
    Some(size(&LENGTHS_M, length.trim())? / size(&TIMES_S, time.trim())?)
}

/// The size of a unit of latitude and longitude \[degrees\]; none where it is none.
pub(super) fn degrees(unit: &str) -> Option<f64> {
    match unit.trim().to_lowercase().as_str() {
        "deg" | "degree" | "degrees" | "°" => Some(1.0),
        "rad" | "radian" | "radians" => Some(1.0_f64.to_degrees()),
        "dege7" | "1e-7 deg" | "1e7" => Some(1e-7),
        _ => None,
    }
}

/// The name of a column without the unit at its end, and the unit: `x [mm]`, `x (ft)`.
pub(super) fn bracketed(name: &str) -> (&str, Option<&str>) {
    let name = name.trim();
    let within = |open, close| name.strip_suffix(close)?.rsplit_once(open);
    match within('[', ']').or_else(|| within('(', ')')) {
        Some((stem, unit)) if !stem.trim().is_empty() => (stem.trim(), Some(unit.trim())),
        _ => (name, None),
    }
}

/// The ways to take a unit off the end of a name without brackets, and whether it is one of velocity.
pub(super) fn endings(name: &str) -> impl Iterator<Item = (&str, &str, bool)> {
    let units = VELOCITY_ENDS.map(|unit| (unit, true)).into_iter().chain(LENGTH_ENDS.map(|unit| (unit, false)));
    units.filter_map(|(unit, velocity)| {
        let (stem, end) = name.split_at_checked(name.len().checked_sub(unit.len())?)?;
        Some((stem.strip_suffix('_')?, end, velocity)).filter(|_| end.eq_ignore_ascii_case(unit))
    })
}

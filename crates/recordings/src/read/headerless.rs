//! Tables of plain numbers without a header.

use super::columns::Body;
use super::conventions::Convention;
use super::error::Fault;
use super::layout::Layout;
use super::leftovers::Slots;
use super::options::{Dimensions, ReadOptions};

/// How far the norm of a quaternion may be from 1.
const NORM: f64 = 0.01;

/// The columns of a vehicle whose x is in this one.
fn body(x: usize, dimensions: Dimensions) -> Body {
    let (axes, count) = dimensions.counts();
    let from = |first: usize| [0, 1, 2].map(|axis| (axis < axes).then_some(first + axis));
    Body { position: from(x), velocity: (count > axes).then(|| from(x + axes)), radius: None }
}

/// The columns of a table whose first row holds these numbers: time and then the numbers of each vehicle, or a table of
/// the vehicle `alone`, as TUM and KITTI write them.
pub(super) fn layout(first: &[f64], options: &ReadOptions, alone: &str) -> Result<Layout, Fault> {
    let count = first.len();
    let fits = |dimensions: &Dimensions| count > 1 && (count - 1).is_multiple_of(dimensions.counts().1);
    let table = |time, names, bodies: Vec<Body>, words: &str| {
        let note = format!("there is no header: the numbers are taken as {words}");
        Layout {
            time,
            rest: None,
            unit: None,
            id: None,
            is_id_given: false,
            rivals: Vec::new(),
            suspects: Vec::new(),
            names,
            metres: vec![1.0; count],
            on_earth: false,
            convention: Convention::default(),
            is_planar: bodies.iter().any(|body| body.position[2].is_none()),
            bodies,
            slots: Slots::default(),
            notes: vec![note],
        }
    };
    let one = |time, position: [usize; 3], words| {
        let body = Body { position: position.map(Some), velocity: None, radius: None };
        table(time, vec![alone.to_owned()], vec![body], words)
    };
    if let &[_, _, _, _, x, y, z, w] = first
        && ((x * x + y * y + z * z + w * w).sqrt() - 1.0).abs() < NORM
    {
        return Ok(one(Some(0), [1, 2, 3], "time, position and attitude of one vehicle, as TUM writes them"));
    }
    let known: Vec<_> = Dimensions::ALL.into_iter().filter(fits).collect();
    let dimensions = match (options.dimensions, &known[..]) {
        (Some(given), _) if fits(&given) => given,
        (None, &[only]) if count == 1 + only.counts().1 => only,
        (None, [_, ..]) => {
            let problem = format!("it has {count} numbers, and nothing says how many of them are one vehicle's");
            let ways: Vec<_> = known.iter().map(|dimensions| dimensions.name()).collect();
            let remedy = format!(
                "say it with --dimensions {}: x and y, x, y and z, and +2 or +3 with their velocities",
                ways.join(" or ")
            );
            return Err(Fault::coded("recording/ambiguous-layout", problem, remedy));
        }
        (None, []) if count == 12 => {
            if options.times_per_second.is_none() {
                return Err(Fault::frames("it has twelve numbers, as KITTI writes poses, and no time"));
            }
            return Ok(one(None, [3, 7, 11], "a pose of one vehicle in each line, as KITTI writes them"));
        }
        (given, _) => {
            let each = given.map_or(3, |given| given.counts().1);
            let problem = format!("the line has {count} numbers where time and {each} for each vehicle are expected");
            return Err(Fault::coded(
                "recording/field-count",
                problem,
                "write t x y z x y z ..., a line for each time, or give other --dimensions",
            ));
        }
    };
    let (axes, each) = dimensions.counts();
    let bodies: Vec<_> = (1..count).step_by(each).map(|x| body(x, dimensions)).collect();
    let names: Vec<_> = (1..=bodies.len()).map(|number| number.to_string()).collect();
    let words = format!(
        "time and {}{} of each of {} vehicles",
        if axes == 2 { "x, y (there is no height)" } else { "x, y, z" },
        if each > axes { " and velocity" } else { "" },
        names.len()
    );
    Ok(table(Some(0), names, bodies, &words))
}

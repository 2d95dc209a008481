//! Assigns the columns of a table to roles by its header.
//!
//! A *long* table has one row per vehicle and time, a *wide* table one row per time. Names are compared without regard
//! to case. Units in names are applied, and unknown units are refused.

use std::collections::{BTreeMap, BTreeSet};

use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::option::{COLUMN, ONE_VEHICLE, SCALE};

use super::agreement::Compared;
use super::clock::SubunitColumn;
use super::convention::Convention;
use super::error::{ContentKind, Fault, list, quoted, refuse};
use super::heading::{
    BOOT_TIME, DEPTH, EARTH, HEIGHT, Heading, Heights, ID, POSITION, RADIUS, Role, TIME, VELOCITY, is_angle,
    is_velocity,
};
use super::identity::Slots;
use super::options::{ColumnNames, ReadOptions};
use super::order::PLANAR;
use super::time_unit::TimeUnit;
use super::{aviation, clock, convention, heading, identity};

/// Names of places that are not vehicles.
const PLACES: [&str; 7] = ["home", "origin", "base", "datum", "ref", "reference", "launch"];

/// Names before the coordinates in messages of ROS.
const POSES: [&str; 4] = ["pose", "pose.pose", "/pose", "/pose/pose"];

/// Returns whether a column has this name in messages of ROS: the frame of the coordinates, not that of the vehicle.
fn names_a_frame(column: &str) -> bool {
    let name = column.trim().to_lowercase();
    name.rsplit(['.', '/']).next() == Some("frame_id")
}

/// Roles of the columns of a table.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "independent properties of the columns")]
pub(super) struct Layout {
    /// Column of the time; `None` if the row number is the time.
    pub(super) time: Option<usize>,
    /// Column of the remainder of the time, in a smaller unit.
    pub(super) rest: Option<SubunitColumn>,
    /// Unit in the name of the time column.
    pub(super) unit: Option<TimeUnit>,
    /// Column of the vehicle in a long table.
    pub(super) id: Option<usize>,
    /// Whether the user names the column `id`.
    pub(super) is_id_given: bool,
    /// Other columns of a long table whose names could be those of a vehicle column.
    pub(super) alternative_ids: Vec<usize>,
    /// Unused columns whose values could identify vehicles in a table that seems to hold only one.
    pub(super) suspects: Vec<usize>,
    /// Names of the vehicles of a wide table; empty for a long one.
    pub(super) names: Vec<String>,
    /// Columns of each vehicle of a wide table, or of every row of a long one.
    pub(super) bodies: Vec<VehicleColumns>,
    /// Columns with the vehicle names of a wide table, if any.
    pub(super) slots: Slots,
    /// Factor of each column: the size of the unit in its name \[m or m/s\], or 1.
    pub(super) metres: Vec<f64>,
    /// Whether positions are latitude, longitude \[degrees\] and height \[m\].
    pub(super) on_earth: bool,
    /// Frames and programs recognised by the column names.
    pub(super) convention: Convention,
    /// Whether times count from the start of each vehicle's computer.
    pub(super) counts_from_boot: bool,
    /// Column of the vertical rate of a long table, and the size of its unit \[m/s\] if its name has one.
    pub(super) rate: Option<(usize, Option<f64>)>,
    /// Positions of each vehicle in metres and on the Earth, if it has both. Empty if no vehicle has both.
    pub(super) compared: Vec<Option<Compared>>,
    /// Whether a vehicle has no height column: then no height is used.
    pub(super) is_planar: bool,
    /// Unused columns with the name of the frame of a row.
    pub(super) frames: Vec<usize>,
    /// Facts that follow from the header and the options.
    pub(super) facts: Vec<Fact>,
    /// Notes for the user about the columns.
    pub(super) notes: Vec<String>,
}

impl Layout {
    /// Returns the layout of a table with this header. `alone` is the name of the vehicle in a table without vehicle
    /// names.
    pub(super) fn of(header: &[String], options: &ReadOptions, alone: &str) -> Result<Self, Fault> {
        let convention = Convention::of(header, options)?;
        if convention.has_directions() {
            convention::refuse_known(options, "its header")?;
        }
        let mut columns = Columns::given(header, options)?;
        let found = match columns.get("", TIME) {
            Some(given) => Some((given, None)),
            None => clock::time_columns(header, options)?,
        };
        let (time, rest) = found.ok_or_else(|| missing(header, TIME, ""))?;
        let unit = match rest {
            Some(rest) => Some(rest.unit),
            None => clock::unit_of_time(&header[time], options)?
                .or(convention.counts_from_boot.then_some(TimeUnit::Microseconds)),
        };
        let (id, alternative_ids) = naming_columns(header, time, columns.get("", ID));
        let is_id_given = columns.get("", ID).is_some();

        let is_taken = |column| column == time || id == Some(column) || rest.is_some_and(|rest| rest.column == column);
        let others = (0..header.len()).filter(|&column| !is_taken(column));
        let names = &convention.header;
        let mut headings: Vec<_> = others.filter_map(|column| Some((column, Heading::of(&names[column])?))).collect();
        if id.is_some() {
            without_poses(&mut headings);
        }
        let on_earth = columns.are_on_earth(&headings)?;
        columns.place = if on_earth { EARTH } else { POSITION };
        let places = if on_earth || convention.reference.is_some() { Vec::new() } else { headings.clone() };
        let in_other_frame = vehicles_of(if on_earth { POSITION } else { EARTH }, &headings);
        headings.retain(|(_, heading)| if on_earth { heading.role >= RADIUS } else { !is_angle(heading.role) });
        columns.heights = Heights::place(columns.place, header, &mut columns.found, &mut headings);
        let given: BTreeSet<_> = columns.found.keys().map(|(_, role)| *role).collect();
        for (column, heading) in headings.iter().filter(|(_, heading)| heading.vehicle.is_empty()) {
            if !given.contains(&heading.role) {
                columns.claim("", heading, *column)?;
            }
        }
        let one = columns.get("", columns.place).is_some();
        // Repeated columns are an error: the table has more vehicles than its rows name.
        let repeated = headings.iter().filter(|(_, heading)| heading.is_numbered() && (one || id.is_some()));
        for (column, heading) in repeated {
            if columns.get("", heading.role).is_some() {
                columns.claim("", heading, *column)?;
            }
        }
        let (vehicles, names) = match id {
            Some(_) => (vec![String::new()], Vec::new()),
            None if one => (vec![String::new()], vec![alone.to_owned()]),
            None => columns.claim_wide(&headings).map(|names| (names.clone(), names))?,
        };
        if !one && id.is_none() {
            refuse_two_frames(in_other_frame, &names, on_earth)?;
        }
        let mut bodies = vehicles.iter().map(|vehicle| columns.body(vehicle)).collect::<Result<Vec<_>, _>>()?;
        let flat = vehicles.iter().zip(&bodies).filter(|(_, body)| body.position[2].is_none());
        let flat: Vec<_> = flat.map(|(vehicle, _)| vehicle.clone()).collect();
        let is_planar = !flat.is_empty();
        for body in bodies.iter_mut().filter(|_| is_planar) {
            body.position[2] = None;
            body.velocity.iter_mut().for_each(|velocity| velocity[2] = None);
        }
        let mut layout = Self {
            time: Some(time),
            rest,
            unit,
            id,
            is_id_given,
            alternative_ids,
            names,
            bodies,
            on_earth,
            is_planar,
            counts_from_boot: convention.counts_from_boot || heading::time_and_unit(&header[time]).0 == BOOT_TIME,
            ..Self::default()
        };
        layout.refuse_other_frames(header, &columns.heights, &convention)?;
        let used = layout.columns();
        layout.frames = layout.unused_frames(header, &used);
        if !one && id.is_none() {
            let unused: Vec<_> = (0..header.len()).filter(|column| used.binary_search(column).is_err()).collect();
            layout.slots = identity::examine(header, &unused, &layout.names)?;
        }
        layout.metres = columns.metres(&used, options.metres())?;
        layout.metres.iter_mut().zip(&convention.signs).for_each(|(metres, sign)| *metres *= sign);
        layout.notes.extend(convention.note.clone());
        if is_planar {
            let of_vehicles =
                if flat.len() < vehicles.len() { format!(" of {}", list(&flat, 12)) } else { String::new() };
            layout.notes.push(format!("no column gives the height{of_vehicles}: {PLANAR}"));
        }
        layout.notes.extend(columns.heights_used(&layout, options)?);
        layout.facts = columns.facts(&layout, options);
        layout.convention = convention.clone();
        layout.compare(header, options, &vehicles, (&places, !one && id.is_none()))?;
        layout.check(header, options, one)?;
        if let [first, ..] = layout.slots.ids[..] {
            layout
                .notes
                .push(format!("the names of vehicles are read from columns such as {}", quoted(&header[first])));
            layout.names.clear();
        }
        Ok(layout)
    }

    /// Returns the columns with the frame of a row, without `used` ones.
    fn unused_frames(&self, header: &[String], used: &[usize]) -> Vec<usize> {
        let is_unused = |column: &usize| used.binary_search(column).is_err() && Some(*column) != self.id;
        (0..header.len()).filter(|&column| names_a_frame(&header[column])).filter(is_unused).collect()
    }

    /// Returns the fact which column names the vehicles.
    fn identity(&self, header: &[String], options: &ReadOptions) -> Fact {
        let (source, name) = match (self.id, self.slots.ids.first()) {
            (Some(id), _) if self.is_id_given => (Source::Declared, format!("column {}", quoted(&header[id]))),
            (Some(id), _) => (Source::Deduced, format!("column {}", quoted(&header[id]))),
            (None, Some(&first)) => (Source::Deduced, format!("columns such as {}", quoted(&header[first]))),
            (None, None) if self.names.len() > 1 => (Source::Deduced, "names of columns".to_owned()),
            (None, None) if options.one_vehicle => (Source::Declared, "one vehicle".to_owned()),
            (None, None) => (Source::Convention, "one vehicle, named after the file".to_owned()),
        };
        Fact::name(FactKind::Identity, source, name)
    }

    /// Refuses a header in which only some position columns give the direction of their axis.
    fn refuse_other_frames(&self, header: &[String], heights: &Heights, convention: &Convention) -> Result<(), Fault> {
        if !convention.has_directions() || convention.reference.is_some() {
            return Ok(());
        }
        let of_heights = heights.among(self.bodies.iter().filter_map(|body| body.position[2]));
        let columns_of =
            |body: &VehicleColumns| body.position.into_iter().chain(body.velocity.unwrap_or_default()).flatten();
        let positions = self.bodies.iter().flat_map(columns_of);
        let (directed, others): (Vec<_>, Vec<_>) = positions
            .filter(|column| !of_heights.contains_key(column))
            .partition(|column| convention.directed.contains(column));
        match (&directed[..], &others[..]) {
            (&[directed, ..], &[other, ..]) => {
                let [directed, other] = [directed, other].map(|column| quoted(&header[column]));
                let problem = format!("column {directed} gives the direction of its axis, column {other} does not");
                let remedy = "name the axes of all positions alike, as in `x_ned` or `north`";
                refuse(ContentKind::SeveralFrames, problem, remedy)
            }
            _ => Ok(()),
        }
    }

    /// Refuses columns that leave the vehicles ambiguous, and adds notes. `one`: the position columns name no vehicle.
    fn check(&mut self, header: &[String], options: &ReadOptions, one: bool) -> Result<(), Fault> {
        let (convention, used) = (&self.convention, self.columns());
        if convention.reference.is_some() && options.metres() != 1.0 {
            let problem = format!("its positions are in metres, but {SCALE} is {}", options.metres());
            return refuse(ContentKind::ContradictsOption, problem, format!("omit {SCALE}"));
        }
        let several = self
            .id
            .map(|id| format!("column {}", quoted(&header[id])))
            .or_else(|| (self.names.len() > 1).then(|| "its header".to_owned()));
        if let Some(namer) = several.filter(|_| options.one_vehicle && !options.is_joined) {
            let problem = format!("{namer} names the vehicles");
            return refuse(ContentKind::ContradictsOption, problem, format!("omit {ONE_VEHICLE}"));
        }
        let is_one_vehicle = options.one_vehicle || options.is_joined;
        let unused = (0..header.len()).filter(|column| used.binary_search(column).is_err());
        // Skipped if the user names the vehicle column or declares a single vehicle.
        if (self.id.is_some() || one) && !options.one_vehicle && !self.is_id_given {
            let may_identify_vehicles = |column: &usize| {
                heading::may_identify_vehicles(&header[*column]) && !clock::is_part_of_time(&header[*column])
            };
            let suspects =
                unused.clone().filter(|column| may_identify_vehicles(column) && !self.alternative_ids.contains(column));
            self.suspects = suspects.collect();
        }
        // Pandas renames a second column `x` to `x.1`.
        let repeats = |&column: &usize| {
            let (stem, number) = header[column].rsplit_once('.')?;
            let is_read = |read: usize| header[read] == stem && Heading::of(&convention.header[read]).is_some();
            (heading::is_number(number) && used.iter().any(|&read| is_read(read))).then_some((column, stem))
        };
        if let Some((column, stem)) = unused.clone().find_map(|column| repeats(&column)) {
            let problem = format!("column {} repeats column {}", quoted(&header[column]), quoted(stem));
            let remedy = "rename the columns of each vehicle, or remove these columns";
            return refuse(ContentKind::AmbiguousColumn, problem, remedy);
        }
        let unused: Vec<_> = unused.map(|column| &*header[column]).filter(|name| !name.is_empty()).collect();
        let is_decided = is_one_vehicle || convention.is_one_vehicle;
        if self.id.is_none() && one && !is_decided && !unused.iter().all(|name| heading::is_not_vehicle_column(name)) {
            return Err(match missing(header, ID, "") {
                Fault::Content { kind, problem, remedy } => {
                    let remedy = format!("{remedy}; if all rows are of one vehicle, use {ONE_VEHICLE}");
                    Fault::content(kind, problem, remedy)
                }
                fault => fault,
            });
        }
        if let Some((time, rest)) = self.time.zip(self.rest) {
            let (whole, rest) = (quoted(&header[time]), quoted(&header[rest.column]));
            self.notes.push(format!("times are the sum of {whole} and the remainder {rest}"));
        }
        if !unused.is_empty() {
            self.notes.push(format!("columns not used: {}", unused.join(", ")));
        }
        if !self.names.is_empty() && self.slots.ids.is_empty() && !is_one_vehicle {
            self.notes.push(format!("vehicles by column names: {}", list(&self.names, 50)));
        }
        Ok(())
    }

    /// Finds columns with which the positions are compared: a vertical rate, and a second position on the Earth.
    /// `is_wide`: the names of the position columns contain the names of vehicles.
    fn compare(
        &mut self,
        header: &[String],
        options: &ReadOptions,
        vehicles: &[String],
        (places, is_wide): (&[(usize, Heading<'_>)], bool),
    ) -> Result<(), Fault> {
        let has_height = |body: &VehicleColumns| body.position[2].is_some();
        self.rate = aviation::rate_column(header).filter(|_| matches!(&self.bodies[..], [body] if has_height(body)));
        let is_chosen = ["x", "y"].iter().all(|role| options.columns.get(role).is_some());
        if self.on_earth || is_chosen {
            return Ok(());
        }
        let mut found: BTreeMap<_, Vec<(usize, Option<&str>)>> = BTreeMap::new();
        for (column, Heading { vehicle, role, unit, .. }) in places.iter().filter(|(_, found)| found.role >= EARTH) {
            found.entry((*vehicle, *role)).or_default().push((*column, *unit));
        }
        let columns_of = |vehicle, role| found.get(&(vehicle, role)).map_or(&[][..], Vec::as_slice);
        let has_directions = self.convention.has_directions();
        let metres = |unit: Option<&str>| unit.and_then(|unit| heading::size_of(unit, false)).unwrap_or(1.0);
        let degrees = |unit: Option<&str>| unit.map_or(Some(1.0), heading::degrees);
        let mut notes = Vec::new();
        let compared = vehicles.iter().zip(&self.bodies).map(|(vehicle, body)| {
            // Of several pairs of degrees, the first is compared.
            let [lat, lon] = [0, 1].map(|axis| columns_of(vehicle, EARTH + axis).first().copied());
            let ((lat, of_lat), (lon, of_lon)) = (lat?, lon?);
            // Several heights may be measured from different surfaces.
            let (height, up) = match (columns_of(vehicle, HEIGHT), columns_of(vehicle, DEPTH)) {
                (&[(column, unit)], []) if body.position[2].is_some() => (Some(column), metres(unit)),
                ([], &[(column, unit)]) if body.position[2].is_some() => (Some(column), -metres(unit)),
                _ => (None, 1.0),
            };
            let Some((lat_degrees, lon_degrees)) = degrees(of_lat).zip(degrees(of_lon)) else {
                let [lat, lon] = [lat, lon].map(|column| quoted(&header[column]));
                notes.push(format!("positions are not compared with {lat} and {lon}: the unit is unknown"));
                return None;
            };
            let (earth, units) = ([Some(lat), Some(lon), height], [lat_degrees, lon_degrees, up]);
            Some(Compared { metric: body.position, earth, units, has_directions, is_wide })
        });
        let compared: Vec<_> = compared.collect();
        self.notes.extend(notes);
        self.compared = if compared.iter().any(Option::is_some) { compared } else { Vec::new() };
        if let Some(compared) = self.compared.iter().flatten().next().filter(|_| options.is_joined) {
            let problem = "it has positions in metres and on the Earth, which are not compared between files";
            return Err(compared.fault(problem.to_owned(), header));
        }
        Ok(())
    }

    /// Returns the columns that are read or examined, each once, in ascending order.
    pub(super) fn columns_to_observe(&self) -> Vec<usize> {
        let columns: BTreeSet<_> = self
            .columns()
            .into_iter()
            .chain(self.alternative_ids.iter().copied())
            .chain(self.suspects.iter().copied())
            .chain(self.frames.iter().copied())
            .chain(self.slots.watched.iter().flatten().copied())
            .chain(self.rate.map(|(column, _)| column))
            .chain(self.compared.iter().flatten().flat_map(|compared| compared.earth).flatten())
            .collect();
        columns.into_iter().collect()
    }

    /// Returns the columns that are read, each once, in ascending order.
    pub(super) fn columns(&self) -> Vec<usize> {
        let columns_of = |body: &VehicleColumns| {
            let velocity = body.velocity.unwrap_or_default();
            body.position.into_iter().chain(velocity).chain([body.radius]).flatten()
        };
        let others = self.convention.reference.into_iter().flatten().chain(self.convention.valid.iter().copied());
        let columns: BTreeSet<_> = self
            .bodies
            .iter()
            .flat_map(columns_of)
            .chain(self.time_columns())
            .chain(self.id)
            .chain(others)
            .chain(self.slots.ids.iter().copied())
            .collect();
        columns.into_iter().collect()
    }

    /// Returns the columns of the time.
    pub(super) fn time_columns(&self) -> impl Iterator<Item = usize> {
        self.time.into_iter().chain(self.rest.map(|rest| rest.column))
    }
}

/// Drops the names before the coordinates in messages of ROS, such as `pose.position.x`, unless plain names give x.
fn without_poses(headings: &mut [(usize, Heading<'_>)]) {
    let is_plain = |(_, heading): &(usize, Heading<'_>)| heading.vehicle.is_empty() && heading.role == POSITION;
    if !headings.iter().any(is_plain) {
        for (_, heading) in headings.iter_mut().filter(|(_, heading)| POSES.contains(&heading.vehicle)) {
            heading.vehicle = "";
        }
    }
}

/// Returns the vehicles that have both horizontal coordinates of a frame. `first` is the role of the first coordinate.
fn vehicles_of<'a>(first: Role, headings: &[(usize, Heading<'a>)]) -> BTreeSet<&'a str> {
    let column_of = |role: Role| {
        headings.iter().filter(move |(_, heading)| heading.role == role).map(|(_, heading)| heading.vehicle)
    };
    let second: BTreeSet<_> = column_of(first + 1).collect();
    column_of(first).filter(|vehicle| second.contains(vehicle)).collect()
}

/// Refuses vehicles whose positions are given in another frame only. `names` are the vehicles that are read.
fn refuse_two_frames(in_other_frame: BTreeSet<&str>, names: &[String], on_earth: bool) -> Result<(), Fault> {
    let is_part = |name: &str, prefix: &str| {
        name.strip_prefix(prefix).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '/', '_']))
    };
    let is_known = |vehicle: &str| names.iter().any(|name| is_part(name, vehicle) || is_part(vehicle, name));
    let is_place = |vehicle: &str| PLACES.contains(&vehicle.to_lowercase().as_str());
    let lost = in_other_frame.into_iter().find(|vehicle| !is_known(vehicle) && !is_place(vehicle));
    let Some((vehicle, read)) = lost.zip(names.first()) else { return Ok(()) };
    let kinds = ["metres", "latitude and longitude"];
    let (kind, other) = if on_earth { (kinds[0], kinds[1]) } else { (kinds[1], kinds[0]) };
    let [vehicle, read] = [vehicle, read].map(quoted);
    let problem = format!("the position of vehicle {vehicle} is given in {kind}, that of vehicle {read} in {other}");
    let remedy = "give the positions of all vehicles in one frame, or remove the columns of the other frame";
    refuse(ContentKind::SeveralFrames, problem, remedy)
}

/// Returns the vehicle column and other possible ones; a column given by the user has no alternatives.
fn naming_columns(header: &[String], time: usize, given: Option<usize>) -> (Option<usize>, Vec<usize>) {
    let is_one = |&column: &usize| column != time && heading::is_id(&header[column]);
    let mut named: Vec<_> = (0..header.len()).filter(is_one).collect();
    // Beside the name of an aircraft, `track` is its direction.
    if named.iter().any(|&column| heading::names_aircraft(&header[column])) {
        named.retain(|&column| heading::joined(&header[column]) != "track");
    }
    named.sort_by_key(|&column| !heading::is_aircraft_address(&header[column]));
    let mut named = named.into_iter();
    if given.is_some() { (given, Vec::new()) } else { (named.next(), named.collect()) }
}

/// Columns of the position, velocity and radius of a vehicle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct VehicleColumns {
    /// x, y and optionally z; or latitude, longitude and height.
    pub(super) position: [Option<usize>; 3],
    pub(super) velocity: Option<[Option<usize>; 3]>,
    pub(super) radius: Option<usize>,
}

const WORDS: [&str; 12] = [
    "time",
    "the vehicle",
    "the position along x",
    "the position along y",
    "the position along z",
    "the velocity along x",
    "the velocity along y",
    "the velocity along z",
    "the radius",
    "the latitude",
    "the longitude",
    "the height",
];

/// Returns the fault of a missing column for a role.
pub(super) fn missing(header: &[String], role: Role, suffix: &str) -> Fault {
    let problem = format!("no column gives {}{suffix}; its columns are {}", WORDS[role], list(header, 12));
    let column = COLUMN.set(format!("{}=NAME", ColumnNames::ROLES[role]));
    let remedy = format!("name the column with {column}, or rename it");
    let kind = match role {
        TIME => ContentKind::NoTimeColumn,
        ID => ContentKind::NoVehicleColumn,
        _ if is_velocity(role) || role == RADIUS => ContentKind::MissingColumn,
        _ => ContentKind::NoPositionColumn,
    };
    Fault::content(kind, problem, remedy)
}

/// Columns found so far, by vehicle name and role; the name is empty for columns of all vehicles.
pub(super) struct Columns<'a> {
    pub(super) header: &'a [String],
    pub(super) found: BTreeMap<(String, Role), usize>,
    /// Unit in the name of a column.
    pub(super) units: BTreeMap<usize, &'a str>,
    pub(super) heights: Heights,
    /// Role of the first position axis.
    pub(super) place: Role,
}

impl<'a> Columns<'a> {
    /// Returns the columns named by the user.
    pub(super) fn given(header: &'a [String], options: &'a ReadOptions) -> Result<Self, Fault> {
        let (heights, place) = (Heights::default(), POSITION);
        let mut columns = Self { header, found: BTreeMap::new(), units: BTreeMap::new(), heights, place };
        for (role, name) in options.columns.given() {
            let column = header.iter().position(|column| column == name);
            let column = column.ok_or_else(|| missing(header, role, &format!(" with the name `{name}`")))?;
            columns.found.insert((String::new(), role), column);
            // An unknown unit in the name of a given column is ignored.
            let unit = heading::stem_and_unit(name, Some(is_velocity(role))).1;
            let unit = unit.filter(|unit| is_angle(role) || heading::size_of(unit, is_velocity(role)).is_some());
            columns.units.extend(unit.map(|unit| (column, unit)));
        }
        Ok(columns)
    }

    /// Returns whether positions are read in degrees: the user names the columns, or no columns give metres.
    ///
    /// # Errors
    /// If the user names columns that would not be read.
    fn are_on_earth(&self, headings: &[(usize, Heading<'_>)]) -> Result<bool, Fault> {
        let is_given = |role: Role| self.get("", role).is_some();
        let gives = |role: Role| is_given(role) || headings.iter().any(|(_, found)| found.role == role);
        let chosen = is_given(EARTH) && is_given(EARTH + 1);
        let on_earth = chosen || gives(EARTH) && gives(EARTH + 1) && !(gives(POSITION) && gives(POSITION + 1));
        let unread = if on_earth { [POSITION, POSITION + 1] } else { [EARTH, EARTH + 1] };
        let given = unread.into_iter().find_map(|role| Some((role, self.get("", role)?)));
        let Some((role, column)) = given else { return Ok(on_earth) };
        let kind = if on_earth { "degrees" } else { "metres" };
        let given = COLUMN.set(format!("{}={}", ColumnNames::ROLES[role], self.header[column]));
        let problem = format!("{given} would be ignored, because the positions are read in {kind}");
        refuse(ContentKind::ContradictsOption, problem, "name the columns of either x and y, or lat and lon")
    }

    pub(super) fn get(&self, vehicle: &str, role: Role) -> Option<usize> {
        self.found.get(&(vehicle.to_owned(), role)).copied()
    }

    /// Returns the note on height columns recognised by name. Such heights point up, whatever the mapping of the other
    /// axes.
    ///
    /// # Errors
    /// If a height without a unit is beside columns of aircraft, whose heights are usually in feet.
    pub(super) fn heights_used(&self, layout: &Layout, options: &ReadOptions) -> Result<Option<String>, Fault> {
        let used = self.heights_of(layout);
        let Some((&first, &is_turned)) = used.first_key_value() else { return Ok(None) };
        let aircraft = aviation::column_of_aircraft(self.header, layout.id, first);
        if let Some(other) = aircraft.filter(|_| !self.units.contains_key(&first) && options.scale.is_none()) {
            let [height, other] = [&self.header[first], other].map(|name| quoted(name));
            let problem =
                format!("column {height} has no unit, and column {other} beside it occurs in data of aircraft");
            let remedy = format!(
                "data of aircraft have heights in feet or metres: give {} for feet or {} for metres, or put the unit \
                 into the name, as in `altitude_ft`",
                SCALE.set("0.3048"),
                SCALE.set("1")
            );
            return refuse(ContentKind::UnknownUnit, problem, remedy);
        }
        if self.place != EARTH {
            convention::refuse_turned_height(options, &self.header[first])?;
        }
        let names: Vec<_> = used.keys().map(|column| &self.header[*column]).collect();
        let turned = if is_turned { ", with opposite sign" } else { "" };
        let scale = options.metres();
        let unit = match self.units.get(&first) {
            None if aviation::is_state_vectors(self.header) && options.scale.is_none() => {
                ", in metres as in the state vectors of OpenSky".to_owned()
            }
            None if self.place == EARTH && scale != 1.0 => format!(", in units of {scale} m ({SCALE})"),
            None if self.place == EARTH => format!(", in metres: the name has no unit ({SCALE} sets another)"),
            _ => String::new(),
        };
        let columns = if used.len() > 1 { "columns" } else { "column" };
        Ok(Some(format!("heights are read from {columns} {}{turned}{unit}", list(&names, 12))))
    }

    /// Returns the columns that are read as heights by their names, and whether the sign is inverted.
    fn heights_of(&self, layout: &Layout) -> BTreeMap<usize, bool> {
        self.heights.among(layout.bodies.iter().filter_map(|body| body.position[2]))
    }

    /// Returns the facts on units, heights and names of vehicles that follow from the header and the options.
    fn facts(&self, layout: &Layout, options: &ReadOptions) -> Vec<Fact> {
        let mut facts = vec![layout.identity(self.header, options)];
        let lengths = layout.bodies.iter().flat_map(|body| body.position).flatten();
        let unit_of = |column: usize| self.units.get(&column).map(|unit| (*unit).to_owned());
        // Heights beside latitudes and longitudes may be in feet. Other numbers have one unit of length.
        let may_be_feet = layout.on_earth && !aviation::is_state_vectors(self.header);
        let unit = |kind: FactKind, unit: Option<String>| match (options.scale, unit) {
            (Some(_), _) => Fact::number(kind, Source::Declared, options.metres(), "m"),
            (None, Some(unit)) => Fact::name(kind, Source::Deduced, unit),
            (None, None) if kind == FactKind::HeightUnit && may_be_feet => Fact::name(kind, Source::Default, "m"),
            (None, None) => Fact::name(kind, Source::Convention, "m"),
        };
        if !layout.on_earth {
            facts.push(unit(FactKind::LengthUnit, lengths.clone().find_map(unit_of)));
        }
        let height = self.heights_of(layout).first_key_value().map(|(column, _)| *column);
        let third = layout.bodies.first().and_then(|body| body.position[2]);
        if let Some(column) = height.or(third.filter(|_| layout.on_earth)) {
            facts.push(unit(FactKind::HeightUnit, unit_of(column)));
            let (source, reference) = heading::height_reference(&self.header[column]);
            facts.push(Fact::name(FactKind::HeightReference, source, reference));
        }
        facts
    }

    pub(super) fn claim(&mut self, vehicle: &str, heading: &Heading<'a>, column: usize) -> Result<(), Fault> {
        let of_vehicle = if vehicle.is_empty() { String::new() } else { format!(" of `{vehicle}`") };
        self.units.extend(heading.unit.map(|unit| (column, unit)));
        let Some(first) = self.found.insert((vehicle.to_owned(), heading.role), column) else { return Ok(()) };
        let (first, second) = (&self.header[first], &self.header[column]);
        let problem = format!("the columns `{first}` and `{second}` both give {}{of_vehicle}", WORDS[heading.role]);
        let remedy = format!("name one of them with {COLUMN}, or remove the other");
        refuse(ContentKind::AmbiguousColumn, problem, remedy)
    }

    /// Finds the vehicles of a wide table; returns their names in order of appearance.
    pub(super) fn claim_wide(&mut self, headings: &[(usize, Heading<'a>)]) -> Result<Vec<String>, Fault> {
        let named: Vec<_> = headings.iter().filter(|(_, heading)| !heading.vehicle.is_empty()).collect();
        let vehicles: BTreeSet<_> = named.iter().map(|(_, heading)| heading.vehicle).collect();
        // If all vehicles are named by letters, `a` is one of them. Otherwise `a_x` is an acceleration.
        let sure = |heading: &Heading<'_>| !heading.ambiguous && !heading.is_numbered();
        let letters = named.iter().any(|(_, heading)| sure(heading));
        let words = named.iter().find(|(_, heading)| sure(heading) && heading.vehicle.len() > 1);
        let odd = named.iter().find(|(_, heading)| heading.ambiguous);
        if let (Some((odd, _)), Some((word, _))) = (odd, words) {
            let [odd, word] = [*odd, *word].map(|column| quoted(&self.header[column]));
            let problem = format!("column {odd} may belong to a vehicle, like {word}, or be another quantity");
            return refuse(ContentKind::AmbiguousColumn, problem, "give the column a longer name, or remove it");
        }
        let mut names: Vec<String> = Vec::new();
        // `cf1_v_x` is a velocity if there is a `cf1_x`.
        let of_another = |vehicle: &str| {
            let split = vehicle.rsplit_once(['.', '/', '_']).filter(|(_, letter)| heading::LETTERS.contains(letter));
            split.is_some_and(|(other, _)| vehicles.contains(other))
        };
        let is_vehicle = |heading: &Heading<'_>| (letters || !heading.ambiguous) && !of_another(heading.vehicle);
        for (column, heading) in named.into_iter().filter(|(_, heading)| is_vehicle(heading)) {
            let known = self.found.range((heading.vehicle.to_owned(), 0)..).next();
            if known.is_none_or(|((known, _), _)| known != heading.vehicle) {
                names.push(heading.vehicle.to_owned());
            }
            self.claim(heading.vehicle, heading, *column)?;
        }
        if names.is_empty() {
            let hint = " and none for its position (as `id`, `x`, `y`, or as `x1`, `y1`)";
            return Err(missing(self.header, ID, hint));
        }
        Ok(names)
    }

    /// Returns the columns of a vehicle. Requires x and y of the position; a velocity must have the same axes as the
    /// position.
    pub(super) fn body(&self, vehicle: &str) -> Result<VehicleColumns, Fault> {
        let of_vehicle = if vehicle.is_empty() { String::new() } else { format!(" of vehicle `{vehicle}`") };
        let axes = |role| [0, 1, 2].map(|axis| self.get(vehicle, role + axis));
        let (position, velocity) = (axes(self.place), axes(VELOCITY));
        let moves = velocity.iter().any(Option::is_some);
        for axis in 0..3 {
            let lacks = match (position[axis], velocity[axis]) {
                (None, moving) if axis < 2 || moving.is_some() => self.place,
                (Some(_), None) if moves => VELOCITY,
                _ => continue,
            };
            return Err(missing(self.header, lacks + axis, &of_vehicle));
        }
        Ok(VehicleColumns { position, velocity: moves.then_some(velocity), radius: self.get(vehicle, RADIUS) })
    }

    /// Returns the factor of each column by the unit in its name. If one length unit is not metres, all names need a
    /// unit and `--scale` is refused.
    pub(super) fn metres(&self, used: &[usize], scale: f64) -> Result<Vec<f64>, Fault> {
        let mut metres = vec![1.0; self.header.len()];
        let (mut other, mut silent) = (None, None);
        let lengths =
            self.found.iter().filter(|((_, role), column)| *role >= POSITION && used.binary_search(column).is_ok());
        for (&(_, role), &column) in lengths {
            let name = quoted(&self.header[column]);
            if is_angle(role) {
                let unit = self.units.get(&column).map_or("deg", |unit| *unit);
                metres[column] = heading::degrees(unit).ok_or_else(|| {
                    let problem = format!("column {name} has an unknown unit of angle, {}", quoted(unit));
                    let remedy = "write degrees, without a unit in the column name";
                    Fault::content(ContentKind::UnknownUnit, problem, remedy)
                })?;
                continue;
            }
            let Some(unit) = self.units.get(&column) else {
                silent = Some(name);
                continue;
            };
            let what = if is_velocity(role) { "velocity" } else { "length" };
            let size = heading::size_of(unit, is_velocity(role)).ok_or_else(|| {
                let problem = format!("column {name} has an unknown unit of {what}, {}", quoted(unit));
                let remedy = format!(
                    "use one of m, cm, mm, km, ft, in; or name the column with {COLUMN} and set its unit with {SCALE}"
                );
                Fault::content(ContentKind::UnknownUnit, problem, remedy)
            })?;
            metres[column] = size;
            if size != 1.0 {
                other = Some(name);
            }
        }
        for column in self.heights.downward() {
            metres[column] = -metres[column];
        }
        let Some(other) = other else {
            if self.place == EARTH {
                let is_length = |(_, role): &&(String, Role)| !is_angle(*role) && *role >= POSITION;
                let lengths: BTreeSet<_> =
                    self.found.iter().filter(|(key, _)| is_length(key)).map(|(_, column)| *column).collect();
                for column in lengths {
                    metres[column] *= scale;
                }
            }
            return Ok(metres);
        };
        if let Some(silent) = silent {
            let problem = format!("column {other} has a unit in its name, but column {silent} has none");
            let remedy = "put a unit into the name of each column, as in `x [mm]`";
            return refuse(ContentKind::UnitConflict, problem, remedy);
        }
        if scale != 1.0 {
            let given = SCALE.set(scale);
            let problem = format!("column {other} has a unit in its name, which contradicts {given}");
            let remedy = format!("omit {SCALE}, or remove the units from the header");
            return refuse(ContentKind::ContradictsOption, problem, remedy);
        }
        Ok(metres)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(header: &str) -> Result<Layout, Fault> {
        let header: Vec<_> = header.split(',').map(str::to_owned).collect();
        Layout::of(&header, &ReadOptions::default(), "alone")
    }

    fn at(columns: [usize; 3]) -> [Option<usize>; 3] {
        columns.map(Some)
    }

    #[test]
    fn long_header_is_read_in_any_order() {
        let layout = layout("z,Y [m],id,x,time_ms,vx,vy,vz,battery").expect("a layout");
        let body = VehicleColumns { position: at([3, 1, 0]), velocity: Some(at([5, 6, 7])), radius: None };
        assert_eq!((layout.time, layout.unit), (Some(4), Some(TimeUnit::Milliseconds)));
        assert_eq!((layout.id, layout.bodies), (Some(2), vec![body]));
        assert_eq!(layout.notes, ["columns not used: battery"]);
    }

    #[test]
    fn planar_motion_needs_no_velocity_along_z() {
        let body = layout("t,id,x,y,vx,vy").expect("a layout").bodies.remove(0);
        assert_eq!((body.position[2], body.velocity), (None, Some([Some(4), Some(5), None])));
    }

    #[test]
    fn wide_header_is_read_by_number_and_by_name() {
        for (header, vehicles) in [
            ("t,x1,y1,z1,x2,y2,z2", ["1", "2"]),
            ("t (s),cf1.x,cf1.y,cf1.z,Leader.x,Leader.y,Leader.z", ["cf1", "Leader"]),
            ("t,a_b_x,a_b_y,a_b_z,c/x,c/y,c/z", ["a_b", "c"]),
        ] {
            let Layout { id: None, names, bodies, .. } = layout(header).expect("a layout") else { panic!("{header}") };
            assert_eq!(names, vehicles, "{header}");
            assert_eq!([bodies[0].position, bodies[1].position], [at([1, 2, 3]), at([4, 5, 6])], "{header}");
        }
    }

    #[test]
    fn missing_and_repeated_columns_are_named() {
        let fault = |header: &str| layout(header).expect_err("refused").to_string();
        assert!(fault("id,x,y,z").contains("gives time"));
        assert!(fault("t,who,x,y,z").contains("gives the vehicle"));
        assert!(fault("t,id,x,z").contains("along y"));
        assert!(fault("t,x1,y1,z1,x2,z2").contains("along y of vehicle `2`"));
        assert!(fault("t,id,x,y,z,vx,vy").contains("velocity along z"));
        assert!(fault("t,id,x,y,z,vz").contains("velocity along x"));
        assert!(fault("t,id,x,y,vx,vy,vz").contains("position along z"));
        assert!(fault("t,a.x,a.y,a.z,a.vx,a.vy").contains("velocity along z of vehicle `a`"));
        assert!(fault("t,id,x,y,pos_x").contains("`x` and `pos_x` both give the position along x"));
    }
}

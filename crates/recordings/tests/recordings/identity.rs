//! Rows are assigned to the vehicle that they name, or the recording is refused.

use std::fmt::Write as _;
use std::fs;

use tautline_recordings::read::{Place, ReadError, ReadOptions};

use crate::messages::read_bytes;
use crate::recording::{Whole, assert_refused};

const AMBIGUOUS: &str = "recording/ambiguous-vehicle";
const SEVERAL: &str = "recording/several-vehicles";
const TWICE: &str = "recording/vehicle-twice";

fn read(text: &str) -> Result<Whole, ReadError> {
    read_bytes("flight.csv", text.as_bytes(), &ReadOptions::default())
}

fn by_column(text: &str, column: &str) -> Result<Whole, ReadError> {
    let mut options = ReadOptions::default();
    options.columns.set("id", column);
    read_bytes("flight.csv", text.as_bytes(), &options)
}

/// Reads a folder with these files.
fn folder(files: &[(&str, &str)]) -> Result<Whole, ReadError> {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, content) in files {
        fs::write(folder.path().join(name), content).expect("written");
    }
    Whole::read(folder.path(), &ReadOptions::default())
}

/// Asserts that a recording is refused with this code, and that the message or remedy contains these names.
#[track_caller]
fn is_refused(found: Result<Whole, ReadError>, code: &str, names: &[&str]) {
    let error = match found {
        Ok(whole) => panic!("read: {:?}, {:?}", whole.vehicles, whole.notes),
        Err(error) => error,
    };
    assert_eq!(error.code(), code, "{error}");
    let text = format!("{error}\n{}", error.help());
    for name in names {
        assert!(text.contains(name), "{text}\ninstead of {name}");
    }
}

/// Returns rows of several vehicles, 5 m apart, interleaved in time.
fn interleaved(header: &str, names: &[&str], times: usize) -> String {
    let mut text = format!("{header}\n");
    for row in 0..times * names.len() {
        let (vehicle, t) = (row % names.len(), row as f64 / 10.0);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{t},{},{},{}", names[vehicle], 0.3 * t, 5 * vehicle);
    }
    text
}

const ALONE: &str = "t,x,y\n0,50,50\n1,50,50\n2,50,50\n";

/// Names of vehicle columns.
const NAMES: [&str; 44] = [
    "mmsi",
    "icao24",
    "icao",
    "hex",
    "hexident",
    "sysid",
    "system_id",
    "tail",
    "tail_number",
    "callsign",
    "flight",
    "registration",
    "uav",
    "uas",
    "uav_id",
    "robot",
    "robot_name",
    "agent",
    "agent_id",
    "track",
    "track_id",
    "object",
    "object_id",
    "obj_id",
    "target",
    "vessel",
    "ship",
    "imo",
    "aircraft",
    "plane",
    "quad",
    "rover",
    "entity",
    "actor",
    "person_id",
    "ped_id",
    "pedestrian",
    "player",
    "node",
    "node_id",
    "tag",
    "model",
    "unit",
    "drone name",
];

#[test]
fn common_vehicle_column_names_are_recognised() {
    for name in NAMES {
        let header = format!("t,{name},x,y");
        let found = read(&interleaved(&header, &["205", "211"], 3)).expect(name);
        assert_eq!(found.vehicles, ["205", "211"], "{name}");
        // In a folder each file is one vehicle.
        let files = [("a.csv", &*interleaved(&header, &["205", "211"], 3)), ("b.csv", ALONE)];
        is_refused(folder(&files), SEVERAL, &["a.csv"]);
    }
    for header in ["t,valid,x,y", "t,idle,x,y", "t,width,x,y", "t,video,x,y"] {
        assert!(read(&interleaved(header, &["1", "2"], 3)).is_err(), "{header} names no vehicle");
    }
}

#[test]
fn vehicles_under_unknown_columns_are_not_merged() {
    let alone = ("b.csv", ALONE);
    for times in [2, 3, 40] {
        for names in [&["1", "2"][..], &["alpha", "bravo", "charlie"], &["7", "9", "11", "13"], &["1.0", "2.0"]] {
            let file = interleaved("t,whose,x,y", names, times);
            is_refused(folder(&[("a.csv", &file), alone]), SEVERAL, &["a.csv", "column=id=whose"]);
            // A known name column with a single value does not hide it.
            let file = interleaved("t,whose,x,y,id", names, times).replace('\n', ",cf1\n").replacen(",cf1", "", 1);
            is_refused(folder(&[("a.csv", &file), alone]), SEVERAL, &["`whose`"]);
        }
    }
    // The same in blocks of ten rows.
    let parts: Vec<_> = (0..200).map(|k| if k / 10 % 2 == 0 { "p" } else { "q" }).collect();
    let rows = parts.iter().enumerate().map(|(k, part)| format!("{k},{part},0,{}\n", if *part == "p" { 0 } else { 7 }));
    let file = format!("t_s,whose,x,y\n{}", rows.collect::<String>());
    is_refused(folder(&[("a.csv", &file), alone]), SEVERAL, &["`whose`"]);
    // The same in sequence, with time restarting.
    let file = "t,whose,x,y\n0,p,0,0\n1,p,0,0\n2,p,0,0\n0,q,9,0\n1,q,9,0\n2,q,9,0\n";
    is_refused(folder(&[("a.csv", file), alone]), SEVERAL, &["`whose`"]);
}

#[test]
fn measurements_are_not_vehicle_names() {
    let rows = |value: &dyn Fn(usize) -> String| {
        let place = |k: usize| (k as f64 / 9.0).sin();
        (0..200)
            .map(|k| format!("{},{},{},{}\n", k as f64 / 10.0, place(k), place(2 * k), value(k)))
            .collect::<Vec<_>>()
            .concat()
    };
    let odd: [&dyn Fn(usize) -> String; 7] = [
        &|k| (60 + k * 7 % 3).to_string(),
        &|k| if k / 20 % 2 == 0 { "AUTO".to_owned() } else { "LOITER".to_owned() },
        &|k| (k % 2).to_string(),
        &|k| (k % 256).to_string(),
        &|k| format!("12.{}", k * 7 % 3),
        &|k| k.to_string(),
        &|_| "iris".to_owned(),
    ];
    for value in odd {
        let file = format!("t,x,y,whose\n{}", rows(value));
        let found = folder(&[("a.csv", &file), ("b.csv", ALONE)]).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(found.vehicles, ["a", "b"]);
    }
}

const NUMBERED: &str = "id,timestamp,drone,x,y,z\n1,0.0,a,0,0,0\n2,0.0,b,2,0,0\n3,0.5,a,1,0,0\n4,0.5,b,1,0,0\n";

#[test]
fn row_numbers_are_not_vehicle_names() {
    is_refused(read(NUMBERED), AMBIGUOUS, &["`id`", "`drone`"]);
    is_refused(read(&NUMBERED.replace("drone", "whose")), AMBIGUOUS, &["`id`", "`whose`"]);
    assert_eq!(by_column(NUMBERED, "drone").expect("read").vehicles, ["a", "b"]);
    // Accepted for one instant of several vehicles, or if the user names the column.
    let instant = "t,id,x,y\n0,1,0,0\n0,2,5,0\n0,3,9,0\n";
    assert_eq!(read(instant).expect("read").vehicles.len(), 3);
    assert_eq!(by_column(NUMBERED, "id").expect("read").vehicles.len(), 4);
}

#[test]
fn contradictory_name_columns_are_refused() {
    let table = |rows: &[&str]| format!("t,id,callsign,x,y\n{}\n", rows.join("\n"));
    for rows in [
        // A value of one column belongs to two values of the other.
        &["0,1,A,0,0", "0,2,B,5,0", "1,1,B,0,0", "1,2,A,5,0"][..],
        &["0,1,A,0,0", "0.5,1,B,5,0", "1,1,A,0,0", "1.5,1,B,5,0"],
        &["0,1,A,0,0", "0,2,A,5,0", "0,3,B,9,0", "1,1,A,0,0"],
    ] {
        is_refused(read(&table(rows)), AMBIGUOUS, &["column=id=id or column=id=callsign"]);
        by_column(&table(&rows[..2]), "id").expect("the user says which");
    }
    for rows in [
        &["0,1,A,0,0", "0,2,B,5,0", "1,1,A,0,0", "1,2,B,5,0"][..],
        &["0,1,A,0,0", "0,2,A,5,0", "1,1,A,0,0", "1,2,A,5,0"],
        &["0,1,,0,0", "0,2,B,5,0", "1,1,A,0,0", "1,2,B,5,0"],
    ] {
        assert_eq!(read(&table(rows)).expect("read").vehicles, ["1", "2"]);
    }
}

#[test]
fn two_spellings_of_a_name_are_refused() {
    for [first, second] in
        [["1", "1.0"], ["Cf1", "cf1"], ["7", "007"], ["UAV-a", "uav-A"], ["cf1", "cf01"], ["cf-1", "cf_1"]]
    {
        let rows = format!("t,id,x,y\n0,{first},0,0\n0,b,5,0\n1,{second},0,0\n1,b,5,0\n");
        let quoted = [format!("`{first}`"), format!("`{second}`")];
        let error = read(&rows).expect_err("refused");
        assert_eq!(error.place, Some(Place::Line(4)), "{error}");
        is_refused(Err(error), TWICE, &[&quoted[0], &quoted[1]]);
        let wide = format!("t,{first}.x,{first}.y,{second}.x,{second}.y\n0,1,2,3,4\n");
        if !first.starts_with(|c: char| c.is_ascii_digit()) {
            is_refused(read(&wide), TWICE, &[]);
        }
        let (a, b) = (format!("{first}.csv"), format!("{second}.csv"));
        is_refused(folder(&[(&a, ALONE), (&b, ALONE)]), TWICE, &[]);
        // The same by the names in the rows of joined files.
        let file = |name: &str| format!("t,id,x,y\n0,{name},0,0\n1,{name},0,0\n");
        let files = [("p.csv", file(first)), ("q.csv", file(second)), ("r.csv", file("other"))];
        let files: Vec<_> = files.iter().map(|(name, text)| (*name, text.as_str())).collect();
        is_refused(folder(&files), TWICE, &["q.csv", "p.csv"]);
    }
    for [first, second] in [["1", "10"], ["cf1", "cf10"], ["4e5012", "4e5013"], ["3e0001", "30"], ["1.5", "1"]] {
        let rows = format!("t,id,x,y\n0,{first},0,0\n0,{second},5,0\n1,{first},0,0\n1,{second},5,0\n");
        assert_eq!(read(&rows).expect("read").vehicles.len(), 2, "{first} {second}");
    }
    // A name shared by all files is not a vehicle name.
    let file = "t,child_frame_id,x,y\n0,base_link,0,0\n1,base_link,0,0\n";
    assert_eq!(folder(&[("r1.csv", file), ("r2.csv", file)]).expect("read").vehicles, ["r1", "r2"]);
}

#[test]
fn decreasing_time_may_mean_several_vehicles_or_a_clock_change() {
    let options = ["column=id=NAME", "use sort"];
    is_refused(read("t,id,x,y\n0,a,0,0\n2,a,2,0\n1,a,1,0\n"), "recording/time-backwards", &options);
    let files = [("a.csv", "t,x,y\n0,0,0\n2,2,0\n1,1,0\n"), ("b.csv", ALONE)];
    is_refused(folder(&files), "recording/time-backwards", &options);
    // Sorting does not hide vehicles that a column distinguishes, unless the user overrides it.
    let merged = "t,whose,x,y\n0,p,0,0\n1,p,0,0\n2,p,0,0\n0,q,9,0\n1,q,9,0\n2,q,9,0\n";
    let files = tempfile::tempdir().expect("a folder");
    fs::write(files.path().join("a.csv"), merged).expect("written");
    fs::write(files.path().join("b.csv"), ALONE).expect("written");
    let sorted = ReadOptions { sort: true, ..ReadOptions::default() };
    is_refused(Whole::read(files.path(), &sorted), SEVERAL, &["`whose`", "use one_vehicle"]);
    fs::write(files.path().join("a.csv"), interleaved("t,whose,x,y", &["1", "2"], 3)).expect("written");
    is_refused(Whole::read(files.path(), &ReadOptions::default()), SEVERAL, &["`whose`", "use one_vehicle"]);
    let known = ReadOptions { one_vehicle: true, ..ReadOptions::default() };
    assert_eq!(Whole::read(files.path(), &known).expect("read").vehicles, ["a", "b"]);
}

/// Returns rows of team 1, with two crossing vehicles, and of team 2, with one vehicle far away.
fn teams(column: &str, serials: [&str; 2]) -> String {
    let mut text = format!("t,id,{column},x,y,z\n");
    for k in 0..=20 {
        let (t, x) = (f64::from(k) / 10.0, f64::from(k) / 2.0 - 5.0);
        let (later, back) = (t + 0.05, -x);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{t},1,{},{x},0,1\n{t},2,c,50,0,1\n{later},1,{},{back},0,1", serials[0], serials[1]);
    }
    text
}

#[test]
fn shared_vehicle_name_is_refused() {
    for (column, serials) in [("drone_serial", ["a", "b"]), ("whose", ["11", "12"]), ("whose", ["1.5", "2.5"])] {
        let table = teams(column, serials);
        is_refused(read(&table), SEVERAL, &["vehicle `1`", &format!("`{column}`")]);
        assert_eq!(by_column(&table, "id").expect("the user says so").vehicles.len(), 2);
    }
    // One vehicle per name, with a measurement that changes at the same rate.
    let steady = teams("whose", ["a", "b"]).lines().filter(|line| !line.contains(",b,")).collect::<Vec<_>>().join("\n");
    assert_eq!(read(&steady).expect("read").vehicles.len(), 2);
}

#[test]
fn repeated_columns_of_wide_tables_are_refused() {
    for header in ["t,A_x,A_y,A_z,A_x.1,A_y.1,A_z.1,C_x,C_y,C_z", "t,A.x,A.y,A.z,A.x.1,A.y.1,A.z.1,C.x,C.y,C.z"] {
        let table = format!("{header}\n0,-5,0,1,5,0,1,50,0,0\n1,0,0,1,0,0,1,50,0,0\n2,5,0,1,-5,0,1,50,0,0\n");
        is_refused(read(&table), "recording/ambiguous-column", &[]);
    }
    let other = "t,A_x,A_y,A_z,gain.1\n0,-5,0,1,5\n1,0,0,1,0\n2,5,0,1,-5\n";
    assert_eq!(read(other).expect("read").vehicles.len(), 1);
}

#[test]
fn fractional_vehicle_names_are_distinguished() {
    for count in [2, 3, 5, 10] {
        let names: Vec<_> = (1..=count).map(|k| format!("{k}.5")).collect();
        let names: Vec<_> = names.iter().map(String::as_str).collect();
        let file = interleaved("t,whose,x,y", &names, 40);
        is_refused(folder(&[("a.csv", &file), ("b.csv", ALONE)]), SEVERAL, &["`whose`"]);
    }
}

#[test]
fn column_groups_with_name_columns_use_these_names() {
    let head_on = |header: &str| {
        let rows = (0..10).map(|k| {
            let [low, high] = if k < 5 { [("a", k), ("b", 9 - k)] } else { [("b", 9 - k), ("a", k)] };
            format!("{k},{},{},0,0,{},{},0,0\n", low.0, low.1, high.0, high.1)
        });
        read(&format!("{header}\n{}", rows.collect::<String>()))
    };
    for header in [
        "t_s,id1,x1,y1,z1,id2,x2,y2,z2",
        "t_s,name_1,x_1,y_1,z_1,name_2,x_2,y_2,z_2",
        "t_s,track_id1,x1,y1,z1,track_id2,x2,y2,z2",
        "t_s,det/0/id,det/0/x,det/0/y,det/0/z,det/1/id,det/1/x,det/1/y,det/1/z",
        "t_s,m.id,m.x,m.y,m.z,n.id,n.x,n.y,n.z",
    ] {
        let found = head_on(header).expect(header);
        assert_eq!(found.vehicles, ["a", "b"], "{header}");
        let last = found.samples()[18..].to_vec();
        assert_eq!(last, [(9.0, "b", [0.0; 3]), (9.0, "a", [9.0, 0.0, 0.0])], "{header}");
    }
    let some = read("t,id1,x1,y1,x2,y2\n0,a,1,2,3,4\n").expect_err("one of two");
    assert_refused(&some, AMBIGUOUS, "line 1");
    let unnamed = read("t,id1,x1,y1,id2,x2,y2\n0,a,1,2,,3,4\n").expect_err("no name");
    assert_refused(&unnamed, "recording/empty-cell", "line 2");
    assert_eq!(read("t,id1,x1,y1,id2,x2,y2\n0,a,1,2,,,\n").expect("not seen").vehicles, ["a"]);
}

#[test]
fn columns_of_a_further_vehicle_are_refused() {
    for more in ["x 3,y 3,z 3", "x-3,y-3,z-3", "3x,3y,3z", "p3x,p3y,p3z", "xc,yc,zc", "x_c,y_c,z_c", "c:x,c:y,c:z"] {
        let error = read(&format!("t,x1,y1,z1,x2,y2,z2,{more}\n0,1,2,3,4,5,6,7,8,9\n")).expect_err(more);
        assert_refused(&error, "recording/ambiguous-column", "line 1");
    }
    for more in ["pos3[0],pos3[1],pos3[2]", "e3,n3,u3", "east3,north3,up3", "x{3},y{3},z{3}"] {
        assert!(read(&format!("t,x1,y1,z1,x2,y2,z2,{more}\n0,1,2,3,4,5,6,7,8,9\n")).is_err(), "{more}");
    }
    for more in ["gyro1_x,gyro1_y,gyro1_z", "qx1,qy1,qz1", "ax1,ay1,az1", "imu.x,imu.y,imu.z", "a_x,a_y,a_z"] {
        let found = read(&format!("t,x1,y1,z1,x2,y2,z2,{more}\n0,1,2,3,4,5,6,7,8,9\n")).expect(more);
        assert_eq!(found.vehicles, ["1", "2"], "{more}");
    }
}

#[test]
fn quantities_are_neither_names_nor_vehicles() {
    // Course over ground, vehicle type, attitudes and accelerations beside positions.
    for [first, second] in [["track", "model"], ["ax", "ay"], ["qx", "qy"], ["tx", "ty"], ["xdot", "ydot"]] {
        let header = format!("t_s,m.x,m.y,m.{first},m.{second},n.x,n.y,n.{first},n.{second}");
        let rows: Vec<_> = (0..4).map(|k| format!("{k},{k},0,{k}.5,1,9,{k},{k}.25,1")).collect();
        let found = read(&format!("{header}\n{}\n", rows.join("\n"))).expect(first);
        assert_eq!(found.vehicles, ["m", "n"], "{first}");
    }
    // Possible names are refused if they are exchanged between rows, or never repeat.
    let moved = "t_s,m.x,m.y,m.track,n.x,n.y,n.track\n0,0,0,a,9,0,b\n1,8,0,b,1,0,a\n";
    assert_refused(&read(moved).expect_err("change places"), AMBIGUOUS, "line 3");
    let new = "t_s,m.x,m.y,m.id,n.x,n.y,n.id\n0,0,0,1,9,0,2\n1,8,0,3,1,0,4\n2,8,0,5,1,0,6\n";
    assert_refused(&read(new).expect_err("numbers"), AMBIGUOUS, "");
}

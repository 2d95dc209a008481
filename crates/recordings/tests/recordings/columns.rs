//! Units and columns are read as named, or refused.

use std::fs;

use tautline_recordings::read::{Dimensions, ReadError, ReadOptions, TimeUnit};

use crate::recording::{Whole, assert_refused};

fn read_with(name: &str, content: &str, options: &ReadOptions) -> Result<Whole, ReadError> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    fs::write(&path, content).expect("written");
    Whole::read(&path, options)
}

fn read(content: &str) -> Result<Whole, ReadError> {
    read_with("flight.csv", content, &ReadOptions::default())
}

/// Returns a table of two rows whose cells are 1, then 2.
fn ones(header: &str) -> String {
    let row = |number: &str| vec![number; header.split(',').count()].join(",");
    format!("{header}\n{}\n{}\n", row("1"), row("2"))
}

/// Asserts that a table is refused with this code.
#[track_caller]
fn refused(content: &str, options: &ReadOptions, code: &str) {
    assert_refused(&read_with("flight.csv", content, options).expect_err(content), code, "line 1");
}

#[test]
fn length_units_in_names_are_applied() {
    for (header, metres) in [
        ("t,x1 [mm],y1 [mm],z1 [mm]", 0.001),
        ("t,a.x [mm],a.y [mm],a.z [mm]", 0.001),
        ("t,x_cm,y_cm,z_cm", 0.01),
        ("t,cf1_x_cm,cf1_y_cm,cf1_z_cm", 0.01),
        ("t,x (ft),y (ft),z (ft)", 0.3048),
        ("t,X[km],Y[km],Z[km]", 1000.0),
        ("t,x [m],y,z", 1.0),
        ("t,x_m,y_m,z_m", 1.0),
    ] {
        let whole = read(&ones(header)).unwrap_or_else(|error| panic!("{header}: {error}"));
        assert_eq!(whole.samples()[0].2, [metres; 3], "{header}");
    }
    let mixed = read(&ones("t,x [m],y [cm],z [mm],vx [km/h],vy [mm/s],vz_m_s,radius (cm)")).expect("read");
    let tautline_core::track::Item::Sample(sample) = &mixed.items[0] else { panic!("a piece") };
    assert_eq!(sample.position_m.as_slice(), [1.0, 0.01, 0.001]);
    assert_eq!(sample.velocity_m_s.map(|v| [v.x * 3.6, v.y, v.z]), Some([1.0, 0.001, 1.0]));
    assert_eq!(sample.radius_m, Some(0.01));
}

#[test]
fn unknown_and_contradictory_units_are_refused() {
    let scaled = ReadOptions { scale: Some(0.001.into()), ..ReadOptions::default() };
    let plain = ReadOptions::default();
    for (header, options, code) in [
        ("t,id,x [px],y [px],z [px]", &plain, "recording/unknown-unit"),
        ("t,x1 (deg),y1 (deg)", &plain, "recording/unknown-unit"),
        ("t,id,x,y,z,vx [mm],vy [mm],vz [mm]", &plain, "recording/unknown-unit"),
        ("t,x [mm],y [mm],z", &plain, "recording/unit-conflict"),
        ("t,id,x [mm],y [mm],radius", &plain, "recording/unit-conflict"),
        ("t,x [mm],y [mm]", &scaled, "recording/contradicts-option"),
    ] {
        refused(&ones(header), options, code);
    }
    // The unit in the name of a column given by the user applies too.
    for (east, north) in [("east [mm]", "north (mm)"), ("east_mm", "north_mm")] {
        let mut named = ReadOptions::default();
        assert!(named.columns.set("x", east) && named.columns.set("y", north));
        let whole = read_with("f.csv", &ones(&format!("t,id,{east},{north}")), &named).expect("read");
        assert_eq!(whole.samples()[0].2, [0.001, 0.001, 0.0]);
    }
    // Names in metres do not contradict a scale.
    assert_eq!(read_with("f.csv", &ones("t,x [m],y"), &scaled).expect("read").samples()[0].2, [0.001, 0.001, 0.0]);
    // Unused columns may have any unit.
    assert!(read(&ones("t,id,x,y,z,gyro_x [deg/s]")).is_ok());
}

#[test]
fn time_units_in_names_are_applied_or_refused() {
    let ms = read(&ones("Time [MS],x,y")).expect("read");
    assert_eq!((ms.clock.unit, ms.clock.inferred), ("ms", false));
    for header in ["time [min],x,y", "time (hours),id,x,y", "t_min,x1,y1", "timestamp [frames],x,y"] {
        refused(&ones(header), &ReadOptions::default(), "recording/unknown-unit");
    }
    let minutes = ReadOptions { times_per_second: Some(1.0 / 60.0), ..ReadOptions::default() };
    let whole = read_with("f.csv", &ones("time [min],x,y"), &minutes).expect("read");
    assert_eq!((whole.samples()[0].0, whole.samples()[1].0, whole.clock.inferred), (60.0, 120.0, false));
    let said = ReadOptions { time_unit: Some(TimeUnit::Seconds), ..ReadOptions::default() };
    assert_eq!(read_with("f.csv", &ones("time (utc),x,y"), &said).expect("read").samples()[1].0, 2.0);
}

#[test]
fn frame_numbers_require_a_rate() {
    for header in ["frame,id,x,y", "Frame Number,x1,y1", "frame_idx,x,y", "step,id,x,y"] {
        refused(&ones(header), &ReadOptions::default(), "recording/frames");
        let options = ReadOptions { times_per_second: Some(50.0), ..ReadOptions::default() };
        let whole = read_with("f.csv", &ones(header), &options).expect("read");
        assert_eq!(whole.samples()[1].0, 0.04, "{header}");
    }
    let mut named = ReadOptions::default();
    named.columns.set("t", "frame");
    refused(&ones("t,frame,id,x,y"), &named, "recording/frames");
    // Frame numbers beside a time are ignored.
    assert_eq!(read(&ones("frame,t,id,x,y")).expect("read").samples()[1].0, 2.0);
}

#[test]
fn quantities_are_not_vehicles() {
    for extra in [
        "gyro_x,gyro_y,gyro_z",
        "a_x,a_y,a_z",
        "v_x,v_y,v_z",
        "speed_x,speed_y,speed_z",
        "cf1/orientation/x,cf1/orientation/y,cf1/orientation/z",
        "1.acc.x,1.acc.y,1.acc.z",
        "imu0_x,imu0_y",
    ] {
        let whole =
            read(&ones(&format!("t,x1,y1,z1,x2,y2,z2,{extra}"))).unwrap_or_else(|error| panic!("{extra}: {error}"));
        assert_eq!(whole.vehicles, ["1", "2"], "{extra}");
        let unused = format!("columns not used: {}", extra.replace(',', ", "));
        assert!(whole.notes.contains(&unused), "{:?}", whole.notes);
        refused(&ones(&format!("t,{extra}")), &ReadOptions::default(), "recording/no-vehicle-column");
    }
    // If all vehicles are named by letters, `a` is one of them.
    assert_eq!(read(&ones("t,a_x,a_y,b_x,b_y")).expect("read").vehicles, ["a", "b"]);
    assert_eq!(read(&ones("t,a.x,a.y,v.x,v.y")).expect("read").vehicles, ["a", "v"]);
    let ambiguous = ones("t,cf1_x,cf1_y,cf2_x,cf2_y,a_x,a_y");
    refused(&ambiguous, &ReadOptions::default(), "recording/ambiguous-column");
}

#[test]
fn vehicles_inferred_from_column_names_are_noted() {
    let listed = |header: &str| {
        let notes = read(&ones(header)).expect("read").notes;
        notes.iter().find_map(|note| note.strip_prefix("vehicles by column names: ").map(str::to_owned))
    };
    assert_eq!(listed("t,cf1.x,cf1.y,home.x,home.y").as_deref(), Some("`cf1`, `home`"));
    assert_eq!(listed("t,x1,y1,x2,y2").as_deref(), Some("`1`, `2`"));
    assert_eq!(listed("t,x,y").as_deref(), Some("`flight`"));
    assert_eq!(listed("t,id,x,y"), None);
}

#[test]
fn repeated_columns_are_refused() {
    for header in [
        "t,px,py,pz,px.1,py.1,pz.1",
        "t,id,px,py,pz,px.1,py.1,pz.1",
        "t,x,y,z,x1,y1,z1",
        "t,x,y,x,y",
        "t,id,x,y,x_2,y_2",
        "t,id,x,y,x[1],y[1]",
    ] {
        refused(&ones(header), &ReadOptions::default(), "recording/ambiguous-column");
    }
    assert_eq!(read(&ones("t,x.1,y.1,x.2,y.2")).expect("read").vehicles, ["1", "2"]);
    assert_eq!(read(&ones("t,x[0],y[0],x[1],y[1]")).expect("read").vehicles, ["0", "1"]);
    assert_eq!(read(&ones("t,drone[0].x,drone[0].y")).expect("read").vehicles, ["drone[0]"]);
}

#[test]
fn ambiguous_plain_numbers_require_dimensions() {
    let text = |count: usize| format!("{}\n{}\n", vec!["0"; count].join(" "), vec!["1"; count].join(" "));
    let vehicles = |count, dimensions| {
        let options = ReadOptions { dimensions, ..ReadOptions::default() };
        read_with("flight.txt", &text(count), &options).map(|whole| whole.vehicles.len())
    };
    // Ten numbers may be three vehicles, or one with velocity and acceleration; eleven may be two with heading and
    // speed.
    for (count, ways) in [(5, "2 or 2+2"), (7, "2 or 3 or 3+3"), (10, "3"), (11, "2"), (13, "2 or 3 or 2+2 or 3+3")] {
        let error = vehicles(count, None).expect_err("asked");
        assert!(error.help().contains(&format!("use dimensions={ways}:")), "{}", error.help());
    }
    for (count, dimensions, expected) in [
        (4, Some(Dimensions::Space), 1),
        (10, Some(Dimensions::Space), 3),
        (3, None, 1),
        (7, Some(Dimensions::Space), 2),
        (7, Some(Dimensions::Plane), 3),
        (7, Some(Dimensions::SpaceVelocity), 1),
        (9, Some(Dimensions::PlaneVelocity), 2),
    ] {
        assert_eq!(vehicles(count, dimensions).expect("read"), expected, "{count} numbers");
    }
    assert!(vehicles(8, Some(Dimensions::Space)).is_err());
    let options = ReadOptions { dimensions: Some(Dimensions::Plane), ..ReadOptions::default() };
    let whole = read_with("flight.txt", &text(7), &options).expect("read");
    assert!(whole.notes.iter().any(|note| note.contains("of each of 3 vehicles")), "{:?}", whole.notes);
    assert!(read_with("flight.csv", &ones("t,x1,y1"), &options).is_err(), "a header says it");
}

#[test]
fn header_may_be_a_comment() {
    for content in [
        "# made up\n# t,id,x,y\n0,7,1,2\n",
        "#t id x y\n0 7 1 2\n",
        "# t, id, x, y\n0 7 1 2\n",
        "#t,id,x,y\n0,cf7,1,2\n",
    ] {
        let whole = read_with("flight.txt", content, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!((whole.vehicles[0].trim_start_matches("cf"), whole.samples()[0].2), ("7", [1.0, 2.0, 0.0]));
    }
    // A comment with the same number of words is not a header.
    assert!(read("# one two three four\n0,7,1,2\n").is_err());
}

#[test]
fn tuples_and_single_vehicle_tables_are_read() {
    let rvo = read_with("rvo.txt", "0 (1,2) (-3,4.5)\n0.25 (1.5, 2) (-3,4)\n", &ReadOptions::default()).expect("read");
    let samples = [(0.0, "1", [1.0, 2.0, 0.0]), (0.0, "2", [-3.0, 4.5, 0.0])];
    assert_eq!(rvo.samples()[..2], samples);
    assert_eq!(rvo.items.len(), 4);

    let tum = "# timestamp tx ty tz qx qy qz qw\n5 1 2 3 0 0 0.6 0.8\n6 1 2 4 0 0 0 1\n";
    let found = read_with("cf1.tum", tum, &ReadOptions::default()).expect("read");
    assert_eq!((found.vehicles.clone(), found.samples()[1].2), (vec!["cf1".to_owned()], [1.0, 2.0, 4.0]));
    assert!(read_with("no.tum", "5 1 2 3 9 9 9 9\n", &ReadOptions::default()).is_err(), "no attitude");

    let kitti = "1 0 0 7 0 1 0 8 0 0 1 9\n1 0 0 8 0 1 0 8 0 0 1 9\n";
    let asked = read_with("00.txt", kitti, &ReadOptions::default()).expect_err("no time");
    assert_refused(&asked, "recording/frames", "line 1");
    let options = ReadOptions { times_per_second: Some(10.0), ..ReadOptions::default() };
    let found = read_with("00.txt", kitti, &options).expect("read");
    assert_eq!(found.samples(), [(0.0, "00", [7.0, 8.0, 9.0]), (0.1, "00", [8.0, 8.0, 9.0])]);

    let one = read(&ones("t,x,y,z,vx,vy,vz,qx,qy,qz,qw,roll,gyro.x")).expect("read");
    assert_eq!(one.vehicles, ["flight"]);
    refused(&ones("t,who,x,y,z"), &ReadOptions::default(), "recording/no-vehicle-column");
}

#[test]
fn positions_of_messages_are_read_beside_a_column_of_vehicles() {
    let header = "header.stamp.sec,header.stamp.nanosec,child_frame_id,pose.position.x,pose.position.y,pose.position.z";
    let rows = "0,0,a,1,2,3\n0,0,b,4,5,6\n0,500000000,a,1,2,3\n0,500000000,b,4,5,6\n";
    let found = read(&format!("{header},twist.linear.x\n{}", rows.replace('\n', ",9\n"))).expect("read");
    assert_eq!(found.samples()[3], (0.5, "b", [4.0, 5.0, 6.0]));
    let nested = header.replace("pose.", "pose.pose.");
    assert_eq!(read(&format!("{nested}\n{rows}")).expect("read").samples(), found.samples());
    let plotted = "__time,/a/pose/position/x,/a/pose/position/y,/a/pose/position/z\n0,1,2,3\n0.5,1,2,3\n";
    assert_eq!(read(plotted).expect("read").samples()[1], (0.5, "/a/pose", [1.0, 2.0, 3.0]));
    // Negative twins: plain names come first, two plain names are refused, and other quantities are no positions.
    let both = read("t,id,x,y,pose.position.x,pose.position.y\n0,a,1,2,8,9\n1,a,1,2,8,9\n").expect("read");
    assert_eq!(both.samples()[0].2, [1.0, 2.0, 0.0]);
    refused(
        "t,id,pose.position.x,pose.pose.position.x,pose.position.y\n0,a,1,2,3\n",
        &ReadOptions::default(),
        "recording/ambiguous-column",
    );
    refused("t,id,twist.linear.x,twist.linear.y\n0,a,1,2\n", &ReadOptions::default(), "recording/no-position-column");
}

#[test]
fn degrees_have_several_names_and_units() {
    let table = |names: &str, degree: f64| {
        let [lat, lon] = [47.1, 8.2].map(|degrees: f64| (degrees / degree).round());
        let row = |time: u8, by: f64| format!("{time},a,{:?},{lon:?},400\n", lat + by / degree);
        read(&format!("t,id,{names}\n{}{}", row(0, 0.0), row(1, 1e-3)))
    };
    let north_m = |found: &Whole| found.samples()[1].2[1];
    let expected = north_m(&read("t,id,lat,lon,alt\n0,a,47.1,8.2,400\n1,a,47.101,8.2,400\n").expect("degrees"));
    for names in ["gps_lat_e7,gps_lon_e7,gps_alt", "lat_e7,lon_e7,alt", "geo_lat_e7,geo_lon_e7,geo_alt"] {
        assert!((north_m(&table(names, 1e-7).expect(names)) - expected).abs() < 0.01, "{names}");
    }
    for names in ["geo_lat,geo_lon,geo_alt", "wgs84_latitude,wgs84_longitude,alt", "geodetic_lat,geodetic_lon,alt"] {
        assert!(
            (north_m(&table(names, 1.0).expect(names)) - north_m(&table("lat,lon,alt", 1.0).expect("degrees"))).abs()
                < 1e-9,
            "{names}"
        );
    }
    // Negative twins: another power of ten, and degrees that are no place on the Earth.
    assert_eq!(table("lat_e6,lon_e6,alt", 1e-6).expect_err("unknown").code(), "recording/no-position-column");
    assert_eq!(table("lat,lon,alt", 1e-7).expect_err("too large").code(), "recording/not-on-earth");
}

#[test]
fn whole_numbers_beyond_doubles_name_vehicles_exactly() {
    let row = |time: f64, id: u64, x: u8| format!("{{\"t\": {time}, \"id\": {id}, \"x\": {x}, \"y\": 0, \"z\": 1}}\n");
    let (a, b) = (u64::MAX - 1, u64::MAX);
    let text: String = [0.0, 0.5].map(|time| row(time, a, 1) + &row(time, b, 9)).concat();
    let found = read_with("flight.jsonl", &text, &ReadOptions::default()).expect("read");
    assert_eq!(found.vehicles, [a.to_string(), b.to_string()]);
}

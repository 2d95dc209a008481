//! Tables of known data sets, single vehicles, tables with a row of units, and JSON lines.

use tautline_core::track::Item;
use tautline_recordings::read::{Dimensions, Format, ReadError, ReadOptions};

use crate::messages::read_bytes;
use crate::recording::{Whole, assert_refused};

fn read(name: &str, text: &str) -> Result<Whole, ReadError> {
    read_bytes(name, text.as_bytes(), &ReadOptions::default())
}

fn whole(name: &str, text: &str) -> Whole {
    read(name, text).unwrap_or_else(|error| panic!("{error}\n{}\n{text}", error.help()))
}

#[test]
fn euroc_ground_truth_is_read() {
    let text = concat!(
        "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [],",
        " q_RS_z [], v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1],",
        " b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2],",
        " b_a_RS_S_z [m s^-2]\n",
        "1403636580838555648,4.6,-1.7,0.7,0.5,-0.1,-0.8,-0.1,-0.02,0.03,0.8,0,0,0,0,0,0\n",
        "1403636580843555328,4.6,-1.7,0.8,0.5,-0.1,-0.8,-0.1,-0.02,0.03,0.8,0,0,0,0,0,0\n",
    );
    let found = whole("data.csv", text);
    assert_eq!((found.vehicles.clone(), found.clock.unit), (vec!["data".to_owned()], "ns"));
    let Item::Sample(sample) = &found.items[1] else { panic!("a piece") };
    assert_eq!(sample.position_m.as_slice(), [4.6, -1.7, 0.8]);
    assert_eq!(sample.velocity_m_s.map(Into::into), Some([-0.02, 0.03, 0.8]));
    assert_eq!(found.clock.epoch_ns, 1_403_636_580_000_000_000);
    assert_eq!(sample.time_s, 0.843_555_328);
}

#[test]
fn single_vehicle_table_is_read_without_a_folder() {
    let text = "t_s,x,y,z,eph,mode\n0,1,2,3,0.5,4\n1,1,2,4,0.5,4\n";
    let error = read("cf1.csv", text).expect_err("any column may name vehicles");
    assert_refused(&error, "recording/no-vehicle-column", "line 1");
    assert!(error.help().ends_with("use one_vehicle"), "{}", error.help());
    let one = ReadOptions { one_vehicle: true, ..ReadOptions::default() };
    let found = read_bytes("cf1.csv", text.as_bytes(), &one).expect("read");
    assert_eq!(found.samples(), [(0.0, "cf1", [1.0, 2.0, 3.0]), (1.0, "cf1", [1.0, 2.0, 4.0])]);
    // Two vehicles in one table show by two positions at one time.
    let two = "t_s,x,y,z,mode\n0,1,2,3,4\n0,5,6,7,4\n";
    let error = read_bytes("cf1.csv", two.as_bytes(), &one).expect_err("two");
    assert_refused(&error, "recording/duplicate-row", "line 3");
    for several in ["t,id,x,y\n0,a,1,2\n", "t,x1,y1,x2,y2\n0,1,2,3,4\n"] {
        let error = read_bytes("f.csv", several.as_bytes(), &one).expect_err("named");
        assert_refused(&error, "recording/contradicts-option", "line 1");
    }
    let mcap = ReadOptions { one_vehicle: true, format: Some(Format::SKYBRUSH), ..ReadOptions::default() };
    assert_refused(&read_bytes("a.json", b"{}", &mcap).expect_err("a show"), "recording/unused-option", "");
}

#[test]
fn trajnet_is_recognised_only_if_unambiguous() {
    let text = "780\t1\t8.46\t3.59\n790\t1\t9.57\t3.79\n790\t2\t1.5\t2.5\n";
    let error = read("biwi_eth.txt", text).expect_err("how long is a frame?");
    assert_refused(&error, "recording/frames", "line 1");
    let fps = ReadOptions { times_per_second: Some(25.0), ..ReadOptions::default() };
    let found = read_bytes("biwi_eth.txt", text.as_bytes(), &fps).expect("read");
    let expected = [(31.2, "1", [8.46, 3.59, 0.0]), (31.6, "1", [9.57, 3.79, 0.0]), (31.6, "2", [1.5, 2.5, 0.0])];
    assert_eq!(found.samples(), expected);
    // With one vehicle per frame, the numbers may also be a time, x, y and z: the user must choose.
    let single = "0 1 2 3\n10 1 2 4\n";
    let error = read("t.txt", single).expect_err("two meanings");
    assert_refused(&error, "recording/ambiguous-layout", "");
    let space = ReadOptions { dimensions: Some(Dimensions::Space), ..ReadOptions::default() };
    assert_eq!(read_bytes("t.txt", single.as_bytes(), &space).expect("read").samples()[1].2, [1.0, 2.0, 4.0]);
    assert_eq!(whole("t.txt", "0 1 2 3\n10 1.5 2 4\n").samples()[1].2, [1.5, 2.0, 4.0], "no number of a vehicle");
    let said = ReadOptions { format: Some(Format::TRAJNET), ..fps.clone() };
    assert_eq!(read_bytes("t.txt", single.as_bytes(), &said).expect("read").samples()[1], (0.4, "1", [2.0, 4.0, 0.0]));
    let named = read_bytes("t.csv", b"t,id,x,y\n0,1,2,3\n", &said).expect_err("a header");
    assert_refused(&named, "recording/wrong-format", "line 1");
    // A repeated vehicle in a frame, or a name that is not an integer, excludes TrajNet.
    for text in ["0 1 2 3\n0 1 2 4\n", "0 1.5 2 3\n0 2.5 2 4\n"] {
        assert_refused(&read("t.txt", text).expect_err("twice"), "recording/duplicate-row", "line 2");
    }
}

#[test]
fn units_row_is_applied() {
    for units in ["ms,-,mm,mm,mm,rad", "[ms],[],[mm],[mm],[mm],[rad]", "(ms),,(mm),(mm),(mm),"] {
        let found =
            whole("f.csv", &format!("t,id,x,y,z,yaw\n{units}\n500,a,1000,2000,3000,0\n1000,a,1000,2000,3000,0\n"));
        assert_eq!(found.samples()[0], (0.5, "a", [1.0, 2.0, 3.0]), "{units}");
        assert!(!found.clock.inferred, "{units}");
    }
    let split =
        whole("f.csv", "sec,nsec,id,x_mm,y_mm,vx_m_s,vy_m_s\ns,ns,-,mm,mm,m/s,m/s\n1,500000000,a,1000,2000,1,2\n");
    assert_eq!(split.samples(), [(1.5, "a", [1.0, 2.0, 0.0])]);
    let wide = whole("f.csv", "t,x1,y1\ns,cm,cm\n1,200,300\n");
    assert_eq!(wide.samples(), [(1.0, "1", [2.0, 3.0, 0.0])]);
    let error = read("f.csv", "t,id,x [m],y\ns,-,mm,mm\n0,a,1,2\n").expect_err("two units");
    assert_refused(&error, "recording/unit-conflict", "line 2");
    let error = read("f.csv", "t,id,x,y\ns,-,px,px\n0,a,1,2\n").expect_err("no length");
    assert_refused(&error, "recording/unknown-unit", "line 1");
    // Any other row below the header is an ordinary, invalid row.
    let error = read("f.csv", "t,id,x,y\nlater,-,m,m\n0,a,1,2\n").expect_err("no unit");
    assert_refused(&error, "recording/not-a-number", "line 2");
    assert_refused(&read("f.csv", "t,id,x,y\ns,-,m,m\n").expect_err("nothing"), "recording/empty", "");
}

#[test]
fn json_lines_are_rows() {
    let long = concat!(
        "{\"t\": 0, \"id\": \"a\", \"x\": 1, \"y\": 2, \"z\": 3}\n",
        "\n",
        "{\"id\": \"b\", \"t\": 0.5, \"z\": 6, \"y\": 5, \"x\": 4}\n",
    );
    let expected = [(0.0, "a", [1.0, 2.0, 3.0]), (0.5, "b", [4.0, 5.0, 6.0])];
    assert_eq!(whole("f.jsonl", long).samples(), expected);
    let nested = concat!(
        "{\"t\": 0, \"id\": \"a\", \"position\": {\"x\": 1, \"y\": 2, \"z\": 3}}\n",
        "{\"t\": 0.5, \"id\": \"b\", \"position\": {\"x\": 4, \"y\": 5, \"z\": 6}}\n",
    );
    assert_eq!(whole("f.ndjson", nested).samples(), expected);
    let listed = "{\"t\": 0, \"id\": \"a\", \"pos\": [1, 2, 3]}\n{\"t\": 0.5, \"id\": \"b\", \"pos\": [4, 5, 6]}\n";
    assert_eq!(whole("f.jsonl", listed).samples(), expected);
    let wide = concat!(
        "{\"t\": 0, \"a\": {\"x\": 1, \"y\": 2}, \"b\": null}\n",
        "{\"t\": 1, \"a\": {\"x\": 1, \"y\": 2}, \"b\": {\"x\": 3, \"y\": 4}}\n",
    );
    assert_eq!(whole("f.jsonl", wide).samples().len(), 3, "b is not seen at first");
    let exact = concat!(
        "{\"t\": 1700000000.1234567, \"id\": \"a\", \"x\": 1, \"y\": 2}\n",
        "{\"t\": 1700000001, \"id\": \"a\", \"x\": 1, \"y\": 2}\n",
    );
    assert_eq!(whole("f.jsonl", exact).samples()[0].0, 0.123_456_7);
}

#[test]
fn json_lists_of_changing_length_must_name_vehicles() {
    let nameless = concat!(
        "{\"t\": 0, \"d\": [{\"x\": 0, \"y\": 0}, {\"x\": 5, \"y\": 0}]}\n",
        "{\"t\": 0.5, \"d\": [{\"x\": 5, \"y\": 0}]}\n",
    );
    let error = read("f.jsonl", nameless).expect_err("ambiguous");
    assert_refused(&error, "recording/list-length", "line 2");
    let named = concat!(
        "{\"t\": 0, \"d\": [{\"id\": \"a\", \"x\": 0, \"y\": 0}, {\"id\": \"b\", \"x\": 5, \"y\": 0}]}\n",
        "{\"t\": 0.5, \"d\": [{\"id\": \"b\", \"x\": 5, \"y\": 0}]}\n",
    );
    let found = whole("f.jsonl", named);
    assert_eq!(found.samples()[1..], [(0.0, "b", [5.0, 0.0, 0.0]), (0.5, "b", [5.0, 0.0, 0.0])]);
    let posed = concat!(
        "{\"t\": 0, \"d\": [{\"id\": \"a\", \"pose\": {\"x\": 0, \"y\": 0}}, {\"id\": \"b\", ",
        "\"pose\": {\"x\": 5, \"y\": 0}}]}\n",
        "{\"t\": 0.5, \"d\": [{\"id\": \"b\", \"pose\": {\"x\": 5, \"y\": 0}}]}\n",
    );
    assert_eq!(whole("f.jsonl", posed).samples()[2], (0.5, "b", [5.0, 0.0, 0.0]));
    // Null elements, empty or missing lists and numeric keys are unambiguous.
    let two = "[{\"x\": 0, \"y\": 0}, {\"x\": 5, \"y\": 0}]";
    for more in ["[{\"x\": 0, \"y\": 0}, null]", "[]", "null"] {
        let text = format!("{{\"t\": 0, \"d\": {two}}}\n{{\"t\": 0.5, \"d\": {more}}}\n{{\"t\": 1, \"d\": {two}}}\n");
        assert_eq!(whole("f.jsonl", &text).vehicles, ["d.0", "d.1"], "{more}");
    }
    let keyed = concat!(
        "{\"t\": 0, \"d\": {\"7\": {\"x\": 0, \"y\": 0}, \"12\": {\"x\": 5, \"y\": 0}}}\n",
        "{\"t\": 0.5, \"d\": {\"7\": {\"x\": 0, \"y\": 0}}}\n",
    );
    assert_eq!(whole("f.jsonl", keyed).samples().len(), 3);
}

#[test]
fn invalid_json_objects_are_refused_with_their_line() {
    let first = "{\"t\": 0, \"id\": \"a\", \"x\": 1, \"y\": 2}\n";
    for (second, code) in [
        ("{\"t\": 1, \"id\": \"a\", \"x\": 1, \"y\": NaN}\n", "recording/malformed"),
        ("{\"t\": 1, \"t\": 2, \"id\": \"a\", \"x\": 1, \"y\": 2}\n", "recording/malformed"),
        ("{\"t\": 1, \"id\": \"a\", \"x\": 1", "recording/malformed"),
        ("{\"t\": 1, \"id\": \"a\", \"x\": 1, \"y\": \"two\"}\n", "recording/not-a-number"),
        ("{\"t\": 1, \"id\": \"a\", \"x\": 1}\n", "recording/empty-cell"),
        ("{\"id\": \"a\", \"x\": 1, \"y\": 2}\n", "recording/empty-cell"),
    ] {
        let error = read("f.jsonl", &format!("{first}{second}")).expect_err(code);
        assert_refused(&error, code, "line 2");
    }
}

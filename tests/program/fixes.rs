//! Positions of a receiver without a fix are gaps.

use std::fs;

use crate::program::{TAUTLINE, ran_by};

#[test]
fn fixes_at_zero_and_zero_are_gaps_that_are_counted() {
    let folder = tempfile::tempdir().expect("a folder");
    let audit = |rows: &dyn Fn(i32) -> String| {
        let lines: Vec<_> = (0..10).map(|t| format!("{t},a,47,8,400\n{t},b,{}\n", rows(t))).collect();
        let text = lines.concat();
        fs::write(folder.path().join("gps.csv"), format!("t_s,id,lat,lon,alt\n{text}")).expect("written");
        ran_by(TAUTLINE, folder.path(), &["audit", "gps.csv", "--delta", "1"])
    };
    let there = audit(&|_| "47.001,8,400".to_owned());
    assert!(there.exit == Some(0) && !there.err.contains("fix"), "{there:?}");
    let lost = audit(&|t| if t == 4 { "0,0,0".to_owned() } else { "47.001,8,400".to_owned() });
    assert_eq!(lost.exit, Some(1), "{lost:?}");
    assert!(lost.out.starts_with("UNDECIDED: b was not seen from 3.000 s to 5.000 s"), "{lost:?}");
    assert!(lost.err.contains("1 position of `b` omitted for lack of a fix"), "{lost:?}");
    let limited = ran_by(TAUTLINE, folder.path(), &["audit", "gps.csv", "--limit", "climb=5,speed=1"]);
    assert!(limited.out.starts_with("UNDECIDED"), "{limited:?}");
}

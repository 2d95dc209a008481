//! `tautline render`, `tautline view` and the pictures of a run: files, texts and exit codes.
//!
//! Needs a graphics adapter, or a software driver; `tests/run.sh` installs one.

use std::fs;
use std::path::Path;

use crate::program::{Ran, TAUTLINE, ran_by};
use tautline::mcap::{Header, McapRecorder};
use tempfile::TempDir;

const GOOD: Option<i32> = Some(0);
const WRONG_INPUT: Option<i32> = Some(2);
const MACHINE_FAILED: Option<i32> = Some(3);

fn ran(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, arguments)
}

/// Returns a folder with the run of a short flight in `out`.
fn flown(scenario: &str, more: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let base = ["run", scenario, "--out", "out", "--quiet", "--set", "time.duration_s=4"];
    let Ran { exit, err, .. } = ran(folder.path(), &[&base, more].concat());
    assert!(exit <= Some(1), "{err}");
    folder
}

fn size_of(path: &Path) -> [u32; 2] {
    let bytes = fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    assert!(bytes.starts_with(b"\x89PNG"), "{}", path.display());
    [16, 20].map(|at| u32::from_be_bytes(bytes[at..at + 4].try_into().expect("four bytes")))
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut names: Vec<_> =
        entries.map(|entry| entry.expect("an entry").file_name().into_string().expect("UTF-8")).collect();
    names.sort();
    names
}

#[test]
fn a_comparison_shows_the_closest_approach_of_each_law() {
    let folder = tempfile::tempdir().expect("a folder");
    let what = ["compare", "pentagon", "--laws", "edge-tension,laplacian", "--runs", "2", "--set", "time.duration_s=6"];
    let Ran { exit, err, .. } = ran(folder.path(), &[&what[..], &["--html", "c.html", "--quiet"]].concat());
    assert_eq!((exit, err.as_str()), (GOOD, ""));
    let page = fs::read_to_string(folder.path().join("c.html")).expect("a page");
    let captions: Vec<_> = page
        .split("<figcaption>")
        .filter(|caption| caption.contains(", the closest of 2 flights (start.seed "))
        .collect();
    assert_eq!(captions.len(), 2);
    for (caption, expected) in captions.iter().zip(["edge-tension: 2.4", "laplacian: 1.5"]) {
        assert!(caption.starts_with(expected), "{caption}");
    }
    assert!(page.len() < 1 << 20, "{} bytes", page.len());
}

#[test]
fn a_run_writes_pictures_and_shows_them_on_its_page() {
    let folder = flown("pentagon-laplacian", &[]);
    let out = folder.path().join("out");
    assert_eq!(names(&out.join("snapshots")), ["closest.png", "end.png", "start.png", "violation-1.png"]);
    assert_eq!(size_of(&out.join("snapshots/closest.png")), [1280, 800]);
    let page = fs::read_to_string(out.join("report.html")).expect("a page");
    assert_eq!(page.matches("data:image/png;base64,").count(), 4);
    assert!(page.contains("Vehicles 4 and 5 were closer than delta from"), "the violation is described in words");

    // A run without pictures removes those of the run before.
    let again = ["run", "pentagon", "--out", "out", "--force", "--no-snapshots", "--set", "time.duration_s=1"];
    ran(folder.path(), &again);
    assert_eq!(names(&out.join("snapshots")), Vec::<String>::new());
    assert!(!fs::read_to_string(out.join("report.html")).expect("a page").contains("data:image/png"));
}

#[test]
fn a_run_refuses_an_adapter_that_does_not_exist_unless_it_takes_no_pictures() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = ["run", "pentagon", "--out", "out", "--adapter", "no such adapter", "--set", "time.duration_s=1"];
    let Ran { exit, err, .. } = ran(folder.path(), &run);
    assert_eq!(exit, Some(2), "{err}");
    assert!(err.contains("there is no `no such adapter` adapter; there are: "), "{err}");
    assert!(!folder.path().join("out").exists(), "nothing was flown");
    let Ran { exit, err, .. } = ran(folder.path(), &[&run[..], &["--no-snapshots"]].concat());
    assert_eq!(exit, Some(1), "{err}");
    assert!(folder.path().join("out/report.html").exists(), "{err}");
}

#[test]
fn the_rate_of_a_recording_is_not_that_of_a_film() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("two.csv"), "t_s,id,x,y,z\n0,a,0,0,0\n0,b,9,0,0\n1,a,0,1,0\n1,b,9,1,0\n")
        .expect("written");
    let film = ["render", "two.csv", "--film", "film.gif", "--size", "64x48"];
    let refused = ran(folder.path(), &[&film[..], &["--fps", "30"]].concat());
    assert!(refused.exit == Some(2) && refused.err.contains("--film-fps sets the rate of a film"), "{}", refused.err);
    let other = ran(folder.path(), &["render", "none.csv", "--fps", "30"]);
    assert!(other.exit == Some(2) && !other.err.contains("--film-fps"), "{}", other.err);
}

#[test]
fn render_without_a_driver_draws_by_itself() {
    let folder = flown("pentagon", &["--no-snapshots"]);
    let run = |more: &[&str]| {
        let done = std::process::Command::new(TAUTLINE)
            .args([&["render", "out/run.mcap", "--size", "320x180"], more].concat())
            .current_dir(folder.path())
            // The loader finds no Vulkan driver; OpenGL is not enough.
            .env("VK_DRIVER_FILES", "/nonexistent.json")
            .env("VK_ICD_FILENAMES", "/nonexistent.json")
            .output()
            .expect("the program runs");
        (
            done.status.code(),
            [done.stdout, done.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat(),
        )
    };
    let (exit, text) = run(&[]);
    assert_eq!(exit, GOOD, "{text}");
    assert!(text.contains("drawn by the program itself, without a graphics adapter"), "{text}");
    assert_eq!(size_of(&folder.path().join("out/snapshots/start.png")), [320, 180]);
    let (exit, text) = run(&["--adapter", "hardware"]);
    assert_eq!(exit, MACHINE_FAILED, "{text}");
    assert!(text.contains("no graphics adapter") && text.contains("mesa-vulkan-drivers"), "{text}");
}

#[test]
fn two_scenarios_are_drawn_side_by_side() {
    let folder = tempfile::tempdir().expect("a folder");
    let flights = ["render", "pentagon-laplacian", "--beside", "pentagon", "--size", "321x90", "--adapter", "none"];
    let film = ["--film", "both.gif", "--film-fps", "5", "--until", "2", "--at", "2"];
    let Ran { exit, err, .. } = ran(folder.path(), &[&flights[..], &film].concat());
    assert_eq!(exit, GOOD, "{err}");
    let gif = fs::File::open(folder.path().join("both.gif")).expect("a film");
    let mut decoder = gif::DecodeOptions::new().read_info(gif).expect("a GIF");
    let mut frames = 0;
    while decoder.read_next_frame().expect("a frame").is_some() {
        frames += 1;
    }
    assert_eq!(([decoder.width(), decoder.height()], frames), ([320, 90], 11));
    assert_eq!(size_of(&folder.path().join("out/pentagon-laplacian/snapshots/at-2.000s.png")), [320, 90]);
    let Ran { exit, err, .. } = ran(folder.path(), &["render", "pentagon", "--until", "1e9", "--film", "a.gif"]);
    assert_eq!(exit, WRONG_INPUT);
    assert!(err.contains("--until: must be from 0 s to 120 s"), "{err}");
}

#[test]
fn a_mission_has_a_picture_of_each_leg() {
    let folder = flown("obstacles", &["--adapter", "none", "--set", "time.duration_s=60"]);
    let names = names(&folder.path().join("out/snapshots"));
    assert_eq!(names, ["closest.png", "end.png", "leg-1.png", "start.png"]);
}

#[test]
fn every_kind_of_picture_is_written_to_its_target() {
    let folder = flown("pentagon", &["--no-snapshots"]);
    let render = |more: &[&str]| {
        let arguments = [&["render", "out/run.mcap", "--size", "160x90"], more].concat();
        let Ran { exit, err, .. } = ran(folder.path(), &arguments);
        assert_eq!(exit, GOOD, "{more:?}: {err}");
    };
    let at = |name: &str| folder.path().join(name);
    render(&[]);
    assert_eq!(names(&at("out/snapshots")), ["closest.png", "end.png", "start.png"]);
    render(&["--at", "start,1.5", "--out", "a", "--camera", "top", "--theme", "light"]);
    assert_eq!(names(&at("a")), ["at-1.500s.png", "start.png"]);
    assert_eq!(size_of(&at("a/start.png")), [160, 90]);
    render(&["--every", "1", "--out", "b", "--camera", "-60,30,25"]);
    assert_eq!(names(&at("b")), (1..=5).map(|k| format!("frame-0000{k}.png")).collect::<Vec<_>>());
    render(&["--sheet", "3x2", "--out", "c"]);
    assert_eq!(size_of(&at("c/sheet.png")), [159, 90]);
    let films: &[_] = if cfg!(feature = "film") { &["d.mp4", "d.gif"] } else { &["d.gif"] };
    for film in films {
        render(&["--film", film, "--film-fps", "5"]);
        assert!(fs::metadata(at(film)).expect(film).len() > 1000, "{film}");
    }
    let gif = fs::File::open(at("d.gif")).expect("a film");
    let mut decoder = gif::DecodeOptions::new().read_info(gif).expect("a GIF");
    let mut frames = 0;
    while decoder.read_next_frame().expect("a frame").is_some() {
        frames += 1;
    }
    assert_eq!(frames, 21, "4 s at 5 pictures per second, both ends included");
}

#[test]
fn invalid_requests_are_refused_with_a_remedy() {
    let folder = flown("pentagon", &["--no-snapshots"]);
    let header = Header::new("empty", "", 2, 1.0);
    McapRecorder::create(&folder.path().join("empty.mcap"), &header).expect("a file").finish().expect("closed");
    fs::write(folder.path().join("noise.mcap"), b"this is not a recording").expect("written");
    fs::write(folder.path().join("a-file"), b"").expect("written");
    fs::create_dir(folder.path().join("folder.mp4")).expect("a folder");
    // Arguments after `render`, exit code, part of the message.
    let cases: &[(&[&str], Option<i32>, &str)] = &[
        (&["out/run.mcap", "--size", "0x10"], WRONG_INPUT, "each at least 1"),
        (&["out/run.mcap", "--size", "10"], WRONG_INPUT, "such as 1280x720"),
        (&["out/run.mcap", "--size", "100000x100000"], WRONG_INPUT, "pixels a side"),
        (&["out/run.mcap", "--camera", "isometric"], WRONG_INPUT, "`isometric` is not a camera"),
        (&["out/run.mcap", "--camera", "follow:9"], WRONG_INPUT, "there is no vehicle `9` to follow"),
        (&["out/run.mcap", "--camera", "0,100,5"], WRONG_INPUT, "an elevation that is not between"),
        (&["out/run.mcap", "--theme", "pink"], WRONG_INPUT, "[possible values: dark, light]"),
        (&["out/run.mcap", "--at", "5"], WRONG_INPUT, "--at: must be from 0 s to 4 s, got 5 s"),
        (&["out/run.mcap", "--at", "soon"], WRONG_INPUT, "`soon` is not a time"),
        (&["out/run.mcap", "--at", "nan"], WRONG_INPUT, "`nan` is not a time"),
        (&["out/run.mcap", "--at", "-1"], WRONG_INPUT, "--at: must be from 0 s to 4 s, got -1 s"),
        (&["out/run.mcap", "--every", "0"], WRONG_INPUT, "--every: must be more than 0, got 0"),
        (&["out/run.mcap", "--every", "-1"], WRONG_INPUT, "--every: must be more than 0, got -1"),
        (&["out/run.mcap", "--delta", "-1"], WRONG_INPUT, "--delta: must be more than 0 and at most"),
        (&["out/run.mcap", "--delta", "1e300"], WRONG_INPUT, "got 1e300"),
        (&["out/run.mcap", "--delta", "2.6"], WRONG_INPUT, "judged by its own delta, 2 m"),
        (
            &["out/run.mcap", "--scale", "0.001"],
            WRONG_INPUT,
            "options for reading: have no effect on a recording of tautline",
        ),
        (&["out/run.mcap", "--every", "1e-9"], WRONG_INPUT, "at most 100000 pictures"),
        (&["out/run.mcap", "--sheet", "4"], WRONG_INPUT, "such as 4x3"),
        (&["out/run.mcap", "--sheet", "4000x4"], WRONG_INPUT, "do not fit into"),
        (&["out/run.mcap", "--sheet", "10x10", "--size", "60000x60000"], WRONG_INPUT, "pixels a side"),
        (&["out/run.mcap", "--film", "film.avi"], WRONG_INPUT, "does not end in .mp4 or .gif"),
        (&["out/run.mcap", "--film", "film.gif", "--film-fps", "0"], WRONG_INPUT, "got 0"),
        (&["out/run.mcap", "--film", "film.mp4", "--size", "101x50"], WRONG_INPUT, "even sides"),
        (&["out/run.mcap", "--film", "film.mp4", "--speed", "0"], WRONG_INPUT, "--speed: must be more than 0, got 0"),
        (&["out/run.mcap", "--film", "film.mp4", "--speed", "-3"], WRONG_INPUT, "--speed: must be more than 0, got -3"),
        (&["out/run.mcap", "--speed", "2"], WRONG_INPUT, "required arguments were not provided: --film <FILE>"),
        (&["out/run.mcap", "--at", "end", "--film-fps", "10"], WRONG_INPUT, "not provided: --film <FILE>"),
        (
            &["out/run.mcap", "--film", "film.mp4", "--speed", "nan"],
            WRONG_INPUT,
            "--speed: must be more than 0, got NaN",
        ),
        (&["out/run.mcap", "--film", "folder.mp4"], WRONG_INPUT, "folder.mp4 is a folder"),
        (&["out/run.mcap", "--out", "refused", "--camera", "follow:9"], WRONG_INPUT, "there is no vehicle `9`"),
        (&["out/run.mcap", "--out", "refused", "--size", "60000x9"], WRONG_INPUT, "pixels a side"),
        (&["out/run.mcap", "--adapter", "no such adapter"], WRONG_INPUT, "there is no `no such adapter` adapter"),
        (&["nowhere.mcap"], WRONG_INPUT, "nowhere.mcap"),
        (&["noise.mcap"], WRONG_INPUT, "noise.mcap, line 1: no column gives time"),
        (&["empty.mcap"], WRONG_INPUT, "no samples"),
        (&["out/run.mcap", "--out", "a-file/below"], MACHINE_FAILED, "cannot write to a-file/below"),
        (&["out/run.mcap", "--film", "a-file/film.gif"], MACHINE_FAILED, "cannot write to a-file"),
    ];
    for (arguments, exit, message) in cases {
        let Ran { exit: found, out, err } = ran(folder.path(), &[&["render"], *arguments].concat());
        // Long lines are broken for the terminal.
        let text = err.split_whitespace().filter(|word| *word != "|" && *word != "│").collect::<Vec<_>>().join(" ");
        assert_eq!((found, out.as_str()), (*exit, ""), "{arguments:?}: {err}");
        assert!(text.contains(message), "{arguments:?}: {text}");
        assert!(!err.contains("panicked"), "{arguments:?}: {err}");
    }
    assert_eq!(names(&folder.path().join("out")), ["figures", "report.html", "report.json", "run.mcap"]);
    assert!(!folder.path().join("refused").exists(), "a refused command leaves no folder");
}

#[test]
fn too_large_coordinates_are_refused_with_vehicle_value_and_time() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("far.csv"), "t,id,x,y,z\n0,a,0,0,0\n0,b,1,0,0\n1,a,1e300,0,0\n1,b,-1e300,0,0\n")
        .expect("written");
    for more in [&[][..], &["--at", "closest"], &["--delta", "1"]] {
        let Ran { exit, err, .. } = ran(folder.path(), &[&["render", "far.csv"], more].concat());
        assert_eq!(exit, WRONG_INPUT, "{err}");
        let text = err.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
        assert!(
            text.contains("vehicle a has a coordinate of 1e300 m at 1 s; coordinates and radii must be at most 1e9 m"),
            "{text}"
        );
    }
    assert_eq!(names(folder.path()), ["far.csv"]);
}

#[cfg(not(feature = "film"))]
#[test]
fn an_mp4_film_without_ffmpeg_is_refused_with_remedies() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("two.csv"), "t,id,x,y,z\n0,a,0,0,0\n0,b,3,0,0\n1,a,0,1,0\n1,b,3,1,0\n")
        .expect("written");
    let done = std::process::Command::new(TAUTLINE)
        .args(["render", "two.csv", "--film", "two.mp4"])
        .current_dir(folder.path())
        .env("PATH", "")
        .output()
        .expect("the program runs");
    let err = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), MACHINE_FAILED, "{err}");
    assert!(err.contains("render/no-ffmpeg") && err.contains("--features film") && err.contains(".gif"), "{err}");
    assert!(!folder.path().join("two.mp4").exists());
}

#[test]
fn no_output_overwrites_another_or_the_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    let rows = "t,id,x,y,z\n0,a,-2,0,0\n0,b,2,0,0\n1,a,-2,1,0\n1,b,2,0,0\n";
    let recordings = ["start.png", "sheet.png", "r.gif"];
    for name in recordings {
        fs::write(folder.path().join(name), rows).expect("written");
    }
    let clashes: [(&[&str], &str); 4] = [
        (&["r.gif", "--film", "r.gif"], "--film r.gif would overwrite the recording"),
        (&["r.gif", "--film", "./new/../r.gif"], "--film ./new/../r.gif would overwrite the recording"),
        (&["start.png", "--out", ".", "--at", "start"], "the picture ./start.png would overwrite the recording"),
        (&["sheet.png", "--out", ".", "--sheet", "2x2"], "the sheet ./sheet.png would overwrite the recording"),
    ];
    for (arguments, message) in clashes {
        let Ran { exit, err, .. } = ran(folder.path(), &[&["render"], arguments].concat());
        assert_eq!(exit, WRONG_INPUT, "{arguments:?}: {err}");
        let text = err.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
        assert!(text.contains(message), "{arguments:?}: {text}");
    }
    assert_eq!(names(folder.path()), ["r.gif", "sheet.png", "start.png"], "no file is created");
    for name in recordings {
        assert_eq!(fs::read_to_string(folder.path().join(name)).expect(name), rows);
    }
    let apart = ["render", "r.gif", "--out", "new", "--at", "start", "--film", "new/film.gif", "--size", "64x36"];
    let Ran { exit, err, .. } = ran(folder.path(), &[&apart[..], &["--film-fps", "2"]].concat());
    assert_eq!(exit, GOOD, "{err}");
    assert_eq!(names(&folder.path().join("new")), ["film.gif", "start.png"]);
}

#[test]
fn the_closest_picture_is_at_the_closest_approach_between_samples() {
    let folder = tempfile::tempdir().expect("a folder");
    let rows = "t,id,x,y,z\n0,a,-2,0,0\n0,b,2,0,0\n1,a,2,0,0\n1,b,-2,0,0\n";
    fs::write(folder.path().join("headon.csv"), rows).expect("written");
    let render = ["render", "headon.csv", "--delta", "1", "--size", "320x180", "--at", "closest,0.5,0.5", "--out", "a"];
    let Ran { exit, err, .. } = ran(folder.path(), &render);
    assert_eq!(exit, GOOD, "{err}");
    assert!(err.contains("vehicles of unknown radius are drawn with 0.1 m"), "{err}");
    assert_eq!(names(&folder.path().join("a")), ["at-0.500s.png", "closest.png"]);
    let [closest, halfway] =
        ["closest.png", "at-0.500s.png"].map(|name| fs::read(folder.path().join("a").join(name)).expect(name));
    assert!(closest == halfway, "they are closest halfway");
    let near = ["render", "headon.csv", "--delta", "1", "--size", "320x180", "--at", "0.1,0.10001", "--out", "b"];
    assert_eq!(ran(folder.path(), &near).exit, GOOD);
    assert_eq!(names(&folder.path().join("b")), ["at-0.10001s.png", "at-0.100s.png"], "two times have two pictures");
    let until = ran(folder.path(), &["render", "headon.csv", "--at", "0.1", "--until", "0.5"]);
    assert_eq!(until.exit, WRONG_INPUT, "{}", until.err);
    assert!(until.err.contains("--until: has no effect without --film, --sheet or --every"), "{}", until.err);
}

/// Returns the pixels of a picture: red, green and blue.
fn pixels(path: &Path) -> Vec<[u8; 3]> {
    let file = fs::File::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG");
    let mut rgb = vec![0; reader.output_buffer_size().expect("a size")];
    reader.next_frame(&mut rgb).expect("a picture");
    rgb.as_chunks().0.to_vec()
}

/// Colour of violations on a dark background; the banner fills the first pixel with it.
const VIOLATION_COLOUR: [u8; 3] = [0xFF, 0x2F, 0x3C];

#[test]
fn a_picture_is_red_only_during_a_violation_of_the_audit() {
    let folder = tempfile::tempdir().expect("a folder");
    // The separation is exactly 1.25 m, and equality is no violation.
    let still = |t: u32| format!("{t},a,0,0,0\n{t},b,0.75,1,0\n");
    let table = format!("t,id,x,y,z\n{}{}{}", still(0), still(1), still(2));
    fs::write(folder.path().join("still.csv"), table).expect("written");
    for (delta, is_violation) in [("1.25", false), ("1.2500001", true)] {
        let audit = ran(folder.path(), &["audit", "still.csv", "--delta", delta]);
        assert_eq!(audit.exit, Some(i32::from(is_violation)), "{}", audit.out);
        let render = ["render", "still.csv", "--delta", delta, "--at", "1", "--size", "320x180", "--out", delta];
        let Ran { exit, err, .. } = ran(folder.path(), &render);
        assert_eq!(exit, GOOD, "{err}");
        let pixels = pixels(&folder.path().join(delta).join("at-1.000s.png"));
        assert_eq!(pixels[0] == VIOLATION_COLOUR, is_violation, "delta {delta}: {:?}", pixels[0]);
        assert_eq!(pixels.contains(&VIOLATION_COLOUR), is_violation, "delta {delta}");
    }
}

#[test]
fn a_refused_recording_is_drawn_as_not_judged() {
    let folder = tempfile::tempdir().expect("a folder");
    // The radius of a vehicle must not change during a flight.
    let table = "t,id,x,y,z,radius\n0,a,0,0,0,0.1\n0,b,1,0,0,0.1\n1,a,0,0,0,0.2\n1,b,1,0,0,0.1\n";
    fs::write(folder.path().join("grows.csv"), table).expect("written");
    assert_eq!(ran(folder.path(), &["audit", "grows.csv", "--delta", "2"]).exit, WRONG_INPUT);
    let Ran { exit, err, .. } = ran(folder.path(), &["render", "grows.csv", "--delta", "2", "--size", "320x180"]);
    let text = err.split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(exit, GOOD, "{err}");
    assert!(text.contains("it was not judged"), "{text}");
    assert!(!pixels(&folder.path().join("snapshots/start.png")).contains(&VIOLATION_COLOUR));
}

#[test]
fn trails_have_the_requested_length() {
    let folder = tempfile::tempdir().expect("a folder");
    let side_by_side = |t: u32| format!("{t},a,{},0,1\n{t},b,{},4,1\n", 2 * t, 2 * t);
    let table: String = (0..=10).map(side_by_side).collect();
    fs::write(folder.path().join("ahead.csv"), format!("t,id,x,y,z\n{table}")).expect("written");
    let picture = |name: &str, more: &[&str]| {
        let render = ["render", "ahead.csv", "--at", "end", "--camera", "top", "--size", "320x180", "--out", name];
        let render = [&render[..], more].concat();
        let Ran { exit, err, .. } = ran(folder.path(), &render);
        assert_eq!(exit, GOOD, "{err}");
        pixels(&folder.path().join(name).join("end.png"))
    };
    let none = picture("none", &["--trail", "1e-6"]);
    let painted = |more: &[&str]| picture("some", more).iter().zip(&none).filter(|(with, none)| with != none).count();
    let [whole, long, short] = [&[][..], &["--trail", "5.5"], &["--trail", "2.5"]].map(painted);
    assert!(whole > long && long > short && short > 0, "{whole}, {long} and {short} pixels");
    for trail in ["0", "-1", "nan"] {
        let Ran { exit, err, .. } = ran(folder.path(), &["render", "ahead.csv", "--trail", trail]);
        assert_eq!(exit, WRONG_INPUT, "{err}");
        assert!(err.contains("must be more than 0"), "{err}");
    }
}

#[test]
fn a_window_uses_the_reading_options() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("own.csv"), "t,id,east,y,z\n0,a,-2,0,0\n0,b,2,0,0\n1,a,-2,1,0\n").expect("written");
    // Arguments after `view`, exit code, part of the message. Without a display, a valid recording fails only after it
    // was read.
    let cases: [(&[&str], Option<i32>, &str); 5] = [
        (&["own.csv"], WRONG_INPUT, "own.csv"),
        (&["own.csv", "--column", "x=east"], MACHINE_FAILED, "no display"),
        (&["own.csv", "--column", "x=east", "--input-format", "npz"], WRONG_INPUT, "own.csv"),
        (&["own.csv", "--column", "x=east", "--scale", "0"], WRONG_INPUT, "recording/option-out-of-range"),
        (&["pentagon", "--scale", "0.001"], WRONG_INPUT, "have no effect on a scenario"),
    ];
    for (arguments, exit, message) in cases {
        let done = std::process::Command::new(TAUTLINE)
            .arg("view")
            .args(arguments)
            .current_dir(folder.path())
            .env_remove("DISPLAY")
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
            .output()
            .expect("the program runs");
        let err = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), exit, "{arguments:?}: {err}");
        assert!(err.contains(message), "{arguments:?}: {err}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn without_a_desktop_the_driver_is_silent_and_there_is_one_process() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("two.csv"), "t,id,x,y,z\n0,a,-2,0,0\n0,b,2,0,0\n1,a,-2,1,0\n").expect("written");
    let command = |arguments: &[&str]| {
        let mut command = std::process::Command::new(TAUTLINE);
        command.args(arguments).current_dir(folder.path()).env_remove("XDG_RUNTIME_DIR");
        command.env_remove("NODEVICE_SELECT").env_remove("MESA_VK_DEVICE_SELECT");
        command
    };
    let has_driver_message = |command: &mut std::process::Command, exit: Option<i32>| {
        let done = command.output().expect("the program runs");
        let err = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), exit, "{err}");
        err.contains("XDG_RUNTIME_DIR")
    };
    let render = ["render", "two.csv", "--size", "64x36", "--at", "start"];
    let run = ["run", "pentagon", "--out", "out", "--set", "time.duration_s=1"];
    assert!(!has_driver_message(&mut command(&render), GOOD));
    assert!(
        !has_driver_message(&mut command(&run), Some(1)),
        "the formation is not reached: the exit code passes through"
    );
    // Selecting a device through that layer keeps its message.
    assert!(has_driver_message(command(&render).env("MESA_VK_DEVICE_SELECT", "0:0"), GOOD));

    // A signal reaches the only process.
    let long = ["run", "pentagon", "--out", "long", "--set", "time.duration_s=100000"];
    let mut flight = command(&long).stderr(std::process::Stdio::piped()).spawn().expect("the program runs");
    let recording = folder.path().join("long/run.mcap");
    let began = std::time::Instant::now();
    while fs::metadata(&recording).map_or(0, |file| file.len()) == 0 {
        assert!(began.elapsed() < std::time::Duration::from_mins(1), "the recording is empty");
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    let signal = std::process::Command::new("kill").args(["-INT", &flight.id().to_string()]).status().expect("kill");
    assert!(signal.success());
    assert_eq!(flight.wait().expect("it ends").code(), Some(1), "an interrupted run ends cleanly and does not pass");
    assert!(folder.path().join("long/report.json").exists());
}

#[test]
fn an_unfinished_recording_is_drawn_with_a_note() {
    let folder = flown("pentagon", &["--no-snapshots"]);
    let whole = fs::read(folder.path().join("out/run.mcap")).expect("a recording");
    fs::write(folder.path().join("cut.mcap"), &whole[..whole.len() - 40]).expect("written");
    let Ran { exit, err, .. } = ran(folder.path(), &["render", "cut.mcap", "--at", "start", "--size", "160x90"]);
    assert_eq!(exit, GOOD, "{err}");
    assert!(err.contains("the recording was not closed"), "{err}");
}

#[test]
fn a_recording_without_samples_after_a_crash_is_refused() {
    let folder = flown("pentagon", &["--no-snapshots"]);
    let whole = fs::read(folder.path().join("out/run.mcap")).expect("a recording");
    for (bytes, more) in [(100, &[][..]), (4000, &[]), (4000, &["--allow-unfinished"])] {
        fs::write(folder.path().join("cut.mcap"), &whole[..bytes]).expect("written");
        let Ran { exit, err, .. } = ran(folder.path(), &[&["render", "cut.mcap"], more].concat());
        assert_eq!(exit, WRONG_INPUT, "{err}");
        assert!(err.contains("cut.mcap: the run was cut off before anything was written"), "{err}");
    }
}

#[test]
fn a_folder_is_read_as_one_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::create_dir(folder.path().join("some")).expect("a folder");
    fs::write(folder.path().join("some/table.csv"), "a,b\n1,2\n").expect("written");
    for command in ["view", "render"] {
        let Ran { exit, err, .. } = ran(folder.path(), &[command, "some"]);
        assert_eq!(exit, WRONG_INPUT, "{err}");
        let text = err.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
        assert!(text.contains("the folder was taken for one recording"), "{text}");
    }
}

#[test]
fn a_window_without_a_display_ends_with_a_remedy() {
    let folder = tempfile::tempdir().expect("a folder");
    let done = std::process::Command::new(TAUTLINE)
        .args(["view", "pentagon"])
        .current_dir(folder.path())
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .output()
        .expect("the program runs");
    let err = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), MACHINE_FAILED, "{err}");
    assert!(err.contains("no display") && err.contains("tautline render") && !err.contains(".rs:"), "{err}");
}

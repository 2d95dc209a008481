use std::ops::ControlFlow;
use tautline::figures::{self, Course, Yardsticks};
use tautline::formation::Formation;
use tautline::scenario::{Override, Scenario, Source};
use tautline::swarm::*;
use tautline::{plant, sim};
#[test]
fn look() {
    let out = std::path::Path::new("/tmp/n/fig-look");
    std::fs::create_dir_all(out).unwrap();
    for name in ["pentagon", "circle", "pentagon-laplacian"] {
        let s = Scenario::read(&Source::resolve(name).unwrap(), &[]).unwrap();
        fly(&s, name, out);
    }
    let _ = Override::parse("time.duration_s=5");
    // sphere of 40 in space
    let n = 40;
    let f = Formation::sphere(n, 8.0);
    let mut start = Rows::zeros(n);
    for i in 0..n {
        let k = (i * 17) % n;
        start[(i, 0)] = ((k % 5) as f64) * 4.0;
        start[(i, 1)] = ((k / 5) as f64) * 4.0;
        start[(i, 2)] = (i % 3) as f64 * 0.7;
    }
    let s = Scenario::new("sphere", Swarm::at_rest(start), f, 0.5, 40.0);
    fly(&s, "sphere", out);
    let t = tautline::law::EdgeTension::new(1.0, 0.5, 0.5 + 0.881373587).unwrap();
    let fig = figures::tension_curve(&t, "Fig. 1: edge tension").unwrap();
    std::fs::write(out.join("tension.svg"), fig.svg).unwrap();
}
fn fly(s: &Scenario, name: &str, out: &std::path::Path) {
    let mut course = Course::new();
    let (mut law, mut plant) = (s.law().unwrap(), plant::for_scenario(s));
    let t = std::time::Instant::now();
    let fl = sim::fly(s, law.as_mut(), plant.as_mut(), &mut course, &mut |_| ControlFlow::Continue(())).unwrap();
    eprintln!("{name} flown {:?}", t.elapsed());
    let t = std::time::Instant::now();
    let y = Yardsticks {
        delta_m: s.delta_m,
        certified_m: fl.certificate.certified_m,
        shape: Some((&s.formation, &s.graph)),
        edge_error_m: Some(0.01),
        disagreement_m_s: Some(0.01),
    };
    for f in figures::of_run(&course, &y).unwrap() {
        eprintln!("{name} {} {}", f.name, f.svg.len());
        std::fs::write(out.join(format!("{name}-{}.svg", f.name)), f.svg).unwrap();
    }
    eprintln!("{name} drawn {:?}", t.elapsed());
}

use tautline_sim::scenario::{Scenario, Source, Override};
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let sets: Vec<_> = args[1..].iter().map(|s| Override::parse(s).unwrap()).collect();
    let scenario = Scenario::read(&Source::resolve(&args[0]).unwrap(), &sets).unwrap_or_else(|e| panic!("{e:?}"));
    let t = std::time::Instant::now();
    match scenario.identify() { Ok(i) => println!("{i}\n{:?}\n{:?}", i.tracking, t.elapsed()), Err(e) => println!("{e:?}") }
}

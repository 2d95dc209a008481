//! `tautline watch`: a live monitor of separation.

use std::fs::File;
use std::io::{self, Write as _};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use clap::builder::PossibleValue;

use super::console::{self, Console, Exit, Terminal};
use super::json::JsonArgument;
use super::reading::origin;
use tautline_core::track::EarthOrigin;
use tautline_recordings::read::{self, EarthFrame, ReadError};
use tautline_report::report::page::live_page;
use tautline_report::request::{Failure, Monitor as _, one_of, outputs};
use tautline_watch::foxglove_server::FoxgloveServer;
use tautline_watch::page::Page;
use tautline_watch::source::{self, Feed, MavlinkFrame, NamingOptions, OwnedPose};
use tautline_watch::{
    Assessment, Bound, ClockScope, Expected, Monitor, Notice, Output, Plan, PlanEnd, Record, Settings, TimeBase,
    watch as watch_inputs,
};

/// Arguments of `tautline watch`.
#[derive(Debug, Args)]
#[command(after_help = "\
Sources:
  -                     Standard input. Each line is a JSON object with t, id, x, y, z, and vx, vy, vz if known.
                        A line with t, id and event, which is off, is the sign-off of a vehicle.
  mavlink:ADDRESS:PORT  MAVLink over UDP. The system id is the name of a vehicle.
  rosbridge:HOST:PORT   Topics of ROS, with --topic. Plans of planners are read, too.
  foxglove:HOST:PORT    Topics with positions of a Foxglove server, all or those of --topic.

A line comes each second and at every change of state: CLEAR, UNDECIDED or VIOLATION. A watch ends with its input or
with Ctrl-C. Exit codes: 0 if it was CLEAR from start to end, 1 if not or if a vehicle left its plan.")]
pub(super) struct WatchArguments {
    /// Source of positions; several sources are not joined.
    #[arg(value_name = "SOURCE", default_value = "-")]
    source: String,
    /// Safety distance of two centres [m].
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    delta: f64,
    /// Bound on the acceleration of each vehicle [m/s^2]: g tan(tilt) for level flight [default: 9.81, a tilt of 45
    /// degrees, or a fall with stopped motors].
    #[arg(long, value_name = "M/S2", allow_negative_numbers = true)]
    accel: Option<f64>,
    /// Bound on the error of each position [m], with the speed times the error of its stamp [default: 0.05, and with
    /// `--origin` five times the standard deviation that the source reports].
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    position_error: Option<f64>,
    /// Bound on the error of each velocity that is sent [m/s] [default: 0.1].
    #[arg(long, value_name = "M/S", allow_negative_numbers = true)]
    velocity_error: Option<f64>,
    /// Acceleration with which each vehicle can brake [m/s^2].
    #[arg(long, value_name = "M/S2", default_value_t = 3.0, allow_negative_numbers = true)]
    brake: f64,
    /// Age beyond which a vehicle is stale [s] [default: 1].
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    max_age: Option<f64>,
    /// Smallest delay between a stamp and its arrival [s], which the watch cannot measure [default: 0].
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    latency: Option<f64>,
    /// Time ahead that is examined [s].
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, allow_negative_numbers = true)]
    horizon: f64,
    /// Number of vehicles that must be heard before anything is clear.
    #[arg(long, value_name = "COUNT", conflicts_with = "ids")]
    expect: Option<usize>,
    /// Names of vehicles that must be heard before anything is clear, separated by commas.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    ids: Vec<String>,
    /// Largest number of vehicles; a message of a further vehicle is an error.
    #[arg(long, value_name = "COUNT", default_value_t = 2000)]
    max_vehicles: usize,
    /// Present from which ages count: the time on this machine, or the largest stamp so far, for files.
    #[arg(long, value_name = "WHICH", default_value = "arrival", value_parser = time_base())]
    time: TimeBase,
    /// Clocks of the stamps: one for all vehicles, or one per vehicle [default: own for `mavlink`, else common].
    #[arg(long, value_name = "WHICH", value_parser = clocks())]
    clocks: Option<ClockScope>,
    /// Topic to read; repeatable.
    #[arg(long = "topic", value_name = "NAME")]
    topics: Vec<String>,
    /// Frame of the positions, if messages have several frames.
    #[arg(long, value_name = "NAME")]
    frame: Option<String>,
    /// Origin of geographic positions: degrees, and metres of height.
    #[arg(long, value_name = "LAT,LON,HEIGHT", value_parser = origin, allow_hyphen_values = true)]
    origin: Option<[f64; 3]>,
    /// Approved plan, a recording of any format: report deviations from it, and expect its vehicles.
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// Stamp at which the plan has its time 0 [s]; with `--clocks own`, the time since the start of the watch. By
    /// default, the times of the plan are stamps. With times since 1970, time 0 is the first second.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, requires = "plan")]
    plan_start: Option<f64>,
    /// Largest deviation from the plan [m].
    #[arg(long, value_name = "METRES", default_value_t = 0.5, allow_negative_numbers = true, requires = "plan")]
    tube: f64,
    /// Motion after the end of a planner's plan. Unknown motion is not judged [default: hold].
    #[arg(long, value_name = "END", value_parser = plan_end())]
    plan_end: Option<PlanEnd>,
    /// Write the used positions to a .csv or .mcap file for `tautline audit`, as FILE.partial until the end.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Overwrite an existing recording, and the file of --json.
    #[arg(long)]
    force: bool,
    /// Serve a live page on this address [default: 127.0.0.1:8737, for this machine only].
    #[arg(
        long,
        value_name = "ADDRESS:PORT",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "127.0.0.1:8737",
        value_parser = own_address::<8737>
    )]
    page: Option<SocketAddr>,
    /// Serve Foxglove on an address of this machine [default: 127.0.0.1:8765].
    #[arg(
        long,
        value_name = "ADDRESS:PORT",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "127.0.0.1:8765",
        value_parser = own_address::<8765>
    )]
    foxglove: Option<SocketAddr>,
    // Each notice is a line.
    #[command(flatten)]
    json: JsonArgument,
    /// Print no text.
    #[arg(long, short)]
    quiet: bool,
}

/// Watches until the source ends or Ctrl-C.
pub(super) fn watch(arguments: &WatchArguments) -> Result<Exit, Failure> {
    let source = arguments.source()?;
    if let Some(address) = arguments.foxglove.filter(|address| !address.ip().is_loopback()) {
        let message = format!("--foxglove: other machines are refused, as the protocol has no token ({address})");
        let help = "write --foxglove, and run ssh -L 8765:127.0.0.1:8765 THIS_MACHINE on the other machine";
        return Err(Failure::input("watch/setting", message, help));
    }
    if let (Some(page), Some(foxglove)) = (arguments.page, arguments.foxglove)
        && share_a_port(page, foxglove)
    {
        let message = format!("--page, --foxglove: both have one port ({page}, {foxglove})");
        let other = if page.port() == u16::MAX { page.port() - 1 } else { page.port() + 1 };
        return Err(Failure::input("watch/setting", message, format!("write --foxglove=127.0.0.1:{other}")));
    }
    let mut settings = arguments.settings(&source)?;
    let plan = arguments.read_plan(&mut settings)?;
    let monitor = Monitor::new(settings, plan).map_err(|error| {
        Failure::input("watch/setting", error.to_string(), "give a number in this range; tautline watch --help")
    })?;
    let console = Console { data_on_stdout: arguments.json.is_piped(), quiet: arguments.quiet };
    arguments.check_outputs()?;
    let mut outputs = Outputs {
        console,
        recorder: arguments.recorder()?,
        lines: Lines::open(&arguments.json)?,
        page: None,
        foxglove: None,
    };
    let terminal = Terminal::new(console)?;
    if let Some(address) = arguments.page {
        let page = Page::serve(address, live_page()).map_err(|error| {
            let message = format!("--page: cannot serve on {address}: {error}");
            Failure::machine("watch/cannot-listen", message)
                .with_help("give a free port, such as --page=127.0.0.1:8738")
        })?;
        Console { quiet: false, ..console }.warn(&format!("live page: {}", page.url()));
        outputs.page = Some(page);
    }
    if let Some(address) = arguments.foxglove {
        let frame = arguments.frame.as_deref().unwrap_or("world");
        let server = FoxgloveServer::serve(address, frame).map_err(|error| {
            let message = format!("--foxglove: cannot serve on {address}: {error}");
            Failure::machine("watch/cannot-listen", message)
                .with_help("give a free port, such as --foxglove=127.0.0.1:8766")
        })?;
        Console { quiet: false, ..console }.warn(&format!("Foxglove server: {}", server.url()));
        outputs.foxglove = Some(server);
    }
    let (feed, inputs) = source::channel(Arc::clone(terminal.interruption()));
    arguments.start(source, feed, console)?;
    let watched = watch_inputs(monitor, &inputs, &mut outputs)
        .map_err(|error| Failure::machine("files/cannot-write", format!("cannot write the watch: {error}")));
    if let Some(page) = outputs.page {
        page.finish();
    }
    // The recording is complete even if another output failed.
    let recorded = match (outputs.recorder, &arguments.record) {
        (Some(record), Some(path)) => finish(record, path, console),
        _ => Ok(true),
    };
    let passes = watched?.passes();
    Ok(Exit::good_if(recorded? && passes))
}

/// Source of the command line.
#[derive(Debug)]
enum Address {
    Lines,
    Mavlink(SocketAddr),
    Rosbridge(String),
    Foxglove(String),
}

impl WatchArguments {
    fn source(&self) -> Result<Address, Failure> {
        let refuse = |problem: &str, help: &str| {
            let message = format!("SOURCE: {problem} ({:?})", self.source);
            Err(Failure::input("watch/source", message, help))
        };
        let server = |of: &str| format!("ws://{}", of.trim_start_matches("//"));
        let address = match self.source.split_once(':') {
            _ if self.source == "-" => Address::Lines,
            Some(("mavlink", of)) => match of.trim_start_matches("//").parse() {
                Ok(address) => Address::Mavlink(address),
                Err(_) => return refuse("not an address and port", "write mavlink:0.0.0.0:14550"),
            },
            Some(("rosbridge", of)) => Address::Rosbridge(server(of)),
            Some(("foxglove", of)) => Address::Foxglove(server(of)),
            _ => {
                return refuse(
                    "not a source",
                    "write -, mavlink:0.0.0.0:14550, rosbridge:HOST:9090 or foxglove:HOST:8765",
                );
            }
        };
        if self.time == TimeBase::Stamps && !matches!(address, Address::Lines) {
            return refuse("a live source needs --time arrival", "omit --time");
        }
        if self.plan_end.is_some() && !matches!(address, Address::Rosbridge(_)) {
            return refuse("--plan-end needs plans of planners, which only rosbridge carries", "omit --plan-end");
        }
        if self.time == TimeBase::Stamps && self.clocks == Some(ClockScope::PerVehicle) {
            return refuse("--time stamps needs one clock for all vehicles", "omit --clocks");
        }
        Ok(address)
    }

    fn settings(&self, source: &Address) -> Result<Settings, Failure> {
        let expected = match self.expect {
            Some(count) => Expected::Count(count),
            None if !self.ids.is_empty() => Expected::Names(self.ids.clone()),
            None => Expected::Heard,
        };
        if let Some(empty) = self.ids.iter().position(String::is_empty) {
            let message = format!("--ids: name {} is empty", empty + 1);
            return Err(Failure::input("watch/setting", message, "separate names by one comma each"));
        }
        let by_default = Settings::default();
        let bound = |given: Option<f64>, default: Bound| given.map_or(default, Bound::declared);
        // Positions on the Earth have the error of their receiver.
        let is_on_earth = self.origin.is_some() && !matches!(source, Address::Lines);
        let position_error_m = match self.position_error {
            Some(error_m) => Some(Bound::declared(error_m)),
            None => by_default.position_error_m.filter(|_| !is_on_earth),
        };
        Ok(Settings {
            delta_m: self.delta,
            accel_m_s2: bound(self.accel, by_default.accel_m_s2),
            position_error_m,
            velocity_error_m_s: bound(self.velocity_error, by_default.velocity_error_m_s),
            brake_m_s2: self.brake,
            max_age_s: bound(self.max_age, by_default.max_age_s),
            latency_s: bound(self.latency, by_default.latency_s),
            horizon_s: self.horizon,
            tube_m: self.tube,
            plan_end: self.plan_end,
            expected,
            max_vehicles: self.max_vehicles,
            time_base: self.time,
            clocks: self.clocks,
            has_message_counts: matches!(source, Address::Mavlink(_)),
        })
    }

    /// Reads the plan, whose vehicles are expected unless others are.
    fn read_plan(&self, settings: &mut Settings) -> Result<Plan, Failure> {
        let Some(path) = &self.plan else { return Ok(Plan::default()) };
        if let Some(start_s) = self.plan_start.filter(|start_s| !start_s.is_finite()) {
            let message = format!("--plan-start: must be finite ({start_s})");
            return Err(Failure::input("watch/setting", message, "give a number of seconds"));
        }
        let unread = |error: ReadError| Failure::from(error).under("--plan");
        let origin = self.origin.map(|place| EarthOrigin { place, is_inferred: false });
        let mut recording = read::open_plan(path, origin.as_ref()).map_err(unread)?;
        let (mut items, mut more) = (Vec::new(), recording.clock().other_unit.is_some());
        while more {
            more = recording.read(&mut items).map_err(unread)?;
        }
        let refused = |problem: &str, help: &str| {
            let message = format!("--plan: {}: {problem}", path.display());
            Err(Failure::input("watch/plan", message, help))
        };
        if let Some(other) = recording.clock().doubt(&items) {
            let problem = format!("its times may be in {} or {other}", recording.clock().unit);
            return refused(&problem, "name the column of times time_s or time_ms");
        }
        if !items.is_empty() {
            recording = read::open_plan(path, origin.as_ref()).map_err(unread)?;
        }
        let epoch_s = match settings.clock_scope() {
            // The reader counts times since 1970 from a whole second.
            ClockScope::Common => recording.clock().epoch_ns as f64 * 1e-9,
            ClockScope::PerVehicle => 0.0,
        };
        let start_s = self.plan_start.unwrap_or(epoch_s);
        let Some(plan) = Plan::read(&mut *recording, start_s).map_err(unread)? else {
            return refused("too long to keep in memory", "give a plan with at most 20 million positions");
        };
        let metadata = recording.metadata();
        if metadata.is_planar {
            return refused("it has no heights, so a deviation in height is not known", "add the heights to the plan");
        }
        if settings.expected == Expected::Heard {
            settings.expected = Expected::Names(plan.names().map(str::to_owned).collect());
        }
        Ok(plan)
    }

    /// Rejects outputs that would overwrite the plan or each other or, without --force, any file.
    fn check_outputs(&self) -> Result<(), Failure> {
        self.json.check("", self.force)?;
        let partial = self.record.as_deref().map(Record::partial_of);
        let plan = self.plan.as_deref().map(|plan| ("the plan".to_owned(), plan));
        let records = [self.record.as_deref(), partial.as_deref()].into_iter().flatten();
        let outputs: Vec<_> = records.map(|path| ("--record".to_owned(), path)).chain(self.json.file()).collect();
        outputs::check(&plan.into_iter().collect::<Vec<_>>(), &outputs)
    }

    fn recorder(&self) -> Result<Option<Record>, Failure> {
        let Some(path) = &self.record else { return Ok(None) };
        if !Record::is_written(path) {
            let message = format!("--record: must end in .csv or .mcap ({:?})", path.display().to_string());
            return Err(Failure::input("watch/record", message, "give another name"));
        }
        if path.is_dir() {
            let message = format!("--record: {} is a folder", path.display());
            return Err(Failure::input("watch/record", message, "give another name"));
        }
        // The watch writes both.
        let partial = Record::partial_of(path);
        if let Some(there) = [path, &partial].into_iter().find(|file| file.exists() && !self.force) {
            let message = format!("--record: the file exists ({})", there.display());
            return Err(Failure::input("watch/record", message, "give another name, or --force to overwrite it"));
        }
        Ok(Some(Record::create(path).map_err(|error| cannot_write(path, &error))?))
    }

    fn start(&self, source: Address, feed: Feed, console: Console) -> Result<(), Failure> {
        let earth = match self.origin.map(EarthFrame::new).transpose() {
            Ok(earth) => earth,
            Err(why) => return Err(Failure::input("watch/source", format!("--origin: {why}"), "give degrees")),
        };
        let naming = || NamingOptions { topics: self.topics.clone(), frame: self.frame.clone(), earth };
        let refused = |why: String| Failure::input("watch/source", format!("SOURCE: {why}"), "tautline watch --help");
        match source {
            Address::Lines => {
                std::thread::spawn(move || source::lines(io::stdin().lock(), &feed));
                Ok(())
            }
            Address::Mavlink(address) => {
                let frame = earth.map_or(MavlinkFrame::Local, MavlinkFrame::Global);
                let bound = source::mavlink(address, frame, feed).map_err(|error| {
                    let message = format!("SOURCE: cannot listen on {address}: {error}");
                    Failure::machine("watch/cannot-listen", message).with_help("give a free port")
                })?;
                let what = if earth.is_some() { "GLOBAL_POSITION_INT" } else { "LOCAL_POSITION_NED" };
                console.warn(&format!("listening to {what} on {bound}"));
                Ok(())
            }
            Address::Rosbridge(url) => source::rosbridge(&url, naming(), feed).map_err(refused),
            Address::Foxglove(url) => source::foxglove(&url, naming(), feed).map_err(refused),
        }
    }
}

fn cannot_write(path: &Path, error: &io::Error) -> Failure {
    let message = format!("{}: cannot write the file: {error}", path.display());
    Failure::machine("files/cannot-write", message).with_help("write to another folder")
}

/// Completes a recording. Returns whether it has positions; without any, no file stays.
fn finish(record: Record, path: &Path, console: Console) -> Result<bool, Failure> {
    let rows = record.rows();
    if rows == 0 {
        record.discard().map_err(|error| cannot_write(path, &error))?;
        console.warn(&format!("--record: no position was heard, so {} is not written", path.display()));
        return Ok(false);
    }
    record.finish().map_err(|error| cannot_write(path, &error))?;
    console.warn(&format!("recorded {rows} positions in {}", path.display()));
    Ok(true)
}

/// Place of the notices as lines of JSON.
enum Lines {
    None,
    Piped,
    File(File),
}

impl Lines {
    fn open(json: &JsonArgument) -> Result<Self, Failure> {
        Ok(match json.file() {
            Some((_, path)) => Self::File(File::create(path).map_err(|error| cannot_write(path, &error))?),
            None if json.is_piped() => Self::Piped,
            None => Self::None,
        })
    }
}

/// All outputs of a watch.
struct Outputs {
    console: Console,
    lines: Lines,
    recorder: Option<Record>,
    page: Option<Page>,
    foxglove: Option<FoxgloveServer>,
}

impl Output for Outputs {
    fn notice(&mut self, notice: &Notice) -> io::Result<()> {
        let line = format!("{}\n", notice.json);
        match &mut self.lines {
            Lines::None => self.console.say(&notice.text),
            Lines::Piped => console::data(&line).map_err(|failure| io::Error::other(failure.to_string()))?,
            Lines::File(file) => {
                file.write_all(line.as_bytes())?;
                self.console.say(&notice.text);
            }
        }
        if let Some(page) = &mut self.page {
            page.notice(notice);
        }
        if let Some(server) = &mut self.foxglove {
            server.notice(notice);
        }
        Ok(())
    }

    fn pose(&mut self, time_s: f64, pose: &OwnedPose) -> io::Result<()> {
        self.recorder.as_mut().map_or(Ok(()), |recorder| recorder.push(time_s, pose))
    }

    fn assessed(&mut self, of: &Assessment, monitor: &Monitor) -> io::Result<()> {
        if let Some(page) = &mut self.page {
            page.assessed(of, monitor);
        }
        if let Some(server) = &mut self.foxglove {
            server.assessed(of, monitor);
        }
        Ok(())
    }
}

/// Returns the address and port of an option, whose default port is `PORT`.
fn own_address<const PORT: u16>(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| {
        let port = text.rsplit(':').next().and_then(|port| port.parse().ok()).unwrap_or(PORT);
        format!("not an IP address and a port; write 127.0.0.1:{port}")
    })
}

/// Returns whether two servers cannot listen on these addresses, because they have one port. Port 0 is any free port.
fn share_a_port(a: SocketAddr, b: SocketAddr) -> bool {
    let is_same_ip = a.ip() == b.ip() || a.ip().is_unspecified() || b.ip().is_unspecified();
    a.port() != 0 && a.port() == b.port() && is_same_ip
}

fn time_base() -> impl clap::builder::TypedValueParser<Value = TimeBase> {
    let named = |name: &'static str, help: &'static str| PossibleValue::new(name).help(help);
    one_of(vec![
        (named("arrival", "the arrival of messages here"), TimeBase::Arrival),
        (named("stamps", "the largest stamp so far"), TimeBase::Stamps),
    ])
}

fn plan_end() -> impl clap::builder::TypedValueParser<Value = PlanEnd> {
    let named = |end: PlanEnd, help: &'static str| (PossibleValue::new(end.name()).help(help), end);
    one_of(vec![
        named(PlanEnd::Hold, "hold the last point"),
        named(PlanEnd::Continue, "continue with the last velocity"),
        named(PlanEnd::Unknown, "unknown, not judged"),
    ])
}

fn clocks() -> impl clap::builder::TypedValueParser<Value = ClockScope> {
    let named = |name: &'static str, help: &'static str| PossibleValue::new(name).help(help);
    one_of(vec![
        (named("common", "one clock, or synchronised clocks"), ClockScope::Common),
        (named("own", "a clock per vehicle"), ClockScope::PerVehicle),
    ])
}

//! A stage between a control law and its vehicle that certifies the separation of every pair, under any law.
//!
//! Each vehicle flies a *reference* that it makes up itself and keeps the path of the reference, and of a full brake
//! from it, inside planes. Each pair agrees on its plane by a contract of two messages. The law's command is changed
//! only where the planes require it. Nothing is assumed of the law, of latency, loss or order of messages, or of
//! clocks.
//!
//! | module | holds |
//! | --- | --- |
//! | [`brake`] | stop point and command of the brake; the reservation (Lemma 1) |
//! | [`tube`] | bounds on the distance to the reference and on the feedback |
//! | [`plane`] | reserved segments and the plane between two of them |
//! | [`contract`] | messages, proposals and decisions (Lemma 3) |
//! | `contracts` | contracts of a vehicle with all others |
//! | `agenda` | periods at which contracts are looked at |
//! | [`obstacle`] | convex obstacles and the planes before them (Lemma 4) |
//! | [`choice`] | which commands are accepted, and which one is taken |
//! | [`settings`] | settings, defaults, errors, limits of the reference, rounding budget |
//! | [`start`] | announced starts, their bytes, and their hash |
//! | [`wire`] | messages as bytes |
//! | [`saved`] | state of a shield, to be continued in another process |
//! | [`shield`] | [`Shield`] of one vehicle, for real vehicles and simulators |
//! | [`unicycle`] | shield of a vehicle that cannot stop (Lemma 5) |
//! | [`fleet`] | [`Fleet`] of all vehicles of a simulation; the condition on starts |
//! | [`report`] | numbers of a flight, and whether the assumptions held |
//!
//! # Model
//! Vehicle i has p' = v and v' = a22 v + u + w. Its command u is held over its own period h. Lengths are in m, times in
//! s, and |.| is the Euclidean norm. Periods, errors and margins may differ between vehicles. Assumptions:
//!
//! - **A1** Every u with |u| <= A is carried out. |w(t)| <= W at all times. The reference is at most V fast.
//! - **A2** The own state is measured at the own instants within `eps_p` and `eps_v`. At the start the state is within
//!   the same of the announced one. A measurement may be older, by a whole number of periods or by a known age.
//! - **A3** The shield runs at every instant. Where the law has no command, it brakes ([`Shield::brake`]). The time
//!   between two instants is h, or any time of a range that is known afterwards ([`Shield::filter_timed`]).
//! - **A4** A message that arrives is what was sent, and arrives after it was sent. It may be late, lost, doubled or
//!   overtaken.
//! - **A5** All vehicles use one frame. The starts of a pair are announced values that both vehicles hold with the same
//!   bits ([`Start`]). No vehicle computes the start of another one from its own settings. The first instant is at the
//!   start.
//!
//! Each message carries a hash of the two starts of its pair. A vehicle that holds other starts is found by its first
//! message that arrives.
//!
//! # Algorithm
//! At each instant the vehicle, with its reference at (p, v) and the stop point s of its brake:
//!
//! 1. reads the newest message of each other vehicle: as a follower it decides on a new proposal, as an owner it takes
//!    a decision;
//! 2. as an owner without a pending proposal, proposes the plane between the two segments \[p, s\]. It holds the plane
//!    beside the old one. The segments must be at least m1 + m2 apart. Planes far from both vehicles are not renewed;
//! 3. renews its planes before obstacles within reach, and chooses the acceleration of the reference: a command that is
//!    *accepted*, or that of the brake;
//! 4. sends its next segment with pending proposals and last decisions to the vehicles that need them.
//!
//! Steps 1, 2 and 4 look only at contracts with news and at those whose plane may come within reach (`agenda`). The
//! commands have the same bits as if all planes were tested.
//!
//! A command is accepted if it and the next speed are within the limits. The next position and the next stop point must
//! also be inside all planes held. A plane between two vehicles leaves each of them a margin
//! m = delta / 2 + e, where e is the bound of the [`tube`]. With upright ellipsoids all of this holds in the scaled
//! lengths of a [`plane::Metric`].
//!
//! # Proof
//! **Lemma 1** ([`brake::Brake`]). With p, s, the next position and the next stop point inside a half-space, the path
//!  of the period and the whole brake after it are inside.
//!
//! **Lemma 2** (a choice always exists). At each instant, after steps 1 and 2, p and s are inside all planes held, so
//!  the brake is a choice. Both are inside at the start, because each vehicle tests p and s of both vehicles against
//!  the first plane of the pair. A pair that fails the test does not start. The last command was accepted, or was that
//!  of the brake. So the next p and s are inside all planes held over the period (Lemma 1). A plane is taken on only
//!  after p and s were tested against it. Dropping a plane changes nothing.
//!
//! **Lemma 3** ([`contract`]). At every time the two vehicles of a pair hold a common plane. Its base case is the plane
//!  of the announced starts, which both compute with the same numbers (A5).
//!
//! **Lemma 4** ([`obstacle`]). The vehicle may renew a plane before a convex obstacle alone, at any instant.
//!
//! **Theorem.** Let A1 to A5 hold, and let the segments of each pair pass the test of Lemma 2. For this they must be at
//!  least delta + e1 + e2 apart. Let the segment of each vehicle be at least its clearance and e from each obstacle.
//!  Then any two vehicles are at least delta apart at all times, and each vehicle keeps its clearance, under every law,
//!  latency and loss.
//!
//! *Proof.* Take the common plane of Lemma 3 at a time t. By Lemmas 1 and 2 both references are inside it, one on its
//!  side by m1 and the other one by m2. They are at least m1 + m2 = delta + e1 + e2 apart. Each vehicle is within its e
//!  of its reference. Lemma 4 gives the clearance of obstacles.
//!
//! # Irregular instants and old measurements
//! Let the time T between two instants be any one in \[`h-`, H\] with `h-` = h (1 - r) and H = (k + 1) h (1 + r). Here
//! r is the tolerance of the period, and k the number of instants in a row that a computer may miss. The actuator
//! holds its command until the next instant, so a hang is one long T. The vehicle knows T at the next instant.
//!
//! - **Reference.** It holds its acceleration over T and advances by T. Reference and plant hold the same command for
//!   the same time, so T - h adds nothing to the error of the tracker.
//! - **Tube.** The loop is a linear system whose step is any of those of the times in \[`h-`, H\].
//!   [`tube::irregular`] computes a norm of the error that no sequence of times leaves.
//! - **Brake.** Its command never reverses the vehicle within H, and its stop point is an upper bound over all
//!   sequences of times. Lemma 1 holds with both ([`brake::Brake`]).
//! - **Acceptance.** The position after H, and the stop points after `h-` and H, are tested. The latter keep the room
//!   of [`Brake::bend_m`](brake::Brake::bend_m). So p and s are inside all planes for every T, and Lemma 2 holds.
//!   Lemmas 3 and 4 use no time.
//! - **Error of the clock.** If T is known within `eps_t`, the reference jumps by at most V `eps_t` and A `eps_t` at
//!   the next instant. Both ends of the jump are inside the planes. The tube contains these jumps. A vehicle that does
//!   not measure T takes h for it, with `eps_t` = r h.
//! - **Age.** A measurement is any time in \[0, a\] old, and the vehicle knows this age. It predicts its state at the
//!   instant with its own commands since then. By A1 only the push is unknown. Up to drag and `eps_t`, the prediction
//!   is a measurement of the instant with the errors `eps_p` + a `eps_v` + W a^2 / 2 and `eps_v` + W a. A2 holds with
//!   them. Before the first measurement the announced start takes its place.
//!
//! With r = 0, k = 0 and a = 0 each command has the same bits as without these settings. The vehicles of a pair may
//! differ in all of them: only margins and segments are announced. [`UnicycleShield`] assumes regular instants.
//!
//! The margins of a pair contain 1e-6 m for the rounding of doubles. [`settings`] lists the covered operations, and
//! refuses settings and starts beyond it.
//!
//! # What voids the certificate
//! A vehicle that is dead, frozen or weaker than A voids it, and so does one that misses more than k instants. So do a
//! push or an error beyond its bound, and other starts on the two sides of a pair. So do forged messages and a vehicle
//! without a contract. A silent vehicle does not void it: the others stay behind the last common plane.
//! [`Counters::exceeded`](report::Counters::exceeded) names an assumption that did not hold in a flight.
//!
//! Arrival is not proved. Planes that are not renewed stay safe, and vehicles wait behind them.

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

mod agenda;
pub mod brake;
pub mod choice;
pub mod contract;
mod contracts;
pub mod fleet;
pub mod log;
pub mod obstacle;
pub mod plane;
pub mod report;
pub mod saved;
pub mod settings;
pub mod shield;
pub mod start;
pub mod tube;
pub mod unicycle;
pub mod wire;

pub use brake::State;
pub use contract::{Body, Broadcast, Entry, Message};
pub use fleet::Fleet;
pub use log::ContractLog;
pub use nalgebra;
pub use obstacle::{ConvexBody, Obstacle};
pub use report::Counters;
pub use saved::SavedShield;
pub use settings::{Limits, Settings, ShieldError, ShieldFault};
pub use shield::{Shield, Timing};
pub use start::Start;
pub use unicycle::UnicycleShield;

#[cfg(test)]
mod tests;

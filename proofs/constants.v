(** * Constants of the Rust code that bound its rounding

    Written by `constants.sh` from the code. Literals are exact here; the code rounds them to doubles. *)

From Coq Require Import Reals.
Open Scope R_scope.

(** `f64::EPSILON` *)
Definition EPSILON : R := / 4503599627370496.

(** `crates/audit/src/sweep.rs` *)
Definition MIN_LIMIT_M : R := 1e-70.
Definition MAX_LENGTH_M : R := 1e70.
Definition RESOLUTION : R := 8.0 * EPSILON.

(** `crates/audit/src/cross_check.rs` *)
Definition GRAZING_BAND : R := 16.0 * EPSILON.

(** `crates/audit/src/pair_sweep.rs` *)
Definition MARGIN : R := 1e-6.
Definition OF_SCALE : R := 1e-23.

(** `crates/shield/src/settings.rs` *)
Definition FARTHEST_M : R := 1e6.
Definition ROUNDING_M : R := 1e-6.
Definition MOTION_M : R := 1.5e-7.
Definition NORMAL_M : R := 8e-8.
Definition STIFF_M : R := 1e4.
Definition UNIT_ROUNDOFF : R := EPSILON / 2.0.

(** `crates/shield/src/plane.rs` *)
Definition UNIT : R := 1e-14.
Definition SINGLE : R := 1e-6.

(** `crates/shield/src/choice.rs` *)
Definition COMMAND_ROUNDING : R := 1e-12.

(** `crates/shield/src/report.rs` *)
Definition UNREPORTED : R := 2.5e-7.

(** `crates/shield/src/tube.rs` *)
Definition CELL_RATE : R := 0.5.
Definition TERMS : R := 20.
Definition STATES : R := 5.
Definition GRID_STEP : R := 60.0.

(** Check sums of modelled functions. After a change, compare the function with its model:

- 2193954305 `fn larger(` of `crates/audit/src/sweep.rs`
- 2367017454 `fn new(` of `crates/audit/src/sweep.rs`
- 2968038786 `fn interpolated(` of `crates/audit/src/sweep.rs`
- 1369544729 `fn scale_squared(` of `crates/audit/src/sweep.rs`
- 1685085019 `fn resolution_m(` of `crates/audit/src/sweep.rs`
- 1479897631 `fn closest(` of `crates/audit/src/sweep.rs`
- 2466265998 `fn improve(` of `crates/audit/src/sweep.rs`
- 272481751 `fn separation_m(` of `crates/audit/src/sweep.rs`
- 808597969 `let is_surely_below` of `crates/audit/src/ledger.rs`
- 3529121054 `fn is_near(` of `crates/audit/src/cross_check.rs`
- 3767419551 `fn grazing_band(` of `crates/audit/src/cross_check.rs`
- 1102818635 `fn with_cutoff(` of `crates/audit/src/pair_sweep.rs`
- 2857011970 `fn add(` of `crates/audit/src/pair_sweep.rs`
- 268577252 `fn add_close(` of `crates/audit/src/pair_sweep.rs`
- 3671343056 `fn straight(&self) ` of `crates/audit/src/pair_sweep.rs`
- 1776232283 `fn interpolated(` of `crates/audit/src/pair_sweep.rs`
- 1172910487 `fn fraction(` of `crates/audit/src/segment.rs`
- 1564478144 `fn scaled(` of `crates/shield/src/plane.rs`
- 479002263 `fn stretch(` of `crates/shield/src/plane.rs`
- 990115067 `fn true_plane(` of `crates/shield/src/plane.rs`
- 2875618280 `fn room_m(` of `crates/shield/src/plane.rs`
- 3522532610 `fn contains(` of `crates/shield/src/plane.rs`
- 4067340868 `fn owner_plane(` of `crates/shield/src/plane.rs`
- 782625003 `fn follower_plane(` of `crates/shield/src/plane.rs`
- 2444268779 `fn unit(` of `crates/shield/src/plane.rs`
- 3642325604 `fn is_valid(` of `crates/shield/src/plane.rs`
- 2741795934 `let margin_m =` of `crates/shield/src/settings.rs`
- 3360143635 `fn exponential(` of `crates/shield/src/tube.rs`
*)

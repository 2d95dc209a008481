(** * Decisions of the first stage of the sweep

    The audit decides with doubles whether two vehicles on straight lines are below a limit: [is_surely_below] finds a
    violation, and a motion that is not [is_near] has none. Otherwise `exact.rs` decides. [samples_clear] and
    [samples_below] prove both decisions, [samples_bounds] and [samples_skipped] the search for the smallest separation.

    The constants are those of the code ([constants]). The two decisions hold for all positions up to [MAX_LENGTH_M] and
    limits from [MIN_LIMIT_M] on, underflow included. The bounds of the smallest separation need a scale of at least
    1e-100 m. *)

From Coq Require Import Reals Lra ZArith Lia.
From Flocq Require Import Core.
From Proofs Require Import geometry doubles constants resolution.
Open Scope R_scope.

(** `larger`. *)
Definition larger (a b : R) : R := if Rlt_dec a b then b else a.

(** `RelativeMotion::scale_squared`. [interpolated] is `interpolated_squared`. *)
Definition scale_squared (from to : vector) (interpolated : R) : R :=
  larger (larger (fdot from from) (fdot to to)) interpolated.

(** `RelativeMotion::resolution_m`. *)
Definition resolution (from to : vector) (interpolated : R) : R :=
  rounded (RESOLUTION * rounded (sqrt (scale_squared from to interpolated))).

(** `is_surely_below` of `Ledger::judge_straight`. *)
Definition is_surely_below (from to : vector) (interpolated limit : R) : Prop :=
  rounded (separation from to + resolution from to interpolated) < limit.

(** `KeepOut::is_near`, with `grazing_band`. The exact stage judges a motion that is near. *)
Definition is_near (from to : vector) (interpolated delta : R) : Prop :=
  closest from to <= rounded (rounded (delta * delta) +
    rounded (GRAZING_BAND * rounded (larger (fdot from from) interpolated + rounded (delta * delta)))).

(** Bounds of `SmallestSeparation::add_close`. *)
Definition lower (from to : vector) (interpolated : R) : R :=
  rounded (separation from to - resolution from to interpolated).
Definition upper (from to : vector) (interpolated : R) : R :=
  rounded (separation from to + resolution from to interpolated).

(** Test of `SmallestSeparation::add`: a motion that is not a candidate is skipped. *)
Definition is_candidate (from to : vector) (interpolated known : R) : Prop :=
  closest from to < rounded (rounded (rounded (known * known) * rounded (1 + rounded MARGIN)) +
    rounded (rounded OF_SCALE * scale_squared from to interpolated)).

Lemma larger_is_most : forall a b, a <= larger a b /\ b <= larger a b.
Proof. intros. unfold larger. destruct (Rlt_dec a b); lra. Qed.

Section Ends.

(** Computed ends, true ends, and the bound of their distance. *)
Variables from to first last : vector.
Variable interpolated : R.
Hypothesis doubles_from : doubles from.
Hypothesis doubles_to : doubles to.
Hypothesis not_huge : norm (sub to from) <= huge.
Hypothesis positive : 0 <= interpolated.

Definition ends_error : R -> R := fun s => norm (sub (on_line from to s) (on_line first last s)).

Let scale_ := sqrt (scale_squared from to interpolated).

Hypothesis ends_are_close : forall s, 0 <= s <= 1 -> 12.41 * u * norm from + ends_error s <= 13.7 * u * scale_ + tiny.

Lemma scale_is_positive : 0 <= scale_squared from to interpolated.
Proof.
  unfold scale_squared. pose proof (larger_is_most (larger (fdot from from) (fdot to to)) interpolated). lra.
Qed.

Lemma scale_is_square : scale_ * scale_ = scale_squared from to interpolated.
Proof. apply sqrt_sqrt, scale_is_positive. Qed.

Lemma from_is_within : norm from <= scale_ + 2 * u * scale_ + 2 * tiny.
Proof.
  pose proof (length_error from) as E. apply Rabs_le_inv in E. pose proof (norm_is_positive from).
  assert (sqrt (fdot from from) <= scale_).
  { apply sqrt_le_1_alt. unfold scale_squared.
    pose proof (larger_is_most (larger (fdot from from) (fdot to to)) interpolated).
    pose proof (larger_is_most (fdot from from) (fdot to to)). lra. }
  pose proof tiny_is_positive. unfold u in *. lra.
Qed.

Lemma resolution_is_between :
  15 * u * scale_ - tiny <= resolution from to interpolated <= scale_ / 1000 + tiny.
Proof.
  unfold resolution. fold scale_. assert (P : 0 <= scale_) by apply sqrt_pos.
  pose proof (rounded_between _ P) as A. pose proof (rounded_is_positive _ P) as PA.
  assert (PR : 0 <= RESOLUTION * rounded scale_).
  { apply Rmult_le_pos; auto. unfold RESOLUTION, EPSILON. lra. }
  pose proof (rounded_between _ PR) as B. unfold RESOLUTION, EPSILON in *.
  pose proof least_below_tiny. pose proof least_is_positive. unfold u in *. lra.
Qed.

Lemma true_end : forall s, norm (on_line first last s) <= norm (on_line from to s) + ends_error s /\
  norm (on_line from to s) <= norm (on_line first last s) + ends_error s.
Proof.
  intros s. pose proof (norms_differ (on_line from to s) (on_line first last s)) as N. apply Rabs_le_inv in N.
  unfold ends_error. lra.
Qed.

Lemma root_is_within : sqrt (closest from to) <= norm from + 1.51 * u * norm from + u * tiny.
Proof. apply root_at_most. apply closest_is_of_candidates. Qed.

(** Bounds of the computed separation by true separations. *)
Lemma separation_is_least : forall s, 0 <= s <= 1 ->
  separation from to <= norm (on_line first last s) + 13.7 * u * scale_ + 5 * tiny.
Proof.
  intros s S. pose proof (root_is_least from to doubles_from doubles_to s not_huge S) as R.
  pose proof (ends_are_close s S) as E. destruct (true_end s) as [_ T].
  pose proof (rounded_between _ (sqrt_pos (closest from to))) as B. fold (separation from to) in B.
  pose proof least_below_tiny. pose proof least_is_positive. pose proof tiny_is_positive.
  pose proof (norm_is_positive from). pose proof (norm_is_positive (on_line from to s)).
  unfold u in *. lra.
Qed.

Lemma separation_is_attained : exists s, 0 <= s <= 1 /\
  norm (on_line first last s) <= separation from to + 13.7 * u * scale_ + 5 * tiny.
Proof.
  destruct (root_is_attained from to doubles_from doubles_to) as (s & S & R). exists s. split; auto.
  pose proof (ends_are_close s S) as E. destruct (true_end s) as [T _].
  pose proof (rounded_between _ (sqrt_pos (closest from to))) as B. fold (separation from to) in B.
  pose proof root_is_within as W.
  pose proof least_below_tiny. pose proof least_is_positive. pose proof tiny_is_positive.
  pose proof (norm_is_positive from). unfold u in *. lra.
Qed.

Lemma separation_is_within : 0 <= separation from to <= scale_ + 7 * u * scale_ + 4 * tiny.
Proof.
  pose proof (rounded_between _ (sqrt_pos (closest from to))) as B. fold (separation from to) in B.
  pose proof root_is_within as W. pose proof from_is_within as F.
  pose proof least_below_tiny. pose proof least_is_positive. pose proof tiny_is_positive.
  assert (0 <= scale_) by apply sqrt_pos. split.
  - apply rounded_is_positive, sqrt_pos.
  - unfold u in *. lra.
Qed.

(** Smallest scale of the bounds \[m\]. *)
Definition least_scale : R := / 10 ^ 100.

Lemma tiny_of_scale : least_scale <= scale_ -> 100 * tiny <= u * scale_ / 100.
Proof.
  intros L. pose proof tiny_is_small as T. unfold least_scale in L.
  assert (/ 10 ^ 140 <= u / 1000000 * / 10 ^ 100).
  { replace (/ 10 ^ 140) with (/ 10 ^ 40 * / 10 ^ 100) by (field; lra).
    apply Rmult_le_compat_r; [left; apply Rinv_0_lt_compat, pow_lt; lra|]. unfold u. lra. }
  assert (0 < / 10 ^ 100) by (apply Rinv_0_lt_compat, pow_lt; lra).
  assert (u * / 10 ^ 100 <= u * scale_) by (apply Rmult_le_compat_l; [unfold u|]; lra).
  unfold u in *. lra.
Qed.

Lemma surely_below_is_below : forall limit,
  double limit -> MIN_LIMIT_M <= limit -> is_surely_below from to interpolated limit ->
  exists s, 0 <= s <= 1 /\ norm (on_line first last s) < limit.
Proof.
  intros limit D M B. apply below_before_rounding in B; auto.
  pose proof resolution_is_between as R. pose proof tiny_is_positive as T.
  assert (P : 0 <= scale_) by apply sqrt_pos.
  destruct (Rle_or_lt least_scale scale_) as [L | L].
  - destruct separation_is_attained as (s & S & A). exists s. split; auto.
    pose proof (tiny_of_scale L). unfold u in *. lra.
  - exists 0. split; [lra|]. destruct (true_end 0) as [E _]. rewrite <- (from_is_on_line from to) in E.
    pose proof from_is_within as F. pose proof (ends_are_close 0 ltac:(lra)) as G.
    pose proof tiny_is_small as TS. unfold least_scale in L.
    assert (/ 10 ^ 140 <= / 10 ^ 100) by (apply Rinv_le; [apply pow_lt; lra | apply Rle_pow; [lra|lia]]).
    pose proof (norm_is_positive from).
    assert (10 * / 10 ^ 100 < MIN_LIMIT_M) by (unfold MIN_LIMIT_M; lra).
    unfold u in *. lra.
Qed.

Lemma bounds_enclose : least_scale <= scale_ ->
  (forall s, 0 <= s <= 1 -> lower from to interpolated <= norm (on_line first last s)) /\
  exists s, 0 <= s <= 1 /\ norm (on_line first last s) <= upper from to interpolated.
Proof.
  intros L. pose proof (tiny_of_scale L) as T. pose proof resolution_is_between as R. pose proof tiny_is_positive.
  pose proof separation_is_within as W. pose proof least_below_tiny. pose proof least_is_positive.
  assert (P : 0 <= scale_) by apply sqrt_pos. split.
  - intros s S. pose proof (separation_is_least s S) as A. unfold lower.
    pose proof (rounding_error (separation from to - resolution from to interpolated)) as E. apply Rabs_le_inv in E.
    assert (Rabs (separation from to - resolution from to interpolated) <= 1.01 * scale_)
      by (apply Rabs_le; unfold u in *; lra).
    unfold u in *. lra.
  - destruct separation_is_attained as (s & S & A). exists s. split; auto. unfold upper.
    pose proof (rounding_error (separation from to + resolution from to interpolated)) as E. apply Rabs_le_inv in E.
    assert (Rabs (separation from to + resolution from to interpolated) <= 1.01 * scale_)
      by (apply Rabs_le; unfold u in *; lra).
    unfold u in *. lra.
Qed.

Lemma least_of_scale : least_scale <= scale_ -> least <= scale_ * scale_ / 10 ^ 30.
Proof.
  intros L. pose proof (tiny_of_scale L) as T. pose proof tiny_is_positive. pose proof least_is_small as E.
  assert (tiny * tiny <= scale_ * scale_).
  { assert (tiny <= scale_) by (unfold u in *; lra). apply Rmult_le_compat; lra. }
  assert (0 <= tiny * tiny) by (apply Rle_0_sqr).
  replace (u * tiny * (u * tiny)) with (u * u * (tiny * tiny)) in E by ring. unfold u in *. lra.
Qed.

Lemma skipped_is_not_below : forall known, 0 <= known -> least_scale <= scale_ ->
  ~ is_candidate from to interpolated known ->
  forall s, 0 <= s <= 1 -> known <= norm (on_line first last s).
Proof.
  intros known K L N s S. unfold is_candidate in N. apply Rnot_lt_le in N.
  destruct (Rle_or_lt known (norm (on_line first last s))) as [|B]; auto. exfalso.
  pose proof (tiny_of_scale L) as T. pose proof (least_of_scale L) as TL. pose proof tiny_is_positive.
  pose proof least_is_positive as PL. assert (P : 0 <= scale_) by apply sqrt_pos.
  rewrite <- scale_is_square in N.
  assert (PSS : 0 <= scale_ * scale_) by (now apply Rmult_le_pos).
  assert (PKK : 0 <= known * known) by (now apply Rmult_le_pos).
  pose proof (rounded_between _ PKK) as R1. pose proof (rounded_is_positive _ PKK) as P1.
  assert (M : (1 + 0.999 * MARGIN) <= rounded (1 + rounded MARGIN)).
  { pose proof (rounded_between MARGIN) as A. assert (0 <= MARGIN) by (unfold MARGIN; lra).
    pose proof (rounded_is_positive MARGIN). pose proof (rounded_between (1 + rounded MARGIN)) as C.
    pose proof tiny_is_small. assert (/ 10 ^ 140 <= 1) by lra. pose proof least_below_tiny.
    unfold MARGIN, u in *. lra. }
  assert (O : 0.999 * OF_SCALE <= rounded OF_SCALE).
  { pose proof (rounded_between OF_SCALE) as A. assert (0 <= OF_SCALE) by (unfold OF_SCALE; lra).
    pose proof tiny_is_small. assert (/ 10 ^ 140 <= OF_SCALE / 10000) by (unfold OF_SCALE; lra).
    pose proof least_below_tiny.
    unfold OF_SCALE, u in *. lra. }
  set (a := rounded (known * known)) in *. set (b := rounded (1 + rounded MARGIN)) in *.
  set (o := rounded OF_SCALE) in *.
  assert (AB : a * (1 + 0.999 * MARGIN) <= a * b) by (now apply Rmult_le_compat_l).
  assert (OS : 0.999 * OF_SCALE * (scale_ * scale_) <= o * (scale_ * scale_)) by (now apply Rmult_le_compat_r).
  assert (PAB : 0 <= a * b) by (apply Rle_trans with (a * (1 + 0.999 * MARGIN)); auto;
    apply Rmult_le_pos; auto; unfold MARGIN; lra).
  assert (POS : 0 <= o * (scale_ * scale_)) by (eapply Rle_trans; [|exact OS];
    apply Rmult_le_pos; auto; unfold OF_SCALE; lra).
  pose proof (rounded_between _ PAB) as R2. pose proof (rounded_between _ POS) as R3.
  pose proof (rounded_is_positive _ PAB) as P2. pose proof (rounded_is_positive _ POS) as P3.
  pose proof (rounded_between _ (Rplus_le_le_0_compat _ _ P2 P3)) as R4.
  (* The root is below the known separation and its error. *)
  pose proof (root_is_least from to doubles_from doubles_to s not_huge S) as R.
  pose proof (ends_are_close s S) as E. destruct (true_end s) as [_ TE].
  pose proof (norm_is_positive from). pose proof (norm_is_positive (on_line from to s)).
  set (root := sqrt (closest from to)) in *.
  assert (RR : root * root = closest from to) by (apply sqrt_sqrt, closest_is_positive).
  assert (PR : 0 <= root) by apply sqrt_pos.
  assert (A : root <= known + 13.8 * u * scale_) by (unfold u in *; lra).
  assert (C : closest from to <= (known + 13.8 * u * scale_) * (known + 13.8 * u * scale_)).
  { rewrite <- RR. apply Rmult_le_compat; auto. }
  (* 2 a b <= m a^2 + b^2 / m. *)
  pose proof (Rle_0_sqr (known * 0.0009 - 13.8 * u * scale_ / 0.0009)) as Sq. unfold Rsqr in Sq.
  unfold MARGIN, OF_SCALE, u in *. lra.
Qed.

Let band := sqrt (larger (fdot from from) interpolated).

Hypothesis start_is_close : forall s, 0 <= s <= 1 ->
  12.41 * u * norm from + ends_error s <= 14.5 * u * band + 1.01 * u * norm (on_line first last s) + tiny.

Lemma clear_is_clear : forall delta, MIN_LIMIT_M <= delta -> ~ is_near from to interpolated delta ->
  forall s, 0 <= s <= 1 -> delta <= norm (on_line first last s).
Proof.
  intros delta M N s S. unfold is_near in N. apply Rnot_le_lt in N.
  destruct (Rle_or_lt delta (norm (on_line first last s))) as [|B]; auto. exfalso.
  assert (PI : 0 <= larger (fdot from from) interpolated).
  { pose proof (larger_is_most (fdot from from) interpolated). lra. }
  assert (BB : band * band = larger (fdot from from) interpolated) by (now apply sqrt_sqrt).
  rewrite <- BB in N. assert (PB : 0 <= band) by apply sqrt_pos.
  assert (PD : 0 < MIN_LIMIT_M) by (unfold MIN_LIMIT_M; lra).
  assert (T : tiny <= u * delta / 1000 /\ least <= u * (delta * delta) / 1000).
  { pose proof tiny_is_small as T. pose proof least_is_small as L. pose proof tiny_is_positive.
    assert (/ 10 ^ 140 <= u / 1000 * MIN_LIMIT_M) by (unfold MIN_LIMIT_M, u; lra).
    assert (u / 1000 * MIN_LIMIT_M <= u / 1000 * delta) by (apply Rmult_le_compat_l; [unfold u|]; lra).
    assert (TD : tiny <= delta) by (unfold u in *; lra).
    assert (tiny * tiny <= delta * delta) by (apply Rmult_le_compat; lra).
    assert (0 <= tiny * tiny) by apply Rle_0_sqr.
    replace (u * tiny * (u * tiny)) with (u * u * (tiny * tiny)) in L by ring. unfold u in *. lra. }
  destruct T as [TD TL]. pose proof least_is_positive as PL. pose proof tiny_is_positive as PT.
  assert (PDD : 0 <= delta * delta) by (apply Rmult_le_pos; lra).
  assert (PBB : 0 <= band * band) by (now apply Rmult_le_pos).
  pose proof (rounded_between _ PDD) as R1. pose proof (rounded_is_positive _ PDD) as P1.
  set (a := rounded (delta * delta)) in *.
  pose proof (rounded_between _ (Rplus_le_le_0_compat _ _ PBB P1)) as R2.
  pose proof (rounded_is_positive _ (Rplus_le_le_0_compat _ _ PBB P1)) as P2.
  set (b := rounded (band * band + a)) in *.
  assert (PG : 0 <= GRAZING_BAND * b) by (apply Rmult_le_pos; auto; unfold GRAZING_BAND, EPSILON; lra).
  pose proof (rounded_between _ PG) as R3. pose proof (rounded_is_positive _ PG) as P3.
  set (c := rounded (GRAZING_BAND * b)) in *.
  pose proof (rounded_between _ (Rplus_le_le_0_compat _ _ P1 P3)) as R4.
  pose proof (root_is_least from to doubles_from doubles_to s not_huge S) as R.
  pose proof (start_is_close s S) as E. destruct (true_end s) as [_ TE].
  pose proof (norm_is_positive from). pose proof (norm_is_positive (on_line from to s)).
  set (root := sqrt (closest from to)) in *.
  assert (RR : root * root = closest from to) by (apply sqrt_sqrt, closest_is_positive).
  assert (PR : 0 <= root) by apply sqrt_pos.
  assert (A : root <= (1 + 0.1 * u) * delta + 14.51 * u * band) by (unfold u in *; lra).
  assert (C : closest from to <=
    ((1 + 0.1 * u) * delta + 14.51 * u * band) * ((1 + 0.1 * u) * delta + 14.51 * u * band)).
  { rewrite <- RR. apply Rmult_le_compat; auto. }
  pose proof (Rle_0_sqr (delta - band)) as Sq. unfold Rsqr in Sq.
  unfold GRAZING_BAND, EPSILON, u in *. lra.
Qed.

End Ends.

(** ** Two samples at both ends

    `RelativeMotion::new(b.from - a.from, b.to - a.to)` of `Overlap::straight`. *)

(** Positions of two vehicles at both ends. *)
Record samples := { a_from : vector; a_to : vector; b_from : vector; b_to : vector }.

Definition is_position (a : vector) : Prop :=
  doubles a /\ Rabs (x a) <= MAX_LENGTH_M /\ Rabs (y a) <= MAX_LENGTH_M /\ Rabs (z a) <= MAX_LENGTH_M.

Definition are_positions (p : samples) : Prop :=
  is_position (a_from p) /\ is_position (a_to p) /\ is_position (b_from p) /\ is_position (b_to p).

(** Computed relative positions at both ends. *)
Definition computed_from (p : samples) : vector := fsub (b_from p) (a_from p).
Definition computed_to (p : samples) : vector := fsub (b_to p) (a_to p).

(** True relative position at a fraction of the motion. *)
Definition relative (p : samples) (s : R) : vector :=
  on_line (sub (b_from p) (a_from p)) (sub (b_to p) (a_to p)) s.

(** Scale of the bound \[m\]. *)
Definition scale_of (p : samples) : R := sqrt (scale_squared (computed_from p) (computed_to p) 0).

Lemma position_is_short : forall a, is_position a -> norm a <= 2 * MAX_LENGTH_M.
Proof.
  intros a (_ & X & Y & Z). set (k := {| x := MAX_LENGTH_M; y := MAX_LENGTH_M; z := MAX_LENGTH_M |}).
  assert (P : 0 <= MAX_LENGTH_M) by (unfold MAX_LENGTH_M; lra).
  apply norm_at_most; [lra|]. unfold dot.
  assert (Q : forall c, Rabs c <= MAX_LENGTH_M -> c * c <= MAX_LENGTH_M * MAX_LENGTH_M).
  { intros c C. rewrite <- (Rabs_pos_eq (c * c)) by apply Rle_0_sqr. rewrite Rabs_mult.
    apply Rmult_le_compat; auto using Rabs_pos. }
  pose proof (Q _ X). pose proof (Q _ Y). pose proof (Q _ Z). assert (0 <= MAX_LENGTH_M * MAX_LENGTH_M) by nra. lra.
Qed.

Lemma difference_is_short : forall a b, norm (sub a b) <= norm a + norm b.
Proof.
  intros a b. replace (sub a b) with (add a (sub {| x := 0; y := 0; z := 0 |} b))
    by (unfold add, sub; cbn; f_equal; ring).
  eapply Rle_trans; [apply triangle|]. apply Rplus_le_compat_l. right.
  unfold norm. f_equal. unfold dot, sub. cbn. ring.
Qed.

Lemma short_is_not_huge : 100 * MAX_LENGTH_M <= huge.
Proof.
  unfold huge.
  rewrite <- IZR_Zpower by lia. unfold MAX_LENGTH_M.
  apply Rle_trans with (IZR (2 ^ 240)); [lra|]. apply IZR_le. vm_compute. discriminate.
Qed.

Lemma computed_difference : forall a b, doubles a -> doubles b ->
  norm (sub (fsub a b) (sub a b)) <= u * norm (sub a b) /\
  norm (fsub a b) <= (1 + u) * norm (sub a b) /\ (1 - u) * norm (sub a b) <= norm (fsub a b).
Proof.
  intros a b A B. pose proof (fsub_error a b A B) as E. pose proof (norms_differ (fsub a b) (sub a b)) as N.
  apply Rabs_le_inv in N. lra.
Qed.

Section Samples.

Variable p : samples.
Hypothesis positions : are_positions p.

Let from := computed_from p.
Let to := computed_to p.
Let first := sub (b_from p) (a_from p).
Let last := sub (b_to p) (a_to p).

Lemma samples_are_not_huge : norm (sub to from) <= huge.
Proof.
  destruct positions as (A & B & C & D).
  pose proof (position_is_short _ A). pose proof (position_is_short _ B).
  pose proof (position_is_short _ C). pose proof (position_is_short _ D).
  destruct (computed_difference (b_from p) (a_from p)) as (_ & F & _); try apply C; try apply A.
  destruct (computed_difference (b_to p) (a_to p)) as (_ & T & _); try apply D; try apply B.
  pose proof (difference_is_short (b_from p) (a_from p)). pose proof (difference_is_short (b_to p) (a_to p)).
  pose proof (difference_is_short to from). pose proof short_is_not_huge.
  unfold from, to, computed_from, computed_to in *.
  assert (0 <= MAX_LENGTH_M) by (unfold MAX_LENGTH_M; lra). unfold u in *. lra.
Qed.

Lemma error_between : forall s, 0 <= s <= 1 ->
  ends_error from to first last s <= (1 - s) * (u * norm first) + s * (u * norm last).
Proof.
  intros s S. destruct positions as (A & B & C & D). unfold ends_error.
  replace (sub (on_line from to s) (on_line first last s)) with
    (add (scale (1 - s) (sub from first)) (scale s (sub to last)))
    by (unfold on_line, add, sub, scale; cbn; f_equal; ring).
  eapply Rle_trans; [apply triangle|]. rewrite !norm_scale by lra.
  apply Rplus_le_compat; (apply Rmult_le_compat_l; [lra|]); apply computed_difference;
    first [apply A | apply B | apply C | apply D].
Qed.

Lemma samples_are_close : forall s, 0 <= s <= 1 ->
  12.41 * u * norm from + ends_error from to first last s <= 13.7 * u * sqrt (scale_squared from to 0) + tiny.
Proof.
  intros s S. pose proof (error_between s S) as E. destruct positions as (A & B & C & D).
  destruct (computed_difference (b_from p) (a_from p)) as (_ & _ & F); try apply C; try apply A.
  destruct (computed_difference (b_to p) (a_to p)) as (_ & _ & T); try apply D; try apply B.
  fold first last from to in F, T |- *. change (fsub (b_from p) (a_from p)) with from in F.
  change (fsub (b_to p) (a_to p)) with to in T.
  pose proof (from_is_within from to 0) as W.
  set (Sc := sqrt (scale_squared from to 0)) in *.
  assert (PS : 0 <= Sc) by apply sqrt_pos.
  assert (W' : norm to <= Sc + 2 * u * Sc + 2 * tiny).
  { pose proof (length_error to) as L. apply Rabs_le_inv in L. pose proof (norm_is_positive to).
    assert (sqrt (fdot to to) <= Sc).
    { apply sqrt_le_1_alt. unfold scale_squared. pose proof (larger_is_most (larger (fdot from from) (fdot to to)) 0).
      pose proof (larger_is_most (fdot from from) (fdot to to)). lra. }
    pose proof tiny_is_positive. unfold u in *. lra. }
  pose proof tiny_is_positive as PT.
  assert (K : forall k, (1 - u) * k <= Sc + 2 * u * Sc + 2 * tiny -> u * k <= 1.01 * u * Sc + 3 * u * tiny)
    by (intros k K; unfold u in *; lra).
  assert (F' : u * norm first <= 1.01 * u * Sc + 3 * u * tiny) by (apply K; lra).
  assert (T' : u * norm last <= 1.01 * u * Sc + 3 * u * tiny) by (apply K; lra).
  assert ((1 - s) * (u * norm first) <= (1 - s) * (1.01 * u * Sc + 3 * u * tiny)) by (apply Rmult_le_compat_l; lra).
  assert (s * (u * norm last) <= s * (1.01 * u * Sc + 3 * u * tiny)) by (apply Rmult_le_compat_l; lra).
  unfold u in *. lra.
Qed.

Lemma samples_start_close : forall s, 0 <= s <= 1 ->
  12.41 * u * norm from + ends_error from to first last s <=
  14.5 * u * sqrt (larger (fdot from from) 0) + 1.01 * u * norm (on_line first last s) + tiny.
Proof.
  intros s S. pose proof (error_between s S) as E. destruct positions as (A & B & C & D).
  destruct (computed_difference (b_from p) (a_from p)) as (_ & _ & F); try apply C; try apply A.
  change (fsub (b_from p) (a_from p)) with from in F. fold first in F.
  assert (L : larger (fdot from from) 0 = fdot from from).
  { unfold larger. pose proof (fdot_self_is_positive from). destruct Rlt_dec; lra. }
  rewrite L. pose proof (length_error from) as N. apply Rabs_le_inv in N.
  pose proof (norm_is_positive from) as PF. pose proof (norm_is_positive first) as P0.
  pose proof (norm_is_positive last).
  (* s r1 = r(s) - (1 - s) r0 *)
  assert (W : s * norm last <= norm (on_line first last s) + (1 - s) * norm first).
  { rewrite <- !norm_scale by lra. replace (scale s last) with (sub (on_line first last s) (scale (1 - s) first))
      by (unfold on_line, add, sub, scale; cbn; f_equal; ring).
    apply difference_is_short. }
  assert ((1 - s) * norm first <= 1 * norm first) by (apply Rmult_le_compat_r; lra).
  pose proof tiny_is_positive.
  assert (E' : ends_error from to first last s <= u * norm (on_line first last s) + 2 * u * norm first).
  { replace ((1 - s) * (u * norm first) + s * (u * norm last)) with
      (u * ((1 - s) * norm first) + u * (s * norm last)) in E by ring.
    assert (u * (s * norm last) <= u * (norm (on_line first last s) + (1 - s) * norm first))
      by (apply Rmult_le_compat_l; [unfold u|]; lra).
    unfold u in *. lra. }
  pose proof (norm_is_positive (on_line first last s)).
  unfold u in *. lra.
Qed.

Lemma samples_are_doubles : doubles from /\ doubles to.
Proof. split; apply fsub_is_doubles. Qed.

End Samples.

(** The first stage excludes a violation: the vehicles are at least delta apart at all times of the motion. *)
Theorem samples_clear : forall p delta s,
  are_positions p -> MIN_LIMIT_M <= delta -> ~ is_near (computed_from p) (computed_to p) 0 delta -> 0 <= s <= 1 ->
  delta <= norm (relative p s).
Proof.
  intros p delta s P D N S. destruct (samples_are_doubles p).
  apply (clear_is_clear (computed_from p) (computed_to p) (sub (b_from p) (a_from p)) (sub (b_to p) (a_to p)) 0);
    auto; try lra; [now apply samples_are_not_huge | now apply samples_start_close].
Qed.

(** The first stage finds a violation: the vehicles are below the limit at some time of the motion. *)
Theorem samples_below : forall p limit,
  are_positions p -> double limit -> MIN_LIMIT_M <= limit ->
  is_surely_below (computed_from p) (computed_to p) 0 limit ->
  exists s, 0 <= s <= 1 /\ norm (relative p s) < limit.
Proof.
  intros p limit P D L B. destruct (samples_are_doubles p).
  apply (surely_below_is_below (computed_from p) (computed_to p) (sub (b_from p) (a_from p)) (sub (b_to p) (a_to p)) 0);
    auto; try lra. now apply samples_are_close.
Qed.

(** The smallest separation is between the two bounds. *)
Theorem samples_bounds : forall p, are_positions p -> least_scale <= scale_of p ->
  (forall s, 0 <= s <= 1 -> lower (computed_from p) (computed_to p) 0 <= norm (relative p s)) /\
  exists s, 0 <= s <= 1 /\ norm (relative p s) <= upper (computed_from p) (computed_to p) 0.
Proof.
  intros p P L. destruct (samples_are_doubles p).
  apply (bounds_enclose (computed_from p) (computed_to p) (sub (b_from p) (a_from p)) (sub (b_to p) (a_to p)) 0);
    auto; try lra; [now apply samples_are_not_huge | now apply samples_are_close].
Qed.

(** A skipped motion is not closer than the known separation. *)
Theorem samples_skipped : forall p known s, are_positions p -> least_scale <= scale_of p -> 0 <= known ->
  ~ is_candidate (computed_from p) (computed_to p) 0 known -> 0 <= s <= 1 -> known <= norm (relative p s).
Proof.
  intros p known s P L K N S. destruct (samples_are_doubles p).
  apply (skipped_is_not_below (computed_from p) (computed_to p) (sub (b_from p) (a_from p)) (sub (b_to p) (a_to p)) 0);
    auto; try lra; [now apply samples_are_not_huge | now apply samples_are_close].
Qed.

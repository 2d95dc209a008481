(** * Rounding of the planes of the shield

    Model of `Divider::owner_plane`, `Divider::follower_plane`, `Plane::room_m` and `Plane::contains` of
    `crates/shield/src/plane.rs`, and of the margin of `Settings::limits`, operation by operation. *)

From Coq Require Import Reals Lra ZArith Lia.
From Flocq Require Import Core.
From Proofs Require Import geometry doubles constants resolution.
Open Scope R_scope.

(** `Plane`. *)
Record plane := { plane_normal : vector; plane_offset : R }.

(** `Plane::room_m`. *)
Definition room (p : plane) (a : vector) : R := rounded (plane_offset p - fdot (plane_normal p) a).

Definition fdivide (a : vector) (k : R) : vector :=
  {| x := rounded (x a / k); y := rounded (y a / k); z := rounded (z a / k) |}.

Definition opposite (a : vector) : vector := {| x := - x a; y := - y a; z := - z a |}.

(** `Metric::scaled`, computed and exact. *)
Definition fscaled (vertical : R) (a : vector) : vector := {| x := x a; y := y a; z := rounded (z a * vertical) |}.
Definition scaled (vertical : R) (a : vector) : vector := {| x := x a; y := y a; z := z a * vertical |}.

(** `Metric::stretch`. *)
Definition stretch (vertical : R) : R := Rmax vertical 1.

(** `Metric::true_plane`. *)
Definition true_plane (vertical : R) (n : vector) (offset : R) : plane :=
  if Req_EM_T vertical 1 then {| plane_normal := n; plane_offset := offset |}
  else
    let s := fscaled vertical n in
    let length := rounded (sqrt (fdot s s)) in
    {| plane_normal := fdivide s length; plane_offset := rounded (offset / length) |}.

(** `Divider::unit`. *)
Definition unit_of (n : vector) (offset : R) : vector * R :=
  let squared := fdot n n in
  if Rle_dec (Rabs (rounded (squared - 1))) (rounded UNIT) then (n, offset)
  else let length := rounded (sqrt squared) in (fdivide n length, rounded (offset / length)).

(** `Divider::owner_plane` and `Divider::follower_plane`. *)
Definition owner_plane (vertical : R) (n : vector) (offset margin : R) : plane :=
  let (n, o) := unit_of n offset in true_plane vertical n (rounded (o - margin)).
Definition follower_plane (vertical : R) (n : vector) (offset margin : R) : plane :=
  let (n, o) := unit_of n offset in true_plane vertical (opposite n) (rounded (- o - margin)).

(** `Divider::is_valid`. *)
Definition is_valid (n : vector) : Prop := Rabs (rounded (fdot n n - 1)) <= rounded SINGLE.

(** `margin_m` of `Settings::limits`; `f64::midpoint` of these sizes is half of the sum. *)
Definition margin_of (delta vertical e : R) : R :=
  rounded (rounded (rounded (delta + rounded (rounded ROUNDING_M * stretch vertical)) / 2) +
    rounded (e * stretch vertical)).

(** Point with coordinates of at most [FARTHEST_M]. *)
Definition is_near_origin (a : vector) : Prop :=
  doubles a /\ Rabs (x a) <= FARTHEST_M /\ Rabs (y a) <= FARTHEST_M /\ Rabs (z a) <= FARTHEST_M.

(** Vertical factors for which nothing underflows. *)
Definition is_factor (vertical : R) : Prop := double vertical /\ / 10 ^ 30 <= vertical <= 10 ^ 30.

(** The unit of rounding of the code. *)
Lemma unit_of_the_code : u = UNIT_ROUNDOFF.
Proof. unfold u, UNIT_ROUNDOFF, EPSILON. lra. Qed.

(** Length that a plane at a point costs, in units of the stretch: the row of `settings.rs` \[m\]. *)
Definition PLANE_M : R := 16 * u * FARTHEST_M.

(** Largest deviation of the length of a unit normal from 1. *)
Definition OFF_UNIT : R := 5.2e-15.

(** Rounding of the reference of a vehicle in the rows of `settings.rs` that are not proved here: an excess that is not
    reported, brake and reference, and the largest command \[m\]. *)
Definition REFERENCE_M : R := UNREPORTED + MOTION_M + COMMAND_ROUNDING * STIFF_M.

(** The rows of the budget before an obstacle add up to at most half of [ROUNDING_M]. *)
Theorem obstacle_budget : REFERENCE_M + NORMAL_M + PLANE_M + OFF_UNIT * FARTHEST_M + 1e-9 <= ROUNDING_M / 2.
Proof.
  unfold REFERENCE_M, NORMAL_M, PLANE_M, OFF_UNIT, FARTHEST_M, UNREPORTED, MOTION_M, COMMAND_ROUNDING, STIFF_M,
    ROUNDING_M, u. lra.
Qed.

Definition is_unit (n : vector) : Prop := doubles n /\ 1 - OFF_UNIT <= norm n <= 1 + OFF_UNIT.

(** Bound of the errors of underflow, 5e-100. *)
Definition slight : R := bpow radix2 (-330).

Lemma least_is_slight : 0 < least /\ 10 ^ 40 * least <= slight.
Proof.
  split; [apply least_is_positive|]. apply Rle_trans with (bpow radix2 140 * least).
  - apply Rmult_le_compat_r; [pose proof least_is_positive; lra|]. rewrite <- IZR_Zpower by lia. rewrite pow_IZR.
    apply IZR_le. vm_compute. discriminate.
  - unfold least, slight. rewrite <- bpow_plus. apply bpow_le. lia.
Qed.

Lemma slight_is_small : tiny <= slight <= u / 10 ^ 40.
Proof.
  split; [apply bpow_le; lia|]. unfold slight. rewrite u_is_power.
  replace (-330)%Z with (-53 + - (277))%Z by lia. rewrite bpow_plus. apply Rmult_le_compat_l; [apply bpow_ge_0|].
  rewrite bpow_opp. apply Rinv_le; [apply pow_lt; lra|]. rewrite <- IZR_Zpower by lia. rewrite pow_IZR.
  apply IZR_le. vm_compute. discriminate.
Qed.

Lemma near_is_short : forall a, is_near_origin a -> norm a <= 1.7321 * FARTHEST_M.
Proof.
  intros a (_ & X & Y & Z). assert (P : 0 <= FARTHEST_M) by (unfold FARTHEST_M; lra).
  apply norm_at_most; [lra|]. unfold dot.
  assert (Q : forall c, Rabs c <= FARTHEST_M -> c * c <= FARTHEST_M * FARTHEST_M).
  { intros c C. rewrite <- (Rabs_pos_eq (c * c)) by apply Rle_0_sqr. rewrite Rabs_mult.
    apply Rmult_le_compat; auto using Rabs_pos. }
  pose proof (Q _ X). pose proof (Q _ Y). pose proof (Q _ Z). assert (0 <= FARTHEST_M * FARTHEST_M) by nra. lra.
Qed.

Lemma room_is_exact : forall p a, double (plane_offset p) -> 0 <= room p a -> fdot (plane_normal p) a <= plane_offset p.
Proof.
  intros p a D R. unfold room in R.
  pose proof (difference_error _ _ D (fdot_is_double (plane_normal p) a)) as E.
  set (d := plane_offset p - fdot (plane_normal p) a) in *. destruct (Rle_or_lt 0 d) as [G | G]; [unfold d in G; lra|].
  rewrite (Rabs_left d G) in E. apply Rabs_le_inv in E. exfalso.
  assert (u * - d < - d) by (unfold u; lra). lra.
Qed.

(** A dot product that is at most a computed bound is at most the exact bound and its rounding. *)
Lemma bound_before_rounding : forall w a A X k t,
  0 <= A -> 0 <= t -> 0 <= k <= 10 -> Rabs w <= A -> w <= a + k * u * A + t -> Rabs (a - X) <= 2.01 * u * Rabs X + t ->
  w <= X + (k + 2.1) * u * A + 3 * t.
Proof.
  intros w a A X k t PA Pt Pk W B E. apply Rabs_le_inv in W, E.
  assert (KA : 0 <= k * u * A <= 10 * u * A).
  { assert (0 <= u * A) by (apply Rmult_le_pos; [unfold u; lra|auto]).
    split; [|apply Rle_trans with (10 * (u * A)); [|lra]].
    - rewrite Rmult_assoc. apply Rmult_le_pos; lra.
    - rewrite Rmult_assoc. apply Rmult_le_compat_r; lra. }
  set (j := k * u * A) in *. replace ((k + 2.1) * u * A) with (j + 2.1 * u * A) by (unfold j; ring).
  destruct (Rle_or_lt A X) as [Big | Small]; [unfold u in *; lra|].
  unfold Rabs in E. destruct (Rcase_abs X) as [N | N].
  - destruct (Rle_or_lt (- X) (1.01 * A)); unfold u in *; lra.
  - unfold u in *. lra.
Qed.

Section Plane.

Variables (vertical : R) (n : vector) (p : vector) (bound offset : R).
Hypothesis factor : is_factor vertical.
Hypothesis unit_n : is_unit n.
Hypothesis near_p : is_near_origin p.
Hypothesis double_offset : double offset.
Hypothesis offset_is_rounded : Rabs (offset - bound) <= u * Rabs bound.

Let s := scaled vertical n.
Let product := norm s * norm p.

Lemma dot_of_scaled : dot n (scaled vertical p) = dot s p.
Proof. unfold dot, s, scaled. cbn. ring. Qed.

Lemma stretch_is_most : vertical <= stretch vertical /\ 1 <= stretch vertical.
Proof. unfold stretch. split; [apply Rmax_l | apply Rmax_r]. Qed.

Lemma scaled_is_short : norm s <= (1 + OFF_UNIT) * stretch vertical.
Proof.
  destruct stretch_is_most as [V O]. destruct factor as (_ & F & _).
  assert (0 < / 10 ^ 30) by (apply Rinv_0_lt_compat, pow_lt; lra).
  apply Rle_trans with (stretch vertical * norm n).
  - apply norm_at_most; [apply Rmult_le_pos; [lra|apply norm_is_positive]|].
    replace (stretch vertical * norm n * (stretch vertical * norm n))
      with (stretch vertical * stretch vertical * (norm n * norm n)) by ring.
    rewrite norm_squared. unfold dot, s, scaled. cbn.
    set (k := stretch vertical) in *.
    assert (1 * 1 <= k * k) by (apply Rmult_le_compat; lra).
    assert (vertical * vertical <= k * k) by (apply Rmult_le_compat; lra).
    assert (1 * (x n * x n) <= k * k * (x n * x n)) by (apply Rmult_le_compat_r; [apply Rle_0_sqr|lra]).
    assert (1 * (y n * y n) <= k * k * (y n * y n)) by (apply Rmult_le_compat_r; [apply Rle_0_sqr|lra]).
    assert (vertical * vertical * (z n * z n) <= k * k * (z n * z n))
      by (apply Rmult_le_compat_r; [apply Rle_0_sqr|lra]).
    lra.
  - rewrite Rmult_comm. apply Rmult_le_compat_r; [lra|]. destruct unit_n. lra.
Qed.

Lemma product_is_small : 0 <= product <= 1.73211 * FARTHEST_M * stretch vertical.
Proof.
  pose proof scaled_is_short. pose proof (near_is_short p near_p). destruct stretch_is_most.
  unfold product. split; [apply Rmult_le_pos; apply norm_is_positive|].
  apply Rle_trans with ((1 + OFF_UNIT) * stretch vertical * (1.7321 * FARTHEST_M)).
  - apply Rmult_le_compat; auto using norm_is_positive.
  - unfold OFF_UNIT, FARTHEST_M. lra.
Qed.

Lemma ball_side : vertical = 1 -> 0 <= room (true_plane vertical n offset) p ->
  dot n (scaled vertical p) <= bound + 6 * u * product + slight.
Proof.
  intros V R. unfold true_plane in R. destruct (Req_EM_T vertical 1) as [_|]; [|lra].
  apply room_is_exact in R; auto. cbn in R.
  rewrite dot_of_scaled. assert (E : s = n).
  { unfold s, scaled. rewrite V. destruct n. cbn. f_equal. ring. }
  pose proof (fdot_error n p) as D. unfold product. rewrite E in *. apply Rabs_le_inv in D.
  destruct least_is_slight.
  assert (PA : 0 <= norm n * norm p) by (apply Rmult_le_pos; apply norm_is_positive).
  assert (B : dot n p <= bound + (3.0001 + 2.1) * u * (norm n * norm p) + 3 * (4 * least)).
  { apply bound_before_rounding with offset; try lra; [apply cauchy_schwarz|].
    pose proof (Rabs_pos bound). unfold u in *. lra. }
  unfold u in *. lra.
Qed.

(** A scaled normal that is computed, and divided by its length. *)
Let s' := fscaled vertical n.
Let length := rounded (sqrt (fdot s' s')).

Lemma scaled_is_doubles : doubles s'.
Proof. destruct unit_n as ((A & B & C) & _). repeat split; auto. apply rounded_is_double. Qed.

Lemma scaled_error : norm (sub s' s) <= u * norm s + 2 * least.
Proof.
  rewrite <- norm_scale by (unfold u; lra). pose proof least_is_positive.
  apply norm_of_coordinates; [lra| | |]; unfold s', s, scaled, fscaled, sub, scale; cbn [x y z];
    rewrite Rabs_mult, (Rabs_pos_eq u) by (unfold u; lra).
  - rewrite Rminus_eq_0, Rabs_R0. pose proof (Rabs_pos (x n)). unfold u; lra.
  - rewrite Rminus_eq_0, Rabs_R0. pose proof (Rabs_pos (y n)). unfold u; lra.
  - apply rounding_error.
Qed.

Lemma scaled_is_long : / 10 ^ 31 <= norm s.
Proof.
  destruct factor as (_ & F & _). destruct unit_n as (_ & N & _).
  assert (P : 0 < / 10 ^ 30) by (apply Rinv_0_lt_compat, pow_lt; lra).
  set (k := / 10 ^ 30) in *. assert (K1 : k <= 1) by (unfold k; lra).
  apply Rle_trans with (k * norm n).
  - apply Rle_trans with (k * (1 - OFF_UNIT)); [unfold k, OFF_UNIT; lra|]. apply Rmult_le_compat_l; lra.
  - rewrite <- norm_scale by lra. apply norm_at_most; [apply norm_is_positive|]. rewrite norm_squared.
    unfold dot, s, scaled, scale. cbn.
    assert (k * k <= 1 * 1) by (apply Rmult_le_compat; lra).
    assert (k * k <= vertical * vertical) by (apply Rmult_le_compat; lra).
    assert (k * k * (x n * x n) <= 1 * (x n * x n)) by (apply Rmult_le_compat_r; [apply Rle_0_sqr|lra]).
    assert (k * k * (y n * y n) <= 1 * (y n * y n)) by (apply Rmult_le_compat_r; [apply Rle_0_sqr|lra]).
    assert (k * k * (z n * z n) <= vertical * vertical * (z n * z n))
      by (apply Rmult_le_compat_r; [apply Rle_0_sqr|lra]).
    lra.
Qed.

Lemma length_is_between : 0 < length <= 10 ^ 31.
Proof.
  pose proof scaled_is_long as L. pose proof scaled_error as E. pose proof (norms_differ s' s) as D.
  apply Rabs_le_inv in D. pose proof (length_error s') as Q. apply Rabs_le_inv in Q.
  pose proof (rounded_between _ (sqrt_pos (fdot s' s'))) as R. fold length in R.
  destruct least_is_slight. pose proof slight_is_small. pose proof tiny_is_positive.
  pose proof scaled_is_short as Sh. destruct factor as (_ & _ & V).
  assert (St : stretch vertical <= 10 ^ 30) by (unfold stretch; apply Rmax_lub; lra).
  assert (0 < / 10 ^ 31) by lra.
  unfold OFF_UNIT, u in *. split; lra.
Qed.

Lemma ellipsoid_side : vertical <> 1 -> 0 <= room (true_plane vertical n offset) p ->
  dot n (scaled vertical p) <= bound + 7.3 * u * product + 1e8 * slight.
Proof.
  intros V R. unfold true_plane in R. destruct (Req_EM_T vertical 1) as [|_]; [lra|]. cbv zeta in R.
  fold s' in R. fold length in R. apply room_is_exact in R; [|apply rounded_is_double].
  cbn [plane_normal plane_offset] in R.
  rewrite dot_of_scaled. set (q := fdivide s' length) in *. set (o := rounded (offset / length)) in *.
  destruct length_is_between as [L0 L1]. set (l := length) in *. clearbody l.
  destruct least_is_slight as [PL LM].
  pose proof (near_is_short p near_p) as NP. pose proof (norm_is_positive p) as PP.
  pose proof (norm_is_positive s) as PS.
  assert (Ll : l * least <= slight / 10 ^ 9).
  { apply Rle_trans with (10 ^ 31 * least); [apply Rmult_le_compat_r; lra | lra]. }
  assert (PLl : 0 <= l * least) by (apply Rmult_le_pos; lra).
  assert (Div : forall c, Rabs (l * rounded (c / l) - c) <= u * Rabs c + l * least).
  { intros c. pose proof (rounding_error (c / l)) as E.
    replace (l * rounded (c / l) - c) with (l * (rounded (c / l) - c / l)) by (field; lra).
    rewrite Rabs_mult, (Rabs_pos_eq l) by lra.
    apply Rle_trans with (l * (u * Rabs (c / l) + least)); [apply Rmult_le_compat_l; lra|].
    unfold Rdiv. rewrite Rabs_mult, (Rabs_pos_eq (/ l)) by (left; now apply Rinv_0_lt_compat). right. field. lra. }
  assert (Q : norm (sub (scale l q) s') <= u * norm s' + 2 * (l * least)).
  { rewrite <- norm_scale by (unfold u; lra).
    apply norm_of_coordinates; auto; unfold q, fdivide, sub, scale; cbn [x y z];
      rewrite (Rabs_mult u), (Rabs_pos_eq u) by (unfold u; lra); apply Div. }
  pose proof scaled_error as Es. pose proof (norms_differ s' s) as D. apply Rabs_le_inv in D.
  assert (Qs : norm (sub (scale l q) s) <= 2.001 * u * norm s + slight).
  { replace (sub (scale l q) s) with (add (sub (scale l q) s') (sub s' s)) by (unfold add, sub; cbn; f_equal; ring).
    eapply Rle_trans; [apply triangle|].
    assert (least <= slight / 10 ^ 9) by lra. unfold u in *. lra. }
  pose proof (norms_differ (scale l q) s) as D2. apply Rabs_le_inv in D2. rewrite (norm_scale l q) in D2 by lra.
  pose proof (fdot_error q p) as F. apply Rabs_le_inv in F.
  (* Both sides times the length. *)
  assert (F' : l * dot q p <= l * fdot q p + 3.0001 * u * ((l * norm q) * norm p) + 4 * (l * least)).
  { apply Rle_trans with (l * (fdot q p + (3.0001 * u * (norm q * norm p) + 4 * least))).
    - apply Rmult_le_compat_l; lra.
    - right. ring. }
  assert (R' : l * fdot q p <= l * o) by (apply Rmult_le_compat_l; lra).
  assert (N1 : l * norm q * norm p <= ((1 + 2.001 * u) * norm s + slight) * norm p)
    by (apply Rmult_le_compat_r; lra).
  assert (N2 : slight * norm p <= 2e6 * slight).
  { apply Rle_trans with (slight * (1.7321 * FARTHEST_M)); [apply Rmult_le_compat_l; lra|]. unfold FARTHEST_M.
  lra. }
  assert (G : dot s p <= l * dot q p + (2.001 * u * norm s + slight) * norm p).
  { replace (dot s p) with (l * dot q p - dot (sub (scale l q) s) p) by (unfold dot, sub, scale; cbn; ring).
    pose proof (cauchy_schwarz (sub (scale l q) s) p) as C. apply Rabs_le_inv in C.
    assert (norm (sub (scale l q) s) * norm p <= (2.001 * u * norm s + slight) * norm p)
      by (apply Rmult_le_compat_r; lra). lra. }
  assert (PA : 0 <= norm s * norm p) by (now apply Rmult_le_pos).
  assert (PZ : 0 < slight) by lra.
  assert (B : dot s p <= bound + (5.0021 + 2.1) * u * (norm s * norm p) + 3 * (1e7 * slight)).
  { apply bound_before_rounding with (l * o); try lra; [apply cauchy_schwarz| |].
    - unfold u in *. lra.
    - pose proof (Div offset) as O. fold o in O.
      replace (l * o - bound) with ((l * o - offset) + (offset - bound)) by ring.
      eapply Rle_trans; [apply Rabs_triang|].
      assert (Rabs offset <= (1 + u) * Rabs bound).
      { replace offset with ((offset - bound) + bound) by ring. eapply Rle_trans; [apply Rabs_triang|]. lra. }
      pose proof (Rabs_pos bound). unfold u in *. lra. }
  fold product in B, PA. unfold u in *. lra.
Qed.

(** A point that the computed test finds inside is inside, but for [PLANE_M]. *)
Lemma inside_before_rounding : 0 <= room (true_plane vertical n offset) p ->
  dot n (scaled vertical p) <= bound + PLANE_M * stretch vertical.
Proof.
  intros R. pose proof product_is_small as P. destruct stretch_is_most as [_ O].
  pose proof slight_is_small as Sl. pose proof tiny_is_positive.
  assert (W : dot n (scaled vertical p) <= bound + 7.3 * u * product + 1e8 * slight).
  { destruct (Req_EM_T vertical 1) as [V | V].
    - pose proof (ball_side V R). unfold u in *. lra.
    - now apply ellipsoid_side. }
  unfold PLANE_M, FARTHEST_M, u in *. lra.
Qed.

End Plane.

(** ** Unit normals *)

Lemma unit_of_is_unit : forall n offset, doubles n -> double offset -> is_valid n ->
  is_unit (fst (unit_of n offset)) /\ double (snd (unit_of n offset)).
Proof.
  intros n offset N O V. unfold is_valid in V. unfold unit_of. cbv zeta.
  pose proof (fdot_error n n) as E. rewrite <- norm_squared in E. apply Rabs_le_inv in E.
  pose proof (norm_is_positive n) as P. destruct least_is_slight as [PL LM].
  pose proof (difference_error (fdot n n) 1 (fdot_is_double n n) double_1) as D.
  pose proof slight_is_small as Sl.
  assert (S : least <= / 10 ^ 40) by (unfold u in *; lra).
  assert (PNN : 0 <= norm n * norm n) by (now apply Rmult_le_pos).
  (* A computed deviation bounds the squared length. *)
  assert (K : forall c, 0 <= c <= 1e-5 -> Rabs (rounded (fdot n n - 1)) <= c ->
    1 - 1.001 * c - 3.5e-16 <= norm n * norm n <= 1 + 1.001 * c + 3.5e-16).
  { intros c C B. set (w := fdot n n - 1) in *.
    assert (W : Rabs w <= (1 + 2 * u) * c).
    { assert (Rabs w <= Rabs (rounded w) + Rabs (rounded w - w)).
      { replace w with (rounded w + - (rounded w - w)) at 1 by ring. eapply Rle_trans; [apply Rabs_triang|].
        rewrite Rabs_Ropp. lra. }
      pose proof (Rabs_pos w). unfold u in *. lra. }
    apply Rabs_le_inv in W. unfold w in W. unfold u in *. lra. }
  pose proof (rounded_between UNIT) as U1. assert (PU : 0 <= UNIT) by (unfold UNIT; lra).
  pose proof (rounded_is_positive UNIT PU) as U2. specialize (U1 PU).
  pose proof (rounded_between SINGLE) as S1. assert (PSi : 0 <= SINGLE) by (unfold SINGLE; lra).
  pose proof (rounded_is_positive SINGLE PSi) as S2. specialize (S1 PSi).
  destruct (Rle_dec (Rabs (rounded (fdot n n - 1))) (rounded UNIT)) as [G | G]; cbn [fst snd].
  - split; auto. split; auto.
    destruct (K (rounded UNIT)) as [K1 K2]; auto; [unfold UNIT, u in *; lra|].
    split.
    + apply square_at_most; auto. unfold OFF_UNIT, UNIT, u in *. lra.
    + apply square_at_most; [unfold OFF_UNIT; lra|]. unfold OFF_UNIT, UNIT, u in *. lra.
  - split; [|apply rounded_is_double]. split; [repeat split; apply rounded_is_double|].
    destruct (K (rounded SINGLE)) as [K1 K2]; auto; [unfold SINGLE, u in *; lra|].
    assert (Nn : 0.9 <= norm n <= 1.1).
    { split; apply square_at_most; try lra; unfold SINGLE, u in *; lra. }
    pose proof (length_error n) as L. apply Rabs_le_inv in L.
    pose proof tiny_is_positive.
    assert (S3 : tiny <= / 10 ^ 40) by (unfold u in *; lra).
    pose proof (rounded_between _ (sqrt_pos (fdot n n))) as R.
    set (l := rounded (sqrt (fdot n n))) in *.
    assert (Zz : 0 < / 10 ^ 40) by lra. assert (Zs : / 10 ^ 40 <= u / 1000) by (unfold u; lra).
    assert (Pl : 0.8 <= l <= 1.2) by (unfold u in *; lra).
    assert (Ll : (1 - 2.6 * u) * norm n <= l <= (1 + 2.6 * u) * norm n) by (unfold u in *; lra).
    assert (Div : forall c, Rabs (l * rounded (c / l) - c) <= u * Rabs c + l * least).
    { intros c. pose proof (rounding_error (c / l)) as Ec.
      replace (l * rounded (c / l) - c) with (l * (rounded (c / l) - c / l)) by (field; lra).
      rewrite Rabs_mult, (Rabs_pos_eq l) by lra.
      apply Rle_trans with (l * (u * Rabs (c / l) + least)); [apply Rmult_le_compat_l; lra|].
      unfold Rdiv. rewrite Rabs_mult, (Rabs_pos_eq (/ l)) by (left; apply Rinv_0_lt_compat; lra). right. field. lra. }
    set (q := fdivide n l).
    assert (PLl : 0 <= l * least) by (apply Rmult_le_pos; lra).
    assert (Q : norm (sub (scale l q) n) <= u * norm n + 2 * (l * least)).
    { rewrite <- norm_scale by (unfold u; lra).
      apply norm_of_coordinates; auto; unfold q, fdivide, sub, scale; cbn [x y z];
        rewrite (Rabs_mult u), (Rabs_pos_eq u) by (unfold u; lra); apply Div. }
    pose proof (norms_differ (scale l q) n) as D2. apply Rabs_le_inv in D2. rewrite (norm_scale l q) in D2 by lra.
    assert (l * least <= 1.2 * / 10 ^ 40) by (apply Rmult_le_compat; lra).
    assert (X1 : l * norm q <= (1 + 2 * u) * norm n) by (unfold u in *; lra).
    assert (X2 : (1 - 2 * u) * norm n <= l * norm q) by (unfold u in *; lra).
    split.
    + apply Rmult_le_reg_l with l; [lra|]. unfold OFF_UNIT, u in *. lra.
    + apply Rmult_le_reg_l with l; [lra|]. unfold OFF_UNIT, u in *. lra.
Qed.

Lemma opposite_is_unit : forall n, is_unit n -> is_unit (opposite n).
Proof.
  intros n ((A & B & C) & N). split; [repeat split; now apply double_opp|].
  replace (norm (opposite n)) with (norm n); auto. unfold norm, dot, opposite. cbn. f_equal. ring.
Qed.

(** ** Margins *)

Section Margins.

Variables (vertical delta e : R).
Hypothesis positive_delta : 0 <= delta.
Hypothesis positive_e : 0 <= e.
Hypothesis margin_is_small : margin_of delta vertical e <= FARTHEST_M.

Let st := stretch vertical.

(** The computed margin contains half of delta, the tube, and half of [ROUNDING_M]. *)
Lemma margin_is_enough :
  delta / 2 + ROUNDING_M / 2 * st + e * st <= margin_of delta vertical e + 1e-9 /\ delta / 2 + e * st <= 1.1e6.
Proof.
  assert (O : 1 <= st) by apply Rmax_r.
  pose proof margin_is_small as small. unfold margin_of in *. fold st in small |- *.
  assert (PR : 0 <= ROUNDING_M) by (unfold ROUNDING_M; lra).
  pose proof (rounded_between _ PR) as R0. pose proof (rounded_is_positive _ PR) as P0.
  set (r := rounded ROUNDING_M) in *.
  assert (Q1 : 0 <= r * st) by (apply Rmult_le_pos; lra).
  pose proof (rounded_between _ Q1) as R1. pose proof (rounded_is_positive _ Q1) as P1.
  set (a := rounded (r * st)) in *.
  assert (Q2 : 0 <= delta + a) by lra.
  pose proof (rounded_between _ Q2) as R2. pose proof (rounded_is_positive _ Q2) as P2.
  set (b := rounded (delta + a)) in *.
  assert (Q3 : 0 <= b / 2) by lra.
  pose proof (rounded_between _ Q3) as R3. pose proof (rounded_is_positive _ Q3) as P3. set (c := rounded (b / 2)) in *.
  assert (Q4 : 0 <= e * st) by (apply Rmult_le_pos; lra).
  pose proof (rounded_between _ Q4) as R4. pose proof (rounded_is_positive _ Q4) as P4.
  set (f := rounded (e * st)) in *.
  assert (Q5 : 0 <= c + f) by lra.
  pose proof (rounded_between _ Q5) as R5. set (m := rounded (c + f)) in *.
  destruct least_is_slight as [PL LM]. pose proof slight_is_small.
  assert (S1 : least <= 1e-30) by (unfold u in *; lra).
  assert (rs : (1 - 2 * u) * ROUNDING_M * st <= r * st).
  { apply Rmult_le_compat_r; [lra|]. unfold ROUNDING_M, u in *. lra. }
  unfold FARTHEST_M, ROUNDING_M, u in *. split; lra.
Qed.

End Margins.

(** ** Two vehicles *)

(** Two references that the computed tests find inside their planes. The vehicles are within their tubes of them, but
    for rounding of the references. Then the vehicles are at least delta apart in the lengths of the metric. *)
Theorem rounded_vehicles_are_apart : forall vertical delta e1 e2 n offset p q p' q',
  is_factor vertical -> doubles n -> double offset -> is_valid n ->
  0 <= delta -> 0 <= e1 -> 0 <= e2 ->
  margin_of delta vertical e1 <= FARTHEST_M -> margin_of delta vertical e2 <= FARTHEST_M ->
  is_near_origin p -> is_near_origin q ->
  0 <= room (owner_plane vertical n offset (margin_of delta vertical e1)) p ->
  0 <= room (follower_plane vertical n offset (margin_of delta vertical e2)) q ->
  distance p p' <= e1 + REFERENCE_M -> distance q q' <= e2 + REFERENCE_M ->
  delta <= distance (scaled vertical p') (scaled vertical q').
Proof.
  intros v delta e1 e2 n offset p q p' q' F N O V D1 E1' E2' M1 M2 P Q R1 R2 T1 T2.
  unfold owner_plane in R1. unfold follower_plane in R2.
  destruct (unit_of_is_unit n offset N O V) as [U W]. destruct (unit_of n offset) as [n' o]. cbn [fst snd] in U, W.
  set (m1 := margin_of delta v e1) in *. set (m2 := margin_of delta v e2) in *.
  assert (Dm1 : double m1) by apply rounded_is_double. assert (Dm2 : double m2) by apply rounded_is_double.
  assert (A1 : dot n' (scaled v p) <= o - m1 + PLANE_M * stretch v).
  { apply inside_before_rounding with (rounded (o - m1)); auto using rounded_is_double. now apply difference_error. }
  assert (A2 : dot (opposite n') (scaled v q) <= - o - m2 + PLANE_M * stretch v).
  { apply inside_before_rounding with (rounded (- o - m2)); auto using rounded_is_double, opposite_is_unit.
    apply difference_error; auto using double_opp. }
  destruct (margin_is_enough v delta e1 D1 E1' M1) as [G1 H1].
  destruct (margin_is_enough v delta e2 D1 E2' M2) as [G2 H2]. fold m1 in G1. fold m2 in G2.
  set (st := stretch v) in *. assert (St : 1 <= st) by apply Rmax_r.
  (* Vehicle and reference along the normal. *)
  assert (B : forall a a' e, distance a a' <= e + REFERENCE_M -> 0 <= e -> e * st <= 1.1e6 ->
    Rabs (dot n' (scaled v a') - dot n' (scaled v a)) <= e * st + (REFERENCE_M + 6e-9) * st).
  { intros a a' e Ta Pe Le. rewrite <- dot_sub.
    replace (sub (scaled v a') (scaled v a)) with (scaled v (sub a' a)) by (unfold sub, scaled; cbn; f_equal; ring).
    rewrite dot_of_scaled. eapply Rle_trans; [apply cauchy_schwarz|].
    pose proof (scaled_is_short v n' F U) as Sh. fold st in Sh.
    apply Rle_trans with ((1 + OFF_UNIT) * st * (e + REFERENCE_M)).
    - apply Rmult_le_compat; auto using norm_is_positive.
    - assert (0 < REFERENCE_M < 1e-6) by (unfold REFERENCE_M, UNREPORTED, MOTION_M, COMMAND_ROUNDING, STIFF_M; lra).
      assert (REFERENCE_M * st <= 1e-6 * st) by (apply Rmult_le_compat_r; lra). unfold OFF_UNIT. lra. }
  assert (Pe1 : e1 * st <= 1.1e6) by lra. assert (Pe2 : e2 * st <= 1.1e6) by lra.
  pose proof (B p p' e1 T1 E1' Pe1) as B1. pose proof (B q q' e2 T2 E2' Pe2) as B2. apply Rabs_le_inv in B1, B2.
  assert (Op : dot (opposite n') (scaled v q) = - dot n' (scaled v q)) by (unfold dot, opposite; cbn; ring).
  rewrite Op in A2.
  assert (C : delta + (ROUNDING_M - 2 * REFERENCE_M - 2 * PLANE_M - 2 * 6e-9) * st - 2e-9 <=
    dot n' (sub (scaled v q') (scaled v p'))) by (rewrite dot_sub; lra).
  pose proof (dot_at_most n' (sub (scaled v q') (scaled v p'))) as CS.
  destruct U as (_ & _ & U). pose proof (norm_is_positive (sub (scaled v q') (scaled v p'))) as PN.
  unfold distance. set (d := norm (sub (scaled v q') (scaled v p'))) in *.
  assert (norm n' * d <= (1 + OFF_UNIT) * d) by (now apply Rmult_le_compat_r).
  destruct (Rle_or_lt delta d) as [|Short]; auto. exfalso.
  assert (K : 1e-7 <= ROUNDING_M - 2 * REFERENCE_M - 2 * PLANE_M - 2 * 6e-9).
  { unfold REFERENCE_M, PLANE_M, FARTHEST_M, UNREPORTED, MOTION_M, COMMAND_ROUNDING, STIFF_M, ROUNDING_M, u. lra. }
  assert (1e-7 * st <= (ROUNDING_M - 2 * REFERENCE_M - 2 * PLANE_M - 2 * 6e-9) * st) by (apply Rmult_le_compat_r; lra).
  assert (delta <= 2.2e6) by (assert (0 <= e1 * st) by (apply Rmult_le_pos; lra); lra).
  unfold OFF_UNIT in *. lra.
Qed.

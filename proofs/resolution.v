(** * Rounding of the smallest separation of a straight motion

    Model of `RelativeMotion::closest` and `ClosestPoint` of `crates/audit/src/sweep.rs`, operation
      by operation. Let u =
    2^-53, and let r be the distance of the computed start. The root of the result differs from the smallest separation
    between the computed ends by at most 12.4 u r, and [2 * tiny] for underflow: [root_is_least], [root_is_attained].
    The error of the fraction is 10.1 u r of it. It moves the point along the motion, so it counts only near
    separation 0. *)

From Coq Require Import Reals Lra ZArith Lia.
From Flocq Require Import Core.
From Proofs Require Import geometry doubles.
Open Scope R_scope.

(** `ClosestPoint::improve`. *)
Definition improve (squared candidate : R) : R := if Rlt_dec candidate squared then candidate else squared.

(** `(-start_rate / self.by.norm_squared()).min(1.0)`. A quotient by 0 is infinite, and its minimum with 1 is 1. *)
Definition fraction (start_rate speed_squared : R) : R :=
  if Req_EM_T speed_squared 0 then 1 else Rmin (rounded (- start_rate / speed_squared)) 1.

(** `RelativeMotion::closest`: smallest squared separation. *)
Definition closest (from to : vector) : R :=
  let by_ := fsub to from in
  let start_rate := fdot from by_ in
  let start := fdot from from in
  let inner :=
    if Rlt_dec start_rate 0 then
      if Rlt_dec 0 (fdot to by_) then
        let point := fadd from (fscale by_ (fraction start_rate (fdot by_ by_))) in
        improve start (fdot point point)
      else start
    else start in
  improve inner (fdot to to).

(** `ClosestPoint::separation_m`. *)
Definition separation (from to : vector) : R := rounded (sqrt (closest from to)).

(** Relative position at a fraction of the motion. *)
Definition on_line (from to : vector) (s : R) : vector := add from (scale s (sub to from)).

(** Largest length of a displacement: two coordinates of at most 1e70 differ by less. *)
Definition huge : R := bpow radix2 240.

Lemma improve_is_least : forall a b, improve a b <= a /\ improve a b <= b /\ (improve a b = a \/ improve a b = b).
Proof. intros. unfold improve. destruct (Rlt_dec b a); lra. Qed.

(** ** Errors of the terms *)

Lemma norms_differ : forall a b, Rabs (norm a - norm b) <= norm (sub a b).
Proof.
  intros a b. apply Rabs_le.
  assert (T : forall c d, norm c <= norm d + norm (sub c d)).
  { intros c d. replace c with (add d (sub c d)) at 1; [apply triangle|].
    unfold add, sub. destruct c, d; cbn; f_equal; ring. }
  pose proof (T a b). pose proof (T b a) as S. rewrite (norm_opposite b a) in S. lra.
Qed.

Lemma to_is_on_line : forall from to, to = on_line from to 1.
Proof. intros from to. unfold on_line, add, scale, sub. destruct from, to. cbn. f_equal; ring. Qed.

Lemma from_is_on_line : forall from to, from = on_line from to 0.
Proof. intros from to. unfold on_line, add, scale, sub. destruct from, to. cbn. f_equal; ring. Qed.

Section Motion.

Variables from to : vector.
Hypothesis doubles_from : doubles from.
Hypothesis doubles_to : doubles to.

Let d := sub to from.
Let g := fsub to from.

Lemma by_length : Rabs (norm g - norm d) <= u * norm d.
Proof. eapply Rle_trans; [apply norms_differ|]. now apply fsub_error. Qed.

Lemma rate_error : forall a, Rabs (fdot a g - dot a d) <= 4.001 * u * (norm a * norm d) + 4 * least.
Proof.
  intros a. pose proof (fdot_error a g) as E. pose proof by_length as B. apply Rabs_le_inv in B.
  assert (C : Rabs (dot a g - dot a d) <= u * (norm a * norm d)).
  { rewrite <- dot_sub. eapply Rle_trans; [apply cauchy_schwarz|].
    rewrite <- Rmult_assoc, (Rmult_comm u), Rmult_assoc. apply Rmult_le_compat_l; [apply norm_is_positive|].
    now apply fsub_error. }
  replace (fdot a g - dot a d) with ((fdot a g - dot a g) + (dot a g - dot a d)) by ring.
  eapply Rle_trans; [apply Rabs_triang|].
  assert (norm a * norm g <= norm a * ((1 + u) * norm d)) by (apply Rmult_le_compat_l; [apply norm_is_positive|lra]).
  pose proof (norm_is_positive a). pose proof (norm_is_positive d).
  assert (0 <= norm a * norm d) by (now apply Rmult_le_pos). unfold u in *. lra.
Qed.

Lemma speed_error : Rabs (fdot g g - norm d * norm d) <= 5.001 * u * (norm d * norm d) + 4 * least.
Proof.
  pose proof (fdot_error g g) as E. rewrite <- norm_squared in E. pose proof by_length as B. apply Rabs_le_inv in B.
  pose proof (norm_is_positive g). pose proof (norm_is_positive d).
  assert (norm g * norm g <= (1 + u) * norm d * ((1 + u) * norm d)) by (apply Rmult_le_compat; lra).
  assert (P : 0 <= (1 - u) * norm d) by (unfold u; lra).
  assert ((1 - u) * norm d * ((1 - u) * norm d) <= norm g * norm g) by (apply Rmult_le_compat; lra).
  assert (0 <= norm d * norm d) by (now apply Rmult_le_pos).
  apply Rabs_le_inv in E. apply Rabs_le. unfold u in *. lra.
Qed.

(** Point of the line that is closest to the origin, as a fraction. *)
Let foot := - dot from d / (norm d * norm d).

Let sigma := fraction (fdot from g) (fdot g g).

Lemma least_of_lengths : forall a b, tiny <= a -> tiny <= b -> 4 * least <= u * u * (a * b) / 1000000.
Proof.
  intros a b A B. rewrite least_is_small. pose proof tiny_is_positive as T.
  assert (tiny * tiny <= a * b) by (apply Rmult_le_compat; lra).
  assert (0 < tiny * tiny) by (apply Rmult_lt_0_compat; lra).
  replace (u * tiny * (u * tiny)) with (u * u * (tiny * tiny)) by ring. unfold u in *. lra.
Qed.

Lemma least_of_huge : least * huge <= u * tiny / 1000000.
Proof.
  unfold least, huge, tiny. rewrite u_is_power, <- !bpow_plus.
  apply Rle_trans with (bpow radix2 (-523) * bpow radix2 (-20)).
  - rewrite <- bpow_plus. apply bpow_le. lia.
  - replace (-53 + -470)%Z with (-523)%Z by lia. unfold Rdiv. apply Rmult_le_compat_l; [apply bpow_ge_0|]. simpl. lra.
Qed.

Lemma least_below_tiny : 3 * least <= u * tiny.
Proof.
  pose proof least_of_huge as H. pose proof least_is_positive as L. pose proof tiny_is_positive as T.
  assert (1 <= huge) by (unfold huge; change 1 with (bpow radix2 0); apply bpow_le; lia).
  assert (least * 1 <= least * huge) by (apply Rmult_le_compat_l; lra).
  unfold u in *. lra.
Qed.

Lemma fraction_is_between : fdot from g < 0 -> 0 <= sigma <= 1.
Proof.
  intros Q. unfold sigma, fraction. destruct (Req_EM_T _ 0) as [|N]; [lra|].
  split; [|apply Rmin_r]. apply Rmin_glb; [|lra]. apply rounded_is_positive.
  apply Rmult_le_pos; [lra|]. left. apply Rinv_0_lt_compat. pose proof (fdot_self_is_positive g). lra.
Qed.

Lemma quotient_error : forall y nu alpha e F,
  0 <= F -> Rabs nu <= 5.01 * u -> Rabs alpha <= 4.002 * u * F -> 0 <= e <= F ->
  y * (1 + nu) = e + alpha -> Rabs (y - e) <= 9.02 * u * F.
Proof.
  intros y nu alpha e F HF N A E H. apply Rabs_le_inv in N, A.
  assert (K : (y - e) * (1 + nu) = alpha - e * nu) by lra.
  assert (e * nu <= e * (5.01 * u)) by (apply Rmult_le_compat_l; lra).
  assert (e * (- (5.01 * u)) <= e * nu) by (apply Rmult_le_compat_l; lra).
  assert (e * u <= F * u) by (apply Rmult_le_compat_r; unfold u; lra).
  apply Rabs_le. split.
  - destruct (Rle_or_lt (- (9.02 * u * F)) (y - e)) as [|L]; [lra|exfalso].
    assert ((y - e) * (1 + nu) < (- (9.02 * u * F)) * (1 + nu)) by (apply Rmult_lt_compat_r; unfold u in *; lra).
    assert (u * F * (- (5.01 * u)) <= u * F * nu) by (apply Rmult_le_compat_l; [unfold u|]; lra).
    unfold u in *; lra.
  - destruct (Rle_or_lt (y - e) (9.02 * u * F)) as [|L]; [lra|exfalso].
    assert ((9.02 * u * F) * (1 + nu) < (y - e) * (1 + nu)) by (apply Rmult_lt_compat_r; unfold u in *; lra).
    assert (u * F * (- (5.01 * u)) <= u * F * nu) by (apply Rmult_le_compat_l; [unfold u|]; lra).
    unfold u in *; lra.
Qed.

(** The computed fraction is close to the foot. *)
Lemma fraction_error :
  tiny <= norm from -> tiny <= norm d <= huge -> fdot from g < 0 -> dot from d < 0 -> foot <= 1 ->
  Rabs (sigma - foot) * norm d <= 10.05 * u * norm from.
Proof.
  intros TF [TD HD] Q W FO.
  pose proof tiny_is_positive as T. pose proof (rate_error from) as R. pose proof speed_error as S.
  pose proof (least_of_lengths _ _ TF TD) as L1. pose proof (least_of_lengths _ _ TD TD) as L2.
  pose proof (cauchy_schwarz from d) as CS. rewrite Rabs_left in CS by auto.
  set (F := norm from) in *. set (D := norm d) in *. set (q := fdot from g) in *. set (n := fdot g g) in *.
  assert (0 < D * D) by (apply Rmult_lt_0_compat; lra).
  assert (0 < F * D) by (apply Rmult_lt_0_compat; lra).
  assert (R' : Rabs (q - dot from d) <= 4.002 * u * (F * D)) by (unfold u in *; lra).
  assert (S' : Rabs (n - D * D) <= 5.01 * u * (D * D)) by (unfold u in *; lra).
  assert (Pn : 0 < n) by (apply Rabs_le_inv in S'; unfold u in *; lra).
  set (e := - dot from d / D).
  assert (E : 0 <= e <= F).
  { unfold e. split.
    - apply Rmult_le_pos; [lra|]. left. apply Rinv_0_lt_compat. lra.
    - apply Rmult_le_reg_r with D; [lra|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. lra. }
  assert (Y : Rabs (- q / n * D - e) <= 9.02 * u * F).
  { apply quotient_error with ((n - D * D) / (D * D)) ((dot from d - q) / D); try lra.
    - unfold Rdiv. rewrite Rabs_mult, (Rabs_pos_eq (/ _)) by (left; apply Rinv_0_lt_compat; lra).
      apply Rmult_le_reg_r with (D * D); [lra|]. rewrite Rmult_assoc, Rinv_l by lra. lra.
    - unfold Rdiv. rewrite Rabs_mult, (Rabs_pos_eq (/ _)) by (left; apply Rinv_0_lt_compat; lra).
      rewrite Rabs_minus_sym. apply Rmult_le_reg_r with D; [lra|]. rewrite Rmult_assoc, Rinv_l by lra. lra.
    - unfold e. field. lra. }
  (* The quotient is rounded, and cut at 1. *)
  unfold sigma, fraction. fold q. fold n. destruct (Req_EM_T n 0) as [Z | _]; [lra|].
  pose proof (rounding_error (- q / n)) as V. set (v := - q / n) in *.
  assert (Pv : 0 <= v) by (unfold v; apply Rmult_le_pos; [lra | left; now apply Rinv_0_lt_compat]).
  rewrite (Rabs_pos_eq v Pv) in V.
  assert (A : Rabs (rounded v - foot) * D <= 10.05 * u * F).
  { assert (FD : foot * D = e) by (unfold foot, e; fold D; field; lra).
    rewrite <- (Rabs_pos_eq D) at 1 by lra. rewrite <- Rabs_mult.
    replace ((rounded v - foot) * D) with ((rounded v - v) * D + (v * D - e)) by (rewrite <- FD; ring).
    eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_mult, (Rabs_pos_eq D) by lra.
    assert (Rabs (rounded v - v) * D <= (u * v + least) * D) by (apply Rmult_le_compat_r; lra).
    assert (least * D <= least * huge) by (apply Rmult_le_compat_l; [pose proof least_is_positive; lra|auto]).
    pose proof least_of_huge. apply Rabs_le_inv in Y.
    assert (u * (v * D) <= u * (F + 9.02 * u * F)) by (apply Rmult_le_compat_l; [unfold u|]; lra).
    assert (Rabs (v * D - e) <= 9.02 * u * F) by (now apply Rabs_le). unfold u in *. lra. }
  eapply Rle_trans; [|exact A]. apply Rmult_le_compat_r; [lra|].
  unfold Rmin. destruct (Rle_dec (rounded v) 1); [lra|]. rewrite (Rabs_pos_eq (1 - foot)) by lra.
  rewrite Rabs_pos_eq by lra. lra.
Qed.

(** ** The point between the ends *)

Let point := fadd from (fscale g sigma).

Lemma point_error : fdot from g < 0 ->
  norm (sub point (on_line from to sigma)) <=
    u * norm (on_line from to sigma) + 2.01 * u * (sigma * norm d) + 3 * least.
Proof.
  intros Q. destruct (fraction_is_between Q) as [S0 S1]. pose proof least_is_positive as L.
  set (step := fscale g sigma). set (exact := scale sigma d).
  assert (A : norm (sub step exact) <= 2.001 * u * (sigma * norm d) + 2 * least).
  { replace (sub step exact) with (add (sub step (scale sigma g)) (scale sigma (sub g d)))
      by (unfold step, exact, add, sub, scale; cbn; f_equal; ring).
    eapply Rle_trans; [apply triangle|]. rewrite norm_scale by auto.
    pose proof (fscale_error g sigma S0) as E. fold step in E.
    pose proof (fsub_error to from doubles_to doubles_from) as B. fold g d in B.
    pose proof by_length as G. apply Rabs_le_inv in G.
    assert (sigma * norm (sub g d) <= sigma * (u * norm d)) by (apply Rmult_le_compat_l; auto).
    assert (sigma * norm g <= sigma * ((1 + u) * norm d)) by (apply Rmult_le_compat_l; [auto|lra]).
    pose proof (norm_is_positive d). assert (0 <= sigma * norm d) by (now apply Rmult_le_pos).
    unfold u in *. lra. }
  assert (B : norm (sub (add from step) (on_line from to sigma)) = norm (sub step exact)).
  { f_equal. unfold on_line, exact, d, add, sub, scale. cbn. f_equal; ring. }
  pose proof (fadd_error from step doubles_from (fscale_is_doubles g sigma)) as C.
  change (fadd from step) with point in C.
  assert (D : norm (add from step) <= norm (on_line from to sigma) + norm (sub step exact)).
  { rewrite <- B. pose proof (norms_differ (add from step) (on_line from to sigma)) as N. apply Rabs_le_inv in N. lra. }
  replace (sub point (on_line from to sigma)) with
    (add (sub point (add from step)) (sub (add from step) (on_line from to sigma)))
    by (unfold add, sub; cbn; f_equal; ring).
  eapply Rle_trans; [apply triangle|]. rewrite B.
  pose proof (norm_is_positive d). assert (0 <= sigma * norm d) by (now apply Rmult_le_pos).
  unfold u in *. lra.
Qed.

(** ** Error of the smallest separation *)

Lemma on_line_squared : forall s,
  norm (on_line from to s) * norm (on_line from to s) =
  norm from * norm from + 2 * s * dot from d + s * s * (norm d * norm d).
Proof. intros. rewrite !norm_squared. unfold on_line, d, dot, add, scale, sub. cbn. ring. Qed.

Lemma closest_is_positive : 0 <= closest from to.
Proof.
  unfold closest. cbv zeta.
  repeat match goal with |- context [improve ?a ?b] =>
    destruct (improve_is_least a b) as (_ & _ & [-> | ->]) end;
  repeat destruct Rlt_dec;
  repeat match goal with |- context [improve ?a ?b] =>
    destruct (improve_is_least a b) as (_ & _ & [-> | ->]) end; apply fdot_self_is_positive.
Qed.

(** The result is the square of a candidate, and at most those of all candidates. *)
Lemma closest_is_of_candidates :
  closest from to <= fdot from from /\ closest from to <= fdot to to /\
  (fdot from g < 0 -> 0 < fdot to g -> closest from to <= fdot point point) /\
  (closest from to = fdot from from \/ closest from to = fdot to to \/
   fdot from g < 0 /\ closest from to = fdot point point).
Proof.
  unfold closest. cbv zeta. fold g. fold sigma. fold point.
  destruct (Rlt_dec (fdot from g) 0) as [Q | Q]; [destruct (Rlt_dec 0 (fdot to g)) as [Z | Z]|].
  - destruct (improve_is_least (fdot from from) (fdot point point)) as (A & B & C).
    destruct (improve_is_least (improve (fdot from from) (fdot point point)) (fdot to to)) as (A' & B' & C').
    split; [lra|]. split; [lra|]. split; [intros; lra|]. destruct C' as [-> | ->]; auto. destruct C as [-> | ->]; auto.
  - destruct (improve_is_least (fdot from from) (fdot to to)) as (A & B & C).
    split; [lra|]. split; [lra|]. split; [intros; lra|]. destruct C as [-> | ->]; auto.
  - destruct (improve_is_least (fdot from from) (fdot to to)) as (A & B & C).
    split; [lra|]. split; [lra|]. split; [intros; lra|]. destruct C as [-> | ->]; auto.
Qed.

Lemma root_at_most : forall a, closest from to <= fdot a a ->
  sqrt (closest from to) <= norm a + 1.51 * u * norm a + u * tiny.
Proof.
  intros a H. apply sqrt_le_1_alt in H. pose proof (length_error a) as E. apply Rabs_le_inv in E. lra.
Qed.

Lemma product_of_small : forall a b, 0 <= a -> 0 <= b -> 0 <= u * (a * b).
Proof. intros. apply Rmult_le_pos; [unfold u; lra|]. now apply Rmult_le_pos. Qed.

(** A length whose square exceeds that of [m] by that of a small part of it. *)
Lemma length_beyond : forall L m w D e,
  0 <= L -> 0 <= m -> 0 < D -> 0 <= e -> Rabs w <= e * D -> L * L = m * m + (w / D) * (w / D) -> L <= m + e.
Proof.
  intros L m w D e HL Hm HD He W E.
  assert (A : Rabs (w / D) <= e).
  { unfold Rdiv. rewrite Rabs_mult, (Rabs_pos_eq (/ D)) by (left; now apply Rinv_0_lt_compat).
    apply Rmult_le_reg_r with D; auto. now rewrite Rmult_assoc, Rinv_l, Rmult_1_r by lra. }
  assert (B : w / D * (w / D) <= e * e).
  { rewrite <- (Rabs_pos_eq (w / D * (w / D))) by apply Rle_0_sqr. rewrite Rabs_mult.
    apply Rmult_le_compat; auto using Rabs_pos. }
  apply square_at_most; [lra|]. pose proof (Rmult_le_pos _ _ Hm He). lra.
Qed.

(** The computed separation is at most the separation at any fraction, and this error. *)
Lemma root_is_least : forall s, norm d <= huge -> 0 <= s <= 1 ->
  sqrt (closest from to) <= (1 - u) * norm (on_line from to s) + 12.4 * u * norm from + 2 * tiny.
Proof.
  intros s HD S. pose proof tiny_is_positive as T.
  destruct closest_is_of_candidates as (C1 & C2 & C3 & _).
  pose proof (root_at_most _ C1) as R1. pose proof (root_at_most _ C2) as R2.
  pose proof (on_line_squared s) as E. pose proof (on_line_squared 1) as E1. rewrite <- to_is_on_line in E1.
  pose proof (norm_is_positive from) as PF. pose proof (norm_is_positive to) as PT.
  pose proof (norm_is_positive d) as PD. pose proof (norm_is_positive (on_line from to s)) as PR.
  pose proof (rate_error from) as Q1. pose proof (rate_error to) as Q2.
  pose proof (cauchy_schwarz from d) as CS.
  assert (TD : dot to d = dot from d + norm d * norm d) by (rewrite norm_squared; unfold d, dot, sub; cbn; ring).
  set (F := norm from) in *. set (L := norm to) in *. set (D := norm d) in *. set (m' := norm (on_line from to s)) in *.
  set (w := dot from d) in *. set (root := sqrt (closest from to)) in *.
  destruct (Rle_or_lt tiny F) as [TF | TF]; [|unfold u in *; lra].
  assert (M0 : F <= m' + s * D).
  { unfold F, m'. replace (norm from) with (norm (add (on_line from to s) (scale s (sub from to)))).
    - eapply Rle_trans; [apply triangle|]. rewrite norm_scale by lra. rewrite norm_opposite. fold d D. lra.
    - f_equal. unfold on_line, add, scale, sub. destruct from, to. cbn. f_equal; ring. }
  assert (s * D <= 1 * D) by (apply Rmult_le_compat_r; lra).
  destruct (Rle_or_lt tiny D) as [TD' | TD']; [|unfold u in *; lra].
  assert (PDD : 0 < D * D) by (apply Rmult_lt_0_compat; lra).
  assert (S2 : 0 <= s * s * (D * D)) by (apply Rmult_le_pos; [apply Rle_0_sqr|lra]).
  destruct (Rle_or_lt 0 w) as [W | W].
  { assert (F <= m').
    { apply square_at_most; auto. assert (0 <= s * w) by (apply Rmult_le_pos; lra). lra. }
    unfold u in *. lra. }
  destruct (Rle_or_lt (dot to d) 0) as [V | V].
  { assert (L <= m').
    { apply square_at_most; auto.
      assert (0 <= (1 - s) * - (w + D * D)) by (apply Rmult_le_pos; lra).
      assert (0 <= (1 - s) * ((1 - s) * (D * D))) by (apply Rmult_le_pos; [lra|apply Rmult_le_pos; lra]). nra. }
    assert (L <= F) by (apply square_at_most; auto; lra).
    unfold u in *. lra. }
  assert (Efoot : foot = - w / (D * D)) by reflexivity. clearbody foot. set (m := norm (on_line from to foot)).
  assert (FO : foot * (D * D) = - w) by (rewrite Efoot; field; lra).
  assert (F0 : 0 <= foot) by (rewrite Efoot; apply Rmult_le_pos; [lra | left; now apply Rinv_0_lt_compat]).
  assert (F1 : foot <= 1) by (apply Rmult_le_reg_r with (D * D); lra).
  assert (PM : 0 <= m) by apply norm_is_positive.
  assert (EM : m * m = F * F - w / D * (w / D)).
  { unfold m. rewrite on_line_squared. fold F D w. rewrite Efoot. field. lra. }
  assert (ES : forall v, norm (on_line from to v) * norm (on_line from to v) =
    m * m + (v - foot) * D * ((v - foot) * D)).
  { intros v. rewrite on_line_squared, EM. fold F D w.
    replace (w / D * (w / D)) with (foot * foot * (D * D)) by (rewrite Efoot; field; lra).
    replace w with (- (foot * (D * D))) by lra. ring. }
  assert (MM : m <= m').
  { apply square_at_most; auto. unfold m'. rewrite ES. pose proof (Rle_0_sqr ((s - foot) * D)). unfold Rsqr in *. lra. }
  assert (MF : m <= F).
  { apply square_at_most; auto. pose proof (Rle_0_sqr (w / D)). unfold Rsqr in *. lra. }
  enough (root <= (1 - u) * m + 12.4 * u * F + 2 * tiny).
  { assert ((1 - u) * m <= (1 - u) * m') by (apply Rmult_le_compat_l; unfold u; lra). lra. }
  pose proof (least_of_lengths _ _ TF TD') as LF.
  assert (PFD : 0 <= F * D) by (apply Rmult_le_pos; lra).
  destruct (Rle_or_lt 0 (fdot from g)) as [Q | Q].
  { assert (F <= m + 4.002 * u * F).
    { apply length_beyond with w D; try lra; [unfold u; lra|].
      rewrite Rabs_left by lra. apply Rabs_le_inv in Q1. unfold u in *. lra. }
    unfold u in *. lra. }
  destruct (Rle_or_lt (fdot to g) 0) as [Z | Z].
  { destruct (Rle_or_lt tiny L) as [TL | TL]; [|unfold u in *; lra].
    pose proof (least_of_lengths _ _ TL TD') as LL. assert (0 <= L * D) by (apply Rmult_le_pos; lra).
    assert (L <= m + 4.002 * u * L).
    { apply length_beyond with (dot to d) D; try lra; [unfold u; lra| |].
      - rewrite Rabs_pos_eq by lra. apply Rabs_le_inv in Q2. unfold u in *. lra.
      - rewrite E1, EM. rewrite TD. field. lra. }
    unfold u in *. lra. }
  pose proof (root_at_most _ (C3 Q Z)) as R3. pose proof (point_error Q) as PE.
  pose proof (fraction_error TF (conj TD' HD) Q W F1) as FE.
  pose proof (norms_differ point (on_line from to sigma)) as ND. apply Rabs_le_inv in ND.
  pose proof (ES sigma) as Er. destruct (fraction_is_between Q) as [S0 S1].
  pose proof (norm_is_positive (on_line from to sigma)) as PR'. pose proof least_is_positive as Pl.
  fold D F in PE, FE. set (r := norm (on_line from to sigma)) in *. fold root in R3.
  set (e := (sigma - foot) * D) in *.
  assert (Ae : Rabs e <= 10.05 * u * F) by (unfold e; rewrite Rabs_mult, (Rabs_pos_eq D) by lra; exact FE).
  assert (SD : sigma * D <= F + 10.05 * u * F).
  { replace (sigma * D) with (e + foot * D) by (unfold e; ring). apply Rabs_le_inv in Ae.
    assert (foot * D <= F).
    { apply Rmult_le_reg_r with D; [lra|]. rewrite Rabs_left in CS by lra. lra. }
    lra. }
  assert (PS : 0 <= sigma * D) by (apply Rmult_le_pos; lra).
  assert (EE : e * e <= (10.05 * u * F) * (10.05 * u * F)).
  { replace (e * e) with (Rabs e * Rabs e) by (rewrite <- Rabs_mult; apply Rabs_pos_eq, Rle_0_sqr).
    apply Rmult_le_compat; auto using Rabs_pos. }
  pose proof least_below_tiny as LT.
  destruct (Rle_or_lt m (F / 16)) as [Near | Far].
  - assert (r <= m + 10.05 * u * F).
    { apply square_at_most; [unfold u; lra|]. rewrite Er.
      assert (0 <= m * F) by (now apply Rmult_le_pos). unfold u in *. lra. }
    unfold u in *. lra.
  - assert (r <= m + 0.01 * u * F).
    { apply square_at_most; [unfold u; lra|]. rewrite Er.
      assert (F / 16 * F <= m * F) by (apply Rmult_le_compat_r; lra).
      assert (0 <= F * F) by (now apply Rmult_le_pos). unfold u in *. lra. }
    unfold u in *. lra.
Qed.

(** The computed separation is at least the separation at some fraction, less this error. *)
Lemma root_is_attained : exists s, 0 <= s <= 1 /\
  norm (on_line from to s) <= sqrt (closest from to) + 6.7 * u * norm from + 2 * tiny.
Proof.
  destruct closest_is_of_candidates as (C1 & _ & _ & C).
  pose proof (root_at_most _ C1) as R1. pose proof tiny_is_positive as T. pose proof least_is_positive as Pl.
  pose proof (norm_is_positive from) as PF.
  assert (B : forall a, closest from to = fdot a a -> norm a <= sqrt (closest from to) + 1.51 * u * norm a + u * tiny).
  { intros a ->. pose proof (length_error a) as E. apply Rabs_le_inv in E. lra. }
  destruct C as [C | [C | [Q C]]]; apply B in C.
  - exists 0. split; [lra|]. rewrite <- from_is_on_line. unfold u in *. lra.
  - exists 1. split; [lra|]. rewrite <- to_is_on_line. pose proof (norm_is_positive to). unfold u in *. lra.
  - destruct (fraction_is_between Q) as [S0 S1]. exists sigma. split; [lra|].
    pose proof (point_error Q) as PE. pose proof (norms_differ point (on_line from to sigma)) as ND.
    apply Rabs_le_inv in ND. pose proof (norm_is_positive point) as PP.
    pose proof (norm_is_positive (on_line from to sigma)) as PR.
    assert (SD : sigma * norm d <= norm (on_line from to sigma) + norm from).
    { rewrite <- norm_scale by lra. replace (scale sigma d) with (add (on_line from to sigma) (scale 1 (sub
        {| x := 0; y := 0; z := 0 |} from))) by
        (unfold on_line, d, add, scale, sub; destruct from, to; cbn; f_equal; ring).
      eapply Rle_trans; [apply triangle|]. rewrite norm_scale by lra. apply Rplus_le_compat_l. rewrite Rmult_1_l.
      right. unfold norm. f_equal. unfold dot, sub. cbn. ring. }
    pose proof least_below_tiny as LT.
    unfold u in *. lra.
Qed.

End Motion.

(** * First stage of the sweep with interpolated ends

    Model of `Overlap::interpolated` and `RelativeMotion::interpolated`: the ends of the motion lie on lines between
    samples at other times. The theorems are those of [decisions]. *)

From Coq Require Import Reals Lra ZArith Lia.
From Flocq Require Import Core.
From Proofs Require Import geometry doubles constants resolution decisions.
Open Scope R_scope.

(** `Line`: samples at both ends. *)
Record line := { from_s : R; to_s : R; start : vector; stop : vector }.

Definition is_line (l : line) : Prop :=
  double (from_s l) /\ double (to_s l) /\ is_position (start l) /\ is_position (stop l).

(** `share` of `Overlap::interpolated`, with `Line::fraction`; [is_end] belongs to the end of the motion. *)
Definition share_by (quotient : R -> R -> R) (l : line) (t : R) (is_end : bool) : R :=
  if Rle_dec (to_s l) (from_s l) then if is_end then 1 else 0
  else if Rle_dec t (from_s l) then 0
  else if Rle_dec (to_s l) t then 1
  else quotient (t - from_s l) (to_s l - from_s l).

Definition share : line -> R -> bool -> R := share_by Rdiv.
Definition computed_share : line -> R -> bool -> R := share_by (fun a b => rounded (rounded a / rounded b)).

(** True position on a line. *)
Definition position (l : line) (t : R) (is_end : bool) : vector := on_line (start l) (stop l) (share l t is_end).

Definition relative_position (a b : line) (t : R) (is_end : bool) : vector :=
  sub (position b t is_end) (position a t is_end).

Definition computed_position (a b : line) (t : R) (is_end : bool) : vector :=
  fadd (fsub (start b) (start a))
    (fsub (fscale (fsub (stop b) (start b)) (computed_share b t is_end))
      (fscale (fsub (stop a) (start a)) (computed_share a t is_end))).

(** `RelativeMotion::interpolated`: `interpolated_squared`. *)
Definition interpolated_squared (a b : line) : R :=
  let squared c := fdot c c in
  rounded (9 * rounded (3 * rounded (rounded (squared (fsub (start b) (start a)) + squared (fsub (stop a) (start a)))
    + squared (fsub (stop b) (start b))))).

Lemma share_error : forall l t is_end, is_line l -> double t ->
  0 <= share l t is_end <= 1 /\ 0 <= computed_share l t is_end /\
  Rabs (computed_share l t is_end - share l t is_end) <= 3.01 * u * share l t is_end + least.
Proof.
  intros l t is_end (F & T & _ & _) D. unfold share, computed_share, share_by.
  pose proof least_is_positive as PL.
  assert (Zero : Rabs (0 - 0) <= 3.01 * u * 0 + least) by (rewrite Rminus_0_r, Rabs_R0; lra).
  assert (One : Rabs (1 - 1) <= 3.01 * u * 1 + least).
  { replace (1 - 1) with 0 by ring. rewrite Rabs_R0. unfold u. lra. }
  destruct Rle_dec as [|N]; [destruct is_end; lra|].
  destruct Rle_dec as [|N1]; [lra|]. destruct Rle_dec as [|N2]; [lra|].
  apply Rnot_le_lt in N, N1, N2.
  pose proof (difference_error t (from_s l) D F) as A. pose proof (difference_error (to_s l) (from_s l) T F) as B.
  set (a := t - from_s l) in *. set (b := to_s l - from_s l) in *.
  assert (Pa : 0 < a) by (unfold a; lra). assert (Pb : 0 < b) by (unfold b; lra).
  assert (ab : a <= b) by (unfold a, b; lra).
  rewrite (Rabs_pos_eq a) in A by lra. rewrite (Rabs_pos_eq b) in B by lra.
  apply Rabs_le_inv in A, B.
  assert (Pa' : 0 < rounded a) by (unfold u in *; lra). assert (Pb' : 0 < rounded b) by (unfold u in *; lra).
  assert (Q : Rabs (rounded a / rounded b - a / b) <= 2.001 * u * (a / b)).
  { set (q := rounded a / rounded b). set (e := a / b).
    assert (Eq : q * rounded b = rounded a) by (unfold q; field; lra).
    assert (Ee : e * b = a) by (unfold e; field; lra).
    assert (Pe : 0 <= e) by (unfold e; apply Rmult_le_pos; [lra | left; now apply Rinv_0_lt_compat]).
    assert (Pq : 0 <= q) by (unfold q; apply Rmult_le_pos; [lra | left; now apply Rinv_0_lt_compat]).
    assert (q * ((1 - u) * b) <= q * rounded b) by (apply Rmult_le_compat_l; [auto|lra]).
    assert (q * rounded b <= q * ((1 + u) * b)) by (apply Rmult_le_compat_l; [auto|lra]).
    assert (U : q * b <= (1 + 2.001 * u) * e * b) by (unfold u in *; lra).
    assert (V : (1 - 2.001 * u) * e * b <= q * b) by (unfold u in *; lra).
    apply Rmult_le_reg_r in U, V; auto. apply Rabs_le. lra. }
  assert (Pq : 0 <= rounded a / rounded b) by (apply Rmult_le_pos; [lra | left; now apply Rinv_0_lt_compat]).
  assert (Pe : 0 <= a / b) by (apply Rmult_le_pos; [lra | left; now apply Rinv_0_lt_compat]).
  assert (Le : a / b <= 1) by (apply Rmult_le_reg_r with b; [auto|]; unfold Rdiv; rewrite Rmult_assoc, Rinv_l; lra).
  pose proof (rounded_between _ Pq) as R. split; [lra|]. split; [now apply rounded_is_positive|].
  apply Rabs_le_inv in Q. apply Rabs_le. unfold u in *. lra.
Qed.

(** A computed displacement times its share. *)
Lemma part_error : forall l t is_end, is_line l -> double t ->
  norm (sub (fscale (fsub (stop l) (start l)) (computed_share l t is_end))
      (scale (share l t is_end) (sub (stop l) (start l))))
    <= 5.1 * u * norm (sub (stop l) (start l)) + u * tiny.
Proof.
  intros l t is_end L D. destruct (share_error l t is_end L D) as ((S0 & S1) & C0 & E).
  destruct L as (_ & _ & P & Q). set (by_ := sub (stop l) (start l)). set (by' := fsub (stop l) (start l)).
  set (c := computed_share l t is_end) in *. set (s := share l t is_end) in *.
  destruct (computed_difference (stop l) (start l)) as (B1 & B2 & B3); [apply Q|apply P|].
  fold by_ in B1, B2, B3. change (fsub (stop l) (start l)) with by' in B1, B2, B3.
  pose proof (fscale_error by' c C0) as F. pose proof (norm_is_positive by_) as PB. pose proof least_is_positive as PL.
  assert (N : norm by_ <= huge).
  { pose proof (position_is_short _ P). pose proof (position_is_short _ Q).
    pose proof (difference_is_short (stop l) (start l)). pose proof short_is_not_huge. fold by_ in H1.
    assert (0 <= MAX_LENGTH_M) by (unfold MAX_LENGTH_M; lra). lra. }
  assert (LN : least * norm by_ <= u * tiny / 1000000).
  { eapply Rle_trans; [apply Rmult_le_compat_l; [lra|exact N]|apply least_of_huge]. }
  apply Rabs_le_inv in E.
  assert (SU : 3.01 * u * s <= 3.01 * u) by (unfold u; lra).
  pose proof least_below_tiny as LT. pose proof tiny_is_positive as PT.
  assert (Lu : least <= u / 1000).
  { pose proof tiny_is_small. assert (/ 10 ^ 140 <= 1 / 1000) by lra. unfold u in *; lra. }
  replace (sub (fscale by' c) (scale s by_)) with
    (add (sub (fscale by' c) (scale c by')) (add (scale c (sub by' by_)) (sub (scale c by_) (scale s by_))))
    by (unfold add, sub, scale; cbn; f_equal; ring).
  eapply Rle_trans; [apply triangle|]. eapply Rle_trans; [apply Rplus_le_compat_l, triangle|].
  rewrite norm_scale by auto.
  assert (D3 : norm (sub (scale c by_) (scale s by_)) <= 3.01 * u * norm by_ + least * norm by_).
  { replace (sub (scale c by_) (scale s by_)) with (scale (c - s) by_)
      by (unfold sub, scale; cbn; f_equal; ring).
    assert (K : norm (scale (c - s) by_) = Rabs (c - s) * norm by_).
    { unfold norm. replace (dot (scale (c - s) by_) (scale (c - s) by_)) with ((c - s) * (c - s) * dot by_ by_)
        by (unfold dot, scale; cbn; ring).
      rewrite sqrt_mult_alt by apply Rle_0_sqr. f_equal. apply sqrt_Rsqr_abs. }
    rewrite K. rewrite <- Rmult_plus_distr_r. apply Rmult_le_compat_r; auto. apply Rabs_le. lra. }
  assert (c * norm (sub by' by_) <= (1 + 3.02 * u) * (u * norm by_)).
  { apply Rmult_le_compat; auto using norm_is_positive. unfold u in *. lra. }
  assert (c * norm by' <= (1 + 3.02 * u) * ((1 + u) * norm by_)).
  { apply Rmult_le_compat; auto using norm_is_positive. unfold u in *. lra. }
  unfold u in *. lra.
Qed.

Section Lines.

Variables a b : line.
Hypothesis line_a : is_line a.
Hypothesis line_b : is_line b.

(** Sum of the lengths of the terms. *)
Definition sum_of_terms : R :=
  norm (sub (start b) (start a)) + norm (sub (stop a) (start a)) + norm (sub (stop b) (start b)).

Let S := sum_of_terms.

Lemma terms_are_positive : 0 <= norm (sub (start b) (start a)) /\ 0 <= norm (sub (stop a) (start a)) /\
  0 <= norm (sub (stop b) (start b)).
Proof. repeat split; apply norm_is_positive. Qed.

Lemma sum_is_positive : 0 <= S.
Proof. destruct terms_are_positive as (? & ? & ?). unfold S, sum_of_terms. lra. Qed.

Lemma position_error : forall t is_end, double t ->
  norm (sub (computed_position a b t is_end) (relative_position a b t is_end)) <= 7.5 * u * S + 4 * u * tiny /\
  norm (relative_position a b t is_end) <= S.
Proof.
  intros t is_end D. destruct terms_are_positive as (P0 & P1 & P2). pose proof tiny_is_positive as PT.
  pose proof (part_error a t is_end line_a D) as Ea. pose proof (part_error b t is_end line_b D) as Eb.
  destruct (share_error a t is_end line_a D) as ((A0 & A1) & _).
  destruct (share_error b t is_end line_b D) as ((B0 & B1) & _).
  destruct (computed_difference (start b) (start a)) as (C1 & _ & _); [apply line_b|apply line_a|].
  unfold computed_position, relative_position, position.
  set (s0 := fsub (start b) (start a)) in *. set (s := sub (start b) (start a)) in *.
  set (pa' := fscale (fsub (stop a) (start a)) (computed_share a t is_end)) in *.
  set (pb' := fscale (fsub (stop b) (start b)) (computed_share b t is_end)) in *.
  set (pa := scale (share a t is_end) (sub (stop a) (start a))) in *.
  set (pb := scale (share b t is_end) (sub (stop b) (start b))) in *.
  assert (Na : norm pa <= norm (sub (stop a) (start a))).
  { unfold pa. rewrite norm_scale by auto.
    assert (share a t is_end * norm (sub (stop a) (start a)) <= 1 * norm (sub (stop a) (start a)))
      by (now apply Rmult_le_compat_r). lra. }
  assert (Nb : norm pb <= norm (sub (stop b) (start b))).
  { unfold pb. rewrite norm_scale by auto.
    assert (share b t is_end * norm (sub (stop b) (start b)) <= 1 * norm (sub (stop b) (start b)))
      by (now apply Rmult_le_compat_r). lra. }
  assert (R : sub (on_line (start b) (stop b) (share b t is_end)) (on_line (start a) (stop a) (share a t is_end)) =
    add s (sub pb pa)) by (unfold on_line, s, pb, pa, add, sub, scale; cbn; f_equal; ring).
  rewrite R.
  pose proof (fsub_error pb' pa' (fscale_is_doubles _ _) (fscale_is_doubles _ _)) as F1.
  pose proof (fadd_error s0 (fsub pb' pa') (fsub_is_doubles _ _) (fsub_is_doubles _ _)) as F2.
  pose proof (norms_differ pa' pa) as Va. pose proof (norms_differ pb' pb) as Vb. apply Rabs_le_inv in Va, Vb.
  pose proof (difference_is_short pb' pa') as W1.
  pose proof (norms_differ (fsub pb' pa') (sub pb' pa')) as W2. apply Rabs_le_inv in W2.
  pose proof (triangle s0 (fsub pb' pa')) as W3.
  pose proof (norms_differ s0 s) as W4. apply Rabs_le_inv in W4.
  pose proof (triangle s (sub pb pa)) as W5. pose proof (difference_is_short pb pa) as W6.
  assert (ES : S = norm s + norm (sub (stop a) (start a)) + norm (sub (stop b) (start b))) by reflexivity.
  split; [|lra].
  replace (sub (fadd s0 (fsub pb' pa')) (add s (sub pb pa))) with
    (add (sub (fadd s0 (fsub pb' pa')) (add s0 (fsub pb' pa')))
      (add (sub s0 s) (add (sub (fsub pb' pa') (sub pb' pa')) (sub (sub pb' pb) (sub pa' pa)))))
    by (unfold add, sub; cbn; f_equal; ring).
  eapply Rle_trans; [apply triangle|]. eapply Rle_trans; [apply Rplus_le_compat_l, triangle|].
  eapply Rle_trans; [apply Rplus_le_compat_l, Rplus_le_compat_l, triangle|].
  eapply Rle_trans; [apply Rplus_le_compat_l, Rplus_le_compat_l, Rplus_le_compat_l, difference_is_short|].
  unfold u in *. lra.
Qed.

Lemma interpolated_is_positive : 0 <= interpolated_squared a b.
Proof.
  unfold interpolated_squared. apply rounded_is_positive, Rmult_le_pos; [lra|].
  apply rounded_is_positive, Rmult_le_pos; [lra|].
  apply rounded_is_positive, Rplus_le_le_0_compat; [|apply fdot_self_is_positive].
  apply rounded_is_positive, Rplus_le_le_0_compat; apply fdot_self_is_positive.
Qed.

(** The scale of interpolated ends covers three times the sum of the terms. *)
Lemma scale_covers_terms : 3 * S <= (1 + 10 * u) * sqrt (interpolated_squared a b) + tiny.
Proof.
  destruct terms_are_positive as (P0 & P1 & P2).
  assert (N : forall c, 0 <= fdot c c) by apply fdot_self_is_positive.
  destruct (computed_difference (start b) (start a)) as (_ & _ & C0); [apply line_b|apply line_a|].
  destruct (computed_difference (stop a) (start a)) as (_ & _ & C1); [apply line_a|apply line_a|].
  destruct (computed_difference (stop b) (start b)) as (_ & _ & C2); [apply line_b|apply line_b|].
  pose proof (length_error (fsub (start b) (start a))) as L0. pose proof (length_error (fsub (stop a) (start a))) as L1.
  pose proof (length_error (fsub (stop b) (start b))) as L2. apply Rabs_le_inv in L0, L1, L2.
  pose proof (N (fsub (start b) (start a))) as N0. pose proof (N (fsub (stop a) (start a))) as N1.
  pose proof (N (fsub (stop b) (start b))) as N2.
  unfold interpolated_squared. cbv zeta.
  set (k0 := fdot (fsub (start b) (start a)) (fsub (start b) (start a))) in *.
  set (k1 := fdot (fsub (stop a) (start a)) (fsub (stop a) (start a))) in *.
  set (k2 := fdot (fsub (stop b) (start b)) (fsub (stop b) (start b))) in *.
  assert (Q1 : 0 <= k0 + k1) by lra. pose proof (rounded_between _ Q1) as R1.
  pose proof (rounded_is_positive _ Q1) as G1.
  set (m1 := rounded (k0 + k1)) in *.
  assert (Q2 : 0 <= m1 + k2) by lra. pose proof (rounded_between _ Q2) as R2.
  pose proof (rounded_is_positive _ Q2) as G2.
  set (m2 := rounded (m1 + k2)) in *.
  assert (Q3 : 0 <= 3 * m2) by lra. pose proof (rounded_between _ Q3) as R3.
  pose proof (rounded_is_positive _ Q3) as G3.
  set (m3 := rounded (3 * m2)) in *.
  assert (Q4 : 0 <= 9 * m3) by lra. pose proof (rounded_between _ Q4) as R4.
  pose proof (rounded_is_positive _ Q4) as G4.
  set (m4 := rounded (9 * m3)) in *. clearbody k0 k1 k2 m1 m2 m3 m4.
  pose proof least_is_small as LS. pose proof tiny_is_positive as PT. pose proof least_is_positive as PL.
  set (q0 := sqrt k0) in *. set (q1 := sqrt k1) in *. set (q2 := sqrt k2) in *. set (q4 := sqrt m4).
  assert (E0 : q0 * q0 = k0) by (now apply sqrt_sqrt). assert (E1 : q1 * q1 = k1) by (now apply sqrt_sqrt).
  assert (E2 : q2 * q2 = k2) by (now apply sqrt_sqrt). assert (E4 : q4 * q4 = m4) by (now apply sqrt_sqrt).
  assert (P4 : 0 <= q4) by apply sqrt_pos. assert (Z0 : 0 <= q0) by apply sqrt_pos.
  assert (Z1 : 0 <= q1) by apply sqrt_pos. assert (Z2 : 0 <= q2) by apply sqrt_pos.
  set (ut := u * tiny) in *. assert (Put : 0 < ut) by (unfold ut, u; lra).
  assert (Putt : 0 <= ut * ut) by (apply Rle_0_sqr).
  (* The square of a sum of three is at most three times the sum of the squares. *)
  assert (Sum : 3 * (q0 + q1 + q2) <= (1 + 3 * u) * q4 + ut).
  { apply square_at_most; [unfold u; lra|].
    pose proof (Rle_0_sqr (q0 - q1)) as S1. pose proof (Rle_0_sqr (q1 - q2)) as S2.
    pose proof (Rle_0_sqr (q2 - q0)) as S3.
    unfold Rsqr in S1, S2, S3. assert (0 <= q4 * ut) by (apply Rmult_le_pos; lra).
    assert (K : 27 * (k0 + k1 + k2) <= (1 + 5 * u) * m4 + 200 * least) by (unfold u in *; lra).
    replace (((1 + 3 * u) * q4 + ut) * ((1 + 3 * u) * q4 + ut)) with
      ((1 + 3 * u) * (1 + 3 * u) * (q4 * q4) + 2 * (1 + 3 * u) * (q4 * ut) + ut * ut) by ring.
    rewrite E4. unfold u in *. lra. }
  assert (ES : S = norm (sub (start b) (start a)) + norm (sub (stop a) (start a)) + norm (sub (stop b) (start b)))
    by reflexivity.
  unfold ut, u in *. lra.
Qed.

(** Computed ends of the motion from time [t0] to [t1]. *)
Variables t0 t1 : R.
Hypothesis double_t0 : double t0.
Hypothesis double_t1 : double t1.

Let from := computed_position a b t0 false.
Let to := computed_position a b t1 true.
Let first := relative_position a b t0 false.
Let last := relative_position a b t1 true.

Lemma terms_are_short : S <= 12 * MAX_LENGTH_M.
Proof.
  destruct line_a as (_ & _ & A & A'). destruct line_b as (_ & _ & B & B').
  pose proof (position_is_short _ A). pose proof (position_is_short _ A').
  pose proof (position_is_short _ B). pose proof (position_is_short _ B').
  pose proof (difference_is_short (start b) (start a)). pose proof (difference_is_short (stop a) (start a)).
  pose proof (difference_is_short (stop b) (start b)). unfold S, sum_of_terms. lra.
Qed.

Lemma from_within_terms : norm from <= (1 + 8 * u) * S + 4 * u * tiny.
Proof.
  destruct (position_error t0 false double_t0) as [E N]. pose proof sum_is_positive.
  pose proof (norms_differ from first) as D. apply Rabs_le_inv in D. fold from first in E, N. unfold u in *. lra.
Qed.

Lemma lines_are_not_huge : norm (sub to from) <= huge.
Proof.
  pose proof sum_is_positive. pose proof from_within_terms as F. destruct (position_error t1 true double_t1) as [E N].
  pose proof (norms_differ to last) as D. apply Rabs_le_inv in D. fold to last in E, N.
  pose proof (difference_is_short to from). pose proof terms_are_short. pose proof short_is_not_huge as H'.
  pose proof tiny_is_small. assert (/ 10 ^ 140 <= 1) by lra. unfold MAX_LENGTH_M, u in *. lra.
Qed.

Lemma lines_error : forall s, 0 <= s <= 1 -> ends_error from to first last s <= 7.5 * u * S + 4 * u * tiny.
Proof.
  intros s R. unfold ends_error.
  replace (sub (on_line from to s) (on_line first last s)) with
    (add (scale (1 - s) (sub from first)) (scale s (sub to last)))
    by (unfold on_line, add, sub, scale; cbn; f_equal; ring).
  eapply Rle_trans; [apply triangle|]. rewrite !norm_scale by lra.
  destruct (position_error t0 false double_t0) as [E0 _]. destruct (position_error t1 true double_t1) as [E1 _].
  fold from first in E0. fold to last in E1. set (e := 7.5 * u * S + 4 * u * tiny) in *.
  assert ((1 - s) * norm (sub from first) <= (1 - s) * e) by (apply Rmult_le_compat_l; lra).
  assert (s * norm (sub to last) <= s * e) by (apply Rmult_le_compat_l; lra). lra.
Qed.

Lemma lines_are_within : forall s, 0 <= s <= 1 ->
  12.41 * u * norm from + ends_error from to first last s <= 6.7 * u * sqrt (interpolated_squared a b) + tiny.
Proof.
  intros s R. pose proof (lines_error s R). pose proof from_within_terms. pose proof scale_covers_terms.
  pose proof tiny_is_positive. pose proof (sqrt_pos (interpolated_squared a b)).
  pose proof sum_is_positive. unfold u in *. lra.
Qed.

Lemma lines_are_close : forall s, 0 <= s <= 1 ->
  12.41 * u * norm from + ends_error from to first last s <=
  13.7 * u * sqrt (scale_squared from to (interpolated_squared a b)) + tiny.
Proof.
  intros s R. pose proof (lines_are_within s R) as W.
  assert (sqrt (interpolated_squared a b) <= sqrt (scale_squared from to (interpolated_squared a b))).
  { apply sqrt_le_1_alt. apply larger_is_most. }
  pose proof (sqrt_pos (interpolated_squared a b)). unfold u in *. lra.
Qed.

Lemma lines_start_close : forall s, 0 <= s <= 1 ->
  12.41 * u * norm from + ends_error from to first last s <=
  14.5 * u * sqrt (larger (fdot from from) (interpolated_squared a b)) + 1.01 * u * norm (on_line first last s) + tiny.
Proof.
  intros s R. pose proof (lines_are_within s R) as W.
  assert (sqrt (interpolated_squared a b) <= sqrt (larger (fdot from from) (interpolated_squared a b))).
  { apply sqrt_le_1_alt. apply larger_is_most. }
  pose proof (sqrt_pos (interpolated_squared a b)). pose proof (norm_is_positive (on_line first last s)).
  unfold u in *. lra.
Qed.

Lemma lines_are_doubles : doubles from /\ doubles to.
Proof. split; apply fadd_is_doubles. Qed.

(** True relative position at a fraction of the motion. *)
Definition relative_between (s : R) : vector := on_line first last s.

Theorem lines_clear : forall delta s,
  MIN_LIMIT_M <= delta -> ~ is_near from to (interpolated_squared a b) delta -> 0 <= s <= 1 ->
  delta <= norm (relative_between s).
Proof.
  intros delta s D N R. destruct lines_are_doubles. pose proof interpolated_is_positive.
  apply (clear_is_clear from to first last (interpolated_squared a b)); auto; try lra.
  - apply lines_are_not_huge.
  - apply lines_start_close.
Qed.

Theorem lines_below : forall limit,
  double limit -> MIN_LIMIT_M <= limit -> is_surely_below from to (interpolated_squared a b) limit ->
  exists s, 0 <= s <= 1 /\ norm (relative_between s) < limit.
Proof.
  intros limit D L B. destruct lines_are_doubles. pose proof interpolated_is_positive.
  apply (surely_below_is_below from to first last (interpolated_squared a b)); auto. apply lines_are_close.
Qed.

Theorem lines_bounds : least_scale <= sqrt (scale_squared from to (interpolated_squared a b)) ->
  (forall s, 0 <= s <= 1 -> lower from to (interpolated_squared a b) <= norm (relative_between s)) /\
  exists s, 0 <= s <= 1 /\ norm (relative_between s) <= upper from to (interpolated_squared a b).
Proof.
  intros L. destruct lines_are_doubles. pose proof interpolated_is_positive.
  apply (bounds_enclose from to first last (interpolated_squared a b)); auto.
  - apply lines_are_not_huge.
  - apply lines_are_close.
Qed.

Theorem lines_skipped : forall known s, least_scale <= sqrt (scale_squared from to (interpolated_squared a b)) ->
  0 <= known -> ~ is_candidate from to (interpolated_squared a b) known -> 0 <= s <= 1 ->
  known <= norm (relative_between s).
Proof.
  intros known s L K N R. destruct lines_are_doubles. pose proof interpolated_is_positive.
  apply (skipped_is_not_below from to first last (interpolated_squared a b)); auto.
  - apply lines_are_not_huge.
  - apply lines_are_close.
Qed.

End Lines.

(** The relative position at a fraction of the motion is that of the two lines at this time. *)
Lemma position_is_straight : forall l t0 t1 s, from_s l < to_s l -> from_s l <= t0 <= to_s l -> from_s l <= t1
  <= to_s l ->
  0 <= s <= 1 ->
  position l (t0 + s * (t1 - t0)) true = on_line (position l t0 false) (position l t1 true) s.
Proof.
  intros l t0 t1 s L A B S.
  assert (Q : forall t e, from_s l <= t <= to_s l -> share l t e = (t - from_s l) / (to_s l - from_s l)).
  { intros t e T. unfold share, share_by. destruct Rle_dec; [lra|]. destruct Rle_dec.
    - replace t with (from_s l) by lra. field. lra.
    - destruct Rle_dec; auto. replace t with (to_s l) by lra. field. lra. }
  assert (from_s l <= t0 + s * (t1 - t0) <= to_s l).
  { assert (0 <= s * (t1 - from_s l)) by (apply Rmult_le_pos; lra).
    assert (0 <= (1 - s) * (t0 - from_s l)) by (apply Rmult_le_pos; lra).
    assert (0 <= s * (to_s l - t1)) by (apply Rmult_le_pos; lra).
    assert (0 <= (1 - s) * (to_s l - t0)) by (apply Rmult_le_pos; lra). lra. }
  unfold position. rewrite !Q by auto. unfold on_line, add, scale, sub. cbn. f_equal; field; lra.
Qed.

(** * Separation of the vehicles of a replayed flight

    [replay] accepts a log, so at each of its events the references of each pair keep their margins from a common plane
    ([references_are_on_opposite_sides]). So two vehicles within their tubes are at least delta apart. *)

From Coq Require Import Reals Lra ZArith Bool List.
From Proofs Require contract replay geometry.
Import geometry ListNotations.
Open Scope R_scope.

Section Flight.

(** Number of units in a metre, and the factor of vertical lengths in these units. *)
Variables one vertical : Z.
Hypothesis one_is_positive : (0 < one)%Z.

Definition metres (n : Z) : R := IZR n / IZR one.

Definition place (p : replay.point) : vector :=
  {| x := metres (replay.p_x p); y := metres (replay.p_y p); z := metres (replay.p_z p) |}.

(** `Metric::scaled`. *)
Definition scaled (v : vector) : vector := {| x := x v; y := y v; z := metres vertical * z v |}.

(** Normal of a divider, which has length 1 up to rounding. *)
Definition normal_of (d : replay.divider) : vector :=
  {| x := metres (replay.d_x d); y := metres (replay.d_y d); z := metres (replay.d_z d) |}.

(** Margin of a vehicle without the part for rounding that [replay] leaves out. *)
Definition margin (s : replay.start) : R := metres (replay.s_margin s - replay.slack one).

(** A point of the convex hull of the two segments of a period, such as a point of the path
    ([geometry.path_is_within]). *)
Definition may_be_at (m : contract.motion replay.segment) (p : vector) : Prop :=
  is_within
    (place (replay.s_begin (contract.now m))) (place (replay.s_stop (contract.now m)))
    (place (replay.s_begin (contract.next m))) (place (replay.s_stop (contract.next m))) p.

Lemma dot_scaled : forall n p, dot n (scaled p) = dot (scaled n) p.
Proof. intros. unfold dot, scaled. simpl. ring. Qed.

Lemma unit_is_positive : 0 < IZR one.
Proof. now apply IZR_lt. Qed.

(** Bounds in integers are bounds in metres. *)
Lemma bound_in_metres : forall d m,
  IZR (replay.bound one d m) =
  metres (m - replay.slack one) * (1 + dot (normal_of d) (normal_of d)) * (IZR one * IZR one * IZR one).
Proof.
  intros d m. unfold replay.bound, normal_of, dot, metres. cbn [x y z].
  rewrite mult_IZR, !plus_IZR, !mult_IZR. field. apply Rgt_not_eq, unit_is_positive.
Qed.

Lemma offset_in_metres : forall d p,
  IZR (2 * (replay.d_offset d * (one * one) - replay.extent one vertical d p)) =
  2 * (metres (replay.d_offset d) - dot (normal_of d) (scaled (place p))) * (IZR one * IZR one * IZR one).
Proof.
  intros d p. unfold replay.extent, normal_of, place, scaled, dot, metres. cbn [x y z].
  rewrite mult_IZR, minus_IZR, plus_IZR, !mult_IZR, plus_IZR, !mult_IZR. field. apply Rgt_not_eq, unit_is_positive.
Qed.

Lemma cube_is_positive : 0 < IZR one * IZR one * IZR one.
Proof. pose proof unit_is_positive. apply Rmult_lt_0_compat; auto. apply Rmult_lt_0_compat; auto. Qed.

Lemma owner_end : forall d m p,
  (replay.bound one d m <=? 2 * (replay.d_offset d * (one * one) - replay.extent one vertical d p))%Z = true ->
  dot (scaled (normal_of d)) (place p) <=
    metres (replay.d_offset d) - metres (m - replay.slack one) * (1 + dot (normal_of d) (normal_of d)) / 2.
Proof.
  intros d m p H. apply Z.leb_le, IZR_le in H. rewrite bound_in_metres, offset_in_metres in H.
  apply Rmult_le_reg_r in H; [|apply cube_is_positive]. rewrite dot_scaled in H. lra.
Qed.

Lemma follower_end : forall d m p,
  (replay.bound one d m <=? 2 * (replay.extent one vertical d p - replay.d_offset d * (one * one)))%Z = true ->
  dot (scale (-1) (scaled (normal_of d))) (place p) <=
    - metres (replay.d_offset d) - metres (m - replay.slack one) * (1 + dot (normal_of d) (normal_of d)) / 2.
Proof.
  intros d m p H. apply Z.leb_le, IZR_le in H.
  replace (2 * (replay.extent one vertical d p - replay.d_offset d * (one * one)))%Z
    with (- (2 * (replay.d_offset d * (one * one) - replay.extent one vertical d p)))%Z in H by ring.
  rewrite opp_IZR, bound_in_metres, offset_in_metres in H.
  rewrite <- Ropp_mult_distr_l_reverse in H. apply Rmult_le_reg_r in H; [|apply cube_is_positive].
  rewrite dot_scaled in H. unfold scale, dot in *. simpl in *. lra.
Qed.

(** A vector of length 1 in the direction of a normal. A length l is at most (1 + l^2) / 2. *)
Lemma unit_normal_of : forall n, 0 < dot n n -> exists k, 0 < k /\ dot (scale k n) (scale k n) = 1 /\
  forall m, 0 <= m -> m <= k * (m * (1 + dot n n) / 2).
Proof.
  intros n P. exists (/ norm n).
  assert (L : 0 < norm n) by (unfold norm; now apply sqrt_lt_R0).
  assert (S : dot n n = norm n * norm n) by (unfold norm; rewrite sqrt_sqrt; lra).
  split; [now apply Rinv_0_lt_compat|split].
  - replace (dot (scale (/ norm n) n) (scale (/ norm n) n)) with (/ norm n * / norm n * dot n n)
      by (unfold dot, scale; simpl; ring).
    rewrite S. field. lra.
  - intros m M. rewrite S. set (l := norm n) in *.
    replace (/ l * (m * (1 + l * l) / 2)) with (m * ((1 + l * l) / (2 * l))) by (field; lra).
    assert (1 <= (1 + l * l) / (2 * l)).
    { apply Rmult_le_reg_r with (2 * l); [lra|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra.
      pose proof (Rle_0_sqr (l - 1)) as Q. unfold Rsqr in Q. lra. }
    apply Rle_trans with (m * 1); [lra|]. now apply Rmult_le_compat_l.
Qed.

(** The references of each pair of an accepted log are on opposite sides of a common plane, with both margins. *)
Theorem references_are_on_opposite_sides : forall all planes entries rows p a b,
  replay.replay one vertical all planes entries = Some rows -> In p (replay.pairs_of rows) ->
  0 < margin (replay.owner_start (replay.pair_facts p)) -> 0 < margin (replay.follower_start (replay.pair_facts p)) ->
  may_be_at (replay.pair_owner_motion p) a -> may_be_at (replay.pair_follower_motion p) b ->
  exists d,
    in_owner_plane (margin (replay.owner_start (replay.pair_facts p))) d (scaled a) /\
    in_follower_plane (margin (replay.follower_start (replay.pair_facts p))) d (scaled b).
Proof.
  intros all planes entries rows p a b H I M1 M2 A B.
  destruct (replay.logged_pairs_have_a_common_plane _ _ _ _ _ _ _ H I) as (d & DO & DF).
  destruct (replay.logged_segments_are_inside _ _ _ _ _ _ _ H I) as [MO MF].
  destruct (MO d DO) as [O1 O2]. destruct (MF d DF) as [F1 F2]. clear MO MF.
  unfold replay.owner_contains, replay.follower_contains, replay.inside_owner, replay.inside_follower in *.
  apply andb_prop in O1, O2, F1, F2. destruct O1 as [A1 A2], O2 as [A3 A4], F1 as [B1 B2], F2 as [B3 B4].
  apply owner_end in A1, A2, A3, A4. apply follower_end in B1, B2, B3, B4.
  fold (margin (replay.owner_start (replay.pair_facts p))) in *.
  fold (margin (replay.follower_start (replay.pair_facts p))) in *.
  set (m1 := margin (replay.owner_start (replay.pair_facts p))) in *.
  set (m2 := margin (replay.follower_start (replay.pair_facts p))) in *.
  pose proof (A _ _ A1 A2 A3 A4) as Q. pose proof (B _ _ B1 B2 B3 B4) as S.
  rewrite <- dot_scaled in Q.
  replace (dot (scale (-1) (scaled (normal_of d))) b) with (- dot (normal_of d) (scaled b)) in S
    by (unfold dot, scale, scaled; simpl; ring).
  set (n := normal_of d) in *. set (c := metres (replay.d_offset d)) in *.
  assert (N : 0 < dot n n).
  { destruct (Rle_or_lt (dot n n) 0) as [Z | Z]; auto. exfalso.
    assert (X : x n = 0 /\ y n = 0 /\ z n = 0).
    { unfold dot in Z. pose proof (Rle_0_sqr (x n)). pose proof (Rle_0_sqr (y n)). pose proof (Rle_0_sqr (z n)).
      unfold Rsqr in *. repeat split; apply Rsqr_0_uniq; unfold Rsqr; lra. }
    destruct X as (X & Y & W). unfold dot in *. rewrite X, Y, W in *. lra. }
  destruct (unit_normal_of n N) as (k & K & U & L).
  exists {| normal := scale k n; offset := k * c; unit_normal := U |}.
  unfold in_owner_plane, in_follower_plane. simpl.
  assert (D : forall v, dot (scale k n) v = k * dot n v) by (intros; unfold dot, scale; simpl; ring).
  rewrite !D. pose proof (L m1 (Rlt_le _ _ M1)) as L1. pose proof (L m2 (Rlt_le _ _ M2)) as L2.
  apply (Rmult_le_compat_l k) in Q; [|lra]. apply (Rmult_le_compat_l k) in S; [|lra].
  split.
  - apply Rle_trans with (1 := Q). rewrite Rmult_minus_distr_l. lra.
  - rewrite <- Ropp_mult_distr_r in S. rewrite Rmult_minus_distr_l, <- Ropp_mult_distr_r in S. lra.
Qed.

(** At each event of an accepted log the references of each pair are at least the sum of their margins apart. *)
Theorem references_are_apart : forall all planes entries rows p a b,
  replay.replay one vertical all planes entries = Some rows -> In p (replay.pairs_of rows) ->
  0 < margin (replay.owner_start (replay.pair_facts p)) -> 0 < margin (replay.follower_start (replay.pair_facts p)) ->
  may_be_at (replay.pair_owner_motion p) a -> may_be_at (replay.pair_follower_motion p) b ->
  margin (replay.owner_start (replay.pair_facts p)) + margin (replay.follower_start (replay.pair_facts p)) <=
    distance (scaled a) (scaled b).
Proof.
  intros all planes entries rows p a b H I M1 M2 A B.
  destruct (references_are_on_opposite_sides _ _ _ _ _ _ _ H I M1 M2 A B) as (d & P & Q).
  exact (sides_are_apart d _ _ _ _ P Q).
Qed.

(** Vehicles within their tubes of these references are at least delta apart. *)
Theorem vehicles_are_apart : forall all planes entries rows p delta e1 e2 a b a' b',
  replay.replay one vertical all planes entries = Some rows -> In p (replay.pairs_of rows) ->
  0 < delta -> 0 <= e1 -> 0 <= e2 ->
  delta / 2 + e1 <= margin (replay.owner_start (replay.pair_facts p)) ->
  delta / 2 + e2 <= margin (replay.follower_start (replay.pair_facts p)) ->
  may_be_at (replay.pair_owner_motion p) a -> may_be_at (replay.pair_follower_motion p) b ->
  distance (scaled a) (scaled a') <= e1 -> distance (scaled b') (scaled b) <= e2 ->
  delta <= distance (scaled a') (scaled b').
Proof.
  intros all planes entries rows p delta e1 e2 a b a' b' H I D E1 E2 M1 M2 A B T1 T2.
  assert (P1 : 0 < margin (replay.owner_start (replay.pair_facts p))) by lra.
  assert (P2 : 0 < margin (replay.follower_start (replay.pair_facts p))) by lra.
  destruct (references_are_on_opposite_sides _ _ _ _ _ _ _ H I P1 P2 A B) as (d & P & Q).
  exact (geometry.vehicles_are_apart d delta e1 e2 _ _ _ _ _ _ M1 M2 P Q T1 T2).
Qed.

End Flight.

(** * No overflow in the first stage of the sweep

    [doubles] models binary64 without a largest number. All computed values of [resolution] and [decisions] are below
    1e160, and the largest double is 1.8e308. Only the quotient of [fraction] may be larger: it is infinite then, and
    its minimum with 1 is 1 as in the model. *)

From Coq Require Import Reals Lra List.
From Flocq Require Import Core.
From Proofs Require Import geometry doubles constants resolution decisions interpolated.
Import ListNotations.
Open Scope R_scope.

Definition coordinates (a : vector) : list R := [x a; y a; z a].

Definition dot_values (a b : vector) : list R :=
  [rounded (x a * x b); rounded (y a * y b); rounded (z a * z b);
   rounded (rounded (x a * x b) + rounded (y a * y b)); fdot a b].

(** Values of `RelativeMotion::closest`, but for the quotient. *)
Definition closest_values (from to : vector) : list R :=
  let by_ := fsub to from in
  coordinates by_ ++ dot_values from from ++ dot_values to to ++ dot_values from by_ ++ dot_values to by_ ++
  dot_values by_ by_ ++
  if Rlt_dec (fdot from by_) 0 then
    let share := fraction (fdot from by_) (fdot by_ by_) in
    let step := fscale by_ share in
    let point := fadd from step in
    [share] ++ coordinates step ++ coordinates point ++ dot_values point point
  else [].

(** Values of the decisions. *)
Definition decision_values (from to : vector) (interpolated limit : R) : list R :=
  let scale := rounded (sqrt (scale_squared from to interpolated)) in
  let square := rounded (limit * limit) in
  let sum := rounded (larger (fdot from from) interpolated + square) in
  [closest from to; separation from to; scale_squared from to interpolated; scale;
   resolution from to interpolated; lower from to interpolated; upper from to interpolated;
   square; sum; rounded (GRAZING_BAND * sum); rounded (square + rounded (GRAZING_BAND * sum));
   rounded (square * rounded (1 + rounded MARGIN));
   rounded (rounded OF_SCALE * scale_squared from to interpolated);
   rounded (rounded (square * rounded (1 + rounded MARGIN)) +
     rounded (rounded OF_SCALE * scale_squared from to interpolated))].

Definition is_at_most (b : R) (v : R) : Prop := Rabs v <= b.

Lemma rounded_at_most : forall r b, Rabs r <= b -> Rabs (rounded r) <= 2 * b + 1.
Proof.
  intros r b H. pose proof (rounding_error r) as E. pose proof (Rabs_pos r).
  assert (L : least <= 1).
  { pose proof least_below_tiny. pose proof tiny_is_small. pose proof least_is_positive.
    assert (/ 10 ^ 140 <= 1) by lra. assert (u * tiny <= u * 1) by (apply Rmult_le_compat_l; [unfold u|]; lra).
    unfold u in *. lra. }
  assert (Rabs (rounded r) <= Rabs r + Rabs (rounded r - r)).
  { replace (rounded r) with (r + (rounded r - r)) at 1 by ring. apply Rabs_triang. }
  unfold u in *. lra.
Qed.

Lemma product_at_most : forall a b c d, Rabs a <= c -> Rabs b <= d -> Rabs (rounded (a * b)) <= 2 * (c * d) + 1.
Proof. intros. apply rounded_at_most. rewrite Rabs_mult. apply Rmult_le_compat; auto using Rabs_pos. Qed.

Lemma sum_at_most : forall a b c d, Rabs a <= c -> Rabs b <= d -> Rabs (rounded (a + b)) <= 2 * (c + d) + 1.
Proof. intros. apply rounded_at_most. eapply Rle_trans; [apply Rabs_triang|]. lra. Qed.

Lemma difference_at_most : forall a b c d, Rabs a <= c -> Rabs b <= d -> Rabs (rounded (a - b)) <= 2 * (c + d) + 1.
Proof. intros. apply sum_at_most; auto. now rewrite Rabs_Ropp. Qed.

Lemma at_most_more : forall b c l, b <= c -> Forall (is_at_most b) l -> Forall (is_at_most c) l.
Proof. intros b c l L. apply Forall_impl. unfold is_at_most. intros. lra. Qed.

Lemma dot_values_at_most : forall a b c d, 1 <= c -> 1 <= d ->
  Forall (is_at_most c) (coordinates a) -> Forall (is_at_most d) (coordinates b) ->
  Forall (is_at_most (50 * (c * d))) (dot_values a b).
Proof.
  intros a b c d C D A B. unfold coordinates in *.
  inversion_clear A as [|? ? A1 A']. inversion_clear A' as [|? ? A2 A'']. inversion_clear A'' as [|? ? A3 _].
  inversion_clear B as [|? ? B1 B']. inversion_clear B' as [|? ? B2 B'']. inversion_clear B'' as [|? ? B3 _].
  pose proof (product_at_most _ _ _ _ A1 B1) as P1. pose proof (product_at_most _ _ _ _ A2 B2) as P2.
  pose proof (product_at_most _ _ _ _ A3 B3) as P3.
  assert (K : 1 <= c * d) by (rewrite <- (Rmult_1_l 1); apply Rmult_le_compat; lra).
  pose proof (sum_at_most _ _ _ _ P1 P2) as S. pose proof (sum_at_most _ _ _ _ S P3) as T.
  unfold dot_values, fdot. repeat apply Forall_cons; try apply Forall_nil; unfold is_at_most; lra.
Qed.

Lemma closest_does_not_overflow : forall from to,
  Forall (is_at_most 1e72) (coordinates from) -> Forall (is_at_most 1e72) (coordinates to) ->
  Forall (is_at_most 1e150) (closest_values from to).
Proof.
  intros from to F T. set (by_ := fsub to from).
  assert (B : Forall (is_at_most 1e73) (coordinates by_)).
  { unfold by_, fsub, coordinates in *. cbn [x y z].
    inversion_clear F as [|? ? F1 F']. inversion_clear F' as [|? ? F2 F'']. inversion_clear F'' as [|? ? F3 _].
    inversion_clear T as [|? ? T1 T']. inversion_clear T' as [|? ? T2 T'']. inversion_clear T'' as [|? ? T3 _].
    unfold is_at_most in *.
    repeat apply Forall_cons; try apply Forall_nil; (eapply Rle_trans; [apply difference_at_most; eassumption|lra]). }
  unfold closest_values. fold by_. cbv zeta.
  assert (Dots : forall a b c d, 1 <= c -> 1 <= d -> 50 * (c * d) <= 1e150 ->
    Forall (is_at_most c) (coordinates a) -> Forall (is_at_most d) (coordinates b) ->
    Forall (is_at_most 1e150) (dot_values a b)).
  { intros. apply at_most_more with (50 * (c * d)); auto. now apply dot_values_at_most. }
  repeat (apply Forall_app; split).
  - apply at_most_more with 1e73; auto. lra.
  - apply (Dots _ _ 1e72 1e72); auto; lra.
  - apply (Dots _ _ 1e72 1e72); auto; lra.
  - apply (Dots _ _ 1e72 1e73); auto; lra.
  - apply (Dots _ _ 1e72 1e73); auto; lra.
  - apply (Dots _ _ 1e73 1e73); auto; lra.
  - destruct (Rlt_dec (fdot from by_) 0) as [Q|]; [|constructor].
    pose proof (fraction_is_between from to Q) as S. fold by_ in S.
    set (share := fraction (fdot from by_) (fdot by_ by_)) in *.
    assert (Sh : Rabs share <= 1) by (rewrite Rabs_pos_eq; lra).
    assert (St : Forall (is_at_most 3e73) (coordinates (fscale by_ share))).
    { unfold fscale, coordinates in *. cbn [x y z].
      inversion_clear B as [|? ? B1 B']. inversion_clear B' as [|? ? B2 B'']. inversion_clear B'' as [|? ? B3 _].
      unfold is_at_most in *.
      repeat apply Forall_cons; try apply Forall_nil; (eapply Rle_trans; [eapply product_at_most; eassumption|lra]). }
    set (step := fscale by_ share) in *.
    assert (Pt : Forall (is_at_most 1e74) (coordinates (fadd from step))).
    { unfold fadd, coordinates in *. cbn [x y z].
      inversion_clear F as [|? ? F1 F']. inversion_clear F' as [|? ? F2 F'']. inversion_clear F'' as [|? ? F3 _].
      inversion_clear St as [|? ? T1 T']. inversion_clear T' as [|? ? T2 T'']. inversion_clear T'' as [|? ? T3 _].
      unfold is_at_most in *.
      repeat apply Forall_cons; try apply Forall_nil; (eapply Rle_trans; [eapply sum_at_most; eassumption|lra]). }
    repeat (apply Forall_app; split).
    + constructor; [unfold is_at_most; lra|constructor].
    + apply at_most_more with 3e73; auto. lra.
    + apply at_most_more with 1e74; auto. lra.
    + apply (Dots _ _ 1e74 1e74); auto; lra.
Qed.

Lemma root_at_most : forall r b, 0 <= r <= b -> 1 <= b -> Rabs (sqrt r) <= b.
Proof.
  intros r b [P L] B. rewrite Rabs_pos_eq by apply sqrt_pos. apply square_at_most; [lra|].
  rewrite sqrt_sqrt by auto. assert (1 * b <= b * b) by (apply Rmult_le_compat_r; lra). lra.
Qed.

Lemma decisions_do_not_overflow : forall from to interpolated limit,
  Forall (is_at_most 1e72) (coordinates from) -> Forall (is_at_most 1e72) (coordinates to) ->
  0 <= interpolated <= 1e150 -> 0 <= limit <= 1e70 ->
  Forall (is_at_most 1e160) (decision_values from to interpolated limit).
Proof.
  intros from to i l F T I L.
  assert (Dot : forall a, Forall (is_at_most 1e72) (coordinates a) -> 0 <= fdot a a <= 1e150).
  { intros a A. pose proof (dot_values_at_most a a 1e72 1e72 ltac:(lra) ltac:(lra) A A) as D.
    assert (In (fdot a a) (dot_values a a)) by (unfold dot_values; cbn [In]; tauto).
    rewrite Forall_forall in D. specialize (D _ H). unfold is_at_most in D.
    pose proof (fdot_self_is_positive a). rewrite Rabs_pos_eq in D by auto. lra. }
  pose proof (Dot from F) as Df. pose proof (Dot to T) as Dt.
  destruct (closest_is_of_candidates from to) as (C & _).
  pose proof (closest_is_positive from to) as PC.
  assert (S : 0 <= scale_squared from to i <= 1e150).
  { unfold scale_squared, larger. repeat destruct Rlt_dec; lra. }
  assert (W : 0 <= larger (fdot from from) i <= 1e150) by (unfold larger; destruct Rlt_dec; lra).
  unfold decision_values, lower, upper, resolution, separation. cbv zeta.
  set (c := closest from to) in *. set (s := scale_squared from to i) in *. set (w := larger (fdot from from) i) in *.
  apply at_most_more with (1000 * 1e150); [lra|].
  assert (Sq : Rabs (rounded (l * l)) <= 3 * 1e150).
  { assert (Al : Rabs l <= 1e70) by (rewrite Rabs_pos_eq; lra).
    eapply Rle_trans; [apply (product_at_most _ _ _ _ Al Al)|]. lra. }
  assert (B1 : 1 <= 1e150) by lra. set (b := 1e150) in *. clearbody b.
  assert (Ac : Rabs c <= b) by (rewrite Rabs_pos_eq; lra).
  assert (As : Rabs s <= b) by (rewrite Rabs_pos_eq; lra).
  assert (Aw : Rabs w <= b) by (rewrite Rabs_pos_eq; lra).
  pose proof (rounded_at_most _ _ (root_at_most c b ltac:(lra) B1)) as Sep.
  pose proof (rounded_at_most _ _ (root_at_most s b ltac:(lra) B1)) as Sc.
  assert (Rs : Rabs RESOLUTION <= 1) by (rewrite Rabs_pos_eq; unfold RESOLUTION, EPSILON; lra).
  assert (Gr : Rabs GRAZING_BAND <= 1) by (rewrite Rabs_pos_eq; unfold GRAZING_BAND, EPSILON; lra).
  assert (Mg : Rabs MARGIN <= 1) by (rewrite Rabs_pos_eq; unfold MARGIN; lra).
  assert (Of : Rabs OF_SCALE <= 1) by (rewrite Rabs_pos_eq; unfold OF_SCALE; lra).
  assert (A1 : Rabs 1 <= 1) by (rewrite Rabs_pos_eq; lra).
  pose proof (product_at_most _ _ _ _ Rs Sc) as Re.
  pose proof (sum_at_most _ _ _ _ Sep Re) as Up. pose proof (difference_at_most _ _ _ _ Sep Re) as Lo.
  pose proof (sum_at_most _ _ _ _ Aw Sq) as Su.
  pose proof (product_at_most _ _ _ _ Gr Su) as Ba. pose proof (sum_at_most _ _ _ _ Sq Ba) as Be.
  pose proof (sum_at_most _ _ _ _ A1 (rounded_at_most _ _ Mg)) as Om.
  pose proof (product_at_most _ _ _ _ Sq Om) as Sm.
  pose proof (product_at_most _ _ _ _ (rounded_at_most _ _ Of) As) as Os.
  pose proof (sum_at_most _ _ _ _ Sm Os) as Tot.
  repeat apply Forall_cons; try apply Forall_nil; unfold is_at_most; lra.
Qed.

(** ** Positions *)

Lemma coordinates_of_norm : forall a b, norm a <= b -> Forall (is_at_most b) (coordinates a).
Proof.
  intros a b N.
  assert (K : forall c, c * c <= dot a a -> Rabs c <= b).
  { intros c C. apply Rle_trans with (norm a); auto. apply square_at_most; [apply norm_is_positive|].
    rewrite norm_squared, <- Rabs_mult, Rabs_pos_eq by apply Rle_0_sqr. exact C. }
  pose proof (Rle_0_sqr (x a)) as X. pose proof (Rle_0_sqr (y a)) as Y. pose proof (Rle_0_sqr (z a)) as Z.
  unfold Rsqr in *. unfold coordinates.
  repeat apply Forall_cons; try apply Forall_nil; apply K; unfold dot; lra.
Qed.

Lemma difference_of_positions : forall a b, is_position a -> is_position b -> norm (fsub a b) <= 5e70.
Proof.
  intros a b A B. destruct (computed_difference a b) as (_ & N & _); [apply A|apply B|].
  pose proof (difference_is_short a b). pose proof (position_is_short _ A). pose proof (position_is_short _ B).
  unfold MAX_LENGTH_M, u in *. lra.
Qed.

(** Nothing overflows for motions between samples. *)
Theorem samples_do_not_overflow : forall p limit, are_positions p -> 0 <= limit <= MAX_LENGTH_M ->
  Forall (is_at_most 1e150) (closest_values (computed_from p) (computed_to p)) /\
  Forall (is_at_most 1e160) (decision_values (computed_from p) (computed_to p) 0 limit).
Proof.
  intros p l (A & B & C & D) L. unfold MAX_LENGTH_M in L.
  assert (F : Forall (is_at_most 1e72) (coordinates (computed_from p))).
  { apply coordinates_of_norm. pose proof (difference_of_positions _ _ C A). unfold computed_from. lra. }
  assert (T : Forall (is_at_most 1e72) (coordinates (computed_to p))).
  { apply coordinates_of_norm. pose proof (difference_of_positions _ _ D B). unfold computed_to. lra. }
  split; [now apply closest_does_not_overflow | apply decisions_do_not_overflow; auto; lra].
Qed.

(** Nor for motions between interpolated ends. *)
Theorem lines_do_not_overflow : forall a b t0 t1 limit, is_line a -> is_line b -> double t0 -> double t1 ->
  0 <= limit <= MAX_LENGTH_M ->
  let from := computed_position a b t0 false in
  let to := computed_position a b t1 true in
  Forall (is_at_most 1e150) (closest_values from to) /\
  Forall (is_at_most 1e160) (decision_values from to (interpolated_squared a b) limit).
Proof.
  intros a b t0 t1 l A B D0 D1 L from to. unfold MAX_LENGTH_M in L.
  pose proof (terms_are_short a b A B) as S. pose proof tiny_is_positive. pose proof tiny_is_small as Ti.
  assert (Ti' : tiny <= 1) by lra.
  assert (N : forall t e, double t -> Forall (is_at_most 1e72) (coordinates (computed_position a b t e))).
  { intros t e Dt. apply coordinates_of_norm. destruct (position_error a b A B t e Dt) as [E R].
    pose proof (norms_differ (computed_position a b t e) (relative_position a b t e)) as V. apply Rabs_le_inv in V.
    unfold MAX_LENGTH_M, u in *. lra. }
  assert (I : 0 <= interpolated_squared a b <= 1e150).
  { split; [apply interpolated_is_positive|].
    destruct A as (_ & _ & A1 & A2). destruct B as (_ & _ & B1 & B2).
    assert (Sq : forall c d, is_position c -> is_position d -> Rabs (fdot (fsub c d) (fsub c d)) <= 1e144).
    { intros c d C D.
      assert (K : Forall (is_at_most 5e70) (coordinates (fsub c d))).
      { now apply coordinates_of_norm, difference_of_positions. }
      pose proof (dot_values_at_most _ _ 5e70 5e70 ltac:(lra) ltac:(lra) K K) as V.
      rewrite Forall_forall in V. assert (In (fdot (fsub c d) (fsub c d)) (dot_values (fsub c d) (fsub c d)))
        by (unfold dot_values; cbn [In]; tauto).
      specialize (V _ H0). unfold is_at_most in V. lra. }
    unfold interpolated_squared. cbv zeta.
    assert (A3 : Rabs 3 <= 3) by (rewrite Rabs_pos_eq; lra). assert (A9 : Rabs 9 <= 9) by (rewrite Rabs_pos_eq; lra).
    pose proof (sum_at_most _ _ _ _ (Sq _ _ B1 A1) (Sq _ _ A2 A1)) as S1.
    pose proof (sum_at_most _ _ _ _ S1 (Sq _ _ B2 B1)) as S2.
    pose proof (product_at_most _ _ _ _ A3 S2) as S3. pose proof (product_at_most _ _ _ _ A9 S3) as S4.
    eapply Rle_trans; [apply Rle_abs|]. eapply Rle_trans; [exact S4|]. lra. }
  split.
  - apply closest_does_not_overflow; now apply N.
  - apply decisions_do_not_overflow; try (now apply N); auto; lra.
Qed.

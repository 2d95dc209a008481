(** * Planes, paths and the brake, over the real numbers

    Lemma 1 and the last step of the theorem of `docs/shield.md`. All lengths are those of the metric of the pair
    (`plane::Metric`): true lengths for balls, scaled ones for ellipsoids. Doubles are not modelled: the margin for
    rounding of `settings.rs` covers them. *)

From Coq Require Import Reals Lra.
Open Scope R_scope.

(** Vector of three numbers. *)
Record vector := { x : R; y : R; z : R }.

Definition add (a b : vector) : vector := {| x := x a + x b; y := y a + y b; z := z a + z b |}.
Definition scale (k : R) (a : vector) : vector := {| x := k * x a; y := k * y a; z := k * z a |}.
Definition sub (a b : vector) : vector := {| x := x a - x b; y := y a - y b; z := z a - z b |}.
Definition dot (a b : vector) : R := x a * x b + y a * y b + z a * z b.
Definition norm (a : vector) : R := sqrt (dot a a).
Definition distance (a b : vector) : R := norm (sub b a).

Lemma dot_add : forall n a b, dot n (add a b) = dot n a + dot n b.
Proof. intros. unfold dot, add. simpl. ring. Qed.

Lemma dot_sub : forall n a b, dot n (sub a b) = dot n a - dot n b.
Proof. intros. unfold dot, sub. simpl. ring. Qed.

Lemma dot_scale : forall n k a, dot n (scale k a) = k * dot n a.
Proof. intros. unfold dot, scale. simpl. ring. Qed.

(** Cauchy-Schwarz for a unit normal. *)
Lemma extent_is_at_most_norm : forall n a, dot n n = 1 -> dot n a <= norm a.
Proof.
  intros n a U. unfold norm.
  destruct (Rle_or_lt (dot n a) 0) as [N | P].
  - apply Rle_trans with 0; [exact N | apply sqrt_pos].
  - rewrite <- (sqrt_square (dot n a)) by lra. apply sqrt_le_1_alt.
    assert (L : dot n n * dot a a - dot n a * dot n a =
      (x n * y a - y n * x a) * (x n * y a - y n * x a) + (y n * z a - z n * y a) * (y n * z a - z n * y a) +
      (z n * x a - x n * z a) * (z n * x a - x n * z a)).
    { unfold dot. ring. }
    rewrite U in L.
    pose proof (Rle_0_sqr (x n * y a - y n * x a)) as A.
    pose proof (Rle_0_sqr (y n * z a - z n * y a)) as B.
    pose proof (Rle_0_sqr (z n * x a - x n * z a)) as C.
    unfold Rsqr in A, B, C. lra.
Qed.

(** ** Common plane *)

(** `plane::Divider`, with a normal of length 1. *)
Record divider := { normal : vector; offset : R; unit_normal : dot normal normal = 1 }.

(** `Divider::owner_plane` and `Divider::follower_plane`, each with the margin of its vehicle. *)
Definition in_owner_plane (m : R) (d : divider) (p : vector) : Prop := dot (normal d) p <= offset d - m.
Definition in_follower_plane (m : R) (d : divider) (p : vector) : Prop := - dot (normal d) p <= - offset d - m.

(** Two points on opposite sides of a common plane are at least both margins apart. *)
Theorem sides_are_apart : forall d m1 m2 p q,
  in_owner_plane m1 d p -> in_follower_plane m2 d q -> m1 + m2 <= distance p q.
Proof.
  intros d m1 m2 p q P Q. unfold in_owner_plane, in_follower_plane in *.
  apply Rle_trans with (dot (normal d) (sub q p)); [rewrite dot_sub; lra|].
  apply extent_is_at_most_norm, unit_normal.
Qed.

(** Last step of the theorem. The references are on opposite sides of a common plane, with margins of at least delta / 2
    and the tube. Each vehicle is within its tube of its reference. Then the vehicles are at least delta apart. *)
Theorem vehicles_are_apart : forall d delta e1 e2 m1 m2 p q p' q',
  delta / 2 + e1 <= m1 -> delta / 2 + e2 <= m2 ->
  in_owner_plane m1 d p -> in_follower_plane m2 d q ->
  distance p p' <= e1 -> distance q' q <= e2 ->
  delta <= distance p' q'.
Proof.
  intros d delta e1 e2 m1 m2 p q p' q' M1 M2 P Q E1 E2. unfold in_owner_plane, in_follower_plane in *.
  pose proof (extent_is_at_most_norm (normal d) (sub p' p) (unit_normal d)) as A.
  pose proof (extent_is_at_most_norm (normal d) (sub q q') (unit_normal d)) as B.
  pose proof (extent_is_at_most_norm (normal d) (sub q' p') (unit_normal d)) as C.
  unfold distance in *. rewrite dot_sub in A, B, C. lra.
Qed.

(** ** Stop point of the brake *)

(** `Brake::glide_s` at a speed with [m] whole periods of brake: m = floor(speed / (b h)). *)
Definition glide (b h : R) (m : nat) (speed : R) : R :=
  h * (INR m + 1 / 2) - b * h * h * INR m * (INR m + 1) / (2 * speed).

(** [m] is the number of whole periods of brake at this speed. *)
Definition whole_periods (b h : R) (m : nat) (speed : R) : Prop :=
  INR m * (b * h) <= speed < (INR m + 1) * (b * h).

(** G >= h / 2. *)
Theorem glide_is_at_least_half_a_period : forall b h m speed,
  0 < b -> 0 < h -> whole_periods b h m speed -> h / 2 <= glide b h m speed.
Proof.
  intros b h m speed B H [L _]. unfold glide.
  destruct m as [|m].
  - simpl. unfold Rdiv. rewrite Rmult_0_r, !Rmult_0_l. lra.
  - rewrite S_INR in *. set (k := INR m) in *. assert (K : 0 <= k) by apply pos_INR.
    assert (V : 0 < speed).
    { assert (0 < b * h) by (apply Rmult_lt_0_compat; auto). nra. }
    assert (T : b * h * h * (k + 1) * (k + 1 + 1) / (2 * speed) <= h * (k + 1 + 1) / 2).
    { apply Rmult_le_reg_r with (2 * speed); [lra|].
      unfold Rdiv at 1. rewrite Rmult_assoc, Rinv_l, Rmult_1_r by lra.
      replace (b * h * h * (k + 1) * (k + 1 + 1)) with (((k + 1) * (b * h)) * (h * (k + 1 + 1))) by ring.
      replace (h * (k + 1 + 1) / 2 * (2 * speed)) with (speed * (h * (k + 1 + 1))) by field.
      apply Rmult_le_compat_r; [|exact L]. apply Rmult_le_pos; lra. }
    assert (K2 : 0 <= h * k) by (apply Rmult_le_pos; lra).
    nra.
Qed.

(** State of a reference: `brake::State`. *)
Record state := { position : vector; velocity : vector }.

(** `State::after`. *)
Definition after (s : state) (u : vector) (t : R) : state := {|
  position := add (add (position s) (scale t (velocity s))) (scale (t * t / 2) u);
  velocity := add (velocity s) (scale t u) |}.

(** `Brake::stop_m`, with [m] whole periods. *)
Definition stop (b h : R) (m : nat) (s : state) : vector :=
  add (position s) (scale (glide b h m (norm (velocity s))) (velocity s)).

(** `Brake::command`: full deceleration for whole periods, and then what is left of the speed. *)
Definition brake (b h : R) (v : vector) : vector :=
  if Rle_dec (norm v) (b * h) then scale (- / h) v else scale (- b / norm v) v.

Lemma norm_scale : forall k a, 0 <= k -> norm (scale k a) = k * norm a.
Proof.
  intros k a K. unfold norm. replace (dot (scale k a) (scale k a)) with ((k * k) * dot a a).
  - rewrite sqrt_mult_alt by (apply Rmult_le_pos; auto). now rewrite sqrt_square.
  - unfold dot, scale. simpl. ring.
Qed.

Ltac by_axes := unfold add, sub, scale; simpl; f_equal.

(** Period of brake at more than the speed that the period removes. *)
Lemma full_period : forall b h m s,
  0 < b -> 0 < h -> whole_periods b h m (norm (velocity s)) -> b * h < norm (velocity s) ->
  let s' := after s (brake b h (velocity s)) h in
  exists m', m = S m' /\ whole_periods b h m' (norm (velocity s')) /\ stop b h m' s' = stop b h m s /\
  exists covered, 0 <= covered <= glide b h m (norm (velocity s)) /\
    position s' = add (position s) (scale covered (velocity s)).
Proof.
  intros b h m [p v] B H W F. simpl in *. set (speed := norm v) in *.
  assert (BH : 0 < b * h) by (apply Rmult_lt_0_compat; auto).
  assert (Speed : 0 < speed) by lra.
  destruct m as [|m]; [unfold whole_periods in W; simpl in W; lra|].
  exists m. split; [reflexivity|].
  unfold brake. fold speed. destruct (Rle_dec speed (b * h)); [lra|].
  set (k := 1 - b * h / speed).
  assert (K : 0 < k).
  { unfold k. apply Rmult_lt_reg_r with speed; auto. field_simplify; lra. }
  assert (V : add v (scale h (scale (- b / speed) v)) = scale k v).
  { unfold k. by_axes; field; lra. }
  rewrite V. unfold stop. simpl. rewrite V, (norm_scale k v) by lra. fold speed.
  assert (N : k * speed = speed - b * h) by (unfold k; field; lra).
  rewrite N.
  assert (W' : whole_periods b h m (speed - b * h)).
  { unfold whole_periods in *. rewrite S_INR in W. lra. }
  assert (G : h - b * h * h / (2 * speed) + k * glide b h m (speed - b * h) = glide b h (S m) speed).
  { unfold k, glide. rewrite S_INR. field. lra. }
  split; [exact W'|split].
  - rewrite <- G. by_axes; field; lra.
  - exists (h - b * h * h / (2 * speed)). split.
    + assert (b * h * h / (2 * speed) <= h / 2).
      { apply Rmult_le_reg_r with (2 * speed); [lra|]. unfold Rdiv at 1.
        rewrite Rmult_assoc, Rinv_l, Rmult_1_r by lra.
        replace (h / 2 * (2 * speed)) with (speed * h) by field. apply Rmult_le_compat_r; lra. }
      assert (h / 2 <= glide b h m (speed - b * h)) by now apply glide_is_at_least_half_a_period.
      assert (0 <= k * glide b h m (speed - b * h)) by (apply Rmult_le_pos; lra).
      lra.
    + by_axes; field; lra.
Qed.

(** Last period of brake. *)
Lemma last_period : forall b h m s,
  0 < b -> 0 < h -> whole_periods b h m (norm (velocity s)) -> norm (velocity s) <= b * h ->
  let s' := after s (brake b h (velocity s)) h in
  velocity s' = {| x := 0; y := 0; z := 0 |} /\ position s' = stop b h m s.
Proof.
  intros b h m [p v] B H W F. simpl in *. set (speed := norm v) in *.
  assert (BH : 0 < b * h) by (apply Rmult_lt_0_compat; auto).
  assert (G : glide b h m speed = h / 2).
  { unfold glide, whole_periods in *. destruct m as [|[|m]].
    - simpl. unfold Rdiv. rewrite Rmult_0_r, !Rmult_0_l. lra.
    - simpl in *. replace speed with (b * h) by lra. field. lra.
    - rewrite !S_INR in W. pose proof (pos_INR m). nra. }
  unfold brake, stop. fold speed. simpl. destruct (Rle_dec speed (b * h)); [|lra].
  fold speed. rewrite G. destruct v. split; by_axes; field; lra.
Qed.

(** Lemma 1. After a period of brake the stop point is the same one, until the vehicle rests at it. *)
Theorem brake_keeps_its_stop_point : forall b h m s,
  0 < b -> 0 < h -> whole_periods b h m (norm (velocity s)) ->
  let s' := after s (brake b h (velocity s)) h in
  exists m', whole_periods b h m' (norm (velocity s')) /\ stop b h m' s' = stop b h m s.
Proof.
  intros b h m s B H W. cbv zeta.
  destruct (Rle_or_lt (norm (velocity s)) (b * h)) as [L | L].
  - destruct (last_period b h m s B H W L) as [V P]. exists 0%nat. split.
    + rewrite V. unfold whole_periods, norm, dot. simpl.
      replace (0 * 0 + 0 * 0 + 0 * 0) with 0 by ring. rewrite sqrt_0.
      assert (0 < b * h) by (apply Rmult_lt_0_compat; auto). lra.
    + rewrite <- P. unfold stop. rewrite V. destruct (position _). by_axes; ring.
  - destruct (full_period b h m s B H W L) as (m' & _ & W' & E & _). eauto.
Qed.

(** Lemma 1. A half-space that contains a segment contains that of the brake after a period. So the brake is a command
    that the contract allows ([contract.brake_is_a_choice]). *)
Theorem brake_stays_in_its_segment : forall b h m s n c,
  0 < b -> 0 < h -> whole_periods b h m (norm (velocity s)) ->
  let s' := after s (brake b h (velocity s)) h in
  dot n (position s) <= c -> dot n (stop b h m s) <= c ->
  exists m', whole_periods b h m' (norm (velocity s')) /\ dot n (position s') <= c /\ dot n (stop b h m' s') <= c.
Proof.
  intros b h m s n c B H W s' P S.
  destruct (brake_keeps_its_stop_point b h m s B H W) as (m' & W' & E). exists m'.
  split; [exact W'|split; [|unfold s'; rewrite E; exact S]].
  destruct (Rle_or_lt (norm (velocity s)) (b * h)) as [L | L].
  - destruct (last_period b h m s B H W L) as [_ Q]. unfold s'. rewrite Q. exact S.
  - destruct (full_period b h m s B H W L) as (_ & _ & _ & _ & g & G & Q).
    unfold s', stop in *. rewrite Q. rewrite dot_add, dot_scale in *.
    destruct (Rle_or_lt (dot n (velocity s)) 0) as [N | N].
    + assert (g * dot n (velocity s) <= g * 0) by (apply Rmult_le_compat_l; lra). lra.
    + assert (g * dot n (velocity s) <= glide b h m (norm (velocity s)) * dot n (velocity s))
        by (apply Rmult_le_compat_r; lra). lra.
Qed.

(** ** Path of a period *)

(** A point is in the closed convex hull of two segments: it is in each half-space that contains the four ends. *)
Definition is_within (p s p' s' point : vector) : Prop :=
  forall n c, dot n p <= c -> dot n s <= c -> dot n p' <= c -> dot n s' <= c -> dot n point <= c.

(** Lemma 1. The path of a period is in each half-space with its begin, its stop point and its end. It is a Bezier
    curve, and its second control point is in the segment to the stop point because G >= h / 2. *)
Theorem path_is_within : forall s u g h t s',
  0 < h -> h / 2 <= g -> 0 <= t <= h ->
  is_within (position s) (add (position s) (scale g (velocity s))) (position (after s u h)) s' (position (after s u t)).
Proof.
  intros [p v] u g h t s' H G T n c A B C _. simpl in *.
  rewrite !dot_add, !dot_scale in *.
  set (np := dot n p) in *. set (nv := dot n v) in *. set (nu := dot n u) in *.
  (* The second control point. *)
  assert (M : np + nv * (h / 2) <= c).
  { destruct (Rle_or_lt nv 0) as [N | N].
    - assert (nv * (h / 2) <= 0) by (apply Rle_trans with (0 * (h / 2)); [apply Rmult_le_compat_r|]; lra). lra.
    - assert (nv * (h / 2) <= nv * g) by (apply Rmult_le_compat_l; lra). lra. }
  set (f := t / h).
  assert (F : 0 <= f <= 1).
  { unfold f. split.
    - apply Rmult_le_pos; [lra | left; now apply Rinv_0_lt_compat].
    - apply Rmult_le_reg_r with h; auto. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. lra. }
  replace (np + t * nv + t * t / 2 * nu) with
    ((1 - f) * (1 - f) * np + 2 * f * (1 - f) * (np + nv * (h / 2)) + f * f * (np + h * nv + h * h / 2 * nu))
    by (unfold f; field; lra).
  assert (W1 : 0 <= (1 - f) * (1 - f)) by nra.
  assert (W2 : 0 <= 2 * f * (1 - f)) by nra.
  assert (W3 : 0 <= f * f) by nra.
  apply Rle_trans with ((1 - f) * (1 - f) * c + 2 * f * (1 - f) * c + f * f * c).
  - apply Rplus_le_compat; [apply Rplus_le_compat|]; apply Rmult_le_compat_l; auto.
  - right. ring.
Qed.

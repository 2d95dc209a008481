(** * Rounding of vectors of doubles

    Binary64, round to nearest, ties to even (Flocq). [rounded] has no largest number: `overflow.v` bounds the values of
    the sweep, and those of the shield are within 1e6 m. Underflow is included: its error is at most [least]. Rust rounds each
    operation on its own and fuses none. `dot` and `norm_squared` of nalgebra add (x + y) + z, as [fdot] does. *)

From Coq Require Import Reals Lra ZArith Lia.
From Flocq Require Import Core Plus_error Relative.
From Proofs Require Import geometry.
Open Scope R_scope.

Notation exponents := (FLT_exp (-1074) 53).
(** Numbers of binary64, without a largest one. *)
Definition double (r : R) : Prop := generic_format radix2 exponents r.
Definition rounded (r : R) : R := round radix2 exponents ZnearestE r.

Local Instance precision_is_positive : Prec_gt_0 53.
Proof. reflexivity. Qed.

(** Unit of rounding, 2^-53. *)
Definition u : R := / 9007199254740992.
(** Error of underflow. *)
Definition least : R := bpow radix2 (-1075).
(** Length below which errors do not matter \[m\], 3e-142. *)
Definition tiny : R := bpow radix2 (-470).

Lemma u_is_bpow : u = / 2 * bpow radix2 (- (53) + 1).
Proof. unfold u. simpl. lra. Qed.

Lemma u_ro_is_u : u_ro radix2 53 = u.
Proof. unfold u_ro, u. simpl. lra. Qed.

Lemma least_is_positive : 0 < least.
Proof. apply bpow_gt_0. Qed.

Lemma tiny_is_positive : 0 < tiny.
Proof. apply bpow_gt_0. Qed.

Lemma tiny_is_small : tiny <= / 10 ^ 140.
Proof.
  unfold tiny. apply Rle_trans with (bpow radix2 (-466)).
  - apply bpow_le. lia.
  - replace (-466)%Z with (- (466))%Z by lia. rewrite bpow_opp.
    apply Rinv_le; [apply pow_lt; lra|]. rewrite <- IZR_Zpower by lia. rewrite pow_IZR. apply IZR_le.
    vm_compute. discriminate.
Qed.

Lemma u_is_power : u = bpow radix2 (-53).
Proof. unfold u. simpl. lra. Qed.

Lemma least_is_small : least = / 536870912 * (u * tiny * (u * tiny)).
Proof.
  unfold least, tiny. rewrite u_is_power. replace (/ 536870912) with (bpow radix2 (-29)) by (simpl; lra).
  rewrite <- !bpow_plus. reflexivity.
Qed.

(** ** One operation *)

Lemma rounding_error : forall r, Rabs (rounded r - r) <= u * Rabs r + least.
Proof.
  intros r. destruct (relative_error_N_FLT'_ex radix2 (-1074) 53 ltac:(lia) (fun x => negb (Z.even x)) r)
    as (e & h & E & H & _ & D).
  unfold rounded. change ZnearestE with (Znearest (fun x => negb (Z.even x))). rewrite D.
  replace (r * (1 + e) + h - r) with (r * e + h) by ring.
  eapply Rle_trans; [apply Rabs_triang|]. apply Rplus_le_compat.
  - rewrite Rabs_mult, Rmult_comm. apply Rmult_le_compat_r; [apply Rabs_pos|].
    eapply Rle_trans; [exact E|]. rewrite u_ro_is_u. unfold u. lra.
  - replace least with (/ 2 * bpow radix2 (-1074)); [exact H|].
    unfold least. change (/ 2) with (bpow radix2 (-1)). rewrite <- bpow_plus. reflexivity.
Qed.

Lemma sum_error : forall a b, double a -> double b -> Rabs (rounded (a + b) - (a + b)) <= u * Rabs (a + b).
Proof.
  intros a b A B. destruct (FLT_plus_error_N_ex radix2 (-1074) 53 (fun x => negb (Z.even x)) a b A B)
    as (e & E & D).
  unfold rounded. change ZnearestE with (Znearest (fun x => negb (Z.even x))). rewrite D.
  replace ((a + b) * (1 + e) - (a + b)) with ((a + b) * e) by ring.
  rewrite Rabs_mult, Rmult_comm. apply Rmult_le_compat_r; [apply Rabs_pos|].
  eapply Rle_trans; [exact E|]. rewrite u_ro_is_u. unfold u. lra.
Qed.

Lemma double_opp : forall a, double a -> double (- a).
Proof. intros. now apply generic_format_opp. Qed.

Lemma difference_error : forall a b, double a -> double b -> Rabs (rounded (a - b) - (a - b)) <= u * Rabs (a - b).
Proof. intros a b A B. apply (sum_error a (- b)); auto using double_opp. Qed.

Lemma rounded_is_double : forall r, double (rounded r).
Proof. intros. apply generic_format_round; auto with typeclass_instances. Qed.

Lemma rounded_double : forall r, double r -> rounded r = r.
Proof. intros. apply round_generic; auto with typeclass_instances. Qed.

Lemma rounded_is_monotonic : forall a b, a <= b -> rounded a <= rounded b.
Proof. intros. apply round_le; auto with typeclass_instances. Qed.

Lemma double_0 : double 0.
Proof. apply generic_format_0. Qed.

Lemma rounded_is_positive : forall a, 0 <= a -> 0 <= rounded a.
Proof. intros a A. rewrite <- (rounded_double 0 double_0). now apply rounded_is_monotonic. Qed.

Lemma rounded_between : forall r, 0 <= r -> (1 - u) * r - least <= rounded r <= (1 + u) * r + least.
Proof.
  intros r P. pose proof (rounding_error r) as E. rewrite (Rabs_pos_eq r P) in E. apply Rabs_le_inv in E. lra.
Qed.

(** A comparison with a double is not changed by rounding. *)
Lemma below_before_rounding : forall a limit, double limit -> rounded a < limit -> a < limit.
Proof.
  intros a limit D L. destruct (Rlt_or_le a limit) as [|G]; auto.
  apply rounded_is_monotonic in G. rewrite (rounded_double limit D) in G. lra.
Qed.

Lemma double_1 : double 1.
Proof.
  change 1 with (bpow radix2 0). apply generic_format_bpow. unfold FLT_exp. simpl. lia.
Qed.

(** ** Lengths *)

Definition size (a : vector) : vector := {| x := Rabs (x a); y := Rabs (y a); z := Rabs (z a) |}.

Lemma norm_is_positive : forall a, 0 <= norm a.
Proof. intros. apply sqrt_pos. Qed.

Lemma dot_self_is_positive : forall a, 0 <= dot a a.
Proof.
  intros. unfold dot. pose proof (Rle_0_sqr (x a)). pose proof (Rle_0_sqr (y a)). pose proof (Rle_0_sqr (z a)).
  unfold Rsqr in *. lra.
Qed.

Lemma norm_squared : forall a, norm a * norm a = dot a a.
Proof. intros. apply sqrt_sqrt, dot_self_is_positive. Qed.

Lemma square_at_most : forall a b, 0 <= b -> a * a <= b * b -> a <= b.
Proof. intros a b B H. destruct (Rle_or_lt a b); auto. nra. Qed.

Lemma norm_at_most : forall a b, 0 <= b -> dot a a <= b * b -> norm a <= b.
Proof. intros. apply square_at_most; auto. now rewrite norm_squared. Qed.

Lemma cauchy_schwarz : forall a b, Rabs (dot a b) <= norm a * norm b.
Proof.
  intros a b. apply square_at_most.
  - apply Rmult_le_pos; apply norm_is_positive.
  - replace (norm a * norm b * (norm a * norm b)) with (norm a * norm a * (norm b * norm b)) by ring.
    rewrite !norm_squared. rewrite <- Rabs_mult, Rabs_pos_eq by apply Rle_0_sqr.
    assert (L : dot a a * dot b b - dot a b * dot a b =
      (x a * y b - y a * x b) * (x a * y b - y a * x b) + (y a * z b - z a * y b) * (y a * z b - z a * y b) +
      (z a * x b - x a * z b) * (z a * x b - x a * z b)) by (unfold dot; ring).
    pose proof (Rle_0_sqr (x a * y b - y a * x b)). pose proof (Rle_0_sqr (y a * z b - z a * y b)).
    pose proof (Rle_0_sqr (z a * x b - x a * z b)). unfold Rsqr in *. lra.
Qed.

Lemma dot_at_most : forall a b, dot a b <= norm a * norm b.
Proof. intros. eapply Rle_trans; [apply Rle_abs|apply cauchy_schwarz]. Qed.

Lemma norm_size : forall a, norm (size a) = norm a.
Proof.
  intros. unfold norm, dot, size. cbn. f_equal. rewrite <- !Rabs_mult, !Rabs_pos_eq by apply Rle_0_sqr. reflexivity.
Qed.

Lemma triangle : forall a b, norm (add a b) <= norm a + norm b.
Proof.
  intros a b. pose proof (norm_is_positive a). pose proof (norm_is_positive b). apply norm_at_most; [lra|].
  replace (dot (add a b) (add a b)) with (dot a a + 2 * dot a b + dot b b) by (unfold dot, add; cbn; ring).
  rewrite <- !norm_squared. pose proof (dot_at_most a b). nra.
Qed.

Lemma norm_scale : forall k a, 0 <= k -> norm (scale k a) = k * norm a.
Proof.
  intros k a K. unfold norm. replace (dot (scale k a) (scale k a)) with (k * k * dot a a)
    by (unfold dot, scale; cbn; ring).
  rewrite sqrt_mult_alt by nra. now rewrite sqrt_square.
Qed.

Lemma norm_opposite : forall a b, norm (sub a b) = norm (sub b a).
Proof. intros. unfold norm. f_equal. unfold dot, sub. cbn. ring. Qed.

(** Coordinates that are at most those of another vector, and a number. *)
Lemma norm_of_coordinates : forall e a t, 0 <= t ->
  Rabs (x e) <= Rabs (x a) + t -> Rabs (y e) <= Rabs (y a) + t -> Rabs (z e) <= Rabs (z a) + t ->
  norm e <= norm a + 2 * t.
Proof.
  intros e a t T X Y Z. rewrite <- (norm_size e).
  set (b := {| x := t; y := t; z := t |}).
  apply Rle_trans with (norm (add (size a) b)).
  - apply norm_at_most; [apply norm_is_positive|]. rewrite norm_squared. unfold dot, add, size, b. cbn.
    pose proof (Rabs_pos (x e)). pose proof (Rabs_pos (y e)). pose proof (Rabs_pos (z e)).
    repeat apply Rplus_le_compat; apply Rmult_le_compat; auto.
  - eapply Rle_trans; [apply triangle|]. rewrite norm_size. apply Rplus_le_compat_l.
    apply norm_at_most; [lra|]. unfold dot, b. cbn. nra.
Qed.

(** ** Vectors of doubles *)

Definition doubles (a : vector) : Prop := double (x a) /\ double (y a) /\ double (z a).

Definition fadd (a b : vector) : vector :=
  {| x := rounded (x a + x b); y := rounded (y a + y b); z := rounded (z a + z b) |}.
Definition fsub (a b : vector) : vector :=
  {| x := rounded (x a - x b); y := rounded (y a - y b); z := rounded (z a - z b) |}.
Definition fscale (a : vector) (k : R) : vector :=
  {| x := rounded (x a * k); y := rounded (y a * k); z := rounded (z a * k) |}.
(** `dot`, and with equal vectors `norm_squared`. *)
Definition fdot (a b : vector) : R :=
  rounded (rounded (rounded (x a * x b) + rounded (y a * y b)) + rounded (z a * z b)).

Lemma fdot_is_double : forall a b, double (fdot a b).
Proof. intros. apply rounded_is_double. Qed.

Lemma fadd_is_doubles : forall a b, doubles (fadd a b).
Proof. intros. repeat split; apply rounded_is_double. Qed.

Lemma fsub_is_doubles : forall a b, doubles (fsub a b).
Proof. intros. repeat split; apply rounded_is_double. Qed.

Lemma fscale_is_doubles : forall a k, doubles (fscale a k).
Proof. intros. repeat split; apply rounded_is_double. Qed.

Lemma fdot_self_is_positive : forall a, 0 <= fdot a a.
Proof.
  intros. unfold fdot. repeat (apply rounded_is_positive; try apply Rplus_le_le_0_compat); apply Rle_0_sqr.
Qed.

(** Error of a sum of three products, whose sizes are A, B and C. *)
Lemma sum_of_products : forall a b c A B C p q r,
  Rabs a <= A -> Rabs b <= B -> Rabs c <= C ->
  Rabs (p - a) <= u * A + least -> Rabs (q - b) <= u * B + least -> Rabs (r - c) <= u * C + least ->
  double p -> double q -> double r ->
  Rabs (rounded (rounded (p + q) + r) - (a + b + c)) <= 3.0001 * u * (A + B + C) + 4 * least.
Proof.
  intros a b c A B C p q r Ha Hb Hc Hp Hq Hr Dp Dq Dr.
  pose proof (sum_error p q Dp Dq) as S. pose proof (sum_error _ r (rounded_is_double (p + q)) Dr) as T.
  pose proof least_is_positive as L.
  set (s := rounded (p + q)) in *. set (t := rounded (s + r)) in *.
  assert (Hpq : Rabs (p + q) <= (1 + u) * (A + B) + 2 * least).
  { replace (p + q) with ((p - a) + a + (q - b) + b) by ring.
    eapply Rle_trans; [apply Rabs_triang|]. eapply Rle_trans; [apply Rplus_le_compat_r, Rabs_triang|].
    eapply Rle_trans; [apply Rplus_le_compat_r, Rplus_le_compat_r, Rabs_triang|]. lra. }
  assert (Hsr : Rabs (s + r) <= (1 + u) * ((1 + u) * (A + B) + 2 * least) + (1 + u) * C + least).
  { replace (s + r) with ((s - (p + q)) + (p + q) + (r - c) + c) by ring.
    eapply Rle_trans; [apply Rabs_triang|]. eapply Rle_trans; [apply Rplus_le_compat_r, Rabs_triang|].
    eapply Rle_trans; [apply Rplus_le_compat_r, Rplus_le_compat_r, Rabs_triang|].
    unfold u in *. lra. }
  replace (t - (a + b + c)) with ((t - (s + r)) + (s - (p + q)) + (p - a) + (q - b) + (r - c)) by ring.
  pose proof (Rabs_pos a). pose proof (Rabs_pos b). pose proof (Rabs_pos c).
  eapply Rle_trans; [apply Rabs_triang|]. eapply Rle_trans; [apply Rplus_le_compat_r, Rabs_triang|].
  eapply Rle_trans; [apply Rplus_le_compat_r, Rplus_le_compat_r, Rabs_triang|].
  eapply Rle_trans; [apply Rplus_le_compat_r, Rplus_le_compat_r, Rplus_le_compat_r, Rabs_triang|].
  unfold u in *. lra.
Qed.

Lemma product_error : forall a b, Rabs (rounded (a * b) - a * b) <= u * (Rabs a * Rabs b) + least.
Proof. intros. rewrite <- Rabs_mult. apply rounding_error. Qed.

Lemma fdot_error : forall a b, Rabs (fdot a b - dot a b) <= 3.0001 * u * (norm a * norm b) + 4 * least.
Proof.
  intros a b. unfold fdot, dot.
  eapply Rle_trans; [apply (sum_of_products (x a * x b) (y a * y b) (z a * z b)
    (Rabs (x a) * Rabs (x b)) (Rabs (y a) * Rabs (y b)) (Rabs (z a) * Rabs (z b)));
    try apply product_error; try apply rounded_is_double; rewrite Rabs_mult; apply Rle_refl|].
  apply Rplus_le_compat_r. apply Rmult_le_compat_l; [unfold u; lra|].
  rewrite <- (norm_size a), <- (norm_size b). apply (dot_at_most (size a) (size b)).
Qed.

(** Error of a computed length before its square root is rounded. *)
Lemma length_error : forall a, Rabs (sqrt (fdot a a) - norm a) <= 1.51 * u * norm a + u * tiny.
Proof.
  intros a. pose proof (fdot_error a a) as E.
  pose proof (norm_is_positive a) as N. pose proof (norm_squared a) as S. pose proof (fdot_self_is_positive a) as P.
  pose proof (sqrt_pos (fdot a a)) as Q. pose proof (sqrt_sqrt _ P) as R.
  pose proof tiny_is_positive as T. pose proof least_is_small as L.
  set (n := norm a) in *. set (q := sqrt (fdot a a)) in *. rewrite <- R, <- S in E.
  apply Rabs_le_inv in E. apply Rabs_le.
  set (t := u * tiny) in *. assert (0 < t) by (unfold t, u; lra). rewrite L in E.
  assert (0 <= n * t) by (apply Rmult_le_pos; lra). assert (0 <= n * n) by (apply Rmult_le_pos; lra).
  assert (0 <= t * t) by (apply Rmult_le_pos; lra). clearbody t. clear S R L. split.
  - destruct (Rle_or_lt ((1 - 1.51 * u) * n - t) 0) as [Z | Z]; [lra|].
    enough ((1 - 1.51 * u) * n - t <= q) by lra. apply square_at_most; auto.
    replace (((1 - 1.51 * u) * n - t) * ((1 - 1.51 * u) * n - t)) with
      ((1 - 1.51 * u) * (1 - 1.51 * u) * (n * n) - 2 * (t * ((1 - 1.51 * u) * n - t)) - t * t) by ring.
    assert (0 <= t * ((1 - 1.51 * u) * n - t)) by (apply Rmult_le_pos; lra).
    unfold u in *. lra.
  - enough (q <= (1 + 1.51 * u) * n + t) by lra. apply square_at_most; [unfold u in *; lra|].
    replace (((1 + 1.51 * u) * n + t) * ((1 + 1.51 * u) * n + t)) with
      ((1 + 1.51 * u) * (1 + 1.51 * u) * (n * n) + 2 * (1 + 1.51 * u) * (n * t) + t * t) by ring.
    unfold u in *. lra.
Qed.

Lemma fadd_error : forall a b, doubles a -> doubles b -> norm (sub (fadd a b) (add a b)) <= u * norm (add a b).
Proof.
  intros a b (A1 & A2 & A3) (B1 & B2 & B3). rewrite <- norm_scale by (unfold u; lra).
  replace (norm (scale u (add a b))) with (norm (scale u (add a b)) + 2 * 0) by ring.
  apply norm_of_coordinates; [lra| | |]; unfold fadd, fsub, add, sub, scale; cbn [x y z];
    rewrite Rabs_mult, (Rabs_pos_eq u), Rplus_0_r by (unfold u; lra);
    now apply sum_error.
Qed.

Lemma fsub_error : forall a b, doubles a -> doubles b -> norm (sub (fsub a b) (sub a b)) <= u * norm (sub a b).
Proof.
  intros a b (A1 & A2 & A3) (B1 & B2 & B3). rewrite <- norm_scale by (unfold u; lra).
  replace (norm (scale u (sub a b))) with (norm (scale u (sub a b)) + 2 * 0) by ring.
  apply norm_of_coordinates; [lra| | |]; unfold fadd, fsub, add, sub, scale; cbn [x y z];
    rewrite Rabs_mult, (Rabs_pos_eq u), Rplus_0_r by (unfold u; lra);
    now apply difference_error.
Qed.

Lemma fscale_error : forall a k, 0 <= k -> norm (sub (fscale a k) (scale k a)) <= u * (k * norm a) + 2 * least.
Proof.
  intros a k K. pose proof least_is_positive.
  rewrite <- (norm_scale k) by auto. rewrite <- norm_scale by (unfold u; lra).
  apply norm_of_coordinates; [lra| | |]; unfold fscale, sub, scale; cbn [x y z];
    rewrite (Rabs_mult u), (Rabs_pos_eq u), (Rmult_comm k) by (unfold u; lra); apply rounding_error.
Qed.

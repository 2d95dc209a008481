(** * Smallest distance of two straight segments at a common time

    Model of `closest_on_lines`, `relative` and `Segment.at` of `python/tautline/check_proof.py`, which confirms proofs
    of audits. All inputs are integers. [closest_is_least] and [closest_is_attained]: the computed fraction is the
    smallest squared distance over all real times at which both segments exist. *)

From Coq Require Import Reals Lra ZArith Lia.
Open Scope R_scope.

(** Numerators of a position. *)
Record numbers := { n_x : Z; n_y : Z; n_z : Z }.

(** `Segment`: times and positions at both ends. *)
Record segment := { from_t : Z; to_t : Z; start : numbers; stop : numbers }.

Definition dot (a b : numbers) : Z := (n_x a * n_x b + n_y a * n_y b + n_z a * n_z b)%Z.
Definition minus (a b : numbers) : numbers :=
  {| n_x := (n_x a - n_x b)%Z; n_y := (n_y a - n_y b)%Z; n_z := (n_z a - n_z b)%Z |}.
Definition times (k : Z) (a : numbers) : numbers :=
  {| n_x := (k * n_x a)%Z; n_y := (k * n_y a)%Z; n_z := (k * n_z a)%Z |}.
Definition plus (a b : numbers) : numbers :=
  {| n_x := (n_x a + n_x b)%Z; n_y := (n_y a + n_y b)%Z; n_z := (n_z a + n_z b)%Z |}.

(** Length of a segment in time, or 1 for an instant. *)
Definition length (s : segment) : Z := if (to_t s =? from_t s)%Z then 1%Z else (to_t s - from_t s)%Z.

(** `Segment.at`: numerators and denominator of the position at a time. *)
Definition position (s : segment) (t : Z) : numbers :=
  if (to_t s =? from_t s)%Z then start s
  else plus (times (to_t s - t) (start s)) (times (t - from_t s) (stop s)).

(** `relative`: numerators of the position of [b] relative to [a]. The denominator is [length a * length b]. *)
Definition relative (a b : segment) (t : Z) : numbers :=
  minus (times (length a) (position b t)) (times (length b) (position a t)).

(** Fraction of two integers. *)
Record fraction := { above : Z; below : Z }.

(** Smallest squared length between [begin] and [last] over a denominator [scale]. *)
Definition least (begin last : numbers) (scale : Z) : fraction :=
  let by_ := minus last begin in
  let rate := dot begin by_ in
  if (0 <=? rate)%Z then {| above := dot begin begin; below := (scale * scale)%Z |}
  else if (dot last by_ <=? 0)%Z then {| above := dot last last; below := (scale * scale)%Z |}
  else
    let speed := dot by_ by_ in
    {| above := (dot begin begin * speed - rate * rate)%Z; below := (speed * scale * scale)%Z |}.

(** `closest_on_lines`: smallest squared distance. *)
Definition closest (a b : segment) : fraction :=
  let from := Z.max (from_t a) (from_t b) in
  let to := Z.min (to_t a) (to_t b) in
  least (relative a b from) (relative a b to) (length a * length b).

(** ** Motion over the real numbers *)

Definition value (f : fraction) : R := IZR (above f) / IZR (below f).

(** Coordinate of a segment at a real time: the straight line between its ends. *)
Definition line (s : segment) (axis : numbers -> Z) (t : R) : R :=
  if (to_t s =? from_t s)%Z then IZR (axis (start s))
  else IZR (axis (start s)) +
    (t - IZR (from_t s)) / (IZR (to_t s) - IZR (from_t s)) * (IZR (axis (stop s)) - IZR (axis (start s))).

Definition square (r : R) : R := r * r.

Definition squared_distance (a b : segment) (t : R) : R :=
  square (line b n_x t - line a n_x t) + square (line b n_y t - line a n_y t) + square (line b n_z t - line a n_z t).

(** Squared length at a fraction of the way. *)
Definition squared_length (begin last : numbers) (scale : Z) (f : R) : R :=
  (square (IZR (n_x begin) + f * IZR (n_x last - n_x begin)) +
   square (IZR (n_y begin) + f * IZR (n_y last - n_y begin)) +
   square (IZR (n_z begin) + f * IZR (n_z last - n_z begin))) / square (IZR scale).

(** ** Minimum of the quadratic *)

Lemma squared_length_is_quadratic : forall begin last scale f,
  squared_length begin last scale f =
  (IZR (dot begin begin) + 2 * f * IZR (dot begin (minus last begin)) +
   f * f * IZR (dot (minus last begin) (minus last begin))) / square (IZR scale).
Proof.
  intros. unfold squared_length, dot, minus, square. cbn [n_x n_y n_z].
  rewrite !plus_IZR, !mult_IZR, !minus_IZR. f_equal. ring.
Qed.

Lemma last_is_quadratic : forall begin last,
  IZR (dot last last) =
    IZR (dot begin begin) + 2 * IZR (dot begin (minus last begin)) + IZR (dot (minus last begin) (minus last begin)) /\
  IZR (dot last (minus last begin)) =
    IZR (dot begin (minus last begin)) + IZR (dot (minus last begin) (minus last begin)).
Proof.
  intros. unfold dot, minus. cbn [n_x n_y n_z]. rewrite !plus_IZR, !mult_IZR, !minus_IZR. split; ring.
Qed.

Lemma dot_is_positive : forall a, 0 <= IZR (dot a a).
Proof.
  intros a. apply IZR_le. unfold dot.
  pose proof (Z.square_nonneg (n_x a)). pose proof (Z.square_nonneg (n_y a)). pose proof (Z.square_nonneg (n_z a)). lia.
Qed.

Lemma square_is_positive : forall k, (0 < k)%Z -> 0 < square (IZR k).
Proof. intros k K. apply IZR_lt in K. unfold square. now apply Rmult_lt_0_compat. Qed.

Lemma least_is_least_and_attained : forall begin last scale,
  (0 < scale)%Z ->
  (forall f, 0 <= f <= 1 -> value (least begin last scale) <= squared_length begin last scale f) /\
  exists f, 0 <= f <= 1 /\ value (least begin last scale) = squared_length begin last scale f.
Proof.
  intros begin last scale S. pose proof (square_is_positive _ S) as Q. unfold square in Q.
  destruct (last_is_quadratic begin last) as [L1 L2].
  pose proof (dot_is_positive (minus last begin)) as V.
  unfold least, value. cbv zeta.
  set (a := dot begin begin) in *. set (r := dot begin (minus last begin)) in *.
  set (v := dot (minus last begin) (minus last begin)) in *.
  assert (Q' : forall x y, x <= y -> x / (IZR scale * IZR scale) <= y / (IZR scale * IZR scale)).
  { intros x y H. apply Rmult_le_compat_r; auto. left. now apply Rinv_0_lt_compat. }
  destruct (Z.leb_spec 0 r) as [R0 | R0]; [|destruct (Z.leb_spec (dot last (minus last begin)) 0) as [E | E]];
    cbn [above below].
  - apply IZR_le in R0. rewrite mult_IZR. split.
    + intros f F. rewrite squared_length_is_quadratic. fold a r v. apply Q'. nra.
    + exists 0. split; [lra|]. rewrite squared_length_is_quadratic. fold a r v. unfold square. f_equal. ring.
  - apply IZR_le in E. apply IZR_lt in R0. rewrite mult_IZR. split.
    + intros f F. rewrite squared_length_is_quadratic. fold a r v. apply Q'. rewrite L1.
      assert (0 <= (1 - f) * - (IZR r + IZR v)) by (apply Rmult_le_pos; lra).
      assert (0 <= (1 - f) * ((1 - f) * IZR v)) by (apply Rmult_le_pos; [lra|apply Rmult_le_pos; lra]). nra.
    + exists 1. split; [lra|]. rewrite squared_length_is_quadratic. fold a r v. unfold square. f_equal. rewrite L1.
      ring.
  - apply IZR_lt in R0, E. rewrite L2 in E. assert (P : 0 < IZR v) by lra.
    rewrite minus_IZR, !mult_IZR. split.
    + intros f F. rewrite squared_length_is_quadratic. fold a r v.
      replace ((IZR a * IZR v - IZR r * IZR r) / (IZR v * IZR scale * IZR scale))
        with ((IZR a - IZR r * IZR r / IZR v) / (IZR scale * IZR scale))
        by (field; split; [|lra]; intros Z; rewrite Z in Q; lra).
      apply Q'.
      assert (0 <= (IZR r + f * IZR v) * (IZR r + f * IZR v) / IZR v).
      { apply Rmult_le_pos; [apply Rle_0_sqr | left; now apply Rinv_0_lt_compat]. }
      replace ((IZR r + f * IZR v) * (IZR r + f * IZR v) / IZR v)
        with (IZR r * IZR r / IZR v + 2 * f * IZR r + f * f * IZR v) in H by (field; lra). lra.
    + exists (- IZR r / IZR v). split.
      * split.
        -- apply Rmult_le_pos; [lra | left; now apply Rinv_0_lt_compat].
        -- apply Rmult_le_reg_r with (IZR v); auto. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. lra.
      * rewrite squared_length_is_quadratic. fold a r v. unfold square. field.
        split; [lra|]. intros Z. rewrite Z in Q. lra.
Qed.

(** ** Two segments *)

Lemma length_is_positive : forall s, (from_t s <= to_t s)%Z -> (0 < length s)%Z.
Proof. intros s H. unfold length. destruct (Z.eqb_spec (to_t s) (from_t s)); lia. Qed.

(** A coordinate of the numerators is the coordinate of the line times the denominator. *)
Lemma position_is_on_the_line : forall s t axis,
  (axis = n_x \/ axis = n_y \/ axis = n_z) -> (from_t s <= to_t s)%Z ->
  IZR (axis (position s t)) = IZR (length s) * line s axis (IZR t).
Proof.
  intros s t axis A H. unfold position, length, line. destruct (Z.eqb_spec (to_t s) (from_t s)) as [E | E].
  - ring.
  - assert (0 < IZR (to_t s) - IZR (from_t s)) by (rewrite <- minus_IZR; apply IZR_lt; lia).
    rewrite minus_IZR.
    destruct A as [-> | [-> | ->]]; cbn [plus times n_x n_y n_z]; rewrite plus_IZR, !mult_IZR, !minus_IZR; field; lra.
Qed.

Lemma relative_is_on_the_lines : forall a b t axis,
  (axis = n_x \/ axis = n_y \/ axis = n_z) -> (from_t a <= to_t a)%Z -> (from_t b <= to_t b)%Z ->
  IZR (axis (relative a b t)) = IZR (length a * length b) * (line b axis (IZR t) - line a axis (IZR t)).
Proof.
  intros a b t axis A Ha Hb. pose proof (position_is_on_the_line a t axis A Ha) as P.
  pose proof (position_is_on_the_line b t axis A Hb) as Q. rewrite mult_IZR.
  destruct A as [-> | [-> | ->]]; unfold relative; cbn [minus times n_x n_y n_z];
    rewrite minus_IZR, !mult_IZR, P, Q; ring.
Qed.

(** A line at a part of the way between two times. *)
Lemma line_is_straight : forall s axis u w f,
  line s axis (u + f * (w - u)) = line s axis u + f * (line s axis w - line s axis u).
Proof. intros. unfold line. destruct (_ =? _)%Z; [ring|]. unfold Rdiv. ring. Qed.

Lemma squared_distance_is_squared_length : forall a b f,
  (from_t a <= to_t a)%Z -> (from_t b <= to_t b)%Z ->
  let from := Z.max (from_t a) (from_t b) in
  let to := Z.min (to_t a) (to_t b) in
  squared_distance a b (IZR from + f * (IZR to - IZR from)) =
  squared_length (relative a b from) (relative a b to) (length a * length b) f.
Proof.
  intros a b f Ha Hb from to. unfold squared_distance, squared_length.
  assert (L : 0 < IZR (length a * length b)).
  { apply IZR_lt. apply Z.mul_pos_pos; now apply length_is_positive. }
  rewrite !minus_IZR, !line_is_straight.
  rewrite !relative_is_on_the_lines by auto. set (k := IZR (length a * length b)) in *.
  unfold square. field. lra.
Qed.

(** At each time at which both segments exist, their squared distance is at least the computed fraction. *)
Theorem closest_is_least : forall a b t,
  (from_t a <= to_t a)%Z -> (from_t b <= to_t b)%Z ->
  IZR (from_t a) <= t <= IZR (to_t a) -> IZR (from_t b) <= t <= IZR (to_t b) ->
  value (closest a b) <= squared_distance a b t.
Proof.
  intros a b t Ha Hb Ta Tb. unfold closest. cbv zeta.
  set (from := Z.max (from_t a) (from_t b)). set (to := Z.min (to_t a) (to_t b)).
  assert (F : IZR from <= t) by (unfold from; destruct (Z.max_spec (from_t a) (from_t b)) as [[_ ->] | [_ ->]]; lra).
  assert (T : t <= IZR to) by (unfold to; destruct (Z.min_spec (to_t a) (to_t b)) as [[_ ->] | [_ ->]]; lra).
  assert (S : (0 < length a * length b)%Z) by (apply Z.mul_pos_pos; now apply length_is_positive).
  destruct (least_is_least_and_attained (relative a b from) (relative a b to) _ S) as [Least _].
  assert (W : exists f, 0 <= f <= 1 /\ t = IZR from + f * (IZR to - IZR from)).
  { destruct (Rle_lt_or_eq_dec (IZR from) (IZR to)) as [L | E]; [lra| |].
    - exists ((t - IZR from) / (IZR to - IZR from)). repeat split.
      + apply Rmult_le_pos; [lra | left; apply Rinv_0_lt_compat; lra].
      + apply Rmult_le_reg_r with (IZR to - IZR from); [lra|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. lra.
      + field. lra.
    - exists 0. lra. }
  destruct W as (f & Hf & ->). specialize (Least f Hf).
  pose proof (squared_distance_is_squared_length a b f Ha Hb) as D. cbv zeta in D. fold from to in D.
  rewrite D. exact Least.
Qed.

(** The computed fraction is the squared distance at such a time. *)
Theorem closest_is_attained : forall a b,
  (from_t a <= to_t a)%Z -> (from_t b <= to_t b)%Z ->
  (Z.max (from_t a) (from_t b) <= Z.min (to_t a) (to_t b))%Z ->
  exists t,
    IZR (from_t a) <= t <= IZR (to_t a) /\ IZR (from_t b) <= t <= IZR (to_t b) /\
    value (closest a b) = squared_distance a b t.
Proof.
  intros a b Ha Hb C. unfold closest. cbv zeta.
  set (from := Z.max (from_t a) (from_t b)) in *. set (to := Z.min (to_t a) (to_t b)) in *.
  assert (S : (0 < length a * length b)%Z) by (apply Z.mul_pos_pos; now apply length_is_positive).
  destruct (least_is_least_and_attained (relative a b from) (relative a b to) _ S) as [_ (f & F & E)].
  exists (IZR from + f * (IZR to - IZR from)).
  assert (B : (from_t a <= from /\ from_t b <= from /\ to <= to_t a /\ to <= to_t b)%Z) by (unfold from, to; lia).
  destruct B as (B1 & B2 & B3 & B4). apply IZR_le in B1, B2, B3, B4, C.
  assert (0 <= f * (IZR to - IZR from)) by (apply Rmult_le_pos; lra).
  assert (f * (IZR to - IZR from) <= 1 * (IZR to - IZR from)) by (apply Rmult_le_compat_r; lra).
  repeat split; try lra.
  pose proof (squared_distance_is_squared_length a b f Ha Hb) as D. cbv zeta in D. fold from to in D.
  rewrite D. exact E.
Qed.

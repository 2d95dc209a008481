(** * Rounding of the grid of the tube

    `exponential` of `crates/shield/src/tube.rs` and the powers of its result on the grid, with the bounds of the rows
    "Cell" and "Grid" of its documentation. [cell_error]: the computed exponential of a cell errs by less than 45 u.
    [grid_step_error]: a step of the grid errs by at most [GRID_STEP] u. [grid_error]: the bound of all points.

    Products may add their terms in any order, fused or not ([sum_of]). *)

From Coq Require Import Reals Lra ZArith Lia.
From Flocq Require Import Core.
From Proofs Require Import doubles constants resolution.
Open Scope R_scope.

(** ** Finite sums *)

Fixpoint sum (n : nat) (f : nat -> R) : R :=
  match n with O => 0 | S m => sum m f + f m end.

Lemma sum_at_most : forall n f g, (forall k, (k < n)%nat -> f k <= g k) -> sum n f <= sum n g.
Proof.
  induction n as [|n IH]; intros f g H; cbn; [lra|].
  apply Rplus_le_compat; [apply IH; intros; apply H; lia | apply H; lia].
Qed.

Lemma sum_equal : forall n f g, (forall k, (k < n)%nat -> f k = g k) -> sum n f = sum n g.
Proof.
  induction n as [|n IH]; intros f g H; cbn; [reflexivity|].
  f_equal; [apply IH; intros; apply H; lia | apply H; lia].
Qed.

Lemma sum_plus : forall n f g, sum n (fun k => f k + g k) = sum n f + sum n g.
Proof. induction n as [|n IH]; intros; cbn; [lra|]. rewrite IH. lra. Qed.

Lemma sum_times : forall n c f, sum n (fun k => c * f k) = c * sum n f.
Proof. induction n as [|n IH]; intros; cbn; [lra|]. rewrite IH. lra. Qed.

Lemma sum_absolute : forall n f, Rabs (sum n f) <= sum n (fun k => Rabs (f k)).
Proof.
  induction n as [|n IH]; intros; cbn; [rewrite Rabs_R0; lra|].
  eapply Rle_trans; [apply Rabs_triang|]. apply Rplus_le_compat_r, IH.
Qed.

Lemma sum_zero : forall n, sum n (fun _ => 0) = 0.
Proof. induction n as [|n IH]; cbn; [reflexivity|]. rewrite IH. lra. Qed.

Lemma sum_constant : forall n c, sum n (fun _ => c) = INR n * c.
Proof. induction n as [|n IH]; intros; [cbn; lra|]. rewrite S_INR. cbn [sum]. rewrite IH. lra. Qed.

Lemma sum_exchange : forall n m f, sum n (fun i => sum m (fun j => f i j)) = sum m (fun j => sum n (fun i => f i j)).
Proof.
  induction n as [|n IH]; intros; cbn.
  - now rewrite sum_zero.
  - rewrite IH. now rewrite <- sum_plus.
Qed.

(** ** Matrices *)

Definition matrix : Type := nat -> nat -> R.

Section Matrices.

(** Number of rows and columns. *)
Variable n : nat.

Definition plus (a b : matrix) : matrix := fun i j => a i j + b i j.
Definition minus (a b : matrix) : matrix := fun i j => a i j - b i j.
Definition over (k : R) (a : matrix) : matrix := fun i j => a i j / k.
Definition product (a b : matrix) : matrix := fun i j => sum n (fun k => a i k * b k j).
Definition identity : matrix := fun i j => if Nat.eq_dec i j then 1 else 0.

(** The largest row sum of absolute values is at most a number. *)
Definition at_most (a : matrix) (c : R) : Prop := forall i, (i < n)%nat -> sum n (fun j => Rabs (a i j)) <= c.

Lemma at_most_more : forall a c d, at_most a c -> c <= d -> at_most a d.
Proof. intros a c d H L i I. pose proof (H i I). lra. Qed.

Lemma at_most_equal : forall a b c, (forall i j, a i j = b i j) -> at_most a c -> at_most b c.
Proof.
  intros a b c E H i I. rewrite (sum_equal n _ (fun j => Rabs (a i j))); [now apply H|]. intros. now rewrite E.
Qed.

Lemma plus_at_most : forall a b c d, at_most a c -> at_most b d -> at_most (plus a b) (c + d).
Proof.
  intros a b c d A B i I. eapply Rle_trans; [apply sum_at_most; intros; apply Rabs_triang|].
  rewrite sum_plus. pose proof (A i I). pose proof (B i I). lra.
Qed.

Lemma minus_at_most : forall a b c d, at_most a c -> at_most b d -> at_most (minus a b) (c + d).
Proof.
  intros a b c d A B i I. eapply Rle_trans.
  - apply (sum_at_most n _ (fun j => Rabs (a i j) + Rabs (b i j))). intros. unfold minus, Rminus.
    eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_Ropp. lra.
  - rewrite sum_plus. pose proof (A i I). pose proof (B i I). lra.
Qed.

Lemma over_at_most : forall a c k, 0 < k -> at_most a c -> at_most (over k a) (c / k).
Proof.
  intros a c k K A i I. rewrite (sum_equal n _ (fun j => / k * Rabs (a i j))).
  - rewrite sum_times. unfold Rdiv. rewrite Rmult_comm. apply Rmult_le_compat_r; [|now apply A].
    left. now apply Rinv_0_lt_compat.
  - intros. unfold over, Rdiv. rewrite Rabs_mult, (Rabs_pos_eq (/ k)); [ring|]. left. now apply Rinv_0_lt_compat.
Qed.

Lemma row_is_positive : forall (a : matrix) i, 0 <= sum n (fun j => Rabs (a i j)).
Proof. intros. rewrite <- (sum_zero n). apply sum_at_most. intros. apply Rabs_pos. Qed.

(** Sums of products of sizes. *)
Lemma sizes_at_most : forall a b c d i, at_most a c -> at_most b d -> 0 <= d -> (i < n)%nat ->
  sum n (fun j => sum n (fun k => Rabs (a i k) * Rabs (b k j))) <= c * d.
Proof.
  intros a b c d i A B D I. rewrite sum_exchange.
  apply Rle_trans with (sum n (fun k => d * Rabs (a i k))).
  - apply sum_at_most. intros k K. rewrite sum_times, Rmult_comm. apply Rmult_le_compat_r; [apply Rabs_pos|].
    now apply B.
  - rewrite sum_times, Rmult_comm. apply Rmult_le_compat_r; auto.
Qed.

Lemma product_at_most : forall a b c d, at_most a c -> at_most b d -> 0 <= d -> at_most (product a b) (c * d).
Proof.
  intros a b c d A B D i I. eapply Rle_trans; [|apply (sizes_at_most a b c d i A B D I)].
  apply sum_at_most. intros j J. unfold product. eapply Rle_trans; [apply sum_absolute|].
  right. apply sum_equal. intros. apply Rabs_mult.
Qed.

Lemma identity_at_most : at_most identity 1.
Proof.
  intros i I. unfold identity.
  assert (G : forall m, (i < m)%nat -> sum m (fun j => Rabs (if Nat.eq_dec i j then 1 else 0)) = 1).
  { assert (Z : forall m, (m <= i)%nat -> sum m (fun j => Rabs (if Nat.eq_dec i j then 1 else 0)) = 0).
    { induction m as [|m IH]; intros M; cbn; [reflexivity|]. rewrite IH by lia.
      destruct (Nat.eq_dec i m); [lia|]. rewrite Rabs_R0. lra. }
    induction m as [|m IH]; intros M; [lia|]. cbn. destruct (Nat.eq_dec i m) as [-> | N].
    - rewrite Z by lia. rewrite Rabs_R1. lra.
    - rewrite IH by lia. rewrite Rabs_R0. lra. }
  rewrite G; [lra|auto].
Qed.

(** ** Rounded products *)

(** A sum of products a k * b k over some k, with its number of roundings. *)
Inductive sum_of (a b : nat -> R) : nat -> R -> R -> R -> Prop :=
  (** Product of two numbers: exact value, its size, and the computed value. *)
  | single : forall k, sum_of a b 1 (a k * b k) (Rabs (a k) * Rabs (b k)) (rounded (a k * b k))
  (** Product and sum in one operation. *)
  | fused : forall k m e s c, sum_of a b m e s c ->
      sum_of a b (S m) (a k * b k + e) (Rabs (a k) * Rabs (b k) + s) (rounded (a k * b k + c))
  (** Sum of two sums. *)
  | added : forall m m' e e' s s' c c', sum_of a b m e s c -> sum_of a b m' e' s' c' ->
      sum_of a b (m + m') (e + e') (s + s') (rounded (c + c')).

Lemma sum_of_is_double : forall a b m e s c, sum_of a b m e s c -> double c.
Proof. intros a b m e s c H. destruct H; apply rounded_is_double. Qed.

Lemma sum_of_has_terms : forall a b m e s c, sum_of a b m e s c -> (1 <= m)%nat /\ Rabs e <= s.
Proof.
  intros a b m e s c H.
  induction H as [k | k m e s c H [M E] | m m' e e' s s' c c' H [M E] H' [M' E']]; (split; [lia|]).
  - rewrite Rabs_mult. lra.
  - eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_mult. lra.
  - eapply Rle_trans; [apply Rabs_triang|]. lra.
Qed.

(** Sums of m products err by at most 1.01 m u of the sizes, for m up to 100. *)
Lemma sum_of_error : forall a b m e s c, sum_of a b m e s c -> (m <= 100)%nat ->
  Rabs (c - e) <= 1.01 * INR m * u * s + (3 * INR m - 2) * least.
Proof.
  intros a b m e s c H. pose proof least_is_positive as PL.
  assert (Step : forall x y K L, 1 <= K <= 100 -> Rabs y <= L -> 0 <= L ->
    Rabs (x - y) <= 1.01 * (K - 1) * u * L + (3 * (K - 1) - 2) * least ->
    u * Rabs x <= 1.01 * u * L + least).
  { intros x y K L RK Y PL' D. assert (Rabs x <= Rabs y + Rabs (x - y)).
    { replace x with (y + (x - y)) at 1 by ring. apply Rabs_triang. }
    assert (K * (u * L) <= 100 * (u * L)) by (apply Rmult_le_compat_r; [apply Rmult_le_pos; [unfold u|]; lra|lra]).
    assert (K * least <= 100 * least) by (apply Rmult_le_compat_r; lra). unfold u in *. lra. }
  induction H as [k | k m e s c H IH | m m' e e' s s' c c' H IH H' IH']; intros M.
  - pose proof (rounding_error (a k * b k)) as E. rewrite Rabs_mult in E.
    pose proof (Rabs_pos (a k)). pose proof (Rabs_pos (b k)).
    assert (0 <= Rabs (a k) * Rabs (b k)) by (now apply Rmult_le_pos). cbn [INR]. unfold u in *. lra.
  - specialize (IH ltac:(lia)). destruct (sum_of_has_terms _ _ _ _ _ _ H) as [M1 Es].
    pose proof (rounding_error (a k * b k + c)) as E.
    assert (Ps : 0 <= s) by (pose proof (Rabs_pos e); lra).
    assert (Pk : 0 <= Rabs (a k) * Rabs (b k)) by (apply Rmult_le_pos; apply Rabs_pos).
    assert (RM : 1 <= INR m + 1 <= 100).
    { rewrite <- S_INR. split; [pose proof (le_INR 1 (S m) ltac:(lia)) as Q; exact Q|].
      replace 100 with (INR 100) by (cbn; lra). now apply le_INR. }
    pose proof (pos_INR m) as PM.
    assert (D : Rabs (a k * b k + c - (a k * b k + e)) <= 1.01 * INR m * u * s + (3 * INR m - 2) * least).
    { replace (a k * b k + c - (a k * b k + e)) with (c - e) by ring. exact IH. }
    assert (Q : u * Rabs (a k * b k + c) <= 1.01 * u * (Rabs (a k) * Rabs (b k) + s) + least).
    { apply (Step _ (a k * b k + e) (INR m + 1)); auto; try lra.
      - eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_mult. lra.
      - replace (INR m + 1 - 1) with (INR m) by ring. eapply Rle_trans; [exact D|].
        assert (0 <= INR m * (u * (Rabs (a k) * Rabs (b k)))).
        { apply Rmult_le_pos; auto. apply Rmult_le_pos; auto. unfold u. lra. } lra. }
    rewrite S_INR. replace (rounded (a k * b k + c) - (a k * b k + e)) with
      ((rounded (a k * b k + c) - (a k * b k + c)) + (a k * b k + c - (a k * b k + e))) by ring.
    eapply Rle_trans; [apply Rabs_triang|].
    assert (0 <= INR m * (u * (Rabs (a k) * Rabs (b k)))).
    { apply Rmult_le_pos; auto. apply Rmult_le_pos; auto. unfold u. lra. } lra.
  - specialize (IH ltac:(lia)). specialize (IH' ltac:(lia)).
    destruct (sum_of_has_terms _ _ _ _ _ _ H) as [M1 Es]. destruct (sum_of_has_terms _ _ _ _ _ _ H') as [M1' Es'].
    pose proof (rounding_error (c + c')) as E.
    assert (Ps : 0 <= s) by (pose proof (Rabs_pos e); lra). assert (Ps' : 0 <= s') by (pose proof (Rabs_pos e'); lra).
    pose proof (le_INR 1 m M1) as N1. pose proof (le_INR 1 m' M1') as N1'. cbn [INR] in N1, N1'.
    assert (RM : INR m + INR m' <= 100).
    { rewrite <- plus_INR. replace 100 with (INR 100) by (cbn; lra). now apply le_INR. }
    assert (US : 0 <= u * s) by (apply Rmult_le_pos; [unfold u|]; lra).
    assert (US' : 0 <= u * s') by (apply Rmult_le_pos; [unfold u|]; lra).
    assert (X1 : (INR m + INR m' - 1 - INR m) * (u * s) >= 0) by (apply Rle_ge, Rmult_le_pos; lra).
    assert (X2 : (INR m + INR m' - 1 - INR m') * (u * s') >= 0) by (apply Rle_ge, Rmult_le_pos; lra).
    assert (D : Rabs (c + c' - (e + e')) <= 1.01 * INR m * u * s + (3 * INR m - 2) * least +
      (1.01 * INR m' * u * s' + (3 * INR m' - 2) * least)).
    { replace (c + c' - (e + e')) with ((c - e) + (c' - e')) by ring.
      eapply Rle_trans; [apply Rabs_triang|]. lra. }
    (* The sum is a little larger than the bound for all terms but one, so its last rounding is counted apart. *)
    assert (Big : Rabs (c + c') <= 1.000001 * (s + s') + 3 * 100 * least).
    { replace (c + c') with ((e + e') + (c + c' - (e + e'))) by ring.
      eapply Rle_trans; [apply Rabs_triang|].
      pose proof (Rabs_triang e e').
      assert (INR m * (u * s) <= 100 * (u * s)) by (apply Rmult_le_compat_r; lra).
      assert (INR m' * (u * s') <= 100 * (u * s')) by (apply Rmult_le_compat_r; lra).
      assert ((INR m + INR m') * least <= 100 * least) by (apply Rmult_le_compat_r; lra).
      unfold u in *. lra. }
    rewrite plus_INR. replace (rounded (c + c') - (e + e')) with
      ((rounded (c + c') - (c + c')) + (c + c' - (e + e'))) by ring.
    eapply Rle_trans; [apply Rabs_triang|].
    assert (S1 : rounded (c + c') - (c + c') = rounded (c + c') - (c + c')) by reflexivity.
    pose proof (sum_error c c' (sum_of_is_double _ _ _ _ _ _ H) (sum_of_is_double _ _ _ _ _ _ H')) as SE.
    assert (U1 : u * Rabs (c + c') <= u * (1.000001 * (s + s') + 3 * 100 * least)) by
      (apply Rmult_le_compat_l; [unfold u|]; lra).
    assert (Y1 : 1 * (u * s) <= INR m' * (u * s)) by (apply Rmult_le_compat_r; lra).
    assert (Y2 : 1 * (u * s') <= INR m * (u * s')) by (apply Rmult_le_compat_r; lra).
    unfold u in *. lra.
Qed.

(** Each entry of [p] is a computed sum of at most [m] products. *)
Definition is_computed_product (m : nat) (a b p : matrix) : Prop :=
  forall i j, (i < n)%nat -> (j < n)%nat -> exists m', (m' <= m)%nat /\
    sum_of (a i) (fun k => b k j) m' (product a b i j) (sum n (fun k => Rabs (a i k) * Rabs (b k j))) (p i j).

(** Products of m terms err by at most 1.01 m u times the product of the norms. *)
Lemma product_error : forall m a b p c d,
  (m <= 100)%nat -> is_computed_product m a b p -> at_most a c -> at_most b d -> 0 <= d ->
  at_most (minus p (product a b)) (1.01 * INR m * u * (c * d) + INR n * (3 * INR m * least)).
Proof.
  intros m a b p c d M P A B D i I. pose proof least_is_positive as PL.
  apply Rle_trans with
    (sum n (fun j => 1.01 * INR m * u * sum n (fun k => Rabs (a i k) * Rabs (b k j)) + 3 * INR m * least)).
  - apply sum_at_most. intros j J. destruct (P i j I J) as (m' & M' & H).
    eapply Rle_trans; [apply (sum_of_error _ _ _ _ _ _ H); lia|].
    pose proof (le_INR _ _ M') as L. destruct (sum_of_has_terms _ _ _ _ _ _ H) as [_ E].
    set (s := sum n (fun k => Rabs (a i k) * Rabs (b k j))) in *.
    assert (0 <= s) by (pose proof (Rabs_pos (product a b i j)); lra).
    assert (INR m' * (u * s) <= INR m * (u * s))
      by (apply Rmult_le_compat_r; [apply Rmult_le_pos; [unfold u|]; lra|lra]).
    assert (INR m' * least <= INR m * least) by (apply Rmult_le_compat_r; lra). lra.
  - rewrite sum_plus, sum_times, sum_constant. apply Rplus_le_compat_r.
    apply Rmult_le_compat_l; [|now apply sizes_at_most].
    pose proof (pos_INR m). apply Rmult_le_pos; [lra|unfold u; lra].
Qed.

End Matrices.

(** ** Exponential of a cell *)

Lemma least_below_unit : least <= u / 10 ^ 6.
Proof.
  pose proof least_below_tiny as L. pose proof tiny_is_small as T. pose proof least_is_positive.
  assert (tiny <= / 10 ^ 6) by lra. assert (u * tiny <= u * / 10 ^ 6) by (apply Rmult_le_compat_l; [unfold u|]; lra).
  unfold u in *. lra.
Qed.

(** States of the loop. *)
Definition states : nat := 5.

Lemma states_of_the_code : STATES = INR states /\ TERMS = INR 20 /\ CELL_RATE = / 2.
Proof. unfold STATES, TERMS, CELL_RATE, states. cbn [INR]. repeat split; lra. Qed.

Section Cell.

Notation at_most := (at_most states).
Notation product := (product states).

(** Exact matrix X, and the computed one with an error of 3.1 u |X|: length of a cell, rate of the lag, product. *)
Variables X X' : matrix.
Hypothesis X_is_small : at_most X CELL_RATE.
Hypothesis X_is_close : at_most (minus X' X) (3.1 * u * CELL_RATE).

(** The divisor of a term. *)
Definition divisor (k : nat) : R := IZR (Z.of_nat (S k)).

(** Exact terms and sums of the series. *)
Fixpoint term (k : nat) : matrix :=
  match k with O => identity | S m => over (divisor m) (product (term m) X) end.
Fixpoint series (k : nat) : matrix :=
  match k with O => identity | S m => plus (series m) (term (S m)) end.

(** Computed terms and sums: `term = term * matrix / f64::from(k); sum += term`. *)
Variables products terms sums : nat -> matrix.
Hypothesis first_term : forall i j, terms 0%nat i j = identity i j.
Hypothesis next_product : forall k, is_computed_product states states (terms k) X' (products k).
Hypothesis next_term : forall k i j, terms (S k) i j = rounded (products k i j / divisor k).
Hypothesis first_sum : forall i j, sums 0%nat i j = identity i j.
Hypothesis next_sum : forall k i j, sums (S k) i j = rounded (sums k i j + terms (S k) i j).

(** Bounds of the terms and of their sums. *)
Fixpoint term_size (k : nat) : R :=
  match k with O => 1 | S m => term_size m * / IZR (2 * Z.of_nat (S m)) end.
Fixpoint series_size (k : nat) : R :=
  match k with O => 1 | S m => series_size m + term_size (S m) end.

Lemma divisor_is_positive : forall k, 1 <= divisor k.
Proof. intros. unfold divisor. apply (IZR_le 1). lia. Qed.

Lemma divisor_is_next : forall k, divisor k = INR k + 1.
Proof. intros. unfold divisor. rewrite <- INR_IZR_INZ. apply S_INR. Qed.

Lemma term_size_next : forall k, term_size (S k) = term_size k * / divisor k / 2.
Proof.
  intros. cbn [term_size]. unfold divisor. rewrite mult_IZR. pose proof (divisor_is_positive k) as D.
  unfold divisor in D. field. lra.
Qed.

Lemma term_size_is_positive : forall k, 0 < term_size k.
Proof.
  induction k as [|k IH]; [cbn; lra|]. rewrite term_size_next. pose proof (divisor_is_positive k).
  assert (0 < / divisor k) by (apply Rinv_0_lt_compat; lra).
  assert (0 < term_size k * / divisor k) by (now apply Rmult_lt_0_compat). lra.
Qed.

Lemma term_size_halves : forall k, term_size (S k) <= term_size k / 2.
Proof.
  intros. rewrite term_size_next. pose proof (divisor_is_positive k). pose proof (term_size_is_positive k).
  assert (/ divisor k <= / 1) by (apply Rinv_le; lra). rewrite Rinv_1 in H1.
  assert (term_size k * / divisor k <= term_size k * 1) by (apply Rmult_le_compat_l; lra). lra.
Qed.

Lemma series_size_falls : forall m k, (m <= k)%nat -> series_size k + term_size k <= series_size m + term_size m.
Proof.
  intros m k H. induction H as [|k H IH]; [lra|]. cbn [series_size]. pose proof (term_size_halves k). lra.
Qed.

Lemma series_size_grows : forall m k, (m <= k)%nat -> series_size m <= series_size k.
Proof.
  intros m k H. induction H as [|k H IH]; [lra|]. cbn [series_size]. pose proof (term_size_is_positive (S k)). lra.
Qed.

Lemma series_size_at_most : forall k, series_size k <= 1.652.
Proof.
  intros k. assert (F : series_size 4 + term_size 4 <= 1.652) by (cbn; lra).
  destruct (Nat.le_gt_cases k 4) as [L | L].
  - pose proof (series_size_grows k 4 L). pose proof (term_size_is_positive 4). lra.
  - pose proof (series_size_falls 4 k ltac:(lia)). pose proof (term_size_is_positive k). lra.
Qed.

Lemma term_size_at_end : term_size 20 <= / 10 ^ 24.
Proof. cbn. lra. Qed.

(** Unit of the errors of underflow. *)
Let q : R := 1000 * least.

Lemma q_is_tiny : 0 < q /\ q <= u / 10 ^ 6.
Proof.
  pose proof least_is_positive as P. pose proof tiny_is_small as T. unfold q. split; [lra|].
  pose proof least_is_small as L. pose proof tiny_is_positive.
  assert (tiny <= / 10 ^ 3) by lra.
  assert (tiny * tiny <= / 10 ^ 3 * / 10 ^ 3) by (apply Rmult_le_compat; lra).
  replace (u * tiny * (u * tiny)) with (u * u * (tiny * tiny)) in L by ring. unfold u in *. lra.
Qed.

Lemma term_errors : forall k, (k <= 20)%nat ->
  at_most (term k) (term_size k) /\
  at_most (minus (terms k) (term k)) (10 * INR k * u * term_size k + INR k * q).
Proof.
  destruct q_is_tiny as [Pq Lq].
  induction k as [|k IH]; intros K.
  - split; [apply identity_at_most|]. intros i I. cbn [INR term].
    rewrite (sum_equal states _ (fun _ => 0)); [rewrite sum_zero; lra|].
    intros. unfold minus. rewrite first_term. rewrite Rminus_eq_0. apply Rabs_R0.
  - destruct (IH ltac:(lia)) as [B E]. pose proof (divisor_is_positive k) as D.
  pose proof (term_size_is_positive k) as P.
    pose proof least_is_positive as PL. pose proof (term_size_next k) as N. pose proof (divisor_is_next k) as DN.
    set (a := term_size k) in *. set (e := 10 * INR k * u * a + INR k * q) in *.
    assert (Half : CELL_RATE = / 2) by (unfold CELL_RATE; lra).
    pose proof X_is_small as XS. pose proof X_is_close as XC. rewrite Half in XS, XC.
    split.
    + rewrite N. cbn [term]. apply at_most_more with (a * / 2 / divisor k); [|unfold Rdiv; lra].
      apply over_at_most; [lra|]. apply product_at_most; auto. lra.
    + assert (RK : 0 <= INR k <= 20).
      { split; [apply pos_INR|]. replace 20 with (INR 20) by (cbn; lra). apply le_INR. lia. }
      set (h := a + e).
      assert (Bh : at_most (terms k) h).
      { apply at_most_equal with (plus (term k) (minus (terms k) (term k))).
        - intros. unfold plus, minus. ring.
        - now apply plus_at_most. }
      set (x' := / 2 + 3.1 * u * / 2).
      assert (Bx : at_most X' x').
      { apply at_most_equal with (plus X (minus X' X)).
        - intros. unfold plus, minus. ring.
        - now apply plus_at_most. }
      assert (Px : 0 <= x') by (unfold x', u; lra).
      pose proof (product_error states states (terms k) X' (products k) h x' ltac:(unfold states; lia) (next_product k)
        Bh Bx Px)
        as Ep.
      set (ep := 1.01 * INR states * u * (h * x') + INR states * (3 * INR states * least)) in *.
      pose proof (product_at_most states (terms k) X' h x' Bh Bx Px) as Bp.
      assert (Bq : at_most (products k) (h * x' + ep)).
      { apply at_most_equal with (plus (product (terms k) X') (minus (products k) (product (terms k) X'))).
        - intros. unfold plus, minus. ring.
        - now apply plus_at_most. }
      (* Rounding of the division. *)
      assert (Ed : at_most (minus (terms (S k)) (over (divisor k) (products k)))
        (u * ((h * x' + ep) / divisor k) + INR states * least)).
      { intros i I. pose proof (over_at_most states (products k) _ (divisor k) ltac:(lra) Bq i I) as O.
        apply Rle_trans with (sum states (fun j => u * Rabs (over (divisor k) (products k) i j) + least)).
        - apply sum_at_most. intros j J. unfold minus, over. rewrite next_term. apply rounding_error.
        - rewrite sum_plus, sum_times, sum_constant. apply Rplus_le_compat_r.
        apply Rmult_le_compat_l; [unfold u; lra|auto]. }
      pose proof (over_at_most states _ _ (divisor k) ltac:(lra) Ep) as F1.
      pose proof (over_at_most states _ _ (divisor k) ltac:(lra)
        (product_at_most states (terms k) (minus X' X) h _ Bh XC ltac:(unfold u; lra))) as F2.
      pose proof (over_at_most states _ _ (divisor k) ltac:(lra)
        (product_at_most states (minus (terms k) (term k)) X e _ E XS ltac:(lra))) as F3.
      pose proof (plus_at_most states _ _ _ _ F1 (plus_at_most states _ _ _ _ F2 F3)) as F123.
      pose proof (plus_at_most states _ _ _ _ Ed F123) as G.
      eapply at_most_more; [eapply at_most_equal; [|exact G]|].
      * intros i j. unfold plus, minus, over. cbn [term]. unfold over, Rdiv. unfold tube.product.
        assert (L1 : sum states (fun c => terms k i c * (X' c j - X c j)) =
          sum states (fun c => terms k i c * X' c j) - sum states (fun c => terms k i c * X c j)).
        { rewrite <- (Rmult_1_l (sum states (fun c => terms k i c * X c j))).
          replace (sum states (fun c => terms k i c * X' c j) - 1 * sum states (fun c => terms k i c * X c j)) with
            (sum states (fun c => terms k i c * X' c j) + -1 * sum states (fun c => terms k i c * X c j)) by ring.
          rewrite <- sum_times, <- sum_plus. apply sum_equal. intros. ring. }
        assert (L2 : sum states (fun c => (terms k i c - term k i c) * X c j) =
          sum states (fun c => terms k i c * X c j) - sum states (fun c => term k i c * X c j)).
        { replace (sum states (fun c => terms k i c * X c j) - sum states (fun c => term k i c * X c j)) with
            (sum states (fun c => terms k i c * X c j) + -1 * sum states (fun c => term k i c * X c j)) by ring.
          rewrite <- sum_times, <- sum_plus. apply sum_equal. intros. ring. }
        rewrite L1, L2. ring.
      * rewrite N. set (w := / divisor k) in *.
        assert (Pw : 0 < w) by (apply Rinv_0_lt_compat; lra).
        assert (w1 : w <= 1) by (unfold w; rewrite <- Rinv_1; apply Rinv_le; lra).
        assert (kw : INR k * w = 1 - w).
        { assert (divisor k * w = 1) by (unfold w; apply Rinv_r; lra). rewrite DN in H. lra. }
        unfold Rdiv. fold w. rewrite S_INR. unfold ep, x', h, e, states. cbn [INR].
        set (b := a * w). assert (Pb : 0 < b) by (now apply Rmult_lt_0_compat).
        assert (kb : INR k * b = a - b).
        { unfold b. rewrite <- Rmult_assoc, (Rmult_comm (INR k)), Rmult_assoc, kw. ring. }
        assert (kq : INR k * (q * w) = q - q * w) by (replace (INR k * (q * w)) with (q * (INR k * w))
          by ring; rewrite kw; ring).
        assert (qw : q * w <= q * 1) by (apply Rmult_le_compat_l; lra).
        assert (Pqw : 0 < q * w) by (now apply Rmult_lt_0_compat).
        assert (lw : least * w <= least * 1) by (apply Rmult_le_compat_l; lra).
        assert (Plw : 0 < least * w) by (now apply Rmult_lt_0_compat).
        assert (Ekw : 0 <= INR k * q) by (apply Rmult_le_pos; lra).
        assert (hw : (a + (10 * INR k * u * a + INR k * q)) * w = b + 10 * u * (a - b) + (q - q * w)).
        { rewrite <- kb, <- kq. unfold b. ring. }
        assert (ew : (10 * INR k * u * a + INR k * q) * w = 10 * u * (a - b) + (q - q * w)).
        { rewrite <- kb, <- kq. unfold b. ring. }
        assert (ab : a <= 21 * b).
        { assert (INR k * b <= 20 * b) by (apply Rmult_le_compat_r; lra). lra. }
        set (H := (a + (10 * INR k * u * a + INR k * q)) * w) in *.
        set (E' := (10 * INR k * u * a + INR k * q) * w) in *.
        replace ((a + (10 * INR k * u * a + INR k * q)) * (3.1 * u * / 2) * w) with (H * (3.1 * u * / 2))
          by (unfold H; ring).
        replace ((10 * INR k * u * a + INR k * q) * / 2 * w) with (E' * / 2) by (unfold E'; ring).
        match goal with |- ?l <= _ => replace l with
          (u * (H * (/ 2 + 3.1 * u * / 2) + (1.01 * (1 + 1 + 1 + 1 + 1) * u * (H * (/ 2 + 3.1 * u * / 2)) +
            (1 + 1 + 1 + 1 + 1) * (3 * (1 + 1 + 1 + 1 + 1) * (least * w)))) + (1 + 1 + 1 + 1 + 1) * least +
          ((1.01 * (1 + 1 + 1 + 1 + 1) * u * (H * (/ 2 + 3.1 * u * / 2)) +
            (1 + 1 + 1 + 1 + 1) * (3 * (1 + 1 + 1 + 1 + 1) * (least * w))) +
          (H * (3.1 * u * / 2) + E' * / 2))) by (unfold H, E'; ring) end.
        rewrite hw, ew. clearbody b H E'. unfold q, u in *. lra.
Qed.

Lemma series_at_most : forall k, (k <= 20)%nat -> at_most (series k) (series_size k).
Proof.
  induction k as [|k IH]; intros K; [apply identity_at_most|].
  cbn [series series_size]. apply plus_at_most; [apply IH; lia|]. now apply term_errors.
Qed.

Lemma sums_are_doubles : forall k i j, double (sums k i j).
Proof.
  intros [|k] i j; [rewrite first_sum; unfold identity; destruct Nat.eq_dec; [apply double_1|apply double_0]|].
  rewrite next_sum. apply rounded_is_double.
Qed.

Lemma terms_are_doubles : forall k i j, double (terms k i j).
Proof.
  intros [|k] i j; [rewrite first_term; unfold identity; destruct Nat.eq_dec; [apply double_1|apply double_0]|].
  rewrite next_term. apply rounded_is_double.
Qed.

(** Sum of the sizes of the terms before one. *)
Definition size_before (k : nat) : R := series_size k - term_size k.

Lemma size_before_next : forall k, size_before (S k) = series_size k.
Proof. intros. unfold size_before. cbn [series_size]. ring. Qed.

Lemma sum_errors : forall k, (k <= 20)%nat ->
  at_most (minus (sums k) (series k)) (1.66 * INR k * u + 5 * u * size_before k + INR k * (30 * q)).
Proof.
  destruct q_is_tiny as [Pq Lq].
  induction k as [|k IH]; intros K.
  - intros i I. rewrite (sum_equal states _ (fun _ => 0)).
    + rewrite sum_zero. unfold size_before. cbn. lra.
    + intros. unfold minus. rewrite first_sum. cbn [series]. rewrite Rminus_eq_0. apply Rabs_R0.
  - specialize (IH ltac:(lia)). destruct (term_errors (S k) K) as [B E].
    pose proof (series_at_most (S k) K) as S1. pose proof (series_size_at_most (S k)) as S2.
    pose proof (series_size_at_most k) as S3. pose proof (term_size_is_positive k) as Pk.
    pose proof (term_size_is_positive (S k)) as Pk'.
    assert (RK : 0 <= INR k <= 19).
    { split; [apply pos_INR|]. replace 19 with (INR 19) by (cbn; lra). apply le_INR. lia. }
    set (d := 1.66 * INR k * u + 5 * u * size_before k + INR k * (30 * q)) in *.
    set (e := 10 * INR (S k) * u * term_size (S k) + INR (S k) * q) in *.
    pose proof (plus_at_most states _ _ _ _ IH E) as DE.
    assert (Both : at_most (plus (sums k) (terms (S k))) (series_size (S k) + (d + e))).
    { apply at_most_equal with
        (plus (series (S k)) (plus (minus (sums k) (series k)) (minus (terms (S k)) (term (S k))))).
      - intros. unfold plus, minus. cbn [series]. unfold plus. ring.
      - now apply plus_at_most. }
    assert (Er : at_most (minus (sums (S k)) (plus (sums k) (terms (S k)))) (u * (series_size (S k) + (d + e)))).
    { intros i I. apply Rle_trans with (sum states (fun j => u * Rabs (plus (sums k) (terms (S k)) i j))).
      - apply sum_at_most. intros j J. unfold minus. rewrite next_sum. unfold plus.
        apply sum_error; [apply sums_are_doubles | apply terms_are_doubles].
      - rewrite sum_times. apply Rmult_le_compat_l; [unfold u; lra|]. now apply Both. }
    eapply at_most_more; [eapply at_most_equal; [|exact (plus_at_most states _ _ _ _ Er DE)]|].
    + intros i j. unfold plus, minus. cbn [series]. unfold plus. ring.
    + rewrite size_before_next, S_INR.
      assert (Ek : e = 5 * u * term_size k + (INR k + 1) * q).
      { unfold e. rewrite term_size_next, S_INR, divisor_is_next. field. lra. }
      assert (Bk : size_before k = series_size k - term_size k) by reflexivity.
      assert (Bp : 0 <= size_before k <= 1.652).
      { split; [|lra]. destruct k as [|m]; [unfold size_before; cbn; lra|]. rewrite size_before_next.
        pose proof (series_size_grows 0 m ltac:(lia)) as G. cbn [series_size] in G. lra. }
      assert (Tk : term_size k <= 1.652) by lra.
      assert (kq : 0 <= INR k * q <= 19 * q) by (split; [apply Rmult_le_pos; lra | apply Rmult_le_compat_r; lra]).
      assert (De : d + e <= 100 * u) by (rewrite Ek; unfold d, u in *; lra).
      rewrite Ek in *. unfold d, u in *. lra.
Qed.

Lemma rest_of_series : forall m k, (20 <= m <= k)%nat ->
  at_most (minus (series k) (series m)) (series_size k - series_size m).
Proof.
  intros m k [M H]. induction H as [|k H IH].
  - intros i I. rewrite (sum_equal states _ (fun _ => 0)); [rewrite sum_zero; lra|].
    intros. unfold minus. rewrite Rminus_eq_0. apply Rabs_R0.
  - eapply at_most_more; [eapply at_most_equal; [|eapply plus_at_most; [exact IH|]]|].
    + intros i j. unfold minus, plus. cbn [series]. instantiate (1 := term (S k)). unfold plus. ring.
    + assert (T : forall l, at_most (term l) (term_size l)).
      { assert (Half : CELL_RATE = / 2) by (unfold CELL_RATE; lra). pose proof X_is_small as XS. rewrite Half in XS.
        induction l as [|l IHl]; [apply identity_at_most|]. rewrite term_size_next. cbn [term].
        pose proof (divisor_is_positive l). apply at_most_more
          with (term_size l * / 2 / divisor l); [|unfold Rdiv; lra].
        apply over_at_most; [lra|]. apply product_at_most; auto. lra. }
      apply T.
    + cbn [series_size]. lra.
Qed.

(** The computed sum of 21 terms is within 45 u of all longer sums of the series, and so of the exponential. *)
Theorem cell_error : forall k, (20 <= k)%nat -> at_most (minus (sums 20%nat) (series k)) (45 * u).
Proof.
  intros k K. destruct q_is_tiny as [Pq Lq].
  pose proof (sum_errors 20 ltac:(lia)) as E. pose proof (rest_of_series 20 k ltac:(lia)) as G.
  assert (size_before 20 <= 1.652).
  { unfold size_before. pose proof (series_size_at_most 20). pose proof (term_size_is_positive 20). lra. }
  pose proof (series_size_falls 20 k K) as F. pose proof (term_size_is_positive k). pose proof term_size_at_end.
  eapply at_most_more; [eapply at_most_equal; [|exact (minus_at_most states _ _ _ _ E G)]|].
  - intros i j. unfold minus. ring.
  - replace (INR 20) with 20 by (cbn; lra). unfold u in *. lra.
Qed.

(** Longer sums are at most 1.652 in norm. *)
Lemma series_is_small : forall k, at_most (series k) 1.652.
Proof.
  intros k. destruct (Nat.le_gt_cases k 20) as [L | L].
  - apply at_most_more with (series_size k); [now apply series_at_most | apply series_size_at_most].
  - apply at_most_more with (series_size 20 + (series_size k - series_size 20));
      [|pose proof (series_size_at_most k); lra].
    apply at_most_equal with (plus (series 20) (minus (series k) (series 20))).
    + intros. unfold plus, minus. ring.
    + apply plus_at_most; [apply series_at_most; lia | apply rest_of_series; lia].
Qed.

End Cell.

(** ** Powers on the grid *)

Section Grid.

Notation at_most := (at_most states).
Notation product := (product states).

(** Exact and computed exponential of a cell, and the computed points of the grid, `grid.push(cell * last)`. *)
Variables cell computed_cell : matrix.
Variable points : nat -> matrix.
Hypothesis cell_is_small : at_most cell 1.652.
Hypothesis cell_is_close : at_most (minus computed_cell cell) (45 * u).
Hypothesis first_point : forall i j, points 0%nat i j = identity i j.
Hypothesis next_point : forall k, is_computed_product states states computed_cell (points k) (points (S k)).

(** Largest computed norm of the points. *)
Variable cells : nat.
Variable largest : R.
Hypothesis points_are_small : forall k, (k <= cells)%nat -> at_most (points k) largest.
Hypothesis largest_is_large : 1 <= largest.

Definition step_error (k : nat) : matrix := minus (points (S k)) (product cell (points k)).

(** A step of the grid errs by at most [GRID_STEP] u times the largest computed norm. *)
Lemma grid_step_error : forall k, (k <= cells)%nat -> at_most (step_error k) (GRID_STEP * u * largest).
Proof.
  intros k K. pose proof (points_are_small k K) as P. pose proof largest_is_large as L.
  assert (C : at_most computed_cell (1.652 + 45 * u)).
  { apply at_most_equal with (plus cell (minus computed_cell cell)).
    - intros. unfold plus, minus. ring.
    - now apply plus_at_most. }
  pose proof (product_error states states computed_cell (points k) (points (S k)) _ largest
    ltac:(unfold states; lia) (next_point k) C P ltac:(lra)) as E.
  pose proof (product_at_most states (minus computed_cell cell) (points k) _ largest cell_is_close P ltac:(lra)) as F.
  eapply at_most_more; [eapply at_most_equal; [|exact (plus_at_most states _ _ _ _ E F)]|].
  - intros i j. unfold step_error, plus, minus, tube.product.
    assert (H : sum states (fun c => (computed_cell i c - cell i c) * points k c j) =
      sum states (fun c => computed_cell i c * points k c j) - sum states (fun c => cell i c * points k c j)).
    { replace (sum states (fun c => computed_cell i c * points k c j) - sum states (fun c => cell i c * points k c j))
        with (sum states (fun c => computed_cell i c * points k c j) +
          -1 * sum states (fun c => cell i c * points k c j))
        by ring.
      rewrite <- sum_times, <- sum_plus. apply sum_equal. intros. ring. }
    rewrite H. ring.
  - unfold states. cbn [INR]. pose proof least_below_unit as LU. pose proof least_is_positive.
    unfold GRID_STEP. unfold u in *. lra.
Qed.

(** Exact points of the grid. *)
Fixpoint power (k : nat) : matrix := match k with O => identity | S m => product cell (power m) end.

(** Sum of the propagated errors of the steps. *)
Lemma error_of_point : forall k i j, (i < states)%nat -> (j < states)%nat ->
  minus (points k) (power k) i j = sum k (fun l => product (power (k - 1 - l)) (step_error l) i j).
Proof.
  induction k as [|k IH]; intros i j I J.
  - unfold minus. cbn [power sum]. rewrite first_point. ring.
  - unfold minus. cbn [power sum].
    replace (S k - 1 - k)%nat with 0%nat by lia.
    assert (Id : product (power 0) (step_error k) i j = step_error k i j).
    { cbn [power]. unfold tube.product, identity.
      assert (G : forall m, (i < m)%nat -> sum m (fun c => (if Nat.eq_dec i c then 1 else 0) * step_error k c j) =
        step_error k i j).
      { assert (Z : forall m, (m <= i)%nat ->
          sum m (fun c => (if Nat.eq_dec i c then 1 else 0) * step_error k c j) = 0).
        { induction m as [|m IHm]; intros M; cbn; [reflexivity|]. rewrite IHm by lia.
          destruct (Nat.eq_dec i m); [lia|]. ring. }
        induction m as [|m IHm]; intros M; [lia|]. cbn. destruct (Nat.eq_dec i m) as [-> | N].
        - rewrite Z by lia. ring.
        - rewrite IHm by lia. ring. }
      now apply G. }
    rewrite Id.
    assert (Step : points (S k) i j = step_error k i j + product cell (points k) i j)
      by (unfold step_error, minus; ring).
    rewrite Step.
    assert (Rec : product cell (points k) i j - product cell (power k) i j =
      sum k (fun l => product (power (S k - 1 - l)) (step_error l) i j)).
    { unfold tube.product at 1 2.
      replace (sum states (fun c => cell i c * points k c j) - sum states (fun c => cell i c * power k c j)) with
        (sum states (fun c => cell i c * points k c j) + -1 * sum states (fun c => cell i c * power k c j)) by ring.
      rewrite <- sum_times, <- sum_plus.
      rewrite (sum_equal states _
        (fun c => sum k (fun l => cell i c * product (power (k - 1 - l)) (step_error l) c j))).
      - rewrite sum_exchange. apply sum_equal. intros l Hl.
        replace (S k - 1 - l)%nat with (S (k - 1 - l)) by lia. cbn [power]. unfold tube.product at 2 3.
        rewrite (sum_equal states (fun c => sum states (fun m => cell i m * power (k - 1 - l) m c) * step_error l c j)
          (fun c => sum states (fun m => cell i m * power (k - 1 - l) m c * step_error l c j))).
        + rewrite sum_exchange. apply sum_equal. intros c C. unfold tube.product.
          rewrite <- sum_times. apply sum_equal. intros. ring.
        + intros c C. rewrite Rmult_comm, <- sum_times. apply sum_equal. intros. ring.
      - intros c C. rewrite sum_times. rewrite <- IH by auto. unfold minus. ring. }
    rewrite <- Rec. ring.
Qed.

(** `eps_grid` before it is doubled: the bound of the error of all points. *)
Definition grid_part : R := GRID_STEP * u * INR cells * largest.
Definition grid_bound : R := grid_part * largest / (1 - grid_part).

Theorem grid_error : grid_part < 1 -> forall k, (k <= cells)%nat -> at_most (minus (points k) (power k)) grid_bound.
Proof.
  intros G. pose proof largest_is_large as L. pose proof (pos_INR cells) as PC.
  assert (PG : 0 <= grid_part).
  { unfold grid_part, GRID_STEP. apply Rmult_le_pos; [|lra]. apply Rmult_le_pos; [unfold u; lra|auto]. }
  assert (PB : 0 <= grid_bound).
  { unfold grid_bound, Rdiv. apply Rmult_le_pos; [apply Rmult_le_pos; lra|]. left. apply Rinv_0_lt_compat. lra. }
  assert (EB : grid_part * (largest + grid_bound) = grid_bound) by (unfold grid_bound; field; lra).
  set (c := GRID_STEP * u * largest). assert (Pc : 0 <= c) by (unfold c, GRID_STEP, u; lra).
  (* Strong induction: the exact points before k are at most [largest + grid_bound]. *)
  assert (All : forall m k, (k <= m)%nat -> (k <= cells)%nat -> at_most (minus (points k) (power k)) grid_bound).
  { induction m as [|m IH]; intros k Km Kc i I.
    - assert (k = 0%nat) by lia. subst. rewrite (sum_equal states _ (fun _ => 0)); [rewrite sum_zero; auto|].
      intros. unfold minus. cbn [power]. rewrite first_point, Rminus_eq_0. apply Rabs_R0.
    - assert (Pw : forall l, (l < k)%nat -> at_most (power l) (largest + grid_bound)).
      { intros l Hl. apply at_most_equal with (minus (points l) (minus (points l) (power l))).
        - intros. unfold minus. ring.
        - apply minus_at_most; [apply points_are_small; lia | apply IH; lia]. }
      apply Rle_trans with (sum k (fun _ => (largest + grid_bound) * c)).
      + rewrite (sum_equal states _ (fun j => Rabs (sum k (fun l => product (power (k - 1 - l)) (step_error l) i j))))
          by (intros; now rewrite error_of_point).
        eapply Rle_trans; [apply sum_at_most; intros; apply sum_absolute|]. rewrite sum_exchange.
        apply sum_at_most. intros l Hl.
        apply (product_at_most states (power (k - 1 - l)) (step_error l) (largest + grid_bound) c); auto.
        * apply Pw. lia.
        * apply grid_step_error. lia.
      + rewrite sum_constant. rewrite <- EB at 2.
        replace (grid_part * (largest + grid_bound)) with (INR cells * ((largest + grid_bound) * c))
          by (unfold grid_part, c; ring).
        apply Rmult_le_compat_r; [apply Rmult_le_pos; lra|]. now apply le_INR. }
  intros k K. apply (All k k); auto.
Qed.

End Grid.

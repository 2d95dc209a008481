(** * Separation of two vehicles

    The theorem of `docs/shield.md` for a pair: the contract of [contract] with the planes of [geometry]. *)

From Coq Require Import Reals Lra Bool List.
From Proofs Require contract geometry.
Import geometry ListNotations.
Open Scope R_scope.

(** `plane::Segment`. *)
Record segment := { begin : vector; end_point : vector }.

Section Separation.

(** Distances that the vehicles keep from a divider: `Start::margin_m` of the owner and of the follower. *)
Variables m1 m2 : R.

(** Starts, their hash and their first divider, as in [contract]. *)
Variable Facts : Type.
Variable hash : Facts -> nat.
Variables owner_start follower_start : Facts -> segment.
Variable between : Facts -> option divider.

Definition is_at_most (a b : R) : bool := if Rle_dec a b then true else false.

(** `Plane::contains` of the owner's plane. *)
Definition inside_owner (d : divider) (s : segment) : bool :=
  is_at_most (dot (normal d) (begin s)) (offset d - m1) && is_at_most (dot (normal d) (end_point s)) (offset d - m1).

(** `Plane::contains` of the follower's plane. *)
Definition inside_follower (d : divider) (s : segment) : bool :=
  is_at_most (- dot (normal d) (begin s)) (- offset d - m2) &&
  is_at_most (- dot (normal d) (end_point s)) (- offset d - m2).

Notation reachable :=
  (contract.reachable Facts divider segment hash owner_start follower_start between inside_owner inside_follower).

(** A point of the convex hull of the two segments of a period, such as a point of the path
    ([geometry.path_is_within]). *)
Definition may_be_at (m : contract.motion segment) (p : vector) : Prop :=
  is_within (begin (contract.now _ m)) (end_point (contract.now _ m))
    (begin (contract.next _ m)) (end_point (contract.next _ m)) p.

Lemma is_at_most_true : forall a b, is_at_most a b = true -> a <= b.
Proof. intros a b. unfold is_at_most. destruct (Rle_dec a b); auto; discriminate. Qed.

(** The references of the two vehicles are on opposite sides of a common plane at every time. *)
Theorem references_are_on_opposite_sides : forall facts s p q,
  reachable contract.contract_rules facts facts s ->
  may_be_at (contract.owner_motion _ _ s) p -> may_be_at (contract.follower_motion _ _ s) q ->
  exists d,
    In d (contract.owner_planes _ (contract.owner _ _ s)) /\
    In d (contract.follower_planes _ (contract.follower _ _ s)) /\
    in_owner_plane m1 d p /\ in_follower_plane m2 d q.
Proof.
  intros facts s p q R P Q.
  destruct (contract.common_plane _ _ _ _ _ _ _ _ _ _ _ R) as (d & O & F).
  destruct (contract.segments_are_inside _ _ _ _ _ _ _ _ _ _ _ R) as [MO MF].
  destruct (MO d O) as [O1 O2]. destruct (MF d F) as [F1 F2]. clear MO MF.
  exists d. split; [exact O|split; [exact F|]].
  unfold inside_owner, inside_follower in *.
  apply andb_prop in O1, O2, F1, F2. destruct O1 as [A1 A2], O2 as [A3 A4], F1 as [B1 B2], F2 as [B3 B4].
  apply is_at_most_true in A1, A2, A3, A4, B1, B2, B3, B4.
  split.
  - apply P; auto.
  - unfold in_follower_plane.
    assert (N : forall v, dot (scale (-1) (normal d)) v = - dot (normal d) v).
    { intros v. unfold dot, scale. simpl. ring. }
    rewrite <- N. apply Q; rewrite N; auto.
Qed.

(** Theorem. Let both vehicles hold the same starts, and let the start condition hold for them. At every time, let each
    vehicle be within its tube of a point of the path of its reference. Then both are at least delta apart, for every
    behaviour of the radio and every choice of commands. *)
Theorem vehicles_are_separated : forall facts s delta e1 e2 p q p' q',
  delta / 2 + e1 <= m1 -> delta / 2 + e2 <= m2 ->
  reachable contract.contract_rules facts facts s ->
  may_be_at (contract.owner_motion _ _ s) p -> may_be_at (contract.follower_motion _ _ s) q ->
  distance p p' <= e1 -> distance q' q <= e2 ->
  delta <= distance p' q'.
Proof.
  intros facts s delta e1 e2 p q p' q' M1 M2 R P Q E1 E2.
  destruct (references_are_on_opposite_sides facts s p q R P Q) as (d & _ & _ & A & B).
  exact (vehicles_are_apart d delta e1 e2 m1 m2 p q p' q' M1 M2 A B E1 E2).
Qed.

End Separation.

(** * Contracts with a defect, and traces of the contract

    Each theorem [without_...] switches off one rule of [contract.rules], or one condition of the start. It gives steps
    that lead to two vehicles without a common plane. So each rule is needed, and [contract.common_plane] is not empty.

    The world is a line. A divider is a place. The owner stays at or below it, the follower at or above it. *)

From Coq Require Import Arith Bool List Lia.
From Proofs Require Import contract.
Import ListNotations.

(** Starts of two flights. The owner starts at 0, the follower at 10. *)
Inductive facts := Here | Other.

Definition hash (f : facts) : nat := match f with Here => 1 | Other => 2 end.
Definition owner_start (f : facts) : nat := 0.
Definition follower_start (f : facts) : nat := 10.
Definition between (f : facts) : option nat := Some match f with Here => 5 | Other => 9 end.
Definition inside_owner (divider segment : nat) : bool := segment <=? divider.
Definition inside_follower (divider segment : nat) : bool := divider <=? segment.

Notation starts_with := (starts facts nat nat hash owner_start follower_start between inside_owner inside_follower).
Notation reaches :=
  (reachable facts nat nat hash owner_start follower_start between inside_owner inside_follower).
Notation run_with := (run nat nat inside_owner inside_follower).

(** Start with messages of other starts in the radio. *)
Definition start (a b : facts) (messages : list (message nat)) : state nat nat := {|
  owner := owned_at_start facts nat hash a match a with Here => 5 | Other => 9 end;
  owner_motion := {| now := 0; next := 0 |};
  follower := followed_at_start facts nat hash b match b with Here => 5 | Other => 9 end;
  follower_motion := {| now := 10; next := 10 |};
  radio := messages |}.

(** The owner may be beyond the follower. *)
Definition have_passed (s : state nat nat) : Prop :=
  next _ (follower_motion _ _ s) < next _ (owner_motion _ _ s).

(** Two vehicles without a common plane that have passed each other. *)
Definition is_broken (s : state nat nat) : Prop := ~ have_common_plane _ _ s /\ have_passed s.

Ltac no_plane := intros (d & O & F); simpl in O, F;
  repeat (destruct O as [<- | O]; [destruct F as [F | []]; discriminate|]); destruct O.

(** Runs steps from a start, and gives the last state. *)
Ltac trace a b messages events :=
  match goal with |- exists s, reachable _ _ _ _ _ _ _ _ _ ?r _ _ s /\ _ =>
    let result := eval vm_compute in (run_with r (start a b messages) events) in
    match result with Some ?last =>
      exists last; split;
        [ exists (start a b messages), events; split;
          [ eexists; eexists; repeat (split; [reflexivity|]); simpl; intros m Hin;
            repeat (destruct Hin as [<- | Hin]; [split; discriminate|]); destruct Hin
          | vm_compute; reflexivity ]
        | ]
    end
  end.

Ltac broken := split; [no_plane | unfold have_passed; simpl; lia].

(** Steps in which a proposal is sent, decided and answered. The places of both messages are given. *)
Definition exchange (stamp place : nat) : list (event nat nat) := [
  SendOwner _ _ stamp; HearFollower _ _ place; RenewFollower _ _ true;
  SendFollower _ _ stamp; HearOwner _ _ (S place)].

(** ** The contract is not stuck *)

(** A plane is proposed, sent, accepted, answered and taken. Both vehicles then use the space that it gives. *)
Theorem a_plane_is_renewed : exists s,
  reaches contract_rules Here Here s /\
  owner_planes _ (owner _ _ s) = [9] /\ follower_planes _ (follower _ _ s) = [9] /\
  next _ (owner_motion _ _ s) = 9 /\ next _ (follower_motion _ _ s) = 10.
Proof.
  trace Here Here (@nil (message nat))
    ([RenewOwner nat nat (Some 9)] ++ exchange 1 0 ++ [RenewOwner _ _ None; CommandOwner _ _ 9]).
  simpl. auto.
Qed.

(** A proposal beyond the follower is refused. The owner keeps the old plane and gives the next number. *)
Theorem a_plane_is_refused : exists s,
  reaches contract_rules Here Here s /\
  owner_planes _ (owner _ _ s) = [5; 6] /\ o_number _ (owner _ _ s) = 2 /\
  follower_planes _ (follower _ _ s) = [5].
Proof.
  trace Here Here (@nil (message nat)) (
    [CommandFollower nat nat 7; RenewFollower _ _ true; RenewOwner _ _ (Some 9)] ++ exchange 1 0 ++
    [RenewOwner _ _ (Some 6)]).
  simpl. auto.
Qed.

(** ** Conditions of the start *)

(** Two vehicles with different starts have different first planes. No rule of the contract helps. *)
Theorem without_equal_starts : exists s, reaches contract_rules Other Here s /\ is_broken s.
Proof.
  trace Other Here (@nil (message nat)) [CommandOwner nat nat 9; CommandFollower _ _ 5]. broken.
Qed.

(** An answer of an earlier flight with the same hash breaks the contract. So the number of the flight must be new. *)
Theorem without_new_flight : exists m s,
  m_starts _ m = hash Here /\
  run_with contract_rules (start Here Here [m])
    [RenewOwner _ _ (Some 9); HearOwner _ _ 0; RenewOwner _ _ None; CommandOwner _ _ 9; CommandFollower _ _ 5] =
    Some s /\
  is_broken s.
Proof.
  exists {| m_stamp := 1; m_starts := 1; m_body := FollowerBody _ (Some {| d_number := 1; d_accepted := true |}) |}.
  eexists. split; [reflexivity|]. split; [reflexivity|]. broken.
Qed.

(** ** Rules of the contract *)

(** The owner gives up the old plane when it proposes the new one. *)
Theorem without_old_plane : exists s,
  reaches {| keeps_old_plane := false; matches_number := true; waits_for_decision := true; numbers_grow := true;
    decides_once := true; compares_hash := true; saves_first := true |} Here Here s /\ is_broken s.
Proof.
  trace Here Here (@nil (message nat))
    [RenewOwner nat nat (Some 9); CommandOwner _ _ 9; CommandFollower _ _ 5]. broken.
Qed.

(** The owner takes a decision on an older number as one on the pending number. *)
Theorem without_matching_number : exists s,
  reaches {| keeps_old_plane := true; matches_number := false; waits_for_decision := true; numbers_grow := true;
    decides_once := true; compares_hash := true; saves_first := true |} Here Here s /\ is_broken s.
Proof.
  trace Here Here (@nil (message nat)) (
    [RenewOwner nat nat (Some 3)] ++ exchange 1 0 ++
    [RenewOwner _ _ (Some 9); RenewOwner _ _ None; CommandOwner _ _ 9; CommandFollower _ _ 3]). broken.
Qed.

(** The owner proposes again before it knows the decision. *)
Theorem without_waiting : exists s,
  reaches {| keeps_old_plane := true; matches_number := true; waits_for_decision := false; numbers_grow := true;
    decides_once := true; compares_hash := true; saves_first := true |} Here Here s /\ is_broken s.
Proof.
  trace Here Here (@nil (message nat))
    [RenewOwner nat nat (Some 3); SendOwner _ _ 1; RenewOwner _ _ (Some 9); HearFollower _ _ 0; RenewFollower _ _ true;
     CommandOwner _ _ 5; CommandFollower _ _ 3]. broken.
Qed.

(** The owner gives a number twice. *)
Theorem without_growing_numbers : exists s,
  reaches {| keeps_old_plane := true; matches_number := true; waits_for_decision := true; numbers_grow := false;
    decides_once := true; compares_hash := true; saves_first := true |} Here Here s /\ is_broken s.
Proof.
  trace Here Here (@nil (message nat)) (
    [RenewOwner nat nat (Some 3)] ++ exchange 1 0 ++
    [RenewOwner _ _ (Some 9); RenewOwner _ _ None; CommandOwner _ _ 9; CommandFollower _ _ 3]). broken.
Qed.

(** The follower first refuses a proposal and then accepts it. *)
Theorem without_single_decision : exists s,
  reaches {| keeps_old_plane := true; matches_number := true; waits_for_decision := true; numbers_grow := true;
    decides_once := false; compares_hash := true; saves_first := true |} Here Here s /\ ~ have_common_plane _ _ s.
Proof.
  trace Here Here (@nil (message nat)) (
    [CommandFollower nat nat 7; RenewFollower _ _ true; RenewOwner _ _ (Some 9)] ++ exchange 1 0 ++
    [RenewOwner _ _ None; CommandFollower _ _ 10; RenewFollower _ _ true]). no_plane.
Qed.

(** A vehicle reads messages with another hash: the answer of an earlier flight. *)
Theorem without_hash : exists s,
  reaches {| keeps_old_plane := true; matches_number := true; waits_for_decision := true; numbers_grow := true;
    decides_once := true; compares_hash := false; saves_first := true |} Here Here s /\ is_broken s.
Proof.
  trace Here Here
    [{| m_stamp := 1; m_starts := 3; m_body := FollowerBody nat (Some {| d_number := 1; d_accepted := true |}) |}]
    [RenewOwner nat nat (Some 9); HearOwner _ _ 0; RenewOwner _ _ None; CommandOwner _ _ 9; CommandFollower _ _ 5].
  broken.
Qed.

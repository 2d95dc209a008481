(** * Crash and return of a vehicle

    A vehicle whose computer restarts loads a saved contract (`Shield::save`, `SavedShield::load`) and continues.
    Lemma 3 still holds under one rule, [contract.saves_first]: the vehicle saves its contract after each change, before
    it sends a message and before it takes a command. [without_saving_first] and [without_saved_contract] show that the
    rule is needed. The code does not save by itself: the rule is one for its caller.

    The model covers the contract. It does not cover the flight while the computer is off: the vehicle must stay in its
    reserved segments, and the loaded reference must be that of the vehicle. *)

From Coq Require Import Arith Bool List Lia.
From Proofs Require Import contract twins.
Import ListNotations.

Section Crash.

Variables Facts Divider Segment : Type.
Variable hash : Facts -> nat.
Variables owner_start follower_start : Facts -> Segment.
Variable between : Facts -> option Divider.
Variables inside_owner inside_follower : Divider -> Segment -> bool.

Notation state := (state Divider Segment).
Notation event := (event Divider Segment).
Notation apply := (apply Divider Segment inside_owner inside_follower).
Notation starts := (starts Facts Divider Segment hash owner_start follower_start between inside_owner inside_follower).
Notation invariant := (invariant Divider Segment inside_owner inside_follower).
Notation contract_holds := (contract_holds Divider).
Notation same_owned := (same_owned Divider).
Notation same_followed := (same_followed Divider).

(** The two vehicles, and the contract that each of them saved last. *)
Record saved := { current : state; owner_saved : owned Divider; follower_saved : followed Divider }.

Definition with_current (c : saved) (s : state) : saved :=
  {| current := s; owner_saved := owner_saved c; follower_saved := follower_saved c |}.

(** Whether the saved contracts allow a step: those of messages and commands need a saved contract. Messages heard since
    need not be saved. *)
Definition is_saved (c : saved) (e : event) : Prop :=
  match e with
  | SendOwner _ _ _ | CommandOwner _ _ _ => same_owned (owner _ _ (current c)) (owner_saved c)
  | SendFollower _ _ _ | CommandFollower _ _ _ => same_followed (follower _ _ (current c)) (follower_saved c)
  | _ => True
  end.

(** Steps of two vehicles that save, crash and return, at any time and any number of times. *)
Inductive step (r : rules) (c : saved) : saved -> Prop :=
  | Event e s :
      (saves_first r = true -> is_saved c e) -> apply r (current c) e = Some s -> step r c (with_current c s)
  | SaveOwner :
      step r c {| current := current c; owner_saved := owner _ _ (current c); follower_saved := follower_saved c |}
  | SaveFollower :
      step r c {| current := current c; owner_saved := owner_saved c; follower_saved := follower _ _ (current c) |}
  | ReturnOwner :
      step r c (with_current c (with_owner _ _ (current c) (owner_saved c) (owner_motion _ _ (current c))))
  | ReturnFollower :
      step r c (with_current c (with_follower _ _ (current c) (follower_saved c) (follower_motion _ _ (current c)))).

Inductive steps (r : rules) (c : saved) : saved -> Prop :=
  | Rest : steps r c c
  | Then d e : steps r c d -> step r d e -> steps r c e.

(** Both vehicles save their contracts at the start. *)
Definition saved_start (s : state) : saved :=
  {| current := s; owner_saved := owner _ _ s; follower_saved := follower _ _ s |}.

Definition reachable (r : rules) (facts : Facts) (c : saved) : Prop :=
  exists s, starts facts facts s /\ steps r (saved_start s) c.

(** The state after each of the two, or both, load their saved contracts. *)
Definition loaded (c : saved) (o : owned Divider) (f : followed Divider) : state := {|
  owner := o; owner_motion := owner_motion _ _ (current c);
  follower := f; follower_motion := follower_motion _ _ (current c);
  radio := radio _ _ (current c) |}.

(** The invariant holds for each choice of a present or a saved contract of each vehicle. *)
Definition saved_invariant (h : nat) (c : saved) : Prop :=
  forall o f, In o [owner _ _ (current c); owner_saved c] -> In f [follower _ _ (current c); follower_saved c] ->
    invariant h (loaded c o f).

Lemma owner_command_is_inside : forall h c o f segment,
  invariant h (loaded c o f) ->
  forallb (fun d => inside_owner d segment) (owner_planes Divider o) = true ->
  invariant h {| owner := o; owner_motion := command _ (owner_motion _ _ (current c)) segment;
    follower := f; follower_motion := follower_motion _ _ (current c); radio := radio _ _ (current c) |}.
Proof. intros h c o f segment (C & O & F) A. split; [|split]; auto. now apply command_holds. Qed.

Lemma follower_command_is_inside : forall h c o f segment,
  invariant h (loaded c o f) ->
  forallb (fun d => inside_follower d segment) (follower_planes Divider f) = true ->
  invariant h {| owner := o; owner_motion := owner_motion _ _ (current c);
    follower := f; follower_motion := command _ (follower_motion _ _ (current c)) segment;
    radio := radio _ _ (current c) |}.
Proof. intros h c o f segment (C & O & F) A. split; [|split]; auto. now apply command_holds. Qed.

Lemma same_owner_planes : forall o o', same_owned o o' -> owner_planes Divider o = owner_planes Divider o'.
Proof. intros o o' (_ & _ & H & P). unfold owner_planes. now rewrite H, P. Qed.

Lemma same_follower_planes : forall f f',
  same_followed f f' -> follower_planes Divider f = follower_planes Divider f'.
Proof. intros f f' (_ & H & _). unfold follower_planes. now rewrite H. Qed.

Theorem saved_invariant_is_inductive : forall h c d,
  saved_invariant h c -> step contract_rules c d -> saved_invariant h d.
Proof.
  intros h c d H S. destruct S as [e s Saved A | | | |].
  - specialize (Saved eq_refl).
    (* The steps of a vehicle change nothing but its own contract, its own motion and the radio. *)
    assert (Step : forall o f s', In o [owner _ _ (current c); owner_saved c] ->
      In f [follower _ _ (current c); follower_saved c] ->
      apply contract_rules (loaded c o f) e = Some s' -> invariant h s').
    { intros o f s' Ho Hf A'. eapply invariant_is_inductive; [apply H|]; eauto. }
    intros o f Ho Hf. simpl in Ho, Hf.
    destruct e; simpl in A, Saved, Step.
    + destruct (nth_error _ _) as [m|]; [|discriminate]. injection A as <-. simpl in *.
      destruct Ho as [<- | [<- | []]]; [|now apply H; simpl; auto].
      eapply Step; [left; reflexivity | exact Hf | reflexivity].
    + destruct (nth_error _ _) as [m|]; [|discriminate]. injection A as <-. simpl in *.
      destruct Hf as [<- | [<- | []]]; [|now apply H; simpl; auto].
      eapply Step; [exact Ho | left; reflexivity | reflexivity].
    + injection A as <-. simpl in *. destruct Ho as [<- | [<- | []]].
      * eapply Step; [left; reflexivity | exact Hf | reflexivity].
      * destruct (H (owner_saved c) f) as (C & O & F); simpl; auto.
        split; [|split]; auto. now apply advance_holds.
    + injection A as <-. simpl in *. destruct Hf as [<- | [<- | []]].
      * eapply Step; [exact Ho | left; reflexivity | reflexivity].
      * destruct (H o (follower_saved c)) as (C & O & F); simpl; auto.
        split; [|split]; auto. now apply advance_holds.
    + injection A as <-. simpl in *. eapply Step; [exact Ho | exact Hf | reflexivity].
    + injection A as <-. simpl in *. eapply Step; [exact Ho | exact Hf | reflexivity].
    + match type of A with (if ?b then _ else _) = _ => destruct b eqn:I; [|discriminate A] end.
      injection A as <-. simpl in Ho, Hf. apply (owner_command_is_inside h c o f segment).
      * apply H; simpl; auto.
      * destruct Ho as [<- | [<- | []]]; [exact I|]. rewrite <- (same_owner_planes _ _ Saved). exact I.
    + match type of A with (if ?b then _ else _) = _ => destruct b eqn:I; [|discriminate A] end.
      injection A as <-. simpl in Ho, Hf. apply (follower_command_is_inside h c o f segment).
      * apply H; simpl; auto.
      * destruct Hf as [<- | [<- | []]]; [exact I|]. rewrite <- (same_follower_planes _ _ Saved). exact I.
    + injection A as <-. simpl in *. destruct (H o f) as (C & O & F); simpl; auto.
      split; [|split]; auto. apply owner_message_holds; auto.
      destruct Ho as [<- | [<- | []]]; [repeat split|]. destruct Saved as (? & ? & ? & ?). repeat split; auto.
    + injection A as <-. simpl in *. destruct (H o f) as (C & O & F); simpl; auto.
      split; [|split]; auto. apply follower_message_holds; auto.
      destruct Hf as [<- | [<- | []]]; [repeat split|]. destruct Saved as (? & ? & ?). repeat split; auto.
  - intros o f Ho Hf. apply H; auto. simpl in *. intuition.
  - intros o f Ho Hf. apply H; auto. simpl in *. intuition.
  - intros o f Ho Hf. apply H; auto. simpl in *. intuition.
  - intros o f Ho Hf. apply H; auto. simpl in *. intuition.
Qed.

Theorem saved_invariant_is_reachable : forall facts c,
  reachable contract_rules facts c -> saved_invariant (hash facts) c.
Proof.
  intros facts c (s & Start & Run). induction Run as [| d e Run IH S].
  - intros o f Ho Hf. simpl in Ho, Hf. destruct s.
    destruct Ho as [<- | [<- | []]], Hf as [<- | [<- | []]]; exact (invariant_at_start _ _ _ _ _ _ _ _ _ _ _ Start).
  - eapply saved_invariant_is_inductive; eauto.
Qed.

(** Lemma 3 with crashes. Vehicles that return with the contract that they saved hold a common plane at every time, and
    their segments stay inside their planes. *)
Theorem common_plane_after_return : forall facts c,
  reachable contract_rules facts c ->
  have_common_plane Divider Segment (current c) /\
  motion_holds _ _ inside_owner (owner_planes _ (owner _ _ (current c))) (owner_motion _ _ (current c)) /\
  motion_holds _ _ inside_follower (follower_planes _ (follower _ _ (current c))) (follower_motion _ _ (current c)).
Proof.
  intros facts c R. apply saved_invariant_is_reachable in R.
  assert (I : invariant (hash facts) (current c)).
  { destruct c as [[] o f]. apply R; simpl; auto. }
  split; [|split; apply I]. eapply invariant_has_common_plane. exact I.
Qed.

End Crash.

(** ** Twins *)

Notation crash_reaches :=
  (reachable facts nat nat hash owner_start follower_start between inside_owner inside_follower).
Notation crash_step := (step nat nat inside_owner inside_follower).

(** A vehicle sends and flies before it saves: the follower accepts a plane and returns without it. *)
Theorem without_saving_first : exists c,
  crash_reaches {| keeps_old_plane := true; matches_number := true; waits_for_decision := true; numbers_grow := true;
    decides_once := true; compares_hash := true; saves_first := false |} Here c /\ is_broken (current _ _ c).
Proof.
  pose (events := [RenewOwner nat nat (Some 9)] ++ exchange 1 0 ++ [RenewOwner _ _ None; CommandOwner _ _ 9]).
  pose (r := {| keeps_old_plane := true; matches_number := true; waits_for_decision := true; numbers_grow := true;
    decides_once := true; compares_hash := true; saves_first := false |}).
  pose (s0 := start Here Here []).
  assert (All : forall events c s, run_with r (current _ _ c) events = Some s ->
    steps nat nat inside_owner inside_follower r c (with_current _ _ c s)).
  { assert (Trans : forall c d e, steps nat nat inside_owner inside_follower r c d ->
      steps nat nat inside_owner inside_follower r d e -> steps nat nat inside_owner inside_follower r c e).
    { intros c d e P Q. induction Q; auto. econstructor; eauto. }
    induction events0 as [|e rest IH]; simpl; intros c s A.
    - injection A as <-. destruct c. apply Rest.
    - destruct (apply _ _ _ _ _ _ e) as [s1|] eqn:E; [|discriminate].
      eapply Trans; [eapply Then; [apply Rest | eapply Event; [discriminate | exact E]]|].
      apply (IH (with_current _ _ c s1)). exact A. }
  let v := eval vm_compute in (run_with r s0 events) in
  match v with Some ?last =>
    pose (c1 := with_current nat nat (saved_start nat nat s0) last);
    assert (E : run_with r s0 events = Some last) by (vm_compute; reflexivity)
  end.
  pose (c2 := with_current nat nat c1
    (with_follower _ _ (current _ _ c1) (follower_saved _ _ c1) (follower_motion _ _ (current _ _ c1)))).
  destruct (apply nat nat inside_owner inside_follower r (current _ _ c2) (CommandFollower _ _ 5)) as [s3|] eqn:E3;
    [|vm_compute in E3; discriminate].
  exists (with_current nat nat c2 s3). split.
  - exists s0. split.
    + eexists; eexists. repeat (split; [reflexivity|]). intros m [].
    + eapply Then; [eapply Then; [apply (All events (saved_start nat nat s0)); exact E | apply ReturnFollower]|].
      eapply Event; [discriminate | exact E3].
  - vm_compute in E3. injection E3 as <-. broken.
Qed.

(** A vehicle that returns with the contract of the start has no common plane with its partner. *)
Theorem without_saved_contract : exists s,
  reaches contract_rules Here Here s /\
  let o := owned_at_start facts nat hash Here 5 in
  let f := followed_at_start facts nat hash Here 5 in
  ~ have_common_plane _ _ (with_owner _ _ s o (owner_motion _ _ s)) /\
  is_broken (with_follower _ _ s f {| now := 5; next := 5 |}).
Proof.
  trace Here Here (@nil (message nat))
    ([RenewOwner nat nat (Some 9)] ++ exchange 1 0 ++ [RenewOwner _ _ None; CommandOwner _ _ 9]).
  split; [no_plane | broken].
Qed.

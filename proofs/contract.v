(** * Contract of two vehicles on the plane between them

    Model of the contract of a pair: `crates/shield/src/contract.rs`, with `Contracts::hear` and `Contracts::new` of
    `contracts.rs` and the instants of `shield.rs`. The main results are Lemma 3 of `docs/shield.md` ([common_plane])
    and Lemma 2 ([segments_are_inside], [brake_is_a_choice]).

    The model allows every behaviour of the code and more:

    - Each vehicle takes its steps at any time. The model has no clock.
    - The radio is a list of messages that only grows. Any message of it may arrive at any time, many times, or never.
    - A message may have any stamp. The owner may propose any plane that contains its own segment.
    - A follower may refuse any plane.
    - A vehicle may or may not look at its contract, propose and send. The conditions on room and due periods are left
      out. *)

From Coq Require Import Arith Bool List Lia.
Import ListNotations.

(** Decision of the follower on the proposal with a number: `contract::Decision`. *)
Record decision := { d_number : nat; d_accepted : bool }.

(** `contract::NO_DECISION`. *)
Definition no_decision := {| d_number := 0; d_accepted := false |}.

(** Whether the partner holds the same starts, by its messages: `contract::Agreement`. *)
Inductive agreement := Unheard | Same | Void.

(** Rules of the contract that can be switched off, so that [twins] shows the need of each one. *)
Record rules := {
  (** The owner holds the old plane while the decision on a proposal is pending. *)
  keeps_old_plane : bool;
  (** The owner takes only the decision on the number of its pending proposal. *)
  matches_number : bool;
  (** The owner gives no new number while a decision is pending. *)
  waits_for_decision : bool;
  (** Each proposal has a larger number than all before. *)
  numbers_grow : bool;
  (** The follower decides on each number once. *)
  decides_once : bool;
  (** Each vehicle compares the hash of the starts in each message. *)
  compares_hash : bool;
  (** In [crash]: a vehicle saves its contract before it sends a message or takes a command. *)
  saves_first : bool }.

(** The rules of the code. *)
Definition contract_rules := {|
  keeps_old_plane := true; matches_number := true; waits_for_decision := true; numbers_grow := true;
  decides_once := true; compares_hash := true; saves_first := true |}.

Section Contract.

(** The two announced starts of a pair, as one vehicle holds them: two values of `start::Start`. *)
Variable Facts : Type.
(** `plane::Divider`. The owner's plane and the follower's plane are functions of it, so a common plane is an equal
    divider. *)
Variable Divider : Type.
(** `plane::Segment`. *)
Variable Segment : Type.

(** `start::hash_of_pair`. *)
Variable hash : Facts -> nat.
(** Reserved segments of the starts of the owner and the follower: `Start::segment`. *)
Variables owner_start follower_start : Facts -> Segment.
(** `Divider::between` of the two starts. *)
Variable between : Facts -> option Divider.
(** `Divider::owner_plane(...).contains(segment)` and the same of `follower_plane`. *)
Variables inside_owner inside_follower : Divider -> Segment -> bool.

(** ** Messages *)

(** `contract::Proposal`. *)
Record proposal := { p_number : nat; p_divider : Divider }.

(** `contract::Body`, without the segment of the follower: it helps to choose a plane, and the model allows any. *)
Inductive body := OwnerBody (p : option proposal) | FollowerBody (q : option decision).

(** `contract::Message` of this pair. Messages of other pairs have no effect on its contract (`Contracts::hear`). *)
Record message := { m_stamp : nat; m_starts : nat; m_body : body }.

(** ** Vehicles *)

(** `contract::Owned`. [o_number] is `proposed.number`, and [o_pending] is `proposed.divider` while `is_pending`. *)
Record owned := {
  o_hash : nat;
  o_agreement : agreement;
  o_stamp : nat;
  o_decision : decision;
  o_held : Divider;
  o_number : nat;
  o_pending : option Divider }.

(** `contract::Followed`. [f_proposal] is [None] for `NO_PROPOSAL`. *)
Record followed := {
  f_hash : nat;
  f_agreement : agreement;
  f_stamp : nat;
  f_proposal : option proposal;
  f_held : Divider;
  f_decided : decision }.

(** Segments of a vehicle at its last instant and at its next one (`Shield::segment` before and after
    `Shield::command`). The path of the period is in the convex hull of both ([geometry.path_is_within]). *)
Record motion := { now : Segment; next : Segment }.

(** Planes that the owner respects: those that `Owned::look` adds, whether within reach or not. *)
Definition owner_planes (o : owned) : list Divider :=
  o_held o :: match o_pending o with Some d => [d] | None => [] end.

(** Planes that the follower respects: `Followed::look`. *)
Definition follower_planes (f : followed) : list Divider := [f_held f].

(** `contract::divider_of_starts`. *)
Definition divider_of_starts (facts : Facts) : option Divider :=
  match between facts with
  | Some d => if inside_owner d (owner_start facts) && inside_follower d (follower_start facts) then Some d else None
  | None => None
  end.

(** `Owned::new(...).with_hash(...)` at a first plane. *)
Definition owned_at_start (facts : Facts) (d : Divider) : owned := {|
  o_hash := hash facts; o_agreement := Unheard; o_stamp := 0; o_decision := no_decision;
  o_held := d; o_number := 0; o_pending := None |}.

(** `Followed::new(...).with_hash(...)` at a first plane. *)
Definition followed_at_start (facts : Facts) (d : Divider) : followed := {|
  f_hash := hash facts; f_agreement := Unheard; f_stamp := 0; f_proposal := None;
  f_held := d; f_decided := no_decision |}.

Section Rules.

Variable r : rules.

(** `Shared::compare`: the new agreement, and whether the message may be read. *)
Definition compare (own : nat) (state : agreement) (m : message) : agreement * bool :=
  if compares_hash r && negb (m_starts m =? own) then (Void, false)
  else match state with Void => (Void, false) | _ => (Same, true) end.

(** `Owned::hear`. `Contracts::hear` drops a message that is not from the other side of the pair. *)
Definition hear_owned (o : owned) (m : message) : owned :=
  match m_body m with
  | OwnerBody _ => o
  | FollowerBody q =>
      let (a, reads) := compare (o_hash o) (o_agreement o) m in
      if reads && (o_stamp o <? m_stamp m) then {|
        o_hash := o_hash o; o_agreement := a; o_stamp := m_stamp m;
        o_decision := match q with Some q => q | None => no_decision end;
        o_held := o_held o; o_number := o_number o; o_pending := o_pending o |}
      else {|
        o_hash := o_hash o; o_agreement := a; o_stamp := o_stamp o; o_decision := o_decision o;
        o_held := o_held o; o_number := o_number o; o_pending := o_pending o |}
  end.

(** `Followed::hear`. *)
Definition hear_followed (f : followed) (m : message) : followed :=
  match m_body m with
  | FollowerBody _ => f
  | OwnerBody p =>
      let (a, reads) := compare (f_hash f) (f_agreement f) m in
      if reads && (f_stamp f <? m_stamp m) then {|
        f_hash := f_hash f; f_agreement := a; f_stamp := m_stamp m; f_proposal := p;
        f_held := f_held f; f_decided := f_decided f |}
      else {|
        f_hash := f_hash f; f_agreement := a; f_stamp := f_stamp f; f_proposal := f_proposal f;
        f_held := f_held f; f_decided := f_decided f |}
  end.

Definition is_void (a : agreement) : bool := match a with Void => true | _ => false end.

(** First half of `Owned::renew`: takes the decision on the pending proposal. *)
Definition take_decision (o : owned) : owned :=
  match o_pending o with
  | Some d =>
      let number := d_number (o_decision o) in
      if if matches_number r then number =? o_number o else 0 <? number then {|
        o_hash := o_hash o; o_agreement := o_agreement o; o_stamp := o_stamp o; o_decision := o_decision o;
        o_held := if d_accepted (o_decision o) then d else o_held o;
        o_number := o_number o; o_pending := None |}
      else o
  | None => o
  end.

(** Second half of `Owned::renew`: proposes a divider if the own segment is inside. [None] stands for an instant without
    a proposal: not due, far, no gap, or no number left. *)
Definition propose (o : owned) (segment : Segment) (wish : option Divider) : owned :=
  match wish with
  | Some d =>
      let is_pending := match o_pending o with Some _ => true | None => false end in
      if inside_owner d segment && negb (waits_for_decision r && is_pending) then {|
        o_hash := o_hash o; o_agreement := o_agreement o; o_stamp := o_stamp o; o_decision := o_decision o;
        o_held := if keeps_old_plane r then o_held o else d;
        o_number := if numbers_grow r then S (o_number o) else 1;
        o_pending := Some d |}
      else o
  | None => o
  end.

(** `Owned::renew`. *)
Definition renew (o : owned) (segment : Segment) (wish : option Divider) : owned :=
  if is_void (o_agreement o) then o else propose (take_decision o) segment wish.

(** `Followed::decide`. A follower that is not willing refuses: the model allows to refuse any plane, the code refuses
    those that do not contain its segment. *)
Definition decide (f : followed) (segment : Segment) (willing : bool) : followed :=
  match f_proposal f with
  | Some p =>
      if is_void (f_agreement f) || (decides_once r && (p_number p <=? d_number (f_decided f))) then f
      else
        let accepted := willing && inside_follower (p_divider p) segment in {|
          f_hash := f_hash f; f_agreement := f_agreement f; f_stamp := f_stamp f; f_proposal := f_proposal f;
          f_held := if accepted then p_divider p else f_held f;
          f_decided := {| d_number := p_number p; d_accepted := accepted |} |}
  | None => f
  end.

(** Message of the owner: `Owned::proposal` and `Contracts::next_entry`. *)
Definition owner_message (stamp : nat) (o : owned) : message := {|
  m_stamp := stamp; m_starts := o_hash o;
  m_body := OwnerBody match o_pending o with
    | Some d => if is_void (o_agreement o) then None else Some {| p_number := o_number o; p_divider := d |}
    | None => None
    end |}.

(** Message of the follower: `Followed::decision` and `Contracts::next_entry`. *)
Definition follower_message (stamp : nat) (f : followed) : message := {|
  m_stamp := stamp; m_starts := f_hash f;
  m_body := FollowerBody (if 0 <? d_number (f_decided f) then Some (f_decided f) else None) |}.

(** ** Transition system *)

Record state := {
  owner : owned;
  owner_motion : motion;
  follower : followed;
  follower_motion : motion;
  radio : list message }.

(** Steps of the two vehicles. A number of a message is its place in the radio. *)
Inductive event :=
  (** `Shield::hear`. *)
  | HearOwner (place : nat)
  | HearFollower (place : nat)
  (** An instant at which the vehicle looks at its contract: `Shield::advance`, then `Owned::renew` or
      `Followed::decide`. *)
  | RenewOwner (wish : option Divider)
  | RenewFollower (willing : bool)
  (** An instant without a look at the contract: `Shield::brake`, or a plane that is not due. *)
  | PassOwner
  | PassFollower
  (** The command of an instant: `Shield::command` with an accepted next segment, or with that of the brake. *)
  | CommandOwner (segment : Segment)
  | CommandFollower (segment : Segment)
  (** `Shield::messages`. *)
  | SendOwner (stamp : nat)
  | SendFollower (stamp : nat).

Definition with_owner (s : state) (o : owned) (m : motion) : state := {|
  owner := o; owner_motion := m; follower := follower s; follower_motion := follower_motion s; radio := radio s |}.

Definition with_follower (s : state) (f : followed) (m : motion) : state := {|
  owner := owner s; owner_motion := owner_motion s; follower := f; follower_motion := m; radio := radio s |}.

Definition with_message (s : state) (m : message) : state := {|
  owner := owner s; owner_motion := owner_motion s; follower := follower s; follower_motion := follower_motion s;
  radio := radio s ++ [m] |}.

(** Motion from an instant on, before its command: that of the brake, which stays in the segment. *)
Definition advance (m : motion) : motion := {| now := next m; next := next m |}.

Definition command (m : motion) (segment : Segment) : motion := {| now := now m; next := segment |}.

(** Result of a step, or [None] if the step is not possible. *)
Definition apply (s : state) (e : event) : option state :=
  match e with
  | HearOwner place => option_map (fun m => with_owner s (hear_owned (owner s) m) (owner_motion s))
      (nth_error (radio s) place)
  | HearFollower place => option_map (fun m => with_follower s (hear_followed (follower s) m) (follower_motion s))
      (nth_error (radio s) place)
  | RenewOwner wish =>
      let m := advance (owner_motion s) in Some (with_owner s (renew (owner s) (now m) wish) m)
  | RenewFollower willing =>
      let m := advance (follower_motion s) in Some (with_follower s (decide (follower s) (now m) willing) m)
  | PassOwner => Some (with_owner s (owner s) (advance (owner_motion s)))
  | PassFollower => Some (with_follower s (follower s) (advance (follower_motion s)))
  | CommandOwner segment =>
      if forallb (fun d => inside_owner d segment) (owner_planes (owner s))
      then Some (with_owner s (owner s) (command (owner_motion s) segment)) else None
  | CommandFollower segment =>
      if forallb (fun d => inside_follower d segment) (follower_planes (follower s))
      then Some (with_follower s (follower s) (command (follower_motion s) segment)) else None
  | SendOwner stamp => Some (with_message s (owner_message stamp (owner s)))
  | SendFollower stamp => Some (with_message s (follower_message stamp (follower s)))
  end.

Fixpoint run (s : state) (events : list event) : option state :=
  match events with
  | [] => Some s
  | e :: rest => match apply s e with Some s => run s rest | None => None end
  end.

(** A start of both vehicles: each one computes the first plane from the starts that it holds (`Contracts::new`). The
    radio may already hold messages that belong to other starts, such as those of an earlier flight. *)
Definition starts (owner_facts follower_facts : Facts) (s : state) : Prop :=
  exists d e,
    divider_of_starts owner_facts = Some d /\ divider_of_starts follower_facts = Some e /\
    owner s = owned_at_start owner_facts d /\ follower s = followed_at_start follower_facts e /\
    owner_motion s = {| now := owner_start owner_facts; next := owner_start owner_facts |} /\
    follower_motion s = {| now := follower_start follower_facts; next := follower_start follower_facts |} /\
    forall m, In m (radio s) -> m_starts m <> hash owner_facts /\ m_starts m <> hash follower_facts.

Definition reachable (owner_facts follower_facts : Facts) (s : state) : Prop :=
  exists s0 events, starts owner_facts follower_facts s0 /\ run s0 events = Some s.

(** Owner and follower hold a common plane. *)
Definition have_common_plane (s : state) : Prop :=
  exists d, In d (owner_planes (owner s)) /\ In d (follower_planes (follower s)).

End Rules.

(** ** Invariant *)

(** A proposal that may still arrive was decided, or is the pending one. *)
Definition proposal_fits (o : owned) (f : followed) (p : proposal) : Prop :=
  p_number p <= d_number (f_decided f) \/ (p_number p = o_number o /\ o_pending o = Some (p_divider p)).

(** A decision that may still arrive is not newer than the last one, and equal to it if it has the same number. *)
Definition decision_fits (f : followed) (q : decision) : Prop :=
  d_number q <= d_number (f_decided f) /\
  (d_number q = d_number (f_decided f) -> d_accepted q = d_accepted (f_decided f)).

Definition message_fits (h : nat) (o : owned) (f : followed) (m : message) : Prop :=
  m_starts m = h ->
  match m_body m with
  | OwnerBody (Some p) => proposal_fits o f p
  | FollowerBody (Some q) => decision_fits f q
  | _ => True
  end.

(** Planes and numbers of the two vehicles. *)
Definition planes_fit (o : owned) (f : followed) : Prop :=
  match o_pending o with
  | None => d_number (f_decided f) = o_number o /\ f_held f = o_held o
  | Some d =>
      (S (d_number (f_decided f)) = o_number o /\ f_held f = o_held o) \/
      (d_number (f_decided f) = o_number o /\ 0 < o_number o /\
       f_held f = if d_accepted (f_decided f) then d else o_held o)
  end.

(** Invariant of the contract. [h] is the hash of the starts that both vehicles hold. *)
Definition contract_holds (h : nat) (o : owned) (f : followed) (messages : list message) : Prop :=
  o_hash o = h /\ f_hash f = h /\ planes_fit o f /\
  (d_number (o_decision o) = 0 \/ decision_fits f (o_decision o)) /\
  (forall p, f_proposal f = Some p -> proposal_fits o f p) /\
  (forall m, In m messages -> message_fits h o f m).

(** Invariant of the motion of a vehicle: all planes contain both segments. *)
Definition motion_holds (inside : Divider -> Segment -> bool) (planes : list Divider) (m : motion) : Prop :=
  forall d, In d planes -> inside d (now m) = true /\ inside d (next m) = true.

(** The whole invariant. *)
Definition invariant (h : nat) (s : state) : Prop :=
  contract_holds h (owner s) (follower s) (radio s) /\
  motion_holds inside_owner (owner_planes (owner s)) (owner_motion s) /\
  motion_holds inside_follower (follower_planes (follower s)) (follower_motion s).

Lemma compare_reads : forall own a m b,
  compare contract_rules own a m = (b, true) -> m_starts m = own.
Proof.
  unfold compare; simpl; intros own a m b.
  destruct (m_starts m =? own) eqn:E; simpl.
  - intros _. now apply Nat.eqb_eq.
  - discriminate.
Qed.

Lemma hear_owned_holds : forall h o f messages m,
  contract_holds h o f messages -> In m messages ->
  contract_holds h (hear_owned contract_rules o m) f messages.
Proof.
  intros h o f messages m (Ho & Hf & Hp & Hd & Hq & Hm) Hin. unfold hear_owned.
  specialize (Hm m Hin) as Hfits. unfold message_fits in Hfits.
  destruct (m_body m) as [p | q]; [exact (conj Ho (conj Hf (conj Hp (conj Hd (conj Hq Hm)))))|].
  destruct (compare contract_rules (o_hash o) (o_agreement o) m) as [a reads] eqn:C.
  destruct reads; simpl; [|exact (conj Ho (conj Hf (conj Hp (conj Hd (conj Hq Hm)))))].
  destruct (o_stamp o <? m_stamp m); [|exact (conj Ho (conj Hf (conj Hp (conj Hd (conj Hq Hm)))))].
  apply compare_reads in C. rewrite Ho in C. specialize (Hfits C).
  refine (conj Ho (conj Hf (conj Hp (conj _ (conj Hq Hm))))). simpl.
  destruct q; [right; exact Hfits | left; reflexivity].
Qed.

Lemma hear_followed_holds : forall h o f messages m,
  contract_holds h o f messages -> In m messages ->
  contract_holds h o (hear_followed contract_rules f m) messages.
Proof.
  intros h o f messages m (Ho & Hf & Hp & Hd & Hq & Hm) Hin. unfold hear_followed.
  specialize (Hm m Hin) as Hfits. unfold message_fits in Hfits.
  destruct (m_body m) as [p | q]; [|exact (conj Ho (conj Hf (conj Hp (conj Hd (conj Hq Hm)))))].
  destruct (compare contract_rules (f_hash f) (f_agreement f) m) as [a reads] eqn:C.
  destruct reads; simpl; [|exact (conj Ho (conj Hf (conj Hp (conj Hd (conj Hq Hm)))))].
  destruct (f_stamp f <? m_stamp m); [|exact (conj Ho (conj Hf (conj Hp (conj Hd (conj Hq Hm)))))].
  apply compare_reads in C. rewrite Hf in C. specialize (Hfits C).
  refine (conj Ho (conj Hf (conj Hp (conj Hd (conj _ Hm))))). simpl.
  intros p0 E. subst p. exact Hfits.
Qed.

Lemma take_decision_holds : forall h o f messages,
  contract_holds h o f messages -> contract_holds h (take_decision contract_rules o) f messages.
Proof.
  intros h o f messages H. pose proof H as (Ho & Hf & Hp & Hd & Hq & Hm). unfold take_decision.
  destruct (o_pending o) as [d|] eqn:P; [|exact H]. simpl.
  destruct (d_number (o_decision o) =? o_number o) eqn:N; [|exact H].
  apply Nat.eqb_eq in N.
  unfold planes_fit in Hp. rewrite P in Hp.
  assert (Decided : d_number (f_decided f) = o_number o /\
    d_accepted (o_decision o) = d_accepted (f_decided f) /\
    f_held f = if d_accepted (f_decided f) then d else o_held o).
  { destruct Hp as [[E F] | (E & F & G)], Hd as [Z | [L A]]; try lia.
    repeat split; auto. apply A. lia. }
  destruct Decided as (E & A & G).
  assert (Fits : forall p, proposal_fits o f p -> p_number p <= d_number (f_decided f)).
  { intros p [L | [L _]]; lia. }
  refine (conj Ho (conj Hf (conj (conj E _) (conj Hd (conj _ _))))); simpl.
  - now rewrite A.
  - intros p Hp'. left. auto.
  - intros m Hin. specialize (Hm m Hin). unfold message_fits in *. intros S. specialize (Hm S).
    destruct (m_body m) as [[p|] | q]; auto. left. auto.
Qed.

Lemma propose_holds : forall h o f messages segment wish,
  contract_holds h o f messages -> contract_holds h (propose contract_rules o segment wish) f messages.
Proof.
  intros h o f messages segment wish H. pose proof H as (Ho & Hf & Hp & Hd & Hq & Hm). unfold propose.
  destruct wish as [d|]; [|exact H]. destruct (inside_owner d segment); [|exact H].
  destruct (o_pending o) as [e|] eqn:P; simpl; [exact H|].
  unfold planes_fit in Hp. rewrite P in Hp. destruct Hp as [N E].
  assert (Fits : forall p, proposal_fits o f p -> p_number p <= d_number (f_decided f)).
  { intros p [L | [_ L]]; [lia | congruence]. }
  refine (conj Ho (conj Hf (conj _ (conj Hd (conj _ _))))); simpl.
  - left. simpl. auto.
  - intros p Hp'. left. auto.
  - intros m Hin. specialize (Hm m Hin). unfold message_fits in *. intros S. specialize (Hm S).
    destruct (m_body m) as [[p|] | q]; auto. left. auto.
Qed.

Lemma renew_holds : forall h o f messages segment wish,
  contract_holds h o f messages -> contract_holds h (renew contract_rules o segment wish) f messages.
Proof.
  intros h o f messages segment wish H. unfold renew.
  destruct (is_void (o_agreement o)); [exact H|]. apply propose_holds, take_decision_holds, H.
Qed.

Lemma decide_holds : forall h o f messages segment willing,
  contract_holds h o f messages -> contract_holds h o (decide contract_rules f segment willing) messages.
Proof.
  intros h o f messages segment willing H. pose proof H as (Ho & Hf & Hp & Hd & Hq & Hm). unfold decide.
  destruct (f_proposal f) as [p|] eqn:F; [|exact H].
  destruct (is_void (f_agreement f)); simpl; [exact H|].
  destruct (p_number p <=? d_number (f_decided f)) eqn:L; [exact H|].
  apply Nat.leb_gt in L.
  destruct (Hq p eq_refl) as [X | [N P]]; [lia|].
  unfold planes_fit in Hp. rewrite P in Hp. destruct Hp as [[E G] | (E & _)]; [|lia].
  assert (Fits : forall q, proposal_fits o f q ->
    p_number q <= p_number p).
  { intros q [X | [X _]]; lia. }
  assert (Decision : forall q, decision_fits f q -> d_number q < p_number p).
  { intros q [X _]. lia. }
  refine (conj Ho (conj Hf (conj _ (conj _ (conj _ _))))); unfold planes_fit; rewrite ?P; simpl.
  - right. repeat split; try lia. now rewrite G.
  - destruct Hd as [Z | Hd]; [now left|]. right. specialize (Decision _ Hd). split; simpl; intros; lia.
  - intros p0 H0. left. auto.
  - intros m Hin. specialize (Hm m Hin). unfold message_fits in *. intros S. specialize (Hm S).
    destruct (m_body m) as [[q|] | [q|]]; auto.
    + left. simpl. auto.
    + specialize (Decision _ Hm). split; simpl; intros; lia.
Qed.

(** The fields of a contract from which messages are made. *)
Definition same_owned (o o' : owned) : Prop :=
  o_hash o = o_hash o' /\ o_number o = o_number o' /\ o_held o = o_held o' /\ o_pending o = o_pending o'.

Definition same_followed (f f' : followed) : Prop :=
  f_hash f = f_hash f' /\ f_held f = f_held f' /\ f_decided f = f_decided f'.

Lemma owner_message_holds : forall h o o' f messages stamp,
  contract_holds h o f messages -> same_owned o o' ->
  contract_holds h o f (messages ++ [owner_message stamp o']).
Proof.
  intros h o o' f messages stamp (Ho & Hf & Hp & Hd & Hq & Hm) (S1 & S2 & S3 & S4).
  refine (conj Ho (conj Hf (conj Hp (conj Hd (conj Hq _))))).
  intros m Hin. apply in_app_or in Hin. destruct Hin as [Hin | [Hin | []]]; auto.
  subst m. intros _. simpl. destruct (o_pending o') as [d|]; auto.
  destruct (is_void (o_agreement o')); auto. right. auto.
Qed.

Lemma follower_message_holds : forall h o f f' messages stamp,
  contract_holds h o f messages -> same_followed f f' ->
  contract_holds h o f (messages ++ [follower_message stamp f']).
Proof.
  intros h o f f' messages stamp (Ho & Hf & Hp & Hd & Hq & Hm) (S1 & S2 & S3).
  refine (conj Ho (conj Hf (conj Hp (conj Hd (conj Hq _))))).
  intros m Hin. apply in_app_or in Hin. destruct Hin as [Hin | [Hin | []]]; auto.
  subst m. intros _. simpl. destruct (0 <? d_number (f_decided f')); auto.
  rewrite <- S3. split; auto.
Qed.

Lemma advance_holds : forall inside planes m,
  motion_holds inside planes m -> motion_holds inside planes (advance m).
Proof. intros inside planes m H d Hin. destruct (H d Hin). auto. Qed.

Lemma command_holds : forall inside planes m segment,
  motion_holds inside planes m -> forallb (fun d => inside d segment) planes = true ->
  motion_holds inside planes (command m segment).
Proof.
  intros inside planes m segment H A d Hin. rewrite forallb_forall in A. destruct (H d Hin). simpl. auto.
Qed.

Lemma renew_keeps_motion : forall o wish m,
  motion_holds inside_owner (owner_planes o) m -> now m = next m ->
  motion_holds inside_owner (owner_planes (renew contract_rules o (now m) wish)) m.
Proof.
  intros o wish m H E. unfold renew. destruct (is_void (o_agreement o)); auto.
  assert (T : motion_holds inside_owner (owner_planes (take_decision contract_rules o)) m).
  { unfold take_decision. destruct (o_pending o) as [d|] eqn:P; auto. simpl.
    destruct (d_number (o_decision o) =? o_number o); auto.
    intros e [<- | []]. apply H. unfold owner_planes. rewrite P.
    destruct (d_accepted (o_decision o)); simpl; auto. }
  revert T. generalize (take_decision contract_rules o) as t. intros t T. unfold propose.
  destruct wish as [d|]; auto. destruct (inside_owner d (now m)) eqn:I; auto. simpl.
  destruct (o_pending t) as [e|] eqn:P; simpl; auto.
  intros e [<- | [<- | []]].
  - apply T. unfold owner_planes. now left.
  - rewrite <- E. auto.
Qed.

Lemma decide_keeps_motion : forall f m willing,
  motion_holds inside_follower (follower_planes f) m -> now m = next m ->
  motion_holds inside_follower (follower_planes (decide contract_rules f (now m) willing)) m.
Proof.
  intros f m willing H E. unfold decide. destruct (f_proposal f) as [p|]; auto.
  destruct (is_void (f_agreement f) || _); auto. simpl.
  intros d [<- | []]. destruct willing; simpl.
  - destruct (inside_follower (p_divider p) (now m)) eqn:I.
    + rewrite <- E. auto.
    + apply H. now left.
  - apply H. now left.
Qed.

Lemma owner_planes_of_hear : forall r o m, owner_planes (hear_owned r o m) = owner_planes o.
Proof.
  intros. unfold hear_owned. destruct (m_body m); auto. destruct (compare _ _ _ _). destruct (_ && _); auto.
Qed.

Lemma follower_planes_of_hear : forall r f m, follower_planes (hear_followed r f m) = follower_planes f.
Proof.
  intros. unfold hear_followed. destruct (m_body m); auto. destruct (compare _ _ _ _). destruct (_ && _); auto.
Qed.

(** Splits a step with a condition. *)
Tactic Notation "destruct_if" hyp(A) ident(I) := match type of A with
  (if ?b then _ else _) = _ => destruct b eqn:I; [|discriminate A]
end.

(** The invariant holds at the start. Both vehicles must hold the same starts. *)
Theorem invariant_at_start : forall facts s, starts facts facts s -> invariant (hash facts) s.
Proof.
  intros facts s (d & e & Hd & He & Ho & Hf & Mo & Mf & Hr).
  rewrite Hd in He. injection He as <-. unfold divider_of_starts in Hd.
  destruct (between facts) as [g|]; [|discriminate].
  destruct (inside_owner g (owner_start facts)) eqn:A; [|discriminate].
  destruct (inside_follower g (follower_start facts)) eqn:B; [|discriminate].
  injection Hd as <-. unfold invariant. rewrite Ho, Hf, Mo, Mf.
  split; [|split].
  - unfold contract_holds, planes_fit; simpl. repeat split; auto; try (intros; discriminate).
    intros m Hin E. destruct (Hr m Hin). contradiction.
  - intros x [<- | []]. auto.
  - intros x [<- | []]. auto.
Qed.

(** Each step of each vehicle keeps the invariant: it is inductive. *)
Theorem invariant_is_inductive : forall h s e s',
  invariant h s -> apply contract_rules s e = Some s' -> invariant h s'.
Proof.
  intros h s e s' (C & O & F) A. destruct e; simpl in A.
  - destruct (nth_error (radio s) place) as [m|] eqn:N; [|discriminate]. injection A as <-.
    apply nth_error_In in N. split; [|split]; simpl; rewrite ?owner_planes_of_hear; auto.
    apply hear_owned_holds; auto.
  - destruct (nth_error (radio s) place) as [m|] eqn:N; [|discriminate]. injection A as <-.
    apply nth_error_In in N. split; [|split]; simpl; rewrite ?follower_planes_of_hear; auto.
    apply hear_followed_holds; auto.
  - injection A as <-. split; [|split]; auto; [apply renew_holds; auto|].
    apply (renew_keeps_motion _ _ (advance (owner_motion s))); auto. now apply advance_holds.
  - injection A as <-. split; [|split]; auto; [apply decide_holds; auto|].
    apply (decide_keeps_motion _ (advance (follower_motion s))); auto. now apply advance_holds.
  - injection A as <-. split; [|split]; auto. now apply advance_holds.
  - injection A as <-. split; [|split]; auto. now apply advance_holds.
  - destruct_if A Inside. injection A as <-.
    split; [|split]; auto. now apply command_holds.
  - destruct_if A Inside. injection A as <-.
    split; [|split]; auto. now apply command_holds.
  - injection A as <-. split; [|split]; auto. apply owner_message_holds; auto. repeat split.
  - injection A as <-. split; [|split]; auto. apply follower_message_holds; auto. repeat split.
Qed.

Theorem invariant_is_reachable : forall facts s,
  reachable contract_rules facts facts s -> invariant (hash facts) s.
Proof.
  intros facts s (s0 & events & Start & Run). apply invariant_at_start in Start.
  revert s0 Start Run. induction events as [|e rest IH]; simpl; intros s0 Start Run.
  - injection Run as <-. exact Start.
  - destruct (apply contract_rules s0 e) as [s1|] eqn:A; [|discriminate].
    apply (IH s1); auto. eapply invariant_is_inductive; eauto.
Qed.

(** ** Statements *)

Lemma invariant_has_common_plane : forall h s, invariant h s -> have_common_plane s.
Proof.
  intros h s ((_ & _ & P & _) & _).
  exists (f_held (follower s)). split; [|now left].
  unfold planes_fit in P. unfold owner_planes. destruct (o_pending (owner s)) as [d|].
  - destruct P as [[_ ->] | (_ & _ & ->)]; [now left|]. destruct (d_accepted _); simpl; auto.
  - destruct P as [_ ->]. now left.
Qed.

(** Lemma 3. If both vehicles hold the same starts, they hold a common plane at every time. *)
Theorem common_plane : forall facts s,
  reachable contract_rules facts facts s -> have_common_plane s.
Proof. intros facts s R. eapply invariant_has_common_plane, invariant_is_reachable, R. Qed.

(** Lemma 2. At every time all planes of both vehicles contain the segments of their periods. *)
Theorem segments_are_inside : forall facts s,
  reachable contract_rules facts facts s ->
  motion_holds inside_owner (owner_planes (owner s)) (owner_motion s) /\
  motion_holds inside_follower (follower_planes (follower s)) (follower_motion s).
Proof. intros facts s R. apply invariant_is_reachable in R. destruct R as (_ & O & F). auto. Qed.

(** Lemma 2. At every time the own segment is a possible next segment. The brake leads to a part of it. *)
Theorem brake_is_a_choice : forall facts s,
  reachable contract_rules facts facts s ->
  apply contract_rules s (CommandOwner (now (owner_motion s))) <> None /\
  apply contract_rules s (CommandFollower (now (follower_motion s))) <> None.
Proof.
  intros facts s R. apply segments_are_inside in R. destruct R as [O F]. simpl.
  assert (forall inside planes m, motion_holds inside planes m ->
    forallb (fun d => inside d (now m)) planes = true) as All.
  { intros inside planes m H. apply forallb_forall. intros d Hin. now apply H. }
  apply All in O, F. unfold follower_planes in F. simpl in O, F. rewrite O, F. split; discriminate.
Qed.

(** State of two vehicles that hold different starts [a] and [b], and the planes [d] and [e] of these starts. *)
Definition unread (a b : Facts) (d e : Divider) (s : state) : Prop :=
  (o_hash (owner s) = hash a /\ f_hash (follower s) = hash b) /\
  (forall m, In m (radio s) ->
    match m_body m with OwnerBody _ => m_starts m <> hash b | FollowerBody _ => m_starts m <> hash a end) /\
  (o_agreement (owner s) <> Same /\ o_held (owner s) = d /\ o_decision (owner s) = no_decision /\
   (o_pending (owner s) <> None -> 0 < o_number (owner s))) /\
  (f_agreement (follower s) <> Same /\ f_held (follower s) = e /\ f_proposal (follower s) = None /\
   f_decided (follower s) = no_decision).

Lemma unread_is_inductive : forall a b d e s v s',
  hash a <> hash b -> unread a b d e s -> apply contract_rules s v = Some s' -> unread a b d e s'.
Proof.
  intros a b d e s v s' Ne U A.
  pose proof U as ((Ha & Hb) & Hm & (O1 & O2 & O3 & O4) & F1 & F2 & F3 & F4).
  destruct v; simpl in A.
  - destruct (nth_error (radio s) place) as [m|] eqn:N; [|discriminate]. injection A as <-.
    apply nth_error_In in N. specialize (Hm m N). unfold unread, with_owner, hear_owned, compare. simpl.
    destruct (m_body m); [exact U|]. rewrite Ha. apply Nat.eqb_neq in Hm. rewrite Hm. simpl.
    apply Nat.eqb_neq in Hm. repeat split; auto; try (intros; discriminate); try apply U.
  - destruct (nth_error (radio s) place) as [m|] eqn:N; [|discriminate]. injection A as <-.
    apply nth_error_In in N. specialize (Hm m N). unfold unread, with_follower, hear_followed, compare. simpl.
    destruct (m_body m); [|exact U]. rewrite Hb. apply Nat.eqb_neq in Hm. rewrite Hm. simpl.
    apply Nat.eqb_neq in Hm. repeat split; auto; try (intros; discriminate); try apply U.
  - injection A as <-. unfold unread. simpl. unfold renew. destruct (is_void _); [exact U|].
    unfold take_decision. rewrite O3. simpl.
    assert (E : match o_pending (owner s) with Some _ => match o_number (owner s) with 0 => false | S _ => true end
      | None => true end = true).
    { destruct (o_pending (owner s)); auto. destruct (o_number (owner s)); auto.
      exfalso. assert (0 < 0) by (apply O4; discriminate). lia. }
    set (t := match o_pending (owner s) with Some _ => _ | None => _ end).
    assert (T : t = owner s).
    { unfold t. destruct (o_pending (owner s)); auto. destruct (o_number (owner s)); [discriminate|auto]. }
    rewrite T. unfold propose. destruct wish as [g|]; [|exact U].
    destruct (inside_owner g _ && _); [|exact U]. simpl.
    repeat split; auto; try lia; try apply U.
  - injection A as <-. unfold unread. simpl. unfold decide. rewrite F3. exact U.
  - injection A as <-. exact U.
  - injection A as <-. exact U.
  - destruct_if A Inside. injection A as <-. exact U.
  - destruct_if A Inside. injection A as <-. exact U.
  - injection A as <-. unfold unread. simpl. split; [auto|split; [|auto]].
    intros m Hin. apply in_app_or in Hin. destruct Hin as [Hin | [<- | []]]; [now apply Hm|]. simpl. congruence.
  - injection A as <-. unfold unread. simpl. split; [auto|split; [|auto]].
    intros m Hin. apply in_app_or in Hin. destruct Hin as [Hin | [<- | []]]; [now apply Hm|]. simpl. congruence.
Qed.

(** A vehicle that holds other starts than its partner reads no message of it. Each of the two stays behind its first
    plane. The model takes a hash that differs for different starts; the code cuts SHA-256 to 64 bits. *)
Theorem other_starts_are_not_read : forall a b s,
  (forall x y, hash x = hash y -> x = y) -> a <> b ->
  reachable contract_rules a b s ->
  exists d e,
    divider_of_starts a = Some d /\ divider_of_starts b = Some e /\
    (o_agreement (owner s) <> Same /\ o_held (owner s) = d /\ o_decision (owner s) = no_decision) /\
    (f_agreement (follower s) <> Same /\ f_held (follower s) = e /\ f_proposal (follower s) = None /\
     f_decided (follower s) = no_decision).
Proof.
  intros a b s Injective Differ (s0 & events & (d & e & Hd & He & Ho & Hf & _ & _ & Hr) & Run).
  assert (Ne : hash a <> hash b) by (intros E; apply Differ, Injective, E).
  assert (U : unread a b d e s0).
  { unfold unread. rewrite Ho, Hf. simpl. repeat split; auto; try congruence.
    intros m Hin. destruct (Hr m Hin). destruct (m_body m); auto. }
  assert (T : unread a b d e s).
  { clear - Ne U Run. revert s0 U Run. induction events as [|v rest IH]; simpl; intros s0 U Run.
    - injection Run as <-. exact U.
    - destruct (apply contract_rules s0 v) as [s1|] eqn:A; [|discriminate].
      apply (IH s1); auto. eapply unread_is_inductive; eauto. }
  exists d, e. destruct T as (_ & _ & O & F). repeat split; auto; apply O || apply F.
Qed.

(** A message with another hash voids the contract, and then no message is read. *)
Theorem another_hash_voids_for_ever : forall o m n,
  (exists q, m_body m = FollowerBody q) -> m_starts m <> o_hash o ->
  let void := hear_owned contract_rules o m in
  o_agreement void = Void /\ owner_planes void = owner_planes o /\ hear_owned contract_rules void n = void /\
  forall segment wish, renew contract_rules void segment wish = void.
Proof.
  intros o m n [q Q] Ne. cbv zeta.
  assert (E : hear_owned contract_rules o m = {|
    o_hash := o_hash o; o_agreement := Void; o_stamp := o_stamp o; o_decision := o_decision o;
    o_held := o_held o; o_number := o_number o; o_pending := o_pending o |}).
  { unfold hear_owned, compare. rewrite Q. apply Nat.eqb_neq in Ne. simpl. rewrite Ne. reflexivity. }
  rewrite E. repeat split.
  unfold hear_owned, compare. simpl. destruct (m_body n); auto. destruct (negb _); auto.
Qed.

End Contract.

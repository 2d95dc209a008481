(** * Replay of a contract log

    [tautline run --contract-log FILE] writes each event of the contracts of a flight. [step] takes one event to all
    pairs, and refuses it if the transition system of [contract] forbids it. [replay_is_sound]: each pair of an accepted
    log is in a state that the transition system reaches. So its theorems hold for this flight, at each event.

    All lengths are integers: multiples of 1 / [one] metres. Each finite double is an integer for [one] = 2^1074. So
    the test whether a plane contains a segment is exact. *)

From Coq Require Import ZArith Arith Bool List Lia.
From Proofs Require Import contract.
Import ListNotations.

Arguments o_hash {_}. Arguments o_agreement {_}. Arguments o_decision {_}. Arguments o_held {_}.
Arguments o_number {_}. Arguments o_pending {_}. Arguments f_hash {_}. Arguments f_agreement {_}.
Arguments f_proposal {_}. Arguments f_held {_}. Arguments f_decided {_}. Arguments p_number {_}.
Arguments p_divider {_}. Arguments m_stamp {_}. Arguments m_starts {_}. Arguments m_body {_}.
Arguments now {_}. Arguments next {_}. Arguments owner {_ _}. Arguments follower {_ _}. Arguments radio {_ _}.
Arguments owner_motion {_ _}. Arguments follower_motion {_ _}. Arguments owner_planes {_}.
Arguments follower_planes {_}. Arguments OwnerBody {_}. Arguments FollowerBody {_}.

(** ** Numbers of a log *)

(** Point, in units of 1 / [one] metres. *)
Record point := { p_x : Z; p_y : Z; p_z : Z }.

(** `plane::Segment`. *)
Record segment := { s_begin : point; s_stop : point }.

(** `plane::Divider`: its normal, which has the length [one] up to rounding, and its offset. *)
Record divider := { d_x : Z; d_y : Z; d_z : Z; d_offset : Z }.

(** Announced start of a vehicle: its segment and its margin. *)
Record start := { s_segment : segment; s_margin : Z }.

(** What both vehicles of a pair hold at the start: the two starts, the first plane, and the hash of the starts. *)
Record facts := { owner_start : start; follower_start : start; first_plane : divider; starts_hash : nat }.

Definition owner_segment (f : facts) : segment := s_segment (owner_start f).
Definition follower_segment (f : facts) : segment := s_segment (follower_start f).
Definition between (f : facts) : option divider := Some (first_plane f).

Definition point_eqb (a b : point) : bool := (p_x a =? p_x b)%Z && (p_y a =? p_y b)%Z && (p_z a =? p_z b)%Z.
Definition segment_eqb (a b : segment) : bool := point_eqb (s_begin a) (s_begin b) && point_eqb (s_stop a) (s_stop b).
Definition divider_eqb (a b : divider) : bool :=
  (d_x a =? d_x b)%Z && (d_y a =? d_y b)%Z && (d_z a =? d_z b)%Z && (d_offset a =? d_offset b)%Z.

Lemma divider_eqb_eq : forall a b, divider_eqb a b = true -> a = b.
Proof.
  intros [a b c d] [a' b' c' d'] H. unfold divider_eqb in H. simpl in H.
  rewrite !andb_true_iff, !Z.eqb_eq in H. destruct H as (((-> & ->) & ->) & ->). reflexivity.
Qed.

(** ** Events of a log *)

(** Content of a message, as in `contract::Body`: a proposal, or the sender's segment and its last decision. *)
Inductive content := OfOwner (p : option (proposal divider)) | OfFollower (s : segment) (q : option decision).

(** One line of a log. Vehicles are numbers from 0. *)
Inductive entry :=
  (** An instant of a vehicle, with the number of its period. *)
  | Instant (vehicle period : nat)
  (** The owner takes the decision on its pending proposal: it drops one of its two planes. *)
  | Take (owner follower number : nat) (accepted : bool)
  (** The owner proposes a plane, and holds it beside the other one. *)
  | Propose (owner follower number : nat) (plane : divider)
  (** The follower decides. If it accepts, it takes the new plane and drops the old one. *)
  | Decide (follower owner number : nat) (accepted : bool)
  (** The vehicle reserves a segment from its next instant on. *)
  | Reserve (vehicle : nat) (s : segment)
  | Send (from to stamp hash : nat) (c : content)
  | Hear (to from stamp hash : nat) (c : content)
  (** At the end: the planes that a vehicle holds towards another one. *)
  | Hold (vehicle other : nat) (planes : list divider).

(** Reason why an event is forbidden. *)
Inductive reason :=
  | UnknownVehicle | AfterEnd | WrongPeriod | NotAtInstant | NotReserved | NothingPending | NotHeard | OtherDecision
  | StillPending | PlaneOutside | WrongNumber | NoProposal | DecidedBefore | ContractIsVoid | SegmentOutside
  | SentBefore | WrongStamp | WrongHash | WrongContent | NeverSent | OtherPlanes.

Inductive result (A : Type) := Accepted (a : A) | Forbidden (why : reason).
Arguments Accepted {_}. Arguments Forbidden {_}.

Definition require {A} (condition : bool) (why : reason) (otherwise : result A) : result A :=
  if condition then otherwise else Forbidden why.

(** ** Pairs *)

Notation owned := (contract.owned divider).
Notation followed := (contract.followed divider).
Notation motion := (contract.motion segment).
Notation message := (contract.message divider).
Notation state := (contract.state divider segment).

(** A vehicle within a pair: its period, whether it is between an instant and its command, whether it has sent a message
    since, and whether its planes at the end were compared. *)
Record clock := { period : nat; looks : bool; sends : bool; ended : bool }.

(** State of a pair. [sent] holds the messages sent so far, the newest first, each with the segment of a follower. *)
Record pair := {
  owner_index : nat;
  follower_index : nat;
  pair_facts : facts;
  pair_owner : owned;
  pair_owner_motion : motion;
  owner_clock : clock;
  pair_follower : followed;
  pair_follower_motion : motion;
  follower_clock : clock;
  sent : list (message * option segment) }.

Definition with_pair_owner (p : pair) (o : owned) (m : motion) (c : clock) : pair := {|
  owner_index := owner_index p; follower_index := follower_index p; pair_facts := pair_facts p;
  pair_owner := o; pair_owner_motion := m; owner_clock := c;
  pair_follower := pair_follower p; pair_follower_motion := pair_follower_motion p;
  follower_clock := follower_clock p; sent := sent p |}.

Definition with_pair_follower (p : pair) (f : followed) (m : motion) (c : clock) : pair := {|
  owner_index := owner_index p; follower_index := follower_index p; pair_facts := pair_facts p;
  pair_owner := pair_owner p; pair_owner_motion := pair_owner_motion p; owner_clock := owner_clock p;
  pair_follower := f; pair_follower_motion := m; follower_clock := c; sent := sent p |}.

Definition with_sent (p : pair) (m : message) (s : option segment) : pair := {|
  owner_index := owner_index p; follower_index := follower_index p; pair_facts := pair_facts p;
  pair_owner := pair_owner p; pair_owner_motion := pair_owner_motion p; owner_clock := owner_clock p;
  pair_follower := pair_follower p; pair_follower_motion := pair_follower_motion p;
  follower_clock := follower_clock p; sent := (m, s) :: sent p |}.

Definition body_of (c : content) : body divider :=
  match c with OfOwner p => OwnerBody p | OfFollower _ q => FollowerBody q end.
Definition segment_of (c : content) : option segment := match c with OfOwner _ => None | OfFollower s _ => Some s end.

Definition message_of (stamp hash : nat) (c : content) : message :=
  {| m_stamp := stamp; m_starts := hash; m_body := body_of c |}.

Definition body_eqb (a b : body divider) : bool :=
  match a, b with
  | OwnerBody None, OwnerBody None | FollowerBody None, FollowerBody None => true
  | OwnerBody (Some p), OwnerBody (Some q) => (p_number p =? p_number q) && divider_eqb (p_divider p) (p_divider q)
  | FollowerBody (Some p), FollowerBody (Some q) =>
      (d_number p =? d_number q) && Bool.eqb (d_accepted p) (d_accepted q)
  | _, _ => false
  end.

Definition message_eqb (a b : message) : bool :=
  (m_stamp a =? m_stamp b) && (m_starts a =? m_starts b) && body_eqb (m_body a) (m_body b).

Definition option_segment_eqb (a b : option segment) : bool :=
  match a, b with Some a, Some b => segment_eqb a b | None, None => true | _, _ => false end.

Lemma body_eqb_eq : forall a b, body_eqb a b = true -> a = b.
Proof.
  intros [[[n d]|] | [[n v]|]] [[[n' d']|] | [[n' v']|]] H; simpl in H; try discriminate; auto;
    apply andb_prop in H; destruct H as [N D]; apply Nat.eqb_eq in N; subst n'.
  - apply divider_eqb_eq in D. now subst d'.
  - apply eqb_prop in D. now subst v'.
Qed.

Lemma message_eqb_eq : forall a b, message_eqb a b = true -> a = b.
Proof.
  intros [s h b] [s' h' b'] H. unfold message_eqb in H. simpl in H. rewrite !andb_true_iff, !Nat.eqb_eq in H.
  destruct H as ((-> & ->) & B). apply body_eqb_eq in B. now subst b'.
Qed.

Definition is_pending (o : owned) : bool := match o_pending o with Some _ => true | None => false end.

Section Replay.

(** Number of units in a metre. *)
Variable one : Z.
(** Factor of vertical lengths, times [one]: `plane::Metric`. *)
Variable vertical : Z.

(** Part of each margin that is left out, 2^-21 m. The margin of 5e-7 m for rounding in the margin of each vehicle is
    larger. *)
Definition slack : Z := Z.div one 2097152.

(** ** Geometry *)

(** Extent of a point along the normal of a divider in scaled lengths, times [one]^3. *)
Definition extent (d : divider) (p : point) : Z :=
  ((d_x d * p_x p + d_y d * p_y p) * one + d_z d * vertical * p_z p)%Z.

(** Bound on twice the margin times the length of the normal, times [one]^3. A length l is at most (1 + l^2) / 2. *)
Definition bound (d : divider) (margin : Z) : Z :=
  ((margin - slack) * (one * one + (d_x d * d_x d + d_y d * d_y d + d_z d * d_z d)))%Z.

(** `Divider::owner_plane(...).contains(...)`, computed exactly with a margin that is smaller by [slack]. *)
Definition inside_owner (margin : Z) (d : divider) (s : segment) : bool :=
  let b := bound d margin in
  let offset := (d_offset d * (one * one))%Z in
  (b <=? 2 * (offset - extent d (s_begin s)))%Z && (b <=? 2 * (offset - extent d (s_stop s)))%Z.

(** `Divider::follower_plane(...).contains(...)`, computed like [inside_owner]. *)
Definition inside_follower (margin : Z) (d : divider) (s : segment) : bool :=
  let b := bound d margin in
  let offset := (d_offset d * (one * one))%Z in
  (b <=? 2 * (extent d (s_begin s) - offset))%Z && (b <=? 2 * (extent d (s_stop s) - offset))%Z.

Definition owner_contains (f : facts) : divider -> segment -> bool := inside_owner (s_margin (owner_start f)).
Definition follower_contains (f : facts) : divider -> segment -> bool :=
  inside_follower (s_margin (follower_start f)).

(** ** Steps of a pair *)

(** Whether an entry is about a vehicle of a pair. *)
Definition concerns (e : entry) (p : pair) : bool :=
  match e with
  | Instant v _ | Reserve v _ => (v =? owner_index p) || (v =? follower_index p)
  | Take a b _ _ | Propose a b _ _ | Decide b a _ _ => (a =? owner_index p) && (b =? follower_index p)
  | Send a b _ _ _ | Hear a b _ _ _ | Hold a b _ =>
      (a =? owner_index p) && (b =? follower_index p) || (b =? owner_index p) && (a =? follower_index p)
  end.

Definition begin_instant (c : clock) (k : nat) : result clock :=
  require (negb (ended c)) AfterEnd
    (require (negb (looks c)) NotReserved
      (require (k =? S (period c)) WrongPeriod
        (Accepted {| period := k; looks := true; sends := false; ended := false |}))).

Definition end_instant (c : clock) : clock := {| period := period c; looks := false; sends := false; ended := false |}.
Definition end_sending (c : clock) : clock := {| period := period c; looks := false; sends := true; ended := false |}.
Definition end_log (c : clock) : clock := {| period := period c; looks := false; sends := true; ended := true |}.

Definition at_instant {A} (c : clock) (otherwise : result A) : result A :=
  require (negb (ended c)) AfterEnd (require (looks c) NotAtInstant otherwise).

Definition after_command {A} (c : clock) (otherwise : result A) : result A :=
  require (negb (ended c)) AfterEnd (require (negb (looks c)) NotReserved otherwise).

Definition bind {A B} (a : result A) (f : A -> result B) : result B :=
  match a with Accepted a => f a | Forbidden why => Forbidden why end.

Definition owner_renews (p : pair) (wish : option divider) : owned :=
  contract.renew divider segment (owner_contains (pair_facts p)) contract_rules (pair_owner p)
    (now (advance segment (pair_owner_motion p))) wish.

Definition follower_decides (p : pair) (willing : bool) : followed :=
  contract.decide divider segment (follower_contains (pair_facts p)) contract_rules (pair_follower p)
    (now (advance segment (pair_follower_motion p))) willing.

Fixpoint dividers_eqb (a b : list divider) : bool :=
  match a, b with
  | [], [] => true
  | a :: rest, b :: others => divider_eqb a b && dividers_eqb rest others
  | _, _ => false
  end.

(** Takes an entry that concerns a pair to this pair. *)
Definition feed (e : entry) (p : pair) : result pair :=
  let o := pair_owner p in
  let f := pair_follower p in
  match e with
  | Instant v k =>
      if v =? owner_index p then
        bind (begin_instant (owner_clock p) k) (fun c =>
          Accepted (with_pair_owner p o (advance segment (pair_owner_motion p)) c))
      else
        bind (begin_instant (follower_clock p) k) (fun c =>
          Accepted (with_pair_follower p f (advance segment (pair_follower_motion p)) c))
  | Take _ _ number accepted =>
      at_instant (owner_clock p)
        (require (negb (is_void (o_agreement o))) ContractIsVoid
          (require (is_pending o) NothingPending
            (require (o_number o =? number) WrongNumber
              (require (d_number (o_decision o) =? number) NotHeard
                (require (Bool.eqb (d_accepted (o_decision o)) accepted) OtherDecision
                  (Accepted (with_pair_owner p (owner_renews p None) (advance segment (pair_owner_motion p))
                    (owner_clock p))))))))
  | Propose _ _ number d =>
      let proposed := owner_renews p (Some d) in
      at_instant (owner_clock p)
        (require (negb (is_void (o_agreement o))) ContractIsVoid
          (require (negb (is_pending o)) StillPending
            (require (is_pending proposed) PlaneOutside
              (require (o_number proposed =? number) WrongNumber
                (Accepted (with_pair_owner p proposed (advance segment (pair_owner_motion p)) (owner_clock p)))))))
  | Decide _ _ number accepted =>
      let decided := follower_decides p accepted in
      at_instant (follower_clock p)
        (require (negb (is_void (f_agreement f))) ContractIsVoid
          (require (match f_proposal f with Some q => p_number q =? number | None => false end) NoProposal
            (require (d_number (f_decided f) <? number) DecidedBefore
              (require (Bool.eqb (d_accepted (f_decided decided)) accepted) PlaneOutside
                (Accepted (with_pair_follower p decided (advance segment (pair_follower_motion p))
                  (follower_clock p)))))))
  | Reserve v s =>
      if v =? owner_index p then
        at_instant (owner_clock p)
          (require (forallb (fun d => owner_contains (pair_facts p) d s) (owner_planes o)) SegmentOutside
            (Accepted (with_pair_owner p o (command segment (pair_owner_motion p) s) (end_instant (owner_clock p)))))
      else
        at_instant (follower_clock p)
          (require (forallb (fun d => follower_contains (pair_facts p) d s) (follower_planes f)) SegmentOutside
            (Accepted (with_pair_follower p f (command segment (pair_follower_motion p) s)
              (end_instant (follower_clock p)))))
  | Send from _ stamp hash c =>
      let m := message_of stamp hash c in
      if from =? owner_index p then
        after_command (owner_clock p)
          (require (negb (sends (owner_clock p))) SentBefore
            (require (stamp =? period (owner_clock p)) WrongStamp
              (require (hash =? o_hash o) WrongHash
                (require (message_eqb m (owner_message divider stamp o)) WrongContent
                  (Accepted (with_sent (with_pair_owner p o (pair_owner_motion p) (end_sending (owner_clock p)))
                    m (segment_of c)))))))
      else
        after_command (follower_clock p)
          (require (negb (sends (follower_clock p))) SentBefore
            (require (stamp =? period (follower_clock p)) WrongStamp
              (require (hash =? f_hash f) WrongHash
                (require (message_eqb m (follower_message divider stamp f)) WrongContent
                  (require (option_segment_eqb (segment_of c) (Some (next (pair_follower_motion p)))) WrongContent
                    (Accepted (with_sent
                      (with_pair_follower p f (pair_follower_motion p) (end_sending (follower_clock p)))
                      m (segment_of c))))))))
  | Hear to _ stamp hash c =>
      let m := message_of stamp hash c in
      require (existsb (fun old => message_eqb m (fst old) && option_segment_eqb (segment_of c) (snd old)) (sent p))
        NeverSent
        (if to =? owner_index p then
          require (negb (ended (owner_clock p))) AfterEnd
            (Accepted (with_pair_owner p (hear_owned divider contract_rules o m) (pair_owner_motion p)
              (owner_clock p)))
        else
          require (negb (ended (follower_clock p))) AfterEnd
            (Accepted (with_pair_follower p (hear_followed divider contract_rules f m) (pair_follower_motion p)
              (follower_clock p))))
  | Hold v _ planes =>
      if v =? owner_index p then
        after_command (owner_clock p)
          (require (dividers_eqb planes (owner_planes o)) OtherPlanes
            (Accepted (with_pair_owner p o (pair_owner_motion p) (end_log (owner_clock p)))))
      else
        after_command (follower_clock p)
          (require (dividers_eqb planes (follower_planes f)) OtherPlanes
            (Accepted (with_pair_follower p f (pair_follower_motion p) (end_log (follower_clock p)))))
  end.

(** ** Steps of a fleet *)

(** Applies a function to the members of a list that are selected. Forbids an event that selects none. *)
Fixpoint update {A} (selects : A -> bool) (f : A -> result A) (all : list A) : result (list A) :=
  match all with
  | [] => Accepted []
  | a :: rest =>
      bind (if selects a then f a else Accepted a) (fun a =>
        bind (update selects f rest) (fun rest => Accepted (a :: rest)))
  end.

(** All pairs: one row for each owner, with its number. *)
Definition fleet := list (nat * list pair).

(** Whether a row may have pairs that an entry concerns. *)
Definition concerns_row (e : entry) (row : nat * list pair) : bool :=
  match e with
  | Instant v _ | Reserve v _ => fst row <=? v
  | Take a _ _ _ | Propose a _ _ _ | Decide _ a _ _ => fst row =? a
  | Send a b _ _ _ | Hear a b _ _ _ | Hold a b _ => (fst row =? a) || (fst row =? b)
  end.

Definition is_known (e : entry) (rows : fleet) : bool :=
  existsb (fun row => concerns_row e row && existsb (concerns e) (snd row)) rows.

(** Takes an entry to all pairs that it concerns. *)
Definition step (e : entry) (rows : fleet) : result fleet :=
  require (is_known e rows) UnknownVehicle
    (update (concerns_row e)
      (fun row => bind (update (concerns e) (feed e) (snd row)) (fun pairs => Accepted (fst row, pairs))) rows).

(** Pair at its start. [None] if the first plane does not contain both segments. *)
Definition pair_at_start (i j : nat) (one other : start) (hash : nat) (d : divider) : option pair :=
  let f := {| owner_start := one; follower_start := other; first_plane := d; starts_hash := hash |} in
  match divider_of_starts facts divider segment owner_segment follower_segment between (owner_contains f)
    (follower_contains f) f with
  | Some d =>
      let c := {| period := 0; looks := false; sends := false; ended := false |} in
      Some {|
        owner_index := i; follower_index := j; pair_facts := f;
        pair_owner := owned_at_start facts divider starts_hash f d;
        pair_owner_motion := {| now := owner_segment f; next := owner_segment f |}; owner_clock := c;
        pair_follower := followed_at_start facts divider starts_hash f d;
        pair_follower_motion := {| now := follower_segment f; next := follower_segment f |}; follower_clock := c;
        sent := [] |}
  | None => None
  end.

(** First planes of the pairs, in the order of owners and then of followers, each with the hash of the starts. *)
Definition planes_of_starts := list (nat * divider).

(** Returns the pairs of an owner with all followers from a number on, and the planes that are left. *)
Fixpoint row_at_start (i : nat) (one : start) (j : nat) (others : list start) (planes : planes_of_starts) :
  option (list pair * planes_of_starts) :=
  match others, planes with
  | [], _ => Some ([], planes)
  | other :: others, (hash, d) :: planes =>
      match pair_at_start i j one other hash d, row_at_start i one (S j) others planes with
      | Some p, Some (row, over) => Some (p :: row, over)
      | _, _ => None
      end
  | _, [] => None
  end.

(** Returns all pairs of the starts from a number on. *)
Fixpoint rows_at_start (i : nat) (all : list start) (planes : planes_of_starts) : option fleet :=
  match all with
  | [] => match planes with [] => Some [] | _ => None end
  | one :: others =>
      match row_at_start i one (S i) others planes with
      | Some (row, over) => option_map (cons (i, row)) (rows_at_start (S i) others over)
      | None => None
      end
  end.

Fixpoint steps (entries : list entry) (rows : fleet) : result fleet :=
  match entries with
  | [] => Accepted rows
  | e :: rest => bind (step e rows) (steps rest)
  end.

(** Replays a log. *)
Definition replay (all : list start) (planes : planes_of_starts) (entries : list entry) : option fleet :=
  match rows_at_start 0 all planes with
  | Some rows => match steps entries rows with Accepted rows => Some rows | Forbidden _ => None end
  | None => None
  end.

Definition pairs_of (rows : fleet) : list pair := flat_map snd rows.

(** Whether the planes of both vehicles of each pair were compared at the end. *)
Definition is_complete (rows : fleet) : bool :=
  forallb (fun p => ended (owner_clock p) && ended (follower_clock p)) (pairs_of rows).

(** ** Soundness *)

(** States of the transition system of a pair that it reaches from its start. *)
Definition reaches (f : facts) (s : state) : Prop :=
  reachable facts divider segment starts_hash owner_segment follower_segment between (owner_contains f)
    (follower_contains f) contract_rules f f s.

(** The state of a pair is that of a trace. *)
Definition is_traced (p : pair) : Prop := exists s : state,
  reaches (pair_facts p) s /\
  owner s = pair_owner p /\ owner_motion s = pair_owner_motion p /\
  follower s = pair_follower p /\ follower_motion s = pair_follower_motion p /\
  forall m g, In (m, g) (sent p) -> In m (radio s).

(** Identity of a pair, which no event changes. *)
Definition key (p : pair) : nat * nat * facts := (owner_index p, follower_index p, pair_facts p).

Lemma reaches_next : forall f s e t,
  reaches f s ->
  apply divider segment (owner_contains f) (follower_contains f) contract_rules s e = Some t -> reaches f t.
Proof.
  intros f s e t (s0 & events & S & R) A. exists s0, (events ++ [e]). split; [exact S|].
  revert s0 S R. clear -A. intros s0 _. revert s0.
  induction events as [|d rest IH]; simpl; intros s0 R.
  - injection R as ->. now rewrite A.
  - destruct (apply _ _ _ _ _ s0 d) as [s1|]; [|discriminate]. now apply IH.
Qed.

Lemma require_accepted : forall A b why (r : result A) a, require b why r = Accepted a -> b = true /\ r = Accepted a.
Proof. intros A [] why r a H; simpl in H; [auto|discriminate]. Qed.

Lemma at_instant_accepted : forall A c (r : result A) a, at_instant c r = Accepted a -> r = Accepted a.
Proof. intros A c r a H. unfold at_instant in H. now do 2 apply require_accepted in H as [_ H]. Qed.

Lemma after_command_accepted : forall A c (r : result A) a, after_command c r = Accepted a -> r = Accepted a.
Proof. intros A c r a H. unfold after_command in H. now do 2 apply require_accepted in H as [_ H]. Qed.

Lemma bind_accepted : forall A B (a : result A) (f : A -> result B) b,
  bind a f = Accepted b -> exists a', a = Accepted a' /\ f a' = Accepted b.
Proof. intros A B [a | why] f b H; simpl in H; [eauto | discriminate]. Qed.

Ltac opens H := repeat (
  first [apply at_instant_accepted in H | apply after_command_accepted in H |
    let E := fresh "E" in apply require_accepted in H as [E H] |
    let c := fresh "c" in let E := fresh "C" in apply bind_accepted in H as (c & E & H)]).

(** Proves that a step of a pair is one of the transition system: [e] is the event. *)
Ltac traces e := match goal with
  | R : reaches _ ?s |- is_traced _ =>
      eexists; split; [apply (reaches_next _ s e); [exact R|]; simpl |]
  end.

Theorem feed_is_sound : forall e p q, is_traced p -> feed e p = Accepted q -> is_traced q /\ key q = key p.
Proof.
  intros e p q (s & R & O & OM & F & FM & M) H.
  destruct e; simpl in H.
  - destruct (vehicle =? owner_index p); opens H; injection H as <-; split; auto.
    + traces (PassOwner divider segment); [reflexivity|]. simpl. rewrite ?O, ?OM. auto.
    + traces (PassFollower divider segment); [reflexivity|]. simpl. rewrite ?F, ?FM. auto.
  - opens H. injection H as <-. split; auto.
    traces (RenewOwner divider segment None); [reflexivity|].
    simpl. unfold owner_renews. simpl. rewrite ?O, ?OM. auto.
  - opens H. injection H as <-. split; auto.
    traces (RenewOwner divider segment (Some plane)); [reflexivity|].
    simpl. unfold owner_renews. simpl. rewrite ?O, ?OM. auto.
  - opens H. injection H as <-. split; auto.
    traces (RenewFollower divider segment accepted); [reflexivity|].
    simpl. unfold follower_decides. simpl. rewrite ?F, ?FM. auto.
  - destruct (vehicle =? owner_index p); opens H; injection H as <-; split; auto.
    + traces (CommandOwner divider segment s0); [rewrite O, E; reflexivity|]. simpl. rewrite ?O, ?OM. auto.
    + traces (CommandFollower divider segment s0); [rewrite F, E; reflexivity|]. simpl. rewrite ?F, ?FM. auto.
  - destruct (from =? owner_index p); opens H; injection H as <-; split; auto.
    + apply message_eqb_eq in E2.
      traces (SendOwner divider segment stamp); [reflexivity|]. simpl. repeat (split; auto).
      intros m g [I | I]; apply in_or_app; [right; left | left; eauto]. injection I as <- _. now rewrite E2, O.
    + apply message_eqb_eq in E2.
      traces (SendFollower divider segment stamp); [reflexivity|]. simpl. repeat (split; auto).
      intros m g [I | I]; apply in_or_app; [right; left | left; eauto]. injection I as <- _. now rewrite E2, F.
  - apply require_accepted in H as [Sent H].
    assert (I : In (message_of stamp hash c) (radio s)).
    { apply existsb_exists in Sent. destruct Sent as ([m g] & I & E). apply andb_prop in E. destruct E as [E _].
      simpl in E. apply message_eqb_eq in E. rewrite E. eauto. }
    apply In_nth_error in I. destruct I as [place I].
    destruct (to =? owner_index p); opens H; injection H as <-; split; auto.
    + traces (HearOwner divider segment place); [rewrite I; reflexivity|]. simpl. rewrite ?O, ?OM. auto.
    + traces (HearFollower divider segment place); [rewrite I; reflexivity|]. simpl. rewrite ?F, ?FM. auto.
  - destruct (vehicle =? owner_index p); opens H; injection H as <-; split; auto; exists s; simpl; auto 10.
Qed.

Lemma update_accepted : forall A selects (f : A -> result A) all left,
  update selects f all = Accepted left ->
  Forall2 (fun a b => b = a \/ f a = Accepted b) all left.
Proof.
  intros A selects f. induction all as [|a rest IH]; simpl; intros left H.
  - injection H as <-. constructor.
  - apply bind_accepted in H as (b & B & H). apply bind_accepted in H as (others & U & H). injection H as <-.
    constructor; auto. destruct (selects a); [auto|]. injection B as <-. auto.
Qed.

(** Two fleets have the same pairs, each in a traced state. *)
Definition keys (rows : fleet) : list (nat * nat * facts) := map key (pairs_of rows).

Definition all_traced (rows : fleet) : Prop := forall p, In p (pairs_of rows) -> is_traced p.

Lemma row_is_sound : forall selects e pairs left,
  (forall p, In p pairs -> is_traced p) -> update selects (feed e) pairs = Accepted left ->
  (forall p, In p left -> is_traced p) /\ map key left = map key pairs.
Proof.
  intros selects e pairs left T U. apply update_accepted in U. induction U as [|a b rest others H _ IH]; simpl.
  - auto.
  - destruct IH as [T' K]; [intros p I; apply T; now right|].
    assert (B : is_traced b /\ key b = key a).
    { destruct H as [-> | H]; [split; auto; apply T; now left|]. eapply feed_is_sound; eauto. apply T. now left. }
    destruct B as [B1 B2]. split; [|now rewrite B2, K]. intros p [<- | I]; auto.
Qed.

Theorem step_is_sound : forall e rows left,
  all_traced rows -> step e rows = Accepted left -> all_traced left /\ keys left = keys rows.
Proof.
  intros e rows left T H. apply require_accepted in H as [_ H]. apply update_accepted in H.
  unfold all_traced, keys, pairs_of in *.
  induction H as [|a b rest others H _ IH]; simpl in *; auto.
  destruct IH as [T' K]; [intros p I; apply T, in_or_app; now right|].
  assert (B : (forall p, In p (snd b) -> is_traced p) /\ map key (snd b) = map key (snd a)).
  { destruct H as [-> | H]; [split; auto; intros p I; apply T, in_or_app; now left|].
    apply bind_accepted in H as (pairs & U & H). injection H as <-. simpl.
    eapply row_is_sound; eauto. intros p I. apply T, in_or_app. now left. }
  destruct B as [B1 B2]. split.
  - intros p I. apply in_app_or in I. destruct I; auto.
  - rewrite !map_app, K, B2. reflexivity.
Qed.

Lemma steps_are_sound : forall entries rows left,
  all_traced rows -> steps entries rows = Accepted left -> all_traced left /\ keys left = keys rows.
Proof.
  induction entries as [|e rest IH]; simpl; intros rows left T H.
  - injection H as <-. auto.
  - apply bind_accepted in H as (rows' & S & H). apply step_is_sound in S; auto. destruct S as [T' K].
    apply IH in H; auto. destruct H as [T'' K']. split; [auto|congruence].
Qed.

Lemma pair_at_start_is_traced : forall i j one other hash d p,
  pair_at_start i j one other hash d = Some p ->
  is_traced p /\
  key p = (i, j, {| owner_start := one; follower_start := other; first_plane := d; starts_hash := hash |}).
Proof.
  intros i j a b hash d p H. unfold pair_at_start in H.
  set (f := {| owner_start := a; follower_start := b; first_plane := d; starts_hash := hash |}) in *.
  destruct (divider_of_starts _ _ _ _ _ _ _ _ f) as [e|] eqn:D; [|discriminate]. injection H as <-.
  split; [|reflexivity].
  set (s := {| owner := owned_at_start facts divider starts_hash f e;
    owner_motion := {| now := owner_segment f; next := owner_segment f |};
    follower := followed_at_start facts divider starts_hash f e;
    follower_motion := {| now := follower_segment f; next := follower_segment f |}; radio := [] |} : state).
  exists s. split; [|simpl; repeat (split; auto)].
  exists s, []. split; [|reflexivity].
  exists e, e. simpl. repeat (split; auto); contradiction.
Qed.

Lemma row_at_start_is_traced : forall i one others j planes row over,
  row_at_start i one j others planes = Some (row, over) ->
  (forall p, In p row -> is_traced p) /\
  forall k other, nth_error others k = Some other ->
    exists p, In p row /\ owner_index p = i /\ follower_index p = j + k /\
      owner_start (pair_facts p) = one /\ follower_start (pair_facts p) = other.
Proof.
  intros i a. induction others as [|b others IH]; simpl; intros j planes row over H.
  - injection H as <- _. split; [contradiction|]. intros [|k] other N; discriminate.
  - destruct planes as [|[hash d] planes]; [discriminate|].
    destruct (pair_at_start i j a b hash d) as [p|] eqn:P; [|discriminate].
    destruct (row_at_start i a (S j) others planes) as [[rest after]|] eqn:T; [|discriminate]. injection H as <- _.
    apply pair_at_start_is_traced in P. destruct P as [P K]. apply IH in T. destruct T as [T C].
    unfold key in K. injection K as K1 K2 K3.
    split; [intros q [<- | I]; auto|].
    intros [|k] other N; simpl in N.
    + injection N as <-. exists p. rewrite K3, K2, Nat.add_0_r. repeat split; auto. now left.
    + apply C in N. destruct N as (q & I & Q1 & Q2 & Q3). exists q. repeat split; auto; try apply Q3; [now right|lia].
Qed.

Lemma rows_at_start_are_traced : forall all i planes rows,
  rows_at_start i all planes = Some rows ->
  all_traced rows /\
  forall k l one other, k < l -> nth_error all k = Some one -> nth_error all l = Some other ->
    exists p, In p (pairs_of rows) /\ owner_index p = i + k /\ follower_index p = i + l /\
      owner_start (pair_facts p) = one /\ follower_start (pair_facts p) = other.
Proof.
  induction all as [|a others IH]; simpl; intros i planes rows H.
  - destruct planes; [|discriminate]. injection H as <-. split; [intros p []|]. intros [|k] l; discriminate.
  - destruct (row_at_start i a (S i) others planes) as [[row over]|] eqn:T; [|discriminate].
    destruct (rows_at_start (S i) others over) as [rest|] eqn:U; [|discriminate]. injection H as <-.
    apply row_at_start_is_traced in T. destruct T as [T C]. apply IH in U. destruct U as [U D].
    unfold all_traced, pairs_of in *. simpl. split.
    + intros p I. apply in_app_or in I. destruct I; auto.
    + intros [|k] [|l] one' other L N M; try lia; simpl in N, M.
      * injection N as <-. apply C in M. destruct M as (p & I & P1 & P2 & P3).
        exists p. repeat split; try apply P3; [apply in_or_app; auto | lia | lia].
      * assert (L' : k < l) by lia. destruct (D k l one' other L' N M) as (p & I & P1 & P2 & P3).
        exists p. repeat split; try apply P3; [apply in_or_app; auto | lia | lia].
Qed.

(** Soundness. If a log is accepted, the state of each pair of its starts is one that the transition system reaches. *)
Theorem replay_is_sound : forall all planes entries rows,
  replay all planes entries = Some rows ->
  all_traced rows /\
  forall k l one other, k < l -> nth_error all k = Some one -> nth_error all l = Some other ->
    exists p, In p (pairs_of rows) /\ owner_index p = k /\ follower_index p = l /\
      owner_start (pair_facts p) = one /\ follower_start (pair_facts p) = other.
Proof.
  intros all planes entries rows H. unfold replay in H.
  destruct (rows_at_start 0 all planes) as [begun|] eqn:B; [|discriminate].
  destruct (steps entries begun) as [left|why] eqn:S; [|discriminate]. injection H as <-.
  apply rows_at_start_are_traced in B. destruct B as [T C]. apply steps_are_sound in S; auto. destruct S as [T' K].
  split; auto. intros k l one' other L N M. destruct (C k l one' other L N M) as (p & I & P1 & P2 & P3 & P4).
  assert (J : In (key p) (keys left)) by (rewrite K; now apply in_map).
  apply in_map_iff in J. destruct J as (q & E & J). unfold key in E. injection E as E1 E2 E3.
  exists q. rewrite E1, E2, E3. auto.
Qed.

(** Each part of an accepted log from its begin is accepted. So all statements hold at each event. *)
Theorem each_prefix_is_accepted : forall all planes entries more rows,
  replay all planes (entries ++ more) = Some rows -> exists before, replay all planes entries = Some before.
Proof.
  intros all planes entries more rows H. unfold replay in *.
  destruct (rows_at_start 0 all planes) as [begun|]; [|discriminate].
  assert (P : forall b rows', steps (entries ++ more) b = Accepted rows' -> exists c, steps entries b = Accepted c).
  { clear. induction entries as [|e rest IH]; simpl; intros b rows' H; [eauto|].
    apply bind_accepted in H as (c & S & H). rewrite S. simpl. eauto. }
  destruct (steps (entries ++ more) begun) as [left|] eqn:S; [|discriminate].
  apply P in S. destruct S as [c ->]. eauto.
Qed.

(** Lemma 3 for a log: both vehicles of each pair hold a common plane. *)
Theorem logged_pairs_have_a_common_plane : forall all planes entries rows p,
  replay all planes entries = Some rows -> In p (pairs_of rows) ->
  exists d, In d (owner_planes (pair_owner p)) /\ In d (follower_planes (pair_follower p)).
Proof.
  intros all planes entries rows p H I. apply replay_is_sound in H. destruct H as [T _].
  destruct (T p I) as (s & R & <- & _ & <- & _). exact (common_plane _ _ _ _ _ _ _ _ _ _ _ R).
Qed.

(** Lemma 2 for a log: all planes of each vehicle contain its segments. *)
Theorem logged_segments_are_inside : forall all planes entries rows p,
  replay all planes entries = Some rows -> In p (pairs_of rows) ->
  motion_holds divider segment (owner_contains (pair_facts p)) (owner_planes (pair_owner p)) (pair_owner_motion p) /\
  motion_holds divider segment (follower_contains (pair_facts p)) (follower_planes (pair_follower p))
    (pair_follower_motion p).
Proof.
  intros all planes entries rows p H I. apply replay_is_sound in H. destruct H as [T _].
  destruct (T p I) as (s & R & <- & <- & <- & <- & _). exact (segments_are_inside _ _ _ _ _ _ _ _ _ _ _ R).
Qed.

End Replay.

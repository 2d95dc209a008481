(** * A new plane can always be agreed on

    The contract never gets stuck. From each reachable state of two vehicles with the same starts, some steps lead to
    any plane that contains the segments of both. Only a message with another hash stops a contract
    ([contract.another_hash_voids_for_ever]). *)

From Coq Require Import Arith Bool List Lia.
From Proofs Require Import contract.
Import ListNotations.

Section Progress.

Variables Facts Divider Segment : Type.
Variable hash : Facts -> nat.
Variables owner_start follower_start : Facts -> Segment.
Variable between : Facts -> option Divider.
Variables inside_owner inside_follower : Divider -> Segment -> bool.

Notation state := (state Divider Segment).
Notation event := (event Divider Segment).
Notation run := (run Divider Segment inside_owner inside_follower contract_rules).
Notation apply := (apply Divider Segment inside_owner inside_follower contract_rules).
Notation invariant := (invariant Divider Segment inside_owner inside_follower).
Notation reachable :=
  (reachable Facts Divider Segment hash owner_start follower_start between inside_owner inside_follower).

Arguments owner {_ _}. Arguments follower {_ _}. Arguments owner_motion {_ _}. Arguments follower_motion {_ _}.
Arguments radio {_ _}. Arguments o_agreement {_}. Arguments o_number {_}. Arguments o_pending {_}.
Arguments o_decision {_}. Arguments o_held {_}. Arguments f_held {_}. Arguments o_stamp {_}. Arguments f_stamp {_}.
Arguments f_agreement {_}. Arguments f_decided {_}. Arguments next {_}. Arguments now {_}.

Local Arguments nth_error : simpl never.

(** No message with another hash has arrived. *)
Definition is_open (s : state) : Prop := o_agreement (owner s) <> Void /\ f_agreement (follower s) <> Void.

(** The owner sends, the follower hears, decides and answers, and the owner hears. *)
Definition exchange (s : state) : list event :=
  let stamp := S (o_stamp (owner s) + f_stamp (follower s)) in
  let place := length (radio s) in
  [SendOwner _ _ stamp; HearFollower _ _ place; RenewFollower _ _ true; SendFollower _ _ stamp;
   HearOwner _ _ (S place)].

Lemma run_app : forall a s b, run s (a ++ b) = match run s a with Some t => run t b | None => None end.
Proof. induction a as [|e a IH]; simpl; intros s b; auto. destruct (apply s e); auto. Qed.

Lemma run_keeps_invariant : forall events h s t, invariant h s -> run s events = Some t -> invariant h t.
Proof.
  induction events as [|e rest IH]; simpl; intros h s t I R.
  - injection R as <-. exact I.
  - destruct (apply s e) as [u|] eqn:A; [|discriminate]. eapply IH; [|exact R].
    eapply invariant_is_inductive; eauto.
Qed.

Lemma nth_of_last : forall (A : Type) (l : list A) a, nth_error (l ++ [a]) (length l) = Some a.
Proof. intros. rewrite nth_error_app2, Nat.sub_diag; auto. Qed.

Lemma not_void : forall a, a <> Void -> is_void a = false.
Proof. intros []; auto. congruence. Qed.

Lemma exchange_runs : forall h s d,
  invariant h s -> is_open s -> o_pending (owner s) = Some d ->
  exists t, run s (exchange s) = Some t /\ is_open t /\
    o_pending (owner t) = Some d /\ o_number (owner t) = o_number (owner s) /\
    owner_motion t = owner_motion s /\ next (follower_motion t) = next (follower_motion s) /\
    o_decision (owner t) = f_decided (follower t) /\ d_number (f_decided (follower t)) = o_number (owner t) /\
    (S (d_number (f_decided (follower s))) = o_number (owner s) ->
     inside_follower d (next (follower_motion s)) = true -> d_accepted (f_decided (follower t)) = true).
Proof.
  intros h [o om f fm messages] d ((Ho & Hf & P & _) & _) [Vo Vf] Pend. simpl in *.
  destruct o as [oh oa os od ohe n op], f as [fh fa fs fp fhe [dn da]]. simpl in *. subst op oh fh.
  unfold planes_fit in P. simpl in P.
  set (stamp := S (os + fs)).
  assert (Ls : (fs <? stamp) = true) by (apply Nat.ltb_lt; unfold stamp; lia).
  assert (Lo : (os <? stamp) = true) by (apply Nat.ltb_lt; unfold stamp; lia).
  assert (Ra : forall a, a <> Void -> forall m, m_starts Divider m = h ->
    compare Divider contract_rules h a m = (Same, true)).
  { intros a V m E. unfold compare. rewrite E, Nat.eqb_refl. simpl. destruct a; auto. congruence. }
  assert (Last : forall m1 m2 : message Divider,
    nth_error ((messages ++ [m1]) ++ [m2]) (S (length messages)) = Some m2).
  { intros m1 m2. replace (S (length messages)) with (length (messages ++ [m1])) by (rewrite app_length; simpl; lia).
    apply nth_of_last. }
  set (p := {| p_number := n; p_divider := d |}).
  set (o := {| o_hash := h; o_agreement := oa; o_stamp := os; o_decision := od; o_held := ohe; o_number := n;
    o_pending := Some d |}).
  set (f := {| f_hash := h; f_agreement := fa; f_stamp := fs; f_proposal := fp; f_held := fhe;
    f_decided := {| d_number := dn; d_accepted := da |} |}).
  set (f1 := {| f_hash := h; f_agreement := Same; f_stamp := stamp; f_proposal := Some p; f_held := fhe;
    f_decided := {| d_number := dn; d_accepted := da |} |}).
  assert (Heard : hear_followed Divider contract_rules f (owner_message Divider stamp o) = f1).
  { unfold hear_followed, owner_message. simpl. rewrite (not_void _ Vo), (Ra fa Vf) by reflexivity.
    simpl. rewrite Ls. reflexivity. }
  assert (Decided : exists f2, decide Divider Segment inside_follower contract_rules f1 (next fm) true = f2 /\
    f_hash Divider f2 = h /\ f_agreement f2 = Same /\ d_number (f_decided f2) = n /\ 0 < n /\
    (S dn = n -> inside_follower d (next fm) = true -> d_accepted (f_decided f2) = true)).
  { eexists. split; [reflexivity|]. unfold decide. simpl. destruct (n <=? dn) eqn:L.
    - apply Nat.leb_le in L. destruct P as [[E _] | (E & N & _)]; [lia|]. simpl. repeat split; auto. intros; lia.
    - apply Nat.leb_gt in L. destruct P as [[E _] | (E & _)]; [|lia]. simpl. repeat split; auto. lia. }
  destruct Decided as (f2 & D & Hf2 & Vf2 & Nf2 & N & Af2).
  assert (Answered : exists o1,
    hear_owned Divider contract_rules o (follower_message Divider stamp f2) = o1 /\
    o_agreement o1 = Same /\ o_pending o1 = Some d /\ o_number o1 = n /\ o_decision o1 = f_decided f2).
  { eexists. split; [reflexivity|]. unfold hear_owned, follower_message. simpl. rewrite Hf2.
    rewrite (Ra oa Vo) by reflexivity. simpl. rewrite Lo, Nf2. simpl.
    assert (Z : (0 <? n) = true) by now apply Nat.ltb_lt. rewrite Z. simpl. auto. }
  destruct Answered as (o1 & A & Vo1 & Po1 & No1 & Do1).
  unfold exchange. cbn [contract.run contract.apply owner follower owner_motion follower_motion radio o_stamp f_stamp].
  unfold with_message, with_owner, with_follower.
  cbn [owner follower owner_motion follower_motion radio o_stamp f_stamp advance now next].
  fold stamp. fold o f. change (o_stamp o) with os. change (f_stamp f) with fs.
  fold stamp.
  rewrite nth_of_last. cbn [option_map owner follower owner_motion follower_motion radio]. rewrite Heard.
  cbn [owner follower owner_motion follower_motion radio advance now next]. rewrite D, Last.
  cbn [option_map owner follower owner_motion follower_motion radio]. rewrite A.
  eexists. split; [reflexivity|]. unfold is_open. simpl. rewrite Vo1, Vf2, Po1, No1, Do1, Nf2.
  repeat split; auto; discriminate.
Qed.

(** The owner takes the decision that it heard. *)
Lemma decision_runs : forall s d wish,
  is_open s -> o_pending (owner s) = Some d -> d_number (o_decision (owner s)) = o_number (owner s) ->
  exists t, run s [RenewOwner _ _ wish] = Some t /\ is_open t /\ follower t = follower s /\
    follower_motion t = follower_motion s /\ next (owner_motion t) = next (owner_motion s) /\
    match wish with
    | Some e => inside_owner e (next (owner_motion s)) = true ->
        o_pending (owner t) = Some e /\ o_number (owner t) = S (o_number (owner s))
    | None => owner_planes _ (owner t) = [if d_accepted (o_decision (owner s)) then d else o_held (owner s)]
    end.
Proof.
  intros [o om f fm messages] d wish [Vo Vf] Pend N. simpl in *. eexists. split; [reflexivity|].
  unfold with_owner, renew, take_decision, is_open. simpl. rewrite (not_void _ Vo), Pend, N, Nat.eqb_refl.
  destruct wish as [e|]; unfold propose; simpl.
  - destruct (inside_owner e (next om)) eqn:I; simpl; repeat split; auto; discriminate.
  - repeat split; auto.
Qed.

(** From each reachable state of two vehicles with the same starts, the two can agree on any plane that contains the
    segments of both, unless a message with another hash has arrived. *)
Theorem any_plane_can_be_agreed : forall facts s d,
  reachable contract_rules facts facts s -> is_open s ->
  inside_owner d (next (owner_motion s)) = true -> inside_follower d (next (follower_motion s)) = true ->
  exists events t, run s events = Some t /\
    owner_planes _ (owner t) = [d] /\ follower_planes _ (follower t) = [d].
Proof.
  intros facts s d R Open Io If. apply invariant_is_reachable in R. set (h := hash facts) in *.
  (* First the pending proposal, if there is one, is decided, and the plane is proposed. *)
  assert (First : exists events t, run s events = Some t /\ is_open t /\ o_pending (owner t) = Some d /\
    S (d_number (f_decided (follower t))) = o_number (owner t) /\
    inside_follower d (next (follower_motion t)) = true).
  { destruct (o_pending (owner s)) as [e|] eqn:Pend.
    - destruct (exchange_runs h s e R Open Pend) as (t & Rt & Ot & Pt & Nt & Mt & Ft & Dt & Et & _).
      assert (Matches : d_number (o_decision (owner t)) = o_number (owner t)) by congruence.
      destruct (decision_runs t e (Some d) Ot Pt Matches) as (u & Ru & Ou & Fu & FMu & _ & W).
      rewrite Mt in W. destruct (W Io) as [Pu Nu].
      exists (exchange s ++ [RenewOwner _ _ (Some d)]), u. rewrite run_app, Rt.
      split; [exact Ru|]. split; [exact Ou|]. split; [exact Pu|]. rewrite Fu, FMu, Ft, Nu. auto.
    - exists [RenewOwner _ _ (Some d)]. destruct s as [o om f fm messages]. simpl in *. eexists. split; [reflexivity|].
      destruct R as ((_ & _ & P & _) & _). unfold planes_fit in P. simpl in P. rewrite Pend in P.
      destruct Open as [Vo Vf]. unfold with_owner, renew, take_decision, is_open. simpl in *.
      rewrite (not_void _ Vo), Pend. unfold propose. simpl. rewrite Io, Pend. simpl.
      destruct P as [P _]. repeat split; auto. }
  destruct First as (events & t & Rt & Ot & Pt & Nt & It).
  pose proof (run_keeps_invariant _ _ _ _ R Rt) as Inv.
  destruct (exchange_runs h t d Inv Ot Pt) as (u & Ru & Ou & Pu & _ & _ & _ & Du & Eu & Au).
  specialize (Au Nt It).
  assert (Matches : d_number (o_decision (owner u)) = o_number (owner u)) by congruence.
  destruct (decision_runs u d None Ou Pu Matches) as (v & Rv & _ & Fv & _ & _ & Planes).
  rewrite Du, Au in Planes.
  exists ((events ++ exchange t) ++ [RenewOwner _ _ None]), v. rewrite !run_app, Rt, Ru.
  assert (Run : run s ((events ++ exchange t) ++ [RenewOwner _ _ None]) = Some v)
    by (rewrite !run_app, Rt, Ru; exact Rv).
  split; [exact Rv|]. split; [exact Planes|].
  destruct (run_keeps_invariant _ _ _ _ R Run) as ((_ & _ & P & _) & _).
  unfold owner_planes in Planes. unfold planes_fit in P.
  destruct (o_pending (owner v)); [discriminate|]. injection Planes as Held.
  unfold follower_planes. destruct P as [_ ->]. now rewrite Held.
Qed.

End Progress.

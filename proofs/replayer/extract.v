(** Extraction of [replay] to OCaml, with the integers of Zarith. *)

From Coq Require Import Arith ZArith Extraction ExtrOcamlBasic ExtrOcamlNatBigInt ExtrOcamlZBigInt.
From Proofs Require Import replay.

Extract Constant Nat.leb => "Big_int_Z.le_big_int".

Extraction "model.ml" rows_at_start step pairs_of is_complete slack.

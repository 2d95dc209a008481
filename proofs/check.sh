#!/bin/sh
# Checks the proofs. From anywhere: sh proofs/check.sh [--accept]
#
# Compares constants.v with the Rust code, compiles all files, and checks them again with coqchk. Compares the axioms of
# each theorem with assumptions.txt. --accept writes constants.v and assumptions.txt. Then copies with a defect must
# fail. At the end it builds proofs/replay, which checks contract logs. Needs the Debian packages coq, libcoq-flocq,
# ocaml, ocaml-findlib and libzarith-ocaml-dev.
set -eu
cd "$(dirname "$0")"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

sh ./constants.sh >"$scratch/constants.v"
[ "${1:-}" != --accept ] || cp "$scratch/constants.v" constants.v
if ! diff constants.v "$scratch/constants.v"; then
    echo "proofs: constants or modelled functions of the code changed; compare them with their models, and run" \
        "sh proofs/check.sh --accept" >&2
    exit 1
fi

# Compiles and checks the files of a folder: check FOLDER. Writes FOLDER/found, one line for each theorem.
check() (
    cd "$1"
    files=$(coqdep -R . Proofs -sort ./*.v | tr ' ' '\n' | sed 's|.*/||; s|\.v$||; /^$/d')
    for file in $files; do
        coqc -q -R . Proofs "$file.v" || return 1
    done
    # Libraries are not checked again: the standard library alone takes another half minute.
    coqchk -silent -R . Proofs $(for file in $files; do echo "-norec Proofs.$file"; done) || return 1
    for file in $files; do
        echo "From Proofs Require $file."
        sed -n 's/^Theorem \([A-Za-z0-9_]*\).*/\1/p' "$file.v" | while read -r name; do
            echo "Goal True. idtac \"theorem $file.$name\". Abort. Print Assumptions $file.$name."
        done
    done >assumptions_of_all.v
    coqc -q -R . Proofs assumptions_of_all.v >printed || return 1
    # Names of axioms begin in the first column, and their types go on in the next lines.
    awk '
        function end() { if (name != "") print name ": " (axioms == "" ? "no axioms" : substr(axioms, 2)) }
        /^theorem / { end(); name = $2; axioms = ""; next }
        /^(Axioms:|Closed under|[[:space:]])/ || NF == 0 { next }
        { axioms = axioms " " $1 }
        END { end() }' printed >found
)

mkdir "$scratch/proofs"
cp ./*.v "$scratch/proofs"
check "$scratch/proofs"
[ "${1:-}" != --accept ] || cp "$scratch/proofs/found" assumptions.txt
if ! diff assumptions.txt "$scratch/proofs/found"; then
    echo "proofs: the theorems or their axioms changed; if this is intended, run sh proofs/check.sh --accept" >&2
    exit 1
fi

# A copy with a defect must fail: mutant NAME FILE 'COMMANDS OF SED'. FILE is contract, or replay, which uses it.
mutant() {
    mkdir "$scratch/$1"
    cp contract.v "$scratch/$1"
    sed "$3" "$2.v" >"$scratch/$1/$2.v"
    if cmp -s "$2.v" "$scratch/$1/$2.v"; then
        echo "mutant $1: the text to be changed is missing" >&2
        exit 1
    fi
    grep -e '^contract\.' -e "^$2\." assumptions.txt >"$scratch/expected"
    if check "$scratch/$1" >"$scratch/output" 2>&1 &&
        diff "$scratch/expected" "$scratch/$1/found" >"$scratch/output"; then
        echo "mutant $1: not found" >&2
        exit 1
    fi
    echo "mutant $1: found, $(grep -m 1 -e '^>' -e '^File' "$scratch/output")"
}
proof='^Proof\. intros facts s R\. eapply invariant_has_common_plane.*'
mutant admitted contract "s/$proof/Admitted./"
mutant axiom contract "s/$proof/Proof. intros. apply shortcut. Qed./
    s/^Theorem common_plane /Axiom shortcut : forall s, have_common_plane s.\n&/"
mutant defect contract 's/ matches_number := true;/ matches_number := false;/'
mutant unchecked replay 's/require (forallb (fun d => owner_contains .*) SegmentOutside/require true SegmentOutside/'
mutant invented replay 's/require (existsb (fun old => .*/require true/'

# A changed constant or operation of the code must differ from constants.v: changed NAME FILE 'COMMANDS OF SED'.
changed() {
    mkdir "$scratch/$1"
    (cd .. && cp --parents crates/audit/src/*.rs crates/shield/src/*.rs "$scratch/$1")
    sed "$3" "../$2" >"$scratch/$1/$2"
    if cmp -s "../$2" "$scratch/$1/$2"; then
        echo "mutant $1: the text to be changed is missing" >&2
        exit 1
    fi
    if sh ./constants.sh "$scratch/$1" >"$scratch/output" && cmp -s constants.v "$scratch/output"; then
        echo "mutant $1: not found" >&2
        exit 1
    fi
    echo "mutant $1: found, $(diff constants.v "$scratch/output" | grep -m 1 '^>')"
}
changed constant crates/audit/src/sweep.rs 's/ RESOLUTION: f64 = 8.0/ RESOLUTION: f64 = 4.0/'
changed operation crates/audit/src/sweep.rs 's/(self.from + self.by \* fraction)/(self.by * fraction + self.from)/'
changed test crates/shield/src/plane.rs 's/self.room_m(&segment.stop()) >= 0.0/true/'

# A smaller bound or another operation must not be provable: unproved NAME FILE 'COMMANDS OF SED' USER. The proofs of
# USER use FILE.
unproved() {
    mkdir "$scratch/$1"
    for file in geometry doubles constants resolution; do
        cp "$scratch/proofs/$file.v" "$scratch/proofs/$file.vo" "$scratch/$1"
    done
    sed "$3" "$2.v" >"$scratch/$1/$2.v"
    cp "$4.v" "$scratch/$1"
    if cmp -s "$2.v" "$scratch/$1/$2.v"; then
        echo "mutant $1: the text to be changed is missing" >&2
        exit 1
    fi
    if (cd "$scratch/$1" && coqc -q -R . Proofs "$2.v" && coqc -q -R . Proofs "$4.v") >"$scratch/output" 2>&1; then
        echo "mutant $1: not found" >&2
        exit 1
    fi
    echo "mutant $1: found, $(grep -m 1 '^File' "$scratch/output")"
}
unproved resolution constants 's/^Definition RESOLUTION : R := 8.0/Definition RESOLUTION : R := 6.0/' decisions
unproved band constants 's/^Definition GRAZING_BAND : R := 16.0/Definition GRAZING_BAND : R := 7.0/' decisions
unproved budget constants 's/^Definition MOTION_M : R := 1.5e-7/Definition MOTION_M : R := 2e-7/' margin
unproved grid constants 's/^Definition GRID_STEP : R := 60.0/Definition GRID_STEP : R := 50.0/' tube
unproved unbounded resolution 's/Rmin \((rounded (- start_rate \/ speed_squared))\) 1/\1/' decisions

# The replay of contract logs, by the functions that Coq extracts from replay.v.
cp replayer/extract.v replayer/replay.ml "$scratch/proofs"
(
    cd "$scratch/proofs"
    coqc -q -R . Proofs extract.v
    # Coq writes model.ml, with definitions that are not used.
    ocamlfind ocamlopt -package zarith -w -a -c model.mli model.ml
    ocamlfind ocamlopt -package zarith -linkpkg -w +a-4-9-40-41-42-44-45-70 model.cmx replay.ml -o replay
)
cp "$scratch/proofs/replay" replay
echo "proofs: $(wc -l <assumptions.txt) theorems hold, $(grep -c 'no axioms' assumptions.txt) of them without axioms"

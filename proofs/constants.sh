#!/bin/sh
# Prints constants.v: constants of the Rust code that bound its rounding, and check sums of the functions whose rounding
# is modelled. From anywhere: sh proofs/constants.sh [ROOT]
#
# ROOT is the root of the repository with the code.
set -eu
root=${1:-$(dirname "$0")/..}

# Prints the constants NAME of a file of the code, or with another name: constants FILE NAME[=OTHER]...
constants() {
    file=$1
    shift
    echo
    echo "(** \`$file\` *)"
    for name; do
        pattern="^ *\(pub\(([a-z]*)\)\{0,1\} \)\{0,1\}const ${name%=*}: [a-z0-9]* = \(.*\);\$"
        value=$(sed -n "s/$pattern/\3/p" "$root/$file")
        if [ "$(printf '%s\n' "$value" | grep -c .)" != 1 ]; then
            echo "$file: constant ${name%=*} is missing or defined twice" >&2
            exit 1
        fi
        echo "Definition ${name#*=} : R := $(printf '%s' "$value" | sed 's/f64::EPSILON/EPSILON/g; s/_//g')."
    done
}

# Prints the check sum of each function of a file, without comments and white space: functions FILE 'BEGIN OF A LINE'...
functions() {
    file=$1
    shift
    for begin; do
        text=$(awk -v begin="$begin" '
            !inside {
                k = index($0, begin)
                if (!k || substr($0, 1, k - 1) !~ /^ *(pub(\([a-z]*\))? )?$/) next
                inside = 1
                match($0, /^ */)
                closing = substr($0, 1, RLENGTH) "}"
            }
            {
                ends = $0 == closing || (begin ~ /^let / && /;$/)
                sub(/ *\/\/.*/, "")
                gsub(/ /, "")
                print
                if (ends) exit
            }' "$root/$file")
        if [ -z "$text" ]; then
            echo "$file: \`$begin\` is missing" >&2
            exit 1
        fi
        echo "- $(printf '%s' "$text" | cksum | cut -d ' ' -f 1) \`$begin\` of \`$file\`"
    done
}

cat <<'END'
(** * Constants of the Rust code that bound its rounding

    Written by `constants.sh` from the code. Literals are exact here; the code rounds them to doubles. *)

From Coq Require Import Reals.
Open Scope R_scope.

(** `f64::EPSILON` *)
Definition EPSILON : R := / 4503599627370496.
END
constants crates/audit/src/sweep.rs MIN_LIMIT_M MAX_LENGTH_M RESOLUTION
constants crates/audit/src/cross_check.rs GRAZING_BAND
constants crates/audit/src/pair_sweep.rs MARGIN OF_SCALE
constants crates/shield/src/settings.rs FARTHEST_M ROUNDING_M MOTION_M NORMAL_M STIFF_M UNIT_ROUNDOFF
constants crates/shield/src/plane.rs UNIT SINGLE
constants crates/shield/src/choice.rs ROUNDING=COMMAND_ROUNDING
constants crates/shield/src/report.rs ROUNDING=UNREPORTED
constants crates/shield/src/tube.rs CELL_RATE TERMS STATES GRID_STEP

echo
echo '(** Check sums of modelled functions. After a change, compare the function with its model:'
echo
functions crates/audit/src/sweep.rs 'fn larger(' 'fn new(' 'fn interpolated(' 'fn scale_squared(' 'fn resolution_m(' \
    'fn closest(' 'fn improve(' 'fn separation_m('
functions crates/audit/src/ledger.rs 'let is_surely_below'
functions crates/audit/src/cross_check.rs 'fn is_near(' 'fn grazing_band('
functions crates/audit/src/pair_sweep.rs 'fn with_cutoff(' 'fn add(' 'fn add_close(' 'fn straight(&self) ' \
    'fn interpolated('
functions crates/audit/src/segment.rs 'fn fraction('
functions crates/shield/src/plane.rs 'fn scaled(' 'fn stretch(' 'fn true_plane(' 'fn room_m(' 'fn contains(' \
    'fn owner_plane(' 'fn follower_plane(' 'fn unit(' 'fn is_valid('
functions crates/shield/src/settings.rs 'let margin_m ='
functions crates/shield/src/tube.rs 'fn exponential('
echo '*)'

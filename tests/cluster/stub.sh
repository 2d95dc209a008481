#!/bin/sh
# Stub of the program. Shard 1 fails with the code in the file `code`, once for each byte of the file `times`.
camp=$3
case $2 in
missing) [ ! -e "$camp/flown" ] || exit 0; echo 0-3; exit 1 ;;
shard)
    if [ "$5" = 1 ] && [ -s "$camp/times" ]; then
        printf x >> "$camp/begun"
        left=$(wc -c < "$camp/times")
        head -c $((left - 1)) /dev/zero > "$camp/times"
        echo "shard 1 is wrong" >&2
        exit "$(cat "$camp/code")"
    fi
    : > "$camp/flown" ;;
esac

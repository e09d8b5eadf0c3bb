#!/bin/sh
# check_symbols.sh NM LIBRARY
# The shared library shows tsuya_* and nothing else.
set -u

symbols=$("$1" -D --defined-only "$2" | awk '{ print $3 }') || exit 1
wrong=$(printf '%s\n' "$symbols" | grep -v '^tsuya_[a-z0-9_]*$')
if [ -n "$wrong" ]; then
    echo "$2 shows:"
    printf '%s\n' "$wrong"
    exit 1
fi
count=$(printf '%s\n' "$symbols" | wc -l)
echo "$count symbols, all tsuya_*"
[ "$count" -gt 50 ]

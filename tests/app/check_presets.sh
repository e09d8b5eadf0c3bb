#!/bin/sh
# check_presets.sh CMAKE SOURCE_FOLDER
# Every preset configures.
set -eu

cmake=$1 source=$2
stage=$(mktemp -d "${TMPDIR:-/tmp}/tsuya-presets-XXXXXX")
trap 'rm -rf "$stage"' EXIT

cd "$source"
for preset in release debug asan tsan coverage; do
    "$cmake" --preset "$preset" -B "$stage/$preset" >"$stage/log" 2>&1 || { echo "preset $preset:"; cat "$stage/log"; exit 1; }
    echo "$preset configures"
done
[ "$("$cmake" --list-presets | grep -c '^ *"')" = 5 ] || { "$cmake" --list-presets; echo "the presets and this list differ"; exit 1; }

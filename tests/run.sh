#!/bin/sh
# tests/run.sh BUILD JOBS LABEL_REGEX EXCLUDED_LABEL_REGEX
# Runs ctest, then names what was skipped (whole programs, and single cases inside them) and closes with the counts.
set -u

build=$1 jobs=$2 include=$3 exclude=$4
log=$build/tests.xml

set -- --test-dir "$build" -j "$jobs" --output-on-failure --no-tests=error \
    --output-junit "$(cd "$build" && pwd)/tests.xml" --test-output-size-passed 4000000 --test-output-size-failed 4000000
[ -n "$include" ] && set -- "$@" -L "$include"
[ -n "$exclude" ] && set -- "$@" -LE "$exclude"

rm -f "$log"
ctest "$@"
code=$?

if [ ! -f "$log" ]; then
    echo "0 passed, 1 failed, 0 skipped (ctest left no $log)"
    exit 1
fi

# A program that prints cmocka's lines counts by its cases, any other as one.
awk '
    function value(line, key) { return match(line, key "=\"[^\"]*\"") ? substr(line, RSTART + length(key) + 2, RLENGTH - length(key) - 3) : "" }
    function close_program() {
        if (program == "") return
        if (status == "fail") { failed += cases_failed > 0 ? cases_failed : 1; passed += cases_ok }
        else if (status == "notrun" || status == "disabled") { skipped += cases_skipped > 0 ? cases_skipped : 1; if (cases_skipped == 0) names[++count] = program }
        else if (cases_ok + cases_skipped > 0) { passed += cases_ok; skipped += cases_skipped }
        else passed++
        program = ""
    }
    /<testcase / {
        close_program()
        program = value($0, "name"); status = value($0, "status")
        cases_ok = cases_failed = cases_skipped = 0
    }
    /\[ +OK +\] / { cases_ok++ }
    /\[ +FAILED +\] [A-Za-z_]/ && !/test\(s\)/ { if (!((program, $0) in seen)) { seen[program, $0] = 1; cases_failed++ } }
    /\[ +SKIPPED +\] [A-Za-z_]/ && !/test\(s\)/ {
        key = $0; sub(/.*\] /, "", key)
        if (!((program, key) in seen)) { seen[program, key] = 1; cases_skipped++; names[++count] = program ": " key }
    }
    END {
        close_program()
        if (count > 0) print "\nSkipped (what they need is not here):"
        for (i = 1; i <= count; i++) print "    " names[i]
        printf "\n%d passed, %d failed, %d skipped\n", passed, failed, skipped
    }
' "$log"
exit $code

#!/bin/sh
# check_headers.sh COMPILER SOURCE_FOLDER HEADER...
# Every public header compiles alone as strict C17, and every header with TSUYA_API is in the list of public headers.
set -u

compiler=$1 source=$2
shift 2
failed=0

for header in "$@"; do
    if ! printf '#include "%s"\ntypedef int not_empty;\n' "$header" |
        "$compiler" -std=c17 -pedantic -Wall -Wextra -Werror -fsyntax-only -I "$source" -x c -; then
        echo "$header: does not compile alone as C17"
        failed=1
    fi
done

cd "$source" || exit 1
for header in "$@"; do
    for needed in $(sed -n 's/^#include "\(.*\)"/\1/p' "$header"); do
        case " $* " in
        *" $needed "*) ;;
        *)
            echo "$header: includes $needed, which is not in cmake/headers.cmake, so it would not be installed"
            failed=1
            ;;
        esac
    done
done
for header in $(grep -l '^TSUYA_\(MUST_CHECK TSUYA_\)\{0,1\}API ' core/*.h calib/*.h capture/*.h reconstruct/*.h weave_detect/*.h \
    brdf/*.h render/*.h 2>/dev/null); do
    case " $* " in
    *" $header "*) ;;
    *)
        echo "$header: declares TSUYA_API but is not in cmake/headers.cmake"
        failed=1
        ;;
    esac
done
exit $failed

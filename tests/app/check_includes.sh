#!/bin/sh
# check_includes.sh SOURCE_FOLDER
# Who may include whom, and that an outside library is included by one adapter file of a room.
set -u
cd "$1" || exit 1

find app brdf calib capture core reconstruct render weave_detect tests \
    \( -name '*.c' -o -name '*.h' -o -name '*.cpp' -o -name '*.hpp' \) -print | LC_ALL=C sort | xargs awk '
    BEGIN {
        may["core"] = " core "
        may["calib"] = " core calib "
        may["reconstruct"] = " core reconstruct "
        may["weave_detect"] = " core weave_detect "
        may["brdf"] = " core brdf "
        may["render"] = " core brdf render "
        may["capture"] = " core calib capture "
        may["app"] = may["tests"] = " core calib reconstruct weave_detect brdf render capture app tests support "
        rooms = " core calib reconstruct weave_detect brdf render capture app "
        n = split("assert complex ctype dirent dlfcn errno fcntl fenv ftw float immintrin inttypes limits locale math omp poll pthread " \
                  "pwd sched setjmp signal spawn stdalign stdarg stdatomic stdbool stddef stdint stdio stdlib string strings termios " \
                  "time unistd argp glob libgen malloc cmocka wchar", names, " ")
        for (i = 1; i <= n; i++) system_header[names[i] ".h"] = 1
        n = split("algorithm array iostream atomic cmath cstddef cstdint cstdio cstdlib cstring exception limits map memory mutex new set sstream " \
                  "stdexcept string unordered_map unordered_set utility vector functional numeric random", names, " ")
        for (i = 1; i <= n; i++) system_header[names[i]] = 1
    }
    function complain(what) { printf "%s:%d: %s\n", FILENAME, FNR, what; failed = 1 }
    FNR == 1 {
        room = FILENAME; sub(/\/.*/, "", room)
        studio = FILENAME ~ /^capture\/(studio|simulate)/
        if (FILENAME ~ /\.cpp$/ && room != "tests" && FILENAME !~ /(_adapter|image_opencv)\.cpp$/) complain("C++ outside an adapter")
    }
    /^[ \t]*#[ \t]*include[ \t]/ {
        name = $0
        sub(/^[^"<]*["<]/, "", name); sub(/[">].*/, "", name)
        head = name; sub(/\/.*/, "", head)
        if (index(rooms, " " head " ") && name ~ /\//) {
            if (index(may[room], " " head " ")) next
            if (studio && (head == "render" || head == "brdf")) next
            complain(room " may not include " name)
            next
        }
        if ($0 ~ /"/) {
            if (room == "tests") next
            complain("\"" name "\": project headers are named from the root, others stand in <>")
            next
        }
        if (name in system_header || name ~ /^(sys|linux|arpa|netinet)\//) next
        library = tolower(head)
        sub(/\.h$/, "", library); sub(/_.*$/, "", library)
        if (room == "tests") next
        key = room " " library
        if ((key in adapter) && adapter[key] != FILENAME) complain(library " is already included by " adapter[key])
        adapter[key] = FILENAME
    }
    END {
        for (key in adapter) print "note: " key " -> " adapter[key]
        exit failed
    }
'

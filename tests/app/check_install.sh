#!/bin/sh
# check_install.sh CMAKE BUILD_FOLDER SOURCE_FOLDER COMPILER NM
# Installs into a folder of its own, then builds and runs README's library example with the installed pkg-config file, shared
# and static, and looks for program, man page, completion and documents.
set -eu

cmake=$1 build=$2 source=$3 compiler=$4 nm=$5
stage=$(mktemp -d "${TMPDIR:-/tmp}/tsuya-install-XXXXXX")
trap 'rm -rf "$stage"' EXIT

DESTDIR=$stage "$cmake" --install "$build" >"$stage/log"
prefix=$(sed -n 's/^prefix=//p' "$build/tsuya.pc")
libraries=$(find "$stage$prefix" -name libtsuya.so -exec dirname {} \;)
export PKG_CONFIG_PATH="$libraries/pkgconfig"
package() { pkg-config --define-variable=prefix="$stage$prefix" "$@" tsuya; }

for file in bin/tsuya share/man/man1/tsuya.1 share/bash-completion/completions/tsuya share/zsh/site-functions/_tsuya; do
    [ -s "$stage$prefix/$file" ] || { echo "$file is not installed"; exit 1; }
done
[ -n "$(find "$stage$prefix" -name conventions.md)" ] || { echo "docs/conventions.md is not installed"; exit 1; }

awk '/^```c$/ { inside = 1; next } /^```$/ { inside = 0 } inside' "$source/README.md" >"$stage/example.c"
cat >"$stage/mesh.ply" <<'PLY'
ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
PLY

expected="3 vertices, 1 triangles, 0.5 m2"
check() {
    answer=$(LD_LIBRARY_PATH="$libraries" "$1" "$stage/mesh.ply") || { echo "$1 failed"; exit 1; }
    [ "$answer" = "$expected" ] || { echo "$1 says '$answer'"; exit 1; }
}
cd "$stage"
"$compiler" -std=c17 -Wall -Wextra -Werror -o shared example.c $(package --cflags --libs)
check ./shared
"$compiler" -std=c17 -o static example.c $(package --cflags) "$libraries/libtsuya.a" \
    $(package --static --libs | sed 's/-ltsuya //')
check ./static
[ "$(LD_LIBRARY_PATH="$libraries" "$stage$prefix/bin/tsuya" --version)" = "tsuya $(package --modversion)" ] ||
    { echo "program and pkg-config file differ in their version"; exit 1; }

# Every installed header compiles alone, as C and as C++.
for header in $(cd "$stage$prefix/include/tsuya" && find . -name '*.h' | sed 's|^\./||'); do
    echo "#include <$header>"
done >all.h
"$compiler" -std=c17 -Wall -Wextra -Werror -fsyntax-only $(package --cflags) -x c all.h

# The archive's strong symbols are tsuya_* too, so that it meets no other library's.
wrong=$("$nm" -g --defined-only "$libraries/libtsuya.a" 2>/dev/null |
    awk 'NF == 3 && $2 !~ /[WVu]/ && $3 !~ /^(tsuya_|\.gomp_critical_user_tsuya_)/ { print $3 }')
[ -z "$wrong" ] || { echo "libtsuya.a shows: $wrong"; exit 1; }
echo "installed, shared and static example run"

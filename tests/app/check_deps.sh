#!/bin/sh
# check_deps.sh SOURCE_FOLDER
# deps/install.sh on other systems, as another user, with and without sudo; programs that would change this one are stood in for.
set -u

source=$1
stage=$(mktemp -d "${TMPDIR:-/tmp}/tsuya-deps-XXXXXX")
trap 'rm -rf "$stage"' EXIT
failed=0
complain() {
    echo "$*:"
    sed 's/^/    /' "$stage/out"
    failed=1
}
says() { grep -qF -- "$1" "$stage/out"; }

# A PATH with what the script uses and nothing else.
for program in sh sed tr cat dirname grep env; do
    ln -s "$(command -v "$program")" "$stage/$program"
done
stand_in() { # NAME BODY
    printf '#!/bin/sh\n%s\n' "$2" >"$stage/$1"
    chmod +x "$stage/$1"
}
stand_in dpkg-query 'for last; do :; done; [ "$last" = colmap ] && exit 1; [ "$last" = cmake ] && { printf not-installed; exit 0; }; printf installed'
stand_in apt-get 'echo "APT $*"'
run() { PATH="$stage" TSUYA_OS_RELEASE="$stage/os-release" sh "$source/deps/install.sh" >"$stage/out" 2>&1; }

printf 'ID=fedora\nVERSION_ID=41\n' >"$stage/os-release"
stand_in id 'echo 0'
run && complain "another system is not refused"
says "fedora 41" && says "    colmap" && says "SKIP_DEPS=1" && ! says "APT" || complain "another system: the packages and the way on are not said"
rm "$stage/os-release"
run && complain "an unknown system is not refused"
SKIP_DEPS=1 run || complain "SKIP_DEPS=1 is not heard"
[ -s "$stage/out" ] && complain "SKIP_DEPS=1 is not quiet"

printf 'ID=debian\nVERSION_ID="12"\n' >"$stage/os-release"
run || complain "root: installing fails"
[ "$(grep -n 'missing and will be installed' "$stage/out" | cut -d: -f1)" = 1 ] && [ "$(sed -n 2,3p "$stage/out" | tr -d ' \n')" = cmakecolmap ] ||
    complain "root: what is missing is not listed first"
says "APT update" && says "APT install -y -q --no-install-recommends cmake colmap" || complain "root: apt-get is not called for what is missing"

stand_in id 'echo 1000'
run && complain "without root and sudo: no failure"
says "there is no sudo" && says "apt-get install --no-install-recommends cmake colmap" && ! says "APT" ||
    complain "without root and sudo: what to run as root is not said"
stand_in sudo 'echo "SUDO $*"; "$@"'
run || complain "with sudo: installing fails"
says "SUDO env DEBIAN_FRONTEND=noninteractive apt-get install" || complain "with sudo: it is not used"

stand_in dpkg-query 'printf installed'
run || complain "nothing is missing: a failure"
[ -s "$stage/out" ] && complain "nothing is missing: not quiet"
exit $failed

#!/bin/sh
# Installs the packages of deps/debian-12.txt that are missing; lists them first.  Quick when nothing is missing.
set -eu

list="$(dirname "$0")/debian-12.txt"

if [ "${SKIP_DEPS:-}" = 1 ]; then
    exit 0
fi

wanted() {
    sed -e 's/#.*//' -e '/^[[:space:]]*$/d' "$list" | tr -d ' \t'
}

other_system() {
    echo "tsuya: this system ($1) is not Debian 12, so nothing is installed by itself." >&2
    echo "Install what these Debian packages hold by your system's own means:" >&2
    wanted | sed 's/^/    /' >&2
    echo "then run the command again with SKIP_DEPS=1, for example: make test SKIP_DEPS=1" >&2
    exit 1
}

system=unknown
release=
os_release=${TSUYA_OS_RELEASE:-/etc/os-release} # tests stand one in
if [ -r "$os_release" ]; then
    system=$(. "$os_release" && echo "${ID:-unknown}")
    release=$(. "$os_release" && echo "${VERSION_ID:-}")
fi
if [ "$system" != debian ] || [ "${release%%.*}" != 12 ]; then
    other_system "$system $release"
fi

missing=
for package in $(wanted); do
    state=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)
    [ "$state" = installed ] || missing="$missing $package"
done
if [ -z "$missing" ]; then
    exit 0
fi

echo "tsuya: these Debian packages are missing and will be installed:"
for package in $missing; do
    echo "    $package"
done

as_root=
if [ "$(id -u)" -ne 0 ]; then
    if ! command -v sudo >/dev/null 2>&1; then
        echo "tsuya: installing needs root, and there is no sudo here. As root, run:" >&2
        echo "    apt-get install --no-install-recommends$missing" >&2
        exit 1
    fi
    as_root=sudo
fi

run_apt() {
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get "$@"
}
run_apt update -q
run_apt install -y -q --no-install-recommends $missing

#!/usr/bin/env bash
# Run the tests against Debian 13's own DOLFINx, in a root folder built like the container image, without a container engine.
#
#   docker/test-debian.sh [pytest arguments]   build or reuse the root, install impactfem, run the tests as a normal user
#   docker/test-debian.sh --shell [COMMAND]    a shell (or one command) in it
#   docker/test-debian.sh --remove             remove the root
#
# Needs the root user and mmdebstrap. Ends with status 77 where such a root cannot be made at all.
# Environment: DEBIAN_TESTS, which of .ci/test (default "versions"; "all" before a release), DEBIAN_ROOT (default .debian-root), DEBIAN_MIRROR (default http://deb.debian.org/debian).
set -euo pipefail
repo=$(cd "$(dirname "$0")/.." && pwd)
root=${DEBIAN_ROOT:-$repo/.debian-root}
cannot=77

if [ "${1:-}" = --remove ]; then
    # Mounts live in a namespace of their own (below); one left here by hand must not be emptied.
    if grep -q " $root/" /proc/mounts; then
        echo "$root has file systems mounted inside: unmount them first." >&2
        exit 1
    fi
    rm -rf --one-file-system "$root"
    exit
fi

if [ "${IN_NAMESPACE:-}" != yes ]; then
    if [ "$(id -u)" != 0 ]; then
        echo "make test-debian needs the root user (it makes a Debian 13 root folder and changes into it)." >&2
        exit $cannot
    fi
    if ! command -v mmdebstrap >/dev/null; then
        echo "make test-debian needs mmdebstrap: apt-get install mmdebstrap" >&2
        exit $cannot
    fi
    if ! unshare --mount --pid --fork true 2>/dev/null; then
        echo "make test-debian needs mount and process namespaces, which this machine (a plain container?) does not allow." >&2
        exit $cannot
    fi
    # In a mount namespace of its own nothing stays mounted and no process stays behind, however this ends.
    IN_NAMESPACE=yes exec unshare --mount --propagation private --pid --fork --kill-child "$0" "$@"
fi

inside() { # as root
    chroot "$root" env -i HOME=/root PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 \
        ${http_proxy:+http_proxy="$http_proxy"} ${https_proxy:+https_proxy="$https_proxy"} "$@"
}

inside_as_user() {
    # The settings are those of the Dockerfile.
    chroot --userspec=impactfem:impactfem "$root" env -i HOME=/home/impactfem PATH=/usr/local/bin:/usr/bin:/bin \
        LANG=C.UTF-8 OMP_NUM_THREADS=1 XDG_CACHE_HOME=/var/cache/impactfem MPLCONFIGDIR=/var/cache/impactfem/matplotlib \
        PRTE_MCA_rmaps_default_mapping_policy=:oversubscribe OMPI_MCA_btl=self,sm \
        TEST_PYTHON=/usr/bin/python3 MPI_TIMEOUT="${MPI_TIMEOUT:-1200}" \
        sh -c 'cd /home/impactfem/source && exec "$@"' sh "$@"
}

mount_kernel_file_systems() {
    mount -t proc proc "$root/proc"
    mount -t sysfs -o ro sysfs "$root/sys"
    mount --rbind /dev "$root/dev"
    mount -t tmpfs -o mode=1777,size=50% tmpfs "$root/dev/shm"
}

wanted=$(cat "$repo/docker/packages.txt" "$repo/docker/dpkg-excludes" | sha256sum)
if [ "$(cat "$root/packages.sha256" 2>/dev/null)" = "$wanted" ]; then
    echo "Debian root: $root (packages unchanged)"
    mount_kernel_file_systems
else
    echo "Debian root: building $root (two minutes, 3 GB) ..."
    "$0" --remove
    mkdir -p "$root"
    # trixie-updates and security fixes do not matter for a test
    mmdebstrap --quiet --variant=minbase trixie "$root" "${DEBIAN_MIRROR:-http://deb.debian.org/debian}"
    mount_kernel_file_systems
    cp -L /etc/resolv.conf "$root/etc/resolv.conf"
    mkdir -p "$root/opt/impactfem/docker"
    cp "$repo"/docker/{install.sh,packages.txt,dpkg-excludes} "$root/opt/impactfem/docker/"
    inside /opt/impactfem/docker/install.sh packages >"$root/install.log" 2>&1 || {
        tail -n 20 "$root/install.log"
        exit 1
    }
    printf '%s\n' "$wanted" >"$root/packages.sha256"
fi
cp "$repo"/docker/{install.sh,packages.txt,dpkg-excludes} "$root/opt/impactfem/docker/"

# The working tree as git sees it, without what is ignored.
copy=$root/home/impactfem/source
rm -rf "$copy"
mkdir -p "$copy"
(cd "$repo" && git ls-files -z --cached --others --exclude-standard |
    while IFS= read -r -d '' name; do [ ! -e "$name" ] || printf '%s\0' "$name"; done |
    tar --create --no-recursion --null --files-from=- --file=-) | tar -xf - -C "$copy" --no-same-owner
chown -R 1000:1000 "$copy"

inside /opt/impactfem/docker/install.sh package /home/impactfem/source

# mpi-pytest is not packaged in Debian: fetched here, where pip is configured, and installed there.
if ! inside python3 -c 'import pytest_mpi' 2>/dev/null; then
    wheels=$root/tmp/wheels
    rm -rf "$wheels"
    fetcher=$repo/.venv/bin/python
    [ -x "$fetcher" ] || fetcher=$("$repo/.ci/find-python" 2>/dev/null) || fetcher=python3
    if "$fetcher" -m pip download --quiet --no-deps --only-binary :all: --dest "$wheels" 'mpi-pytest>=2025.1' >"$root/pip.log" 2>&1 &&
        inside python3 -m pip install --quiet --no-deps --no-index --find-links /tmp/wheels --break-system-packages \
            --root-user-action=ignore mpi-pytest; then
        :
    else
        echo "mpi-pytest could not be fetched: going on without the tests on several ranks." >&2
    fi
fi

if [ "${1:-}" = --shell ]; then
    shift
    [ $# -gt 0 ] || set -- bash
    inside_as_user "$@"
    exit
fi

status=0
echo "== image step: warm the form cache"
inside_as_user /opt/impactfem/docker/install.sh warm || status=1
inside_as_user python3 -P -c '
from mpi4py import MPI
import dolfinx, impactfem, petsc4py, sys
print("Debian: Python", sys.version.split()[0], "DOLFINx", dolfinx.__version__, "petsc4py", petsc4py.__version__)
print("tested:", impactfem.__file__)
'
inside_as_user .ci/test "${DEBIAN_TESTS:-versions}" "$@" || status=1
exit $status

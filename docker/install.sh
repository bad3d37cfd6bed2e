#!/bin/sh
# Turn a bare Debian 13 into the impactfem image. Both docker/Dockerfile and docker/test-debian.sh run these steps:
#
#   install.sh packages        Debian's packages, listed in packages.txt beside this script, and the user (as root)
#   install.sh package SOURCE  impactfem itself, from its source folder, and the demos into the user's home (as root)
#                              VERSION=X.Y.Z in the environment names its version, which the copied source does not know
#   install.sh warm            compile what the methods need, so that a first run need not (as the user)
set -eu
here=$(cd "$(dirname "$0")" && pwd)
user=impactfem
home=/home/$user
cache=/var/cache/impactfem

case "${1:-}" in
packages)
    export DEBIAN_FRONTEND=noninteractive
    cp "$here/dpkg-excludes" /etc/dpkg/dpkg.cfg.d/impactfem
    # A mirror that does not answer once is asked again.
    echo 'Acquire::Retries "3";' >/etc/apt/apt.conf.d/impactfem
    apt-get update -q
    sed 's/#.*//' "$here/packages.txt" | xargs apt-get install -q -y --no-install-recommends
    apt-get clean
    rm -rf /var/lib/apt/lists/*
    id "$user" >/dev/null 2>&1 || useradd --create-home --uid 1000 --shell /bin/bash "$user"
    # Compiled forms are kept for any user the container runs as, not only this one.
    mkdir -p "$cache/fenics" "$cache/matplotlib"
    chmod -R 1777 "$cache"
    ;;
package)
    # Debian's packages are the dependencies: --no-deps keeps pip from replacing any of them.
    work=$(mktemp -d)
    cp -R "$2/pyproject.toml" "$2/README.md" "$2/LICENSE" "$2/LICENSE.GPL" "$2/impactfem" "$work"
    # No history is copied: without VERSION it is the fallback of pyproject.toml.
    [ -z "${VERSION:-}" ] || export SETUPTOOLS_SCM_PRETEND_VERSION_FOR_IMPACTFEM="$VERSION"
    python3 -m pip install --quiet --no-deps --no-build-isolation --no-index --break-system-packages \
        --root-user-action=ignore --force-reinstall "$work"
    rm -rf "$work"
    # A demo's scene may be a link into the package: -L makes it a file of its own.
    rm -rf "$home/demos" "$home/meshes"
    cp -RL "$2/demos" "$2/meshes" "$home"
    mkdir -p "$home/results"
    chown -R "$user:$user" "$home/demos" "$home/meshes" "$home/results"
    # For containers run as another user: Debian closes homes to others.
    chmod 755 "$home"
    chmod 1777 "$home/results"
    ;;
warm)
    work=$(mktemp -d)
    cd "$home"
    export XDG_CACHE_HOME=$cache MPLCONFIGDIR=$cache/matplotlib OMP_NUM_THREADS=1
    impactfem run demos/bar_impact/scene.toml --out "$work/demo" --quiet
    # The other methods' compiled code as well; not every method need fit the demo.
    for method in $(impactfem methods | cut -d ' ' -f 1); do
        impactfem run demos/bar_impact/scene.toml --set "solve.method=$method" --out "$work/$method" --quiet \
            >/dev/null 2>&1 || true
    done
    rm -rf "$work"
    # Numba refuses to work where it may read its cache but not add to it.
    find "$cache" -user "$user" -type d -exec chmod 1777 {} +
    find "$cache" -user "$user" -type f -exec chmod a+rX {} +
    ;;
*)
    sed -n '2,7s/^# \{0,1\}//p' "$0" >&2
    exit 2
    ;;
esac

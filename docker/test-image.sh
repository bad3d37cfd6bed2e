#!/usr/bin/env bash
# Build the container image with buildah and run the demo in it, on one and on two ranks: no container engine, no registry.
#
# Its base is the root of docker/test-debian.sh, made if it is not there: what install.sh does to a bare Debian has been done to it.
# Needs the root user, mmdebstrap and buildah. Ends with status 77 where that cannot work at all.
# Environment: DEBIAN_ROOT and DEBIAN_MIRROR as for test-debian.sh; IMAGE_STORE (default .image-store) holds the image during the test.
set -euo pipefail
repo=$(cd "$(dirname "$0")/.." && pwd)
root=${DEBIAN_ROOT:-$repo/.debian-root}
store=${IMAGE_STORE:-$repo/.image-store}
cannot=77

if [ "${IN_NAMESPACE:-}" != image ]; then
    if [ "$(id -u)" != 0 ] || ! command -v buildah >/dev/null; then
        echo "make test-image needs the root user, mmdebstrap and buildah: apt-get install mmdebstrap buildah" >&2
        exit $cannot
    fi
    "$repo/docker/test-debian.sh" --shell true # ends with 77 where it needs what this machine does not allow
    # What is mounted here, and what ranks leave in /dev/shm, is gone at the end.
    IN_NAMESPACE=image exec unshare --mount --propagation private --pid --fork --kill-child --mount-proc "$0" "$@"
fi
mount -t tmpfs -o mode=1777,size=50% tmpfs /dev/shm
clear_store() { rm -rf --one-file-system "$store"; }
trap clear_store EXIT

for driver in overlay vfs; do # the first is quicker, but not everywhere: not in a container that is itself of overlays
    clear_store
    said=/dev/stderr
    [ "$driver" != overlay ] || said=/dev/null
    buildah=(buildah --root "$store/layers" --runroot "$store/run" --storage-driver "$driver")
    base=$("${buildah[@]}" from scratch 2>$said) && folder=$("${buildah[@]}" mount "$base" 2>$said) && break
    [ "$driver" = overlay ] || exit $cannot
done

echo "== base image (storage: $driver)"
# Without what the later steps of the image make.
tar -C "$root" --one-file-system -cf - --exclude='./proc/*' --exclude='./sys/*' --exclude='./dev/*' --exclude='./tmp/*' \
    --exclude='./home/impactfem/*' --exclude='./var/cache/impactfem/*/*' --exclude='./usr/local/bin/*' \
    --exclude='./usr/local/lib/python3*/dist-packages/*' --exclude=./opt/impactfem . | tar -C "$folder" -xf -
"${buildah[@]}" umount "$base" >/dev/null
"${buildah[@]}" commit --quiet --rm "$base" debian:trixie >/dev/null

echo "== docker/Dockerfile"
"${buildah[@]}" bud --isolation chroot --pull-never --tag impactfem --file "$repo/docker/Dockerfile" "$repo" >"$store/build.log" 2>&1 || {
    tail -n 30 "$store/build.log"
    exit 1
}
"${buildah[@]}" images --format '{{.Name}}: {{.Size}}' impactfem

container=$("${buildah[@]}" from --pull-never impactfem)
inside() { "${buildah[@]}" run --isolation chroot "$container" -- "$@"; }
scene=(impactfem run demos/bar_impact/scene.toml --quiet --out)
echo "== in the image: doctor, the demo on one rank and on two"
inside impactfem doctor
inside "${scene[@]}" results/one
inside mpirun -n 2 "${scene[@]}" results/two >"$store/said" 2>&1 || {
    cat "$store/said"
    exit 1
}
if [ -s "$store/said" ]; then
    echo "a quiet run on two ranks says:"
    cat "$store/said"
    exit 1
fi
inside python3 -c '
import json
one, two = (json.load(open(f"results/{n}/summary.json")) for n in ("one", "two"))
impulse = one["contact"]["impulse"], two["contact"]["impulse"]
print("ranks:", one["ranks"], two["ranks"], " impulse [N s]:", *impulse)
assert (one["ranks"], two["ranks"]) == (1, 2)
assert abs(impulse[1] - impulse[0]) <= 1e-10 * impulse[0]'

#!/usr/bin/env bash
# Run the scene on several MPI ranks: run.sh [RANKS] (default 2). Writes results/bar_impact in the current folder.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
ranks=${1:-2}
# `make setup` makes .venv; elsewhere (Debian, container) both commands are on PATH.
bin=$here/../../.venv/bin
if [ -x "$bin/impactfem" ]; then
    PATH=$bin:$PATH
fi
exec mpirun -n "$ranks" impactfem run "$here/scene.toml" --out results/bar_impact

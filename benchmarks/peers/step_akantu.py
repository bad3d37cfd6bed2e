"""Explicit steps of Akantu: a ball of its elastic law for finite deformation, in flight.

    python step_akantu.py MESH.msh E NU RHO STEPS

Central differences with lumped masses, no contact; prints JSON: seconds of the process for the
median step, step of time [s], nodes, cells. It needs nothing but Akantu, and may run with another
interpreter than the one that starts it.
"""

import json
import statistics
import sys
import tempfile
import time
from pathlib import Path

import akantu as aka

LAW = """material elastic [
  name = rubber
  rho = {density}
  E = {young}
  nu = {poisson}
  finite_deformation = true
]
"""


def run(path: str, young: str, poisson: str, density: str, steps: int) -> dict[str, float]:
    """Time of a step."""
    with tempfile.TemporaryDirectory() as folder:
        law = Path(folder) / "law.dat"
        law.write_text(LAW.format(young=young, poisson=poisson, density=density), encoding="utf-8")
        aka.parseInput(str(law))
    mesh = aka.Mesh(3)
    mesh.read(path)
    model = aka.SolidMechanicsModel(mesh)
    model.initFull(_analysis_method=aka._explicit_lumped_mass)  # noqa: SLF001
    dt = 0.6 * model.getStableTimeStep()
    model.setTimeStep(dt)
    places, velocity = mesh.getNodes(), model.getVelocity()
    velocity[:, 0] = 30.0 * (places[:, 2] - places[:, 2].mean())  # spins at 30/s
    velocity[:, 2] = -2.0 - 30.0 * places[:, 0]
    times = []
    for _ in range(steps):
        begin = time.process_time()
        model.solveStep()
        times.append(time.process_time() - begin)
    cells = mesh.getNbElement(type=aka._tetrahedron_4)  # noqa: SLF001
    return {"step": statistics.median(times), "dt": dt, "nodes": len(places), "cells": cells}


if __name__ == "__main__":
    print(json.dumps(run(*sys.argv[1:5], int(sys.argv[5]))))

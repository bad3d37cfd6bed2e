"""Top or chain of `rigid_peers.py` in Exudyn: python rigid_exudyn.py CASE as JSON.

Bodies with redundant coordinates. The top by an explicit Lie group Runge-Kutta step of order 4, the
chain by joints and the implicit trapezoid of index 2. Boxes on boxes are not among its contacts.
"""

import contextlib
import io
import json
import sys
import time

import exudyn as exu
import numpy as np
from exudyn.rigidBodyUtilities import RigidBodyInertia


def run(case: dict) -> dict:
    """What the case asks for, and seconds."""
    container = exu.SystemContainer()
    system, spins = container.AddSystem(), []
    if case["kind"] == "top":
        system.CreateRigidBody(
            inertia=RigidBodyInertia(1.0, np.diag([1.0, 2.0, 3.0])),
            nodeType=exu.NodeType.RotationRotationVector,
            initialAngularVelocity=case["spin"], gravity=case["gravity"],
        )  # fmt: skip
    else:
        length, mass = case["link"]
        about = np.eye(3) * mass * length**2 / 12.0
        last = system.CreateGround()
        for k in range(case["links"]):
            link = system.CreateRigidBody(
                inertia=RigidBodyInertia(mass, about), gravity=case["gravity"],
                referencePosition=[(k + 0.5) * length, 0.0, 0.0],
            )  # fmt: skip
            system.CreateRevoluteJoint(
                itemNumbers=[last, link], position=[k * length, 0.0, 0.0], axis=[0.0, 0.0, 1.0],
                useGlobalFrame=True,
            )  # fmt: skip
            last = link

    def look(at: object, _: float) -> bool:
        spins.append(
            float(at.GetObjectOutputBody(0, exu.OutputVariableType.AngularVelocityLocal)[1])
        )
        return True

    if case["kind"] == "top":
        system.SetPreStepUserFunction(look)
    system.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = round(case["duration"] / case["dt"])
    settings.timeIntegration.endTime = case["duration"]
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.timeIntegration.newton.relativeTolerance = 1e-10
    settings.timeIntegration.newton.absoluteTolerance = 1e-12
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    kinds = exu.DynamicSolverType
    kind = kinds.RK44 if case["kind"] == "top" else kinds.TrapezoidalIndex2
    begin = time.process_time()
    system.SolveDynamic(settings, solverType=kind)
    seconds = time.process_time() - begin
    found = {"seconds": seconds, "version": exu.__version__}
    if case["kind"] == "top":
        return found | {"spins": spins[1:]}
    place = exu.OutputVariableType.Position
    tip = system.GetObjectOutputBody(last, place, [0.5 * length, 0.0, 0.0])
    return found | {"tip": list(tip[:2])}


if __name__ == "__main__":
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        found = run(json.loads(sys.argv[1]))
    print(json.dumps(found))

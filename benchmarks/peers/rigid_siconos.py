"""A scene of `rigid_peers.py` in Siconos: python rigid_siconos.py CASE as JSON.

Moreau's and Jean's step with theta = 1/2, impact and friction on velocities, nonsmooth Gauss-Seidel
with at most 1000 sweeps. A ball on the floor has the exact relation of a sphere and a plane and
forces to 1e-14; boxes are Bullet's (margins of 20 mm inside, four perturbations that look for
points: the best of those tried) with forces to 1e-10, and settle for 1 s, not timed, before they
are pulled. What `rigid_peers.py` has along y is along z here, as Bullet's planes have it.
"""

import json
import os
import sys
import time

import numpy as np
import siconos.kernel as sk
import siconos.numerics as sn
from siconos.mechanics.collision import (
    RigidBodyDS,
    SiconosBox,
    SiconosContactor,
    SiconosContactorSet,
    SiconosPlane,
)
from siconos.mechanics.collision.bodies import SphereNEDS, SphereNEDSPlanR
from siconos.mechanics.collision.bullet import SiconosBulletCollisionManager, SiconosBulletOptions

SETTLE, VERSION = 1.0, "4.4.0"


def pulled(case: dict, body: object, mass: float, *, aside: bool = True) -> None:
    """Let gravity act, with z up; along the floor only if asked for."""
    x, y, z = upright(case["gravity"])
    body.setFExtPtr([mass * x * aside, mass * y, mass * z])


def upright(vector: list) -> list:
    """A vector with y up as one with z up."""
    x, y, z = vector
    return [x, -z, y]


def contactor(shape: object) -> SiconosContactor:
    """A shape with a margin of Bullet inside, none outside."""
    shape.setInsideMargin(0.02)
    shape.setOutsideMargin(0.0)
    return SiconosContactor(shape)


def made(case: dict, law: object) -> tuple:
    """Bodies, relations and Bullet's manager, the last two if any."""
    ball, x = case.get("ball", False), case.get("speed", 0.0)
    if ball:
        about, spin = 0.4 * 0.1**2, case.get("rolls", 0.0)
        place = [0.0, 0.0, case["heights"][0], 1.0, 0.0, 0.0, 0.0]
        rates = [x, 0.0, case.get("falls", 0.0), *upright([0.0, 0.0, spin])]
        body = SphereNEDS(0.1, 1.0, np.diag([about] * 3), place, rates)
        return [body], [sk.Interaction(law, SphereNEDSPlanR(0.1, 0.0, 0.0, 1.0, 0.0))], None
    if case["kind"] == "top":
        inertia = np.diag([1.0, 2.0, 3.0])
        rates = [0.0, 0.0, 0.0, *case["spin"]]
        return [sk.NewtonEulerDS([0.0] * 3 + [1.0, 0.0, 0.0, 0.0], rates, 1.0, inertia)], [], None
    options = SiconosBulletOptions()
    options.worldScale, options.contactBreakingThreshold = 1.0, 0.02
    options.perturbationIterations = options.minimumPointsPerturbationThreshold = 4
    manager = SiconosBulletCollisionManager(options)
    manager.insertNonSmoothLaw(law, 0, 0)
    ground, bodies = SiconosContactorSet(), []
    ground.append(contactor(SiconosPlane()))
    manager.insertStaticContactorSet(ground, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    for mass, z in zip(case["masses"], case["heights"], strict=True):
        shapes = SiconosContactorSet()
        shapes.append(contactor(SiconosBox(0.2, 0.2, 0.1)))
        body = RigidBodyDS([0.0, 0.0, z, 1.0, 0.0, 0.0, 0.0], [0.0] * 6, mass)
        body.setUseContactorInertia(False)
        body.setInertia(*(mass / 12.0 * np.array([0.05, 0.05, 0.08])).tolist())
        body.setContactors(shapes)
        bodies.append(body)
    return bodies, [], manager


def pressing(system: object, dt: float) -> float:
    """Force of the ground in the last step [N]."""
    pushes = system.topology().indexSet(1).interactions()
    return sum(float(each.lambda_(1)[0]) / dt for each in pushes if not each.has2Bodies())


def run(case: dict) -> dict:
    """What the case asks for, and seconds."""
    dt, still = case["dt"], case["kind"] == "floor" and not case.get("ball", False)
    settling, steps = round(SETTLE / dt) if still else 0, round(case["duration"] / dt)
    system = sk.NonSmoothDynamicalSystem(0.0, dt * (settling + steps + 1))
    mu, back = case.get("mu", 0.0), case.get("restitution", 0.0)
    bodies, relations, manager = made(case, sk.NewtonImpactFrictionNSL(back, back, mu, 3))
    masses = case.get("masses", [1.0])
    for body, mass in zip(bodies, masses, strict=True):
        pulled(case, body, mass, aside=not still)
        system.insertDynamicalSystem(body)
    for relation in relations:
        system.link(relation, bodies[0])
    simulation = sk.TimeStepping(system, sk.TimeDiscretisation(0.0, dt))
    simulation.insertIntegrator(sk.MoreauJeanOSI(0.5))
    cones = sk.FrictionContact(3)
    cones.setNumericsVerboseMode(False)
    cones.numericsSolverOptions().iparam[sn.SICONOS_IPARAM_MAX_ITER] = 1000
    cones.numericsSolverOptions().dparam[sn.SICONOS_DPARAM_TOL] = 1e-14 if relations else 1e-10
    simulation.insertNonSmoothProblem(cones)
    simulation.setNewtonOptions(sk.SICONOS_TS_NONLINEAR)
    simulation.setNewtonTolerance(1e-12)
    if manager is not None:
        simulation.insertInteractionManager(manager)
    spins, start, begin = [], 0.0, time.process_time()
    for k in range(settling + steps):
        if k == settling:
            for body, mass in zip(bodies, masses, strict=True):
                pulled(case, body, mass)
            start, begin = float(bodies[0].q()[0]), time.process_time()
        simulation.computeOneStep()
        if case["kind"] == "top":
            spins.append(float(bodies[0].velocity()[4]))
        simulation.nextStep()
    seconds, body = time.process_time() - begin, bodies[0]
    return {
        "seconds": seconds, "version": VERSION, "spins": spins,
        "way": float(body.q()[0]) - start, "speed": float(body.velocity()[0]),
        "rolls": -float(body.velocity()[4]),
        "force": pressing(system, dt) if case["kind"] == "floor" else 0.0,
    }  # fmt: skip


if __name__ == "__main__":
    # Its library prints to the standard output.
    own = os.dup(1)
    os.dup2(2, 1)
    found = run(json.loads(sys.argv[1]))
    os.write(own, (json.dumps(found) + "\n").encode())

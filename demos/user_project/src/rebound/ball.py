"""A rubber ball that falls on a rigid floor: its scene, its run, and what is read from it."""

import math
from dataclasses import dataclass

import impactfem

GRAVITY = 9.81  # [m/s^2]
RADIUS = 0.02  # [m]
GAP = 2e-4  # [m] between ball and floor at the start of the run


@dataclass(frozen=True)
class Case:
    """One point of the study.

    Attributes:
        height: From which the ball falls [m].
        damping: Rayleigh damping of its material, proportional to stiffness [s].
        mesh_size: Size of the elements at the contact [m].
    """

    height: float
    damping: float
    mesh_size: float = 1e-3

    @property
    def speed(self) -> float:
        """Speed at the floor [m/s]."""
        return math.sqrt(2.0 * GRAVITY * self.height)


@dataclass(frozen=True)
class Rebound:
    """What came out of a case.

    Attributes:
        case: The case.
        restitution: Speed after over speed before.
        max_force: Largest contact force [N].
        contact_time: From first touch to release [s].
        energy_error: Largest gain of energy, over the energy at the start.
    """

    case: Case
    restitution: float
    max_force: float
    contact_time: float
    energy_error: float

    @property
    def height(self) -> float:
        """Height that the ball reaches again [m]."""
        return self.case.height * self.restitution**2


def scene_of(case: Case) -> impactfem.Scene:
    """The last moments of the fall: gravity hardly matters while the ball touches the floor."""
    ball = impactfem.Solid(
        name="ball",
        model="axisymmetric",
        shape=impactfem.shapes.Sphere(radius=RADIUS, center=[0.0, RADIUS + GAP]),
        mesh_size=4.0 * case.mesh_size,
        refine=[
            impactfem.bodies.Refinement(point=[0.0, GAP], radius=0.4 * RADIUS, size=case.mesh_size)
        ],
        density=1200.0,
        youngs_modulus=1e7,
        poisson_ratio=0.4,
        velocity=[0.0, -case.speed],
        rayleigh_stiffness=case.damping,
    )
    fall = GAP / case.speed
    return impactfem.Scene(
        title=f"Rubber ball dropped from {case.height:g} m",
        duration=fall + 5e-3,
        bodies=[ball],
        obstacles=[impactfem.HalfSpace(name="floor", point=[0.0, 0.0], normal=[0.0, 1.0])],
        solve=impactfem.Solve(method="massless", estimate=False),
        output=impactfem.Output(every=20),
    )


def drop(case: Case) -> tuple[impactfem.Result, Rebound]:
    """Run a case.

    Raises:
        impactfem.SceneError: A value of the case cannot work.
        RuntimeError: The run did not complete, or the ball did not leave the floor.
    """
    result = impactfem.solve(scene_of(case))
    if result.summary["status"] != "completed":
        raise RuntimeError(f"{case}: {result.summary['status']}")
    intervals: list[list[float]] = result.summary["contact"]["intervals"]
    after = float(result.history["ball.vy"][-1])
    if not intervals or after <= 0.0:
        raise RuntimeError(f"{case}: the ball has not left the floor; give a longer duration")
    total = result.history["total_energy"].values
    return result, Rebound(
        case=case,
        restitution=after / case.speed,
        max_force=result.summary["contact"]["max_force"] or math.nan,
        contact_time=intervals[-1][1] - intervals[0][0],
        energy_error=float((total - total[0]).max() / total[0]),
    )

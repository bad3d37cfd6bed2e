"""How far the motion of a solid is from the same on elements twice as large."""

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from impactfem.errors import ImpactError
from impactfem.log import Progress
from impactfem.planning import SolidPlan
from impactfem.reference.bar import Errors
from impactfem.result.solid_motion import SolidMotion
from impactfem.scene import Scene

Floats = NDArray[np.float64]

REFERENCE = (
    "same scene on elements twice as large; the difference itself, which bounds the error where "
    "halving the elements at least halves it"
)
"""What estimated errors are measured against."""


@dataclass(frozen=True)
class Track:
    """What two runs of a solid are compared by.

    Attributes:
        times: t_m [s], shape (rows,).
        position: Centre of mass at t_m [m], shape (rows, 3).
        force: Contact force during (t_{m-1}, t_m] [N], shape (rows,).
    """

    times: Floats
    position: Floats
    force: Floats

    @classmethod
    def of_motion(cls, motion: SolidMotion) -> "Track":
        """Of a motion."""
        return cls(motion.times, motion.position, motion.contact_force)

    @classmethod
    def of_history(cls, history: xr.Dataset, name: str) -> "Track":
        """Of the history of body ``name``."""
        position = np.stack([history[f"{name}.{axis}"].values for axis in "xyz"], axis=1)
        return cls(history["time"].values, position, history["contact_force"].values)

    def way(self, times: Floats) -> Floats:
        """Way of the centre of mass since t = 0 [m], linear between levels, shape (times, 3)."""
        moved = self.position - self.position[0]
        return np.stack([np.interp(times, self.times, column) for column in moved.T], axis=1)

    def impulse(self, times: Floats) -> Floats:
        """Impulse of the contact force up to some times [N s], shape (times,)."""
        done = np.cumsum(self.force[1:] * np.diff(self.times))
        impulse: Floats = np.interp(times, self.times, np.concatenate([[0.0], done]))
        return impulse


def estimate_error(
    scene: Scene, chosen: SolidPlan, motion: SolidMotion
) -> tuple[Errors | None, dict[str, Any]]:
    """Run the scene on elements and time steps twice as large and compare (collective).

    With e(h) the error on elements of size h, the difference e(2h) - e(h) is at least e(h) if
    e(h) <= e(2h) / 2. It is not divided by 2^p - 1: two runs do not tell the order p.

    Args:
        scene: The scene.
        chosen: Its plan.
        motion: Its motion by this plan.

    Returns:
        The differences of the centre of mass and of the contact force, or None if the coarse run
        failed; and what it was and cost, for the summary.
    """
    from impactfem.runs.solids import run_solid  # noqa: PLC0415  (loads DOLFINx)

    begin = time.perf_counter()
    coarse = resized(scene, 2.0, chosen.degree)
    numbers = replace(
        chosen,
        mesh_size=2.0 * chosen.mesh_size,
        # Explicit steps follow from the stiffness of the coarse mesh anyway.
        dt=None if chosen.linear_solver == "none" or chosen.dt is None else 2.0 * chosen.dt,
        courant=chosen.courant or (0.9 if chosen.linear_solver == "none" else None),
        layers=None,
        estimate=False,
    )
    try:
        rough, _ = run_solid(coarse, numbers, Progress())
    except ImpactError as error:
        return None, {"message": f"the coarse run failed: {error}"}
    found = difference(Track.of_motion(motion), Track.of_motion(rough), REFERENCE)
    return found, {
        "message": "run on elements twice as large",
        "seconds": time.perf_counter() - begin,
        "num_steps": len(rough.times) - 1,
    }


def resized(scene: Scene, factor: float, degree: int | None = None) -> Scene:
    """The scene on elements so many times as large, steps left to the plan, without output."""
    solid = scene.solid
    if solid.mesh_size is None:
        raise ValueError("the elements of a mesh file cannot be resized")
    balls = tuple(replace(ball, size=factor * ball.size) for ball in solid.refine)
    size = factor * solid.mesh_size
    body = replace(solid, mesh_size=size, refine=balls, degree=degree or solid.degree)
    settings = replace(scene.solve, dt=None, courant=None, estimate=False)
    output = replace(scene.output, fields=(), checkpoint=0)
    return replace(scene, bodies=(body,), solve=settings, output=output)


def difference(fine: Track, coarse: Track, reference: str) -> Errors:
    """Difference of two runs at the times and in the layers of the coarser one.

    Displacements are those of the centre of mass, linear between the levels of the finer run;
    forces are compared by their impulse in each layer, which is exact as they are constant there.

    Args:
        fine: The run with shorter layers.
        coarse: The other one.
        reference: What the errors are measured against, in words.
    """
    end = min(fine.times[-1], coarse.times[-1])
    times = coarse.times[coarse.times <= end * (1.0 + 1e-12)]
    way = fine.way(times)
    apart = np.linalg.norm(way - coarse.way(times), axis=1)
    length = np.linalg.norm(way, axis=1)
    weights = np.diff(times, prepend=times[0]) + np.diff(times, append=times[-1])
    impulses, others = (np.diff(track.impulse(times)) for track in (fine, coarse))
    return Errors(
        reference,
        _relative(apart.max(), length.max()),
        _relative(np.sqrt(weights @ apart**2), np.sqrt(weights @ length**2)),
        _relative(np.abs(impulses - others).sum(), impulses.sum()),
    )


def _relative(value: float, scale: float) -> float:
    """Value over scale, or the value itself where the scale is 0."""
    return float(value / scale) if scale > 0.0 else float(value)

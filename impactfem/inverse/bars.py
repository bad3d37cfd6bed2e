"""Bars by characteristics: outcomes, and their derivatives by differences on both sides."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import SceneError
from impactfem.inverse.outcomes import Outcome
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.steps import Changes, Slopes
from impactfem.planning import BarNumbers, Plan
from impactfem.reference.bar import exact_bar, exact_motion
from impactfem.result.bar_row_motion import RowMotion, row_history
from impactfem.runs.line_probes import bar_probes
from impactfem.scene import Scene
from impactfem.sizing import DEFAULT_ELEMENTS

Floats = NDArray[np.float64]

_STEP = 1e-4  # share of a parameter, the longer of two differences
_KINK = 1e-6  # share by which slopes on both sides may differ before both are told


@dataclass(frozen=True)
class BarRuns:
    """Exact runs as planned."""

    chosen: Plan[BarNumbers]

    def outcome(self, scene: Scene, times: Floats) -> Outcome:
        """A run, known at some times."""
        bar, exact = scene.bar, exact_bar(scene)
        positions = np.linspace(0.0, bar.length, (self.chosen.elements or DEFAULT_ELEMENTS) + 1)
        motion = exact_motion(exact, bar, scene.axial_gravity, times, positions, 1)
        (wall,) = scene.obstacles
        row = RowMotion.of_one(motion, bar, wall.name)
        history = row_history(row, scene.bars, bar_probes(scene, row))
        (pair,) = (
            name.removeprefix("force.") for name, _ in history.items() if name.startswith("force.")
        )
        section = bar.density * bar.area
        pushed = np.array([-section * float(exact.force_integral(0.0, t)) for t in times])
        ends = [end for _, end in exact.contacts if end < scene.duration]
        speed = float("nan")
        if exact.contacts:
            at = np.array([0.0, ends[-1] if ends else scene.duration])
            speed = abs(float(exact.mean_velocity(at)[-1]))
        return Outcome(
            history,
            {pair: pushed},
            {pair: float(sum(end - start for start, end in exact.contacts))},
            {bar.name: speed},
            {bar.name: section * bar.length},
        )

    def jacobian(self, changes: Changes, quantities: Quantities) -> Slopes:
        """Numbers of a run and their derivatives.

        Each side has differences over a step and its half, extrapolated; where they disagree, the
        derivative is the mean of both sides, and a doubt says so.
        """
        scene = changes.scene
        q = quantities.read(self.outcome(scene, quantities.times), scene)
        slopes, doubts = np.zeros((len(q), len(changes.values))), []

        def numbers(k: int, offset: float) -> Floats | None:
            try:
                scene = changes.moved(k, offset)
                return quantities.read(self.outcome(scene, quantities.times), scene)
            except SceneError:
                return None

        for k, size in enumerate(changes.scales):
            sides = []
            for sign in (1.0, -1.0):
                h = sign * _STEP * size
                far, near = numbers(k, h), numbers(k, 0.5 * h)
                if far is not None and near is not None:
                    sides.append((4.0 * near - far - 3.0 * q) / h)
            if not sides:
                raise SceneError(f"parameter[{k}]: there are no scenes beside its value")
            slopes[:, k] = np.mean(sides, axis=0)
            if len(sides) == 2:
                apart, most = np.abs(sides[0] - sides[1]), np.abs(sides).max()
                if apart.max() > _KINK * most:
                    place = int(apart.argmax())
                    doubts.append(
                        f"parameter[{k}]: slopes differ on both sides, {sides[1][place]:.6g} below "
                        f"and {sides[0][place]:.6g} above; their mean is given"
                    )
        return Slopes(q, slopes, doubts)

"""The exact solution of a scene with bars in a row."""

import numpy as np

from impactfem.errors import SceneError
from impactfem.exact import ExactBarRow, RowBar
from impactfem.exact.row_bar import PIECES
from impactfem.exact.row_waves import TooManyWavesError
from impactfem.methods import is_exact
from impactfem.scene import Bar, Scene

MAX_TRANSITS = 1e5
"""Longest duration in transits of a wave through the bar with the shortest one."""


def exact_row(scene: Scene, duration: float | None = None, pieces: int = PIECES) -> ExactBarRow:
    """Exact solution of the bars in a row by characteristics.

    Args:
        scene: Scene with bars, with or without a wall.
        duration: End of the solution [s]; the scene's duration if None.
        pieces: Pieces of each bar on which an initial state is sampled that varies along it.

    Raises:
        SceneError: The duration is too long to follow the waves.
        TooManyWavesError: So are the waves.
    """
    shortest = min(scene.bars, key=lambda bar: bar.transit_time)
    transits = scene.duration / shortest.transit_time
    if not transits <= MAX_TRANSITS:
        raise SceneError(
            f"duration = {scene.duration:g} s is {transits:.2g} transits L / c = "
            f"{shortest.transit_time:g} s of a wave through {shortest.name}, more than the "
            f"{MAX_TRANSITS:g} that are followed; give a shorter duration or a longer bar"
        )
    bars = [_of_bar(bar, pieces) for bar in scene.bars]
    return ExactBarRow(
        bars,
        scene.duration if duration is None else duration,
        wall=bool(scene.obstacles),
        clamped=scene.bars[-1].far_end == "clamped",
    )


def exact_row_if_known(scene: Scene, duration: float | None = None) -> ExactBarRow | None:
    """As `exact_row`; None if there are too many waves to follow and another method may serve.

    Raises:
        SceneError: The duration is too long, or the exact solution itself is asked for.
    """
    try:
        return exact_row(scene, duration)
    except TooManyWavesError:
        if is_exact(scene.solve.method):
            raise
        return None


def _of_bar(bar: Bar, pieces: int) -> RowBar:
    return RowBar.from_functions(
        length=bar.length,
        wave_speed=bar.wave_speed,
        impedance=bar.impedance,
        place=bar.gap,
        displacement=lambda x: bar.displacement(x=x) + np.zeros_like(x),
        velocity=lambda x: bar.initial_velocity(x=x) + np.zeros_like(x),
        pieces=pieces,
    )

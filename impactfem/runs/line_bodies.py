"""What the summary says of bars, beams and rigid bodies: mass, inertia, rotation, strains.

None where the model of a body does not know a figure: a bar has no sections, a rigid body no
strains, and both no ratio of volumes.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.scene import Bar

if TYPE_CHECKING:  # loads SciPy, which bars do without
    from impactfem.system.beam import FreeBeam
    from impactfem.system.few import FewBodies


_SHARE = 0.01  # of the volume, which exceeds strain_99
_BAR_LEVELS, _BEAM_LEVELS = 2000, 500  # that are looked at, evenly spaced: the cost has a bound
_FIBRES = 40  # across the height of a beam


def body_figures(mass: float, **known: Any) -> dict[str, Any]:
    """The figures of a body, None for those that are not known."""
    names = ("inertia", "rotation_max", "strain_max", "strain_99", "volume_ratio_min")
    return {"mass": mass, **{name: known.get(name) for name in names}}


def few_figures(few: "FewBodies", body: int, turn: Floats | None) -> dict[str, Any]:
    """Those of a body without a mesh, with its rotations as `BodyMotion` has them."""
    known: dict[str, Any] = {}
    if few.figured:
        known["inertia"] = few.figured.get("inertia")
    if few.figured and turn is not None:
        known["rotation_max"] = float(np.abs(_since_start(turn)).max())
    return body_figures(few.masses[body], **known)


def _since_start(turn: Floats) -> Floats:
    """Angles since t = 0 [rad], (rows,): in the plane counted over turns, in space up to pi."""
    if turn.shape[1] == 1:
        return np.asarray(turn[:, 0] - turn[0, 0])
    return np.asarray(2.0 * np.arccos(np.minimum(np.abs(turn @ turn[0]), 1.0)))


def bar_figures(bar: Bar, positions: Floats, displacement: Floats) -> dict[str, Any]:
    """Those of a bar, by the mean strain of each element; it does not turn.

    Args:
        bar: The bar.
        positions: Its nodes [m], (nodes,).
        displacement: Of these at some levels [m], (levels, nodes).
    """
    u, h = displacement[_some(len(displacement), _BAR_LEVELS)], np.diff(positions)
    largest, exceeded = strains(np.diff(u, axis=1) / h, h)
    mass = bar.mass
    return body_figures(mass, rotation_max=0.0, strain_max=largest, strain_99=exceeded)


def beam_figures(free: "FreeBeam", position: Floats, turned: float) -> dict[str, Any]:
    """Those of a beam: strains of stretched and bent fibres, by the means of each element.

    A fibre at z has a' - z r', with r the rotation of the section.

    Args:
        free: The beam.
        position: Coordinates at some times, (times, d).
        turned: Largest rotation of the rigid part [rad].
    """
    matrices, beam = free.matrices, free.beam
    u = free.spread(position[_some(len(position), _BEAM_LEVELS)])
    stretch, bend = matrices.strains(u)
    z = beam.height * (np.arange(_FIBRES) / (_FIBRES - 1) - 0.5)
    fibres = stretch[:, :, None] - z * bend[:, :, None]
    volumes = np.repeat(np.diff(matrices.nodes), _FIBRES)
    largest, exceeded = strains(fibres.reshape(len(u), -1), volumes)
    return body_figures(
        beam.mass, inertia=float(free.rigid_mass[2, 2]), rotation_max=turned, strain_max=largest,
        strain_99=exceeded,
    )  # fmt: skip


def _some(levels: int, most: int) -> NDArray[np.int64]:
    """Numbers of levels, the first and the last included."""
    return np.linspace(0, levels - 1, min(levels, most)).round().astype(np.int64)


def strains(strain: Floats, volumes: Floats) -> tuple[float | None, float | None]:
    """Largest strain by amount, and that which 1 % of the volume exceeds at one level.

    Args:
        strain: (levels, cells).
        volumes: In any unit, (cells,).
    """
    if not np.isfinite(strain).all():
        return None, None
    size, share = np.abs(strain), volumes / volumes.sum()
    largest = float(size.max())
    if share.min() >= _SHARE:
        return largest, largest
    order = np.argsort(-size, axis=1)
    exceeding = np.cumsum(share[order], axis=1)
    at = np.argmax(exceeding > _SHARE * (1.0 + 1e-9), axis=1)[:, None]
    cells = np.take_along_axis(order, at, axis=1)
    return largest, float(np.take_along_axis(size, cells, axis=1).max())

"""A watch on what linear elasticity takes to be small: rotations and strains of the bodies."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np

from impactfem.arrays import Floats
from impactfem.findings import ROTATION_LIMITS, STRAIN_LIMITS
from impactfem.marching.rows import Level
from impactfem.system.stretches import Look

_LEAST, _MOST, _APART = 50, 200, 50
"""A run is looked at between 50 and 200 times, in between every 50 layers: a look costs about as
much as a layer. Peaks of the contact force and levels whose fields are kept come on top."""

_NEAR = 0.75
"""Share of the limits of care up to which half of these looks are enough."""

_HIGHER = 1.02
"""How much higher than before a peak of the contact force has to be to be looked at."""


@dataclass
class Seen:
    """The largest of what was seen of a body; see `impactfem.system.stretches`.

    Attributes:
        angle: Rotation when last seen [rad], counted over turns.
        rotation_max: Largest rotation, by amount [rad].
        strain_max: Largest principal strain, by amount.
        strain_99: Largest strain that 1 % of the volume exceeded at one time.
        volume_ratio_min: Least ratio of volumes.
    """

    angle: float = 0.0
    rotation_max: float = 0.0
    strain_max: float = 0.0
    strain_99: float = 0.0
    volume_ratio_min: float = 1.0


class Looked(Protocol):
    """A body that can be looked at: `impactfem.system.stretches.Stretches`, or a beam."""

    @property
    def mass(self) -> float:
        """[kg]."""

    @property
    def inertia(self) -> Floats:
        """About its centre [kg m^2], (1, 1) or (3, 3)."""

    def look(self, displacement: Floats, known: float = 0.0) -> Look:
        """Measure it now; see `Stretches.look`."""


class ModelWatch:
    """Measures bodies at levels that are kept, at peaks of the contact force, and now and then.

    Attributes:
        seen: By body.
    """

    def __init__(
        self, bodies: Mapping[str, Looked], sizes: Sequence[int], layers: int, kept: int
    ) -> None:
        """Look at some layers.

        Args:
            bodies: By name, in the order of their degrees of freedom.
            sizes: Numbers of these on this rank.
            layers: Number of layers; the last is looked at.
            kept: Layers between fields that are kept; 0 if none are.
        """
        self._bodies, self._cuts = bodies, np.cumsum([0, *sizes])
        self._layers, self._kept = layers, kept
        self._every = max(1, layers // _MOST, min(_APART, layers // _LEAST))
        self._force = self._peak = 0.0
        self.seen = {name: Seen() for name in bodies}

    def __call__(self, level: Level) -> None:
        """Look at a level if it is its turn (collective)."""
        layer, force = level.layer, float(level.force.sum())
        fell = force < self._force and self._force > _HIGHER * self._peak
        self._peak, self._force = self._force if fell else self._peak, force
        kept = self._kept and layer % self._kept == 0
        if not (fell or kept or layer % self._every == 0 or layer == self._layers):
            return
        passed = layer % (2 * self._every) and layer < self._layers and not (fell or kept)
        if passed and not any(_is_near(seen) for seen in self.seen.values()):
            return
        moved = level.displacement
        for k, (name, stretches) in enumerate(self._bodies.items()):
            _look(self.seen[name], stretches, moved[self._cuts[k] : self._cuts[k + 1]])

    def state(self) -> str:
        """What was seen, for a checkpoint."""
        bodies = {name: asdict(seen) for name, seen in self.seen.items()}
        return json.dumps({"force": self._force, "peak": self._peak, "bodies": bodies})

    def restore(self, state: str) -> None:
        """Go on from what was seen."""
        data = json.loads(state)
        self._force, self._peak = data["force"], data["peak"]
        self.seen = {name: Seen(**values) for name, values in data["bodies"].items()}

    def figures(self) -> dict[str, dict[str, Any]]:
        """What `summary.json` says of each body, in SI units."""
        found = {}
        for name, stretches in self._bodies.items():
            seen = asdict(self.seen[name])
            del seen["angle"]
            inertia = stretches.inertia.tolist()
            found[name] = {
                "mass": stretches.mass,
                "inertia": inertia if len(inertia) == 3 else inertia[0][0],
                **seen,
            }
        return found


def _is_near(seen: Seen) -> bool:
    """Whether figures come near the limits of care."""
    share = max(seen.rotation_max / ROTATION_LIMITS[0], seen.strain_99 / STRAIN_LIMITS[0])
    return share > _NEAR


def _look(seen: Seen, stretches: Looked, displacement: Floats) -> None:
    look = stretches.look(displacement, seen.strain_99)
    if not math.isfinite(look.rotation + look.strain_max + look.volume_ratio_min):
        return  # the march itself says so
    turns = round((seen.angle - look.rotation) / (2.0 * math.pi))
    seen.angle = look.rotation + 2.0 * math.pi * turns
    seen.rotation_max = max(seen.rotation_max, abs(seen.angle))
    seen.strain_max = max(seen.strain_max, look.strain_max)
    seen.strain_99 = look.strain_99
    seen.volume_ratio_min = min(seen.volume_ratio_min, look.volume_ratio_min)

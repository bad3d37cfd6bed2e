"""What joints need of a body: places that move and turn with it, and what pushes do there.

A rigid body is one station, which moves as it does. Points and beams have a station wherever a
joint holds them, solids one of each surface that a joint holds: its velocity and spin are rows of
their coordinates' rates, and an impulse there moves the whole body.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.system.cuts import Cuts


class Tied(NamedTuple):
    """What a tie holds instead of a radius: its name, and the number of its place."""

    tie: str
    place: int


type Asked = tuple[str, Floats, float | Tied | None]
"""A side of a joint: its name, its place at t = 0 [m], (3,), and the radius of its region [m]."""


@dataclass(frozen=True, kw_only=True)
class Stations:
    """Stations of one system at t = 0.

    Attributes:
        of: Station of each place that was asked for, (asked,).
        names: Body of each, (stations,).
        places, turns: Of these [m], (stations, 3), (stations, 3, 3).
        speeds, spins: Of these, spins along their axes [m/s], [rad/s], (stations, 3) each.
        light: Inverse masses of rigid bodies, 0 of others [1/kg], (stations,).
        inertia: Of rigid bodies along their axes [kg m^2], (stations, 3, 3).
        rows: Velocities and spins in space by rates of the coordinates, (stations, 6, d); of rigid
            bodies none, (stations, 6, 0).
        compliance: Velocities and spins by unit impulses at the stations, (stations, 6, stations,
            6); 0 of rigid bodies, which have `light` and `inertia`.
        freedoms: Number of degrees of freedom of the bodies.
        given: Keys by which a scene sets their velocities; none: it cannot set those of a place.
        axes: By rows the directions in which each moves or does not, (3, 3); None: all alike.
        told: Says the rates that impulses (stations, 6) at t = 0 make, by the keys that set them;
            None: velocities and spins of the stations say it.
        cuts: Planes of symmetry that cut each, (stations,); empty: none.
        fastest: Largest speed at t = 0 of what they are means of [m/s], by which these round.
    """

    of: tuple[int, ...]
    names: tuple[str, ...]
    places: Floats
    turns: Floats
    speeds: Floats
    spins: Floats
    light: Floats
    inertia: Floats
    rows: Floats
    compliance: Floats
    freedoms: int
    given: tuple[str, ...]
    told: Callable[[Floats], str] | None = None
    axes: Floats | None = None
    fastest: float = 0.0
    cuts: tuple[Cuts, ...] = ()

    @classmethod
    def along(
        cls,
        of: tuple[int, ...],
        names: tuple[str, ...],
        places: Floats,
        rows: Floats,
        answers: Floats,
        velocity: Floats,
    ) -> "Stations":
        """Of bodies whose places follow coordinates linearly.

        Args:
            of: Station of each place that was asked for, (asked,).
            names: Body of each, (stations,).
            places: Of these [m], (stations, 3).
            rows: Velocities and spins in space by rates of the coordinates, (stations, 6, d).
            answers: M^-1 rows^T: rates by unit impulses at the stations, (d, 6 stations).
            velocity: Rates of the coordinates at t = 0, (d,).
        """
        count, rates = len(places), rows @ velocity
        flat = rows.reshape(6 * count, -1)
        moving = flat @ answers
        own = np.flatnonzero(np.abs(answers).max(axis=1))
        return cls(
            of=of,
            names=names,
            places=places,
            turns=np.tile(np.eye(3), (count, 1, 1)),
            speeds=rates[:, :3],
            spins=rates[:, 3:],
            light=np.zeros(count),
            inertia=np.tile(np.eye(3), (count, 1, 1)),
            rows=rows,
            compliance=moving.reshape(count, 6, count, 6),
            freedoms=len(own),
            given=() if rows[:, 3:].any() else ("velocity",),
        )


class HasStations(Protocol):
    """What joints can hold."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of its bodies."""

    def stations(self, asked: Sequence[Asked]) -> Stations:
        """What joints hold of bodies at places [m], (3,); see `BodyKind.takes_joints`."""


def couples(each: list[Floats], first: int) -> tuple[NDArray[np.int64], Floats]:
    """Couples of stations of which one moves the other, and how.

    Args:
        each: Of the systems in order the answers (stations, 6, stations, 6), 0 of rigid bodies.
        first: Number of stations of the ground.

    Returns:
        Numbers of the stations after the ground, (couples, 2); how the first moves by unit
        impulses on the second, (couples, 6, 6).
    """
    pairs, found = [], [np.zeros((0, 6, 6))]
    for answer in each:
        if answer.any():
            count = len(answer)
            pairs += [(first + i, first + j) for i in range(count) for j in range(count)]
            found.append(answer.swapaxes(1, 2).reshape(count**2, 6, 6))
        first += len(answer)
    return np.array(pairs, dtype=np.int64).reshape(-1, 2), np.concatenate(found)

"""The motion of bars in a row, or of a row of one, and the history and fields made of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.result.bar_motion import BarMotion, Effort
from impactfem.result.fields import Fields
from impactfem.result.history import BodyMotion, Columns, PairMotion, make_history
from impactfem.result.table import Table
from impactfem.scene import Bar
from impactfem.scene.laws import default_name


@dataclass(frozen=True)
class RowMotion:
    """Motion of bars in a row at common time levels.

    Rows of forces and energies belong to the layer (t_{m-1}, t_m]; row 0 is the initial state.

    Attributes:
        times: t_m [s], shape (layers + 1,).
        labels: Names of the pairs that may meet, as "wall|first" and "first|second".
        positions: For each bar, node positions from its near end [m], shape (nodes,).
        kept: Levels at which the fields are kept, shape (kept,).
        displacement: For each bar, u at the kept levels, from the wall [m], (kept, nodes).
        velocity: For each bar, u_t at the kept levels [m/s], (kept, nodes).
        gap: Gap of each pair at t_m [m], shape (layers + 1, pairs).
        force: Pressing force of each pair in each layer [N], shape (layers, pairs).
        kinetic, elastic: Energy of each bar [J], shape (layers + 1, bars).
        mean_displacement: Of the centres of mass at t_m [m], shape (layers + 1, bars).
        mean_velocity: Of the centres of mass in each layer [m/s], shape (layers + 1, bars).
        effort: How the method got there.
        potential: Potential energy [J], shape (layers + 1,); None: there is none.
        active: Pairs in contact in each row, shape (layers + 1,); None: those that press.
    """

    times: Floats
    labels: tuple[str, ...]
    positions: tuple[Floats, ...]
    kept: NDArray[np.int64]
    displacement: tuple[Floats, ...]
    velocity: tuple[Floats, ...]
    gap: Floats
    force: Floats
    kinetic: Floats
    elastic: Floats
    mean_displacement: Floats
    mean_velocity: Floats
    effort: Effort = field(default_factory=Effort)
    potential: Floats | None = None
    active: NDArray[np.int64] | None = None

    @classmethod
    def of_one(cls, motion: BarMotion, bar: Bar, wall: str) -> "RowMotion":
        """A bar and its wall as a row of one."""
        section = bar.section
        return cls(
            times=motion.times,
            labels=pair_labels([bar], wall),
            positions=(motion.positions,),
            kept=motion.kept,
            displacement=(motion.displacement,),
            velocity=(motion.velocity,),
            # Of a wall that gives way it counts from the end of the spring.
            gap=(np.maximum(motion.gap, 0.0) if bar.wall_stiffness else motion.gap)[:, None],
            force=(-section * motion.multiplier + 0.0)[:, None],  # no negative zeros
            kinetic=section * motion.kinetic[:, None],
            elastic=section * motion.elastic[:, None],
            mean_displacement=motion.mean_displacement[:, None],
            mean_velocity=motion.mean_velocity[:, None],
            effort=replace(
                motion.effort,
                iterates=tuple(
                    (gap, -section * bar.wave_speed**2 / bar.length * multiplier + 0.0)
                    for gap, multiplier in motion.effort.iterates
                ),
            ),
            potential=section * motion.potential,
            active=np.append(0, motion.active.astype(np.int64)),
        )

    @property
    def is_finite(self) -> bool:
        """Whether all displacements and forces are finite."""
        values = (*self.displacement, self.gap, self.force)
        return all(bool(np.isfinite(value).all()) for value in values)


def pair_labels(bars: Sequence[Bar], wall: str | None) -> tuple[str, ...]:
    """Names of the pairs that may meet, in the order of the axis."""
    names = [*([] if wall is None else [wall]), *(bar.name for bar in bars)]
    return tuple(f"{a}|{b}" for a, b in pairwise(names))


def pair_names(labels: Sequence[str], bars: Sequence[Bar]) -> tuple[str, ...]:
    """Names of the pairs in columns, a bar first: "first.wall" and "first.second"."""
    known, found = {bar.name for bar in bars}, []
    for label in labels:
        one, two = label.split("|")
        found.append(default_name(one, two) if one in known else default_name(two, one))
    return tuple(found)


def row_history(
    motion: RowMotion,
    bars: Sequence[Bar],
    probes: Mapping[str, Mapping[str, Floats]] | None = None,
) -> Table:
    """History of a motion, in the columns of the contract."""
    force = np.vstack([np.zeros((1, len(motion.labels))), motion.force])
    bodies = {
        bar.name: BodyMotion.along_axis(
            motion.mean_displacement[:, k] + bar.center, motion.mean_velocity[:, k]
        )
        for k, bar in enumerate(bars)
    }
    still, pressing = np.zeros_like(motion.times), np.count_nonzero(force > 0.0, axis=1)
    history = make_history(
        Columns(
            time=motion.times,
            # A bar alone has none.
            gap=motion.gap.min(axis=1) if motion.labels else np.full(len(motion.times), np.nan),
            contact_force=force.sum(axis=1),
            kinetic_energy=motion.kinetic.sum(axis=1),
            elastic_energy=motion.elastic.sum(axis=1),
            potential_energy=still if motion.potential is None else motion.potential,
            momentum=np.sum([bar.mass * bodies[bar.name].velocity for bar in bars], axis=0),
            active=pressing if motion.active is None else motion.active,
            bodies=bodies,
            pairs={
                name: PairMotion(force[:, k], motion.gap[:, k])
                for k, name in enumerate(pair_names(motion.labels, bars))
            },
            probes=probes or {},
        )
    )
    if len(bars) > 1:
        history["gap"].attrs["comment"] = "smallest distance of neighbours"
    return history


def row_fields(motion: RowMotion, names: tuple[str, ...]) -> Fields:
    """Displacement and velocity of all bars at the kept levels, one bar after the other."""
    counts = tuple(len(positions) for positions in motion.positions)
    return Fields(
        motion.times[motion.kept],
        np.concatenate(motion.positions),
        np.hstack(motion.displacement),
        np.hstack(motion.velocity),
        counts if len(names) > 1 else None,
        names,
    )

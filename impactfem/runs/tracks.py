"""Ways of bodies in two runs, and how far these are apart, whoever watches them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.reference.bar import Errors, trapezoidal
from impactfem.result.table import Table
from impactfem.runs.probe_errors import Told, apart, told
from impactfem.runs.scales import fall_in_step, rounding_share
from impactfem.scene import Scene

if TYPE_CHECKING:
    from impactfem.runs.solid_rows import SolidsMotion


SHARE = 0.1
"""Share of the largest way that a body's own one counts as at least."""


@dataclass(frozen=True)
class Part:
    """Columns of a track that move as one: places of a body, or its centre and its turns.

    Attributes:
        body: Its name.
        way: Since the bodies were placed [m], shape (rows, columns): two rows are as far apart as
            the places are in the mean square.
        carried: What a uniform motion along each axis adds in a second, (3, columns).
        first: Mean velocity of the body at t = 0 [m/s], (3,).
        extent: What coordinates are rounded to eps of [m].
    """

    body: str
    way: Floats
    carried: Floats
    first: Floats
    extent: float

    def at(self, times: Floats, rows: Floats) -> Floats:
        """The way at other times than those of its rows, linear between them."""
        return np.stack([np.interp(times, rows, column) for column in self.way.T], axis=1)


@dataclass(frozen=True)
class Track:
    """What two runs of solids are compared by.

    Attributes:
        times: t_m [s], shape (rows,).
        parts: Ways of bodies at t_m.
        force: Contact force during (t_{m-1}, t_m] [N], shape (rows,).
        grounds: Mean velocities of what bodies are held by or strike [m/s], (count, 3).
        mass: Of all bodies [kg]; 0 if it is not known.
        told: What probes tell besides displacements.
    """

    times: Floats
    parts: tuple[Part, ...]
    force: Floats
    grounds: Floats
    mass: float = 0.0
    told: Mapping[str, Told] = field(default_factory=dict)

    @classmethod
    def of_centres(cls, times: Floats, position: Floats, force: Floats) -> "Track":
        """Of centres of mass [m], (rows, 3 * bodies), over a ground that stands still."""
        parts = []
        for k, place in enumerate(np.split(position, position.shape[1] // 3, axis=1)):
            first = (place[1] - place[0]) / (times[1] - times[0])
            parts.append(_centre(str(k), place, np.zeros(3), first))
        return cls(times, tuple(parts), force, np.zeros((1, 3)))

    @classmethod
    def of_history(
        cls,
        history: Table,
        scene: Scene,
        details: Mapping[str, Any] | None = None,
        bodies: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> "Track":
        """Of centres of mass and turns, as far as a history tells them.

        Args:
            history: Of the run.
            scene: Of the run.
            details: Of its summary, which tell where bodies rest at the start.
            bodies: Of its summary: masses and inertia.
        """
        settled = (details or {}).get("start", {}).get("moved", {})
        parts, known = [], bodies or {}
        fall = fall_in_step(scene, history["time"].values)
        for body in scene.bodies:
            name = body.name
            place, first = (
                np.stack([history[f"{name}.{letter}{axis}"].values for axis in "xyz"], axis=1)
                for letter in ("", "v")
            )
            moved = np.zeros(3)
            moved[: len(settled.get(name, ()))] = settled.get(name, ())
            turns = turned(history, name, known[name]) if body.turns_far and name in known else []
            parts.append(_centre(name, place, moved, first[0], turns, fall))
        mass = sum(float(body.get("mass") or 0.0) for body in known.values())
        times, force = history["time"].values, history["contact_force"].values
        return cls(times, tuple(parts), force, grounds(scene), mass)

    @classmethod
    def of_motion(cls, scene: Scene, motion: "SolidsMotion") -> "Track":
        """Of the displacements that were kept of bodies with elements, of others as of a history.

        Args:
            scene: Of the run.
            motion: What it gave.
        """
        effort = motion.effort
        found = cls.of_history(motion.history, scene, effort.details, effort.bodies)
        centres = {part.body: part for part in found.parts}
        parts = [part for name, part in centres.items() if name not in motion.moved]
        for name, moved in motion.moved.items():
            rows, count, dim = moved.shape
            share = 1.0 / np.sqrt(count)
            carried = np.zeros((3, count, dim))
            carried[np.arange(dim), :, np.arange(dim)] = share
            centre = centres[name.partition("/")[0]]
            places = motion.places[name]
            size = float(np.ptp(places, axis=0).max(initial=0.0) + np.abs(places).max())
            parts.append(
                Part(
                    centre.body, share * moved.reshape(rows, -1), carried.reshape(3, -1),
                    centre.first, max(size, centre.extent),
                )
            )  # fmt: skip
        extents = {part.body: part.extent for part in parts}
        known = {body.name: getattr(body, "youngs_modulus", None) for body in scene.bodies}
        moduli = {name: each for name, each in known.items() if isinstance(each, float)}
        probes = told(motion.history, scene.probes, extents, moduli)
        return Track(found.times, tuple(parts), found.force, found.grounds, found.mass, probes)

    def way(self, times: Floats) -> Floats:
        """Ways of all parts [m], linear between levels, shape (times, columns)."""
        return np.concatenate([part.at(times, self.times) for part in self.parts], axis=1)

    def impulse(self, times: Floats) -> Floats:
        """Impulse of the contact force up to some times [N s], shape (times,)."""
        done = np.cumsum(self.force[1:] * np.diff(self.times))
        impulse: Floats = np.interp(times, self.times, np.concatenate([[0.0], done]))
        return impulse


def _centre(
    name: str, place: Floats, moved: Floats, first: Floats, turns: Sequence[Floats] = (),
    least: float = 0.0,
) -> Part:  # fmt: skip
    """Of a centre of mass [m], (rows, 3), where it moved before, and columns of turns [m].

    Its extent is at least that given.
    """
    columns = [(place - place[0] + moved).T, *(turn[None] - turn[0] for turn in turns)]
    way = np.concatenate(columns).T
    extent = max(least, float(np.abs(place).max() + np.abs(way).max()))
    return Part(name, way, np.eye(3, way.shape[1]), first, extent)


def grounds(scene: Scene) -> Floats:
    """Mean velocities of obstacles, and of what holds bodies [m/s], (count, 3)."""
    end, found = scene.duration, []
    held = [each for body in scene.bodies for each in getattr(body, "supports", ())]
    moving = [obstacle.motion for obstacle in scene.obstacles]
    moving += [getattr(support, "value", None) for support in held]
    moving += [None] * bool(scene.couplings)
    for motion in moving:
        velocity = np.zeros(3)
        given = motion if isinstance(motion, Sequence) else ()
        for axis, formula in enumerate(given):
            if formula is not None:
                velocity[axis] = (float(formula(t=end)) - float(formula(t=0.0))) / end
        found.append(velocity)
    return np.array(found).reshape(-1, 3)


def turned(history: Table, name: str, body: Mapping[str, Any]) -> list[Floats]:
    """Rotation of a body times its radius of gyration [m], as columns; none if it is held.

    They are the entries of the rotation matrix: two rotations are as far apart in them as the
    points of the body are in the mean square (in space, as if its inertia were that of a ball). Of
    mechanisms positions of the joints, by what each has to move at t = 0, and of a free base this.

    Args:
        history: Of the run.
        name: Of the body.
        body: Its mass and inertia, as ``summary.json`` has them.
    """
    given = body.get("inertia", 0.0)
    if isinstance(given, Mapping):  # of the joints of a mechanism
        each = ((f"{name}.{joint}", own / body["mass"]) for joint, own in given.items())
        return [column for joint, own in each for column in _jointed(history, joint, own)]
    inertia = np.atleast_2d(np.asarray(given, dtype=np.float64))
    if f"{name}.angle" in history:
        radius, angle = np.sqrt(inertia[0, 0] / body["mass"]), history[f"{name}.angle"].values
        return [radius * np.cos(angle), radius * np.sin(angle)]
    if f"{name}.qw" not in history:
        return []
    return _rotation(history, name, float(np.trace(inertia)) / (3.0 * body["mass"]))


def _jointed(history: Table, joint: str, own: float) -> list[Floats]:
    """Motion in a joint [m], by the square of the radius of gyration of what it moves [m^2]."""
    if f"{joint}.qw" in history:
        return _rotation(history, joint, own)
    return [np.sqrt(own) * history[f"{joint}.q"].values]


def _rotation(history: Table, name: str, own: float) -> list[Floats]:
    """Entries of a rotation matrix [m], by the square of a mean radius of gyration [m^2]."""
    scale = np.sqrt(0.5 * own)
    w, x, y, z = (history[f"{name}.q{letter}"].values for letter in "wxyz")
    entries = [
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w),
        2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w),
        2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y),
    ]  # fmt: skip
    return [scale * entry for entry in entries]


def difference(fine: Track, coarse: Track, reference: str, least: float = 0.0) -> Errors:
    """Difference of two runs at the times and in the layers of the coarser one.

    How far the places of a body are apart (root mean square), linear between the levels of the
    finer run, is seen against its way in the frame in which that is least: of its mean velocity at
    t = 0, or of an obstacle or support. A body that hardly moves is measured by `SHARE` of the
    largest way, one that moves by rounding by its extent. The largest of all bodies is told.

    Forces are compared by their impulse in each layer, which is exact as they are constant there.

    Args:
        fine: The run with shorter layers.
        coarse: The other one, with the same parts.
        reference: What the errors are measured against, in words.
        least: Way that a body's own one counts as at least [m].
    """
    end = min(fine.times[-1], coarse.times[-1])
    times = np.append(coarse.times[coarse.times < end * (1.0 - 1e-12)], end)
    weights = trapezoidal(times)
    ways = [part.at(times, fine.times) for part in fine.parts]
    others = [part.at(times, coarse.times) for part in coarse.parts]
    off = [
        _sizes(np.linalg.norm(one - two, axis=1), weights)
        for one, two in zip(ways, others, strict=True)
    ]
    extents = np.array([part.extent for part in fine.parts])
    scale = np.array(_scales(fine, times, ways, weights))
    own = np.maximum(scale, np.maximum(SHARE * scale.max(axis=0), least))
    share = rounding_share(len(fine.times) - 1)
    moves = scale[:, :1] > share * extents[:, None]
    among = np.where(moves, own, extents[:, None])
    found = np.divide(off, among, out=np.zeros_like(among), where=np.array(off) > 0.0)
    impulses = [np.diff(track.impulse(times)) for track in (fine, coarse)]
    acting = max(impulse.sum() for impulse in impulses)
    wrong = float(np.abs(impulses[0] - impulses[1]).sum())
    rounding = share * fine.mass * float(extents.max()) / float(times[-1] - times[0])
    largest, mean = found.max(axis=0)
    return Errors(
        reference,
        float(largest),
        float(mean),
        0.0 if max(acting, wrong) <= rounding or not wrong else float(wrong / acting),
        probes=apart(fine.told, coarse.told, (fine.times, coarse.times), times),
    )


def largest_way(track: Track) -> float:
    """Largest way of the bodies [m], each in the frame in which it is least.

    At least the thousandth of their extent, below which rounding makes it up.
    """
    ways = [part.at(track.times, track.times) for part in track.parts]
    scales = _scales(track, track.times, ways, np.ones(len(track.times)))
    extent = max(part.extent for part in track.parts)
    return max(*(largest for largest, _ in scales), 1e-3 * extent) or 1.0


def _sizes(lengths: Floats, weights: Floats) -> tuple[float, float]:
    """Largest and mean square of some lengths in time."""
    return float(lengths.max()), float(np.sqrt(weights @ lengths**2 / weights.sum()))


def _scales(
    track: Track, times: Floats, ways: Sequence[Floats], weights: Floats
) -> list[tuple[float, float]]:
    """Largest and mean way of the body of each part, in the frame in which that is least."""
    bodies = [part.body for part in track.parts]
    best: dict[str, tuple[float, float]] = {}
    for body in dict.fromkeys(bodies):
        own = [k for k, name in enumerate(bodies) if name == body]
        frames = [track.parts[own[0]].first, *track.grounds]
        each = []
        for frame in frames:
            parts = [
                _sizes(
                    np.linalg.norm(
                        ways[k] - np.outer(times, frame @ track.parts[k].carried), axis=1
                    ),
                    weights,
                )
                for k in own
            ]
            each.append((max(largest for largest, _ in parts), max(mean for _, mean in parts)))
        best[body] = min(each)
    return [best[body] for body in bodies]

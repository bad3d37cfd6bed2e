"""Joints of a scene as rows: what they hold, along what their springs, motors and limits act."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats, Integers
from impactfem.errors import SceneError
from impactfem.scene import Joint, Scene
from impactfem.scene.joints import GROUND
from impactfem.scene.laws import side_of
from impactfem.system.joint_kernels import (
    ANGLE,
    DOT,
    RANK,
    at_gradients,
    delassus,
    least,
    sizes_of,
    values,
)
from impactfem.system.joint_rows import JointFrame, Rows
from impactfem.system.moving_ground import MovingGround, drive_at
from impactfem.system.rigid import in_space
from impactfem.system.stations import Asked, HasStations, Stations, couples
from impactfem.system.ties import TiedPlace

_ALONG = ("moving", "rubbing", "stopping", "driven")
"""Rows along the coordinate of a joint."""

_LED = 1e-3  # of the speed of a ground: a motion that begins smoothly rounds by far less
_MOVING = 1e-9  # share of the largest speed with which bodies may part in a joint at t = 0


@dataclass(frozen=True)
class Terms:
    """Terms of rows, as `impactfem.system.joint_kernels.values` takes them.

    Attributes:
        kinds: (terms,).
        rows: The row of each, (terms,).
        bodies: Both sides, 0 is the ground, (terms, 2).
        arms, axes, across: Along the axes of the bodies, (terms, 2, 3).
        shares: Factors in the rows, (terms,).
    """

    kinds: Integers
    rows: Integers
    bodies: Integers
    arms: Floats
    axes: Floats
    across: Floats
    shares: Floats

    def sums(self, values: Floats, count: int) -> Floats:
        """Rows of values of the terms, (count,)."""
        return np.asarray(np.bincount(self.rows, self.shares * values, count))


@dataclass(frozen=True)
class Joints:
    """Joints between bodies, which they hold at stations.

    Attributes:
        joints: As the scene has them.
        parts: Which bodies they hold, by their place among solids and those without meshes, and
            where.
        ground: Its stations, which are the first ones.
        names: Bodies of the stations, the ground too. "Bodies" below are stations.
        places, turns: Of these at t = 0, (bodies, 3), (bodies, 3, 3).
        speeds, spins: Of these, spins along their axes, (bodies, 3) each.
        masses: Inverse masses (bodies,), 0 of what is not rigid, moments of inertia and their
            inverses (bodies, 3, 3).
        elastic: Couples of stations that are not rigid bodies, and how impulses move these; see
            `impactfem.system.stations.couples`.
        terms: Of all rows.
        owner: Joint of each row, (rows,).
        holding: Rows that are constraints, (rows,).
        moving: Row of the coordinate of each joint, -1 where it has none, (joints,).
        rubbing, stopping, driven: Rows of its friction, its limits and its drive, likewise.
        start: Values of the rows at t = 0, (rows,).
        extent: How far from the origin anything is held [m], by which places round.
        taut: Rows in which preloads act, -1 of joints without, (joints,).
        slack: By which springs with a preload rest elsewhere [m], (joints,).
    """

    joints: tuple[Joint, ...]
    parts: tuple[tuple[int, Stations], ...]
    ground: MovingGround
    names: tuple[str, ...]
    places: Floats
    turns: Floats
    speeds: Floats
    spins: Floats
    masses: tuple[Floats, Floats, Floats]
    elastic: tuple[Integers, Floats]
    terms: Terms
    owner: Integers
    holding: NDArray[np.bool_]
    moving: Integers
    rubbing: Integers
    stopping: Integers
    driven: Integers
    start: Floats
    extent: float
    taut: Integers
    slack: Floats

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.owner)

    @cached_property
    def gradient(self) -> Floats:
        """Of the terms at t = 0, (terms, 2, 6)."""
        t = self.terms
        first = self.values_at(self.places, self.turns, np.zeros(len(t.kinds)))
        return np.asarray(
            at_gradients(t.kinds, t.bodies, t.arms, t.axes, self.places, self.turns, first)
        )

    def values_at(self, places: Floats, turns: Floats, before: Floats) -> Floats:
        """Values of the terms, (terms,); see `impactfem.system.joint_kernels.values`."""
        t = self.terms
        return np.asarray(
            values(t.kinds, t.bodies, t.arms, t.axes, t.across, places, turns, before)
        )

    def without_still(self) -> "Joints":
        """Without constraints of what cannot move along them at all, as plates in their plane.

        Their rotations would move them to second order, which no force that is not far too large
        could take back.

        Raises:
            SceneError: The ground of a joint moves along them.
        """
        light, _, inverse = self.masses
        free = self.turns @ inverse @ self.turns.swapaxes(1, 2)
        t, scaled = self.terms, self.gradient * self.terms.shares[:, None, None]
        moved = delassus(t.rows, t.bodies, scaled, scaled, self.count, light, free, *self.elastic)
        still = self.holding & (np.diag(moved) == 0.0)
        for term in np.flatnonzero(still[t.rows]):
            joint = self.joints[self.owner[t.rows[term]]]
            along = np.abs(self.gradient[term, :, :3]).max(axis=0)
            each = zip(joint.motion or (), along[: joint.dim], strict=False)
            if any(not formula.is_constant and part > _MOVING for formula, part in each):
                names = " and ".join(name for name in joint.between or () if name != GROUND)
                raise SceneError(
                    f"{joint.heading} {joint.name}: motion moves {names} along "
                    f"({_shown(along)[1:-1]}), where it does not move: give 0 there, or another "
                    "kind of body"
                )
        return replace(self, holding=self.holding & ~still)

    def response(self) -> Floats:
        """How constraints move by unit impulses in them at t = 0, (constraints, constraints)."""
        light, _, inverse = self.masses
        free = self.turns @ inverse @ self.turns.swapaxes(1, 2)
        return self._response(light, free, self.elastic)

    def _response(self, light: Floats, free: Floats, elastic: tuple[Integers, Floats]) -> Floats:
        """The same with inverse masses and moments of inertia in space, and elastic couples."""
        t = self.terms
        scaled = self.gradient * t.shares[:, None, None]
        found = delassus(t.rows, t.bodies, scaled, scaled, self.count, light, free, *elastic)
        return np.asarray(found[np.ix_(self.holding, self.holding)])

    @cached_property
    def redundant(self) -> int:
        """How many constraints follow from others at t = 0.

        Lengths and turns tell, not masses: of a pin between heavy bodies one row of both of its
        joints moves hardly at all by impulses.
        """
        count, bodies, light = len(self.names), self.terms.bodies, self.masses[0]
        reach = np.zeros(count)
        np.maximum.at(reach, bodies, np.linalg.norm(self.terms.arms, axis=2))
        turning = 1.0 / np.where(reach > 0.0, reach, 1.0) ** 2
        alike = (light > 0.0).astype(float)
        free = (alike * turning)[:, None, None] * np.eye(3)
        couples, moving = self.elastic
        own = couples[:, 0] == couples[:, 1]
        size = np.ones(count)
        size[couples[own, 0]] = np.einsum("nkk->n", moving[own, :3, :3])
        size = np.sqrt(np.where(size > 0.0, size, 1.0))
        moving = moving / (size[couples[:, 0]] * size[couples[:, 1]])[:, None, None]
        found = self._response(alike, free, (couples, moving))
        scale = sizes_of(found)
        own = np.linalg.eigvalsh(found * np.outer(scale, scale)) if len(found) else np.ones(1)
        return int((own < RANK * own[-1]).sum())

    @property
    def mobility(self) -> int:
        """Number of degrees of freedom that the joints leave to the bodies at t = 0."""
        free = sum(stations.freedoms for _, stations in self.parts)
        return free - int(self.holding.sum()) + self.redundant

    def rates(self, speeds: Floats, whirls: Floats) -> Floats:
        """Rates of the rows at t = 0 by velocities and spins in space, (rows,)."""
        twists = np.hstack([speeds, whirls])[self.terms.bodies]
        each = np.einsum("tsk,tsk->t", self.gradient, twists)
        return self.terms.sums(each, self.count)

    def rates_now(self) -> Floats:
        """The same with those of t = 0."""
        return self.rates(self.speeds, np.einsum("bij,bj->bi", self.turns, self.spins))

    @cached_property
    def hard(self) -> NDArray[np.bool_]:
        """Rows that are constraints and do not give way, (rows,)."""
        soft = np.array([joint.soft is not None for joint in self.joints])
        return np.asarray(self.holding & ~soft[self.owner])

    @cached_property
    def _rows(self) -> dict[str, int]:
        """Rows of coordinates by the names of their joints."""
        names = [joint.name for joint in self.joints]
        return dict(zip(names, self.moving.tolist(), strict=True))

    def shift(self, joint: Joint) -> float:
        """What the coordinate of a joint is more than its row [rad or m]."""
        if not joint.leads:  # what it has moved since t = 0
            return -float(self.start[self._rows[joint.name]])
        return 0.0 if joint.points is not None else joint.start

    def wanted(self, t: float) -> tuple[Floats, Floats]:
        """What rows that hold are to be at a time, and their rates, (rows,) each; 0 of others."""
        rows, rates = np.where(self.holding, self.start, 0.0), np.zeros(self.count)
        if (self.driven >= 0).any():
            places, speeds = drive_at([j.position if j.is_driven else None for j in self.joints], t)
            own = self.driven[self.driven >= 0]
            shifts = np.array([self.shift(joint) for joint in self.joints])
            rows[own] = (places - shifts)[self.driven >= 0]
            rates[own] = speeds[self.driven >= 0]
        return rows, rates

    def rest(self, joint: Joint) -> float:
        """Row at which its spring is not strained [rad or m]."""
        slack = float(self.slack[self.joints.index(joint)]) if self.slack.any() else 0.0
        return slack + (joint.start if joint.rest is None else joint.rest) - self.shift(joint)

    def tightened(self, values: Floats) -> "Joints":
        """With preloads as they are where rows have some values, (rows,)."""
        start, slack = self.start.copy(), self.slack.copy()
        for k in np.flatnonzero(self.taut >= 0).tolist():
            joint, row = self.joints[k], self.taut[k]
            if self.holding[row]:
                start[row] = values[row]
            else:
                pull = float(joint.preload or 0.0) / joint.stiffness
                slack[k] += values[row] - pull - self.rest(joint)
        return replace(self, start=start, slack=slack)

    def check_start(self, led: float) -> None:
        """Refuse velocities at t = 0 with which bodies part in their joints.

        Args:
            led: Largest speed of the ground in the run [m/s], by which motions round.

        Raises:
            SceneError: naming the joint, and velocities that fit.
        """
        whirls = np.einsum("bij,bj->bi", self.turns, self.spins)
        wanted, terms = self.wanted(0.0)[1], self.terms
        apart = np.where(self.holding, self.rates_now() - wanted, 0.0)
        reach = float(np.abs(terms.arms).max())
        largest = np.abs(self.speeds).max() + reach * np.abs(whirls).max() + _LED * led
        largest = max(largest, *(stations.fastest for _, stations in self.parts))
        turns = terms.rows[np.isin(terms.kinds, (DOT, ANGLE))]
        allowed = np.full(self.count, _MOVING * largest)
        allowed[turns] = _MOVING * (largest / reach if reach else np.abs(whirls).max())
        worst = int(np.argmax(np.abs(apart) / np.maximum(allowed, np.finfo(float).tiny)))
        if abs(apart[worst]) <= allowed[worst]:
            return
        joint = self.joints[self.owner[worst]]
        text = (
            f"{joint.heading} {joint.name}: its bodies part with {abs(apart[worst]):.4g} "
            "(m/s, or rad/s) at t = 0; give velocities that it allows"
        )
        given = [keys for _, each in self.parts for keys in [each.given] * len(each.names)]
        fixed = [n for _, each in self.parts for n in each.names if not (each.given or each.told)]
        if fixed:
            names = " and ".join(dict.fromkeys(fixed))
            raise SceneError(f"{text}, such as 0 of {names} and of what joints hold to it")
        acting = np.zeros(self.count)
        response, redundant = self.response(), bool(self.redundant)
        nearest = least(response, apart[self.holding], sizes_of(response), redundant=redundant)
        acting[self.holding] = -nearest
        impulse = acting[self.terms.rows] * self.terms.shares
        pushes = np.zeros((len(self.names), 6))
        np.add.at(pushes, self.terms.bodies, impulse[:, None, None] * self.gradient)
        light, _, inverse = self.masses
        free = self.turns @ inverse @ self.turns.swapaxes(1, 2)
        speeds = self.speeds + light[:, None] * pushes[:, :3]
        turning = whirls + np.einsum("bij,bj->bi", free, pushes[:, 3:])
        for (one, two), moving in zip(*self.elastic, strict=True):
            speeds[one] += (moving @ pushes[two])[:3]
        dim, ground = joint.dim or 3, self.ground.count
        shown = [
            {"velocity": _shown(speed[:dim])}
            | {"angular_velocity": _shown(spin) if dim == 3 else _shown(spin[2:])[1:-1]}
            for speed, spin in zip(speeds[ground:], turning[ground:], strict=True)
        ]
        texts = [
            f"{name}: " + ", ".join(f"{key} = {values[key]}" for key in keys)
            for name, keys, values in zip(self.names[ground:], given, shown, strict=True)
            if keys
        ]
        first = ground
        for _, each in self.parts:
            if each.told is not None:
                texts.append(each.told(pushes[first : first + len(each.names)]))
            first += len(each.names)
        fitting = "; ".join(texts)
        raise SceneError(f"{text}, the nearest by energy are {fitting}")


def _shown(values: Floats) -> str:
    return "[" + ", ".join(f"{round(value, 12) + 0.0:.9g}" for value in values.tolist()) + "]"


def joints_of(
    scene: Scene, bodies: Sequence[HasStations], ties: Mapping[str, Sequence[TiedPlace]]
) -> Joints | None:
    """The joints of a scene, its ties and springs; None without any.

    Args:
        scene: The scene.
        bodies: Its solids, and its bodies without meshes.
        ties: Where ties hold them, by their names.

    Raises:
        SceneError: Bodies part in a joint at t = 0.
    """
    if not scene.couplings:
        return None
    ground = MovingGround(tuple(j.motion for j in scene.couplings if j.motion is not None))
    parts, at = _held(scene, bodies, ground.count, ties)
    each = [stations for _, stations in parts]
    names = (*([GROUND] * ground.count), *(name for stations in each for name in stations.names))
    still = ground.turns
    places = np.concatenate([ground.still, *(stations.places for stations in each)])
    turns = np.concatenate([still, *(stations.turns for stations in each)])
    speeds = np.concatenate([ground.at(0.0)[1], *(stations.speeds for stations in each)])
    spins = np.concatenate([ground.still, *(stations.spins for stations in each)])
    inertia = np.concatenate([still, *(stations.inertia for stations in each)])
    light = np.concatenate([np.zeros(ground.count), *(stations.light for stations in each)])
    inverse = np.where((light > 0.0)[:, None, None], np.linalg.inv(inertia), 0.0)
    dim = scene.dim
    turning = {body.name: body.turns_at for body in scene.bodies}
    own_axes = _axes(each, ground.count)
    rows = Rows()
    own = {
        name: np.full(len(scene.couplings), -1)
        for name in ("moving", "rubbing", "stopping", "driven")
    }
    coordinates, taut = dict[str, int](), np.full(len(scene.couplings), -1)
    for k, joint in enumerate(scene.couplings):
        if joint.between is None:
            continue
        for place, tied in enumerate(ties.get(joint.name, ())):
            both = at[k, place, 0], at[k, place, 1]
            rows.tie(k, both, tied, places, turns)
        if joint.name in ties:
            continue
        # Directions turn with the first side: a point has none that do.
        sides = [name.partition("/") for name in joint.between]
        turn = [body not in turning or turning[body](on) for body, _, on in sides]
        mine = (own_axes[at[k, 0, side]] for side in range(2))
        made = JointFrame(
            joint, (at[k, 0, 0], at[k, 0, 1]), places, turns, swapped=joint.leads and not turn[0],
            basis=next((axes for axes in mine if axes is not None), np.eye(3)),
        )  # fmt: skip
        if joint.preload is not None and joint.kind == "fixed":
            taut[k] = len(rows.owner)
        for kind, first, second in made.held(dim, turning=all(turn)):
            made.put(rows, rows.add(k, holds=True), kind, first, second)
        coordinates[joint.name] = len(rows.terms)
        for name in _acting(joint):
            own[name][k] = rows.add(k, holds=name == "driven")
            made.put(rows, int(own[name][k]), *made.coordinate)
    springs = [joint.preload is not None and joint.kind == "prismatic" for joint in scene.couplings]
    taut = np.where(springs, own["moving"], taut)
    _add_gears(scene, rows, coordinates)
    kinds, of, bodies, all_arms, all_axes, all_across, shares = zip(*rows.terms, strict=True)
    terms = Terms(
        np.array(kinds), np.array(of), np.array(bodies), np.array(all_arms), np.array(all_axes),
        np.array(all_across), np.array(shares, dtype=float),
    )  # fmt: skip
    first = values(
        terms.kinds, terms.bodies, terms.arms, terms.axes, terms.across, places, turns,
        np.zeros(len(kinds)),
    )  # fmt: skip
    found = Joints(
        scene.couplings, parts, ground, names, places, turns, speeds, spins,
        (light, inertia, inverse),
        couples([stations.compliance for stations in each], ground.count), terms,
        np.array(rows.owner), np.array(rows.holding), **own,
        start=terms.sums(first, len(rows.owner)), extent=_extent(places, terms.arms, ties),
        taut=taut, slack=np.zeros(len(scene.couplings)),
    )  # fmt: skip
    found.check_start(ground.fastest(scene.duration))
    return found.without_still()


def _add_gears(scene: Scene, rows: Rows, coordinates: Mapping[str, int]) -> None:
    """Add rows of gears, by the terms of the coordinates of their joints."""
    for k, joint in enumerate(scene.couplings):
        if joint.joints is None:
            continue
        row = rows.add(k, holds=True)
        for name, share in zip(joint.joints, (-float(joint.ratio or 0.0), 1.0), strict=True):
            kind, _, both, arms, axes, across, _ = rows.terms[coordinates[name]]
            rows.terms.append((kind, row, both, arms, axes, across, share))


def _extent(places: Floats, arms: Floats, ties: Mapping[str, Sequence[TiedPlace]]) -> float:
    """See `Joints.extent`."""
    tied = (at for each in ties.values() for held in each for _, at, _ in held.sides)
    least = max((float(np.abs(at).max()) for at in tied), default=0.0)
    return max(least, float(np.abs(places).max() + np.abs(arms).max(initial=0.0)))


type _Place = tuple[int, int, int]  # a joint, a place of it, a side


def _held(
    scene: Scene,
    every: Sequence[HasStations],
    count: int,
    ties: Mapping[str, Sequence[TiedPlace]],
) -> tuple[tuple[tuple[int, Stations], ...], dict[_Place, int]]:
    """Systems that joints hold, and stations; the first are the ground's."""
    parts: list[tuple[int, Stations]] = []
    moved = [k for k, joint in enumerate(scene.couplings) if joint.motion is not None]
    at = {(k, 0, side): 1 + n for n, k in enumerate(moved) for side in range(2)}
    wanted = list[tuple[_Place, Asked]]()
    for k, joint in enumerate(scene.couplings):
        if joint.name in ties:
            each = enumerate(ties[joint.name])
            wanted += [((k, n, s), held.sides[s]) for n, held in each for s in range(2)]
            continue
        for side, name in enumerate(joint.between or ()):
            at_start = in_space(np.asarray(joint.places[side], dtype=float))
            wanted.append(((k, 0, side), (name, at_start, joint.radius)))
    for where, _ in wanted:
        at.setdefault(where, 0)
    for place, bodies in enumerate(every):
        mine = [each for each in wanted if side_of(each[1][0])[0] in bodies.names]
        sides, asked = [where for where, _ in mine], [held for _, held in mine]
        if not asked:
            continue
        stations = bodies.stations(asked)
        at |= {key: count + own for key, own in zip(sides, stations.of, strict=True)}
        count += len(stations.names)
        parts.append((place, stations))
    return tuple(parts), at


def _axes(each: Sequence[Stations], ground: int) -> list[Floats | None]:
    """Directions of all stations, of the ground none; see `Stations.axes`."""
    found: list[Floats | None] = [None] * ground
    for stations in each:
        found += [stations.axes] * len(stations.names)
    return found


def _acting(joint: Joint) -> list[str]:
    """Rows along the coordinate of a joint that it has, by their names in `Joints`."""
    each = joint.moves, joint.friction > 0.0, joint.limits is not None, joint.is_driven
    return [name for name, has in zip(_ALONG, each, strict=True) if has]

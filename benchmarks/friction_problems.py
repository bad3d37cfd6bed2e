"""A hundred problems of contact with friction: one step of rigid bodies each, ten of ten families.

A problem is that of `impactfem.contact.friction_newton.ConeProblem`: velocities of contacts
w = q + W r with W = H M^-1 H^T. Families: what they are hard by stands in `FAMILIES`.
"""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.friction_newton import ConeProblem

Floats = NDArray[np.float64]
_STEP, _GRAVITY = 1e-3, 9.81


class _Step:
    """Bodies in space and the contacts between them; -1 is the ground."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.masses: list[float] = []
        self.moments: list[Floats] = []
        self.speeds: list[Floats] = []
        self.rows: list[tuple[int, int, Floats, Floats, Floats]] = []

    def body(self, mass: float, moments: Floats | float, speed: Floats | None = None) -> int:
        self.masses.append(mass)
        self.moments.append(np.broadcast_to(np.asarray(moments, dtype=float), (3,)).copy())
        self.speeds.append(np.zeros(6) if speed is None else speed)
        return len(self.masses) - 1

    def box(self, mass: float, size: Floats, speed: Floats | None = None) -> int:
        return self.body(mass, mass / 12.0 * (size @ size - size**2), speed)

    def contact(self, one: int, two: int, arm: Floats, other: Floats, normal: Floats) -> None:
        """The normal points from two to one; arms from the centres."""
        self.rows.append((one, two, arm, other, normal / np.linalg.norm(normal)))

    def problem(self, mu: float, pull: Floats | None = None) -> ConeProblem:
        bodies, count = len(self.masses), len(self.rows)
        maps = np.zeros((3 * count, 6 * bodies))
        for k, (one, two, arm, other, normal) in enumerate(self.rows):
            across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
            across /= np.linalg.norm(across)
            frame = np.array([normal, across, np.cross(normal, across)])
            for body, place, sign in ((one, arm, 1.0), (two, other, -1.0)):
                if body >= 0:
                    own = slice(6 * body, 6 * body + 6)
                    maps[3 * k : 3 * k + 3, own] = sign * np.hstack([frame, np.cross(place, frame)])
        weights = np.concatenate(
            [
                np.r_[np.full(3, 1 / m), 1 / i]
                for m, i in zip(self.masses, self.moments, strict=True)
            ]
        )
        pulled = np.array([0.0, -_GRAVITY, 0.0]) if pull is None else pull
        free = np.concatenate(self.speeds) + _STEP * np.tile(np.r_[pulled, np.zeros(3)], bodies)
        answer = (maps * weights) @ maps.T
        offset = (maps @ free).reshape(count, 3)
        none = np.zeros(count)
        return ConeProblem(0.5 * (answer + answer.T), offset, none + mu, none)


_UP = np.array([0.0, 1.0, 0.0])


def _corners(size: Floats, level: float) -> list[Floats]:
    return [np.array([x, level, z]) * size / 2 for x in (-1, 1) for z in (-1, 1)]


def block(rng: np.random.Generator) -> ConeProblem:
    """A block on its corners and more places of its base, pushed."""
    step, size = _Step(rng), rng.uniform(0.2, 2.0, 3)
    body = step.box(rng.uniform(0.1, 10.0), size, np.r_[rng.normal(0, 1e-2, 3), np.zeros(3)])
    places = _corners(size, -1)
    places += [
        np.r_[rng.uniform(-0.5, 0.5), -0.5, rng.uniform(-0.5, 0.5)] * size
        for _ in range(rng.integers(12))
    ]
    for place in places:
        step.contact(body, -1, place, np.zeros(3), _UP)
    return step.problem(rng.uniform(0.1, 1.0))


def _stack(step: _Step, count: int, ratio: float) -> None:
    size, below = np.array([0.2, 0.1, 0.2]), -1
    for level in range(count):
        body = step.box(ratio ** (level / max(1, count - 1)), size)
        for place in _corners(size, -1):
            step.contact(body, below, place, place * [1, -1, 1] if below >= 0 else place, _UP)
        below = body


def stack(rng: np.random.Generator) -> ConeProblem:
    """Boxes of equal mass on each other, four corners each, pulled aside."""
    step = _Step(rng)
    _stack(step, int(rng.integers(3, 11)), 1.0)
    return step.problem(0.5, np.r_[rng.uniform(0, 6), -_GRAVITY, rng.uniform(0, 6)])


def heavy(rng: np.random.Generator) -> ConeProblem:
    """The same with masses that grow, up to 1e6 times, upwards or downwards."""
    step = _Step(rng)
    _stack(step, int(rng.integers(2, 7)), 10.0 ** (rng.integers(1, 7) * rng.choice([-1, 1])))
    return step.problem(0.4, np.r_[rng.uniform(0, 2), -_GRAVITY, 0])


def wedge(rng: np.random.Generator) -> ConeProblem:
    """A box that slides in between two walls, with much friction: it may jam."""
    step, size = _Step(rng), np.array([0.2, 0.3, 0.2])
    body = step.box(1.0, size, np.r_[0, -rng.uniform(0, 2), 0, rng.normal(0, 1, 3)])
    lean = rng.uniform(0, 0.5)
    for side in (-1.0, 1.0):
        for up in (-1, 1):
            for z in (-1, 1):
                place = np.array([side, up, z]) * size / 2
                step.contact(body, -1, place, np.zeros(3), np.array([-side, lean, 0]))
    return step.problem(rng.uniform(0.5, 3.0))


def rod(rng: np.random.Generator) -> ConeProblem:
    """Rods that slide on one end, where friction presses them on (Painleve)."""
    step = _Step(rng)
    for _ in range(3):
        angle, turn = rng.uniform(0.3, 1.5), rng.uniform(0, 2 * np.pi)
        along = np.array(
            [np.cos(angle) * np.cos(turn), np.sin(angle), np.cos(angle) * np.sin(turn)]
        )
        speed = np.r_[
            -np.sign(along[0]) * rng.uniform(0, 2), rng.normal(0, 1e-2), 0, rng.normal(0, 1, 3)
        ]
        body = step.body(1.0, 1 / 12.0, speed)
        step.contact(body, -1, -0.5 * along, np.zeros(3), _UP)
    return step.problem(rng.uniform(1.0, 4.0))


def dense(rng: np.random.Generator) -> ConeProblem:
    """No bodies: a random positive matrix, friction up to 3."""
    count = int(rng.integers(2, 20))
    root = rng.standard_normal((3 * count, 3 * count + 2))
    none = np.zeros(count)
    offset = rng.standard_normal((count, 3))
    return ConeProblem(root @ root.T / (3 * count), offset, none + rng.uniform(1, 3), none)


def deficient(rng: np.random.Generator) -> ConeProblem:
    """Random contacts of few bodies: far more forces than motions, half of rank."""
    step = _Step(rng)
    for _ in range(3):
        step.body(10.0 ** rng.uniform(-1, 1), 0.1, rng.normal(0, 0.5, 6))
    for _ in range(18):
        one = int(rng.integers(3))
        two = int(rng.integers(-1, one))
        normal = rng.normal(0, 1, 3)
        normal[1] = abs(normal[1]) + 0.5
        step.contact(one, two, rng.normal(0, 0.5, 3), rng.normal(0, 0.5, 3), normal)
    return step.problem(rng.uniform(0.2, 1.0))


def _in_box(step: _Step, places: Floats, width: float, ratio: float, speed: float) -> None:
    """Balls of radius 0.05 m in a box without a lid, in touch where they nearly are."""
    rng, radius, near = step.rng, _RADIUS, 1.01
    for _ in places:
        mass = ratio ** rng.uniform(0, 1)
        step.body(mass, 0.4 * mass * radius**2, np.r_[rng.normal(0, speed, 3), np.zeros(3)])
    for a, one in enumerate(places):
        for b, two in enumerate(places[:a]):
            if np.linalg.norm(one - two) < near * 2 * radius:
                n = (one - two) / np.linalg.norm(one - two)
                step.contact(a, b, -radius * n, radius * n, n)
        for axis, sign, gap in (
            (0, 1, one[0]), (0, -1, width - one[0]),
            (2, 1, one[2]), (2, -1, width - one[2]), (1, 1, one[1]),
        ):  # fmt: skip
            if gap < near * radius:
                n = sign * np.eye(3)[axis]
                step.contact(a, -1, -radius * n, np.zeros(3), n)


_RADIUS = 0.05


def _poured(rng: np.random.Generator, count: int) -> tuple[Floats, float]:
    """Places of balls that have come to rest in a box, roughly, and the width of the box."""
    radius, places = _RADIUS, np.empty((0, 3))
    width = 2.1 * radius * max(2, round((count / 2) ** (1 / 3)))
    for _ in range(count):
        found = []
        for _ in range(20):
            x, z = rng.uniform(radius, width - radius, 2)
            apart = (places[:, 0] - x) ** 2 + (places[:, 2] - z) ** 2
            below = apart < 4 * radius**2
            level = places[below, 1] + np.sqrt(4 * radius**2 - apart[below])
            found.append((max(radius, level.max(initial=0.0)), x, z))
        y, x, z = min(found)
        places = np.vstack([places, [x, y, z]])
    for _ in range(400):
        places[:, 1] -= 0.008 * radius
        for _ in range(5):
            ways = places[:, None] - places
            length = np.linalg.norm(ways, axis=2) + np.eye(count)
            push = np.maximum(0.0, 2 * radius - length) / length
            places = places + 0.4 * (push[:, :, None] * ways).sum(axis=1)
            low = np.full(3, radius)
            places = np.clip(places, low, [width - radius, np.inf, width - radius])
    return places, width


def balls(rng: np.random.Generator) -> ConeProblem:
    """Balls poured into a box: 30 to 60, up to 150 contacts, friction 0.2 to 5."""
    step = _Step(rng)
    _in_box(step, *_poured(rng, int(rng.integers(30, 61))), 1.0, 0.1 * rng.integers(2))
    return step.problem(rng.choice([0.2, 0.5, 1.0, 5.0]))


def unequal(rng: np.random.Generator) -> ConeProblem:
    """Balls in a box whose masses differ up to 1e6 times."""
    step = _Step(rng)
    _in_box(step, *_poured(rng, 25), 10.0 ** rng.integers(2, 7), 0.1 * rng.integers(2))
    return step.problem(0.5)


def lattice(rng: np.random.Generator) -> ConeProblem:
    """Balls in rows from wall to wall, each beside six others: as few motions as can be."""
    step, side = _Step(rng), 3
    places = _RADIUS * (1 + 2 * np.array(list(np.ndindex(side, 2, side)))).astype(float)
    places += rng.uniform(-1e-4, 1e-4, places.shape)
    _in_box(step, places, 2 * side * _RADIUS, 1.0, 0.1)
    return step.problem(rng.uniform(0.2, 2.0))


FAMILIES: dict[str, Callable[[np.random.Generator], ConeProblem]] = {
    make.__name__: make
    for make in (block, stack, heavy, wedge, rod, dense, deficient, balls, unequal, lattice)
}


def problems(each: int = 10) -> Iterator[tuple[str, int, ConeProblem]]:
    """Family, number and problem."""
    for place, (name, make) in enumerate(FAMILIES.items()):
        for number in range(each):
            yield name, number, make(np.random.default_rng([place, number]))


def residual(problem: ConeProblem, force: Floats) -> float:
    """How far forces are from the law, as a share of the largest force.

    The larger one of: |y - max(0, y - w/a)| and |tau - P(tau - s/a')|, with a and a' the means of
    the answers of a contact to its own forces, over the largest force.
    """
    answer = problem.answers(force)
    own = np.diag(problem.matrix).reshape(force.shape)
    normal = force[:, 0] - np.maximum(0.0, force[:, 0] - answer[:, 0] / own[:, 0])
    trial = force[:, 1:] - answer[:, 1:] / own[:, 1:].mean(axis=1)[:, None]
    length = np.linalg.norm(trial, axis=1)
    bound = problem.friction * np.maximum(force[:, 0], 0.0)
    shrink = np.minimum(1.0, bound / np.maximum(length, 1e-300))
    tangential = np.abs(force[:, 1:] - shrink[:, None] * trial).max(initial=0.0)
    scale = max(np.abs(force).max(initial=0.0), 1e-300)
    return float(max(np.abs(normal).max(initial=0.0), tangential) / scale)

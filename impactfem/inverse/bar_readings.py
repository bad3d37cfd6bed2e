"""What numbers of a bar's run read: derivatives by its motion and by what it is given."""

from collections.abc import Callable
from functools import cached_property, partial

import numpy as np

from impactfem.arrays import Floats
from impactfem.inverse.outcomes import Outcome, amid
from impactfem.inverse.quantities import Quantities
from impactfem.marching.given import Given
from impactfem.result.bar_motion import BarMotion
from impactfem.scene import Bar, Scene, Term
from impactfem.system.fronts import speeds_at_levels
from impactfem.system.sections import row_loads


class Reading:
    """Derivatives of one number, to which parts are added.

    Attributes:
        of_u: By the motion [m], (layers + 1, nodes).
        of_multiplier: By the force against the axis in each layer [N], (layers,).
        given: By what the run is given.
        last: Level after which nothing counts.
    """

    def __init__(self, run: "ReadRun") -> None:
        self.run, self.given, self.last = run, run.given.zeros(), 0
        self.of_u, self.of_multiplier = np.zeros_like(run.u), np.zeros(len(run.u) - 1)

    def of(self, level: int, node: int, weight: float) -> None:
        """Displacement of a node at a level."""
        self.of_u[level, node] += weight
        self.last = max(self.last, level)

    def force(self, level: int, weight: float) -> None:
        """Force of the wall in the layer before a level, 0 at t = 0."""
        if level:
            self.of_multiplier[level - 1] -= weight
            self.last = max(self.last, level)

    def impulse(self, level: int, weight: float) -> None:
        """Of the wall up to a level."""
        self.of_multiplier[:level] -= self.run.dt * weight
        self.last = max(self.last, level)

    def mean(self, level: int, weight: float) -> None:
        """Displacement of the centre of mass."""
        run = self.run
        self.of_u[level] += weight * run.shares
        self._masses(weight * (run.u[level] - run.shares @ run.u[level]) / run.total)
        self.last = max(self.last, level)

    def place(self, level: int, weight: float) -> None:
        """Place of the centre of mass."""
        self.mean(level, weight)
        run = self.run
        self.given.moments[:] += weight / run.total
        self.given.element_mass[:] -= weight * run.given.moments.sum() / run.total**2

    def speed(self, level: int, weight: float) -> None:
        """Of the centre of mass in the layer before a level."""
        run = self.run
        if level:
            self.mean(level, weight / run.dt)
            self.mean(level - 1, -weight / run.dt)
        else:
            v = run.given.velocity
            self.given.velocity[:] += weight * run.shares
            self._masses(weight * (v - run.shares @ v) / run.total)

    def momentum(self, level: int, weight: float) -> None:
        """Along the axis."""
        self.speed(level, weight * self.run.total)
        self.given.element_mass[:] += weight * self.run.motion.mean_velocity[level]

    def kinetic(self, level: int, weight: float) -> None:
        """Kinetic energy, as `two_step` has it."""
        run = self.run
        if run.levels:
            self._of_waves(level, weight)
            return
        if not level:
            v = run.given.velocity
            self._masses(0.5 * weight * v * v)
            self.given.velocity[:] += weight * run.mass * v
            return
        v = (run.u[level] - run.u[level - 1]) / run.dt
        turn = np.diff(v) * run.dt
        self._masses(0.5 * weight * v * v)
        self.given.stiffness[:] -= 0.125 * weight * turn**2
        pull = 0.25 * weight * _pulls(run.given.stiffness * turn)
        by_step = weight * run.mass * v / run.dt + pull
        self.of_u[level] += by_step
        self.of_u[level - 1] -= by_step
        self.last = max(self.last, level)

    def elastic(self, level: int, weight: float) -> None:
        """Elastic energy, as `two_step` has it."""
        run = self.run
        both = (level,) if run.levels or not level else (level - 1, level)
        d = np.diff(run.u[list(both)].mean(axis=0))
        self.given.stiffness[:] += 0.5 * weight * d * d
        for each in both:
            self.of_u[each] -= weight / len(both) * _pulls(run.given.stiffness * d)
        self.last = max(self.last, level)

    def potential(self, level: int, weight: float) -> None:
        """Potential energy of gravity, as `works` has it."""
        run, g = self.run, self.run.given.gravity
        means, of_g, by_means = run.motion.mean_displacement, np.zeros_like(g), np.zeros(len(g) + 1)
        if run.levels:
            own = np.arange(level)
            of_g[own] = np.diff(means)[:level]
            by_means[own + 1] += g[own]
            by_means[own] -= g[own]
        elif level:
            middle = 0.5 * (means[1:] + means[:-1])
            path = np.diff(middle, prepend=means[0])[:level]
            of_g[0] += path[0]
            of_g[1:level] += 0.5 * path[1:]
            of_g[: level - 1] += 0.5 * path[1:]
            rows = row_loads(g[:, None], len(g))[:level, 0]
            left = -np.diff(rows, append=0.0)
            by_means[:level] += 0.5 * left
            by_means[1 : level + 1] += 0.5 * left
            by_means[0] -= rows[0]
        of_g[0] += means[0]
        by_means[0] += g[0]
        self.given.gravity[:] += weight * run.total * of_g
        self.given.element_mass[:] += weight * (g @ of_g)
        by_means *= weight * run.total
        self.of_u[: level + 1] += by_means[: level + 1, None] * run.shares
        self._masses(by_means @ (run.u - means[:, None]) / run.total)
        self.last = max(self.last, level)

    def energies(self, level: int, weight: float) -> None:
        """Kinetic and elastic energy."""
        self.kinetic(level, weight)
        self.elastic(level, weight)

    def between(self, first: int, share: float, level: int, weight: float) -> None:
        """Displacement between two nodes from the place without strain."""
        self.of(level, first, (1.0 - share) * weight)
        self.of(level, first + 1, share * weight)
        self.given.gap[0] -= weight

    def rate(self, first: int, share: float, level: int, weight: float) -> None:
        """Velocity between two nodes, the mean of both layers at a level."""
        before, after = max(level - 1, 0), min(level + 1, len(self.run.u) - 1)
        for node, part in ((first, 1.0 - share), (first + 1, share)):
            if not level:
                self.given.velocity[node] += part * weight
                continue
            factor = part * weight / ((after - before) * self.run.dt)
            self.of(after, node, factor)
            self.of(before, node, -factor)

    def _of_waves(self, level: int, weight: float) -> None:
        run = self.run
        v, em = run.speeds[level], run.given.element_mass
        self.given.element_mass[:] += 0.5 * weight * v * v
        by_speed = weight * em * v
        signs = np.where(np.arange(level + 1)[::-1] % 2, -1.0, 1.0)
        self.given.speeds[:] += signs[0] * by_speed
        nodes = (np.append(by_speed, 0.0) + np.insert(by_speed, 0, 0.0)) / run.dt
        steps = signs[1:, None] * nodes
        self.of_u[1 : level + 1] += steps
        self.of_u[:level] -= steps
        self.last = max(self.last, level)

    def _masses(self, of_nodes: Floats) -> None:
        """Derivative by the masses of nodes."""
        self.given.element_mass[:] += 0.5 * (of_nodes[1:] + of_nodes[:-1])


def _pulls(tension: Floats) -> Floats:
    """What the tension of elements pulls each node with."""
    return np.append(tension, 0.0) - np.insert(tension, 0, 0.0)


type Part = Callable[[Reading, int, float], None]
"""Adds what a number reads at a level, with a weight."""


class ReadRun:
    """A run and what can be read of it.

    Args:
        scene: The scene.
        given: What the run was given.
        motion: Its motion, all levels kept.
        levels: Whether energies are those of levels (`impactfem.system.fronts`).
    """

    def __init__(self, scene: Scene, given: Given, motion: BarMotion, *, levels: bool) -> None:
        self.scene, self.given, self.motion, self.levels = scene, given, motion, levels
        self.bar: Bar = scene.bar
        self.u, self.dt = motion.displacement, float(motion.times[1])
        self.mass = given.mass
        self.total = float(self.mass.sum())
        self.shares = self.mass / self.total

    @cached_property
    def speeds(self) -> Floats:
        """Of the elements at the levels, if they start as waves [m/s]."""
        rates = np.diff(self.u, axis=0) / self.dt
        return speeds_at_levels(self.given.speeds, rates[:, 1:] + rates[:, :-1])

    def parts(self, pair: str) -> dict[str, Part]:
        """What columns read, by name."""
        name = self.bar.name

        def gap(reading: Reading, level: int, weight: float) -> None:
            reading.of(level, 0, weight)

        found: dict[str, Part] = {
            "gap": gap, f"gap.{pair}": gap,
            "contact_force": Reading.force, f"force.{pair}": Reading.force,
            f"impulse.{pair}": Reading.impulse,
            f"{name}.x": Reading.place, f"{name}.vx": Reading.speed,
            "momentum": Reading.momentum,
            "kinetic_energy": Reading.kinetic, "elastic_energy": Reading.elastic,
        }  # fmt: skip
        if not (self.bar.is_driven or self.bar.is_loaded):
            found["potential_energy"] = Reading.potential
        x = self.motion.positions
        for probe in self.scene.probes:
            place = float(probe.point[0])
            first = min(max(int(np.searchsorted(x, place, side="left")) - 1, 0), len(x) - 2)
            share = (place - x[first]) / (x[first + 1] - x[first])
            found[f"{probe.name}.ux"] = partial(_at, Reading.between, first, share)
            found[f"{probe.name}.vx"] = partial(_at, Reading.rate, first, share)
        return found

    @property
    def end(self) -> float:
        """Of the last level [s]."""
        return self.dt * (len(self.u) - 1)

    def over(self, part: Part, time: float) -> Callable[[Reading, float], None]:
        """What is linear between levels, at a time [s]."""
        place = min(time / self.dt, len(self.u) - 1.0)
        level = min(int(place), len(self.u) - 2)

        def add(reading: Reading, weight: float) -> None:
            for each, share in ((level, level + 1.0 - place), (level + 1, place - level)):
                if share:
                    part(reading, each, weight * share)

        return add


def _at(
    part: Callable[[Reading, int, float, int, float], None], first: int, share: float,
    reading: Reading, level: int, weight: float,
) -> None:  # fmt: skip
    part(reading, first, share, level, weight)


type Added = Callable[[Reading], None]


def read_numbers(
    run: ReadRun, quantities: Quantities, outcome: Outcome, rebound: int
) -> list[Added] | None:
    """What adds the derivatives of each number of a run to a reading; None: one is not known.

    Args:
        run: The run.
        quantities: The numbers, in their order.
        outcome: What they were read from.
        rebound: Level at which the speed after the last contact is told.
    """
    (pair,) = outcome.impulse
    parts, found = run.parts(pair), list[Added]()
    for measure, data in zip(quantities.scene.measures, quantities.data, strict=True):
        if measure.of == f"rebound_speed.{run.bar.name}":
            sign = float(np.sign(run.motion.mean_velocity[rebound]))
            found += [partial(Reading.speed, level=rebound, weight=sign)] * len(data.times)
        elif measure.of in parts:
            each = parts[measure.of]
            times = data.times.tolist()
            if not data.by_rows:
                times = [amid(measure.of, time, run.dt, run.end) for time in times]
            found += [_weighted(run.over(each, time), 1.0) for time in times]
        else:
            return None
    for term in quantities.all_terms:
        found.append(_term(run, quantities, term))
    return found


def _weighted(add: Callable[[Reading, float], None], weight: float) -> Added:
    return lambda reading: add(reading, weight)


def _term(run: ReadRun, quantities: Quantities, term: Term) -> Added:
    """What adds the derivatives of a term; of those of the scene alone there are none."""
    time = quantities.at(term)
    v = float(np.interp(time, run.motion.times, run.motion.mean_velocity))
    speed, energies = run.over(Reading.speed, time), run.over(Reading.energies, time)

    def mass(reading: Reading) -> None:
        reading.given.element_mass[:] += 1.0

    def vibration(reading: Reading) -> None:
        energies(reading, 1.0)
        speed(reading, -run.total * v)
        reading.given.element_mass[:] -= 0.5 * v * v

    def terminal(reading: Reading) -> None:
        energies(reading, 1.0)
        run.over(Reading.potential, time)(reading, 1.0)

    known: dict[str, Added] = {
        "mass": mass, "vibration_energy": vibration, "terminal_energy": terminal,
        "speed": _weighted(speed, float(np.sign(v))),
        "peak_force": partial(
            Reading.force, level=int(np.argmin(run.motion.multiplier)) + 1, weight=1.0
        ),
    }  # fmt: skip
    return known.get(term.term, lambda _: None)

"""Layers of masses and springs: the midpoint rule with a discrete gradient for each spring.

    m (v_b - v_a) = dt (m (g + f / M) + sum s d + F - a m (v_a + v_b) / 2),   d = (d_a + d_b) / 2,
    s = k (1 - 2 L / S + 2 b (|d_b| - |d_a|) / (dt S)),   S = |d_a| + |d_b|,
    q_b = q_a + dt (v_a + v_b) / 2,

f is the mean of the force on all of it, M its mass, d_a and d_b the way from end to end of a spring
of length L at both ends of the layer, a and b the damping by mass and stiffness. The work of a
spring is the change of k (|d| - L)^2 / 2, and its force lies along d, so that without damping
energy, momentum and angular momentum stay to rounding; dampers take b k (|d_b| - |d_a|)^2 / dt.
Masses that supports move are where these are at both ends.
 Source: Simo and Gonzalez, Assessment of energy-momentum and symplectic
schemes for stiff dynamical systems (ASME 93-WA/PVP-4, 1993).
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import splu

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError
from impactfem.marching.few import FewInterior
from impactfem.marching.followed_tips import FollowedTips
from impactfem.marching.held_rows import HeldLumped
from impactfem.marching.iterated import SHARE
from impactfem.marching.layers import Sums
from impactfem.marching.meshless import step_length
from impactfem.marching.net_start import NetAtRest
from impactfem.marching.stations import Held
from impactfem.scene import PiecewiseVector
from impactfem.scene.means import StepMean
from impactfem.system.net import Net
from impactfem.system.rigid_modes import unit_spins
from impactfem.system.stations import Stations

_MOST = 60  # iterates of a layer
_SETTLED = 2.0**-51  # their change, as a share of the velocities and of what rounding moves
_STALLED = 64.0  # the same for one that no longer falls
_SLOW = 0.2  # ratio of changes from which on the tangent is renewed
_LEVEL = np.finfo(float).tiny


class NetMidpoint(FewInterior):
    """Interior of masses and springs; see `impactfem.marching.layers.Interior`.

    Attributes:
        span: Of the step [s].
    """

    bodies: Net

    def __init__(self, bodies: Net, gravity: PiecewiseVector, dt: float, *, counts: bool) -> None:
        """Begin at t = 0; see `FewInterior`."""
        super().__init__(bodies, gravity, dt, counts=counts)
        self.span, self._time = dt, 0.0
        nodes, dim = self._start.shape
        # Displacements and velocities of moved masses now and at the end of the layer.
        self._led: tuple[Floats, Floats] | None = bodies.leading(0.0) if bodies.led else None
        self._led_ahead = self._led
        self._struck = np.zeros((nodes, dim))  # impulses on these in the layer
        # Forces on all of it, spread as weight is: by formulas, from outside, and both in the step.
        self._forces = [StepMean(formula) for formula in bodies.force]
        self._applied = self._driving = np.zeros(dim)
        if bodies.led:
            self.bodies = replace(bodies, places=self._with_led_places(bodies.places))
        mesh = bodies.mesh
        self._number = np.full((nodes, dim), -1)
        self._number[bodies.free] = np.arange(len(self._q)).reshape(-1, dim)
        self._mass = np.repeat(bodies.node_mass[bodies.free], dim)
        self._springs, self._lengths = mesh.stiffness, mesh.lengths
        self._one, self._two = mesh.edges.T
        both = np.stack([self._number[self._one], self._number[self._two]], axis=1)
        self._pattern = [
            (np.broadcast_to(both[:, a, :, None], (len(both), dim, dim)).ravel(),
             np.broadcast_to(both[:, b, None, :], (len(both), dim, dim)).ravel(), sign)
            for a, b, sign in ((0, 0, 1.0), (1, 1, 1.0), (0, 1, -1.0), (1, 0, -1.0))
        ]  # fmt: skip
        self.massive = self.volatile = np.ones(nodes, dtype=bool)
        stiffest = np.zeros(nodes)
        np.add.at(stiffest, mesh.edges, mesh.stiffness[:, None])
        extent = float(np.abs(self._start).max()) + float(mesh.lengths.max())
        slow = dt + bodies.damping[1]
        self._rounding = slow * extent * float((stiffest / bodies.node_mass).max())  # [m/s], by eps
        self._pushed = self._joined = self._kick = np.zeros_like(self._v)
        self._tips: FollowedTips  # where joints hold it
        self._begun = self._amid = cast("Floats | None", None)  # rows of the tips
        self._factor: Any = None
        self._prepare(self._v)  # a run that goes on asks for answers before its first layer

    def _ways(self, places: Floats) -> tuple[Floats, Floats]:
        """From end to end of the springs [m], (springs, dim), and their lengths."""
        ways = places[self._two] - places[self._one]
        return ways, np.maximum(np.linalg.norm(ways, axis=1), _LEVEL)

    def _prepare(self, ahead: Floats) -> None:
        """Factor the tangent of a layer that ends with these velocities."""
        (before, begin), (ways, end) = self._ends(ahead)
        lag = 2.0 * self.bodies.damping[1] / self.span
        pull = self._shares(begin, end)
        stretch = self._springs * 2.0 * (self._lengths + lag * begin) / (begin + end) ** 2
        middle = 0.5 * (before + ways)
        each = 0.5 * pull[:, None, None] * np.eye(ways.shape[1])
        each = each + (stretch / end)[:, None, None] * np.einsum("ei,ej->eij", middle, ways)
        braked = (1.0 + 0.5 * self.span * self.bodies.damping[0]) * self._mass
        self._factor = splu((diags(braked) + 0.5 * self.span**2 * self._assembled(each)).tocsc())

    def _assembled(self, each: Floats) -> coo_matrix:
        """Matrix in the coordinates by that of each spring (springs, dim, dim), (d, d)."""
        entries, rows, columns = [], [], []
        for row, column, sign in self._pattern:
            kept = (row >= 0) & (column >= 0)
            entries.append(sign * each.ravel()[kept])
            rows.append(row[kept])
            columns.append(column[kept])
        place = np.concatenate(rows), np.concatenate(columns)
        return coo_matrix((np.concatenate(entries), place), shape=(len(self._q),) * 2)

    def stiffness_at(self, q: Floats) -> coo_matrix:
        """Of the springs at some coordinates [N/m], (d, d)."""
        ways, long = self._ways(self.bodies.places(q))
        along = self._springs * self._lengths / long**3
        each = (self._springs - along * long**2)[:, None, None] * np.eye(ways.shape[1])
        return self._assembled(each + along[:, None, None] * np.einsum("ei,ej->eij", ways, ways))

    def unbalanced_at(self, q: Floats) -> Floats:
        """Loads and forces of the springs at t = 0 at some coordinates [N], (d,)."""
        ways, long = self._ways(self.bodies.places(q))
        pulled = self._gathered((self._springs * (1.0 - self._lengths / long))[:, None] * ways)
        loads = self._loads(0.0, 0.0, self._drive(0.0, 0.0))
        return np.asarray(pulled[self.bodies.free].ravel() + loads)

    def _drive(self, start: float, end: float) -> Floats:
        """Forces on all of it in a step [N], (dim,)."""
        means = [mean(start, end) for mean in self._forces]
        return self._applied + means if means else self._applied

    def _loads(self, start: float, end: float, drive: Floats) -> Floats:
        """Gravity and forces on all of it in a step [N], (d,)."""
        pull = self.gravity(start, end) + drive / self.bodies.masses[0]
        return self._mass * np.tile(pull, len(self.bodies.free))

    def apply(self, body: int, force: Floats, moment: Floats) -> bool:  # noqa: ARG002  (it is one)
        """See `FewInterior`; masses do not take moments."""
        if moment.any():
            return False
        self._applied = force
        return True

    def displaced(self, q: Floats) -> Floats:
        """Displacements of the contact nodes with some coordinates [m], (count, dim)."""
        return self.bodies.places(q) - self._start

    def at_rest(self) -> NetAtRest:
        """It as the search for equilibrium asks it."""
        return NetAtRest(self)

    def put(self, q: Floats) -> None:
        """Begin at some coordinates."""
        self._q = q
        self._prepare(self._v)

    def _end(self, ahead: Floats) -> Floats:
        return np.asarray(self._q + 0.5 * self.span * (self._v + ahead))

    def _after(self, ahead: Floats) -> Floats:
        """Places of all nodes at the end of the layer [m], (nodes, dim)."""
        places = self.bodies.places(self._end(ahead))
        if self._led is not None and self._led_ahead is not None:
            places += self._led_ahead[0] - self._led[0]
        return places

    def _ends(self, ahead: Floats) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
        """Ways and lengths of the springs at both ends of the layer."""
        return self._ways(self.bodies.places(self._q)), self._ways(self._after(ahead))

    def _shares(self, begin: Floats, end: Floats) -> Floats:
        """Forces of springs and dampers by their ways amid the layer [N/m], (springs,)."""
        lag = 2.0 * self.bodies.damping[1] / self.span
        longer = lag * (end - begin) if lag else 0.0
        shares = self._springs * (1.0 - (2.0 * self._lengths - longer) / (begin + end))
        return np.asarray(shares)

    def _gathered(self, forces: Floats) -> Floats:
        """Forces on the nodes by those along the springs (springs, dim), (nodes, dim)."""
        found = np.zeros_like(self._start)
        np.add.at(found, self._one, forces)
        np.add.at(found, self._two, -forces)
        return found

    def _pulled(self, ahead: Floats) -> Floats:
        """Forces of springs and dampers in the layer on all nodes, (nodes, dim)."""
        (before, begin), (after, end) = self._ends(ahead)
        return self._gathered(self._shares(begin, end)[:, None] * (0.5 * (before + after)))

    def _pull(self, ahead: Floats) -> Floats:
        """The same on the coordinates, and what brakes masses, (d,)."""
        found = self._pulled(ahead)[self.bodies.free].ravel()
        if rate := self.bodies.damping[0]:
            found = found - 0.5 * rate * self._mass * (self._v + ahead)
        return found

    def _settle(self, ahead: Floats) -> Floats:
        """Velocities at the end of the layer, by Newton's method with a tangent that is kept."""
        self._amid = None
        size, last = float(np.abs(ahead).max() + np.abs(self._v).max()), np.inf
        slow = False
        for _ in range(_MOST):
            if slow:
                self._prepare(ahead)
            forced = self.span * (self._pull(ahead) + self._weight) + self._pushed + self._joined
            change = self._factor.solve(forced - self._mass * (ahead - self._v))
            ahead = ahead + change
            if not np.isfinite(ahead).all():
                break
            size = max(size, float(np.abs(ahead).max()))
            share = float(np.abs(change).max()) / (_SETTLED * (size + self._rounding))
            if share <= 1.0 or (share <= _STALLED and share >= 0.5 * last):
                return ahead
            slow, last = share > _SLOW * last, share
        raise ConvergenceError(
            f"the springs of {self.bodies.names[0]} did not settle at t = {self._time:.6g} s; use "
            "a smaller solve.dt"
        )

    @property
    def surface_velocity(self) -> Floats:
        """Of the contact nodes [m/s], (count, dim)."""
        return self._with_led(self.spread(self._v), self._led)

    @staticmethod
    def _with_led(speeds: Floats, led: tuple[Floats, Floats] | None) -> Floats:
        """Velocities of all nodes, moved ones among them."""
        return speeds if led is None else speeds + led[1]

    def _with_led_places(self, places: Callable[[Floats], Floats]) -> Callable[[Floats], Floats]:
        """Places of all nodes, moved ones where they are now."""

        def moved(q: Floats) -> Floats:
            found = places(q)
            return found if self._led is None else found + self._led[0]

        return moved

    def predicted(self, start: float, end: float) -> Floats:
        """Where contact nodes go if nothing changes [m], (count, dim)."""
        found = super().predicted(start, end)
        return found if self._led is None else found + (end - start) * self._led[1]

    def spread(self, values: Floats) -> Floats:
        """Values of free coordinates (..., d) at all nodes (..., nodes, dim), 0 where held."""
        found = np.zeros((*values.shape[:-1], *self._start.shape))
        found[..., self.bodies.free, :] = values.reshape(
            *values.shape[:-1], len(self.bodies.free), -1
        )
        return found

    def contact_speeds(self, way: Floats) -> tuple[Floats, Floats]:  # noqa: ARG002  (of others)
        """Velocities of the contact nodes at both ends of the layer without contact forces."""
        return self.surface_velocity, self._with_led(self.spread(self._ahead), self._led_ahead)

    def begin(self, start: float, end: float) -> None:
        """Solve the layer without forces of contact and joints."""
        self.span, self._time = step_length(start, end, self.dt), 0.5 * (start + end)
        self._driving = self._drive(start, end)
        self._weight = self._loads(start, end, self._driving)
        self._pushed = self._joined = self._kick = np.zeros_like(self._v)
        self._begun = None
        if self._led is not None:
            self._led_ahead, self._struck = self.bodies.leading(end), np.zeros_like(self._start)
        self._prepare(self._v)
        self._ahead = self._settle(self._v)

    set_out = begin

    def held(self, stations: Stations) -> Held:
        """It as joints hold it: by tips, which are its stations."""
        self._tips = FollowedTips(stations, self.bodies.dim)
        return HeldLumped(self, self._tips.as_coordinates(stations))

    @property
    def _rows_amid(self) -> Floats:
        """Rates of the tips by velocities amid the layer, as it is solved now."""
        if self._amid is None:
            self._amid = self._tips.rows(0.5 * (self._q + self._end(self._ahead)))
        return self._amid

    @property
    def joined_coordinates(self) -> Floats:
        """Places of the tips."""
        return self._tips.places(self._q)

    @property
    def rates(self) -> Floats:
        """Of the tips at the start of the layer, (tips,)."""
        if self._begun is None:
            self._begun = self._tips.rows(self._q)
        return self._begun @ self._v

    @property
    def rates_ahead(self) -> Floats:
        """Those that with `rates` make the ways and turns of the layer, (tips,)."""
        mean = 0.5 * (self._v + self._ahead)
        return 2.0 * self._rows_amid @ mean - self.rates

    @property
    def rates_left(self) -> Floats:
        """Of the tips at the end of the layer, (tips,)."""
        return self._tips.rows(self._end(self._ahead)) @ self._ahead

    @property
    def reach(self) -> Floats:
        """Rates of the tips by unit impulses in the layer, (tips, tips)."""
        rows = self._rows_amid
        return np.asarray(rows @ self._factor.solve(np.ascontiguousarray(rows.T)))

    @property
    def reach_ahead(self) -> Floats:
        """The same at its end, of impulses that leave no time for anything else."""
        rows = self._tips.rows(self._end(self._ahead))
        return np.asarray((rows / self._mass) @ rows.T)

    def impel(self, impulse: Floats) -> bool:
        """Solve the layer with an impulse of joints on the tips; it does not answer linearly."""
        new = impulse @ self._rows_amid
        guess = self._ahead + self._factor.solve(new - self._joined)
        self._joined = new
        self._ahead = self._settle(guess)
        return False

    def kick(self, impulse: Floats) -> None:
        """Let the next layer start with velocities that an impulse on the tips has changed."""
        self._kick = impulse @ self._tips.rows(self._end(self._ahead)) / self._mass

    def reached(self, forces: Floats) -> Floats:
        """Rates of the tips by several contact forces for a second, (several, tips)."""
        moved = self._factor.solve(self._on_free(forces).T)
        return np.asarray(self._rows_amid @ moved).T

    def carried(self, impulses: Floats) -> Floats:
        """Velocities of the contact nodes by impulses on the tips, (several, count, dim)."""
        pushed = np.ascontiguousarray((impulses @ self._rows_amid).T)
        return self.spread(self._factor.solve(pushed).T)

    def _on_free(self, forces: Floats) -> Floats:
        """Forces (several, count, dim) on free coordinates, (several, d)."""
        return np.ascontiguousarray(forces[:, self.bodies.free].reshape(len(forces), -1))

    @property
    def surface_iterate(self) -> Floats:
        """Displacements of the nodes at the end of the layer, as it is solved now [m]."""
        return self._after(self._ahead) - self._start

    def columns(self, forces: Floats) -> tuple[Floats, Floats]:
        """Displacements of the contact nodes by several forces; nothing is massless."""
        moved = 0.5 * self.span**2 * self._factor.solve(self._on_free(forces).T).T
        return self.spread(moved), np.zeros_like(forces)

    answers = columns

    def strike(self, forces: Floats) -> None:
        """The same."""
        more = self.span * forces[self.bodies.free].ravel()
        self._pushed, self._struck = self._pushed + more, self._struck + self.span * forces
        self._ahead = self._settle(self._ahead + self._factor.solve(more))

    def lay(self, forces: Floats) -> None:
        """Put the contact forces of the step (count, dim), to be solved for."""
        self._pushed = self.span * forces[self.bodies.free].ravel()
        self._struck = self.span * forces

    def settle(self) -> None:
        """Solve for the velocities at the end of the step, with what has pushed so far."""
        self._ahead = self._settle(self._ahead)

    def jolt(self, impulses: Floats) -> None:
        """Change the velocities now by impulses on the nodes [N s], (count, dim)."""
        self._v = self._v + impulses[self.bodies.free].ravel() / self._mass

    def look(self) -> None:
        """Nothing: forces act on nodes wherever these are."""

    def changed(self, ahead: Floats) -> tuple[float, float, float]:
        """By how much velocities have changed since, what changes them, and rounding [m/s]."""
        acting = self._pushed / self._mass, self._ahead - self._v, SHARE * self._v
        sizes = [float(np.abs(each).max(initial=0.0)) for each in (self._ahead - ahead, *acting)]
        return sizes[0], max(sizes[1:]), self.noise

    @property
    def noise(self) -> float:
        """Rounding of velocities [m/s]."""
        size = self._rounding + float(np.abs(self._ahead).max() + np.abs(self._v).max())
        return _STALLED * _SETTLED * size

    def advance(self) -> float:
        """End the step at what was found; the work of forces and supports that move [J]."""
        work = self._lead() + self._driven()
        self._q, self._v = self._end(self._ahead), self._ahead + self._kick
        if self._led_ahead is not None:
            self._led = self._led_ahead
        self._begun = None
        return work

    def _driven(self) -> float:
        """Work of forces on all of it [J]."""
        if not self._driving.any():
            return 0.0
        way = self.spread(0.5 * self.span * (self._v + self._ahead))
        if self._led is not None and self._led_ahead is not None:
            way = way + self._led_ahead[0] - self._led[0]
        carried = self.bodies.node_mass @ way / self.bodies.masses[0]
        return float(self._driving @ carried)

    def _lead(self) -> float:
        """Work of supports on the masses that they move [J]: what these gain, less other forces."""
        if self._led is None or self._led_ahead is None:
            return 0.0
        (here, speed), (there, later) = self._led, self._led_ahead
        mass, way, span = self.bodies.node_mass, there - here, self.span
        gained = 0.5 * float(mass @ (later**2 - speed**2).sum(axis=1))
        weight = mass[:, None] * (self._weight[: way.shape[1]] / self._mass[: way.shape[1]])
        other = self._pulled(self._ahead) + weight + self._struck / span
        return gained - float((other * way).sum())

    def memory(self) -> dict[str, Floats]:
        """Coordinates, their rates, and where supports are."""
        led = {} if self._led is None else {"led": np.array(self._led)}
        return super().memory() | led

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        super().remember(memory)
        if self._led is not None:
            self._led = self._led_ahead = memory["led"][0].copy(), memory["led"][1].copy()

    def spins(self) -> Floats:
        """Velocities of the contact nodes by unit spins [m], (turns, count, dim)."""
        places = self.bodies.places(self._q)
        centre = self.bodies.node_mass @ places / self.bodies.masses[0]
        return np.array(unit_spins(places - centre))

    def summed(self, work: float) -> list[Sums]:
        """Sums now, with the work of supports since the last ones [J]."""
        bodies, mass, dim = self.bodies, self.bodies.node_mass, self.bodies.dim
        turns = dim * (dim - 1) // 2
        if not self.counts:
            none = np.zeros(dim)
            return [Sums(0.0, 0.0, 0.0, none, none, np.zeros(turns), np.zeros(2 * dim * dim))]
        places, speed = bodies.places(self._q), self.surface_velocity
        kinetic = 0.5 * float(self._mass @ self._v**2)
        if self._led is not None:
            kinetic += 0.5 * float(mass @ (self._led[1] ** 2).sum(axis=1))
        momentum, moved = mass @ speed, mass @ (places - self._start)
        arms = places - mass @ places / bodies.masses[0]
        spin = np.einsum("tnd,nd,n->t", self.spins(), speed, mass)
        rest = self._start - bodies.centers[0]
        fit, second = (mass * arms.T) @ rest, (mass * arms.T) @ arms
        return [
            Sums(
                kinetic, bodies.elastic(places), work, momentum, moved, spin,
                np.concatenate([fit.ravel(), second.ravel()]),
            )
        ]  # fmt: skip

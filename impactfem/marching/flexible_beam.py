"""Layers of beams that turn far: an energy-momentum step in places and frames of their nodes.

    m (v_b - v_a) = dt (f + m g + F),   x_b = x_a + dt (v_a + v_b) / 2,
    R_b J W_b - R_a J W_a = dt (moments),   R_b = Cayley(R_a dt (W_a + W_b) / 2) R_a,

with spins W along the axes of the frames R, and forces and moments of `impactfem.system.
beam_kernels`, which do the work of the energy of strains at the mean places. Energy, momentum and
angular momentum stay to rounding; what turns about a principal axis turns by 2 atan(dt W / 2) in a
step. Iterates take the tangent by derivatives along imaginary steps, exact to rounding, and keep it
as long as it leads on.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg.lapack import dgbtrf, dgbtrs

from impactfem.arrays import Booleans, Floats
from impactfem.errors import ConvergenceError
from impactfem.findings import Finding, by_limits
from impactfem.marching.few import FewInterior
from impactfem.marching.flexible_start import FlexibleAtRest
from impactfem.marching.held_rows import HeldLumped
from impactfem.marching.iterated import SHARE
from impactfem.marching.layers import Sums
from impactfem.marching.meshless import step_length
from impactfem.marching.stations import Held
from impactfem.scene import PiecewiseVector
from impactfem.system.beam_kernels import banded, foreseen_in_step, resistance, tangent, turn_by
from impactfem.system.flexible_beam import FlexibleBeam, Frames, carried
from impactfem.system.rigid_modes import unit_spins
from impactfem.system.stations import Stations

_MOST = 40  # iterates of a layer
_SETTLED = 2.0**-51  # their change, as a share of the rates and of what rounding moves
_STALLED = 64.0  # the same for one that no longer falls
_FAR = 1e11  # change by which stresses are foreseen from the first iterate on
_SLOW = 0.1  # ratio of changes from which on the tangent is renewed
_BAND = 11  # of matrices of nodes and their neighbours
_SHARP = (0.5, 1.5)  # turns in an element [rad] beyond which more are needed


class Banded:
    """A factored matrix of nodes that know their neighbours."""

    def __init__(self, blocks: Floats, beside: Floats, free: Booleans) -> None:
        """Factor it; see `impactfem.system.beam_kernels.banded`."""
        full = np.zeros((34, 6 * len(blocks)))
        banded(blocks, beside, free, full)
        self._factor, self._pivots, fault = dgbtrf(full, _BAND, _BAND)
        if fault:
            raise ConvergenceError("the tangent of a beam is singular; use a smaller solve.dt")
        self._held = ~free

    def solve(self, right: Floats) -> Floats:
        """Of (6 nodes,) or (6 nodes, several); nothing of what is held."""
        right = np.array(right)
        right[self._held] = 0.0
        found = dgbtrs(self._factor, _BAND, _BAND, right, self._pivots)[0]
        return np.asarray(found.reshape(right.shape))


class FlexibleMidpoint(FewInterior):
    """Interior of a beam that turns far; see `impactfem.marching.layers.Interior`.

    Unknowns of a step are displacements of the nodes in it, and their turns in space, (nodes, 6).

    Attributes:
        span: Of the step [s].
    """

    bodies: FlexibleBeam

    def __init__(
        self, bodies: FlexibleBeam, gravity: PiecewiseVector, dt: float, *, counts: bool
    ) -> None:
        """Begin at t = 0; see `FewInterior`."""
        super().__init__(bodies, gravity, dt, counts=counts)
        self.span = dt
        count = bodies.nodes
        self._moved = np.zeros((count, 3))
        self._turned = bodies.turns.copy()
        self._speed, self._spin = bodies.ahead[0].copy(), bodies.ahead[1].copy()
        self._free = bodies.moves.ravel()
        self.massive = self.volatile = np.ones(count, dtype=bool)
        length = bodies.beam.length
        self._scale = np.array([1.0, 1.0, 1.0, *([length] * 3)])  # of turns, as ways [m]
        self._rounding = count * length
        none = np.zeros((count, 6))
        self._pushed, self._joined, self._kick = none, none, none
        self._loads: Floats | float = 0.0
        self._steepest = 0.0
        self._applied: Floats | None = None
        self._tips: _Tips  # where joints hold it
        self._rows_amid: Floats | None = None  # of the tips
        self._mass = bodies.node_mass[:, None]
        self._look_at_start()
        self._way = np.zeros((count, 6))
        self._outer: Frames = self._frames
        self._factor = self._tangent(self._way)
        self.beyond: Floats = np.zeros_like(self.surface_way)

    @property
    def _frames(self) -> Frames:
        return self._moved, self._turned

    def _look_at_start(self) -> None:
        """What a step begins with."""
        self._before = self.bodies.looked(self._frames)[0]
        own = self._turned @ (self.bodies.inertia * self._spin)[..., None]
        self._whirl = own[..., 0]  # angular momenta of the nodes in space

    # ---- one step ------------------------------------------------------------------------------

    def _known(self) -> tuple[Any, ...]:
        """What the kernels of a step take."""
        bodies = self.bodies
        alpha, beta = bodies.beam.rayleigh_damping
        return (
            (self._moved, self._turned), (self._speed, self._spin, self._whirl),
            (bodies.node_mass, bodies.inertia, bodies.springs), bodies.elements, bodies.sides,
            self._before, bodies.turns, self.span, beta, alpha,
        )  # fmt: skip

    def _inside(self, way: Floats) -> tuple[Floats, Frames]:
        """What strains, springs and momenta take in a step, (nodes, 6), and where it ends."""
        found, turned = np.empty_like(way), np.empty_like(self._turned)
        resistance(way, *self._known(), found, turned)
        return found, (self._moved + way[:, :3], turned)

    def _tangent(self, way: Floats, since: Floats | None = None) -> Banded:
        """Of a step that ends so, with stresses that the iterate before has foreseen if any."""
        count, bodies = len(way), self.bodies
        blocks, beside = np.zeros((count, 6, 6)), np.zeros((2, count - 1, 6, 6))
        turned = self._inside(way)[1][1]
        stresses = np.zeros((len(bodies.elements), 0))
        if since is not None:
            stresses = np.zeros((len(bodies.elements), 6))
            foreseen_in_step(
                since, way - since, self._frames, bodies.elements, bodies.sides, self._before,
                bodies.turns, self.span, bodies.beam.rayleigh_damping[1],
                self._inside(since)[1][1], stresses,
            )  # fmt: skip
        tangent(way, *self._known(), turned, stresses, blocks, beside)
        return Banded(blocks, beside, self._free)

    def _settle(self, way: Floats) -> Floats:
        """The step, by Newton's method with a tangent that is kept."""
        self._rows_amid = None
        acting = self._weight + self._pushed / self.span + self._joined / self.span
        size = self._largest(way) + self.span * self._largest_rate
        last, slow, since = np.inf, False, way
        for _ in range(_MOST):
            if slow:
                self._factor = self._tangent(way, since)
            found, _ = self._inside(way)
            rest = acting + self._loads_at(way) - found
            change = self._factor.solve(rest.ravel()).reshape(way.shape)
            since, way = way, way + change
            if not np.isfinite(way).all():
                break
            size = max(size, self._largest(way))
            share = self._largest(change) / (_SETTLED * (size + self._rounding))
            if share <= 1.0 or (share <= _STALLED and share >= 0.5 * last):
                self._outer = self._inside(way)[1]
                return way
            slow, last = share > _SLOW * min(last, _FAR), share
        raise ConvergenceError(
            f"the strains of {self.bodies.names[0]} did not settle at t = {self._time:.6g} s; use "
            "a smaller solve.dt"
        )

    def _largest(self, way: Floats) -> float:
        return float(np.abs(way * self._scale).max(initial=0.0))

    @property
    def _largest_rate(self) -> float:
        return float(max(np.abs(self._speed).max(), self._scale[3] * np.abs(self._spin).max()))

    def _loads_at(self, way: Floats) -> Floats | float:
        """Forces of loads in a step, (nodes, 6)."""
        loads = self.bodies.loads
        if loads is None or (loads.is_dead and not isinstance(self._loads, float)):
            return self._loads
        times = self._time - 0.5 * self.span, self._time + 0.5 * self.span
        mean = self._as_coordinates(self._moved + 0.5 * way[:, :3])
        found = loads.mean(*times, mean).reshape(way.shape)
        self._loads = found
        return found

    def begin(self, start: float, end: float) -> None:
        """Solve the layer without forces of contact and joints."""
        self.span, self._time = step_length(start, end, self.dt), 0.5 * (start + end)
        self._weight = np.zeros_like(self._way)
        self._weight[:, : self.bodies.dim] = self._mass * self.gravity(start, end)
        if self._applied is not None:
            self._weight[:, : self.bodies.dim] += self._applied
        none = np.zeros_like(self._way)
        self._pushed, self._joined, self._kick = none, none, none
        self._rows_amid = None
        guess = self.span * np.hstack([self._speed, self._space(self._spin)])
        self._factor = self._tangent(guess)
        self._way = self._settle(guess)
        self.beyond = np.zeros_like(self.surface_way)

    set_out = begin

    def _space(self, spins: Floats) -> Floats:
        """Spins along the axes of the nodes as those in space."""
        return np.asarray((self._turned @ spins[..., None])[..., 0])

    # ---- rates ---------------------------------------------------------------------------------

    @property
    def _rates_now(self) -> Floats:
        """Velocities and spins in space at the start of the step, (nodes, 6)."""
        return np.hstack([self._speed, self._space(self._spin)])

    @property
    def _rates_then(self) -> Floats:
        """Those at its end."""
        mean = self._way / self.span
        spin = (self._turned.swapaxes(-1, -2) @ mean[:, 3:, None])[..., 0]
        own = 2.0 * spin - self._spin
        return np.hstack(
            [2.0 * mean[:, :3] - self._speed, (self._outer[1] @ own[..., None])[..., 0]]
        )

    def known(self) -> Floats:
        """The step as it is solved now."""
        return self._way.copy()

    def changed(self, ahead: Floats) -> tuple[float, float, float]:
        """By how much rates have changed since, what changes them, and rounding [m/s]."""
        span = self.span
        acting = np.zeros_like(self._way)
        acting[:, :3] = self._pushed[:, :3] / self._mass
        gained = 2.0 * (self._way / span - self._rates_now)
        sizes = [
            self._largest(each)
            for each in ((self._way - ahead) * 2.0 / span, acting, gained, SHARE * self._rates_now)
        ]
        return sizes[0], max(sizes[1:]), self.noise

    @property
    def noise(self) -> float:
        """Rounding of velocities [m/s]."""
        size = self._rounding / self.span + self._largest_rate
        return 2.0 * _STALLED * _SETTLED * size

    # ---- contact nodes -------------------------------------------------------------------------

    @property
    def coordinates(self) -> Floats:
        """Displacements of the nodes and, as 0, their turns, (6 nodes,)."""
        return self._as_coordinates(self._moved)

    @staticmethod
    def _as_coordinates(moved: Floats) -> Floats:
        return np.hstack([moved, np.zeros_like(moved)]).ravel()

    @property
    def surface_displacement(self) -> Floats:
        """Of the contact nodes since t = 0 [m], (count, dim)."""
        return self._moved[:, : self.bodies.dim].copy()

    @property
    def surface_velocity(self) -> Floats:
        """Of the contact nodes [m/s], (count, dim)."""
        return self._speed[:, : self.bodies.dim].copy()

    @property
    def surface_iterate(self) -> Floats:
        """Displacements of the nodes at the end of the layer, as it is solved now [m]."""
        return (self._moved + self._way[:, :3])[:, : self.bodies.dim]

    @property
    def surface_way(self) -> Floats:
        """How far the nodes move in the step, as it is solved now [m], (count, dim)."""
        return self._way[:, : self.bodies.dim].copy()

    def predicted(self, start: float, end: float) -> Floats:
        """Where contact nodes go if nothing changes [m], (count, dim)."""
        return (self._moved + (end - start) * self._speed)[:, : self.bodies.dim]

    def contact_speeds(self, way: Floats) -> tuple[Floats, Floats]:  # noqa: ARG002  (of others)
        """Velocities of the contact nodes at both ends of the layer without contact forces."""
        dim = self.bodies.dim
        return self.surface_velocity, self._rates_then[:, :dim]

    @property
    def velocity_ahead(self) -> Floats:
        """Of the contact nodes at the end of the step, as it is solved now [m/s], (count, dim)."""
        return self._rates_then[:, : self.bodies.dim]

    def drift(self, span: float) -> None:
        """Go on for a time [s] at the rates now, without forces."""
        self._moved = self._moved + span * self._speed
        for turned, turn in zip(self._turned, span * self._space(self._spin), strict=True):
            turn_by(turn, turned.copy(), turned)
        self._look_at_start()

    def _on_nodes(self, forces: Floats) -> Floats:
        """Forces (..., count, dim) as those on the unknowns, (..., count, 6)."""
        found = np.zeros((*forces.shape[:-1], 6))
        found[..., : self.bodies.dim] = forces
        return found

    def columns(self, forces: Floats) -> tuple[Floats, Floats]:
        """Displacements of the contact nodes by several forces; nothing is massless."""
        moved = self._factor.solve(self._on_nodes(forces).reshape(len(forces), -1).T).T
        found = moved.reshape(len(forces), -1, 6)[..., : self.bodies.dim]
        return np.ascontiguousarray(found), np.zeros_like(forces)

    answers = columns

    def strike(self, forces: Floats) -> None:
        """The same, and how far the nodes go beyond what `columns` says of these forces."""
        foreseen = self.surface_way + self.columns(forces[None])[0][0]
        self._pushed = self._pushed + self.span * self._on_nodes(forces)
        self._way = self._settle(self._way)
        self.beyond = self.beyond + self.surface_way - foreseen

    def lay(self, forces: Floats) -> None:
        """Put the contact forces of the step (count, dim), to be solved for."""
        self._pushed = self.span * self._on_nodes(forces)

    def settle(self) -> None:
        """Solve for the step, with what has pushed so far."""
        self._way = self._settle(self._way)

    def look(self) -> None:
        """Nothing: forces act on nodes wherever these are."""

    def jolt(self, impulses: Floats) -> None:
        """Change the velocities now by impulses on the nodes [N s], (count, dim)."""
        more = self._on_nodes(impulses)[:, :3] / self._mass
        self._speed = self._speed + more * self.bodies.moves[:, :3]

    def apply(self, body: int, force: Floats, moment: Floats) -> bool:  # noqa: ARG002  (one)
        """See `FewInterior`: spread as mass is; it takes no moments."""
        if moment.any():
            return False
        self._applied = self._mass / self.bodies.masses[0] * force
        return True

    # ---- joints --------------------------------------------------------------------------------

    def held(self, stations: Stations) -> Held:
        """It as joints hold it: by sections, which are its stations."""
        self._tips = _Tips(self.bodies, stations)
        return HeldLumped(self, self._tips.as_coordinates(stations))

    def _amid(self) -> Floats:
        """Rates of the tips by those of the nodes in the step, (tips, 6 nodes)."""
        if self._rows_amid is None:
            self._rows_amid = self._tips.rows(0.5 * (self._turned + self._outer[1]))
        return self._rows_amid

    @property
    def joined_coordinates(self) -> Floats:
        """Places of the tips, and 0 for turns."""
        return self._tips.places(self._frames)

    @property
    def rates(self) -> Floats:
        """Of the tips at the start of the layer, (tips,)."""
        return self._tips.rows(self._turned) @ self._rates_now.ravel()

    @property
    def rates_ahead(self) -> Floats:
        """Those that with `rates` make the ways and turns of the layer, (tips,)."""
        return 2.0 / self.span * (self._amid() @ self._way.ravel()) - self.rates

    @property
    def rates_left(self) -> Floats:
        """Of the tips at the end of the layer, (tips,)."""
        return self._tips.rows(self._outer[1]) @ self._rates_then.ravel()

    @property
    def reach(self) -> Floats:
        """Rates of the tips by unit impulses in the layer, (tips, tips)."""
        rows = self._amid()
        return np.asarray(2.0 / self.span**2 * rows @ self._factor.solve(rows.T))

    def _freed(self, impulses: Floats, turned: Floats) -> Floats:
        """Rates of the nodes by impulses on them (6 nodes, several) that leave no time."""
        given = (impulses.T * self.bodies.moves.ravel()).reshape(-1, self.bodies.nodes, 6)
        own = (turned.swapaxes(-1, -2) @ given[..., 3:, None])[..., 0] / self.bodies.inertia
        spins = (turned @ own[..., None])[..., 0]
        return np.concatenate([given[..., :3] / self._mass, spins], axis=-1).reshape(len(given), -1)

    @property
    def reach_ahead(self) -> Floats:
        """The same at its end, of impulses that leave no time for anything else."""
        rows = self._tips.rows(self._outer[1])
        return np.asarray(rows @ self._freed(rows.T, self._outer[1]).T)

    def impel(self, impulse: Floats) -> bool:
        """Solve the layer with an impulse of joints on the tips; it does not answer linearly."""
        new = (impulse @ self._amid()).reshape(self._way.shape)
        self._joined = new
        self._way = self._settle(self._way)
        return False

    def kick(self, impulse: Floats) -> None:
        """Let the next layer start with rates that an impulse on the tips has changed."""
        given = impulse @ self._tips.rows(self._outer[1])
        self._kick = self._freed(given[:, None], self._outer[1])[0].reshape(-1, 6)

    def reached(self, forces: Floats) -> Floats:
        """Rates of the tips by several contact forces for a second, (several, tips)."""
        moved = self._factor.solve(self._on_nodes(forces).reshape(len(forces), -1).T)
        return np.asarray(2.0 / self.span * self._amid() @ moved).T / self.span

    def carried(self, impulses: Floats) -> Floats:
        """Velocities of the contact nodes by impulses on the tips, (several, count, dim)."""
        moved = self._factor.solve((impulses @ self._amid()).T).T
        rates = 2.0 / self.span**2 * moved.reshape(len(impulses), -1, 6)
        return np.ascontiguousarray(rates[..., : self.bodies.dim])

    # ---- ends of steps -------------------------------------------------------------------------

    def advance(self) -> float:
        """End the step at what was found; the work of loads [J]."""
        work = 0.0
        if not isinstance(self._loads, float):
            work = float((self._loads * self._way).sum())
            self._loads = 0.0
        if self._applied is not None:
            work += float((self._applied * self.surface_way).sum())
        then = self._rates_then + self._kick
        self._moved, self._turned = self._outer
        self._speed = then[:, :3].copy()
        self._spin = (self._turned.swapaxes(-1, -2) @ then[:, 3:, None])[..., 0]
        self._turned = _orthonormal(self._turned)
        self._outer = self._frames
        self._way = np.zeros_like(self._way)
        self._look_at_start()
        return work

    def spins(self) -> Floats:
        """Velocities of the contact nodes by unit spins [m], (turns, count, dim)."""
        places = self.bodies.places(self.coordinates)
        centre = self.bodies.node_mass @ places / self.bodies.masses[0]
        return np.array(unit_spins(places - centre))

    def summed(self, work: float) -> list[Sums]:
        """Sums now, with the work of loads since the last ones [J]."""
        bodies, mass, dim = self.bodies, self.bodies.node_mass, self.bodies.dim
        turns = dim * (dim - 1) // 2
        self._steepest = max(self._steepest, bodies.steepest(self._frames))
        if not self.counts:
            none = np.zeros(dim)
            return [Sums(0.0, 0.0, 0.0, none, none, np.zeros(turns), np.zeros(2 * dim * dim))]
        places = bodies.places(self.coordinates)
        speed = self.surface_velocity
        arms = places - mass @ places / bodies.masses[0]
        own = self._whirl[:, 3 - turns :].sum(axis=0)
        spin = np.einsum("tnd,nd,n->t", self.spins(), speed, mass) + own
        # Angles in the plane are those to the x axis, rotations in space those since t = 0.
        back = np.eye(3)
        if dim == 2 and bodies.beam.curve is None:
            back = bodies.turns[0]
        rest = (bodies.places(0.0 * self.coordinates) - bodies.centers[0]) @ back[:dim, :dim]
        kinetic = 0.5 * float(mass @ (self._speed**2).sum(axis=1))
        kinetic += 0.5 * float((bodies.inertia * self._spin**2).sum())
        # Of a thin body about its axis the sections tell the rotation.
        turned = np.einsum("nk,nik,njk->ij", bodies.inertia, self._turned, bodies.turns) @ back
        about = np.einsum("nk,nik,njk->ij", bodies.inertia, self._turned, self._turned)
        fit = (mass * arms.T) @ rest + turned[:dim, :dim]
        second = (mass * arms.T) @ arms + about[:dim, :dim]
        return [
            Sums(
                kinetic, bodies.looked(self._frames)[2], work, mass @ speed,
                mass @ self.surface_displacement, spin,
                np.concatenate([fit.ravel(), second.ravel()]),
            )
        ]  # fmt: skip

    def findings(self) -> Iterator[Finding]:
        """Elements that bend too far for what they can tell."""
        name = self.bodies.names[0]
        text = f"elements of {name} turn by up to {self._steepest:.2g} rad from end to end"
        yield from by_limits(
            "model_strain", self._steepest, _SHARP, text, name, "give it more elements"
        )

    def at_rest(self) -> FlexibleAtRest:
        """It as the search for equilibrium asks it."""
        return FlexibleAtRest(self)

    @property
    def frames(self) -> Frames:
        """Displacements of the nodes [m] and their frames now."""
        return self._frames

    def unbalanced_at(self, at: Frames) -> Floats:
        """Loads at t = 0 less internal forces at some place, (nodes, 6)."""
        found = -self.bodies.standing(at)[0]
        found[:, : self.bodies.dim] += self._mass * self.gravity(0.0, 0.0)
        if self.bodies.loads is not None:
            loads = self.bodies.loads.mean(0.0, 0.0, self._as_coordinates(at[0]))
            found += loads.reshape(found.shape)
        return found

    def put(self, at: Frames) -> None:
        """Begin at some displacements and frames."""
        self._moved, self._turned = at
        self._outer = self._frames
        self._look_at_start()

    def memory(self) -> dict[str, Floats]:
        """Places and frames, their rates, and what was seen."""
        return {
            "moved": self._moved.copy(), "turned": self._turned.copy(),
            "speed": self._speed.copy(), "spin": self._spin.copy(),
            "steepest": np.array(self._steepest),
        }  # fmt: skip

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        for name in ("moved", "turned", "speed", "spin"):
            setattr(self, f"_{name}", memory[name].copy())
        self._steepest = float(memory["steepest"])
        self._outer = self._frames
        self._look_at_start()


def _orthonormal(frames: Floats) -> Floats:
    """Frames without what rounding has bent, by one step of Newton's for the polar factor."""
    return np.asarray(frames @ (1.5 * np.eye(3) - 0.5 * frames.swapaxes(-1, -2) @ frames))


class _Tips:
    """Sections that joints hold: rigid arms at nodes."""

    def __init__(self, bodies: FlexibleBeam, stations: Stations) -> None:
        count = bodies.nodes
        each = np.zeros((len(stations.places), 6, count, 6))
        each[:, :, bodies.moves] = stations.rows
        self._nodes = np.abs(each).max(axis=(1, 3)).argmax(axis=1)
        away = stations.places - bodies.start[self._nodes]
        # Along the axes of the nodes.
        self._arms = np.einsum("ki,kij->kj", away, bodies.turns[self._nodes])
        self._start, self._count = bodies.start, count
        self._moves = np.flatnonzero(each.reshape(-1, 6 * count).any(axis=1))
        self._free = bodies.moves.ravel()

    def as_coordinates(self, stations: Stations) -> Stations:
        """The stations with rows of their own rates."""
        rows = np.eye(6 * len(self._nodes))[:, self._moves]
        return replace(stations, rows=rows.reshape(len(self._nodes), 6, -1))

    def rows(self, turned: Floats) -> Floats:
        """Rates of the tips by those of the nodes whose axes are so, (tips, 6 nodes)."""
        found = np.zeros((len(self._nodes), 6, self._count, 6))
        for k, (node, arm) in enumerate(zip(self._nodes, self._arms, strict=True)):
            found[k, :, node] = carried(turned[node] @ arm)
        return found.reshape(6 * len(self._nodes), -1)[self._moves] * self._free

    def places(self, at: Frames) -> Floats:
        """Of the tips, and 0 for turns, (tips,)."""
        moved, turned = at
        found = np.zeros((len(self._nodes), 6))
        arms = (turned[self._nodes] @ self._arms[..., None])[..., 0]
        found[:, :3] = self._start[self._nodes] + moved[self._nodes] + arms
        return found.ravel()[self._moves]

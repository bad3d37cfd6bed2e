"""Bring bodies into equilibrium before they are marched."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, cast

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.errors import ConvergenceError, SceneError
from impactfem.findings import Finding, by_limits, percent
from impactfem.marching.few_start import FewAtRest
from impactfem.marching.jointed_start import ByRows, JointedAtRest, Stationed
from impactfem.marching.layers import ContactGaps, Stepper
from impactfem.marching.mechanism_start import MechanismAtRest
from impactfem.marching.plate_start import PlateAtRest
from impactfem.marching.pressing import Pressing
from impactfem.marching.resting import Rest, Resting
from impactfem.marching.rigid_start import RigidAtRest
from impactfem.marching.rough_rest import Rough
from impactfem.marching.rubbing import Friction
from impactfem.marching.static_start import Arms, StaticStart
from impactfem.models.solids import SolidPart, SolidsModel
from impactfem.planning.solid_choices import fitting_solver
from impactfem.result.whole import Whole
from impactfem.system.statics import SolidAtRest
from impactfem.system.stations import Stations
from impactfem.system.surface import SurfaceNodes

_SHIFT_LIMITS = (0.01, np.inf)  # shares of its size by which a body is moved

_SETTLING = 2.0  # times the strain's displacements by which a body settles on what holds it
_UNHELD_LIMITS = (1e-5, np.inf)  # shares of the forces that nothing holds


@dataclass(frozen=True)
class Started:
    """Bodies at rest.

    Attributes:
        rest: Where they are.
        static: Displacements of the massless contact nodes by the contact forces [m], (nodes, dim).
        sizes: Of the bodies [m].
        others: Mass times the way of bodies without meshes [kg m], (dim,) each.
        turned: How far those of them without coordinates that tell it have turned [rad].
        carried: How far the centres of mechanisms have moved [m], (3,) each.
    """

    rest: Rest
    static: Floats
    sizes: dict[str, float]
    others: tuple[Floats, ...] = ()
    turned: Mapping[str, Floats] = field(default_factory=dict)
    carried: Mapping[str, Floats] = field(default_factory=dict)

    def details(self, model: SolidsModel, whole: Whole) -> dict[str, Any]:
        """For ``summary.json``, of what the bodies are parts of (collective)."""
        rest = self.rest
        passes, systems = rest.iterations
        return {
            "kind": "static", "residual": rest.residual, "passes": passes,
            "iterations": systems, "contact_force": whole.factor * float(rest.multiplier.sum()),
            "moved": {
                part.solid.name: whole.mean(way / part.system.total_mass).tolist()
                for part, way in zip(model.parts, self._ways(model), strict=True)
            } | {name: way.tolist() for name, way in self.carried.items()},
            "shifted": {name: rigid for name, (rigid, _) in rest.shifted.items()},
            "unheld": {name: share for name, (share, _) in rest.neutral.items()},
        }  # fmt: skip

    def fallen(self, model: SolidsModel) -> Floats:
        """Mass times the way to where the bodies rest, of all [kg m], (dim,) (collective)."""
        return np.asarray(sum([*self._ways(model), *self.others]))

    def _ways(self, model: SolidsModel) -> list[Floats]:
        each = zip(model.parts, self.of_solids(model), strict=True)
        return [part.system.momentum(place - part.system.displacement) for part, place in each]

    def of_solids(self, model: SolidsModel) -> list[Floats]:
        """Where the solids rest: displacements of the owned dofs of each [m]."""
        return list(self.rest.places[: len(model.parts)])

    def findings(self) -> tuple[Finding, ...]:
        """Bodies that had to be moved until something held them."""
        found: list[Finding] = []
        for name, (way, bent) in self.rest.shifted.items():
            share = way / self.sizes[name] if way > _SETTLING * bent else 0.0  # not of plates
            text = f'start = "static" has moved {name} by {way:.3g} m, {percent(share)} of its size'
            text += ", to where it is held"
            remedy = "check that this is the rest that is meant, or place the body there"
            found += by_limits("setting", share, _SHIFT_LIMITS, text, name, remedy)
        for name, (share, words) in self.rest.neutral.items():
            text = f"at the start nothing holds {name} against its {words}, {percent(share)} of "
            text += "the forces: it begins to move so"
            remedy = "add a support if it should not, or take smaller elements where it is held"
            found += by_limits("setting", share, _UNHELD_LIMITS, text, name, remedy)
        return tuple(found)


def linear_bodies(
    model: SolidsModel, each: Sequence[tuple[SolidPart, SurfaceNodes, Any]], linear_solver: str
) -> list[SolidAtRest]:
    """Solids of small strains as the search asks them (collective).

    Args:
        model: The solids.
        each: They, their contact nodes, and what moves mass off these.
        linear_solver: Of the march, "none" where it needs none.
    """
    gravity = np.asarray(model.scene.vector_gravity.at(0.0))
    return [
        SolidAtRest(
            part.solid.name, part.system, surface, transfer,
            fitting_solver(linear_solver, part.system.num_dofs, part.solid.dim), gravity,
            spin_of(part),
        )
        for part, surface, transfer in each
    ]  # fmt: skip


def spin_of(part: SolidPart) -> Floats:
    """Angular velocity at t = 0 [rad/s], (1,) or in space (3,)."""
    return np.atleast_1d(np.asarray(part.solid.angular_velocity, dtype=np.float64))


def start_at_rest(
    model: SolidsModel,
    bodies: Sequence[Resting],
    surfaces: Sequence[SurfaceNodes],
    interior: Stepper,
    static: Callable[[Floats], Floats],
    gaps: ContactGaps,
    pressing: Pressing,
    arms: Arms | None = None,
    others: Sequence[Any] = (),
    friction: Friction | None = None,
    jointed: tuple[Any, Sequence[int]] | None = None,
) -> Started:
    """Move interiors to equilibrium (collective).

    Args:
        model: The solids.
        bodies: They as the search asks them; freed.
        surfaces: Their contact nodes.
        interior: What marches them.
        static: What forces on contact nodes do to massless ones, (count, dim) each.
        gaps: Of all of them.
        pressing: What finds forces in them.
        arms: By which the march turns directions of gaps; see `StaticStart`.
        others: What steps bodies without meshes, whose contact nodes are the last.
        friction: In the gaps; None without any.
        jointed: What joints hold, with them, and which of the bodies these are; None: none.

    Raises:
        SceneError: Loads drive a body that nothing holds.
        ConvergenceError: No equilibrium was found.
    """
    counts = [surface.count for surface in surfaces]
    counts += [len(other.surface_displacement) for other in others]
    owns = [slice(*ends) for ends in pairwise([0, *np.cumsum(counts).tolist()])]
    besides = [other.at_rest() for other in others]
    bodies = [*bodies, *besides]
    whole = _Whole.of(model, bodies, owns, jointed, interior.dt)
    try:
        rough = None if friction is None else Rough(friction, pressing, model.dim)
        found = None if arms is None else whole.arms(arms)
        search = StaticStart(model.comm, whole.bodies, whole.owns, gaps, pressing, found, rough)
        try:
            rest = search.find()
        except (SceneError, ConvergenceError) as error:
            if not (taken := _taken(model)):
                raise
            raise type(error)(f"{error}; {taken}") from error
    finally:
        for body in whole.bodies:
            body.destroy()
    forces = whole.forces(rest.places)
    rest = replace(rest, places=tuple(whole.split(rest.places)))
    # Between layers interiors know massless nodes as they are without contact forces.
    pressed = static(rest.forces)
    free = rest.surface - pressed
    state = interior.state()
    places = [place.copy() for place in rest.places]
    for surface, own, place in zip(surfaces, owns, places, strict=False):
        surface.spread(free[own], place)
    if surfaces:
        state["displacement"] = np.concatenate(places[: len(surfaces)])
    interior.restore(state, free)
    each = zip(besides, places[len(surfaces) :], strict=True)
    fallen = tuple(other.settle(place) for other, place in each)
    if jointed is not None:
        jointed[0].settle(forces)
    sizes = {part.solid.name: part.system.nodes.size for part in model.parts}
    sizes |= {other.name: other.size for other in besides}
    sizes |= {body.name: max(sizes.values()) for body in whole.bodies if body.name not in sizes}
    each = zip(besides, places[len(surfaces) :], strict=True)
    spun = {
        other.name: other.turned(place) for other, place in each if isinstance(other, FewAtRest)
    }
    carried = {
        other.name: way / other.mass
        for other, way in zip(besides, fallen, strict=True)
        if isinstance(other, MechanismAtRest)
    }
    return Started(rest, pressed, sizes, fallen, spun, carried)


def _taken(model: SolidsModel) -> str:
    """Surfaces that joints and ties leave nothing of to touch, in words; empty if there is none."""
    whole = [
        side
        for part in model.parts
        for (side, *_), region in part.regions.items()
        if len(region.numbers) == region.every
    ]
    if not whole:
        return ""
    return (
        f"mind that joints, ties or masses hold all of {' and '.join(dict.fromkeys(whole))}, whose "
        "nodes then touch nothing: hold a part of it, by a smaller radius, or another surface"
    )


@dataclass(frozen=True)
class _Whole:
    """Bodies of a search, of which those that joints hold are one, the last.

    Attributes:
        bodies: They.
        owns: Contact nodes of each.
        kept: Which of the bodies stand alone, and which joints hold.
    """

    bodies: list[Resting]
    owns: list[slice | Integers]
    kept: tuple[list[int], list[int]]

    @classmethod
    def of(
        cls,
        model: SolidsModel,
        bodies: Sequence[Resting],
        owns: Sequence[slice],
        jointed: tuple[Any, Sequence[int]] | None,
        dt: float,
    ) -> "_Whole":
        """Take bodies; see `start_at_rest` (collective)."""
        if jointed is None or model.joints is None:
            return cls(list(bodies), list(owns), (list(range(len(bodies))), []))
        parts = dict(zip(jointed[1], (each for _, each in model.joints.parts), strict=True))
        held, stations = list(parts), list(parts.values())
        alone = [k for k in range(len(bodies)) if k not in held]
        at = [_stationed(model, bodies, k, own) for k, own in zip(held, stations, strict=True)]
        nodes = [np.arange(owns[k].start, owns[k].stop) for k in held]
        one = JointedAtRest(
            model.joints, [bodies[k] for k in held], at, [len(own) for own in nodes], dt
        )
        every: list[slice | Integers] = [owns[k] for k in alone]
        return cls(
            [*(bodies[k] for k in alone), one], [*every, np.concatenate(nodes)], (alone, held)
        )

    def split(self, places: Sequence[Floats]) -> list[Floats]:
        """Places of the bodies as they were given."""
        alone, held = self.kept
        if not held:
            return list(places)
        one = self.bodies[-1]
        each = [*places[:-1], *cast("JointedAtRest", one).split(places[-1])]
        found = dict(zip([*alone, *held], each, strict=True))
        return [found[k] for k in range(len(found))]

    def forces(self, places: Sequence[Floats]) -> Floats:
        """Those in the rows of joints [N or N m], (rows,)."""
        if not self.kept[1]:
            return np.zeros(0)
        return cast("JointedAtRest", self.bodies[-1]).forces(places[-1])

    def arms(self, arms: Arms) -> Arms:
        """By the places of the search."""
        return lambda there, places: arms(there, self.split(places))


def _stationed(
    model: SolidsModel, bodies: Sequence[Resting], index: int, stations: Stations
) -> Stationed:
    """Stations of a body as the search asks them."""
    body: Any = bodies[index]
    if isinstance(body, RigidAtRest):
        return body
    if isinstance(body, MechanismAtRest):
        return body.linked(stations.names)
    if isinstance(body, FewAtRest):
        # Ends of bars that are clamped do not move.
        stations = replace(stations, rows=stations.rows[..., : len(body.start)])
        return ByRows(stations, body.start, lambda change: change, lambda forces: forces, body.ease)
    if isinstance(body, PlateAtRest):
        own = stations.rows.shape[-1]
        behind = len(body.start) - own
        return ByRows(
            stations, body.start, lambda change: change[:own],
            lambda forces: np.pad(forces, (0, behind)), lambda _: None,
        )  # fmt: skip
    tips, held = model.tips[index], model.parts[index].system.constrained
    nodes = tips.nodes
    return ByRows(
        stations, body.start, lambda change: nodes.gather(change).ravel(),
        lambda forces: nodes.pulled(forces.reshape(-1, nodes.dim), held), lambda _: None,
    )  # fmt: skip

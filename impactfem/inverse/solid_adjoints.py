"""Derivatives of a run of solids by its steps backwards: one sweep for each number.

Whatever varies of loads, starts, places of obstacles and materials costs no more: the sweep tells
derivatives by forces of layers, by displacements and velocities at t = 0, by gaps and by the
constants of each element, which are then held against how these change from scene to scene
(`impactfem.inverse.local_slopes`).
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property, partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_array

from impactfem.arrays import Booleans, Floats
from impactfem.errors import SceneError
from impactfem.fem import MPI, gather
from impactfem.inverse.local_slopes import Local, slopes
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.solid_readings import Kept, Number, Numbers
from impactfem.inverse.steps import Changes
from impactfem.marching.layers import MaterialSums
from impactfem.marching.reversed_march import Given, Reading, ReversedMarch
from impactfem.marching.solids import SolidMarch
from impactfem.mesh.morph import SHAPES, morphed, shaped
from impactfem.scene import Plate, Scene
from impactfem.system.loads import Loads
from impactfem.system.massless import averaged
from impactfem.system.material_slopes import MaterialSlopes, cell_spans, material_numbers
from impactfem.system.matrices import body_forms
from impactfem.system.nodes import Nodes, body_nodes

if TYPE_CHECKING:
    from impactfem.inverse.contact_spells import Pair
    from impactfem.inverse.solids import SolidRuns
    from impactfem.runs.solids import Ready

_LOADS = ("tractions", "pressures")
_STARTS = ("velocity", "angular_velocity", "displacement")
_MATERIALS = (
    "density", "youngs_modulus", "poisson_ratio", "thickness", "materials", "orthotropic",
)  # fmt: skip
_OF_PLATES = ("layers", "residual_stress")


def reversible(ready: "Ready") -> bool:
    """Whether a march is known backwards."""
    march, seen, model = ready.seen.march, ready.seen, ready.seen.model
    plain = seen.feedback is None and seen.loop.started is None
    # Bodies without a mesh of their own: one plate alone.
    plain = plain and len(model.few) + min(len(model.parts), 1) == 1
    return plain and isinstance(march, SolidMarch) and march.reversible


def varies_materials(changes: Changes) -> bool:
    """Whether material or shape change with what varies, as far as is known."""
    return _varies(changes, _differ)


def _varies(changes: Changes, differ: Callable[[Any, Any], bool]) -> bool:
    """Whether bodies differ from those of scenes beside these, as far as is known."""
    bodies = changes.scene.bodies
    for share in (1e-3, -1e-3):
        try:
            others = changes.at(changes.values + share * changes.scales).bodies
        except SceneError:
            continue
        return any(differ(a, b) for a, b in zip(bodies, others, strict=True))
    return True


def _differ(body: Any, other: Any) -> bool:
    """Whether constants of their materials, or their shapes, do, and derivatives know them."""
    if getattr(body, "relaxing", ()):
        return False
    names = materials(body)
    return shaped(body, other) or any(
        getattr(body, name, None) != getattr(other, name, None) for name in names
    )


def materials(body: Any) -> tuple[str, ...]:
    """Keys of its material whose derivatives are known backwards."""
    return (*_MATERIALS, *_OF_PLATES) if isinstance(body, Plate) else _MATERIALS


@dataclass(frozen=True)
class Weights:
    """Derivatives of all numbers by what changes from scene to scene.

    Attributes:
        place, velocity: By displacements and velocities at t = 0, (numbers, owned dofs).
        loads: By forces on the dofs that loads reach, (numbers, layers, reached dofs).
        gap: By gaps at each level without displacements, (numbers, levels, gaps).
        material: By the numbers of the elements of all bodies, (numbers, each, elements); none
            where these stay.
        sums: Of each number those of each body, from which they are told where nodes move.
    """

    place: Floats
    velocity: Floats
    loads: Floats
    gap: Floats
    material: Floats
    sums: Sequence[Sequence[MaterialSums]]


@dataclass(frozen=True)
class Start:
    """What a scene begins with.

    Attributes:
        place, velocity: Displacements and velocities of owned dofs.
        gap: At the levels without displacements, (levels or 1, gaps).
        normals: Of the gaps, (gaps, dim).
    """

    place: Floats
    velocity: Floats
    gap: Floats
    normals: Floats

    @classmethod
    def of(cls, ready: "Ready") -> "Start":
        """Of a march that is ready to run."""
        march, parts = ready.seen.march, ready.seen.model.parts
        gaps, still = march.gaps, np.zeros_like(march.interior.surface_displacement)
        levels = range(march.layers + 1 if gaps.moves else 1)
        each = [gaps.at(still, still, still, k * march.interior.dt) for k in levels]
        return cls(
            np.concatenate([np.zeros(0), *(part.system.displacement for part in parts)]),
            np.concatenate([np.zeros(0), *(part.system.velocity for part in parts)]),
            np.array([gap for gap, _ in each]), each[0][1],
        )  # fmt: skip


class Adjoints:
    """Derivatives of the numbers of a run; what only solids do is said apart, for `plate_adjoints`.

    Args:
        runs: Who ran it.
        changes: The place, and the sizes of steps.
        quantities: The numbers.
        ready: The march that has ended.
        kept: What it has kept.
        pairs: What its pairs did, by name.
    """

    _loading: tuple[str, ...] = (*_LOADS, "thickness", *SHAPES)  # keys by which its loads go

    def __init__(
        self, runs: "SolidRuns", changes: Changes, quantities: Quantities, ready: "Ready",
        kept: Kept, pairs: Mapping[str, "Pair"],
    ) -> None:  # fmt: skip
        self._runs, self._changes, self._ready = runs, changes, ready
        self._quantities = quantities
        self._numbers = self._numbers_of(changes.scene, quantities, ready, kept, pairs)
        self._trail, self._reversed = kept.trail, ReversedMarch(kept.trail)
        self._march = kept.trail.march
        self._scene, self._start = changes.scene, self._start_of(ready)
        seen = ready.seen
        self._comm, self._parts = seen.model.comm, seen.model.parts
        sizes = [len(part.system.constrained) for part in self._parts]
        self._own = [slice(*ends) for ends in pairwise(np.cumsum([0, *sizes]).tolist())]
        reached = [p.system.loads.reached & ~p.system.constrained for p in self._parts]
        self._reached = np.concatenate([np.zeros(0, dtype=bool), *reached])
        self._moves = _varies(changes, shaped)

    def jacobian(self) -> tuple[Floats, Booleans] | None:
        """Derivatives of all numbers (n, P), and of which unknowns they are; None: not known."""
        read = self._numbers.read()
        if read is None:
            return None
        weights = self._weights([self._given(each) for each in read])
        by, known = slopes(self._changes, partial(self._arrays, weights))
        sizes = [each.values.size for each in self._arrays(weights, self._scene)]
        number = np.repeat(np.arange(len(sizes)) % len(read), sizes)
        sums = csr_array((np.ones(len(number)), (number, np.arange(len(number)))))
        found = np.asarray((sums @ by).toarray())
        self._quantities.add_efforts(found, self._scene)
        return found, known

    @cached_property
    def _forces(self) -> Floats:
        return self._loads(self._scene)

    def _given(self, read: "Number") -> tuple[Given, Sequence[MaterialSums], Floats]:
        """Derivatives of a number, and those by the material of all elements, (each, elements).

        With the sums of each body that tell them, if nodes move.
        """

        def add(level: int, reading: Reading) -> None:
            for part in read.get(level, ()):
                part(reading)

        into = None if self._base is None else self._sums()
        self._numbers.into = into
        found = self._reversed.given(max(read, default=0), add, into)
        moved = [self._carried(load) for load in found.loads]
        material = np.zeros((3, 0))
        if into is not None:
            material = self._whole(each.by_material() for each in into)
        told = found._replace(loads=np.array(moved).reshape(len(moved), -1))
        return told, (into or ()) if self._moves else (), material

    def _sums(self) -> Sequence[MaterialSums]:
        """Of each body, empty."""
        each = zip(self._parts, self._scene.solids, strict=True)
        return [MaterialSlopes(part.system.nodes, solid) for part, solid in each]

    def _whole(self, each: Iterable[Floats]) -> Floats:
        """Values of the elements of each body (..., elements) on all ranks, side by side."""
        return np.concatenate([gather(self._comm, one.T).T for one in each], axis=-1)

    def _carried(self, load: Floats) -> Floats:
        """By forces on nodes that loads reach, of which massless ones pass theirs on."""
        found = load.copy()
        for own, transfer in zip(self._own, self._ready.transfers, strict=True):
            if transfer is not None:
                found[own] = averaged(transfer, load[own])
        return np.asarray(found[self._reached])

    def _weights(self, found: Sequence[tuple[Given, Sequence[MaterialSums], Floats]]) -> Weights:
        march, each = self._march, [given for given, _, _ in found]
        # Of explicit layers the rate is the step that the velocity makes.
        unit = march.interior.dt if march.skips else 1.0
        levels = np.zeros((len(each), march.layers + 1, len(self._start.normals)))
        for own, given in zip(levels, each, strict=True):
            own[: len(given.gap)] = given.gap
        return Weights(
            np.array([given.place for given in each]),
            unit * np.array([given.rate for given in each]),
            np.array([given.loads for given in each]), levels,
            np.array([material for *_, material in found]), [sums for _, sums, _ in found],
        )  # fmt: skip

    def _arrays(self, weights: Weights, scene: Scene) -> Sequence[Local]:
        """What a scene gives, times the derivatives by it.

        Raises:
            SceneError: It changes more than loads, starts, places of obstacles and materials.
        """
        starts, start = self._alike(scene), self._started(scene)
        bodies = list(zip(scene.bodies, self._scene.bodies, strict=True))
        if starts:
            ready = self._runs.ready(scene)
            try:
                start = self._start_of(ready)
            finally:
                ready.destroy()
        if not np.array_equal(start.normals, self._start.normals):
            raise SceneError("its obstacles face another way")
        material, nodes = weights.material, None
        if any(shaped(a, b) for a, b in bodies):
            nodes = self._nodes_of(scene)
            material = np.array([self._moved(sums, nodes, scene) for sums in weights.sums])
        forces = self._forces
        each = ((getattr(a, n, ()), getattr(b, n, ())) for a, b in bodies for n in self._loading)
        if any(one != other for one, other in each):
            forces = self._loads(scene, nodes)
        dt, layers = self._march.interior.dt, np.arange(weights.loads.shape[1], dtype=np.float64)
        begin, end = self._spans(dt * layers)
        began = weights.place @ start.place + weights.velocity @ start.velocity
        pushed = np.einsum("nkd,kd->nk", weights.loads, forces)
        pushed, began = map(self._summed, (pushed, began))
        met = np.einsum(
            "nkg,kg->ng", weights.gap, np.broadcast_to(start.gap, weights.gap.shape[1:])
        )
        # Of each number by itself: what rounds in one may be all of another.
        found = [Local(own, {"t": (begin, end)}) for own in pushed]
        found += [Local(own, {}) for own in began[:, None]]
        spans = self._gap_spans
        found += [Local(own, spans) if spans else Local(own.sum(keepdims=True), {}) for own in met]
        if self._base is None:
            return found
        now, x = self._base
        if any(_differ(a, b) for a, b in zip(scene.bodies, self._scene.bodies, strict=True)):
            now = self._material(scene, nodes)
        return [*found, *(Local(self._made(own, now), {"x": x}) for own in material)]

    def _nodes_of(self, scene: Scene) -> Sequence[Nodes]:
        """Nodes of all bodies in a scene in which they are elsewhere (collective)."""
        each = zip(self._parts, scene.solids, strict=True)
        return [body_nodes(morphed(part.mesh, part.solid, solid)) for part, solid in each]

    def _moved(self, sums: Sequence[Any], nodes: Sequence[Nodes], scene: Scene) -> Floats:
        """Derivatives by the numbers of the elements of all bodies whose nodes are elsewhere."""
        each = zip(sums, nodes, scene.solids, strict=True)
        return self._whole(own.on(there, solid).by_material() for own, there, solid in each)

    def _started(self, scene: Scene) -> Start:  # noqa: ARG002  (plates change theirs)
        """With what a scene begins that sets out and meets obstacles as the run does."""
        return self._start

    @property
    def _gap_spans(self) -> dict[str, tuple[Floats, Floats]]:
        """Where gaps lie, as `Local` has it; empty where all change together."""
        return {}

    def _made(self, by: Floats, numbers: Floats) -> Floats:
        """What derivatives by the numbers of elements make with these, (rows, elements)."""
        return by * numbers

    @cached_property
    def _base(self) -> tuple[Floats, tuple[Floats, Floats]] | None:
        """The material of all elements, and their extent along x; None if nothing changes it."""
        if self._trail.states is None:
            return None
        return self._material(self._scene), self._cell_spans()

    def _cell_spans(self) -> tuple[Floats, Floats]:
        """Least and largest x of the elements of all bodies [m], (elements,) each."""
        spans = self._whole(np.array(cell_spans(part.system.nodes)) for part in self._parts)
        return spans[0], spans[1]

    @property
    def _nodes(self) -> Sequence[Nodes]:
        """Nodes of all bodies as they are."""
        return [part.system.nodes for part in self._parts]

    def _material(self, scene: Scene, nodes: Sequence[Nodes] | None = None) -> Floats:
        """Numbers of the material of all elements, (each, elements) (collective)."""
        each = zip(nodes or self._nodes, scene.solids, strict=True)
        return self._whole(material_numbers(own, solid) for own, solid in each)

    def _check_material(self, solid: Any, other: Any) -> None:
        """Refuse materials whose derivatives are not known backwards.

        Raises:
            SceneError: Damping, elements or the start change with them, or a number knows them.
        """
        if self._base is None or solid.relaxing:
            raise SceneError("its material is another")
        same = solid.keeps_volume == other.keeps_volume and solid.retardation == other.retardation
        same = same and not (solid.quality_factor or solid.damping_ratio)
        thicker = solid.thickness != other.thickness
        if not same or (thicker and (len(self._parts) > 1 or solid.has_residual_stress)):
            raise SceneError("its damping or its elements are others")
        heavier = solid.density != other.density or solid.materials != other.materials
        if heavier and np.any(solid.angular_velocity):
            raise SceneError("it begins to turn about another place")
        if (heavier or thicker) and self._numbers.levels:
            raise SceneError("its potential begins elsewhere")
        if self._numbers.stressed:
            raise SceneError("its stress is another")

    def _check_shape(self, solid: Any) -> None:
        """Refuse shapes whose derivatives are not known backwards.

        Raises:
            SceneError: Damping, what meets or what is read changes with them.
        """
        damped = solid.quality_factor or solid.damping_ratio or solid.relaxing
        if self._base is None or damped:
            raise SceneError("its damping is another")
        if solid.has_residual_stress or self._ready.seen.model.pairs:
            raise SceneError("its stress, or what of it meets others, is another")
        if self._numbers.placed or self._numbers.probed:
            raise SceneError("what is read lies elsewhere")

    def _summed(self, values: Floats) -> Floats:
        """Over all ranks."""
        return np.asarray(self._comm.allreduce(np.ascontiguousarray(values)))

    def _start_of(self, ready: "Ready") -> Start:
        return Start.of(ready)

    def _numbers_of(self, *given: Any) -> "Numbers":
        return Numbers(*given)

    def _spans(self, begin: Floats) -> tuple[Floats, Floats]:
        """Times whose mean acts in layers that begin at some times [s]."""
        march = self._march
        if march.skips:
            half = 0.5 * march.interior.dt
            return np.maximum(begin - half, 0.0), begin + half
        return begin, begin + march.interior.dt

    def _loads(self, scene: Scene, there: Sequence[Nodes] | None = None) -> Floats:
        """Forces on the dofs that loads reach, in all layers [N], (layers, reached dofs)."""
        march, found = self._march, []
        begin, end = self._spans(march.interior.dt * np.arange(march.layers, dtype=np.float64))
        bodies = zip(self._parts, scene.solids, self._own, there or self._nodes, strict=True)
        for part, solid, own, nodes in bodies:
            reached = self._reached[own]
            forms = body_forms(nodes, solid)
            loads = Loads(nodes, forms, part.mesh.surfaces, solid, scene.vector_gravity)
            more = loads.reached & ~part.system.constrained & ~reached
            if self._comm.allreduce(bool(more.any()), op=MPI.LOR):
                raise SceneError("its loads reach other places")
            found.append(loads.means(begin, end, reached))
            loads.destroy()
        return np.hstack(found)

    def _alike(self, scene: Scene) -> bool:
        """Whether a scene sets out or meets obstacles in another way.

        Raises:
            SceneError: It differs in more than that and loads.
        """
        moved = begun = scene.obstacles != self._scene.obstacles
        for solid, other in zip(scene.solids, self._scene.solids, strict=True):
            for entry in fields(solid):
                if entry.name in _LOADS or not entry.init:
                    continue
                if getattr(solid, entry.name) == getattr(other, entry.name):
                    continue
                if entry.name in _MATERIALS:
                    self._check_material(solid, other)
                    continue
                if entry.name in SHAPES:
                    self._check_shape(solid)
                    begun = moved = True
                    continue
                if entry.name not in _STARTS:
                    raise SceneError(f"{entry.name} is another")
                if entry.name == "displacement" and self._numbers.probed:
                    raise SceneError("probes read other points of it")
                begun, moved = True, moved or entry.name == "displacement"
        self._check_beside(scene, moved=moved)
        return bool(begun)

    def _check_beside(self, scene: Scene, *, moved: bool) -> None:
        """Refuse what changes in a scene besides its bodies.

        Args:
            scene: The scene.
            moved: Whether what is pulled by gravity begins elsewhere.

        Raises:
            SceneError: It is more than obstacles.
        """
        same = scene.contacts == self._scene.contacts
        same = same and scene.gravity == self._scene.gravity
        if not same or scene.duration != self._scene.duration:
            raise SceneError("it is another in more than loads and starts")
        if moved and self._numbers.levels:
            raise SceneError("its potential begins elsewhere")

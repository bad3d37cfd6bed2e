"""What is kept of the march of solids: fields every so many layers, and a watch."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.contact.overlap import HALF_FACE, folded, overlap
from impactfem.contact.watch import penetration_of_others
from impactfem.errors import SceneError
from impactfem.fem import cell_nodes, on_root
from impactfem.marching.collect import Collector
from impactfem.marching.layers import ContactGaps
from impactfem.marching.marched import Marched
from impactfem.marching.rows import Level
from impactfem.mesh.body import BodyMesh
from impactfem.models.solids import SolidsModel
from impactfem.result.cell_kinds import KINDS
from impactfem.result.shapes import VECTOR, Shape, joined
from impactfem.result.spool import POINT_DATA, FieldSpool
from impactfem.runs.axis_watch import AxisWatch
from impactfem.scene.pairing import self_meeting
from impactfem.system.stress import NodalFields


@dataclass(frozen=True)
class Followed:
    """A body of few coordinates in the field file: a point, a rod, a beam.

    Attributes:
        shape: Its vertices or lines, where they are at t = 0.
        motion: Displacement, velocity and contact force of their nodes at a level, shape
            (nodes, dim); what is not given is NaN in the file. Asked on rank 0 only.
        components: Of fields of `motion` that are not those of all bodies, by name.
    """

    shape: Shape
    motion: Callable[[Level], Mapping[str, Floats]]
    components: Mapping[str, int]


def followed(march: Marched, among: slice) -> list[Followed]:
    """Bodies without meshes as they are marched: balls, and axes between nodes.

    Args:
        march: What moves them.
        among: Which of all contact nodes are theirs.
    """

    def one(body: int, name: str) -> Followed:
        def motion(level: Level) -> dict[str, Floats]:
            forces = march.shown.acting(body, level.nodal_forces[among])
            return march.shown.motion(body) | {"contact_force": forces}

        return Followed(march.shown.drawn(body, name), motion, march.shown.components)

    return [one(body, name) for body, name in enumerate(march.bodies.names)]


class FieldOutput:
    """Appends the fields of every so many layers to a spool on rank 0; nodes body after body."""

    def __init__(
        self,
        model: SolidsModel,
        collector: Collector,
        gaps: ContactGaps,
        others: Sequence[Followed],
        layers: tuple[int, int],
    ) -> None:
        """Set what is written when.

        Args:
            model: The bodies.
            collector: Of the nodes of all of them.
            gaps: Of the march.
            others: Bodies that follow the solids in the file.
            layers: Layers between fields, and their number; the last is written too.
        """
        self._comm, self._collector, self._gaps = model.comm, collector, gaps
        self._model, self._others, (self._every, self._layers) = model, others, layers
        parts = model.parts
        self._dim, self._shown = model.dim, [part.system.fields for part in parts]
        self._cuts = np.cumsum([0, *(len(part.system.constrained) for part in parts)])
        each = zip(model.numbers, model.starts, strict=False)
        own = [np.zeros(0, dtype=np.int64), *(numbers + start for numbers, start in each)]
        self._contact = np.concatenate(own)
        self._spool: FieldSpool | None = None

    def open(self, place: Path | None, kept: int | None) -> None:
        """Open the file on rank 0 (collective).

        Args:
            place: The file, on rank 0.
            kept: Number of levels of an earlier run to keep; None to begin anew.

        Raises:
            SceneError: The bodies have different kinds of cells, and a format takes one kind only.
            OutputError: The file cannot be written or read.
        """
        parts = self._model.parts
        kinds = [KINDS[part.mesh.cell, part.mesh.degree] for part in parts]
        if len(set(kinds)) > 1 and set(self._model.scene.output.fields) != {"vtkhdf"}:
            names = sorted({f"{kind.shape} of degree {kind.degree}" for kind in kinds})
            raise SceneError(
                f"output.fields: the bodies have different cells ({', '.join(names)}), which only "
                'VTKHDF holds; give fields = ["vtkhdf"], or all bodies the same cells and degree'
            )
        none = np.zeros((0, self._dim))
        positions = np.concatenate([none, *(part.system.positions for part in parts)])
        points = self._collector.collect(positions.ravel(), self._dim)
        cells = [_cells(self._comm, part.mesh) for part in parts]
        known = {**POINT_DATA, "contact_normal": VECTOR, **_shown([*self._shown, *self._others])}

        def make() -> None:
            if place is None or points is None:
                return
            if kept is not None:
                self._spool = FieldSpool.reopen(place, kept)
                return
            shapes = [
                Shape(part.solid.name, points[first:end], own[:, list(kind.order)], kind.vtk_type)
                for part, own, kind, (first, end) in zip(
                    parts, cells, kinds, pairwise(self._model.starts), strict=True
                )
            ]
            self._spool = FieldSpool(place, [*shapes, *(b.shape for b in self._others)], known)

        on_root(self._comm, make)

    def count(self) -> int:
        """Number of levels in the file (collective)."""
        return int(on_root(self._comm, lambda: 0 if self._spool is None else len(self._spool)))

    def close(self) -> None:
        """Close the file."""
        if self._spool is not None:
            self._spool.close()

    def __call__(self, level: Level) -> None:
        """Write the level if it is its turn (collective)."""
        if level.layer % self._every and level.layer != self._layers:
            return
        collect, moved, strained = self._collector.collect, level.displacement, level.straining
        each = [
            shown.at(strained[first:end])
            for shown, (first, end) in zip(self._shown, pairwise(self._cuts), strict=True)
        ]
        values = {
            "displacement": collect(moved, self._dim),
            "velocity": collect(level.velocity, self._dim),
        }
        counts = np.diff(self._cuts) // self._dim
        for name, components in _shown(self._shown).items():
            own = [
                fields.get(name, np.full((count, components), np.nan)).ravel()
                for fields, count in zip(each, counts, strict=True)
            ]
            values[name] = collect(np.concatenate([np.zeros(0), *own]), components)
        on_root(self._comm, lambda: self._append(level, values))

    def _append(self, level: Level, values: dict[str, Floats | None]) -> None:
        if self._spool is None:
            return
        given = {name: array for name, array in values.items() if array is not None}
        nodes = len(given["displacement"])
        gap, pressure, active = np.full(nodes, np.nan), np.zeros(nodes), np.zeros(nodes)
        for whole, seen in zip(
            (gap, pressure, active), self._gaps.nodal(level.force, level.gap), strict=True
        ):
            whole[self._contact] = seen[: len(self._contact)]  # other bodies' nodes come after
        forces, normals = np.zeros((2, nodes, self._dim))
        forces[self._contact] = level.nodal_forces[: len(self._contact)]
        normals[self._contact] = level.nodal_normals[: len(self._contact)]
        solids = {
            **given, "gap": gap, "contact_pressure": pressure, "contact_force": forces,
            "contact_normal": normals, "active": active,
        }  # fmt: skip
        each = [solids, *(body.motion(level) for body in self._others)]
        self._spool.append(level.time, joined(each, self._spool.point_data))


def _shown(each: Sequence[NodalFields | Followed]) -> dict[str, int]:
    """Components of the fields that any body has besides its motion."""
    return {name: count for fields in each for name, count in fields.components.items()}


def _cells(comm: Any, mesh: BodyMesh) -> Any:
    """Cells of the whole mesh by canonical numbers, on rank 0 (collective)."""
    own = mesh.mesh.topology.index_map(mesh.mesh.topology.dim).size_local
    cells = mesh.numbers[cell_nodes(mesh.mesh)[:own]]
    everything = comm.gather((mesh.mesh.topology.original_cell_index[:own], cells), root=0)
    if everything is None:
        return None
    order = np.concatenate([part[0] for part in everything])
    ordered = np.empty((len(order), cells.shape[1]), dtype=np.int64)
    ordered[order] = np.concatenate([part[1] for part in everything])
    return ordered


_SELDOM = 10  # looks of which one asks whether bodies lie in themselves, which costs the most


class Watch:
    """Notices what contact lets through: nodes in an obstacle, bodies in each other, in themselves.

    Attributes:
        depth: Of the deepest node without contact unknowns in an obstacle [m]; 0 without any.
        message: What was seen of it, in words.
        overlap: How deep one body was in another [m]; gaps between bodies are means over faces.
        folds: Where and when a body that may bend at will lay in itself, by name, in words.
        axes: What was seen of rods and beams.
    """

    def __init__(
        self, model: SolidsModel, every: int, axes: AxisWatch, *, all_held: bool = False
    ) -> None:
        """Look at the bodies of a model every so many layers.

        Args:
            model: The bodies.
            every: Layers between two looks.
            axes: Looks at rods and beams.
            all_held: Whether contact nodes are held off all obstacles that they can reach.
        """
        self.axes, self._all_held = axes, all_held
        self._comm, self._parts, self._every = model.comm, model.parts, every
        self._pairs = [pair.bodies for pair in model.pairs if pair.within is None]
        self._itself = self_meeting(model.scene)
        parts = model.parts
        self._cuts = np.cumsum([0, *(len(part.system.constrained) for part in parts)])
        self.depth = self.overlap = 0.0
        self.message = ""
        self.folds: dict[str, str] = {}
        self._looks = 0

    def __call__(self, level: Level) -> None:
        """Look at a level if it is its turn (collective)."""
        self.axes(level)
        if level.layer % self._every:
            return
        each = [level.displacement[first:end] for first, end in pairwise(self._cuts)]
        self._look_between(each)
        if self._looks % _SELDOM == 0:
            self._look_for_folds(each, level.time)
        self._looks += 1
        for part, moved in zip(self._parts, each, strict=True):
            if part.contact is None:
                continue
            positions = part.system.positions
            contact = part.contact
            if self._all_held:
                contact = replace(contact, nodes=contact.nodes[:0], rows=contact.rows[:0])
            found = penetration_of_others(
                self._comm, contact, part.obstacles, part.system.numbers,
                positions + moved.reshape(positions.shape), level.time,
            )  # fmt: skip
            if found is not None and found.depth > self.depth:
                self.depth = found.depth
                where = ", ".join(f"{value:.4g}" for value in found.place)
                self.message = (
                    f"a node of {part.solid.name} without contact unknowns was {found.depth:.3g} m "
                    f"deep in obstacle {part.obstacles[found.obstacle].name!r} at ({where}) m, "
                    f"t = {level.time:.4g} s; name its surface in body.contact_surfaces"
                )

    def state(self) -> dict[str, float | str]:
        """What was seen, for a checkpoint."""
        return {
            "depth": self.depth, "message": self.message, "overlap": self.overlap,
            "folds": json.dumps(self.folds), "axes": self.axes.state(),
        }  # fmt: skip

    def restore(self, state: Mapping[str, float | str]) -> None:
        """Go on from what was seen."""
        self.depth, self.message = float(state["depth"]), str(state["message"])
        self.overlap, self.folds = float(state["overlap"]), json.loads(str(state["folds"]))
        self.axes.restore(str(state["axes"]))

    def _look_for_folds(self, displacements: Sequence[Floats], time: float) -> None:
        """Look at each body that may bend at will (collective)."""
        for part, moved in zip(self._parts, displacements, strict=True):
            if part.solid.is_finite and part.solid.name not in self.folds:
                # Gaps are means over faces: what meets itself may lie a little in itself.
                depth = (HALF_FACE,) if part.solid.name in self._itself else ()
                place = folded(part.outside, part.places_at(moved), part.within, *depth)
                if place is not None:
                    where = ", ".join(f"{value:.4g}" for value in place)
                    self.folds[part.solid.name] = f"near ({where}) m at t = {time:.4g} s"

    def _look_between(self, displacements: Sequence[Floats]) -> None:
        """Look at bodies that may meet each other (collective)."""
        places = {
            k: part.places_at(displacements[k])
            for k, part in enumerate(self._parts)
            if any(k in pair for pair in self._pairs)
        }
        for a, b in self._pairs:
            one, two = self._parts[a].outside, self._parts[b].outside
            found = overlap(one, places[a], two, places[b])
            if found is not None:
                self.overlap = max(self.overlap, found[0])

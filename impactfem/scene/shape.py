"""What all shapes of solids can say about themselves."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, NamedTuple

from impactfem.scene.schema import KeyedError
from impactfem.scene.values import degrees_hint, show

AXES = ("x", "y", "z")
_TURN = 1e-9  # angles and directions are equal up to this
MODELS = ("plane_strain", "plane_stress", "axisymmetric", "3d")
FLAT, REVOLVED = MODELS[:3], MODELS[2:]


class Figure(NamedTuple):
    """What a shape is before it is turned and cut: a box, or round.

    Attributes:
        origin: Place from which it is drawn, so that it lies exactly there [m], (dim,).
        faces: Names of its plane faces by axis, the lower one first; "" for none.
        edges: Edges of a box, from the origin on [m], (dim,).
        radii: Round faces, the outer one first, with their radius about the origin [m].
        height: Length along y of a cylinder, from the origin on [m].
    """

    origin: tuple[float, ...]
    faces: tuple[str, ...] = ()
    edges: tuple[float, ...] = ()
    radii: Mapping[str, float] = {}  # never changed
    height: float | None = None

    @property
    def largest(self) -> float:
        """Largest length [m]."""
        return max(*self.edges, *self.radii.values(), self.height or 0.0, 0.0)


class Shape(ABC):
    """What all shapes can say about themselves.

    Attributes:
        kind: Its name in a scene.
        models: Models that it fits.
        place: Key of where it is.
        has_sides: Whether it may lie at an axis of symmetry with a flat side, else about it.
    """

    kind: ClassVar[str]
    models: ClassVar[tuple[str, ...]]
    place: ClassVar[str] = "center"
    has_sides: ClassVar[bool] = False
    angle: float
    symmetry: Sequence[str]

    @property
    @abstractmethod
    def dim(self) -> int:
        """Number of coordinates, 2 or 3."""

    @property
    @abstractmethod
    def centre(self) -> tuple[float, ...]:
        """Centre of the uncut shape (dim,) [m]."""

    @property
    @abstractmethod
    def figure(self) -> Figure:
        """What is drawn of it, before turns and cuts."""

    @property
    @abstractmethod
    def _whole(self) -> float:
        """Area [m^2] or volume [m^3] of the uncut shape."""

    @property
    @abstractmethod
    def half_extents(self) -> tuple[float, ...]:
        """Half the edges of the bounding box of the turned, uncut shape (dim,) [m]."""

    @property
    @abstractmethod
    def _faces(self) -> Mapping[str, tuple[float, ...] | None]:
        """Names of surfaces with their outward normal before turning; None if it is curved."""

    @property
    @abstractmethod
    def symmetric_turns(self) -> float:
        """Smallest angle [rad] whose multiples keep the shape symmetric in x and y; 0 for any."""

    @property
    def volume(self) -> float:
        """Area [m^2] in 2D, volume [m^3] in 3D of what is modelled, i.e. after cuts."""
        return self._whole / 2.0 ** len(self.symmetry)

    @property
    def cuts(self) -> tuple[tuple[int, float], ...]:
        """Number of the axis across each plane that cuts it, and the plane's coordinate [m]."""
        axes = [AXES.index(axis) for axis in self.symmetry]
        return tuple((axis, self.centre[axis]) for axis in axes)

    @property
    def touches_axis(self) -> bool:
        """Whether an axisymmetric body of this shape reaches r = 0."""
        r, half = self.centre[0], self.half_extents[0]
        return r == 0.0 or abs(r - half) <= 1e-12 * half

    @property
    def revolved_volume(self) -> float:
        """Volume [m^3] that the shape sweeps about the axis x = 0 (whole turn, after cuts)."""
        # Pappus: the area times the way of its centroid.
        return 2.0 * math.pi * self.centre[0] * self.volume

    def bounds(self, *, axisymmetric: bool = False) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Lower and upper corner (dim,) [m] of the box around the turned and cut shape."""
        lower = [c - half for c, half in zip(self.centre, self.half_extents, strict=True)]
        upper = [c + half for c, half in zip(self.centre, self.half_extents, strict=True)]
        for axis in self.symmetry:
            lower[AXES.index(axis)] = self.centre[AXES.index(axis)]
        if axisymmetric:
            lower[0] = max(lower[0], 0.0)
        return tuple(lower), tuple(upper)

    def surface_names(self, *, axisymmetric: bool = False) -> tuple[str, ...]:
        """Names of the surfaces of the turned and cut shape; with "axis" if it reaches r = 0."""
        cuts = [AXES.index(axis) for axis in self.symmetry]
        on_axis = axisymmetric and self.touches_axis
        gone = [*cuts, 0] if on_axis else cuts
        left = [
            name
            for name, normal in self._faces.items()
            if normal is None or not any(self._turned(normal)[axis] < -_TURN for axis in gone)
        ]
        return (*left, *(f"symmetry_{axis}" for axis in self.symmetry), *["axis"] * on_axis)

    def middle_of(self, surface: str) -> tuple[float, ...] | None:
        """Middle of a surface of the whole shape [m], (dim,); None of no surface."""
        if surface not in self._faces:
            return None
        normal = self._faces[surface]
        if normal is None:
            return self.centre
        figure = self.figure
        edges = figure.edges or (figure.height or 0.0,) * self.dim
        half = 0.5 * sum(abs(n) * edge for n, edge in zip(normal, edges, strict=True))
        return tuple(c + half * n for c, n in zip(self.centre, self._turned(normal), strict=True))

    def check_model(self, model: str) -> None:
        """Refuse a model that the shape does not fit.

        Raises:
            KeyedError: naming the key of the shape.
        """
        degrees = degrees_hint(self.angle)
        if degrees:
            raise KeyedError(self.kind, "angle", f" = {self.angle:g} is {degrees}.")
        if model not in self.models or (self.dim == 3) != (model == "3d"):
            fitting = self._fitting(model)
            text = f' = {show(self.kind)} does not fit model = "{model}": {fitting}.'
            raise KeyedError(self.kind, "kind", text)
        for axis in self.symmetry:
            if AXES.index(axis) >= self.dim or (axis == "x" and model == "axisymmetric"):
                why = "the model has no such direction to cut; remove it"
                text = f' = {show(list(self.symmetry))} does not fit model = "{model}": {why}.'
                raise KeyedError(self.kind, "symmetry", text)
        if model == "axisymmetric":
            self._check_radius()

    def _fitting(self, model: str) -> str:
        if model in self.models:
            count = 3 if model == "3d" else 2
            return f"its coordinates have {self.dim} entries; give {count}"
        fitting = [cls.kind for cls in Shape.__subclasses__() if model in cls.models]
        return f"give {' or '.join(map(show, fitting))}, or another model"

    def _check_radius(self) -> None:
        """Refuse shapes that reach r < 0 without being halves of a body about the axis."""
        r, half = self.centre[0], self.half_extents[0]
        value, beside = show(list(getattr(self, self.place))), abs(r - half) <= 1e-12 * half
        if r < half and not (beside if self.has_sides else r == 0.0):
            why = f"the shape reaches r = {r - half:.6g} < 0 in an axisymmetric model"
            remedy = "move it to r >= 0" if self.has_sides else "centre it at r = 0"
            raise KeyedError(self.kind, self.place, f" = {value}: {why}; {remedy}.")
        if beside and not self.has_sides:
            why = "the shape touches the axis in a point; centre it at r = 0, or move it away"
            raise KeyedError(self.kind, self.place, f" = {value}: {why}.")
        if self.touches_axis and self.angle != 0.0:
            why = "a shape on the axis cannot be turned about another line; remove it"
            raise KeyedError(self.kind, "angle", f" = {self.angle:g}: {why}.")

    def _check_cut(self) -> None:
        """Refuse cuts of shapes that are not symmetric about them."""
        turns = self.symmetric_turns
        crooked = turns and abs(math.remainder(self.angle, turns)) > _TURN
        if crooked and any(axis in "xy" for axis in self.symmetry):
            text = f" = {self.angle:g} contradicts symmetry = {show(list(self.symmetry))}: "
            why = f"turned so, the {self.kind} has no such symmetry; give a multiple of {turns:.6g}"
            raise KeyedError(self.kind, "angle", f"{text}{why}.")

    def _turned(self, vector: Sequence[float]) -> tuple[float, ...]:
        c, s = math.cos(self.angle), math.sin(self.angle)
        x, y = vector[:2]
        return (c * x - s * y, s * x + c * y, *vector[2:])

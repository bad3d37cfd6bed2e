"""What the scene language asks of every kind of body."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.flight import Flight
from impactfem.scene.probes import MOVES
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

if TYPE_CHECKING:
    from impactfem.scene.joints import Joint

JOINED = 1e-9
"""Share of places by which a joint may be beside what it holds."""


def beside(place: Floats, own: Floats) -> bool:
    """Whether a joint at a place is beside one that it should be at, (dim,) each [m]."""
    return bool(np.abs(own - place).max() > JOINED * max(np.abs(own).max(), np.abs(place).max()))


type Solver = Literal["bar", "bar_row", "march", "vibro"]
"""Methods of one bar, of bars in a row, the march, or methods of few degrees of freedom."""


class BodyKind:
    """Base of all bodies: what is so of most of them.

    Attributes:
        kind: Its name in a scene.
        solvers: What solves one of it, and what several, among obstacles and laws that this knows.
        has_coordinates: Whether methods that do not march solve one of it where they are named.
        marches_alone: Whether the march takes it without other kinds, where its own does not do.
        waves: Whether it has waves, and rebounds by its own elasticity.
        in_elements: Whether it is solved by elements, in a mesh or along its axis.
        small_strains: Whether its elasticity is that of small strains, which must stay small.
        meets_alike: Whether it meets others of its kind by methods of the kind.
        may_meet_nothing: Whether its motion is worth a run where there is nothing to hit.
        settles: Whether it can start in equilibrium (``start = "static"``).
        staggers: Whether its steps can end amid those of solids that take explicit ones.
        probed: What a probe in it may keep.
        settings: Keys of ``[solve]`` that it brings into scenes of several kinds.
        has_surface: Whether it touches at many places what has a surface too.
        is_slender: Whether it touches with an axis.
        meets_edges: Whether edges and faces of rigid bodies may meet it.
        has_links: Whether it is made of links, some of which may have edges and faces.
        dents: Whether its contacts, at single places, may have a stiffness.
        lined: Whether a layer on its faces may give way on obstacles, by its area.
        meshed: Whether it has elements, larger ones of which tell its error.
        takes_joints: Whether joints hold it.
        joined_in_steps: Whether joints hold it where steps are solved by iterates.
        turns_in_joints: Whether it turns where they do, and directions turn with it.
        joined_whole, joined_by_surface: Whether joints name it, and a part of it (`arm/hand`).
        parts_in_joints: What these are.
        tied: Whether ties hold it.
        damped_by_modes: Whether each of its first modes may have a damping of its own.
        attached: Whether another body carries it, so that it meets nothing.
        has_centre: Whether springs act on its centre where they name no place.
        sprung_inside: Whether springs act on any place in it.
        whole_side: Surfaces that its bare name stands for in ``[[contact]] between``; None for all.
    """

    kind: ClassVar[str]
    solvers: ClassVar[tuple[Solver, Solver]] = ("vibro", "vibro")
    has_coordinates: ClassVar[bool] = False
    marches_alone: ClassVar[bool] = True
    waves: ClassVar[bool] = False
    in_elements: ClassVar[bool] = False
    small_strains: ClassVar[bool] = True
    meets_alike: ClassVar[bool] = False
    may_meet_nothing: ClassVar[bool] = False
    settles: ClassVar[bool] = False
    staggers: ClassVar[bool] = True
    probed: ClassVar[tuple[str, ...]] = MOVES
    settings: ClassVar[tuple[str, ...]] = ()
    has_surface: ClassVar[bool] = False
    is_slender: ClassVar[bool] = False
    meets_edges: ClassVar[bool] = False
    has_links: ClassVar[bool] = False
    dents: ClassVar[bool] = False
    lined: ClassVar[bool] = False
    meshed: ClassVar[bool] = False
    takes_joints: ClassVar[bool] = False
    joined_in_steps: ClassVar[bool] = False
    turns_in_joints: ClassVar[bool] = True
    joined_whole: ClassVar[bool] = True
    joined_by_surface: ClassVar[bool] = False
    sprung_inside: ClassVar[bool] = False
    has_centre: ClassVar[bool] = False
    tied: ClassVar[bool] = False
    attached: ClassVar[bool] = False
    damped_by_modes: ClassVar[bool] = False
    parts_in_joints: ClassVar[str] = "links"
    whole_side: ClassVar[tuple[str, ...] | None] = None
    mesh: str | None = None

    def opened(self, folder: Path) -> Self:  # noqa: ARG002  (of those that have files)
        """The same with its file read, whose relative path starts at a folder."""
        return self

    @property
    def cuts(self) -> tuple[tuple[int, float], ...]:
        """Number of the axis across each plane of symmetry that cuts it, and the coordinate [m]."""
        return ()

    def missed(self, place: Floats, part: str) -> str | None:  # noqa: ARG002  (anywhere)
        """Where joints hold it, or a part of a name, instead of at a place (dim,); None: there."""
        return None

    def turns_at(self, part: str) -> bool:  # noqa: ARG002  (all alike)
        """Whether it, or a part of a name, turns where joints hold it, and directions with it."""
        return self.turns_in_joints

    @property
    def own_joints(self) -> tuple["Joint", ...]:
        """Joints that it brings into its scene."""
        return ()

    @property
    def joint_parts(self) -> tuple[str, ...] | None:
        """Names of its parts that joints may hold; None if they are not known yet."""
        return self.surface_names

    @property
    def turns_far(self) -> bool:
        """Whether its rotation may be any, and counts in its error."""
        return False

    @property
    def why_iterated(self) -> str:
        """Why its steps are solved by iterates, in words after its name; empty if they are not."""
        return ""

    @property
    def rolls(self) -> bool:
        """Whether it is a ball that turns, and touches with different places of its surface."""
        return False

    @property
    def is_round(self) -> bool:
        """Whether something of it is round and turns, so that moments may resist its rolling."""
        return self.rolls or self.has_links

    @property
    def is_ball(self) -> bool:
        """Whether it is a ball, or a point."""
        return self.rolls

    @property
    def has_corners(self) -> bool:
        """Whether it has edges and faces."""
        return False

    @property
    def is_curved(self) -> bool:
        """Whether it touches neither with corners nor with balls alone."""
        return False

    @property
    def sees_edges(self) -> bool:
        """Whether edges and faces of rigid bodies may meet it, be it with such of its own."""
        return self.rolls or self.has_corners or self.meets_edges

    @property
    def is_convex(self) -> bool:
        """Whether it is its own convex hull."""
        return True

    @property
    def hull_corners(self) -> int:
        """Number of corners of its convex hull; 0 if it has no edges and faces."""
        return 0

    @property
    def summed(self) -> tuple[Any, ...]:
        """Parts that its mass and inertia are sums of, where what two share counts twice."""
        return ()

    def check_on_axis(self, where: str) -> None:
        """Refuse what does not stand beside axisymmetric solids.

        Args:
            where: Its table, for messages.

        Raises:
            KeyedError: naming the key.
        """
        text = f" = {show(self.kind)}: beside axisymmetric solids there are solids and balls on "
        text += 'the axis only: give a point with a radius there, or solids of model = "3d".'
        raise KeyedError(where, "kind", text)

    def check_beside(self, bodies: Sequence[Any]) -> None:
        """Refuse what contradicts other bodies of its scene, all of which are given.

        Raises:
            KeyedError: naming the key of the body.
        """

    @property
    def meets_itself(self) -> bool:
        """Whether it may bend so far that it strikes itself, and the march knows it."""
        return False

    @property
    def surface_names(self) -> tuple[str, ...] | None:
        """Names of its surfaces in ``between``; None if they are not known yet."""
        return ()

    def box(self) -> tuple[Floats, Floats] | None:
        """Half edges and centre [m] of a box that holds it in any rotation that it may take.

        Shape (dim,) each; None if it is not known before meshing.
        """
        return None

    @property
    def flight(self) -> Flight | None:
        """How it flies; None if that is not certain."""
        return None

    @property
    def swing(self) -> Flight | None:
        """As `flight`, of what may be held: then its places stay about where they are."""
        return self.flight

    def centre_velocity(self) -> Floats | None:
        """Velocity at t = 0 [m/s], (dim,); None if it differs from place to place."""
        return None

    def centreline(self) -> Floats | None:
        """Places along the middle of a slender body at t = 0 [m], (places, dim); None if thick."""
        return None

    def faces(self) -> Floats | None:
        """Triangles, in space tetrahedra, that fill it at t = 0 [m], (cells, corners, dim).

        None if drawings know it otherwise.
        """
        return None

    @property
    def line_thickness(self) -> float:
        """Thickness around its centreline [m]; 0 if it has none."""
        return 0.0

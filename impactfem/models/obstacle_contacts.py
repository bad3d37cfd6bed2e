"""How bodies without meshes meet obstacles: a gap of each node to each of their faces."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.contact.followed_pair import FAR
from impactfem.contact.gaps import Gaps, Started
from impactfem.errors import SceneError
from impactfem.models.ball_contacts import Bodies
from impactfem.scene.obstacles import Rigid
from impactfem.scene.pairing import obstacles_of, pair_name, surfaces_on


@dataclass(frozen=True)
class _OtherFace:
    """A second face of an obstacle that a ball may touch at once, as `Gaps` takes obstacles."""

    obstacle: Rigid
    plane: ClassVar[None] = None

    @property
    def name(self) -> str:
        return self.obstacle.name

    @property
    def moves(self) -> bool:
        return self.obstacle.moves

    @property
    def motion(self) -> Any:
        return self.obstacle.motion

    @property
    def rotation(self) -> Any:
        return self.obstacle.rotation

    def gap(self, points: Floats) -> tuple[Floats, Floats]:
        found = self.obstacle.other_gap(points)
        if found is None:
            raise TypeError(f"obstacle {self.name} has one face only")
        return np.minimum(found[0], FAR), found[1]


def _faces(obstacle: Rigid) -> list[Any]:
    """An obstacle, and its other face if it has one."""
    return (
        [obstacle]
        if obstacle.other_gap(np.zeros((0, 3))) is None
        else [obstacle, _OtherFace(obstacle)]
    )


@dataclass(frozen=True)
class ObstacleMeeting:
    """A body without a mesh beside an obstacle.

    Attributes:
        names: Of the body and the obstacle.
        part: Place of its system among those of the model.
        nodes: Its contact nodes among those of the system, (nodes,).
        gaps: Of these.
    """

    names: tuple[str, str]
    part: int
    nodes: Integers
    gaps: Gaps


def obstacle_meetings(model: Bodies) -> list[ObstacleMeeting]:
    """Meetings of bodies without meshes with obstacles: each node has a gap to each of them.

    Raises:
        SceneError: A body is inside an obstacle at t = 0.
    """
    found = []
    known = {obstacle.name: _faces(obstacle) for obstacle in model.scene.rigid_obstacles}
    for k, bodies in enumerate(model.few):
        places = bodies.places(bodies.position)
        for body, name in enumerate(bodies.names):
            beside = obstacles_of(model.scene, name)
            faces = (pair for o in beside for pair in enumerate(known[o.name]))
            for face, obstacle in faces:
                on = surfaces_on(model.scene, name, obstacle.name)
                own = bodies.meeting(body, on, (obstacle.name, face))
                own = own[bodies.touching[own]]
                if not len(own):
                    continue
                radius = bodies.shell[own]
                balls = Started.of_balls(obstacle, places[own], radius)
                size = float(np.abs(places[own]).max() + radius.max())
                if balls.gap.min(initial=0.0) < -1e-12 * size:
                    raise SceneError(
                        f"{name} on {obstacle.name}: it is {-balls.gap.min():.6g} m inside at "
                        "t = 0; move it"
                    )
                gaps = Gaps(
                    (obstacle,), balls, np.zeros_like(balls.positions), updated=True,
                    pairs=(pair_name(model.scene, name, obstacle.name),), radius=radius,
                )  # fmt: skip
                found.append(ObstacleMeeting((name, obstacle.name), k, own, gaps))
    return found

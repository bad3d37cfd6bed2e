"""Hard cases of solids that are scenes solved once, and what must hold in them."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from impactfem.scene import Scene
from impactfem.studies.hard.board import Case, Claim, Facts
from impactfem.studies.hard.solid_facts import (
    CONTROLLED,
    DISC,
    EXPLICIT,
    FLOOR,
    IMPLICIT,
    IMPULSE,
    SOLID,
    SPEED,
    SQUARE,
    claims,
    facts_of,
    run,
    solid_scene,
    solved,
)

_PULL_DOWN = 0.02  # gravity; a body of size 1 at rest is pressed by 1/100 of its modulus
_STILL: dict[str, Any] = {"kind": "block", "size": [1.0, 1.0], "corner": [-0.5, 0.0]}
_COARSE: dict[str, Any] = {"mesh_size": 0.25, "velocity": [0.0, 0.0]}


def _case(
    name: str, scene: Scene, methods: tuple[str, ...] = SOLID, *,
    settings: Mapping[str, Any] | None = None, pulse: bool = False, lasting: bool = True,
    refusals: frozenset[str] = frozenset(), quick: bool = True,
    extra: Sequence[Claim] = (IMPULSE,),
) -> Case:  # fmt: skip
    return Case(
        name,
        lambda method: run(method, scene, settings, pulse=pulse),
        lambda method: [*claims(method, pulse=pulse, lasting=lasting), *extra],
        methods, refusals, quick, "solid",
    )  # fmt: skip


def _grazing(method: str) -> Facts:
    """Thrown down against gravity: it reaches the floor with almost no speed, or turns before."""
    gap, gravity = 0.1, 0.02
    worst: dict[str, float] = {}
    for excess in (-1e-6, -1e-12, 0.0, 1e-12, 1e-6):
        arrival = math.sqrt(2.0 * gravity * gap)
        speed = arrival * (1.0 + excess)
        scene = solid_scene(
            5.0,
            gravity=(0.0, gravity),
            shape=DISC | {"center": [0.0, 0.5 + gap]},
            velocity=[0.0, -speed],
            mesh_size=0.25,
        )
        result = solved(method, scene, dt=arrival / gravity / 50)  # it turns at a level
        time = result.history["time"].values
        height = result.history["body.y"].values
        thrown = height[0] - speed * time + 0.5 * gravity * time**2
        facts = facts_of(result) | {"displacement": float(np.abs(height - thrown).max()) / gap}
        for name, value in facts.items():
            worst[name] = max(worst.get(name, 0.0), value)
    return worst


def _resting(method: str) -> Facts:
    """A damped square laid on the floor: it settles, and the floor bears its weight."""
    scene = solid_scene(
        60.0, gravity=(0.0, -_PULL_DOWN), shape=_STILL, rayleigh_mass=0.7, **_COARSE
    )
    result = solved(method, scene)
    weight = _PULL_DOWN * (scene.solid.mass or 0.0)
    force = result.history["contact_force"].values
    last = force[-len(force) // 10 :]
    facts = facts_of(result)
    del facts["impulse"]  # damping takes momentum, too
    return facts | {
        "weight": float(np.abs(last - weight).max()) / weight,
        "jitter": float(np.abs(np.diff(last)).max()) / weight,
    }


def _untouched(method: str) -> Facts:
    """A square on the floor, not pressed: nothing happens."""
    result = solved(method, solid_scene(4.0, shape=_STILL, **_COARSE))
    facts = facts_of(result)
    facts["force"] = float(result.history["contact_force"].values.max())
    facts["motion"] = float(np.abs(result.history["body.y"].values - 0.5).max())
    return facts


INSIDE = solid_scene(
    10.0,
    gravity=(0.0, -_PULL_DOWN),
    obstacles=({"kind": "sphere", "center": [0.0, 0.0], "radius": 0.6, "side": "inside"},),
    shape={"kind": "disc", "radius": 0.3, "center": [0.1, 0.1]},
    mesh_size=0.1,
    velocity=[-0.02, -SPEED],
)
_WEDGE = solid_scene(
    6.0,
    obstacles=(
        FLOOR | {"normal": [1.0, 1.0]},
        FLOOR | {"normal": [-1.0, 1.0]},
    ),
    shape=DISC | {"center": [0.01, 0.5 * math.sqrt(2.0) + 0.03]},
)
_LEAVING = solid_scene(
    4.0 * math.pi,
    gravity=(0.0, -0.01),
    obstacles=(FLOOR | {"motion": ["0", "0.05*(cos(t) - 1)"]},),
    shape=DISC | {"center": [0.0, 0.5]},
    velocity=[0.0, 0.0],
)
_BOUNCING: dict[str, Any] = {
    "gravity": (0.0, -_PULL_DOWN),
    "shape": SQUARE | {"corner": [-0.5, 0.1]},
    **_COARSE,
}
_CORNER: dict[str, Any] = {
    "shape": SQUARE | {"corner": [-0.5, 0.02 + 0.5 * (math.sqrt(2.0) - 1.0)], "angle": math.pi / 4},
}
_GRADED: list[dict[str, Any]] = [{"point": [0.0, 0.02], "radius": 0.03, "size": 0.00625}]

CASES: tuple[Case, ...] = (
    _case("disc on a floor", solid_scene(4.0), CONTROLLED, pulse=True),
    _case("square falls flat", solid_scene(4.0, shape=SQUARE), CONTROLLED, pulse=True),
    _case("square falls on its corner", solid_scene(4.0, **_CORNER), CONTROLLED, pulse=True),
    _case("v0 = 0.3 c, contact in the first step", solid_scene(3.0, velocity=[0.0, -0.3]),
          CONTROLLED, pulse=True),
    _case("step 0.999 of the stable one", solid_scene(4.0), EXPLICIT,
          settings={"courant": 0.999}, pulse=True),
    _case("step beyond the stable one", solid_scene(4.0), EXPLICIT, settings={"dt": 0.09},
          refusals=frozenset(EXPLICIT)),
    _case("courant 5, implicit", solid_scene(8.0), IMPLICIT, settings={"courant": 5.0}),
    _case("square bounces, 50 s", solid_scene(50.0, **_BOUNCING), CONTROLLED),
    _case("square bounces, 1000 s, 20000 steps", solid_scene(1000.0, **_BOUNCING), CONTROLLED,
          settings={"dt": 0.05}, quick=False),
    Case("square at rest, damped, bears its weight", _resting,
         lambda m: [*claims(m, pulse=False, lasting=False), Claim("weight", 1e-6, "force = weight"),
                    Claim("jitter", 1e-6, "what has settled stays")],
         SOLID, body="solid"),
    Case("gap 0, at rest", _untouched,
         lambda m: [*claims(m, pulse=False), Claim("force", 0.0, "nothing presses"),
                    Claim("motion", 1e-14, "nothing moves")],
         SOLID, body="solid"),
    _case("gap 0, gravity sets in", solid_scene(20.0, gravity=(0.0, -_PULL_DOWN), shape=_STILL,
                                                **_COARSE), SOLID),
    Case("disc grazes the floor, v -> 0", _grazing,
         lambda m: [*claims(m, pulse=False),
                    Claim("displacement", 1e-2, "a graze hardly changes the motion")],
         SOLID, body="solid"),
    _case("elements 1:20 where it touches", solid_scene(3.0, refine=_GRADED), SOLID, pulse=True),
    _case("nu = -0.5", solid_scene(4.0, poisson_ratio=-0.5), SOLID, pulse=True),
    _case("disc inside a circle", INSIDE, CONTROLLED, extra=()),
    _case("disc inside a circle, updated normals", INSIDE, SOLID,
          settings={"normals": "updated"}, lasting=False, extra=()),
    _case("wedge of two planes", _WEDGE, CONTROLLED, extra=()),
    _case("floor leaves and comes back", _LEAVING, SOLID),
)  # fmt: skip
"""Hard cases of solids that are scenes."""

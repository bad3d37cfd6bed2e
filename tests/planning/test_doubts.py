"""Warnings of a plan about scenes that are probably not meant: nothing is met, units are off."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import impactfem
from impactfem.planning.doubts import doubts
from impactfem.scene import Bar, Beam, Contact, HalfSpace, Point, RigidSphere, Scene, Solid, Wall
from impactfem.shipped import shipped_scenes

FLOOR = HalfSpace(name="floor", point=[0.0, 0.0], normal=[0.0, 1.0])
NOTHING = "nothing within duration"


def sentences(findings):
    return [finding.sentence for finding in findings]


def dropped(**changes):
    """A point 1 m above the floor: it lands after sqrt(2 / g)."""
    body = {"name": "ball", "mass": 1.0, "position": [0.0, 1.0]} | changes
    return {"title": "drop", "bodies": [Point(**body)], "gravity": [0.0, -9.81]}


def test_a_fall_that_ends_before_the_floor():
    landing = math.sqrt(2.0 / 9.81)
    early = Scene(**dropped(), duration=0.95 * landing, obstacles=[FLOOR])
    late = Scene(**dropped(), duration=1.01 * landing, obstacles=[FLOOR])
    assert any(f"ball meets {NOTHING}" in text for text in sentences(doubts(early)))
    assert not doubts(late)


@settings(max_examples=25, deadline=None, derandomize=True, database=None)
@given(vx=st.floats(-3.0, 3.0), vy=st.floats(-3.0, 6.0), duration=st.floats(0.1, 1.0))
def test_what_meets_nothing_has_no_impact(vx, vy, duration):
    """Against a run: a warning is never wrong; none is only near the obstacles."""
    ball = RigidSphere(name="stone", center=[1.0, 0.5], radius=0.3)
    scene = Scene(
        **dropped(velocity=[vx, vy]), duration=duration, obstacles=[FLOOR, ball],
        contacts=[Contact(between=["ball", name], restitution=0.5) for name in ("floor", "stone")],
        solve=impactfem.Solve(estimate=False),
    )  # fmt: skip
    result = impactfem.solve(scene)
    assert not (doubts(scene) and result.summary["contact"]["impulse"])
    height = lambda t: 1.0 + vy * t - 9.81 / 2 * t**2  # noqa: E731
    if height(duration) > 0.1 and vx < -0.1:  # away from the stone
        assert doubts(scene)


def solid(**changes):
    given = {
        "name": "disc", "model": "plane_strain", "mesh_size": 0.2, "density": 1000.0,
        "shape": {"kind": "disc", "radius": 0.5, "center": [0.0, 0.6]},
        "youngs_modulus": 1e6, "poisson_ratio": 0.3,
    }  # fmt: skip
    return Solid(**(given | changes))


def one_solid(duration=0.1, obstacles=(FLOOR,), **changes):
    return Scene(title="t", duration=duration, bodies=[solid(**changes)], obstacles=obstacles)


@pytest.mark.parametrize(
    ("scene", "warned"),
    [
        (one_solid(), True),  # at rest without gravity
        (one_solid(velocity=[0.0, 1.0]), True),
        (one_solid(velocity=[0.0, -0.9]), True),  # 9 cm of 10
        (one_solid(velocity=[0.0, -1.1]), False),
        (one_solid(velocity=[0.0, "0.0*x"]), False),  # not known
        (one_solid(angular_velocity=1.0), False),
        (one_solid(pressures=[{"surface": "rim", "value": 1.0}]), False),
        (one_solid(displacement=[0.0, -0.05]), False),
        (one_solid(obstacles=[HalfSpace(point=[0, 0], normal=[0, 1], motion=["0", "t"])]), False),
    ],
)
def test_solids(scene, warned):
    assert any(f"disc meets {NOTHING}" in text for text in sentences(doubts(scene))) == warned


def test_two_solids_that_part():
    other = solid(name="other", shape={"kind": "disc", "radius": 0.5, "center": [1.1, 0.6]})
    for speed, warned in ((-1.0, True), (2.0, False)):
        bodies = [solid(velocity=[speed, 0.0]), other]
        scene = Scene(title="t", duration=0.1, bodies=bodies)
        assert (
            any(f"the bodies meet {NOTHING}" in text for text in sentences(doubts(scene))) == warned
        )


@pytest.mark.parametrize(("velocity", "warned"), [(0.5, True), (-0.5, False), (-0.09, True)])
def test_bars(velocity, warned):
    bar = Bar(length=1.0, density=1.0, youngs_modulus=1.0, gap=0.5, velocity=velocity)
    scene = Scene(title="t", duration=5.0, bodies=[bar], obstacles=[Wall()])
    found = impactfem.plan(scene).warnings
    assert any("never presses on the wall" in text for text in found) == warned


@pytest.mark.parametrize(("modulus", "warned"), [(210.0, True), (210e9, False)])
def test_a_modulus_in_gigapascals(modulus, warned):
    """Steel has waves of 5200 m/s; 210 Pa instead of GPa makes them 0.16 m/s."""
    steel = {"density": 7850.0, "youngs_modulus": modulus}
    bar = Bar(length=1.0, velocity=-1.0, **steel)
    body = solid(velocity=[0.6, -0.8], **steel)
    beam = {"height": 0.01, "width": 0.01, "length": 0.2, "center": [0.0, 0.02]}
    scenes = [
        Scene(title="t", duration=1e-3, bodies=[bar], obstacles=[Wall()]),
        Scene(title="t", duration=0.2, bodies=[body], obstacles=[FLOOR]),
        Scene(title="t", duration=0.1, bodies=[Beam(velocity=[0.0, -1.0], **beam, **steel)],
              obstacles=[FLOOR]),
    ]  # fmt: skip
    for scene in scenes:
        made = (
            impactfem.plan(scene).warnings if scene.bodies[0] is bar else sentences(doubts(scene))
        )
        assert any("check the units" in text for text in made) == warned


def test_a_modulus_in_gigapascals_of_a_bar_that_a_point_strikes():
    hammer = Scene.from_toml(shipped_scenes()["hammer_bar"])
    assert not doubts(hammer)
    soft = {"body.bar.youngs_modulus": 210.0, "body.bar.velocity": "-1.0", "duration": 1e-5}
    assert any("check the units" in text for text in sentences(doubts(hammer.with_settings(soft))))


@pytest.mark.parametrize("name", shipped_scenes())
def test_nothing_is_doubted_in_shipped_scenes(name):
    scene = Scene.from_toml(shipped_scenes()[name])
    if not scene.bars:
        assert not doubts(scene)
    elif len(scene.bars) < 2:
        assert not any("wall" in text or "units" in text for text in impactfem.plan(scene).warnings)


@pytest.mark.parametrize(("slower", "warned"), [(399.0, False), (0.0, True)])
def test_what_flies_along_is_not_fast(slower, warned):
    """Waves run at 100 m/s in both; that they meet at 1 m/s is what counts."""
    disc = {"kind": "solid", "model": "plane_strain", "density": 100.0, "youngs_modulus": 1e6,
            "poisson_ratio": 0.0, "mesh_size": 0.5}  # fmt: skip
    bodies = [
        disc | {"name": name, "velocity": [speed, 0.0],
                "shape": {"kind": "disc", "radius": 1.0, "center": [x, 0.0]}}
        for name, x, speed in (("a", 0.0, 400.0), ("b", 2.1, slower))
    ]  # fmt: skip
    scene = Scene.from_dict({"title": "two", "duration": 0.1, "body": bodies})
    assert any("check the units" in text for text in sentences(doubts(scene))) == warned

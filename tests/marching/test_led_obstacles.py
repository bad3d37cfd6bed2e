"""Edges and faces of rigid bodies on obstacles that move and turn."""

import tomllib

import numpy as np
import pytest

import impactfem

HALF_SPACE = 'kind = "half_space"\npoint = [0.0, 0.0]\nnormal = [0.0, 1.0]'
SLAB = 'kind = "box"\nsize = [4.0, 1.0]\ncenter = [0.0, -0.5]'
G = 9.81


def block_on(
    obstacle, *, duration=0.25, friction=0.0, restitution=0.0, corner=(-0.1, 0.0), angle=0.0
):
    corner = list(corner)
    shape = f'{{ kind = "block", size = [0.2, 0.1], corner = {corner}, angle = {angle} }}'
    scene = f"""
        title = "block on what moves"
        duration = {duration}
        gravity = [0.0, -{G}]
        [[body]]
        name = "block"
        kind = "rigid"
        shape = {shape}
        mass = 20.0
        [[obstacle]]
        name = "floor"
        {obstacle}
        [[contact]]
        between = ["block", "floor"]
        friction_coefficient = {friction}
        restitution = {restitution}
        [solve]
        dt = 2.5e-3
        estimate = false
    """
    return impactfem.solve(impactfem.Scene.from_dict(tomllib.loads(scene)))


def last(result, *columns):
    return [float(result.history[f"block.{name}"][-1]) for name in columns]


def test_a_rising_slab_bears_weight_and_inertia():
    result = block_on(SLAB + '\nmotion = ["0", "t**2"]')
    assert last(result, "y", "vy") == pytest.approx([0.05 + 0.0625, 0.5], abs=1e-11)
    assert float(result.history["contact_force"][-1]) == pytest.approx(20.0 * (G + 2.0), rel=1e-9)
    assert abs(result.summary["energy"]["unexplained"]) < 1e-11


def test_a_conveyor_takes_a_block_along():
    speed, friction = 0.4, 0.2
    result = block_on(SLAB + f'\nmotion = ["{speed}*t", "0"]', friction=friction)
    sliding = speed / (friction * G)
    assert last(result, "vx") == pytest.approx([speed], abs=1e-10)
    place = speed * (0.25 - sliding) + 0.5 * speed * sliding
    assert last(result, "x") == pytest.approx([place], abs=2.5e-3 * speed)  # a step's way
    assert result.summary["energy"]["taken"]["friction"] == pytest.approx(
        0.5 * 20.0 * speed**2, rel=1e-9
    )


@pytest.mark.parametrize(
    ("led", "body"),
    [
        ('rotation = { point = [0.0, 0.0], angle = "-0.3*t**2" }', {"friction": 0.9}),
        ('rotation = { point = [0.2, -0.1], angle = "0.2*sin(3*t)" }', {"friction": 0.1}),
        ('motion = ["0.05*sin(9*t)", "0.02*sin(20*t)"]',
         {"friction": 0.3, "restitution": 0.3, "corner": [0.2, 0.05], "angle": 0.3}),
    ],
)  # fmt: skip
def test_a_slab_does_what_a_half_space_does(led, body):
    slab, plane = (block_on(f"{kind}\n{led}", **body) for kind in (SLAB, HALF_SPACE))
    names = ("x", "y", "angle", "vx", "vy")
    assert last(slab, *names) == pytest.approx(last(plane, *names), abs=2e-6)


BLOCK = '{ kind = "block", size = [0.2, 0.1, 0.15], corner = [-0.08, 0.25, -0.05], angle = 0.3 }'
ROUND = {
    "sphere": 'kind = "sphere"\ncenter = [0.05, 0.02, 0.0]\nradius = 0.1',
    "cylinder": 'kind = "cylinder"\npoint = [0.0, 0.0, 0.02]\naxis = [1.0, 0.3, 0.0]\nradius = 0.1',
    "box": 'kind = "box"\nsize = [0.3, 0.2, 0.2]\ncenter = [0.03, 0.0, 0.02]\nangle = 0.2',
}


@pytest.mark.parametrize("kind", ROUND)
def test_who_moves_makes_no_difference(kind):
    wind = np.array([0.3, 2.0, -0.1])
    found = []
    for goes in (False, True):  # the obstacle moves, or the body comes with its velocity reversed
        motion = [f"{v!r}*t" for v in wind.tolist()] if goes else ["0", "0", "0"]
        scene = f"""
            title = "frames"
            duration = 0.15
            [[body]]
            name = "block"
            kind = "rigid"
            shape = {BLOCK}
            density = 100.0
            velocity = {[0.0] * 3 if goes else (-wind).tolist()}
            angular_velocity = [1.0, 2.0, -3.0]
            [[obstacle]]
            name = "wall"
            {ROUND[kind]}
            motion = {motion}
            [[contact]]
            between = ["block", "wall"]
            friction_coefficient = 0.3
            restitution = 0.6
            [solve]
            dt = 2e-3
            estimate = false
        """
        history = impactfem.solve(impactfem.Scene.from_dict(tomllib.loads(scene))).history
        speed = np.array([float(history[f"block.v{x}"][-1]) for x in "xyz"])
        assert float(history["contact_impulse"].values.sum()) > 0.0
        found.append(speed if not goes else speed - wind)
    assert found[1] == pytest.approx(found[0], abs=1e-9)

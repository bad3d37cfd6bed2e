"""The structure of the package against `.ci/budget.toml`: it may only get smaller and plainer.

Each place that asks which kind it has before it is one that a new body, obstacle or method has to
visit; each protocol, refusal and parent is one more thing to know. What fell is written down, so
that it cannot come back.
"""

import tomllib
from pathlib import Path

import budget
import pytest

import impactfem

TOP = Path(__file__).resolve().parents[2]
BUDGET = tomllib.loads((TOP / ".ci" / "budget.toml").read_text(encoding="utf-8"))
_SLACK = 250  # lines that a folder may lie below its figure before that has to follow
STEEL = {"density": 7800.0, "youngs_modulus": 2e11, "poisson_ratio": 0.3}
DOWN = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}


@pytest.fixture(scope="module")
def measured():
    return budget.structure()


@pytest.mark.parametrize(
    "name", ["protocols", "refusals", "inheritance", "members", "flags"]
)  # fmt: skip
def test_counts_only_fall(measured, name):
    assert measured[name] <= BUDGET[name], f"{name} rose; .ci/budget.toml says what it counts"
    assert measured[name] == BUDGET[name], f"{name} fell: lower it in .ci/budget.toml"


def test_no_folder_grows(measured):
    assert measured["lines"].keys() == BUDGET["lines"].keys()
    grown = {k: n for k, n in measured["lines"].items() if n > BUDGET["lines"][k]}
    assert not grown, "these folders grew: delete, or raise them in .ci/budget.toml and say why"
    slack = {k: n for k, n in measured["lines"].items() if n < BUDGET["lines"][k] - _SLACK}
    assert not slack, "these folders fell: lower them in .ci/budget.toml"


def test_no_place_asks_anew_which_kind_it_has_before_it():
    for what, places in budget.dispatch().items():
        assert len(places) <= BUDGET["dispatch"][what], (what, places)
        assert len(places) == BUDGET["dispatch"][what], f"{what} fell: lower it: {places}"


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("isinstance(body, Plate)", "class"), ("body.kind == 'rod'", "kind"),
        ("name == 'mechanism'", "name"), ("body.marches", "family"),
        ("scene.bodies[0]", "first_body"), ("isinstance(body, Ball)", ""),
        ("values.dtype.kind == 'f'", ""), ("name == 'left'", ""),
    ],
)  # fmt: skip
def test_what_asks_for_a_kind_is_seen(text, what):
    node = budget.ast.parse(text, mode="eval").body
    assert budget.asks(node) == what


def scene(bodies, duration, *, obstacles=(), contacts=(), joints=(), gravity=(), **solve):
    tables = {
        "body": list(bodies), "obstacle": list(obstacles), "contact": list(contacts),
        "joint": list(joints), "gravity": list(gravity),
    }  # fmt: skip
    given = {name: value for name, value in tables.items() if value}
    return impactfem.Scene.from_dict(
        {"title": "traced", "duration": duration, "solve": solve, "output": {"fields": []}, **given}
    )


def bar():
    given = {"kind": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0}
    body = given | {"gap": 0.5, "velocity": -0.5}
    return scene([body], 5.0, obstacles=[{"kind": "wall"}], method="galerkin", elements=40)


def box_on_plate():
    plate = {
        "kind": "plate", "name": "plate", "outline": {"kind": "rectangle", "size": [0.2, 0.2]},
        "mesh_size": 0.02, "thickness": 0.002, **STEEL,
        "supports": [
            {"edge": edge, "kind": "clamped"} for edge in ("left", "right", "bottom", "top")
        ],
    }  # fmt: skip
    shape = {"kind": "block", "size": [0.05] * 3, "corner": [-0.025, -0.025, 0.0015]}
    box = {"kind": "rigid", "name": "box", "shape": shape, "density": 1000.0,
           "velocity": [0.0, 0.0, -1.0]}  # fmt: skip
    gravity = [0.0, 0.0, -9.81]
    return scene([plate, box], 2e-3, gravity=gravity, dt=2e-5, estimate=False)


def arm_on_solid():
    shape = {"kind": "block", "size": [0.2, 0.02], "corner": [0.0, 0.052]}
    arm = {"kind": "rigid", "name": "arm", "shape": shape, "density": 1000.0}
    pad = {
        "kind": "solid", "name": "pad", "model": "plane_strain", "mesh_size": 0.02,
        "shape": {"kind": "block", "size": [0.1, 0.05], "corner": [0.1, 0.0]},
        "density": 1000.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3,
        "supports": [{"surface": "bottom", "kind": "fixed"}],
    }  # fmt: skip
    hinge = {"kind": "revolute", "name": "hinge", "between": ["ground", "arm"],
             "point": [0.0, 0.062]}  # fmt: skip
    return scene(
        [arm, pad], 0.05, joints=[hinge], gravity=[0.0, -9.81], dt=5e-4, estimate=False
    )  # fmt: skip


def finite_disc(duration=4e-3):
    disc = {
        "kind": "solid", "name": "disc", "model": "plane_strain", "mesh_size": 0.017,
        "shape": {"kind": "disc", "radius": 0.05, "center": [0.0, 0.051]}, "strain": "finite",
        "density": 1100.0, "youngs_modulus": 1.5e6, "poisson_ratio": 0.4, "velocity": [1.0, -1.0],
    }  # fmt: skip
    rubs = {"between": ["disc", "floor"], "friction_coefficient": 0.3}
    return scene([disc], duration, obstacles=[DOWN], contacts=[rubs], dt=1e-4, estimate=False)


@pytest.mark.slow
@pytest.mark.parametrize("made", [bar, box_on_plate, arm_on_solid, finite_disc])
def test_a_run_enters_no_more_files(made):
    given = made()
    impactfem.solve(given)  # loads and compiles
    files, _ = budget.traced(lambda: impactfem.solve(given))
    assert files <= BUDGET["files"][made.__name__]


@pytest.mark.slow
def test_a_step_makes_no_more_calls():
    short, long = finite_disc(), finite_disc(6e-3)
    impactfem.solve(short)
    calls = [budget.traced(lambda each=each: impactfem.solve(each))[1] for each in (short, long)]
    assert (calls[1] - calls[0]) / 20 <= 1.01 * BUDGET["calls"]["finite_disc"]

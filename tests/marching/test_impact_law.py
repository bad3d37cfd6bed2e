"""One law of impacts for a scene, whatever stands beside: contacts that land in one step."""

import numpy as np
import pytest
from moving_scenes import FAR, FAR_3D, check_restart

import impactfem
from impactfem import SceneError
from impactfem.contact.impact_law import Approach, in_turn

LAWS = ("simultaneous", "sequential")
FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
FLOOR_3D = FLOOR | {"point": [0.0, 0.0, 0.0], "normal": [0.0, 1.0, 0.0]}
BESIDE = {"alone": [], "beside rubber": [FAR]}
beside = pytest.mark.parametrize("others", BESIDE.values(), ids=BESIDE)


def scene(bodies, contacts, duration, gravity=(0.0, 0.0), obstacles=(FLOOR,), **solve):
    return impactfem.Scene.from_dict(
        {
            "title": "impact law", "duration": duration, "gravity": list(gravity),
            "body": bodies, "obstacle": list(obstacles), "contact": contacts,
            "solve": {"estimate": False, "dt": 1e-3} | solve, "output": {"fields": []},
        }
    )  # fmt: skip


def last(result, *columns):
    return np.array([result.history[name].values[-1] for name in columns])


def block(width, height, **more):
    shape = {"kind": "block", "size": [width, height], "corner": [-0.5 * width, 0.0045]}
    found = {"kind": "rigid", "name": "a", "mass": 1.0, "shape": shape, "velocity": [0.0, -1.0]}
    return found | more


def row(kind, e, law, others):
    """Three balls that touch, the first of which comes with 1 m/s."""
    balls = []
    for k, x in enumerate((-0.2055, 0.0, 0.2)):
        place = {"radius": 0.1, "position": [x, 0.0]}
        if kind == "rigid":
            place = {"shape": {"kind": "sphere", "radius": 0.1, "center": [x, 0.0]}}
        ball = {"kind": kind, "name": f"b{k}", "mass": 1.0, "velocity": [float(k == 0), 0.0]}
        balls.append(ball | place)
    contacts = [{"between": [f"b{k}", f"b{k + 1}"], "restitution": e} for k in (0, 1)]
    method = "conserving" if others else "moreau_jean"
    return scene(
        [*balls, *others], contacts, 0.01, obstacles=(), method=method, impact_law=law
    )  # fmt: skip


@beside
@pytest.mark.parametrize(
    ("law", "e", "speeds"),
    [
        ("simultaneous", 1.0, [-1 / 3, 2 / 3, 2 / 3]),
        ("sequential", 1.0, [0.0, 0.0, 1.0]),
        ("simultaneous", 0.5, [0.0, 0.5, 0.5]),
        ("sequential", 0.5, [13 / 64, 15 / 64, 9 / 16]),
        ("simultaneous", 0.0, [1 / 3, 1 / 3, 1 / 3]),
        ("sequential", 0.0, [1 / 3, 1 / 3, 1 / 3]),
    ],
)
def test_balls_in_a_row_take_the_law_of_their_scene(law, e, speeds, others):
    result = impactfem.solve(row("rigid", e, law, others))
    assert np.abs(last(result, "b0.vx", "b1.vx", "b2.vx") - speeds).max() <= 1e-8
    told = result.summary["details"].get("impact_law")
    if e == 0.0:  # both laws agree
        assert told is None
        return
    assert (told["law"], told["contacts"], told["pair"]) == (law, 2, "b0.b1")
    (note,) = [f for f in result.summary["verdict"]["findings"] if f["code"] == "impact_law"]
    assert note["severity"] == "note"
    assert law in note["text"]
    assert 'compare impact_law = "' in note["remedy"]


@beside
def test_a_run_goes_on_and_knows_what_was_shared(others, tmp_path, monkeypatch):
    made = row("rigid", 0.5, "sequential", others)
    data = made.to_dict()
    data["output"] = {"fields": [], "checkpoint": 8}
    each = check_restart(impactfem.Scene.from_dict(data), 8, tmp_path, monkeypatch)
    whole, again = (found.summary["details"]["impact_law"] for found in each)
    assert whole == again
    assert whole["time"] == pytest.approx(0.006)


def test_without_a_key_they_are_struck_at_once_as_points_are():
    result = impactfem.solve(row("rigid", 1.0, None, [FAR]))
    points = impactfem.solve(row("point", 1.0, None, []))
    each = (last(found, "b0.vx", "b1.vx", "b2.vx") for found in (result, points))
    assert np.abs(np.subtract(*each)).max() <= 1e-8


@beside
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("mu", "spin"), [(1.0, 1.875), (0.3, 0.0)])
def test_a_square_block_that_lands_flat_lies_or_rocks_by_the_law(mu, spin, law, others):
    """It turns about the first corner with 3 v / 4 b, about the other with a quarter of that.

    The share kept is Housner's, 1 - 3/2 sin^2; below a friction of 1/3 the corner that slips lets
    the other one down again.
    """
    contact = [{"between": ["a", "floor"], "friction_coefficient": mu}]
    method = "conserving" if others else "moreau_jean"
    settings = {"method": method, "impact_law": law, "dt": 1e-4}
    made = scene([block(0.1, 0.1), *others], contact, 0.005, **settings)
    found = abs(last(impactfem.solve(made), "a.spin")[0])
    wanted = spin if law == "sequential" else 0.0
    assert abs(found - wanted) <= 1e-3 * max(wanted, 1e-5)


@beside
@pytest.mark.parametrize("law", LAWS)
def test_a_smooth_tall_block_that_lands_flat(law, others):
    """By turns its corners leave with 1 - (W_12 / W_11)^2 and 0 times 0.3 / 0.7 of W_12 / W_11."""
    width, height = 0.05, 0.2
    turns = 3.0 * width**2 / (width**2 + height**2)
    link = (1.0 - turns) / (1.0 + turns)
    leaves = (1.0 - link) * link if law == "sequential" else 0.0
    contact = [{"between": ["a", "floor"]}]
    method = "conserving" if others else "moreau_jean"
    made = scene([block(width, height), *others], contact, 0.005, method=method, impact_law=law)
    speed, spin = last(impactfem.solve(made), "a.vy", "a.spin")
    assert abs(speed - 0.5 * leaves) <= 1e-3
    assert abs(abs(spin) - leaves / width) <= 1e-2 * max(leaves / width, 1e-6)


@beside
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("mu", "share"), [(1.0, 0.25), (0.3, 0.0)])
def test_a_block_that_rocks_keeps_the_share_of_housner_by_both_laws(mu, share, law, others):
    """1 - 3/2 sin^2, or none where the corner slips: one lands and pushes, the other leaves."""
    tilt, spin = 4.5e-4, -1.0  # about the left corner, which stays at the origin
    cos, sin = np.cos(tilt), np.sin(tilt)
    centre = 0.05 * np.array([cos - sin, cos + sin])
    body = {
        "kind": "rigid", "name": "a", "mass": 1.0, "angle": tilt, "angular_velocity": spin,
        "shape": {"kind": "block", "size": [0.1, 0.1], "corner": (centre - 0.05).tolist()},
        "velocity": (spin * np.array([-centre[1], centre[0]])).tolist(),
    }  # fmt: skip
    contact = [{"between": ["a", "floor"], "friction_coefficient": mu}]
    method = "conserving" if others else "moreau_jean"
    settings = {"method": method, "impact_law": law, "dt": 2e-5}
    made = scene([body, *others], contact, 6e-4, (0.0, -9.81), **settings)
    result = impactfem.solve(made)
    spins = result.history["a.spin"].values
    lands = int(np.argmax(np.diff(spins)))
    assert abs(spins[lands + 1] / spins[lands] - share) <= 0.01
    assert "impact_law" not in result.summary["details"]


def test_a_box_in_space_goes_on_as_alone_beside_rubber():
    """Corners that land within a step (.116 s): it lay flat alone, and rocked on beside rubber."""
    box = {
        "kind": "rigid", "name": "box", "mass": 1.0, "velocity": [1.0, 0.0, 0.0],
        "angular_velocity": [0.3, 0.5, -2.0],
        "shape": {"kind": "block", "size": [0.2, 0.1, 0.1], "corner": [0.0, 0.05, 0.0]},
    }  # fmt: skip
    contact = [{"between": ["box", "floor"], "friction_coefficient": 0.3}]
    spins = ("box.wx", "box.wy", "box.wz")
    found = {}
    for law in LAWS:
        for others in ([], [FAR_3D]):
            settings = {"obstacles": (FLOOR_3D,), "impact_law": law}
            made = scene([box, *others], contact, 0.118, (0.0, -9.81, 0.0), **settings)
            found[law, len(others)] = last(impactfem.solve(made), *spins)
    for law in LAWS:
        assert np.abs(found[law, 0] - found[law, 1]).max() <= 0.02
    assert abs(found["simultaneous", 0][0]) < 0.3
    assert abs(found["sequential", 0][0] - 1.55) <= 0.02


KINDS = {
    "point": {"kind": "point", "mass": 0.5, "radius": 0.02, "position": [0.0, 0.03]},
    "rod": {
        "kind": "rod", "mass": 0.5, "length": 0.2, "radius": 0.01, "center": [0.0, 0.04],
        "inclination": 0.1,
    },
    "beam": {
        "kind": "beam", "length": 0.2, "height": 0.01, "width": 1.0, "density": 500.0,
        "youngs_modulus": 1e8, "elements": 4, "center": [0.0, 0.04], "inclination": 0.1,
    },
    "rigid": {
        "kind": "rigid", "mass": 1.0, "angular_velocity": 1.0,
        "shape": {"kind": "block", "size": [0.1, 0.2], "corner": [0.0, 0.01]},
    },
    "solid": {
        "kind": "solid", "model": "plane_strain", "density": 500.0, "youngs_modulus": 1e6,
        "poisson_ratio": 0.3, "strain": "small", "mesh_size": 0.05,
        "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [0.0, 0.01]},
    },
}  # fmt: skip
KINDS_3D = {
    "point": {"kind": "point", "mass": 0.5, "radius": 0.02, "position": [0.0, 0.03, 0.0]},
    "rigid": {
        "kind": "rigid", "mass": 1.0, "angular_velocity": [0.3, 1.0, 0.2],
        "shape": {"kind": "block", "size": [0.1, 0.2, 0.1], "corner": [0.0, 0.01, 0.0]},
    },
}  # fmt: skip
STIFF = {name: value for name, value in FAR.items() if name not in {"strain", "material"}}
OTHERS = {
    "point": {"kind": "point", "name": "far", "mass": 1.0, "position": [5.0, 5.0]},
    "rigid": {
        "kind": "rigid", "name": "far", "mass": 1.0,
        "shape": {"kind": "sphere", "radius": 0.1, "center": [5.0, 5.0]},
    },
    "solid": STIFF | {"strain": "small"},
}  # fmt: skip
OTHERS_3D = {
    "rigid": OTHERS["rigid"]
    | {"shape": {"kind": "sphere", "radius": 0.1, "center": [5.0, 5.0, 5.0]}},
    "plate": {
        "kind": "plate", "name": "far", "outline": {"kind": "disc", "radius": 0.05},
        "mesh_size": 0.03, "thickness": 1e-3, "density": 7800.0, "youngs_modulus": 2e11,
        "poisson_ratio": 0.3, "center": [5.0, 5.0, 5.0],
        "supports": [{"edge": "rim", "kind": "clamped"}],
    },
}  # fmt: skip
FAR_AWAY = [(2, kind, other) for kind in KINDS for other in OTHERS]
FAR_AWAY += [(3, kind, other) for kind in KINDS_3D for other in OTHERS_3D]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("dim", "kind", "other"), FAR_AWAY)
def test_a_body_that_touches_nothing_changes_no_bit_of_others(dim, kind, other, law):
    """Nor of their forces, but for the order of sums where shapes of more bodies set a scale."""
    kinds, others = (KINDS, OTHERS) if dim == 2 else (KINDS_3D, OTHERS_3D)
    one = kinds[kind] | {"name": "a", "velocity": [1.0, -1.0, 0.0][:dim]}
    contact = {"between": ["a", "floor"], "friction_coefficient": 0.3}
    settings = {"impact_law": law}
    if kind == "solid":
        settings = {"method": "massless"}
    else:
        contact["restitution"] = 0.5
    gravity, floor = [0.0, -9.81, 0.0][:dim], FLOOR if dim == 2 else FLOOR_3D
    alone, beside_it = (
        impactfem.solve(scene(bodies, [contact], 0.03, gravity, (floor,), **settings)).history
        for bodies in ([one], [one, others[other]])
    )
    names = [name for name in alone if name.startswith("a.") or name.endswith(".a.floor")]
    assert len(names) > 4
    for name in names:
        one, two = alone[name].values, beside_it[name].values
        # Slips are summed up over the steps.
        room = 0.0 if name.startswith("a.") else np.finfo(float).eps * len(one) * np.abs(one).max()
        assert np.abs(one - two).max() <= room, name


def test_the_key_is_refused_where_nothing_lands_by_it():
    made = {"impact_law": "sequential", "method": "massless"}
    solid = KINDS["solid"] | {"name": "a"}
    with pytest.raises(SceneError, match=r"solve\.impact_law.*bodies without waves.*remove it"):
        scene([solid], [{"between": ["a", "floor"]}], 0.01, **made)


def test_two_body_impacts_come_in_the_order_in_which_gaps_close():
    """Of a rod that lands a little tilted the lower end comes first, though the other is faster."""
    matrix = np.array([[4.0, -2.0], [-2.0, 4.0]])
    none = np.zeros(2)
    bodies = Approach(np.array([[-1.0], [-1.1]]), np.array([0.1, 0.3]), none + 1.0, none, none)
    impulse, speed = in_turn(matrix, bodies, 1.0)
    # The first end leaves with 1, which throws down the other: -2.1, 2.1; and that the first.
    assert np.allclose(speed[:, 0], [1.1, 1.0], atol=1e-12)
    assert np.allclose(bodies.speed + matrix @ impulse, speed, atol=1e-12)
    never = in_turn(matrix, bodies, 0.05)[0]
    assert not never.any()  # none closes in this time

"""What the plan says of several solids: how they slide, who carries what, who meets nobody."""

import pytest

import impactfem
from impactfem.errors import SceneError
from impactfem.report.table import plan_table

SOLID = {
    "kind": "solid", "model": "plane_strain", "density": 1.0, "youngs_modulus": 1.0,
    "poisson_ratio": 0.0, "mesh_size": 0.25, "strain": "small",
}  # fmt: skip


def block(name, corner, size=(1.0, 0.5), **keys):
    shape = {"kind": "block", "size": list(size), "corner": list(corner)}
    return SOLID | {"name": name, "shape": shape} | keys


def disc(name, center, **keys):
    return SOLID | {"name": name, "shape": {"kind": "disc", "radius": 0.5, "center": center}} | keys


def scene(*bodies, contacts=(), **keys):
    data = {"title": "bodies", "duration": 1.0, "output": {"fields": []}} | keys
    data |= {"body": list(bodies), "contact": [{"between": list(names)} for names in contacts]}
    return impactfem.Scene.from_dict(data)


def test_bodies_that_approach_head_on_slide_little():
    plan = impactfem.plan(
        scene(block("a", (0, 0), velocity=[0.5, 0.0]), block("b", (1.1, 0), mesh_size=0.2))
    )
    assert plan.normals == "fixed"
    assert "small sliding" in plan.reasons["normals"]
    assert plan.method == "explicit"


@pytest.mark.parametrize(
    ("bodies", "keys", "why"),
    [
        ((disc("a", [0, 0], velocity=[1, 0]), disc("b", [1.0, 0.5])), {}, "along each other"),
        ((block("a", (0, 0.55), velocity=[1, 0]), block("b", (0, 0), (3, 0.5))), {}, "each other"),
        (
            (disc("a", [0, 0], angular_velocity=1.0), disc("b", [1.1, 0])),
            {},
            "a turns",
        ),
        (
            (block("a", (1.05, 0)),
             block("b", (0, 0), supports=[{"surface": "left", "kind": "fixed"}])),
            {"gravity": [0.0, -1.0]},
            "along each other by about 0.5 m",
        ),
    ],
)  # fmt: skip
def test_pairs_follow_bodies_that_slide(bodies, keys, why):
    plan = impactfem.plan(scene(*bodies, **keys))
    assert plan.normals == "updated"
    assert why in plan.reasons["normals"]
    assert "energy is right to first order" in plan.reasons["normals"]


def test_bodies_that_fall_together_do_not_slide():
    free = scene(block("a", (0, 0)), block("b", (1.05, 0)), gravity=[0.0, -1.0])
    assert impactfem.plan(free).normals == "fixed"


def test_sliding_is_as_asked():
    asked = scene(
        disc("a", [0, 0], velocity=[1, 0]), disc("b", [1.0, 0.5]), solve={"normals": "fixed"}
    )
    plan = impactfem.plan(asked)
    assert (plan.normals, plan.reasons["normals"]) == ("fixed", "as asked")


def test_the_finer_surface_carries_the_multipliers():
    for sizes, finer in (((0.25, 0.1), "b"), ((0.1, 0.25), "a")):
        bodies = [
            block(name, (x, 0), mesh_size=size)
            for name, x, size in zip("ab", (0.0, 1.1), sizes, strict=True)
        ]
        table = plan_table(impactfem.plan(scene(*bodies)))
        assert f"{finer} is the slave side: its faces are the smaller ones" in table


def test_each_body_is_described_once():
    plan = impactfem.plan(scene(block("a", (0, 0)), block("b", (1.1, 0), degree=2)))
    assert plan.model == (
        "a: block in plane strain, P1 triangles; b: block in plane strain, P2 triangles; "
        "linear elastic, no friction"
    )
    assert plan.method == "massless"


def test_who_meets_nobody_is_warned_of():
    apart = scene(block("a", (0, 0)), block("b", (1.1, 5)), block("c", (-1.1, 0)))
    (warning,) = impactfem.plan(apart).warnings
    assert warning.startswith("body b touches nothing: no face")
    chosen = scene(
        block("a", (0, 0)), block("b", (1.1, 0)), block("c", (2.2, 0)),
        contacts=[("a", "b"), ("b", "c/left"), ("a/left", "c")],
    )  # fmt: skip
    warning, rest = impactfem.plan(chosen).warnings
    assert "bodies a and c cannot meet" in warning
    assert "the bodies meet nothing" in rest  # they are at rest


BALL = {"kind": "sphere", "radius": 0.5, "center": [0.0, 0.3, 0.0]}
PLATE = {"kind": "block", "size": [2.0, 0.5, 2.0], "corner": [-1.0, -0.5, -1.0]}
SOCKET = {"kind": "ring", "radius": 1.0, "inner_radius": 0.6, "center": [0.0, 0.0]}


def in_space(first, second, model):
    solid = SOLID | {"model": model}
    return scene(solid | {"name": "a", "shape": first}, solid | {"name": "b", "shape": second})


def test_overlap_is_found_in_space():
    with pytest.raises(SceneError, match=r"a and b overlap by at least 0\.\d+ m at t = 0 near"):
        impactfem.plan(in_space(BALL, PLATE, "3d"))
    above = BALL | {"center": [0.0, 0.52, 0.0]}
    assert impactfem.plan(in_space(above, PLATE, "3d")).contact_pairs > 0


@pytest.mark.parametrize("radius", [0.5, 0.62])
def test_overlap_knows_the_inside_of_a_hole_from_that_of_the_body(radius):
    shape = {"kind": "disc", "radius": radius, "center": [0.0, 0.0]}
    case = in_space(shape, SOCKET, "plane_strain")
    if radius < 0.6:
        assert impactfem.plan(case).contact_pairs > 0
        return
    with pytest.raises(SceneError, match=r"a and b overlap by at least 0\.0\d+ m"):
        impactfem.plan(case)


def balls(count, spacing):
    """Rigid balls in a row."""
    shape = {"kind": "sphere", "radius": 0.1}
    return impactfem.Scene.from_dict(
        {
            "title": "balls", "duration": 0.1,
            "body": [
                {"kind": "rigid", "name": f"b{k}", "mass": 1.0,
                 "shape": shape | {"center": [spacing * k, 0.0, 0.0]}}
                for k in range(count)
            ],
            "contact": [{"between": ["b0", "b1"]}] if count == 2 else [],
            "solve": {"dt": 5e-4, "estimate": False},
        }
    )  # fmt: skip


@pytest.mark.parametrize("spacing", [0.0, 0.15])
def test_what_a_run_refuses_a_plan_refuses(spacing):
    """Balls in each other were "in order"."""
    with pytest.raises(SceneError, match="b0 and b1 overlap by 0"):
        impactfem.plan(balls(2, spacing))
    assert impactfem.plan(balls(2, 0.2)).contact_pairs == 1


def test_one_overlap_among_many_is_found():
    table = balls(40, 0.25).to_dict()
    table["body"][31]["shape"]["center"] = [7.6, 0.0, 0.0]
    with pytest.raises(SceneError, match=r"b30 and b31 overlap by 0\.1 m"):
        impactfem.plan(impactfem.Scene.from_dict(table))


@pytest.mark.slow
def test_time_and_memory_of_many_bodies_count_their_pairs():
    """300 balls in 200 layers: 11 s, 424 MiB."""
    plan = impactfem.plan(balls(300, 0.25))
    assert plan.contact_pairs == 44_850
    assert 5.0 < plan.seconds < 20.0
    assert plan.memory_mib == pytest.approx(424.0, rel=0.25)


def test_time_of_boxes_counts_what_their_edges_and_faces_take_in_each_layer():
    """25 boxes that fall on each other in 100 layers: 3.05 s; 0.48 s were told."""
    table = balls(25, 0.25).to_dict()
    for k, body in enumerate(table["body"]):
        corner = [0.0025 * (k // 9), 0.0025 * (k // 3 % 3), 0.003 * (k % 3)]
        body["shape"] = {"kind": "block", "corner": corner, "size": [0.002, 0.002, 0.002]}
    table["solve"] = {"dt": table["duration"] / 100, "estimate": False}
    plan = impactfem.plan(impactfem.Scene.from_dict(table))
    assert plan.contact_pairs >= 8 * 300
    assert 3.05 / 3.0 < plan.seconds < 3.0 * 3.05

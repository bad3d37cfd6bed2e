"""Drawings of scenes show bodies where the scene puts them."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.patches import Rectangle
from synthetic import RADIUS, solid_result

import impactfem
from impactfem import Result, Scene
from impactfem.report.page.drawing import _figure, drawing
from impactfem.report.page.outlines import outline_of
from impactfem.scene import Solid
from impactfem.shipped import shipped_scenes

FLOOR = {"kind": "half_space", "name": "floor", "point": [0, 0], "normal": [0, 1]}


def bare(scene):
    return Result(scene, None, {})


def of_tables(bodies, obstacles=(), **more):
    tables = {"title": "Drawn", "duration": 1.0, "body": bodies, "obstacle": list(obstacles)}
    return bare(Scene.from_dict(tables | more))


def solid(shape, model="plane_strain", **more):
    material = {"density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.3, "mesh_size": 0.1}
    return {"kind": "solid", "model": model, "shape": shape} | material | more


def words(result):
    """The texts of a drawing, which stays XML whatever the names."""
    root = ET.fromstring(drawing(result))  # noqa: S314  (our own text)
    assert root.attrib["viewBox"]
    return [
        " ".join(element.itertext()).strip() for element in root.iter() if "text" in element.tag
    ]


@pytest.mark.parametrize(
    ("shape", "model", "area"),
    [
        ({"kind": "block", "size": [2.0, 1.0], "corner": [0.5, -3.0]}, "plane_strain", 2.0),
        (
            {"kind": "block", "size": [2.0, 1.0], "corner": [0.5, 3.0], "angle": 0.7},
            "plane_strain",
            2.0,
        ),
        ({"kind": "disc", "radius": 0.3, "center": [1.0, 2.0]}, "plane_stress", np.pi * 0.09),
        ({"kind": "disc", "radius": 0.3, "center": [0.0, 2.0]}, "axisymmetric", np.pi * 0.045),
        ({"kind": "disc", "radius": 0.3, "center": [1.0, 2.0]}, "axisymmetric", np.pi * 0.09),
        ({"kind": "sphere", "radius": 0.3, "center": [0.0, 2.0]}, "axisymmetric", np.pi * 0.045),
        (
            {"kind": "cylinder", "radius": 0.3, "height": 2.0, "center": [0.0, 1.0]},
            "axisymmetric",
            0.6,
        ),
    ],
)
def test_outlines_fill_the_box_of_the_shape(shape, model, area):
    body = Solid(**{k: v for k, v in solid(shape, model).items() if k != "kind"})
    low, high = body.shape.bounds(axisymmetric=body.is_axisymmetric)
    outline = outline_of(body)
    assert outline.min(axis=0) == pytest.approx(low, abs=1e-12)
    assert outline.max(axis=0) == pytest.approx(high, abs=1e-12)
    ahead = np.roll(outline, -1, axis=0)
    around = 0.5 * np.sum(outline[:, 0] * ahead[:, 1] - ahead[:, 0] * outline[:, 1])
    assert around == pytest.approx(area, rel=2e-3)


@pytest.mark.parametrize("name", shipped_scenes())
def test_every_shipped_scene_in_the_plane_is_drawn_with_its_names(name):
    scene = Scene.from_toml(shipped_scenes()[name])
    result = bare(scene)
    if scene.dim == 3:  # its mesh tells the shape, and there is none here
        assert drawing(result) is None
        return
    shown = " ".join(words(result))
    if len(scene.bodies) > 1 or isinstance(scene.bodies[0], Solid):
        assert all(body.name in shown for body in scene.bodies)


def test_bars_stand_at_their_gaps_with_their_lengths():
    figure = _figure(bare(Scene.from_toml(shipped_scenes()["two_bars"])))
    boxes = [patch for patch in figure.axes[0].patches if isinstance(patch, Rectangle)]
    places = [(box.get_x(), box.get_width()) for box in boxes if box.get_height() == 0.6]
    assert places == [pytest.approx((0.0, 1.0)), pytest.approx((1.002, 2.0))]
    shown = words(bare(Scene.from_toml(shipped_scenes()["two_bars"])))
    assert {"1 m", "2 m", "gap 2 mm", "4 m/s"} <= set(shown)


def test_what_holds_and_pulls_is_told():
    block = solid(
        {"kind": "block", "size": [2.0, 1.0]},
        supports=[{"surface": "left", "kind": "fixed"}],
        pressures=[{"surface": "top", "value": "3*t"}],
        velocity=["0", "-x"],
    )
    floor = FLOOR | {"point": [0, -0.5], "motion": ["0", "0.1*sin(t)"]}
    shown = words(of_tables([block], [floor], gravity=[0.0, -9.81]))
    assert {
        "held",
        "pressure 3*t Pa",
        "v = (0, -x) m/s",
        "floor moves by (0, 0.1*sin(t)) m",
    } <= set(shown)
    assert "9.81 m/s²" in " ".join(shown)


def test_a_mesh_tells_what_a_shape_does_not(tmp_path):
    """The disc of the fields, not that of the shape: a segment for each side of the mesh."""
    result = solid_result(tmp_path / "fields.vtkhdf")
    cut = result.scene.with_settings({"body.body.shape.symmetry": ["x"]})
    figure = _figure(Result(cut, result.history, result.summary, result.fields))
    lines = [c for c in figure.axes[0].collections if len(c.get_paths()) == 36]
    assert lines
    ends = np.concatenate([path.vertices for path in lines[0].get_paths()])
    assert np.hypot(ends[:, 0], ends[:, 1] - RADIUS - 0.1) == pytest.approx(RADIUS, rel=1e-6)


def test_points_springs_and_rods_are_drawn():
    tied = [{"to": "b", "stiffness": 2.0}, {"anchor": [0.0, 3.0], "stiffness": 1.0}]
    points = [
        {"kind": "point", "name": "a", "mass": 1, "position": [0, 1], "springs": tied},
        {"kind": "point", "name": "b", "mass": 1, "position": [1, 1], "radius": 0.2,
         "velocity": [3.0, 4.0]},
    ]  # fmt: skip
    assert {"a", "b", "5 m/s"} <= set(words(of_tables(points, [FLOOR])))
    space = [
        {"kind": "point", "name": "p", "mass": 1, "position": [0, 1, 0], "velocity": [0, 0, 2]}
    ]
    ground = {"kind": "half_space", "point": [0, 0, 0], "normal": [0, 1, 0]}
    drawn = of_tables(space, [ground], gravity=[0.0, -9.81, 0.0])
    assert {"p", "2 m/s", "9.81 m/s²"} <= set(words(drawn))
    rod = {"kind": "rod", "mass": 1, "length": 2, "center": [0, 2], "inclination": 0.5}
    figure = _figure(of_tables([rod], [FLOOR]))
    shapes = [c for c in figure.axes[0].collections if isinstance(c, PolyCollection)]
    corners = shapes[-1].get_paths()[0].vertices[:4]
    ends = 0.5 * (corners[0] + corners[3]), 0.5 * (corners[1] + corners[2])
    assert ends[1] - ends[0] == pytest.approx(2.0 * np.array([np.cos(0.5), np.sin(0.5)]))


def test_obstacles_of_all_kinds_are_drawn():
    around = [
        {"kind": "sphere", "name": "s", "center": [0, -2], "radius": 1},
        {"kind": "box", "name": "x", "center": [3, 0], "size": [1, 1], "angle": 0.3},
        {"kind": "polyline", "name": "l", "points": [[4, -2], [-4, -2.5]]},
        {"kind": "cylinder", "name": "c", "point": [0, 0], "radius": 6, "side": "inside"},
    ]
    figure = _figure(of_tables([solid({"kind": "disc", "radius": 0.5})], around))
    assert figure.axes[0].collections


def test_a_stranger_cannot_put_markup_into_a_drawing():
    scene = Scene.from_toml(shipped_scenes()["bar_impact"])
    odd = scene.with_settings(
        {"title": '"><script>x</script>', "body.bar.velocity": "-0.5*where(x < 2, 1, 1)"}
    )
    text = drawing(bare(odd))
    assert "<script" not in text
    assert "v = -0.5*where(x < 2, 1, 1) m/s" in words(bare(odd))


def test_supports_and_loads_of_solids_in_space_are_drawn_on_their_faces():
    from matplotlib.collections import LineCollection
    from matplotlib.colors import to_hex

    from impactfem.report.page.sketch import SUPPORT
    from impactfem.report.page.space_drawing import draw_solids_in_space

    scene = Scene.from_dict({
        "title": "held", "duration": 1e-5,
        "body": [{"kind": "solid", "name": "block", "model": "3d", "mesh_size": 1.0,
                  "shape": {"kind": "block", "size": [2.0, 1.0, 1.0]}, "density": 1e3,
                  "youngs_modulus": 1e6, "poisson_ratio": 0.3,
                  "supports": [{"surface": "left", "kind": "fixed"}],
                  "pressures": [{"surface": "top", "value": 7.0}]}],
        "solve": {"dt": 1e-6, "estimate": False},
        "output": {"fields": ["vtkhdf"], "pictures": False, "film": False, "report": False},
    })  # fmt: skip
    axes = draw_solids_in_space(impactfem.solve(scene)).axes[0]
    told = {text.get_text() for text in axes.texts}
    assert {"held", "pressure 7 Pa", "block"} <= told
    purple = [c for c in axes.collections if isinstance(c, LineCollection)
              and to_hex(c.get_colors()[0]) == SUPPORT]  # fmt: skip
    held, pressed = (np.concatenate(c.get_segments()) for c in purple)
    # A square and a rectangle, each seen as a parallelogram.
    sizes = [np.linalg.norm(np.ptp(each, axis=0)) for each in (held, pressed)]
    assert sizes[0] < sizes[1]

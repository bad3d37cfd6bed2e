"""Pictures of solids show the motion they are made of."""

from itertools import pairwise

import numpy as np
import pytest
from matplotlib.collections import PolyCollection, TriMesh
from PIL import Image
from synthetic import PEAK_FORCE, PEAK_PRESSURE, RADIUS, solid_result

from impactfem import Result
from impactfem.errors import MissingDependencyError, OutputError
from impactfem.report.skin import Skin, normals
from impactfem.report.solid_figures import survey
from impactfem.report.telling import telling_snapshots
from impactfem.result import StoredSnapshots
from impactfem.result.netcdf import write_netcdf
from impactfem.result.whole import Whole
from impactfem.scene import HalfSpace, RigidBox, RigidCylinder, RigidPolyline, RigidSphere

BOTH = pytest.mark.parametrize("dim", [2, 3])


@pytest.mark.slow
@BOTH
def test_all_pictures_and_the_film_are_written(dim, tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf", dim)
    figures = result.plot(tmp_path / "out")
    names = {"contact_force", "energy", "motion", "velocity", "body"}
    assert set(figures) == names
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "motion.gif", *(f"{name}.png" for name in names)
    }  # fmt: skip
    for name in names:  # not empty, and of a size that a page can show
        picture = np.array(Image.open(tmp_path / f"out/{name}.png").convert("RGB"))
        assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 20
        assert max(picture.shape) < 2500
    assert (tmp_path / "out/motion.gif").stat().st_size < 3e6


def shown_layers(result, most=6):
    found = telling_snapshots(result, Skin.of(result.fields), most)
    return [int(np.flatnonzero(result.fields.times == each.time)[0]) for each in found]


def test_snapshots_of_a_disc_show_displacement_stress_and_pressure(tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf")
    figure = result.plot()["body"]
    panels = [axes for axes in figure.axes if axes.get_title().startswith("t = ")]
    layers = shown_layers(result)
    assert len(panels) == len(layers) > 3
    for axes, layer in zip(panels, layers, strict=True):
        values = result.fields.read(layer)
        mesh = next(c for c in axes.collections if isinstance(c, TriMesh))
        assert np.array_equal(mesh.get_array(), values["von_mises"])
        place = result.fields.points + values["displacement"]
        assert mesh._triangulation.x == pytest.approx(place[:, 0])
        assert mesh._triangulation.y == pytest.approx(place[:, 1])
        pressure = next(c for c in axes.collections if isinstance(c, PolyCollection))
        corners = [path.vertices for path in pressure.get_paths()]
        largest = values["contact_pressure"].max()
        if largest == 0.0:
            assert not corners
            continue
        # The largest pressure of all is drawn as long as a fifth of the body, along the normal.
        below = min(c[:, 1].min() for c in corners)
        assert below == pytest.approx(-0.2 * 2 * RADIUS * largest / PEAK_PRESSURE, rel=1e-2)
    assert f"{PEAK_PRESSURE:.4g} Pa" in figure.legends[0].get_texts()[0].get_text()


def test_pressure_at_a_corner_goes_into_the_obstacle(tmp_path):
    """A square that stands on the floor and may touch it with all its faces."""
    from matplotlib.figure import Figure

    from impactfem.report.plane_picture import PlanePainter
    from impactfem.result import FieldSpool, Shape, StoredSnapshots

    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    with FieldSpool(tmp_path / "f.vtkhdf", [Shape("body", points, [[0, 1, 2, 3]], 9)]) as spool:
        spool.append(0.0, {"displacement": 0 * points, "velocity": 0 * points, "von_mises": [1] * 4,
                           "contact_pressure": [3.0, 1.0, 0.0, 0.0], "gap": [0, 0, 1, 1],
                           "contact_force": 0 * points, "active": [1, 1, 0, 0]})  # fmt: skip
    skin = Skin.of(StoredSnapshots(tmp_path / "f.vtkhdf"))
    floor = HalfSpace(name="floor", point=[0.0, 0.0], normal=[0.0, 2.0])
    painter = PlanePainter(skin, [floor], pressure=3.0)
    areas = painter.draw(Figure().subplots(), skin.snapshot(0))[-1].get_paths()
    assert len(areas) == 1
    corners = {tuple(np.round(c, 12)) for c in areas[0].vertices}
    assert corners == {(0.0, 0.0), (1.0, 0.0), (0.0, -0.2), (1.0, -round(0.2 / 3, 12))}


def test_the_floor_fills_what_lies_below(tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf")
    axes = result.plot()["body"].axes[0]
    filled = min(axes.collections, key=lambda c: c.get_zorder())
    corners = np.concatenate([path.vertices for path in filled.get_paths()])
    low, high = axes.get_ylim()
    assert corners[:, 1].max() == pytest.approx(0.0, abs=1e-9)
    assert corners[:, 1].min() == pytest.approx(low)
    assert high > 2 * RADIUS


def test_moments_are_those_of_contact_and_of_change(tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf", layers=49)
    force = result.history["contact_force"].values
    begins = np.flatnonzero(force > 0.0)[0]
    for most in (4, 6):
        layers = shown_layers(result, most)
        assert len(layers) == most
        # The start, the first contact, the largest force and the end are among them.
        assert {0, int(np.argmax(force)), len(force) - 1} <= set(layers)
        assert min(abs(layer - begins) for layer in layers) <= 3


def test_a_run_without_contact_is_drawn(tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf")
    result.history["contact_force"][:] = 0.0
    layers = shown_layers(result)
    assert {0, len(result.fields) - 1} <= set(layers)
    assert result.plot()["body"] is not None


@pytest.mark.slow
@BOTH
def test_layers_that_are_not_finite_are_left_out(dim, tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf", dim, broken=True)
    figure = result.plot()["body"]
    titles = [axes.get_title() for axes in figure.axes]
    assert "t = 0 s" in titles
    assert "t = 1.2 s" not in titles
    assert "[unstable]" in figure.get_suptitle()
    result.animate(tmp_path / "motion.gif")
    with Image.open(tmp_path / "motion.gif") as film:
        assert film.n_frames > 10


def test_the_centre_of_mass_is_drawn_with_what_moves(tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf")
    (way,) = result.figure("motion").axes[0].lines
    (speed,) = result.figure("velocity").axes[0].lines
    place = result.history["body.y"].values
    assert np.array_equal(way.get_ydata(), place - place[0])
    assert np.array_equal(speed.get_ydata(), result.history["body.vy"].values)


def test_the_direction_of_the_momentum_survives_the_disk(tmp_path):
    import xarray as xr

    write_netcdf(solid_result(tmp_path / "fields.vtkhdf").history, tmp_path / "h.nc")
    with xr.open_dataset(tmp_path / "h.nc", engine="scipy") as again:
        assert again["momentum"].attrs["direction"] == pytest.approx([0.0, 1.0, 0.0])


@pytest.mark.slow
@BOTH
def test_the_film_moves_and_takes_some_seconds(dim, tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf", dim)
    path = result.animate(tmp_path / "motion.gif", frames=8)
    with Image.open(path) as film:
        assert film.n_frames == 8
        frames, duration = [], 0
        for k in range(8):
            film.seek(k)
            frames.append(np.array(film.convert("RGB")).astype(int))
            duration += film.info["duration"]
    assert 4000 <= duration <= 8000
    for one, other in pairwise(frames):
        assert np.abs(one - other).max() > 100
    # The blank part of the paper stays as it is: nothing of an older frame is left behind.
    assert all(np.array_equal(frame[:3], frames[0][:3]) for frame in frames)


def test_films_that_cannot_be_made_say_why(tmp_path, monkeypatch):
    result = solid_result(tmp_path / "fields.vtkhdf", layers=5)
    with pytest.raises(OutputError, match="choose one of these endings"):
        result.animate(tmp_path / "motion.avi")
    with pytest.raises(OutputError, match="cannot be written"):
        result.animate(tmp_path / "absent/motion.gif")
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingDependencyError, match="pip install imageio-ffmpeg"):
        result.animate(tmp_path / "motion.mp4")
    without = Result(result.scene, result.history, result.summary)
    with pytest.raises(OutputError, match="no fields to show"):
        without.animate(tmp_path / "motion.gif")
    assert set(without.plot()) == {"contact_force", "energy", "motion", "velocity"}


@BOTH
def test_the_skin_is_closed_and_looks_outward(dim, tmp_path):
    skin = Skin.of(solid_result(tmp_path / "fields.vtkhdf", dim, layers=2).fields)
    rest = skin.points - skin.points.mean(axis=0)
    if dim == 3:
        normal = normals(skin.points, skin.triangles)
        assert normal.sum(axis=0) == pytest.approx(0.0, abs=1e-12)
        assert np.einsum("ij,ij->i", normal, rest[skin.triangles].mean(axis=1)).min() > 0.0
    else:
        a, b = rest[skin.segments[:, 0]], rest[skin.segments[:, 1]]
        assert (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).min() > 0.0  # counter-clockwise
        assert np.array_equal(np.sort(skin.segments[:, 0]), np.sort(skin.segments[:, 1]))


@pytest.mark.parametrize("axes", ["x", "xz", "xyz"])
def test_a_part_is_shown_with_its_mirror_images(tmp_path, axes):
    """As a closed surface round the whole; opened, cut faces close it where a part is left out."""
    from impactfem.result.shapes import Shape
    from impactfem.result.spool import FieldSpool

    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    points = np.concatenate([corners, corners + np.eye(3)[2]]) + 1.0
    with FieldSpool(tmp_path / "f.vtkhdf", [Shape("body", points, [list(range(8))], 12)]) as spool:
        moved = 0.1 * (points - 1.0)
        spool.append(0.0, {"displacement": moved, "velocity": moved, "von_mises": np.arange(8.0),
                           "contact_pressure": np.ones(8), "gap": np.zeros(8),
                           "contact_force": 0 * points, "active": np.ones(8)})  # fmt: skip
    fields = StoredSnapshots(tmp_path / "f.vtkhdf")
    whole = Whole(tuple((axis, 1.0) for axis in axes))

    def volume(skin):
        place = skin.snapshot(0).place
        normal = normals(place, skin.triangles)
        assert normal.sum(axis=0) == pytest.approx(0.0, abs=1e-12)
        return np.einsum("ij,ij->", place[skin.triangles].mean(axis=1), normal) / 6.0

    assert volume(Skin.of(fields)) == pytest.approx(1.1**3)
    closed = Skin.of(fields, whole)
    assert volume(closed) == pytest.approx(whole.factor * 1.1**3)
    assert not closed.bodies.any()
    assert closed.snapshot(0).von_mises.sum() == whole.factor * 28.0
    opened = Skin.of(fields, whole, np.array([0.5, 0.3, 0.8]))
    assert opened.snapshot(0).von_mises.sum() == whole.factor * 28.0
    opened = Skin.of(fields, whole, np.array([-0.5, -0.3, -0.8]))  # the computed part is left out
    assert opened.snapshot(0).von_mises.sum() == whole.factor * 28.0
    opened = Skin.of(fields, whole, np.array([0.5, 0.3, 0.8]))
    assert opened.opened is (len(axes) > 1)
    assert volume(opened) == pytest.approx((whole.factor - opened.opened) * 1.1**3)
    assert opened.opened is not bool((opened.snapshot(0).place[opened.nodes] > 1.05).all(1).any())


SHIFT = ["0.1*sin(10*t)", "0.2*t", "0"]
IN_SPACE = {
    "ball": RigidSphere(name="o", center=[0.0, -1.0, 0.1], radius=1.0, motion=SHIFT),
    "bowl": RigidSphere(name="o", center=[0.0, 1.2, 0.0], radius=1.2, side="inside"),
    "box": RigidBox(name="o", center=[0.0, -0.2, 0.0], size=[1.0, 0.4, 0.6], angle=0.3),
    "bar": RigidCylinder(name="o", point=[0.0, -0.3, 0.0], axis=[0.0, 0.0, 2.0], radius=0.3),
    "bore": RigidCylinder(
        name="o", point=[0.0, 0.6, 0.0], axis=[1.0, 0.0, 1.0], radius=0.7, side="inside"
    ),
    "chute": RigidPolyline(name="o", points=[[-1.0, 0.5], [-0.3, 0.0], [0.3, 0.0], [1.0, 0.5]]),
}


@pytest.mark.parametrize("obstacle", IN_SPACE.values(), ids=IN_SPACE)
def test_faces_of_obstacles_lie_where_the_gap_is_zero_and_look_to_the_body(obstacle):
    from impactfem.contact.distance import signed_distance

    faces = obstacle.faces(np.array([0.0, 0.6, 0.0]), 2.0)
    gap, direction = signed_distance(obstacle, faces.reshape(-1, 3), 0.0)
    assert gap == pytest.approx(0.0, abs=1e-12)
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    middle = faces.mean(axis=1) + 1e-2 * normal
    assert np.all(signed_distance(obstacle, middle[np.abs(normal).max(axis=1) > 0], 0.0)[0] > 0.0)
    assert np.isfinite(direction).all()


@pytest.mark.slow
@pytest.mark.parametrize("obstacle", IN_SPACE.values(), ids=IN_SPACE)
def test_obstacles_in_space_are_drawn(obstacle, tmp_path):
    wall = HalfSpace(name="wall", point=[0.0, 3.0, 0.0], normal=[0.0, -1.0, 0.0])
    result = solid_result(tmp_path / "fields.vtkhdf", 3, layers=5, obstacles=[obstacle, wall])
    result.plot()["body"].savefig(tmp_path / "body.png", dpi=40)
    alone = solid_result(tmp_path / "alone.vtkhdf", 3, layers=5, obstacles=[wall])
    alone.plot()["body"].savefig(tmp_path / "alone.png", dpi=40)
    with Image.open(tmp_path / "body.png") as one, Image.open(tmp_path / "alone.png") as other:
        different = np.any(np.array(one.convert("RGB")) != np.array(other.convert("RGB")), axis=2)
    assert different.mean() > 0.02


def test_a_body_hides_the_floor_and_a_ball_before_it_hides_the_body(tmp_path):
    """What is nearer to the viewer is drawn later."""
    in_front = RigidSphere(name="o", center=[0.0, 0.6, 3.0], radius=0.2)
    result = solid_result(tmp_path / "fields.vtkhdf", 3, layers=2, obstacles=[in_front])
    skin = Skin.of(result.fields)
    painter, _ = survey(result, skin, [skin.snapshot(0)])
    assert painter.camera.towards @ [0.0, 0.0, 1.0] > 0.5
    from matplotlib.figure import Figure

    axes = Figure().subplots()
    polygons = painter.draw(axes, skin.snapshot(0))[-1]
    colours = polygons.get_facecolor()
    grey = np.ptp(colours[:, :3], axis=1) < 1e-9
    assert grey.any()
    assert np.flatnonzero(grey).min() > np.flatnonzero(~grey).max()


def test_a_moving_obstacle_moves_in_the_plane(tmp_path):
    floor = HalfSpace(name="o", point=[0.0, 0.0], normal=[0.0, 1.0], motion=["0", "-0.2*t"])
    result = solid_result(tmp_path / "fields.vtkhdf", obstacles=[floor])
    panels = [a for a in result.plot()["body"].axes if a.get_title().startswith("t = ")]
    for axes, layer in zip(panels, shown_layers(result), strict=True):
        filled = min(axes.collections, key=lambda c: c.get_zorder())
        top = np.concatenate([path.vertices for path in filled.get_paths()])[:, 1].max()
        assert top == pytest.approx(-0.2 * result.fields.times[layer], abs=1e-9)


def test_force_beside_the_film_is_that_of_the_history(tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf")
    stairs = result.plot()["contact_force"].axes[0].patches[0].get_data()
    assert stairs.values.max() == pytest.approx(PEAK_FORCE, rel=1e-2)

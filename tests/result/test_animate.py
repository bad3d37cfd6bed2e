"""Films and grids show where bodies are."""

import sys
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.animation import FuncAnimation
from matplotlib.collections import PolyCollection
from PIL import Image

import impactfem
from impactfem.errors import MissingDependencyError, OutputError, SceneError
from impactfem.report.animation import film_if_any
from impactfem.report.axis_film import axis_reel
from impactfem.report.body_film import body_reel
from impactfem.report.film import even_moments
from impactfem.report.line_film import line_reel
from impactfem.result import KeptSnapshots, Shape
from impactfem.shipped import shipped_scenes


def solved(name, **settings):
    scene = impactfem.Scene.from_toml(shipped_scenes()[name])
    return impactfem.solve(scene.with_settings(settings))


def floor(**more):
    return impactfem.HalfSpace(name="floor", **more)


def rod_run(duration=0.6):
    rod = impactfem.Rod(name="rod", mass=1.0, length=0.5, center=[0.0, 0.6], inclination=0.5)
    scene = impactfem.Scene(
        title="Rod", duration=duration, gravity=[0.0, -9.81], bodies=[rod],
        obstacles=[floor(point=[0.0, 0.0], normal=[0.0, 1.0])],
        contacts=[impactfem.Contact(between=["rod", "floor"], restitution=0.5)],
    )  # fmt: skip
    return impactfem.solve(scene)


def points_run(dim):
    up = [0.0] * (dim - 1)
    moving = {"motion": ["0"] * (dim - 1) + ["0.05*sin(10*t)"]} if dim == 2 else {}
    ball = impactfem.Point(
        name="ball", mass=1.0, position=[*up, 0.5], radius=0.05 * (dim < 3), velocity=[*up, 0.0]
    )
    scene = impactfem.Scene(
        title="Ball", duration=1.0, gravity=[*up, -9.81], bodies=[ball],
        obstacles=[floor(point=[0.0] * dim, normal=[*up, 1.0], **moving)],
    )  # fmt: skip
    return impactfem.solve(scene, method="moreau_jean", dt=2e-3)


RUNS = {
    "bar": lambda: solved("bar_impact_between"),
    "row": lambda: solved("two_bars"),
    "point 1D": lambda: points_run(1),
    "point 2D": lambda: points_run(2),
    "point 3D": lambda: points_run(3),
    "rod": rod_run,
    "beam": lambda: solved("dropped_beam", duration=2e-4),
    "solid": lambda: solved("elastic_sphere", **{"solve.estimate": False, "duration": 1e-3}),
}


@pytest.fixture(scope="module", params=RUNS)
def run(request):
    return RUNS[request.param]()


@pytest.mark.slow
def test_every_body_is_filmed(run, tmp_path):
    path = run.animate(tmp_path / "motion.gif", frames=5)
    with Image.open(path) as film:
        assert film.n_frames == 5
        frames = []
        for k in range(5):
            film.seek(k)
            frames.append(np.array(film.convert("RGB")).astype(int))
    for one, other in pairwise(frames):
        assert np.abs(one - other).max() > 100
    assert np.abs(frames[0] - frames[-1]).mean() < 30  # most of the paper stays as it is


def test_a_film_without_a_path_shows_itself(run):
    film = run.animate(frames=3)
    assert isinstance(film, FuncAnimation)
    page = film._repr_html_()
    assert page.count("iVBORw0KGgo") == 3  # PNG, in letters
    assert 'max="2"' in page
    assert "http" not in page


def test_a_film_saved_by_matplotlib_is_the_same_motion(tmp_path):
    rod_run(0.1).animate(frames=4).save(tmp_path / "film.gif", writer="pillow")
    with Image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == 4


def test_bars_are_where_their_nodes_are():
    result = solved("bar_impact_between")
    reel = line_reel(result, result.fields, 9)
    for moment, time in enumerate(reel.times):
        layer = int(np.abs(result.fields.times - time).argmin())
        place = result.fields.positions + result.fields.displacement[layer]
        assert reel.near[moment, 0] == pytest.approx(place[0], abs=1e-12)
        assert reel.far[moment, -1] == pytest.approx(place[-1], abs=1e-12)
    # The wave behind its front carries rho c v0 = 0.5 Pa, pressed.
    assert reel.stress.min() == pytest.approx(-0.5, rel=1e-9)


def test_bars_of_a_row_keep_apart_and_touch_in_the_picture():
    result = solved("two_bars")
    reel = line_reel(result, result.fields, 31)
    second = reel.first[1]
    gap = reel.near[:, second] - reel.far[:, second - 1]
    pair = np.interp(reel.times, result.history["time"], result.history["gap.short.long"])
    assert np.allclose(gap, 200.0 * pair, atol=1e-6)


def test_points_are_where_the_history_says():
    result = points_run(2)
    reel = body_reel(result, result.fields, 7)
    for moment, layer in enumerate(reel.layers):
        artists = reel.show(moment)
        time = float(result.fields.times[layer])
        row = int(np.abs(result.history["time"].values - time).argmin())
        place = np.array([result.history[f"ball.{c}"].values[row] for c in "xy"])
        (ball,) = (a for a in artists if isinstance(a, PolyCollection) and a.get_zorder() == 2.5)
        disc = ball.get_paths()[0].vertices[:-1]
        assert np.allclose(np.hypot.reduce(disc - place, axis=1), 0.05)
        assert np.allclose(reel.trails.get_segments()[0][-1], place)
        assert list(reel.now.get_xdata()) == [time, time]


def test_points_on_a_line_are_as_wide_as_they_are():
    result = points_run(1)
    reel = line_reel(result, result.fields, 7)
    assert np.allclose(reel.far - reel.near, 0.1)
    layers = even_moments(result.fields.times, 7)
    assert np.allclose(reel.near[:, 0], result.fields.places("ball")[layers, 0, 0] - 0.05)


def test_ends_of_a_rod_are_as_far_from_the_floor_as_its_gaps_say():
    result = rod_run()
    fields, history = result.fields, result.history
    places = fields.places("rod")
    gap = np.interp(fields.times, history["time"], history["gap.rod.floor"])
    assert np.allclose(places[:, :, 1].min(axis=1), gap, atol=1e-12)
    assert np.allclose(np.hypot.reduce(np.diff(places, axis=1)[:, 0], axis=1), 0.5, rtol=1e-12)
    # Ends turn about the centre: v = v_c + w x r.
    speed = fields.over_time("velocity")
    assert np.allclose(speed.mean(axis=1)[:, 1], np.interp(
        fields.times, history["time"], history["rod.vy"]), atol=1e-12)  # fmt: skip
    arm, turn = np.diff(places, axis=1)[:, 0], np.diff(speed, axis=1)[:, 0]
    assert np.abs(np.einsum("ij,ij->i", arm, turn)).max() < 1e-12 * np.abs(turn).max()
    assert np.abs(turn).max() > 0.1


def test_a_beam_moves_above_its_floor():
    result = solved("dropped_beam", duration=2e-4)
    reel = axis_reel(result, result.fields, 5)
    contact = reel.figure.axes[0].lines[0].get_ydata()  # where the floor would be touched
    assert contact[0] == pytest.approx(-6e-6, abs=1e-9)
    assert (result.fields.places()[:, :, 1].min(axis=1) >= -1e-9).all()
    assert (reel.curves[:, 0, 1] >= contact[0] - 1e-9).all()
    assert reel.curves[0, :, 1] == pytest.approx(0.0)


def test_points_are_vertices_with_their_radius():
    result = points_run(2)
    fields, history = result.fields, result.history
    layout = fields.layout
    assert (layout.names, layout.types.tolist(), layout.radius.tolist()) == (("ball",), [1], [0.05])
    rows = np.abs(history["time"].values[None] - fields.times[:, None]).argmin(axis=1)
    assert np.allclose(fields.places("ball")[:, 0, 1], history["ball.y"].values[rows], rtol=1e-14)
    speed = fields.over_time("velocity", "ball")[:, 0, 1]
    assert np.allclose(speed, history["ball.vy"].values[rows], rtol=1e-14, atol=1e-14)


def test_fields_are_saved_and_loaded(tmp_path):
    result = rod_run(0.1)
    again = impactfem.Result.load(result.save(tmp_path / "rod", pictures=False))
    assert np.array_equal(again.fields.places("rod"), result.fields.places("rod"))
    assert np.array_equal(again.fields.over_time("velocity"), result.fields.over_time("velocity"))
    assert again.animate(tmp_path / "rod.gif", frames=2).exists()


def test_what_cannot_be_filmed_says_why(tmp_path):
    result = solved("bar_impact_between")
    without = impactfem.Result(result.scene, result.history, result.summary)
    with pytest.raises(OutputError, match="no fields to show"):
        without.animate()
    assert film_if_any(without, tmp_path / "motion.gif") is None
    result.fields.displacement[:] = np.nan
    with pytest.raises(OutputError, match="no frame is finite"):
        result.animate(tmp_path / "motion.gif")
    with pytest.raises(OutputError, match="choose one of these endings"):
        result.animate(tmp_path / "motion.png")


@pytest.fixture(scope="module")
def disc():
    return RUNS["solid"]()


def test_a_grid_holds_the_fields_of_its_layer(disc):
    pytest.importorskip("pyvista")
    fields = disc.fields
    grid = fields.grid(2)
    assert {*fields.point_data, "radius"} == set(grid.point_data.keys())
    for name, values in fields.read(2).items():
        assert np.array_equal(np.asarray(grid.point_data[name]), values, equal_nan=True)
    assert np.allclose(grid.points, fields.points)
    assert grid.field_data["time"][0] == fields.times[2]
    assert fields.grid().field_data["time"][0] == fields.times[-1]
    # Half a disc of radius 20 mm, the section of the ball.
    assert grid.compute_cell_sizes()["Area"].sum() == pytest.approx(0.5 * np.pi * 0.02**2, rel=0.02)


def test_the_mesh_at_a_time_is_the_deformed_body(disc):
    pytest.importorskip("pyvista")
    fields = disc.fields
    middle = float(fields.times[3])
    step = float(np.diff(fields.times).min())
    mesh = disc.mesh_at(middle + 0.3 * step)
    place = fields.points + fields.read(3)["displacement"]
    assert np.allclose(mesh.points, place, atol=1e-9)
    assert mesh.field_data["time"][0] == middle


def test_bars_give_grids_too():
    pytest.importorskip("pyvista")
    result = solved("two_bars")
    grid = result.mesh_at(1e-3)
    layer = int(np.abs(result.fields.times - 1e-3).argmin())
    assert grid.n_cells == len(result.fields.starts)
    assert np.allclose(
        grid.points[:, 0], result.fields.positions + result.fields.displacement[layer]
    )
    lengths = grid.compute_cell_sizes()["Length"]
    assert lengths.sum() == pytest.approx(3.0, rel=1e-3)


def test_times_beyond_the_fields_are_told(disc):
    with pytest.raises(SceneError, match=r"time = 7 s: the fields are from 0 to"):
        disc.fields.grid(time=7.0)
    with pytest.raises(IndexError):
        disc.fields.grid(10_000)


def test_a_result_without_fields_has_no_mesh():
    result = points_run(1)
    assert result.mesh_at(0.1).n_cells == 1
    without = impactfem.Result(result.scene, result.history, result.summary)
    with pytest.raises(OutputError, match="has no fields"):
        without.mesh_at(0.1)


def test_without_pyvista_it_is_told_how_to_get_it(disc, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)
    for asked in (disc.fields.grid, lambda: disc.mesh_at(0.0), lambda: disc.plotter(0.0)):
        with pytest.raises(MissingDependencyError, match="pip install pyvista"):
            asked()


def test_a_plotter_shows_tubes_and_balls():
    pytest.importorskip("pyvista")
    from impactfem.result.grids import thickened

    line = Shape.line("rod", [[0.0, 0.0], [1.0, 0.0]], 0.1)
    balls = Shape.vertices("ball", [[0.0, 2.0]], 0.5)
    tip = Shape.vertices("tip", [[3.0, 2.0]])
    still = {name: np.zeros((1, 4, 3)) for name in ("displacement", "velocity")}
    kept = KeptSnapshots(np.zeros(1), [line, balls, tip], still)
    point, rod, ball = thickened(kept.grid(), kept.layout)
    assert rod.bounds[2:4] == pytest.approx((-0.1, 0.1), abs=1e-3)
    assert ball.bounds[:4] == pytest.approx((-0.5, 0.5, 1.5, 2.5), abs=1e-2)
    assert point.n_points == 1
    assert all("velocity" in part.point_data for part in (rod, ball, point))


@pytest.mark.parametrize("frames", [1, 2, 7, 60, 5000])
def test_moments_are_the_rows_nearest_to_even_times(frames):
    times = np.cumsum(np.random.default_rng(3).random(1000)) + 5.0
    wanted = np.linspace(times[0], times[-1], min(frames, len(times)))
    nearest = np.unique(np.abs(times[None] - wanted[:, None]).argmin(axis=1))
    assert np.array_equal(even_moments(times, frames), nearest)
    assert even_moments(times[:1], frames).tolist() == [0]

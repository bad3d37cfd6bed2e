"""The view by pyvista: what it shows, and how it is asked for. VTK may not draw where tests run."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from synthetic import CONTACT, PEAK_FORCE, PEAK_PRESSURE, RADIUS, solid_result

import impactfem
from impactfem.cli import main
from impactfem.report import view
from impactfem.report.palette import fill, tint
from impactfem.result import KeptSnapshots, Shape
from impactfem.result.grids import drawing_fault
from impactfem.scene import RigidBox, Scene

pyvista = pytest.importorskip("pyvista")
SHIPPED = Path(impactfem.__file__).parent / "scenes"


class Paper:
    """A plotter that keeps what it is given."""

    def __init__(self, off_screen=None):
        self.off_screen, self.meshes, self.styles, self.calls = off_screen, {}, {}, []

    def add_mesh(self, mesh, name, **style):
        self.meshes[name], self.styles[name] = mesh, style
        return self

    def add_text(self, text, **_):
        self.text = text

    def remove_actor(self, name):
        del self.meshes[name]

    def add_slider_widget(self, callback, ends, **_):
        self.slide, self.ends = callback, ends

    def __getattr__(self, name):
        self.calls.append(name)
        return self if name == "mapper" else lambda *_, **__: None


@pytest.fixture
def paper(monkeypatch):
    monkeypatch.setattr(pyvista, "Plotter", Paper)


@pytest.mark.usefixtures("paper")
@pytest.mark.parametrize("dim", [2, 3])
def test_bodies_obstacles_and_forces_are_shown(dim, tmp_path):
    box = RigidBox(name="box", center=[1.0, 0.3, 0.0][:dim], size=[0.4] * dim)
    floor = solid_result(tmp_path / "none.vtkhdf", dim).scene.obstacles[0]
    result = solid_result(tmp_path / "fields.vtkhdf", dim, obstacles=[floor, box])
    made, layer = view.make_view(result)
    shown = made.plotter
    assert result.fields.times[layer] == pytest.approx(np.mean(CONTACT))
    parts = {"body", "obstacle", "forces"} | ({"edges"} if dim == 2 else set())  # a ball has none
    assert {name.partition(" ")[0] for name in shown.meshes} == parts
    places = result.fields.places()[layer]
    body = shown.meshes["body 0 0"]
    assert np.asarray(body.points)[:, :dim] == pytest.approx(places[:, :dim])
    assert shown.styles["body 0 0"]["scalars"] == "von_mises"
    assert shown.styles["body 0 0"]["clim"][1] <= PEAK_PRESSURE
    ground = [mesh for name, mesh in shown.meshes.items() if name.startswith("obstacle floor")]
    assert max(mesh.bounds[3] for mesh in ground) == pytest.approx(0.0, abs=0.02)
    assert shown.meshes["obstacle box 0"].bounds[0] == pytest.approx(0.8, abs=0.02)
    assert ("view_xy" in shown.calls) is (dim == 2)
    arrow = shown.meshes["forces"]
    assert arrow.bounds[2] == pytest.approx(0.0, abs=0.01)
    assert arrow.bounds[3] > 0.2 * 2.0 * RADIUS
    assert f"{PEAK_FORCE:.4g} N" in shown.text
    made.add_slider(layer)
    shown.slide(0.0)
    assert "forces" not in shown.meshes
    assert "t = 0 s" in shown.text
    first = np.asarray(shown.meshes["body 0 0"].points)[:, :dim]
    assert first == pytest.approx(result.fields.places()[0, :, :dim])


@pytest.mark.usefixtures("paper")
def test_parts_are_shown_with_their_images_and_one_spot_spoils_no_colours(tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf")
    half = result.with_summary(
        {**result.summary, "details": {"symmetry_planes": {"x": 0.75}, "symmetry_factor": 2}}
    )
    shown = view.make_view(half, 0.0, "displacement")[0].plotter
    assert shown.meshes["body 0 1"].bounds[:2] == pytest.approx((1.0, 2.0), abs=1e-6)
    speeds = np.ones((2, 100, 3))
    speeds[:, 7] = 1e6
    line = Shape.line("bar", np.linspace(0.0, 1.0, 100)[:, None])
    kept = KeptSnapshots(
        np.array([0.0, 1.2]), [line], {"displacement": 0 * speeds, "velocity": speeds}
    )
    scene = Scene.from_toml(SHIPPED / "bar_impact.toml")
    bar = impactfem.Result(scene, result.rows, result.summary, kept)
    made = view.make_view(bar, 0.0)[0]
    assert made.plotter.styles["body 0 0"]["clim"] == pytest.approx((0.0, 3.0**0.5))
    wall = made.plotter.meshes["obstacle wall 0"]
    assert wall.bounds[1] == pytest.approx(0.0)
    low, high = made.plotter.meshes["body 0 0"].bounds[2:4]
    assert 0.01 < high - low < 0.05


@pytest.mark.usefixtures("paper")
def test_rigid_bodies_have_their_colours_unless_a_field_is_asked_for():
    block = {"kind": "rigid", "name": "block", "mass": 1.0, "velocity": [1.0, 0.0],
             "shape": {"kind": "block", "size": [2.0, 1.0]}}  # fmt: skip
    scene = Scene.from_dict({
        "title": "flying", "duration": 0.1, "body": [block], "solve": {"dt": 0.01},
        "output": {"fields": ["vtkhdf"], "pictures": False, "film": False, "report": False},
    })  # fmt: skip
    result = impactfem.solve(scene)
    shown = view.make_view(result, 0.0)[0].plotter
    assert shown.styles["body 0 0"]["color"] == pytest.approx(fill(0))
    assert shown.styles["edges 0"]["color"] == pytest.approx(tint(0))
    assert shown.meshes["edges 0"].length == pytest.approx(np.hypot(2.0, 1.0))
    asked = view.make_view(result, 0.0, "velocity")[0].plotter
    assert asked.styles["body 0 0"]["scalars"] == "velocity"


@pytest.mark.usefixtures("paper")
def test_points_rods_and_beams_have_views():
    for name in ("oscillator", "corner", "dropped_beam"):
        scene = Scene.from_toml(SHIPPED / f"{name}.toml").with_settings(
            {"output.fields": ["vtkhdf"]}
        )
        result = impactfem.solve(scene)
        shown = result.plotter(scene.duration).meshes
        assert {part.partition(" ")[0] for part in shown} == {"body", "obstacle"}, name


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("view")
    result = solid_result(place / "fields.vtkhdf")
    return result.save(place / "out", pictures=False)


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        ([], 1, "--out picture.png"),
        (["--out", "a.jpg"], 2, ".png"),
        (["--out", "a.png", "--at", "7"], 2, "time = 7 s"),
        (["--out", "a.png", "--at", "nan"], 2, "time = nan s"),
        (["--out", "a.png", "--field", "von_mise"], 2, "von_mises"),
        (["--out", "nowhere/a.png"], 1, "cannot be written"),
    ],
)
def test_bad_input_is_told(folder, words, code, told, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(view, "drawing_fault", lambda: "")
    monkeypatch.setattr(pyvista, "Plotter", type("Torn", (Paper,), {"screenshot": _refuse}))
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(view.sys, "platform", "linux")
    monkeypatch.chdir(tmp_path)
    assert main(["show", str(folder), *words]) == code
    assert told in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def _refuse(_, path):
    raise FileNotFoundError(2, "No such file or directory", str(path))


def test_what_cannot_be_shown_is_told(folder, monkeypatch, capsys, tmp_path):
    assert main(["show", str(tmp_path), "--out", "a.png"]) == 2
    assert "no complete result" in capsys.readouterr().err
    monkeypatch.setattr(view, "drawing_fault", lambda: "cannot draw here")
    assert main(["show", str(folder), "--out", "a.png"]) == 1
    assert "impactfem plot" in capsys.readouterr().err
    monkeypatch.setattr(view, "drawing_fault", lambda: "")
    monkeypatch.setitem(view.sys.modules, "pyvista", None)
    assert main(["show", str(folder), "--out", "a.png"]) == 1
    assert "pip install pyvista" in capsys.readouterr().err
    (folder / "fields.vtkhdf").rename(tmp_path / "away.vtkhdf")
    assert main(["show", str(folder), "--out", "a.png"]) == 1
    assert 'output.fields = ["vtkhdf"]' in capsys.readouterr().err
    (tmp_path / "away.vtkhdf").rename(folder / "fields.vtkhdf")


@pytest.mark.slow
def test_a_picture_is_drawn_without_a_display(folder, tmp_path, monkeypatch):
    if fault := drawing_fault():
        pytest.skip(f"VTK {fault}")
    monkeypatch.setattr(view, "drawing_fault", lambda: "")
    assert main(["show", str(folder), "--out", str(tmp_path / "a.png")]) == 0
    picture = np.array(Image.open(tmp_path / "a.png").convert("RGB"))
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 100

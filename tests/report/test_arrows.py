"""Contact forces as arrows: those that act, one for each patch that is pressed."""

import numpy as np
import pytest
from matplotlib.quiver import Quiver
from synthetic import PEAK_FORCE, solid_result

import impactfem
from impactfem.report.arrows import once, resultants
from impactfem.report.body_film import body_reel

CHAIN = np.stack([np.arange(9), np.arange(9) + 1], axis=1)


def on_a_line(count):
    return np.stack([np.arange(float(count)), np.zeros(count), np.zeros(count)], axis=1)


def test_patches_have_one_arrow_each_where_the_forces_act():
    forces = np.zeros((10, 3))
    forces[1:4, 1], forces[7:9, 1] = [1.0, 2.0, 3.0], 4.0
    (one, two) = resultants(forces, on_a_line(10), [CHAIN])
    assert one == pytest.approx(np.array([[14.0 / 6.0, 0.0, 0.0], [0.0, 6.0, 0.0]]))
    assert two == pytest.approx(np.array([[7.5, 0.0, 0.0], [0.0, 8.0, 0.0]]))
    assert resultants(0.0 * forces, on_a_line(10), [CHAIN]).shape == (0, 2, 3)


def test_a_ring_that_is_pressed_all_around_is_halved():
    angle = 2.0 * np.pi * np.arange(40) / 40
    places = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    links = np.stack([np.arange(40), (np.arange(40) + 1) % 40], axis=1)
    found = resultants(-places, places, [links])
    assert len(found) == 4
    assert np.linalg.norm(found[:, 1], axis=1) == pytest.approx(9.0, rel=0.01)
    assert np.einsum("ij,ij->i", found[:, 0], found[:, 1]).max() < -7.0


@pytest.mark.parametrize(("first", "arrows"), [(0, 1), (2, 2)])
def test_a_patch_at_a_plane_of_symmetry_is_one_with_its_image(first, arrows):
    forces = np.zeros((10, 3))
    forces[first : first + 2] = [0.5, 1.0, 0.0]
    found = resultants(forces, on_a_line(10), [CHAIN], [(0, 0.0)])
    assert len(found) == arrows
    assert found[:, 1].sum(axis=0) == pytest.approx([0.0, 4.0, 0.0])
    assert found[:, 0].mean(axis=0) == pytest.approx(0.0)


def shown(axes):
    return [entry for entry in axes.collections if isinstance(entry, Quiver)]


def test_a_pressure_that_is_drawn_has_no_arrow_besides(tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf")
    assert not any(q.N for axes in result.figure("body").axes for q in shown(axes))


@pytest.mark.parametrize("dim", [2, 3])
def test_pictures_and_films_show_the_force_with_its_scale(dim, tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf", dim)
    if dim == 2:  # with friction the pressure does not say it all
        rubs = {"between": ["body", "floor"], "friction_coefficient": 0.1}
        scene = impactfem.Scene.from_dict(result.scene.to_dict() | {"contact": [rubs]})
        result = impactfem.Result(scene, result.history, result.summary, result.fields)
    figure = result.figure("body")
    panels = [axes for axes in figure.axes if axes.get_title().startswith("t = ")]
    lengths = [np.hypot(*np.array([q.U, q.V])).max() for axes in panels for q in shown(axes) if q.N]
    force = result.rows["contact_force"].values
    assert lengths
    assert f"{PEAK_FORCE:.4g} N" in figure.legends[0].get_texts()[-1].get_text()
    reel = body_reel(result, result.fields, 13)
    peak = int(np.argmax(force[reel.layers]))
    (drawn,) = (artist for artist in reel.show(peak) if isinstance(artist, Quiver))
    assert drawn.N == 1
    assert np.hypot(drawn.U, drawn.V)[0] == pytest.approx(max(lengths), rel=0.02)
    assert "arrows" in reel.panel.get_title()


def test_forces_on_nodes_sum_up_to_those_of_the_history():
    """Of a solid and a ball on a floor with friction, in the field file and in the columns."""
    scene = impactfem.Scene.from_dict(
        {
            "title": "Forces",
            "duration": 6e-3,
            "gravity": [0.0, -9.81],
            "body": [
                {
                    "kind": "solid", "name": "block", "model": "plane_strain", "mesh_size": 0.05,
                    "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [0.0, 0.0]},
                    "density": 1000.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3,
                    "velocity": [0.5, -0.1],
                },
                {
                    "kind": "point", "name": "ball", "mass": 0.5, "radius": 0.02,
                    "position": [-0.021, 0.02], "velocity": [1.5, 0.0],
                },
            ],
            "obstacle": [
                {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
            ],
            "contact": [
                {"between": ["block", "floor"], "friction_coefficient": 0.3},
                {"between": ["ball", "floor"], "friction_coefficient": 0.1},
                {"between": ["ball", "block"]},
            ],
            "solve": {"dt": 1e-4, "estimate": False},
            "output": {"every": 1},
        }
    )  # fmt: skip
    result = impactfem.solve(scene)
    rows = result.rows
    floor = {name: rows[f"force.{name}.floor"].values for name in ("block", "ball")}
    rubs = {name: rows[f"tangential_force.{name}.floor"].values for name in ("block", "ball")}
    between = rows["force.ball.block"].values
    scale = max(values.max() for values in (*floor.values(), between))
    on_all = result.fields.over_time("contact_force").sum(axis=1)
    assert on_all[:, 0] == pytest.approx(rubs["block"] + rubs["ball"], abs=1e-9 * scale)
    assert on_all[:, 1] == pytest.approx(floor["block"] + floor["ball"], abs=1e-9 * scale)
    for name, sign in (("block", 1.0), ("ball", -1.0)):  # the face of the block tilts a little
        on_it = result.fields.over_time("contact_force", name).sum(axis=1)
        assert on_it[:, 0] == pytest.approx(rubs[name] + sign * between, abs=1e-3 * scale)
        assert on_it[:, 1] == pytest.approx(floor[name], abs=1e-2 * scale)
        assert floor[name].max() > 0.0
        assert np.abs(rubs[name]).max() > 0.0
    assert between.max() > 0.0


def test_each_force_is_drawn_once():
    """Without the reaction on the other body; a patch in pieces has one arrow."""
    push = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 3.0]])
    back = np.array([[0.001, 0.0, 0.0], [0.0, 0.0, -3.0]])
    piece = np.array([[0.03, 0.0, 0.0], [0.0, 0.3, 1.0]])
    far = np.array([[0.9, 0.0, 0.0], [0.0, 0.0, -3.0]])
    assert once(np.array([push, back, far]), 1.0) == pytest.approx(np.array([push, far]))
    (joined,) = once(np.array([push, piece]), 1.0)
    assert joined[1] == pytest.approx([0.0, 0.3, 4.0])
    assert push[0, 0] < joined[0, 0] < piece[0, 0]

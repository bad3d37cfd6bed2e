"""Films and pictures of bodies of several kinds at once: where they are, in what colours."""

from itertools import pairwise

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from PIL import Image
from synthetic import PEAK_PRESSURE, solid_result

from impactfem.facade import Result
from impactfem.report.body_film import body_reel
from impactfem.report.film import write_film
from impactfem.report.skin import Skin
from impactfem.report.solid_figures import survey
from impactfem.report.telling import telling_snapshots
from impactfem.result import FieldSpool, KeptSnapshots, Shape, StoredSnapshots
from impactfem.result.shapes import joined
from impactfem.result.spool import POINT_DATA

BEAM = np.array([[-1.2, 0.4, 0.1], [-0.9, 0.45, 0.0], [-0.7, 0.4, 0.0]])
BALLS = np.array([[0.9, 1.0, 0.3], [1.2, 0.7, -0.2]])
RADII = np.array([0.15, 0.0])


def with_others(folder, dim):
    """A solid beside a beam and two balls, in one file as a march of all would write it."""
    result = solid_result(folder / "alone.vtkhdf", dim, layers=12)
    alone = result.fields
    ((kind, cells),) = alone.layout.blocks.items()
    shapes = [
        Shape("body", alone.points, cells, kind),
        Shape.line("beam", BEAM[:, :dim], 0.03),
        Shape.vertices("balls", BALLS[:, :dim], RADII),
    ]
    with FieldSpool(folder / "all.vtkhdf", shapes) as spool:
        for layer, time in enumerate(alone.times):
            way = [np.outer(size, np.arange(1.0, 4.0)[:dim] * time) for size in ([1, 2, 1], [3, 4])]
            slender = [{"displacement": 0.1 * each, "velocity": 0.1 * each} for each in way]
            spool.append(time, joined([alone.read(layer), *slender], POINT_DATA))
    fields = StoredSnapshots(folder / "all.vtkhdf")
    return Result(result.scene, result.history, result.summary, fields)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_film_shows_bodies_of_all_kinds_where_they_are(dim, tmp_path):
    result = with_others(tmp_path, dim)
    reel = body_reel(result, result.fields, 5)
    artists = reel.show(3)
    place = np.concatenate([result.fields.places(name) for name in ("beam", "balls")], axis=1)
    flat = reel.painter.camera.flat(place[reel.layers[3]])
    assert len(flat) == 5
    drawn = [a for a in artists if isinstance(a, PolyCollection)]
    polygons = [path.vertices[:-1] for a in drawn for path in a.get_paths()]
    rings = [p for p in polygons if len(p) == 32]
    for middle, radius in zip(flat[3:], RADII, strict=True):
        (disc,) = (r for r in rings if np.allclose(r.mean(axis=0), middle, atol=1e-9))
        wide = radius or np.ptp(disc, axis=0).max() / 2
        assert np.allclose(np.hypot.reduce(disc - middle, axis=1), wide, rtol=1e-6)
    # The beam has its thickness on both sides of its axis, piece by piece.
    for a, b in pairwise(flat[:3]):
        corners = [p for p in polygons if len(p) == 4 and np.allclose(p.mean(axis=0), (a + b) / 2)]
        widths = {round(float(np.hypot(*(p[3] - p[0]))), 9) for p in corners}
        assert 0.06 in widths
    assert np.allclose([s[-1] for s in reel.trails.get_segments()], flat[3:])
    with Image.open(write_film(reel, tmp_path / "motion.gif")) as film:
        assert film.n_frames == 5
    low, high = np.array([reel.panel.get_xlim(), reel.panel.get_ylim()]).T
    for moment in reel.layers:
        ways = reel.painter.camera.flat(place[moment])
        assert ((ways > low) & (ways < high)).all()


def test_one_spot_does_not_spoil_the_colours(tmp_path):
    result = solid_result(tmp_path / "f.vtkhdf", layers=12)
    stored = result.fields
    each = {name: stored.over_time(name) for name in stored.point_data}
    each["von_mises"][:, 7] = 1e3 * PEAK_PRESSURE
    ((kind, cells),) = stored.layout.blocks.items()
    fields = KeptSnapshots(stored.times, [Shape("body", stored.points, cells, kind)], each)
    skin = Skin.of(fields)
    painter, _ = survey(result, skin, map(skin.snapshot, range(len(fields))))
    assert 0.5 * PEAK_PRESSURE < painter.stress[1] <= PEAK_PRESSURE


def test_no_two_panels_in_a_row_are_alike(tmp_path):
    result = solid_result(tmp_path / "f.vtkhdf", layers=49)
    stored = result.fields
    each = {name: stored.over_time(name) for name in stored.point_data}
    rest = int(np.searchsorted(stored.times, 0.7))
    for values in each.values():
        values[rest:] = values[rest]  # it stays where it was
    ((kind, cells),) = stored.layout.blocks.items()
    fields = KeptSnapshots(stored.times, [Shape("body", stored.points, cells, kind)], each)
    skin = Skin.of(fields)
    still = Result(result.scene, result.history, result.summary, fields)
    for given in (result, still):
        panels = telling_snapshots(given, skin if given is still else Skin.of(stored), 6)
        assert len(panels) == 6
        for one, other in pairwise(panels):
            moved = np.abs(one.place - other.place).max() / skin.size
            stressed = np.abs(one.von_mises - other.von_mises).max() / PEAK_PRESSURE
            assert max(moved, stressed) > 2e-2
        assert panels[-1].time == stored.times[-1]


def test_a_film_shows_the_largest_force_and_its_slider_opens_there(tmp_path):
    result = solid_result(tmp_path / "f.vtkhdf", layers=49)
    peak = result.fields.times[np.argmax(result.history["contact_force"].values)]
    reel = body_reel(result, result.fields, 6)
    (opening,) = np.flatnonzero(reel.times == peak)
    assert f'value="{opening}"' in result.animate(frames=6)._repr_html_()

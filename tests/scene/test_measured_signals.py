"""Measured signals and controls of many pieces: tables in formulas."""

from dataclasses import replace

import numpy as np
import pytest

from impactfem import Scene, SceneError, solve
from impactfem.scene.breaks import find_breaks
from impactfem.scene.control import Control
from impactfem.scene.formula import Formula
from impactfem.scene.grammar import naming
from impactfem.scene.jets import motion_at
from impactfem.scene.means import StepMean, mean_of
from impactfem.scene.ranges import range_on

EPS = np.finfo(float).eps
TIMES, VALUES = [0.0, 0.3, 1.0], [0.0, 2.0, -1.0]
SAID = "where(t < 0.3, 2*t/0.3, 2 - 3*(t - 0.3)/0.7)"


def held(force, duration=1.0, **more):
    body = {"kind": "point", "name": "p", "mass": 1.0, "position": [0.0], "force": [force]}
    solve = {"dt": 0.05, "estimate": False}
    return {"title": "p", "duration": duration, "body": [body], "solve": solve} | more


def written(folder, name="f.csv", heading="time,f", times=TIMES):
    rows = [f"{t!r},{v!r}" for t, v in zip(times, VALUES, strict=True)]
    (folder / name).write_text("\n".join([heading, *rows]) + "\n", encoding="utf-8")


@pytest.mark.parametrize("course", ["constant", "linear"])
@pytest.mark.parametrize("pieces", [2, 500])
def test_a_table_is_its_pieces(course, pieces):
    """Values, slopes, means, ranges and breaks against the pieces one by one."""
    rng = np.random.default_rng(pieces)
    values = rng.standard_normal(pieces + (course == "linear"))
    control = Control(name="u", course=course, pieces=pieces, start=values.tolist(), begin=0.1,
                      end=0.9)  # fmt: skip
    with naming({"u": control.tree(1.0)}):
        alone, beside = Formula("u", ("t",)), Formula("2*u + t*q", ("t", "q"))
    edges = control.times(1.0)
    t = rng.random(200)
    room = 1e3 * EPS * np.abs(values).max() * pieces
    assert np.abs(alone(t=t) - control.at(t, 1.0)).max() < room
    assert np.abs([alone.number({"t": each}) - alone(t=each) for each in t]).max() == 0.0
    rate = motion_at(alone, t).rate
    inside = (t > 0.1) & (t < 0.9)
    place = np.searchsorted(edges, t[inside]) - 1
    wanted = np.diff(values)[place] / np.diff(edges)[0] if course == "linear" else 0.0
    assert np.abs(rate[inside] - wanted).max() < room * pieces
    breaks = find_breaks(alone, 1.0)
    assert all(at.before <= edge <= at.after for at, edge in zip(breaks, edges, strict=True))

    low = np.append(t, 0.0)
    high = np.append(t + rng.random(200) ** 4 * (1.0 - t), 1.0)
    least, most, _ = range_on(alone, low, high)
    for k in range(len(low)):
        at = np.concatenate([[low[k], high[k]], edges, np.nextafter(edges, 0.0)])
        seen = alone(t=at[(at >= low[k]) & (at <= high[k])])
        # Beside its own end an interval counts the piece that only touches it.
        assert least[k] <= seen.min() + room
        assert most[k] >= seen.max() - room
        assert least[k] >= values.min(initial=0.0)
        assert most[k] <= values.max(initial=0.0)

    def summed(end):
        width = np.clip(end, edges[:-1], edges[1:]) - edges[:-1]
        if course == "constant":
            return values @ width
        return (values[:-1] + 0.5 * np.diff(values) / np.diff(edges) * width) @ width

    whole = np.array([summed(b) - summed(a) for a, b in zip(low, high, strict=True)])
    assert np.abs((high - low) * mean_of(alone, low, high) - whole).max() < room
    mean = StepMean(beside)(0.05, 0.85, q=3.0)
    assert mean == pytest.approx(2.0 * (summed(0.85) - summed(0.05)) / 0.8 + 3.0 * 0.45, rel=1e-9)


@pytest.mark.parametrize("method", ["event_driven", "moreau_jean"])
def test_a_force_that_was_measured(tmp_path, method):
    """Speed and place at the end, by hand; and the same scene said by a formula."""
    written(tmp_path, heading="time [s], f [N]")
    stop = {"kind": "half_space", "point": [-1.0], "normal": [1.0]}
    solve_by = {"method": method} | ({} if method == "event_driven" else {"dt": 0.05})
    scenes = [
        Scene.from_dict(held(force, solve=solve_by, obstacle=[stop]), base=tmp_path)
        for force in ({"table": "f.csv"}, SAID)
    ]
    assert Scene.from_dict(scenes[0].to_dict(), base=tmp_path) == scenes[0]
    one, two = (solve(scene).history for scene in scenes)
    impulse = 0.3 * 1.0 + 0.7 * 0.5
    assert one["p.vx"].values[-1] == pytest.approx(impulse, abs=1e3 * EPS)
    for name in ("p.x", "p.vx", "kinetic_energy"):
        assert np.abs(one[name].values - two[name].values).max() < 1e4 * EPS


def test_signals_of_bars_gravity_and_controls(tmp_path):
    """Each against the same scene said by formulas, or by hand."""
    written(tmp_path)
    written(tmp_path, "fast.csv", "time [us],f", [0.0, 300.0, 1000.0])
    bar = {"kind": "bar", "name": "b", "length": 1.0, "area": 1e-4, "density": 7800.0,
           "youngs_modulus": 210e9, "gap": 1e-6}  # fmt: skip
    said = "-where(t < 3e-4, 2e3*t/0.3, 2 - 3*(1e3*t - 0.3)/0.7)"
    pushes = {"table": "fast.csv", "formula": "-signal"}, said
    one, two = (
        solve(Scene.from_dict({
            "title": "b", "duration": 1e-3, "body": [bar | {"far_end_force": push}],
            "obstacle": [{"kind": "wall", "name": "w"}], "solve": {"method": "exact"},
        }, base=tmp_path)).history
        for push in pushes
    )  # fmt: skip
    assert np.abs(one["b.x"].values - two["b.x"].values).max() < 1e-18

    pulled = held("0", gravity=[{"table": "f.csv", "formula": "3*signal"}])
    scene = Scene.from_dict(pulled, base=tmp_path)
    assert Scene.from_dict(scene.to_dict(), base=tmp_path) == scene
    fallen = solve(scene).history
    assert fallen["p.vx"].values[-1] == pytest.approx(1.95, rel=1e-12)
    # Steps of 0.05 s see means of them, whose way is right to second order.
    way = 3.0 * (0.3**2 / 3.0 + 0.7 * (0.3 + 0.7 * (2.0 / 2.0 - 3.0 / 6.0)))
    assert fallen["p.x"].values[-1] == pytest.approx(way, abs=3e-3)
    control = {"name": "u", "acts": "body.p.force.x", "pieces": 2, "start": [1.0, 3.0]}
    both = Scene.from_dict(held({"table": "f.csv"}, control=[control]), base=tmp_path)
    assert solve(both).history["p.vx"].values[-1] == pytest.approx(2.65, rel=1e-12)
    kept = both.to_toml(folder=tmp_path / "elsewhere")
    assert str(tmp_path / "f.csv") in kept


def test_bodies_made_anew_find_their_files(tmp_path):
    """As a plan does; a solid in the plane read them where the program was started."""
    written(tmp_path)
    solid = {"kind": "solid", "name": "s", "model": "plane_strain", "density": 1.0,
             "youngs_modulus": 1.0, "poisson_ratio": 0.3, "mesh_size": 0.5,
             "shape": {"kind": "block", "size": [1.0, 1.0], "corner": [0.0, 0.0]},
             "tractions": [{"surface": "right", "value": [{"table": "f.csv"}, "0"]}]}  # fmt: skip
    scene = Scene.from_dict({"title": "s", "duration": 1.0, "body": [solid]}, base=tmp_path)
    assert replace(scene.bodies[0], density=2.0).tractions == scene.bodies[0].tractions


def test_records_that_do_not_fit_are_refused(tmp_path):
    written(tmp_path)
    written(tmp_path, "g.csv", "time,a [g]")
    written(tmp_path, "late.csv", times=[0.1, 0.3, 1.0])
    written(tmp_path, "back.csv", times=[0.0, 0.3, 0.3])
    (tmp_path / "bare.csv").write_text("0,1\n1,2\n", encoding="utf-8")
    for given, duration, words in (
        ({"table": "f.csv"}, 2.0, ["force[0]", "ends at t = 1 s", "lasts 2 s", "duration = 1"]),
        ({"table": "late.csv"}, 1.0, ["begins at t = 0.1 s"]),
        ({"table": "g.csv"}, 1.0, ['in "g"', "in N", "formula"]),
        ({"table": "f.csv", "column": "g"}, 1.0, ['no column "g"', "one of f"]),
        ({"table": "back.csv"}, 1.0, ["do not ascend", "line 4"]),
        ({"table": "bare.csv"}, 1.0, ["no headings"]),
        ({"table": "none.csv"}, 1.0, ["No such file", str(tmp_path)]),
        ({"table": "f.csv", "formula": "sin(signl)"}, 1.0, ["did you mean 'signal'"]),
        ({"table": "f.csv", "colum": "f"}, 1.0, ['no key "colum"']),
    ):
        with pytest.raises(SceneError) as told:
            Scene.from_dict(held(given, duration), base=tmp_path)
        assert all(word in str(told.value) for word in ["body[0].force[0]", *words])
    with pytest.raises(SceneError, match=r"gravity\[0\] = .* ends at t = 1 s"):
        Scene.from_dict(held("0", 2.0, gravity=[{"table": "f.csv"}]), base=tmp_path)

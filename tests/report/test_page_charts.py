"""Charts of the page hold the numbers of the history, and nothing that JSON does not know."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import solid_result

from impactfem import Result, solve
from impactfem.reference.bar import exact_bar
from impactfem.report.error_panel import interpolation_bound
from impactfem.report.page.chart import MOST_POINTS, numbers, thin
from impactfem.report.page.charts import charts
from impactfem.report.panel import is_told
from impactfem.report.panels import panels
from impactfem.report.prefixes import unit_of
from impactfem.scene import Scene
from impactfem.shipped import find_scene

KINDS = ("bar_impact", "two_bars", "oscillator", "corner", "cradle", "dropped_beam", "solid")


@pytest.fixture(scope="module")
def result_of(tmp_path_factory):
    """Results of shipped scenes, made once; "solid" is synthetic."""
    made = {}

    def get(name: str) -> Result:
        if name not in made:
            if name == "solid":
                made[name] = solid_result(tmp_path_factory.mktemp("solid") / "fields.vtkhdf")
            else:
                made[name] = solve(Scene.from_toml(find_scene(name)))
        return made[name]

    return get


def by_name(result: Result) -> dict:
    return {chart.name: chart for chart in charts(result)}


def si(chart, entry: dict) -> dict:
    """A trace in SI units, by the titles of its axes."""
    factors = []
    for axis in ("xaxis", "yaxis"):
        unit = unit_of(chart.figure["layout"][axis]["title"]["text"])
        alone = unit in {"", "1", "m", "s", "N", "J", "m/s", "N s", "kg m/s"}
        factors.append(1.0 if alone else {"n": 1e-9, "µ": 1e-6, "m": 1e-3, "k": 1e3}[unit[0]])
        factors[-1] *= 1e-3 if unit[1:].startswith("g m") else 1.0
    scaled = {
        name: [None if value is None else factor * value for value in entry[name]]
        for name, factor in zip("xy", factors, strict=True)
    }
    return entry | scaled


def trace(chart, name: str) -> dict:
    return si(chart, next(entry for entry in chart.figure["data"] if entry["name"] == name))


@given(
    st.integers(MOST_POINTS + 1, 6 * MOST_POINTS),
    st.lists(st.floats(0.0, 1.0, exclude_max=True), min_size=1, max_size=20, unique=True),
    st.booleans(),
)
def test_thinning_keeps_extremes_of_every_part_and_both_ends(count, places, holes):
    spikes = (count * np.array(places)).astype(int)
    curve = np.sin(np.linspace(0.0, 30.0, count))
    curve[spikes[0]] = 5.0
    curve[spikes[-1]] = -7.0
    if holes:
        curve[::7] = np.nan
    kept = thin(curve)
    assert len(kept) <= MOST_POINTS
    assert kept[0] == 0
    assert kept[-1] == count - 1
    assert (np.diff(kept) > 0).all()
    assert np.nanmax(curve[kept]) == np.nanmax(curve)
    assert np.nanmin(curve[kept]) == np.nanmin(curve)
    # Between neighbours that were kept the curve does not leave their surroundings.
    width = np.ceil(count / (MOST_POINTS // 2 - 1))
    assert np.diff(kept).max() <= 2 * width


def test_short_curves_keep_all_points():
    assert thin(np.zeros(MOST_POINTS)).tolist() == list(range(MOST_POINTS))


@given(st.lists(st.floats(), min_size=1, max_size=50))
def test_numbers_are_plain_with_seven_digits(values):
    found = numbers(values)
    json.dumps(found, allow_nan=False)
    for value, number in zip(values, found, strict=True):
        assert (number is None) == (not np.isfinite(value))
        if number is not None:
            assert number == pytest.approx(value, rel=5.1e-7, abs=1e-320)


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_has_plain_charts_with_units_and_captions(name, result_of):
    result = result_of(name)
    made = charts(result)
    names = [chart.name for chart in made]
    assert {"gap", "energy"} <= set(names)
    # Impacts alone have impulses, and no force.
    assert ("contact_force" in names) == bool(result.history["contact_force"].any())
    assert "contact_force" in names or "impacts" in names
    assert len(set(names)) == len(names)
    for chart in made:
        assert len(json.dumps(chart.figure, allow_nan=False)) < 600_000
        assert chart.caption.endswith(".")
        assert chart.title
        layout = chart.figure["layout"]
        assert chart.figure["data"]
        for axis in ("xaxis", "yaxis"):
            text = layout[axis]["title"]["text"]
            assert "[" in text or text in {"iteration", "relative error"}


@pytest.mark.parametrize("name", KINDS)
def test_force_gap_and_energy_are_those_of_the_history(name, result_of):
    result = result_of(name)
    made, history = by_name(result), result.history
    time = history["time"].values
    shown = [(trace(made["energy"], "total"), "total_energy")]
    if "contact_force" in made:
        force = trace(made["contact_force"], result.summary["method"])
        assert force["line"]["shape"] == "vh"  # the value of row m during (t_{m-1}, t_m]
        shown.append((force, "contact_force"))
    for entry, column in shown:
        assert entry["x"] == pytest.approx(time, rel=1e-6)
        assert entry["y"] == pytest.approx(history[column].values, rel=1e-6)
    gaps = [column for column in history.data_vars if str(column).startswith("gap.")]
    shown = [
        si(made["gap"], entry) for entry in made["gap"].figure["data"] if entry["name"] != "exact"
    ]
    for entry, column in zip(shown, gaps if len(gaps) > 1 else ["gap"], strict=True):
        assert entry["y"] == pytest.approx(history[column].values, rel=1e-6)
    shown = {entry["name"] for entry in made["energy"].figure["data"]} - {"total"}
    for part in ("kinetic", "elastic", "potential"):
        assert (part in shown) == is_told(history[f"{part}_energy"].values)
    assert ("momentum" in made) == is_told(history["momentum"].values)


def test_a_bar_shows_exact_force_waves_and_set_changes(result_of):
    result = result_of("bar_impact")
    made = by_name(result)
    exact = trace(made["contact_force"], "exact")
    assert exact["y"] == pytest.approx(result.exact["contact_force"].values, rel=1e-6)
    heat = made["displacement"].figure["data"][0]
    fields = result.fields
    t = [int(np.abs(fields.times - time).argmin()) for time in heat["x"]]
    x = [int(np.abs(fields.positions - place).argmin()) for place in heat["y"]]
    assert t[0] == 0
    assert t[-1] == len(fields.times) - 1
    assert x[-1] == len(fields.positions) - 1
    shown = np.array(heat["z"])
    assert shown == pytest.approx(fields.displacement[np.ix_(t, x)].T, rel=1e-4)
    changes = made["active_set"].figure["data"][0]["y"]
    assert changes == list(result.summary["active_set"]["set_changes"])


@pytest.mark.parametrize("name", ["gravity_impact", "bar_impact_between"])
def test_the_error_over_time_is_that_against_the_exact_solution(name):
    scene = Scene.from_toml(find_scene(name))
    result = solve(scene, method="newmark")
    chart = by_name(result)["error"]
    exact = exact_bar(scene)
    history = result.history
    time = history["time"].values
    known = np.abs(history["gap"].values - exact.gap(time))
    shown = np.array(trace(chart, "gap, over the largest one")["y"], dtype=float)
    scale = result.exact["gap"].values.max()
    there = np.isfinite(shown) & (known > 0.0)
    assert there.mean() > 0.5
    assert shown[there] * scale == pytest.approx(known[there], rel=1.0)
    assert np.median(np.abs(shown[there] * scale / known[there] - 1.0)) < 0.05
    fine = np.linspace(0.0, time[-1], 400_001)
    bar = scene.bar
    pressing = -bar.density * bar.area * exact.multiplier(fine)
    summed = np.append(0.0, np.cumsum(0.5 * (pressing[1:] + pressing[:-1]) * np.diff(fine)))
    own = np.append(0.0, np.cumsum(history["contact_force"].values[1:] * np.diff(time)))
    wrong = np.abs(own - np.interp(time, fine, summed)) / summed.max()
    shown = np.array(trace(chart, "impulse so far, over all of it")["y"], dtype=float)
    there = np.isfinite(shown)
    assert there.any()
    assert shown[there] == pytest.approx(wrong[there], abs=2e-5)


@given(
    st.lists(st.floats(0.3, 9.7), min_size=1, max_size=3, unique_by=round),
    st.floats(-3.0, 3.0), st.integers(0, 2**31),
)  # fmt: skip
def test_bound_of_interpolation_holds_for_kinks_and_bends(kinks, curvature, seed):
    rng = np.random.default_rng(seed)
    turns = np.abs(rng.normal(size=len(kinks))) * (1.0 if curvature >= 0.0 else -1.0)

    def curve(t):
        bent = sum(k * np.maximum(t - place, 0.0) for k, place in zip(turns, kinks, strict=True))
        return 0.5 * curvature * t**2 + bent

    at = np.linspace(0.0, 10.0, 101)
    inner = rng.uniform(0.2, 9.8, size=200)
    wrong = np.abs(np.interp(inner, at, curve(at)) - curve(inner))
    bound = interpolation_bound(inner, at, curve(at))
    assert (wrong <= bound + 1e-12).all()


def test_a_row_shows_the_force_of_each_pair_and_the_way_of_each_bar():
    result = solve(Scene.from_toml(find_scene("wave_cradle")))
    made = by_name(result)
    pairs = [name for name in result.history.data_vars if str(name).startswith("force.")]
    forces = made["forces"]
    shown = [si(forces, e) for e in forces.figure["data"] if not e["name"].endswith("exact")]
    assert len(shown) == len(pairs) == 5
    for entry, name in zip(shown, pairs, strict=True):
        assert entry["y"] == pytest.approx(result.history[name].values, rel=1e-6)
    # Magnified lines tell true places when hovered over.
    first = trace(made["world_lines"], "striker")
    place = np.interp(first["x"], result.fields.times, result.fields.displacement[:, 0])
    assert first["customdata"] == pytest.approx(place, rel=1e-5, abs=1e-9)


def with_forces(tmp_path, **forces):
    """A result with columns of forces, NAME: the height of a constant one."""
    result = solid_result(tmp_path / "fields.vtkhdf")
    for name, height in forces.items():
        column = result.history["contact_force"].copy(
            data=np.full(len(result.history.time), height)
        )
        result.history[name] = column.assign_attrs(label=name.partition("force.")[2])
    return result


def test_forces_of_many_pairs_name_the_largest_and_keep_the_others_grey(tmp_path):
    heights = {f"force.a{k}.b": float(k) for k in range(1, 9)}
    panel = panels(with_forces(tmp_path, **heights))["forces"]()
    named = {curve.label: curve.colour for curve in panel.curves if curve.named}
    assert list(named) == ["3 others", "a4.b", "a5.b", "a6.b", "a7.b", "a8.b"]
    assert len(set(named.values())) == 6
    assert len(panel.curves) == 8
    assert panel.curves[0].width < panel.curves[-1].width


def test_no_force_is_drawn_twice(tmp_path):
    """That of a single pair is the contact force; components of a tangential force have a size."""
    tangential = {f"tangential_force.a.b{axis}": 3.0 for axis in ("", ".x", ".y", ".z")}
    panel = panels(with_forces(tmp_path, **{"force.a.b": 5.0}, **tangential))["forces"]()
    assert [(curve.label, curve.dashed) for curve in panel.curves] == [("a.b", False)]
    assert (panel.title, panel.y) == ("Tangential forces", "tangential force [N]")
    assert panels(with_forces(tmp_path, **{"force.a.b": 5.0}))["forces"]() is None
    pairs = {"force.a.b": 5.0, "force.a.c": 6.0, "tangential_force.a.c": 2.0}
    panel = panels(with_forces(tmp_path, **pairs))["forces"]()
    assert [(c.label, c.dashed) for c in panel.curves] == [
        ("a.b", False), ("a.c", False), ("a.c, tangential", True),
    ]  # fmt: skip
    assert panel.curves[1].colour == panel.curves[2].colour


def test_impacts_are_vertical_jumps_of_a_phase_portrait(result_of):
    result = result_of("bouncing_ball")
    phase = by_name(result)["phase"].figure["data"][0]
    x, v = np.array(phase["x"]), np.array(phase["y"])
    first = int(np.argmax(np.diff(v)))
    assert x[first : first + 2] == pytest.approx([0.0, 0.0], abs=1e-9)
    speed = np.sqrt(2.0 * 9.81)
    assert v[first : first + 2] == pytest.approx([-speed, 0.8 * speed], rel=1e-6)
    # No line crosses from below to above but at impacts.
    assert np.abs(x[:-1][np.diff(v) > 0.1]).max() < 1e-9


def test_vibro_charts_show_motion_phase_and_impacts(result_of):
    result = result_of("oscillator")
    made = by_name(result)
    dots = made["impacts"].figure["data"][0]
    speeds = dict(zip(dots["x"], dots["y"], strict=True))
    found = result.impacts
    hard = int(np.argmin(found.before))
    assert speeds[float(f"{found.time[hard]:.7g}")] == pytest.approx(-found.before[hard], rel=1e-6)
    assert {"motion", "path"} <= set(by_name(result_of("corner")))


def test_numbers_that_are_not_finite_leave_holes(tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf")
    force = result.history["contact_force"].values
    force[10:] = np.nan
    result.history["total_energy"].values[5] = np.inf
    made = by_name(result)
    shown = made["contact_force"].figure["data"][0]["y"]
    assert shown[9] is not None
    assert shown[10:] == [None] * (len(force) - 10)
    assert trace(made["energy"], "total")["y"][5] is None
    json.dumps([chart.figure for chart in made.values()], allow_nan=False)


def test_nothing_but_noise_still_makes_a_page(tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf")
    for name in result.history.data_vars:
        if name != "active":
            result.history[name].values[:] = np.nan
    json.dumps([chart.figure for chart in charts(result)], allow_nan=False)


def test_iterates_of_an_active_set_are_shown_from_the_first_to_the_last():
    """Over all layers at once: the first knows no contact, the last is the answer."""
    scene = Scene.from_toml(find_scene("bar_impact"))
    result = solve(scene.with_settings({"solve.method": "galerkin", "solve.window": "all"}))
    known = panels(result)
    forces, gaps = known["iterates"](), known["iterate_gaps"]()
    assert len(forces.curves) == len(gaps.curves) == result.summary["active_set"]["iterations"]
    assert not forces.curves[0].y.any()
    assert gaps.curves[0].y.min() < -0.1
    np.testing.assert_array_equal(forces.curves[-1].y, result.rows["contact_force"].values[1:])
    np.testing.assert_array_equal(gaps.curves[-1].y, result.rows["gap"].values[1:])
    layered = solve(scene.with_settings({"solve.method": "galerkin", "solve.window": 1}))
    assert layered.summary["active_set"]["iterates"] == []
    assert panels(layered)["iterates"]() is None

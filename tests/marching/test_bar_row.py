"""Rows of bars by the founding scheme: exact on matched elements, first order off the layers."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import impactfem
from impactfem import Bar, Scene, Solve, Wall
from impactfem.errors import SceneError
from impactfem.exact import ExactBar, row_waves
from impactfem.marching.bar_row import march_row
from impactfem.planning import plan

SPEED = 2.0


def bar(name, gap, velocity=0.0, length=1.0, area=1.0, modulus=1.0, **more):
    return Bar(
        name=name, gap=gap, velocity=velocity, length=length, area=area, youngs_modulus=modulus,
        density=1.0, **more,
    )  # fmt: skip


def scene(bars, duration=5.0, obstacles=(), **solve):
    return Scene(
        title="row", duration=duration, bodies=bars, obstacles=obstacles, solve=Solve(**solve)
    )


def speeds(result):
    return [float(result.history[f"{b.name}.vx"][-1]) for b in result.scene.bars]


ROWS = {
    "equal": ([bar("a", 0.0, SPEED), bar("b", 1.25)], (0.0, 1.0)),
    "half as long": ([bar("a", 0.0, SPEED, length=0.5), bar("b", 0.75)], (0.0, 0.5)),
    # Equal transit times 1; impedance of the second 2 and 1/2.
    "stiffer": ([bar("a", 0.0, SPEED), bar("b", 1.25, length=2.0, modulus=4.0)], (-1 / 3, 2 / 3)),
    "thinner": ([bar("a", 0.0, SPEED), bar("b", 1.25, area=0.5)], (1 / 3, 4 / 3)),
}


@pytest.mark.parametrize(("bars", "left"), ROWS.values(), ids=ROWS)
def test_matched_bars_are_exact_to_rounding(bars, left):
    result = impactfem.solve(scene(bars))
    chosen = result.summary["plan"]
    assert (result.summary["method"], chosen["matched"], chosen["on_layers"]) == (
        "galerkin", True, True,
    )  # fmt: skip
    assert speeds(result) == pytest.approx(np.array(left) * SPEED, abs=1e-11)
    error = result.summary["error"]
    assert error["displacement_max"] < 1e-11
    assert error["force_l1"] < 1e-10
    shorter = min(b.transit_time for b in bars)
    ((begin, end),) = result.summary["contact"]["intervals"]
    assert (begin, end - begin) == pytest.approx((0.25 / SPEED, 2.0 * shorter), abs=1e-9)
    impedances = [b.density * b.area * b.wave_speed for b in bars]
    force = SPEED * impedances[0] * impedances[1] / sum(impedances)
    assert result.summary["contact"]["max_force"] == pytest.approx(force, rel=1e-9)


def test_of_five_bars_struck_by_one_the_last_leaves_alone():
    bars = [bar("striker", 0.0, SPEED), *(bar(f"b{k}", 1.25 + k) for k in range(5))]
    result = impactfem.solve(scene(bars, 8.0))
    assert speeds(result) == pytest.approx([0.0] * 5 + [SPEED], abs=1e-11)
    spells = [pair["intervals"] for pair in result.summary["contact"]["pairs"]]
    assert np.ravel(spells) == pytest.approx(
        np.ravel([(0.125 + k, 2.125 + k) for k in range(5)]), abs=1e-9
    )
    assert result.summary["error"]["displacement_max"] < 1e-11
    # The others rest beside each other: no pair but the last has opened.
    names = [b.name for b in bars]
    gaps = [float(result.history[f"gap.{a}.{b}"][-1]) for a, b in pairwise(names)]
    assert gaps[:4] == pytest.approx([0.0] * 4, abs=1e-12)
    assert gaps[4] == pytest.approx(SPEED * (8.0 - 6.125), rel=1e-9)


def test_one_bar_in_the_row_kernel_is_the_founding_benchmark():
    motion = march_row([bar("a", 0.5, -0.5)], [40], 1.0 / 40.0, 200, wall="wall")
    exact = ExactBar.from_functions(
        length=1.0, wave_speed=1.0, duration=5.0, displacement=lambda x: 0.5 + 0.0 * x,
        velocity=lambda x: -0.5 + 0.0 * x,
    )  # fmt: skip
    reference = exact.displacement(motion.times[:, None], motion.positions[0][None])
    assert np.abs(motion.displacement[0] - reference).max() < 1e-12
    middle = 0.5 * (motion.times[1:] + motion.times[:-1])
    assert np.abs(motion.force[:, 0] + exact.multiplier(middle)).max() < 1e-11


def test_row_against_wall_and_clamp_is_exact():
    bars = [bar("a", 0.5, -1.0), bar("b", 2.0, -1.0)]
    wall = impactfem.solve(scene(bars, 8.0, [Wall()]))
    clamp = impactfem.solve(scene([bar("a", 0.0, 1.0), bar("b", 1.25, far_end="clamped")], 8.0))
    for result in (wall, clamp):
        assert result.summary["method"] == "galerkin"
        assert result.summary["error"]["displacement_max"] < 1e-11
    assert wall.summary["contact"]["pairs"][0]["between"] == ["wall", "a"]


def test_first_order_where_transit_times_have_no_common_measure():
    bars = [bar("a", 0.0, 1.0, length=np.sqrt(0.5)), bar("b", 1.25)]
    assert plan(scene(bars)).method == "exact"
    errors = []
    for elements in (40, 640):
        result = impactfem.solve(scene(bars, method="galerkin", elements=elements))
        assert "forces ring" in result.summary["plan"]["findings"][0]["text"]
        errors.append([result.summary["error"][k] for k in ("displacement_l2", "force_l1")])
    rates = np.log(np.array(errors[0]) / errors[1]) / np.log(16.0)
    assert (rates > 0.8).all()


def test_exact_method_gives_contacts_and_energies_to_rounding():
    bars = [bar("a", 0.0, 1.0, length=np.sqrt(0.5)), bar("b", 1.25)]
    result = impactfem.solve(scene(bars, method="exact"))
    (spell,) = result.summary["contact"]["intervals"]
    start = 1.25 - np.sqrt(0.5)
    assert spell == pytest.approx([start, start + np.sqrt(2.0)], abs=1e-12)
    assert result.summary["contact"]["impulse"] == pytest.approx(np.sqrt(0.5), rel=1e-12)
    assert result.summary["energy"]["max_relative_drift"] < 1e-13
    assert speeds(result) == pytest.approx([0.0, np.sqrt(0.5)], abs=1e-13)


def test_plan_matches_elements_of_unequal_bars():
    bars = [bar("a", 0.0, 1.0, length=0.75), bar("b", 1.0, length=1.75, modulus=4.0)]
    chosen = plan(scene(bars, method="galerkin"))
    a, b = chosen.elements
    assert a * 0.875 == b * 0.75
    assert chosen.courant == pytest.approx((1.0, 1.0))
    with pytest.raises(SceneError, match="no whole number of elements"):
        plan(scene(bars, elements=41))


@pytest.mark.slow
def test_where_waves_split_too_often_the_march_still_serves(monkeypatch):
    monkeypatch.setattr(row_waves, "_MAX_PIECES", 10_000)
    # Pressed between a wall and a clamp: no pair opens, transit times have no common measure.
    lengths, place, bars = (1.0, np.sqrt(2.0), np.sqrt(3.0)), 0.0, []
    for k, (length, area) in enumerate(zip(lengths, (1.0, 3.0, 0.5), strict=True)):
        bars.append(
            bar(f"b{k}", place, 0.1 * (k == 0), length, area, displacement="-0.3*x",
                far_end="clamped" if k == 2 else "free")
        )  # fmt: skip
        place += 0.7 * length
    squeezed = scene(bars, 40.0, [Wall()], elements=20)
    result = impactfem.solve(squeezed)
    assert result.summary["method"] == "conserving"
    assert result.summary["status"] == "completed"
    assert result.summary["error"] is None
    assert result.summary["energy"]["max_relative_drift"] <= 1e-12
    assert "not measured" in result.summary["plan"]["findings"][0]["text"]
    assert result.history["contact_force"].values[-1] > 0.0
    with pytest.raises(SceneError, match='or method = "conserving"'):
        plan(squeezed.with_settings({"solve.method": "exact"}))


def test_fields_of_a_row_survive_their_file(tmp_path):
    result = impactfem.solve(scene([bar("a", 0.0, 1.0, length=0.5), bar("b", 0.75)], 1.0))
    result.save(tmp_path / "out")
    back = impactfem.Result.load(tmp_path / "out")
    assert back.fields.counts == result.fields.counts == (21, 41)
    assert np.array_equal(back.fields.displacement, result.fields.displacement)
    assert len(back.fields.starts) == 60
    assert {"contact_force", "energy", "velocity_map", "strain"} <= set(back.plot())


@st.composite
def matched_rows(draw):
    """Random bars with the same h / c, and the time step."""
    dt, place = 1.0 / draw(st.integers(8, 30)), draw(st.floats(0.0, 0.3))
    bars, elements = [], []
    for k in range(draw(st.integers(2, 4))):
        count, speed = draw(st.integers(2, 30)), draw(st.floats(0.5, 2.0))
        length = speed * count * dt
        bars.append(
            bar(f"b{k}", place, draw(st.floats(-1.0, 1.0)), length, draw(st.floats(0.2, 5.0)),
                speed**2)
        )  # fmt: skip
        elements.append(count)
        place += length + draw(st.sampled_from([0.0, 0.0, 0.11]))
    return bars, elements, dt


@settings(max_examples=60, deadline=None)
@given(matched_rows(), st.booleans(), st.sampled_from([1.0, 0.7]))
def test_random_rows_neither_penetrate_nor_pull_nor_lose_momentum(row, walled, courant):
    bars, elements, dt = row
    wall = "wall" if walled else None
    motion = march_row(bars, elements, courant * dt, int(5.0 / (courant * dt)), wall=wall)
    assert (motion.force >= 0.0).all()
    for k in range(1, len(bars)):
        end = motion.displacement[k - 1][:, -1] + bars[k - 1].length
        gap = motion.displacement[k][:, 0] - end
        assert gap.min() > -1e-12
        assert np.abs(gap - motion.gap[:, k - (not walled)]).max() < 1e-12
    masses = np.array([b.mass for b in bars])
    momentum = masses @ motion.mean_velocity.T
    size = masses @ np.maximum(np.abs(motion.mean_velocity).max(axis=0), 1.0)
    if walled:
        # Layer velocities see the mean of two forces, the first one half of its own.
        push = np.append(0.0, motion.force[:, 0])
        impulse = courant * dt * (np.cumsum(push)[1:] - 0.5 * push[1:])
        assert np.abs(momentum[1:] - momentum[0] - impulse).max() < 1e-10 * size
    else:
        assert np.ptp(momentum) < 1e-10 * size
    energy = (motion.kinetic + motion.elastic).sum(axis=1)
    # Places of about 1 m round velocities by 1e-14 m/s, which counts where bars hardly move.
    rounding = 1e-13 * np.sqrt(energy[0])
    assert energy.max() - energy[0] < 1e-9 * max(energy[0], 1e-12) + rounding

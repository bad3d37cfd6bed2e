"""Bars that are not uniform, or have a load along them, against closed forms."""

import numpy as np
import pytest
from pytest_mpi import parallel_assert

import impactfem
from impactfem import Scene, SceneError
from impactfem.scene import Bar

WAYS = {
    "galerkin": {"method": "galerkin"},
    "slower": {"method": "galerkin", "courant": 0.7},
    "window": {"method": "galerkin", "window": "all"},
    "monolithic": {"method": "monolithic"},
}
STEPPED = {"density": "where(x < 0.5, 1, 4)", "youngs_modulus": 1.0, "area": "where(x < 0.5, 1, 2)"}


def scene(duration=3.0, gravity=0.0, **bar):
    given = {"length": 1.0, "density": 1.0, "youngs_modulus": 1.0, "gap": 0.0} | bar
    return {
        "title": "layered", "duration": duration, "gravity": gravity,
        "body": [{"kind": "bar", **given}], "obstacle": [{"kind": "wall"}],
        "output": {"report": False, "pictures": False, "every": 1},
    }  # fmt: skip


def run(data, **settings):
    return impactfem.solve(Scene.from_dict(data), **settings)


def drift(history):
    energy = history["total_energy"].values
    return float(np.abs(energy[1:] - energy[1]).max())


@pytest.mark.parametrize("way", ["galerkin", "window", "monolithic"])
def test_a_jump_of_impedance_reflects_as_it_must(way):
    # Thrown at the wall it touches: what leaves the wall meets Z = 1 | 4 after .5 s, and what is
    # reflected there, (Z1 - Z2)/(Z1 + Z2) of it, is back at 1 s.
    result = run(scene(0.99, velocity=-0.5, **STEPPED), elements=42, **WAYS[way])
    force, times = result.history["contact_force"].values[1:], result.history["time"].values[1:]
    assert np.abs(force - 0.5).max() < 1e-12  # Z1 v0
    later = run(scene(1.4, velocity=-0.5, **STEPPED), elements=42, **WAYS[way])
    force, times = later.history["contact_force"].values, later.history["time"].values
    back = force[times > 1.0 + 1e-9]
    assert np.abs(back - 0.5 * (3 * 4 - 1) / (4 + 1)).max() < 1e-12
    assert drift(later.history) < 1e-12
    assert later.history["momentum"].values[0] == pytest.approx(-0.5 * (0.5 + 4.0), abs=1e-12)
    assert later.summary["error"]["displacement_max"] < 1e-11


def test_an_exponential_horn_rings_as_its_closed_form_says():
    # (A u')' + A w^2 u = 0 with A = exp(2 k x): w^2 = k^2 + (pi/L)^2 between free ends.
    k, turn = 0.6, np.pi
    shape = f"0.1*exp(-{k}*x)*(cos(pi*x) + {k}/pi*sin(pi*x))"
    wrong = []
    for count in (20, 40):
        data = scene(2.0, gap=1.0, displacement=shape, area=f"exp(2*{k}*x)")
        found = run(data, method="galerkin", elements=count)
        u = found.fields.displacement - 1.0
        t, x = found.fields.times[:, None], found.fields.positions
        exact = np.exp(-k * x) * (np.cos(turn * x) + k / turn * np.sin(turn * x))
        wrong.append(np.abs(u - 0.1 * exact * np.cos(np.hypot(k, turn) * t)).max())
    assert wrong[1] < 1e-4
    assert wrong[0] / wrong[1] > 3.5  # second order


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("end", ["free", "moved"])
def test_energy_and_momentum_under_a_load(way, end):
    moved = {"far_end_displacement": "0.1*sin(3*t)**2"} if end == "moved" else {}
    pulse = "0.3*where(t < 0.73, sin(5*t), 0)*(1 + x)"
    varied = {"density": "1 + x", "youngs_modulus": "2 - x**2", "area": "1 + x"}
    data = scene(1.5, 0.2, gap=2.0, load=pulse, **varied, **moved)
    history = run(data, elements=20, **WAYS[way]).history
    assert drift(history) < 1e-12
    if end == "free":
        mass, t = 7.0 / 3.0, history["time"].values  # of (1 + x)^2
        whole = 0.3 * 1.5 * (1.0 - np.cos(5 * 0.73)) / 5.0
        middle = 0.5 * (t[-1] + t[-2])
        assert history["momentum"].values[-1] == pytest.approx(
            whole - 0.2 * mass * middle, abs=1e-12
        )


@pytest.mark.parametrize("way", ["galerkin", "monolithic"])
def test_a_load_that_is_weight_is_gravity(way):
    varied = {"density": "1 + x", "area": "2 - x", "gap": 0.05}
    found = [
        run(data, elements=20, **WAYS[way]).history
        for data in (scene(3.0, 0.3, **varied), scene(3.0, load="-0.3*(1 + x)*(2 - x)", **varied))
    ]
    for name in ("gap", "contact_force", "momentum", "kinetic_energy"):
        assert np.abs(found[0][name].values - found[1][name].values).max() < 1e-12


def test_a_formula_that_is_constant_is_the_number():
    plain, said = (
        run(scene(4.0, 0.1, gap=0.1, area=area), method="galerkin", elements=40).history
        for area in (2.0, "2 + 0*x")
    )
    for name in ("gap", "contact_force", "total_energy"):
        assert np.abs(plain[name].values - said[name].values).max() < 1e-14


def test_elements_have_equal_travel_times_and_their_mass():
    bar = Bar(length=2.0, density="1 + x", youngs_modulus="1/(1 + x)", area="1 + x**2")
    travel = np.linspace(0.0, 2.0, 11)
    x = bar.places(travel)
    assert bar.transit_time == pytest.approx(4.0, rel=1e-12)  # 1/c = 1 + x
    assert np.abs(x + 0.5 * x**2 - 2.0 * travel).max() < 1e-13
    assert bar.mass == pytest.approx(2.0 + 2.0 + 8.0 / 3.0 + 4.0, rel=1e-12)
    mass = bar.weights(travel) * bar.section * np.diff(travel)
    exact = np.diff(x + 0.5 * x**2 + x**3 / 3.0 + 0.25 * x**4)
    assert np.abs(mass - exact).max() < 1e-12


@pytest.mark.parametrize(
    ("bar", "solve", "words"),
    [
        ({"area": "x - 0.5"}, {}, "area"),
        ({"density": "1/x"}, {}, "density"),
        ({"area": "1 + x"}, {"method": "exact"}, "solve.method"),
        ({"load": "t*x"}, {"method": "conserving"}, "solve.method"),
        ({"load": "1/(t - 1.5)"}, {}, "load"),
        ({"load": "1/(x - 0.25)"}, {}, "load"),
        ({"area": "1 + x"}, {"accuracy": 1e-3}, "solve.accuracy"),
    ],
)
def test_what_cannot_be_is_refused(bar, solve, words):
    with pytest.raises(SceneError, match=words.replace(".", r"\.")):
        Scene.from_dict(scene(**bar) | {"solve": solve})


@pytest.mark.parallel([1, 2])
def test_all_ranks_have_the_same_motion():
    result = run(
        scene(2.0, 0.1, velocity=-0.5, load="x*t", **STEPPED), elements=21, **WAYS["monolithic"]
    )
    swept = run(
        scene(2.0, 0.1, velocity=-0.5, load="x*t", **STEPPED), elements=21, **WAYS["galerkin"]
    )
    apart = np.abs(result.history["gap"].values - swept.history["gap"].values).max()
    parallel_assert(apart < 1e-11)

"""Viscoelastic solids: waves against their dispersion, blows against an ordinary equation."""

import numpy as np
import pytest
from moving_scenes import check_restart
from pytest_mpi import parallel_assert
from scipy.integrate import solve_ivp

import impactfem
from impactfem import Scene, SceneError
from impactfem.models.solids import solids_model
from impactfem.system.finite_strain import FiniteStrain
from impactfem.system.small_strain import SmallStrain

SPEED, RATE = 1e-3, 2.0 * np.pi
FORCES, ENERGY = 0.1797365917013975, 3.281982159214637e-07
TERMS = ((0.5, 0.3), (2.0, 3.0))
RELAXING = {"kind": "maxwell", "terms": [{"modulus": g, "time": t} for g, t in TERMS]}
RETARDED = {"kind": "kelvin_voigt", "time": 0.03}
FLOOR = {"name": "floor", "kind": "half_space", "point": [0, 0], "normal": [0, 1]}
UNIT = {
    "kind": "solid", "model": "plane_strain", "density": 1.0, "youngs_modulus": 1.0,
    "poisson_ratio": 0.0, "strain": "small", "cells": "hexahedron",
}  # fmt: skip


def scene(*bodies, duration=4.0, obstacle=(FLOOR,), dt=0.01, method="massless", **more):
    solve = {"method": method, "dt": dt, "estimate": False} | more.pop("solve", {})
    return Scene.from_dict(
        {
            "title": "viscoelastic", "duration": duration, "body": list(bodies),
            "obstacle": list(obstacle), "solve": solve, "output": {"fields": []},
        } | more
    )  # fmt: skip


def block(size=1.0, **own):
    """A unit square that falls; of one element it is a mass on a spring."""
    return UNIT | {
        "name": "block", "shape": {"kind": "block", "size": [1.0, 1.0]}, "mesh_size": size,
        "degree": 1, "velocity": [0, -SPEED], "contact_surfaces": ["bottom"],
        "viscoelastic": RELAXING,
    } | own  # fmt: skip


def one_degree():
    """Restitution of a unit mass on a unit spring with the terms beside it, by its equation."""
    shares, times = np.array(TERMS).T

    def rates(_, y):
        return np.r_[y[1], -y[0] - shares @ y[2:], y[1] - y[2:] / times]

    def parts(t, y):
        return y[0] + shares @ y[2:] + (t < 0.1)

    parts.terminal, parts.direction = True, -1
    start = np.r_[0.0, 1.0, np.zeros(len(TERMS))]
    found = solve_ivp(rates, (0.0, 20.0), start, events=parts, rtol=1e-10, atol=1e-12)
    return -float(found.y[1, -1])


@pytest.mark.parallel(1)
@pytest.mark.parametrize(
    ("law", "modulus"),
    [
        (RETARDED, lambda s: 1.0 + 0.03 * s),
        (
            {"kind": "maxwell", "terms": [{"modulus": 1.0, "time": 1.0 / RATE}]},
            lambda s: 1.0 + s / RATE / (1.0 + s / RATE),
        ),
    ],
)
def test_waves_die_down_and_travel_by_their_dispersion(law, modulus):
    """Between two places of a strip whose end is moved: 2e-4 of amplitude and phase."""
    ramp = "where(t < 2, 0.5 - 0.5*cos(0.5*pi*t), 1)"
    given = {"surface": "left", "kind": "motion", "value": [f"1e-3*sin(2*pi*t)*{ramp}", "0"]}
    strip = UNIT | {
        "name": "strip", "shape": {"kind": "block", "size": [5.0, 0.1]}, "mesh_size": 0.1,
        "degree": 2, "viscoelastic": law, "supports": [given],
    }  # fmt: skip
    probes = [
        {
            "name": name,
            "body": "strip",
            "point": [x, 0.05],
            "quantities": ["displacement", "stress"],
        }
        for name, x in (("near", 0.5), ("far", 1.0))
    ]
    history = impactfem.solve(scene(strip, duration=5.0, obstacle=(), probe=probes)).history
    last = history["time"].values > 4.0 - 1e-9
    times = history["time"].values[last]
    waves = np.stack([np.cos(RATE * times), np.sin(RATE * times), np.ones_like(times)], axis=1)

    def amplitude(column):
        found = np.linalg.lstsq(waves, history[column].values[last], rcond=None)[0]
        return found[0] - 1j * found[1]

    number = RATE / np.sqrt(modulus(1j * RATE))
    known = np.exp(-0.5j * number)
    found = amplitude("far.ux") / amplitude("near.ux")
    assert abs(np.log(abs(found)) / np.log(abs(known)) - 1.0) <= 3e-3
    assert abs(np.angle(found / known)) <= 3e-3 * abs(np.angle(known))
    if law is not RETARDED:
        strain = -1j * number * amplitude("near.ux")
        assert amplitude("near.sxx") / strain / modulus(1j * RATE) == pytest.approx(1.0, abs=0.03)


@pytest.mark.parallel(1)
def test_restitution_is_that_of_one_degree_of_freedom():
    """To second order in the step, with energy that never grows and is told."""
    known, errors = one_degree(), []
    for dt in (0.04, 0.02):
        result = impactfem.solve(scene(block(), dt=dt))
        history = result.history
        errors.append(history["momentum.y"].values[-1] / SPEED - known)
        energy = history["total_energy"].values
        assert (np.diff(energy) <= 1e-12 * energy[0]).all()
        # What is left in the springs of the terms at the end is stored, the rest is taken.
        taken = sum(result.summary["energy"]["taken"].values())
        assert taken == pytest.approx(energy[0] - energy[-1], rel=1e-9)
    assert abs(errors[0]) <= 3e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


@pytest.mark.parallel(1)
def test_steps_by_iterates_take_what_dashpots_take():
    """Work of a step is the change of the energy and what r amid it loses, however it goes."""
    part = solids_model(scene(block(0.5)), (1,)).parts[0]
    strain, draw = SmallStrain(part.system.nodes, part.solid), np.random.default_rng(0)
    strain.retard(0.0, step := 0.4)
    terms, place = part.system.relaxation, np.zeros(len(part.system.displacement))
    kept = terms.rest(len(place))
    for _ in range(3):
        after = place + draw.normal(size=len(place))
        before, force = strain.energy(place), strain.force(place, after)
        amid = terms.amid(kept, after - place, step)
        kept = terms.after(kept, after - place, step)
        taken = sum(
            g * step / time * (2.0 * part.system.elastic_energy(r))
            for g, time, r in zip(terms.shares, terms.times, amid, strict=True)
        )
        strain.settle(place, after)
        place, work = after, float(force @ (after - place))
        assert work == pytest.approx(strain.energy(place) - before + taken, rel=1e-11)


@pytest.mark.parallel(1)
def test_kelvin_voigt_is_damping_by_the_stiffness():
    one = impactfem.solve(scene(block(0.25, viscoelastic=RETARDED))).history
    said = block(0.25, viscoelastic=None, rayleigh_stiffness=RETARDED["time"])
    two = impactfem.solve(scene(said)).history
    for name in ("total_energy", "contact_force", "momentum.y"):
        np.testing.assert_array_equal(one[name].values, two[name].values)


@pytest.mark.parallel(1)
def test_a_static_start_is_the_equilibrium_after_long():
    """It stays so: the weight on the floor, the sag that of youngs_modulus."""
    heavy = block(0.25, velocity=[0, 0])
    probe = [{"name": "top", "body": "block", "point": [0.5, 1.0], "quantities": ["displacement"]}]
    given = scene(heavy, start="static", gravity=[0, -1e-4], probe=probe, duration=2.0)
    history = impactfem.solve(given).history
    assert np.ptp(history["top.uy"].values) <= 1e-12
    assert np.abs(history["contact_force"].values - 1e-4).max() <= 1e-12
    soft = scene(heavy | {"viscoelastic": None}, **{k: given.to_dict()[k] for k in ("start",
                 "gravity", "probe")}, duration=2.0)  # fmt: skip
    elastic = impactfem.solve(soft).history
    assert history["top.uy"].values[-1] == pytest.approx(elastic["top.uy"].values[-1], rel=1e-12)


@pytest.mark.parallel(1)
def test_the_same_in_flight_as_at_rest():
    """Strains do not see how fast a body flies or where it is, nor turns in the plane."""
    stretched = {"displacement": ["1e-4*x", "0"], "contact_surfaces": None}
    energies = []
    for velocity in ([0.0, 0.0], [30.0, 20.0]):
        own = block(0.25, velocity=velocity, **stretched)
        history = impactfem.solve(scene(own, obstacle=(), duration=1.0)).history
        energies.append(history["elastic_energy"].values)
    assert np.abs(energies[0] - energies[1]).max() <= 1e-8 * energies[0][0]


@pytest.mark.parallel(1)
def test_a_run_goes_on_to_the_bit(tmp_path, monkeypatch):
    given = scene(block(0.5), duration=1.0, output={"fields": [], "checkpoint": 10})
    check_restart(given, 57, tmp_path, monkeypatch)


@pytest.mark.parallel([1, 2])
def test_ranks_agree():
    history = impactfem.solve(scene(block(0.25), duration=1.5)).history
    force, energy = (history[name].values for name in ("contact_force", "total_energy"))
    parallel_assert(abs(force.sum() - FORCES) <= 1e-10 * FORCES)
    parallel_assert(abs(energy[-1] - ENERGY) <= 1e-10 * ENERGY)


@pytest.mark.parallel(1)
@pytest.mark.parametrize(
    ("own", "method", "words"),
    [
        ({}, "explicit", 'solve.method = "explicit" takes explicit steps.*Maxwell terms of block'),
        ({}, "galerkin", 'solve.method = "galerkin" takes explicit steps'),
        ({"youngs_modulus": "1 + x"}, None, "viscoelastic.terms have moduli beside one"),
        ({"viscoelastic": {"kind": "maxwell", "terms": []}}, None, "viscoelastic.terms"),
        (
            {"viscoelastic": {"kind": "maxwell", "terms": [{"modulus": -1.0, "time": 1.0}]}}, None,
            r"viscoelastic.terms\[0\].modulus = -1",
        ),
        ({"viscoelastic": {"kind": "kelvin"}}, None, "viscoelastic.kind.*kelvin_voigt"),
        (
            {"viscoelastic": RETARDED, "rayleigh_stiffness": 1.0}, None,
            "rayleigh_stiffness = 1.0 and viscoelastic.time = 0.03 are one thing",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_by_key(own, method, words):
    with pytest.raises(SceneError, match=words):
        scene(block(**own), method=method) if method else scene(block(**own))


def layers(folder, **own):
    """Two unit squares side by side in one file, of a group each."""
    (folder / "layers.geo").write_text(LAYERS)
    materials = {"near": {"viscoelastic": RETARDED}, "far": {}}
    shown = {"mesh": str(folder / "layers.geo"), "materials": materials, "viscoelastic": None}
    given = block(strain="finite", contact_surfaces=None) | shown | own
    return {k: v for k, v in given.items() if k not in {"shape", "mesh_size", "cells"}}


LAYERS = """
Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {2, 0, 0};
Point(4) = {0, 1, 0}; Point(5) = {1, 1, 0}; Point(6) = {2, 1, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 6}; Line(4) = {6, 5};
Line(5) = {5, 4}; Line(6) = {4, 1}; Line(7) = {2, 5};
Curve Loop(1) = {1, 7, 5, 6}; Plane Surface(1) = {1};
Curve Loop(2) = {2, 3, 4, -7}; Plane Surface(2) = {2};
Transfinite Curve {1:7} = 3; Transfinite Surface {1, 2}; Recombine Surface {1, 2};
Physical Surface("near") = {1}; Physical Surface("far") = {2};
"""


@pytest.mark.parallel(1)
@pytest.mark.parametrize("ratio", [0.0, 0.48])
def test_each_group_is_damped_by_its_own_time(tmp_path, ratio):
    """Work of a step beyond the energy is that of the dashpots of one group alone."""
    own = {"material": "neo_hookean", "poisson_ratio": ratio, "degree": 2}
    part = solids_model(scene(layers(tmp_path, **own), obstacle=()), (2,)).parts[0]
    system, step = part.system, 0.1
    assert system.rayleigh_stiffness == RETARDED["time"]
    strain = FiniteStrain(system.nodes, part.solid, system.following)
    strain.retard(system.rayleigh_stiffness, step)
    x = system.positions
    for side, share in ((x[:, 0] <= 1.0, 1.0), (x[:, 0] >= 1.0, 0.0)):
        # Only one group is strained, so little that strains are linear.
        bubble = 1e-6 * np.where(side, (x[:, 0] - 1.0) ** 2 * (x[:, 1] + 1.0), 0.0)
        place = np.stack([bubble, 0.0 * bubble], axis=1).ravel()
        still = np.zeros_like(place)
        taken = float(strain.force(still, place) @ place) - strain.energy(place)
        known = 2.0 * strain.energy(place) * RETARDED["time"] / step * share
        assert taken == pytest.approx(known, rel=1e-4, abs=1e-6 * strain.energy(place))


def walk(strain, count, step, steps=3, size=0.03, seed=0):
    """Work, change of the energy and what is taken of random steps; the last place."""
    draw, place, found = np.random.default_rng(seed), np.zeros(count), []
    for _ in range(steps):
        strain.retard(0.0, step)
        after = place + size * draw.normal(size=count)
        before, work = strain.energy(place), float(strain.force(place, after) @ (after - place))
        strain.settle(place, after)
        place, change = after, strain.energy(after) - before
        found.append((work, change))
    return np.array(found), place


NEO = {"material": "neo_hookean", "strain": "finite", "poisson_ratio": 0.3}
FINITE = {
    "neo": NEO,
    "kept": NEO | {"poisson_ratio": 0.49},
    "flat": NEO | {"model": "plane_stress"},
}


@pytest.mark.parallel(1)
@pytest.mark.parametrize("law", FINITE)
def test_under_finite_strain_dashpots_take_and_never_give(law):
    """However large the steps; turned as a whole nothing changes."""
    part = solids_model(scene(block(0.5, **FINITE[law]), obstacle=()), (1,)).parts[0]
    system, step = part.system, 0.4
    strain = FiniteStrain(system.nodes, part.solid, system.following)
    found, place = walk(strain, len(system.displacement), step)
    assert (found[:, 0] - found[:, 1] > 0.0).all()
    force, x = strain.force(place, place).reshape(-1, 2), system.positions
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    turned = ((x + place.reshape(-1, 2)) @ turn.T - x).ravel()
    rotated = strain.force(turned, turned).reshape(-1, 2)
    assert np.abs(rotated - force @ turn.T).max() <= 1e-12 * np.abs(force).max() * 10
    again = FiniteStrain(system.nodes, part.solid, system.following)
    again.remember(strain.memory())
    assert again.energy(place) == strain.energy(place)


@pytest.mark.parallel(1)
def test_stress_that_is_held_relaxes_by_its_exponentials():
    """Of a large strain put on at once: E at once, then g C : E exp(-t / tau) beside the law's."""
    part = solids_model(scene(block(**NEO), obstacle=()), (1,)).parts[0]
    system = part.system
    stretched = system.positions * np.array([0.6, 0.0])
    held, still = stretched.ravel(), np.zeros(stretched.size)
    strain = FiniteStrain(system.nodes, part.solid, system.following)
    law = strain.force(held, held)  # nothing is remembered yet
    strain.retard(0.0, 1e-9)
    strain.settle(still, held)
    lame, shear, green = 0.3 / 0.52, 1.0 / 2.6, 0.5 * (1.6**2 - 1.0)
    right = np.isclose(system.positions[:, 0], 1.0)
    dt, worst = 0.01, 0.0
    for count in range(300):
        strain.retard(0.0, dt)
        known = (
            1.6
            * (lame + 2 * shear)
            * green
            * sum(g * np.exp(-(count + 0.5) * dt / t) for g, t in TERMS)
        )
        over = (strain.force(held, held) - law).reshape(-1, 2)
        worst = max(worst, abs(over[right, 0].sum() / known - 1.0))
        strain.settle(held, held)
    assert worst <= 3e-4  # dt^2 / (8 tau^2) of the mean amid a step, and more as time goes on


@pytest.mark.parallel(1)
@pytest.mark.parametrize("ratio", [0.3, 0.48])
def test_groups_relax_each_in_its_own_way(tmp_path, ratio):
    """Small strains by matrices and finite ones by points say the same of small steps."""
    laws = {"near": {"viscoelastic": RELAXING, "poisson_ratio": ratio},
            "far": {"viscoelastic": RETARDED}}  # fmt: skip
    own = {"materials": laws, "degree": None}
    small, finite = (
        solids_model(scene(layers(tmp_path, **own, **more), obstacle=()), (1,)).parts[0]
        for more in ({"strain": "small"}, {"material": "neo_hookean"})
    )
    system, step, size = small.system, 0.2, 1e-7
    one = SmallStrain(system.nodes, small.solid)
    two = FiniteStrain(finite.system.nodes, finite.solid, finite.system.following)
    for strain in (one, two):
        strain.retard(system.rayleigh_stiffness, step)
    draw, place = np.random.default_rng(3), np.zeros(len(system.displacement))
    for _ in range(3):
        after = place + size * draw.normal(size=len(place))
        forces = [strain.force(place, after) for strain in (one, two)]
        assert np.abs(forces[0] - forces[1]).max() <= 1e-5 * np.abs(forces[0]).max()
        tangents = []
        for strain in (one, two):
            matrix = strain.tangent(place, after)
            source, image = matrix.createVecs()
            source.setArray(after)
            matrix.mult(source, image)
            tangents.append(np.array(image.getArray()))
            strain.settle(place, after)
        assert np.abs(tangents[0] - tangents[1]).max() <= 1e-5 * np.abs(tangents[0]).max()
        place = after
        assert one.energy(place) == pytest.approx(two.energy(place), rel=1e-5)


@pytest.mark.parallel(1)
def test_the_plan_for_groups_that_relax_is_one_that_runs(tmp_path):
    """It was explicit steps, by the material of the fastest waves, that the run refused."""
    laws = {"near": {"viscoelastic": RELAXING}, "far": {"youngs_modulus": 100.0}}
    body = layers(tmp_path, materials=laws, strain="small", velocity=[-0.01, 0.0])
    wall = {"kind": "half_space", "name": "wall", "normal": [1, 0], "point": [-1e-3, 0]}
    found = impactfem.solve(scene(body, method=None, dt=None, obstacle=(wall,), duration=0.5))
    assert found.summary["method"] == "conserving"
    assert found.history["contact_force"].values.max() > 0.0


@pytest.mark.parallel(1)
def test_groups_show_their_own_stress(tmp_path):
    """Probes and fields of small strains and of finite ones agree as far as strains are small."""
    laws = {"near": {"viscoelastic": RELAXING}, "far": {"viscoelastic": RETARDED}}
    own = {"materials": laws, "poisson_ratio": 0.3, "velocity": [0, 0], "degree": 1,
           "displacement": ["1e-5*x*x", "1e-5*x*y"]}  # fmt: skip
    watched = [
        MIDDLE[0] | {"name": name, "point": [x, 0.3]} for name, x in (("p", 0.3), ("q", 1.6))
    ]
    shown = []
    for more in ({"strain": "small"}, {"material": "neo_hookean"}):
        run = scene(layers(tmp_path, **own, **more), duration=0.6, obstacle=(), dt=0.02,
                    method="conserving", probe=watched,
                    output={"fields": ["vtkhdf"], "every": 10})  # fmt: skip
        result = impactfem.solve(run)
        each = [result.history[f"{p}.{s}"].values for p in "pq" for s in STRESSES]
        every = range(len(result.fields.times))
        shown.append([*each, *(result.fields.read(k, "von_mises")["von_mises"] for k in every)])
    for small, finite in zip(*shown, strict=True):
        assert np.abs(small - finite).max() <= 4e-4 * np.abs(finite).max()  # ten times the strain


@pytest.mark.parallel(1)
def test_groups_that_relax_alike_are_one_body(tmp_path):
    """By steps that are solved anew, and by those of a body of one material."""
    alike = {"near": {"viscoelastic": RELAXING}, "far": {"viscoelastic": RELAXING}}
    given = {"velocity": [0, 0], "displacement": ["1e-4*x*x", "0"], "contact_surfaces": None}
    plain = block(0.5, shape={"kind": "block", "size": [2.0, 1.0]}, **given)
    energies = []
    for body in (
        layers(tmp_path, strain="small", materials=alike, **given),
        layers(tmp_path, strain="small", **given) | {"materials": {"near": {}, "far": {}},
                                                     "viscoelastic": RELAXING},
        plain,
    ):  # fmt: skip
        run = scene(body, duration=1.0, method="conserving", obstacle=())
        energies.append(impactfem.solve(run).history["elastic_energy"].values)
    assert energies[0][-1] < 0.9 * energies[0][0]
    for other in energies[1:]:
        assert np.abs(other - energies[0]).max() <= 1e-9 * energies[0][0]


def followed(values, dt):
    """Sum of g r of what moves as sampled: r is the integral of exp(-(t - s) / tau) dE(s)."""
    found, times = np.zeros_like(values), dt * np.arange(len(values))
    for share, tau in TERMS:
        grown = np.exp((times[1:] - 0.5 * dt) / tau) * np.diff(values)
        found[1:] += share * np.exp(-times[1:] / tau) * np.cumsum(grown)
    return found


@pytest.mark.parallel(1)
@pytest.mark.parametrize("ratio", [0.3, 0.49])
def test_true_stress_has_what_terms_remember(ratio):
    """Of a stretch by 1.6 in 0.5 s that is held: sigma = F (S + sum g C : r) F^T / J, 5e-6.

    Of the nearly incompressible body lambda's part follows J, as a pressure.
    """
    fine, dt, end = 100, 0.01, 0.5
    ramp = {"surface": "right", "kind": "motion", "value": [f"1.2*min(t, {end})", "0"]}
    held = {"surface": "left", "kind": "motion", "value": ["0", "0"]}
    body = block(**NEO | {"poisson_ratio": ratio, "velocity": [0, 0], "contact_surfaces": None,
                          "supports": [held, ramp]})  # fmt: skip
    watched = [{"name": "p", "body": "block", "point": [0.4, 0.3], "quantities": ["stress"]}]
    given = scene(body, duration=1.5, obstacle=(), method="conserving", probe=watched,
                  output={"fields": ["vtkhdf"], "every": 50})  # fmt: skip
    result = impactfem.solve(given)
    times = dt / fine * np.arange(150 * fine + 1)
    stretch = 1.0 + 1.2 * np.minimum(times, end)
    shear, lame = 0.5 / (1.0 + ratio), ratio / ((1.0 + ratio) * (1.0 - 2.0 * ratio))
    green = followed(0.5 * (stretch**2 - 1.0), dt / fine)
    pressed = lame * np.log(stretch) / stretch
    pressed = pressed + lame * followed(stretch, dt / fine) * (ratio > 0.45)
    bulk = lame * green * (ratio < 0.45)
    along = pressed + shear * (stretch - 1.0 / stretch) + stretch * (bulk + 2.0 * shear * green)
    across = pressed + bulk / stretch
    known = np.stack([along, across, 0.0 * along, across])[:, ::fine]
    found = [result.history[f"p.{name}"].values for name in STRESSES]
    assert np.abs(found - known).max() <= 5e-6 * along.max()
    for layer, time in enumerate(result.fields.times):
        shown = result.fields.read(layer, "cauchy_stress", "von_mises")
        true = shown["cauchy_stress"].reshape(-1, 3, 3)
        at = known[:, round(time / dt)]
        rows, columns = [0, 1, 0, 2], [0, 1, 1, 2]
        assert np.abs(true[:, rows, columns] - at).max() <= 5e-6 * along.max()
        assert np.abs(shown["von_mises"] - (at[0] - at[1])).max() <= 1e-5 * along.max()


@pytest.mark.parallel(1)
def test_a_run_under_finite_strain_goes_on_to_the_bit(tmp_path, monkeypatch):
    own = NEO | {"poisson_ratio": 0.48, "velocity": [0, -0.1]}
    given = scene(block(0.5, **own), duration=0.5, method="conserving", probe=MIDDLE,
                  output={"fields": ["vtkhdf"], "every": 10, "checkpoint": 10})  # fmt: skip
    check_restart(given, 27, tmp_path, monkeypatch)


STRESSES = ("sxx", "syy", "sxy", "szz")
MIDDLE = [{"name": "p", "body": "block", "point": [0.3, 0.3], "quantities": ["stress"]}]
FINITE_ENERGY, FINITE_STRESS, FINITE_MISES = (
    0.0040996672340273,
    -0.221373354741034,
    1.12824675003772,
)


@pytest.mark.parallel([1, 2])
def test_ranks_remember_the_same():
    own = NEO | {"velocity": [0, -0.1]}
    given = scene(block(0.5, **own), duration=0.6, method="conserving", probe=MIDDLE,
                  output={"fields": ["vtkhdf"], "every": 60})  # fmt: skip
    result = impactfem.solve(given)
    energy = result.history["total_energy"].values[-1]
    parallel_assert(abs(energy / FINITE_ENERGY - 1.0) <= 1e-9, str(energy))
    stress = result.history["p.syy"].values[-1]
    parallel_assert(abs(stress / FINITE_STRESS - 1.0) <= 1e-9, str(stress))
    mises = FINITE_MISES  # on rank 0 alone there are fields
    if result.fields is not None:
        mises = float(result.fields.read(1, "von_mises")["von_mises"].sum())
    parallel_assert(abs(mises / FINITE_MISES - 1.0) <= 1e-9, str(mises))


@pytest.mark.parallel(1)
def test_probes_follow_steps_that_contact_splits():
    """Fields at the middle of four triangles are the mean of their points: so are four probes."""
    own = NEO | {"velocity": [0, -0.2], "cells": "simplex", "displacement": ["0", "0.05"]}
    places = {"a": [0.5, 0.2], "b": [0.8, 0.5], "c": [0.5, 0.8], "d": [0.2, 0.5]}
    probes = [MIDDLE[0] | {"name": name, "point": place} for name, place in places.items()]
    given = scene(block(1.0, **own), duration=1.2, dt=0.12, method="conserving", probe=probes,
                  output={"fields": ["vtkhdf"], "every": 1})  # fmt: skip
    result = impactfem.solve(given)
    for layer in range(11):
        found = [
            np.mean([result.history[f"{p}.{s}"].values[layer] for p in places]) for s in STRESSES
        ]
        true = result.fields.read(layer, "cauchy_stress")["cauchy_stress"].reshape(-1, 9)
        assert np.abs(true[-1, [0, 4, 1, 8]] - found).max() <= 1e-12

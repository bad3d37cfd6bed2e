"""Gradients of bodies of any kind by time steps, and uses: a sample's and a bumper's numbers."""

import numpy as np
import pytest

import impactfem
from impactfem import Scene, SceneError
from impactfem.inverse.varied import Varied

PLAIN = {"report": False, "pictures": False, "fields": []}
FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}


def thrown(law, solve, **more):
    """A disc thrown at a plane 5 cm below it with 1 m/s."""
    return Scene.from_dict({
        "title": "thrown", "duration": 0.18,
        "body": [{"kind": "rigid", "name": "disc", "mass": 2.0, "velocity": [0.0, -1.0],
                  "shape": {"kind": "disc", "radius": 0.1, "center": [0.0, 0.15]}}],
        "obstacle": [FLOOR], "contact": [{"between": ["disc", "floor"]} | law],
        "measure": [{"name": "y", "of": "disc.y"}, {"name": "T", "of": "duration.disc.floor"}],
        "objective": {"minimise": [{"term": "value", "of": "y"}]},
        "solve": solve, "output": PLAIN,
    } | more)  # fmt: skip


def test_a_contact_that_gives_way_lasts_half_a_period():
    """T = pi sqrt(m/k), then it flies off: dy/dk = T/2k, dT/dk = -T/2k, to (step/T)^2."""
    vary = [{"name": "k", "key": "contact.0.stiffness"}]
    found = impactfem.gradient(thrown({"stiffness": 2000.0}, {"dt": 2e-3}, parameter=vary))
    assert found.method == "conserving"
    assert found.trusted
    slope = 0.5 * np.pi * np.sqrt(2.0 / 2000.0) / 2000.0
    for name, sign in (("y", 1.0), ("T", -1.0)):
        (told,) = found.measures[name]["gradient"]["k"]
        assert told == pytest.approx(sign * slope, rel=1e-3)


def test_forces_are_read_at_their_time_not_as_means_of_the_step_before_it():
    """F = m v w sin(w t), w^2 = k/m, which means read half a step later miss by 3 to 8 %."""
    w, times = np.sqrt(1000.0), np.array([0.022, 0.0435, 0.054])
    disc = thrown({}, {}).to_dict()["body"][0]
    disc["shape"]["center"] = [0.0, 0.1]
    errors = []
    for dt in (3e-3, 1.5e-3):
        measures = [{"name": f"f{k}", "of": "force.disc.floor", "at": t}
                    for k, t in enumerate(times.tolist())]  # fmt: skip
        scene = thrown({"stiffness": 2000.0}, {"dt": dt}, duration=0.06, body=[disc],
                       parameter=[{"name": "k", "key": "contact.0.stiffness"}], measure=measures,
                       objective={"minimise": [{"term": "value", "of": "f0"}]})  # fmt: skip
        varied = Varied.of(scene)
        told = varied.numbers(varied.start)[:3]
        errors.append(np.abs(told / (2.0 * w * np.sin(w * times)) - 1.0).max())
    assert errors[0] < 5e-3
    assert errors[1] < 0.4 * errors[0]


def test_what_jumps_from_step_to_step_is_refused():
    vary = [{"name": "v", "key": "body.disc.velocity.1"}]
    solve = {"dt": 2e-3, "method": "massless"}
    with pytest.raises(SceneError, match=r"disc\.floor: both have mass .* stiffness"):
        impactfem.gradient(thrown({}, solve, parameter=vary))
    slide = {"name": "rail", "kind": "prismatic", "between": ["ground", "disc"],
             "axis": [0.0, 1.0], "point": [0.0, 0.15], "limits": [-0.04, 1.0]}  # fmt: skip
    with pytest.raises(SceneError, match=r"joint rail comes to its limits, -0\.04 to 1"):
        impactfem.gradient(thrown({"stiffness": 2e3}, solve, parameter=vary, joint=[slide]))


def written(folder, name, times, values, sigma, seed):
    """A measured history with noise, in a file."""
    noise = sigma * np.random.default_rng(seed).standard_normal(len(times))
    np.savetxt(folder / f"{name}.csv", np.column_stack([times, values + noise]), delimiter=",")
    return {"name": name, "data": f"{name}.csv", "sigma": sigma}


def fit(*names):
    """Misfits become least, to a hundredth of standard deviations."""
    return {"minimise": [{"term": "misfit", "of": name} for name in names], "tolerance": 1e-4}


PERIOD = 2.830957e-6  # of the lever


def lever(elements, steps, k=60.0, energy=5e-17, duration=1.5 * PERIOD):
    """The tip of a cantilever, let swing by 10 nm, taps a sticky sample 7 nm below it."""
    return {
        "title": "tip", "duration": duration,
        "body": [{"kind": "beam", "name": "lever", "length": 125e-6, "height": 4e-6,
                  "width": 30e-6, "density": 2330.0, "youngs_modulus": 1.7e11,
                  "elements": elements, "center": [62.5e-6, 0.0], "contact": "ends",
                  "supports": [{"end": "first", "kind": "clamped"}], "quality_factor": 30,
                  "velocity": [0.0, 0.00975], "angular_velocity": 156.0}],
        "obstacle": [FLOOR | {"point": [0.0, -7e-9]}],
        "contact": [{"between": ["lever", "floor"], "stiffness": k, "damping": 1e-7,
                     "adhesion": {"force": 2e-8, "energy": energy}}],
        "probe": [{"name": "tip", "body": "lever", "point": [125e-6, 0.0]}],
        "solve": {"dt": PERIOD / steps, "estimate": False}, "output": PLAIN,
    }  # fmt: skip


@pytest.mark.slow
def test_stiffness_and_adhesion_of_a_sample_by_the_motion_of_a_tip(tmp_path):
    """Data of 12 elements and 600 steps a period, found with 2 and 120; noise of 1 % of 10 nm."""
    history = impactfem.solve(Scene.from_dict(lever(12, 600))).history
    times = np.arange(1, 38) * PERIOD / 25
    way = np.interp(times, history["time"].values, history["tip.uy"].values)
    told = written(tmp_path, "tip", times, way, 1e-10, 0) | {"of": "tip.uy", "unit": "m"}
    data = lever(2, 120, k=50.0, energy=4e-17)
    data |= {"objective": fit("tip"), "measure": [told], "parameter": [
        {"name": "k", "key": "contact.0.stiffness", "bounds": [10.0, 200.0]},
        {"name": "W", "key": "contact.0.adhesion.energy", "bounds": [0.0, 2e-16]},
    ]}  # fmt: skip
    found = impactfem.identify(Scene.from_dict(data, base=tmp_path))
    assert found.trusted, found.doubts
    for name, true, share in (("k", 60.0, 0.03), ("W", 5e-17, 0.5)):
        each = found.parameters[name]
        assert each.interval95[0] < true < each.interval95[1]
        assert each.sigma < share * true


def bumper(size, dt, modulus=6e6, mu=0.3):
    """A rubber disc that strikes a stop obliquely, slips and sticks."""
    return {
        "title": "bumper", "duration": 3.6e-3,
        "body": [{"kind": "solid", "name": "bumper", "model": "plane_strain", "mesh_size": size,
                  "shape": {"kind": "disc", "radius": 0.03, "center": [0.0, 0.0305]},
                  "density": 1100.0, "youngs_modulus": modulus, "poisson_ratio": 0.4,
                  "velocity": [3.0, -4.0]}],
        "obstacle": [FLOOR],
        "contact": [{"between": ["bumper", "floor"], "friction_coefficient": mu}],
        "solve": {"dt": dt, "estimate": False}, "output": PLAIN,
    }  # fmt: skip


@pytest.mark.slow
def test_stiffness_and_friction_of_a_bumper_by_a_record_of_its_force(tmp_path):
    """Data of half the mesh size and a quarter of the step, means about their times."""
    step, forces = 1e-4, {"n": "force.bumper.floor", "t": "tangential_force.bumper.floor"}
    history = impactfem.solve(Scene.from_dict(bumper(0.003, step / 4))).history
    ends, measures = np.arange(1, 36) * step, []
    for seed, (name, of) in enumerate(forces.items()):
        fine = np.asarray(history[of].values)[1:]
        means = fine.reshape(-1, 4).mean(axis=1)[: len(ends)]
        measures.append(
            written(tmp_path, name, ends - step / 2, means, 500.0, seed) | {"of": of, "unit": "N"}
        )
    data = bumper(0.006, step, modulus=5e6, mu=0.2)
    data |= {"objective": fit("n", "t"), "measure": measures, "parameter": [
        {"name": "E", "key": "body.bumper.youngs_modulus", "bounds": [1e6, 2e7]},
        {"name": "mu", "key": "contact.0.friction_coefficient", "bounds": [0.05, 0.8]},
    ]}  # fmt: skip
    found = impactfem.identify(Scene.from_dict(data, base=tmp_path))
    assert found.trusted, found.doubts
    for name, true, share in (("E", 6e6, 0.02), ("mu", 0.3, 0.04)):
        each = found.parameters[name]
        assert each.interval95[0] < true < each.interval95[1]
        assert each.sigma < share * true

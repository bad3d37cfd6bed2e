"""Bars beside other bodies: their waves in the one march, against closed forms."""

import numpy as np
import pytest
from moving_scenes import FAR, alone_or_beside, check_ranks, check_restart

import impactfem
from impactfem import SceneError

STEEL = {"kind": "bar", "name": "bar", "length": 0.3, "density": 7800.0, "youngs_modulus": 210e9,
         "area": 1e-4}  # fmt: skip
SPEED = 1e-2
SOFT = {"kind": "bar", "name": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0}
BLOCK = {
    "kind": "solid", "name": "block", "model": "plane_strain", "mesh_size": 0.5, "density": 1.0,
    "youngs_modulus": 1.0, "poisson_ratio": 0.3,
    "shape": {"kind": "block", "size": [1.0, 1.0], "corner": [0.0, 0.0]},
}  # fmt: skip
WALL = {"kind": "wall", "name": "wall"}


def scene(bodies, duration, gravity=(0.0,), obstacles=(), contacts=(), solve=None, **more):
    return impactfem.Scene.from_dict(
        {
            "title": "bars and others",
            "duration": duration,
            "gravity": gravity if isinstance(gravity, float) else list(gravity),
            "body": list(bodies),
            "obstacle": list(obstacles),
            "contact": list(contacts),
            "solve": {"estimate": False} | (solve or {}),
            "output": {"fields": []},
        }
        | more
    )


def point(name, place, mass=1.0, speed=0.0, **more):
    return {"kind": "point", "name": name, "mass": mass, "position": [place], "velocity": [speed],
            **more}  # fmt: skip


def column(result, name):
    return result.history[name].values


def struck(count, *, turned=False):
    """A mass of that of a clamped bar strikes it."""
    bodies = [SOFT | {"gap": 0.5, "far_end": "clamped"}, point("m", 0.5, speed=SPEED)]
    if not turned:
        return impactfem.solve(scene(bodies, 4.0, solve={"elements": count}))
    law = [{"between": ["m", "bar"]}]
    return impactfem.solve(scene(bodies[::-1], 4.0, contacts=law, solve={"elements": count}))


def test_a_mass_strikes_a_clamped_bar():
    """F = Z v exp(-t), a jump by 2 F0 at 2 L / c, and an end at 3.068 L / c for equal masses."""
    result = struck(200)
    time, force = column(result, "time"), column(result, "force.bar.m")[1:] / SPEED
    step = time[1]
    middle = time[1:] - 0.5 * step
    early = middle < 2.0
    assert np.abs(force[early] - np.exp(-middle[early])).max() < 2.0 * step**2
    # Then F = v + 2 exp(-s) with s = t - 2 and v' = -F: a jump to 2 + exp(-2).
    s = middle[~early] - 2.0
    late = np.exp(-(s + 2.0)) + 2.0 * np.exp(-s) * (1.0 - s)
    closed = force[~early] > 0.0
    assert np.abs(force[~early] - late)[closed].max() < 5.0 * step
    assert time[1:][force > 0.0].max() == pytest.approx(3.068, abs=2.0 * step)
    energy = column(result, "total_energy")
    assert np.abs(energy - energy[0]).max() < 1e-12 * energy[0]


def test_the_same_scene_said_another_way_gives_the_same():
    one, other = struck(50), struck(50, turned=True)
    for name in ("contact_force", "gap", "total_energy", "bar.x", "m.vx"):
        assert np.array_equal(column(one, name), column(other, name))


@pytest.mark.parametrize("given", [{"elements": 100}, {"dt": 0.0137}])
@pytest.mark.parametrize("far_end", ["free", "clamped"])
def test_a_bar_beside_an_idle_body_moves_as_alone(given, far_end):
    """Gravity, wall, waves of the start: against characteristics; off the layers to first order."""
    shape = {"far_end": far_end, "gap": 0.0, "displacement": "0.01*(1-x)"}
    shape = shape if far_end == "clamped" else {"gap": 0.25, "velocity": -0.1}
    pull = 0.01
    alone = {
        "title": "alone", "duration": 6.0, "gravity": pull, "body": [SOFT | shape],
        "obstacle": [WALL], "solve": {"method": "exact"}, "output": {"fields": []},
    }  # fmt: skip
    exact = impactfem.solve(impactfem.Scene.from_dict(alone))
    bodies = [SOFT | shape, point("idle", 50.0)]
    law = [{"between": ["bar", "wall"]}]
    found = impactfem.solve(scene(bodies, 6.0, (-pull,), [WALL], law, given))
    time, step = column(found, "time"), column(found, "time")[1]
    for name in ("bar.x", "bar.vx", "elastic_energy"):
        known = np.interp(time, column(exact, "time"), column(exact, name))
        assert np.abs(column(found, name) - known).max() < 2.0 * step * np.abs(known).max()
    energy, moving = column(found, "total_energy"), column(found, "kinetic_energy")
    assert energy.max() - energy[0] < 1e-12 * np.abs(energy).max() + 1e-15
    moving = moving - 0.5 * column(found, "idle.vx") ** 2
    known = np.interp(time, column(exact, "time"), column(exact, "kinetic_energy"))
    assert np.abs(moving - known).max() < 3.0 * step * known.max()


def test_bars_and_points_in_a_row_pass_momentum_on():
    """Two bars of one impedance and mass between two points: nothing is lost on whole layers."""
    bars = [SOFT | {"name": "a", "gap": 0.0}, SOFT | {"name": "b", "gap": 1.0}]
    balls = [point("left", -0.03, 2.0, 0.01), point("right", 2.03, 0.5)]
    result = impactfem.solve(scene([*bars, *balls], 40.0, solve={"elements": 50}))
    given = column(result, "momentum.x")
    assert np.abs(given - given[0]).max() < 1e-12 * given[0]
    energy = column(result, "total_energy")
    assert energy.max() <= energy[0] * (1.0 + 1e-12)
    assert energy[-1] > 0.97 * energy[0]
    assert column(result, "right.vx")[-1] > 0.005
    for pair in ("a.b", "a.left", "b.right"):
        assert column(result, f"gap.{pair}").min() > -1e-12
        assert column(result, f"force.{pair}").min() >= 0.0


@pytest.mark.slow
@pytest.mark.parametrize("other", ["point", "rod", "beam", "solid"])
def test_a_bar_strikes_every_kind_of_body(other):
    """Along its axis the momentum is kept, and no energy is gained; its guide takes the rest."""
    known = {
        "point": {"mass": 0.05, "radius": 0.01, "position": [0.0, -0.0105]},
        "rod": {"mass": 0.05, "length": 0.1, "radius": 0.005, "center": [0.02, -0.0055]},
        "beam": {"length": 0.1, "height": 0.01, "width": 0.01, "density": 2700.0,
                 "youngs_modulus": 70e9, "elements": 4, "center": [0.0, -0.0055]},
        "solid": {"model": "plane_strain", "density": 2700.0, "youngs_modulus": 70e9,
                  "poisson_ratio": 0.3, "mesh_size": 0.01,
                  "shape": {"kind": "block", "size": [0.06, 0.02], "corner": [-0.03, -0.0205]}},
    }  # fmt: skip
    bar = STEEL | {"point": [0.0, 0.0], "axis": [0.0, 2.0], "velocity": -2.0}
    bodies = [bar, {"kind": other, "name": "other", **known[other]}]
    result = impactfem.solve(scene(bodies, 6e-4, (0.0, 0.0), solve={"dt": 1e-6}))
    given = column(result, "momentum.y")
    assert np.abs(given - given[0]).max() < 1e-12 * len(given) * np.abs(given[0])
    assert column(result, "other.vy")[-1] < -0.05
    assert column(result, "bar.x") == pytest.approx(0.0, abs=1e-15)
    energy = column(result, "total_energy")
    # The end slides along axes and faces: right to the cube of its way, on faces to first order.
    gained = {"point": 1e-12, "rod": 1e-7, "beam": 1e-7, "solid": 1e-4}[other]
    assert energy.max() <= energy[0] * (1.0 + gained)


def test_a_ball_between_a_bar_and_a_wall_passes_the_force_on():
    """The law of the ball at the wall acts on speeds, that of the bar on gaps, in one layer."""
    speed = 1e-2
    bodies = [SOFT | {"gap": 0.205, "velocity": -speed}, point("ball", 0.1, 1e-2, radius=0.1)]
    result = impactfem.solve(scene(bodies, 3.0, (0.0,), [WALL], solve={"elements": 100}))
    time = column(result, "time")
    resting = (time > 0.6) & (time < 2.4)
    for name in ("force.bar.ball", "force.ball.wall"):
        assert column(result, name)[resting] == pytest.approx(speed, rel=1e-9)
    assert column(result, "gap.bar.ball").min() > -1e-12
    assert column(result, "bar.vx")[-1] == pytest.approx(speed, rel=1e-2)


def test_ends_are_named_and_others_pass():
    """Only what a law names meets: the far end, from the other side."""
    bodies = [SOFT | {"gap": 0.5}, point("right", 2.0, speed=-0.1), point("left", 0.2, speed=0.1)]
    law = [{"between": ["bar/far_end", "right"], "name": "hit"}]
    result = impactfem.solve(scene(bodies, 8.0, contacts=law, solve={"elements": 50}))
    assert column(result, "force.hit").max() > 0.0
    assert column(result, "left.vx") == pytest.approx(0.1, abs=1e-15)
    assert column(result, "left.x")[-1] > column(result, "bar.x")[-1]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"contacts": [{"between": ["bar/near_end", "m"]}]}, 'has no surface "near_end"'),
        ({"contacts": [{"between": ["bar", "m"], "restitution": 0.5}]}, "own elasticity"),
        ({"contacts": [{"between": ["bar", "m"], "friction_coefficient": 0.5}]}, "nothing slides"),
        ({"contacts": [{"between": ["bar", "m"]}, {"between": ["m", "bar"]}]}, "same faces"),
        ({"gravity": 9.81}, "give a vector"),
        ({"solve": {"method": "exact"}}, "does not solve bodies of different kinds"),
        ({"solve": {"window": 3}}, "solve.window"),
        ({"solve": {"elements": 3}, "gravity": [0.0, 0.0],
          "bodies": [SOFT | {"point": [0.0, 2.0], "axis": [0.0, 1.0]}, BLOCK]}, "belongs to bars"),
        ({"obstacles": [{"kind": "sphere", "center": [0, 0], "radius": 1.0}]}, "coordinates"),
    ],
)  # fmt: skip
def test_contradictions_are_refused(change, says):
    given = {"gravity": [0.0], "contacts": []} | change
    solve, gravity = given.pop("solve", {}), given.pop("gravity")
    bodies = given.pop("bodies", [SOFT, point("m", -1.0)])
    with pytest.raises(SceneError, match=says):
        scene(bodies, 1.0, solve=solve, **given, gravity=gravity)


@pytest.mark.parametrize(
    ("bar", "says"),
    [
        ({"point": [0.0, 0.0]}, "needs axis"),
        ({"point": [0.0, 0.0], "axis": [0.0, 1.0, 0.0]}, "has 3 entries"),
        ({"point": [0.0, 0.0], "axis": [0.0, 1.0], "gap": 0.1}, "remove gap"),
    ],
)
def test_places_in_space_are_given_once(bar, says):
    with pytest.raises(SceneError, match=says):
        impactfem.Bar(**{k: v for k, v in (SOFT | bar).items() if k != "kind"})


def test_what_cannot_be_is_said_when_meshed():
    bodies = [SOFT | {"gap": 0.5}, point("m", 1.0)]
    with pytest.raises(SceneError, match="bar and m overlap at t = 0"):
        impactfem.plan(scene(bodies, 1.0))
    law = [{"between": ["bar", "m"]}]
    with pytest.raises(SceneError, match="or they meet at other ends than it names"):
        impactfem.plan(scene([bodies[0], point("m", 2.0)], 1.0, contacts=law))
    with pytest.raises(SceneError, match=r"solve.elements = 20 .* remove one"):
        impactfem.plan(scene(bodies, 1.0, solve={"elements": 20, "dt": 0.01}))
    with pytest.raises(SceneError, match="longer than a wave needs"):
        impactfem.solve(scene([bodies[0], point("m", 2.0)], 4.0, solve={"dt": 2.0}))


def test_a_light_body_that_steps_do_not_resolve_is_told():
    def codes(mass):
        plan = impactfem.plan(scene([SOFT, point("m", -0.1, mass)], 1.0, solve={"elements": 20}))
        return {found.code for found in plan.findings}

    assert "contact_unresolved" in codes(0.1)
    light = impactfem.plan(scene([SOFT, point("m", -0.1, 1e-9)], 1.0))  # steps have a bound
    assert "contact_unresolved" in {found.code for found in light.findings}
    assert "contact_unresolved" not in codes(0.5)


def test_probes_of_bars_beside_others():
    """A wave of stress rho c v passes the middle at L / (2 c)."""
    speed = 1e-2
    probe = [{"name": "mid", "body": "bar", "point": [0.5],
              "quantities": ["displacement", "velocity", "stress"]}]  # fmt: skip
    bodies = [SOFT, point("m", 0.0, 1e6, speed)]
    result = impactfem.solve(scene(bodies, 0.9, solve={"elements": 100}, probe=probe))
    time, stress = column(result, "time"), column(result, "mid.sxx")
    assert np.abs(stress[time < 0.48]).max() < 1e-12
    assert stress[time > 0.52] == pytest.approx(-speed, rel=1e-6)
    assert column(result, "mid.vx")[time > 0.52] == pytest.approx(speed, rel=1e-6)
    assert column(result, "mid.ux")[-1] == pytest.approx(speed * (time[-1] - 0.5), rel=2e-2)
    with pytest.raises(SceneError, match=r"probe\[0\].point = \[1.5\] is outside"):
        impactfem.solve(scene(bodies, 0.9, probe=[probe[0] | {"point": [1.5]}]))


def several(**output):
    """A bar between a rod and a beam, with friction, in the plane."""
    bar = STEEL | {"length": 0.1, "point": [0.03, 0.003], "axis": [0.1, 1.0], "velocity": -1.0}
    beam = {
        "kind": "beam",
        "name": "beam",
        "length": 0.2,
        "height": 0.004,
        "width": 0.02,
        "density": 2700.0,
        "youngs_modulus": 70e9,
        "center": [0.0, 0.0],
        "elements": 4,
    }
    rod = {"kind": "rod", "name": "rod", "length": 0.05, "mass": 0.02, "radius": 0.002,
           "center": [0.045, 0.106], "velocity": [0.0, -2.0]}  # fmt: skip
    laws = [{"between": ["bar", "beam"], "friction_coefficient": 0.3},
            {"between": ["bar/far_end", "rod"]}]  # fmt: skip
    bodies = [beam, bar, rod]
    return scene(bodies, 1.5e-3, (0.0, -9.81), (), laws, {"dt": 2e-6},
                 output={"fields": []} | output)  # fmt: skip


RUBBER = FAR | {
    "name": "rubber", "density": 1000.0,
    "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [0.0, 0.0]},
}  # fmt: skip


def thrown(duration=0.01, *, strain="finite", speed=0.5, **output):
    """A bar strikes a block on its axis, amid an element, of which it and a ball rebound."""
    bar = {"kind": "bar", "name": "bar", "length": 0.2, "density": 1000.0, "youngs_modulus": 1e6,
           "area": 0.05, "point": [0.055, 0.1005], "axis": [0.0, 1.0],
           "velocity": -speed}  # fmt: skip
    ball = point("ball", 0.0) | {"position": [0.02, 0.1001], "velocity": [0.0, -speed]}
    block = RUBBER if strain == "finite" else dict(RUBBER, strain="small", material="linear")
    return scene([block, bar, ball], duration, (0.0, 0.0), solve={"dt": 1e-4},
                 output={"fields": []} | output)  # fmt: skip


def test_a_bar_strikes_rubber():
    """Steps are cut where it closes: energy is kept to rounding; slowly, as on a linear block."""
    rubber = impactfem.solve(thrown(0.02))
    energy, momentum = column(rubber, "total_energy"), column(rubber, "bar.vy")
    assert np.abs(energy - energy[0]).max() < 1e-10 * energy[0]
    assert momentum[-1] > 0.4
    assert column(rubber, "gap.rubber.bar").min() > -1e-10
    slow = [impactfem.solve(thrown(0.02, strain=s, speed=0.01)) for s in ("finite", "small")]
    here, there = (column(one, "bar.vy") for one in slow)
    assert np.abs(here - there).max() < 0.01 * 0.01


@alone_or_beside
def test_a_mass_on_a_clamped_bar_beside_what_cuts_steps(beside):
    """F = Z v exp(-t) until waves come back at 2 L / c; off whole time steps too."""
    bar = SOFT | {"far_end": "clamped", "point": [0.0, 0.1], "axis": [0.0, 1.0]}
    ball = point("m", 0.0) | {"position": [0.0, 0.08], "velocity": [0.0, SPEED], "radius": 0.01}
    far = {"position": [5.0, 5.0], "velocity": [0.0, 0.0]}
    other = FAR if beside else point("far", 0.0) | far
    for dt in (0.02, 0.013):
        result = impactfem.solve(scene([bar, ball, other], 2.1, (0.0, 0.0), solve={"dt": dt}))
        time = column(result, "time") - 0.01 / SPEED
        force = column(result, "force.bar.m")[1:] / SPEED
        middle = 0.5 * (time[1:] + time[:-1])
        early = (middle > dt) & (middle < 2.0 - 3.0 * dt)
        assert np.abs(force - np.exp(-middle))[early].max() < (2e-4 if beside else dt)
        energy = column(result, "total_energy")
        assert np.abs(energy - energy[0]).max() < (1e-12 if beside else 0.01) * energy[0]


@pytest.mark.parallel([1, 2])
@pytest.mark.slow
@pytest.mark.parametrize("case", ["several", "thrown"])
def test_a_continued_run_equals_the_whole_one(case, tmp_path, monkeypatch):
    if case == "thrown":
        whole, _ = check_restart(thrown(checkpoint=20), 63, tmp_path, monkeypatch)
        assert column(whole, "force.rubber.bar").max() > 0.0
        return
    case = several(checkpoint=200)
    whole, again = check_restart(case, 500, tmp_path, monkeypatch)
    assert column(whole, "force.bar.beam").max() > 0.0
    assert again.summary["bodies"] == whole.summary["bodies"]


@pytest.mark.parallel(2)
@pytest.mark.parametrize("case", [several, thrown])
def test_ranks_agree(case, monkeypatch):
    check_ranks(case, monkeypatch)


def test_a_bar_has_no_limits_of_strain_beside_other_bodies_as_alone():
    """Half its wave speed at the wall: a strain of 50 %, exact for d'Alembert's bar."""
    bar = SOFT | {"velocity": -0.5}
    ball = {"kind": "point", "name": "ball", "mass": 1.0, "position": [5.0]}
    runs = [
        scene([bar], 1.0, gravity=0.0, obstacles=[WALL], solve={"estimate": None}),
        scene([bar, ball], 1.0, obstacles=[WALL]),
    ]
    for summary in (impactfem.solve(run).summary for run in runs):
        assert summary["bodies"]["bar"]["strain_99"] == pytest.approx(0.5, rel=0.02)
        found = [entry["code"] for entry in summary["verdict"]["findings"]]
        assert "model_strain" not in found
        assert summary["status"] == "completed"

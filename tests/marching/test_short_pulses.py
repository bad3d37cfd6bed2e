"""Loads, supports and obstacles that change within a step: impulses, findings, refusals."""

import math

import numpy as np
import pytest

import impactfem
from impactfem import SceneError
from impactfem.scene.formula import Formula
from impactfem.scene.means import mean_of

SOLID = {
    "kind": "solid", "model": "plane_strain", "mesh_size": 0.1, "density": 1000.0,
    "youngs_modulus": 1e6, "poisson_ratio": 0.3,
}  # fmt: skip
FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, -5.0], "normal": [0.0, 1.0]}
END = 0.02
RANDOM = np.random.default_rng(31)


def pulse(width, peak, start=5e-3, end=8e-3):
    """A triangle, a box or a bell at a random time well before the end; its impulse."""
    at, kind = float(RANDOM.uniform(start, end)), RANDOM.choice(3)
    whole = 0.5 * np.sqrt(np.pi) * (math.erf(at / width) + math.erf((END - at) / width))
    bell = f"{peak}*exp(-((t - {at!r})/{width})**2)", peak * width * whole
    box = f"where(abs(t - {at!r}) < {0.5 * width}, {peak}, 0)", peak * width
    return ((f"{peak}*max(0, 1 - abs(t - {at!r})/{width})", peak * width), box, bell)[kind]


def scene(bodies, *, duration=END, obstacles=(FLOOR,), **more):
    given = {"estimate": False} | more.pop("solve", {})
    return impactfem.Scene.from_dict(
        {"title": "pulse", "duration": duration, "body": bodies, "obstacle": list(obstacles),
         "solve": given, "output": {"fields": []}} | more
    )  # fmt: skip


def codes(found):
    return {each.subject: each for each in found if each.code == "load_unresolved"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "strain"),
    [("explicit", "small"), ("massless", "small"), ("conserving", "small"), ("galerkin", "small"),
     ("explicit", "finite"), ("conserving", "finite")],
)  # fmt: skip
def test_a_solid_takes_the_impulse_of_a_pulse_wherever_it_lies(method, strain):
    """Widths of a thousandth of a step to three, on faces of 0.1 m."""
    bodies, given = [], {}
    for k, width in enumerate((1e-6, 1e-4, 7e-4, 3e-3)):
        (one, first), (two, second) = pulse(width, 300.0), pulse(width, 200.0)
        block = {"kind": "block", "size": [0.2, 0.1], "corner": [0.5 * k, 0.0]}
        bodies.append(SOLID | {
            "name": f"b{k}", "shape": block, "strain": strain,
            "tractions": [{"surface": "right", "value": [one, "0"]}],
            "pressures": [{"surface": "bottom", "value": two}],
        })  # fmt: skip
        given[f"b{k}"] = 0.1 * first / 20.0, 0.2 * second / 20.0
    result = impactfem.solve(scene(bodies, solve={"method": method}))
    told = {each["subject"] for each in result.summary["verdict"]["findings"]
            if each["code"] == "load_unresolved"}  # fmt: skip
    assert told >= {"b0", "b1"}
    # A pressure that follows its face turns a little with it.
    close = 1e-3 if strain == "finite" else 2e-7
    for name, speed in given.items():
        last = [result.history[f"{name}.v{axis}"].values[-1] for axis in "xy"]
        assert last == pytest.approx(speed, rel=close, abs=close * max(speed))


@pytest.mark.slow
def test_bodies_without_meshes_take_the_impulse_of_a_pulse():
    """Plates, boxes by force and moment, points of which forces depend on state, and joints."""
    step, given, bodies = {"dt": 1e-3}, {}, []
    for k, width in enumerate((1e-6, 3e-4, 2e-3)):
        texts, impulses = zip(
            *(pulse(width, peak) for peak in (300.0, 20.0, 7.0, 5.0)), strict=True
        )
        bodies += [
            {"kind": "plate", "name": f"plate{k}", "mesh_size": 0.1, "thickness": 0.01,
             "outline": {"kind": "rectangle", "size": [0.2, 0.2]}, "center": [0.0, 5.0 * k, 9.0],
             "density": 100.0, "youngs_modulus": 1e7, "poisson_ratio": 0.3,
             "pressures": [{"face": "bottom", "value": texts[0]}]},
            {"kind": "rigid", "name": f"box{k}", "mass": 2.0, "inertia": [0.1, 0.2, 0.3],
             "shape": {"kind": "block", "size": [0.2, 0.2, 0.2], "corner": [3.0, 5.0 * k, 9.0]},
             "force": [texts[1], "0", "-0*vx"], "moment": ["0", "0", texts[2]]},
            {"kind": "point", "name": f"point{k}", "mass": 2.0, "radius": 0.1,
             "position": [-3.0, 5.0 * k, 9.0], "force": [f"{texts[3]} + 0*x*y", "0", "0"]},
        ]  # fmt: skip
        given |= {
            f"plate{k}.vz": impulses[0] * 0.04 / 0.04, f"box{k}.vx": impulses[1] / 2.0,
            f"box{k}.wz": impulses[2] / 0.3, f"point{k}.vx": impulses[3] / 2.0,
        }  # fmt: skip
    floor = FLOOR | {"point": [0.0, 0.0, -5.0], "normal": [0.0, 0.0, 1.0]}
    history = impactfem.solve(scene(bodies, obstacles=[floor], solve=step)).history
    for name, speed in given.items():
        assert history[name].values[-1] == pytest.approx(speed, rel=2e-7), name


def test_motors_give_the_impulse_of_a_pulse():
    """Of a joint, and as a force: a hinged box of 2.05 kg m^2 about its hinge."""
    text, impulse = pulse(2e-5, 400.0)
    box = {"kind": "rigid", "name": "box", "mass": 2.0, "inertia": 0.05,
           "shape": {"kind": "block", "size": [0.2, 0.2], "corner": [0.9, -0.1]}}  # fmt: skip
    pin = {"name": "pin", "kind": "revolute", "between": ["ground", "box"], "point": [0.0, 0.0],
           "motor": f"{text} - 0*q"}  # fmt: skip
    rate = [
        impactfem.solve(scene([box | more], joint=[pin | less], solve={"dt": 1e-3}))
        .history["pin.v"].values[-1]
        for more, less in (({}, {}), ({"force": ["0", text]}, {"motor": "0"}))
    ]  # fmt: skip
    assert rate == pytest.approx([impulse / 2.05] * 2, rel=1e-5)


@pytest.mark.parametrize("method", ["event_driven", "moreau_jean", "paoli_schatzman"])
def test_points_take_the_impulse_of_a_pulse(method):
    """Of forces of time alone and with the state; pulses of 1e-6 s in .3 s."""
    for more in ("", " + 0*x*vx*y"):
        (text, impulse), (other, second) = pulse(1e-6, 1e3), pulse(2e-4, 10.0)
        point = {"kind": "point", "name": "p", "mass": 2.0, "position": [0.0, 1.0], "radius": 0.0,
                 "force": [text + more, other + more]}  # fmt: skip
        solve = {"method": method} | ({} if method == "event_driven" else {"dt": 1e-3})
        history = impactfem.solve(scene([point], duration=0.3, solve=solve)).history
        found = [history[f"p.{name}"].values[-1] for name in ("vx", "vy")]
        tails = second if "exp" in other else 0.0  # END is not the end of this run
        assert found == pytest.approx([impulse / 2.0, second / 2.0], rel=2e-7, abs=1e-6 * tails)


def test_means_of_formulas_with_places_and_kinks():
    places = np.array([0.1, 0.25, 0.5, 0.7])
    step = Formula("where(t < x, 1, 0)*where(x <= 0.5, 1, 2)", ("t", "x"))
    assert mean_of(step, 0.0, 1.0, x=places) == pytest.approx([0.1, 0.25, 0.5, 1.4], abs=2e-9)
    swing = mean_of(Formula("abs(sin(1e4*t))", ("t",)), 0.0, 1.0)
    assert swing == pytest.approx((2.0 * 3183 - np.cos(1e4 - 3183 * np.pi) + 1.0) / 1e4, rel=1e-5)
    hidden = Formula("3 + 1e3*exp(-((t - 0.123456)/1e-7)**2)", ("t",))
    levels = np.linspace(0.0, 1.0, 11)
    means = mean_of(hidden, levels[:-1], levels[1:])
    assert means[1] == pytest.approx(3.0 + 1e-3 * np.sqrt(np.pi), rel=1e-9)
    assert np.delete(means, 1) == pytest.approx(3.0, rel=1e-14)
    beside = Formula("1e4*t + where(abs(t - 0.123456) < 1e-7, 3e3, 0)", ("t",))
    assert mean_of(beside, 0.1, 0.2) == pytest.approx(1500.0 + 6e-3, rel=2e-8)


MOVED = "0.001*max(0, 1 - abs(t - 0.01017)/5e-5)"
DISC = {"name": "d", "shape": {"kind": "disc", "radius": 0.1, "center": [0.0, 0.2]}}
RIM = {"surface": "rim"}
LEFT = {"name": "d", "shape": {"kind": "block", "size": [0.2, 0.1], "corner": [0.0, 0.1]}}
GROUND = FLOOR | {"point": [0.0, 0.0]}


def planned(more, motion=None, **solve):
    moved = GROUND if motion is None else GROUND | {"motion": motion}
    return impactfem.plan(scene([SOLID | more], obstacles=[moved], solve=solve))


def held(value):
    return LEFT | {"supports": [{"surface": "left", "kind": "motion", "value": [value, "0"]}]}


def test_what_changes_within_a_step_is_told():
    """Once for each body or obstacle; alike in a frame that moves, and never of what is slow."""
    solve = {"method": "massless", "dt": 3e-4}
    for made in (
        planned(DISC, ["0", MOVED], **solve), planned(DISC, ["3*t", f"2*t + {MOVED}"], **solve),
        planned(held(MOVED), **solve), planned(held(f"{MOVED} + 0.2*t"), **solve),
        planned(DISC | {"tractions": [RIM | {"value": [f"1e6*{MOVED}", "1"]}]}, **solve),
    ):  # fmt: skip
        (found,) = codes(made.findings).values()
        assert found.severity == "warning"
        assert found.value > 0.4
        assert found.limit == 0.05
        assert "solve.dt <= " in found.remedy
    still = {"tractions": [RIM | {"value": ["1e3*sin(500*t) - 1e6", "1e5"]}]}
    for made in (
        planned(DISC | still, ["0", "1e-3*sin(400*t)"], **solve),
        planned(held("where(t < 0.00917, 0.3*t, 0.002751)"), **solve),
        planned(DISC | {"pressures": [RIM | {"value": "where(t < 0.01, 0, 9)"}]}, **solve),
    ):  # fmt: skip
        assert not codes(made.findings)


def test_plans_follow_what_changes_where_a_few_more_steps_do():
    usual = planned(DISC, method="massless")
    shaken = planned(DISC, ["0", "1e-3*sin(1500*t)"], method="massless")
    assert usual.numbers.dt > shaken.numbers.dt > usual.numbers.dt / 4.5
    assert "the motion of floor" in shaken.reasons["dt"]
    assert not codes(shaken.findings)


def test_a_support_that_is_elsewhere_at_the_start_is_a_jump():
    with pytest.raises(
        SceneError, match=r"supports\[0\].value.* jumps from 0 to 0.01 m at t = 0 s"
    ):
        scene([SOLID | held("0.01")])
    for fine in ("0.01*min(1, t/1e-3)", "0.3*t"):
        scene([SOLID | held(fine)])
    scene([SOLID | held("0.01")], start="static")

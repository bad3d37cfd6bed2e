"""Jointed bodies of any size: units, light bodies between heavy ones, slender turning.

The same scene in other units is the same motion, with the same verdict.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impactfem import Scene, solve
from impactfem.runs.scales import opening_findings

LENGTHS = (1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 10.0, 100.0, 1e3, 1e4)
SYSTEMS = [
    (length, length**3 * (1.0, 1e-6, 1e3)[k % 3], (length**0.5, 1.0, length)[k % 3])
    for k, length in enumerate(LENGTHS)
] + [(1e3, 1e3, 1.0)]
"""Metre, kilogram and second in fourteen systems of units: bodies of nm to 10 km, mm and g."""


class Units:
    """Lengths, masses and times of a scene in other units."""

    def __init__(self, length=1.0, mass=1.0, time=1.0):
        self.m, self.kg, self.s = length, mass, time
        self.N, self.J = mass * length / time**2, mass * length**2 / time**2

    def block(self, name, size, corner, mass):
        size, corner = ([self.m * x for x in each] for each in (size, corner))
        shape = {"kind": "block", "size": size, "corner": corner}
        return {"kind": "rigid", "name": name, "shape": shape, "mass": mass * self.kg}

    def scene(self, body, joint, floors, gravity, duration, dt, **law):
        """Bodies that meet half spaces, by these: point, normal."""
        obstacles = [
            {"kind": "half_space", "name": name, "point": [self.m * x for x in point]}
            | {"normal": normal}
            for name, (point, normal) in floors.items()
        ]
        contacts = [{"between": [b["name"], name]} | law for name in floors for b in body[-1:]]
        return Scene.from_dict(
            {
                "title": "sizes", "duration": duration * self.s, "body": body, "joint": joint,
                "gravity": [g * self.m / self.s**2 for g in gravity], "obstacle": obstacles,
                "contact": contacts, "output": {"fields": []},
                "solve": {"dt": dt * self.s, "estimate": False},
            }
        )  # fmt: skip

    def size(self, units, joint=""):
        """Of what a column has, by its units."""
        if " or " in units:
            units = units.split(" or ")["prismatic" in joint]
        above, _, below = units.partition("/")
        found = 1.0
        for names, sign in ((above, 1), (below, -1)):
            for name in names.split():
                unit, _, power = name.partition("^")
                found *= getattr(self, unit, 1.0) ** (sign * int(power or 1))
        return found


def three_links(units):
    """A spring, a damper, friction and limits of turns and of a slide, above a floor."""
    body = [
        units.block("a", [0.5, 0.05], [0.0, -0.025], 5.0),
        units.block("b", [0.4, 0.05], [0.5, -0.025], 2.5),
        units.block("c", [0.1, 0.1], [0.9, -0.05], 1.0),
    ]
    pivot = {"stiffness": 3.0, "damping": 0.1 * units.s, "friction": 0.5}
    slide = {"stiffness": 20.0, "friction": 0.3 * units.m, "limits": [-0.01, 0.01]}
    joint = [
        {"name": "j", "kind": "revolute", "between": ["ground", "a"], "point": [0.0, 0.0]}
        | {key: units.J * value for key, value in pivot.items()},
        {"name": "k", "kind": "revolute", "between": ["a", "b"], "point": [0.5 * units.m, 0.0]}
        | {"limits": [-0.02, 1.0], "restitution": 0.4},
        {"name": "prismatic", "kind": "prismatic", "between": ["b", "c"], "axis": [1.0, 0.0]}
        | {"point": [0.9 * units.m, 0.0], "stiffness": 20.0 * units.N / units.m}
        | {"friction": 0.3 * units.N, "limits": [x * units.m for x in slide["limits"]]},
    ]
    floors = {"f": ([0.0, -0.1], [0.0, 1.0])}
    law = {"restitution": 0.5, "friction_coefficient": 0.3}
    return units.scene(body, joint, floors, [0.3, -9.81], 0.16, 4e-3, **law)


def four_bars(units):
    """A plane linkage in space: three of its equations follow from the others."""
    body = [
        units.block("a", [0.05, 0.5, 0.05], [-0.025, -0.5, -0.025], 1.0),
        units.block("b", [0.6, 0.05, 0.05], [0.0, -0.525, -0.025], 2.0),
        units.block("c", [0.05, 0.5, 0.05], [0.575, -0.5, -0.025], 1.0),
    ]
    # One with round ends: corners across the plane would share what the motion does not determine.
    round_ = {"radius": 0.025, "length": 0.45, "center": [0.6, -0.25, 0.0]}
    shape = {k: (np.array(v) * units.m).tolist() for k, v in round_.items()}
    body[2]["shape"] = {"kind": "capsule", "axis": [0.0, 1.0, 0.0]} | shape
    chain = {"j1": ["ground", "a"], "j2": ["a", "b"], "j3": ["b", "c"], "j4": ["c", "ground"]}
    corners = [0.0, 0.0], [0.0, -0.5], [0.6, -0.5], [0.6, 0.0]
    more = {
        "j1": {}, "j2": {"stiffness": 2.0 * units.J},
        "j3": {"friction": 0.05 * units.J}, "j4": {},
    }  # fmt: skip
    joint = [
        {"name": name, "kind": "revolute", "between": sides, "axis": [0.0, 0.0, 1.0]}
        | {"point": [units.m * x for x in (*corner, 0.0)]} | more[name]
        for (name, sides), corner in zip(chain.items(), corners, strict=True)
    ]  # fmt: skip
    floors = {"f": ([0.635, 0.0, 0.0], [-1.0, 0.0, 0.0])}
    return units.scene(body, joint, floors, [9.0, -9.81, 0.0], 0.16, 4e-3, restitution=0.5)


@pytest.mark.slow
@pytest.mark.parametrize("made", [three_links, four_bars])
def test_units_change_neither_the_motion_nor_the_verdict(made):
    one = solve(made(Units()))
    assert one.summary["status"] == "completed"
    joints = {name.partition(".")[0] for name in one.history.data_vars if name.endswith(".lost")}
    struck = one.history["contact_impulse"].values
    assert (struck > 0.0).any()
    assert sum(one.summary["details"]["energy_taken"].values()) > 0.0
    whole = {}  # largest value of what has the same units
    for column in one.history.data_vars.values():
        size = np.nanmax(np.abs(column.values), initial=0.0)
        whole[column.attrs["units"]] = max(whole.get(column.attrs["units"], 0.0), size)
    told = [(f["code"], f["severity"]) for f in one.summary["verdict"]["findings"]]
    for system in SYSTEMS:
        units = Units(*system)
        other = solve(made(units))
        assert other.summary["status"] == "completed", system
        found = [(f["code"], f["severity"]) for f in other.summary["verdict"]["findings"]]
        assert found == told, system
        for name, column in one.history.data_vars.items():
            joint = name.partition(".")[0]
            size = units.size(column.attrs["units"], joint if joint in joints else "")
            off = np.abs(other.history[name].values / size - column.values)
            # Instants at which limits and floors are met round in places.
            assert np.nanmax(off, initial=0.0) < 1e-8 * whole[column.attrs["units"]], (system, name)


def hung(body, joint, dt=5e-3):
    """What hangs from the ground, and meets nothing, for 0.4 s."""
    far = {"far": ([-100.0, 0.0], [1.0, 0.0])}
    pivot = {"name": "j", "kind": "revolute", "between": ["ground", body[0]["name"]]}
    joint = [pivot | {"point": [0.0, 0.0]}, *joint]
    bodies = [*body, Units().block("stone", [1.0, 1.0], [5.0, 5.0], 1.0)]
    return solve(Units().scene(bodies[::-1], joint[::-1], far, [0.0, -9.81], 0.4, dt))


def test_a_body_without_inertia_of_its_own_swings_as_a_point():
    """Both of its rows then move it alike by turning it: neither follows from the other."""
    shape = {"kind": "disc", "radius": 0.1, "center": [1.0, -1.0]}
    bob = {"kind": "rigid", "name": "bob", "shape": shape, "mass": 1.0, "inertia": 1e-13}
    result = hung([bob], [], 2e-3)
    exact = solve_ivp(
        lambda _, y: [y[1], -9.81 / np.sqrt(2.0) * np.sin(y[0])], (0.0, 0.4), [np.pi / 4, 0.0],
        rtol=1e-11, atol=1e-12,
    ).y[0, -1]  # fmt: skip
    assert abs(result.history["bob.angle"].values[-1] + np.pi / 4 - exact) < 8e-6
    codes = [finding["code"] for finding in result.summary["verdict"]["findings"]]
    assert codes == ["no_estimate"]


def test_a_light_pin_holds_heavy_bodies_together():
    """What is between them changes the motion by its mass only."""
    arms = [Units().block(n, [0.4, 0.05], [x, -0.025], 1.0) for n, x in (("a", 0.0), ("b", 0.4))]
    at = {"kind": "revolute", "point": [0.4, 0.0]}
    alone = hung(arms, [{"name": "k", "between": ["a", "b"]} | at]).history
    for mass, off in ((1e-6, 2e-7), (1e-12, 1e-12)):
        shape = {"kind": "disc", "radius": 0.01, "center": [0.4, 0.0]}
        pin = {"kind": "rigid", "name": "pin", "shape": shape, "mass": mass}
        held = [
            {"name": "k", "kind": "fixed", "between": ["a", "pin"], "point": [0.4, 0.0]},
            {"name": "l", "between": ["pin", "b"]} | at,
        ]
        result = hung([*arms, pin], held)
        assert np.abs(result.history["b.y"].values - alone["b.y"].values).max() < off
        codes = [finding["code"] for finding in result.summary["verdict"]["findings"]]
        assert codes == ["no_estimate"]


def test_joints_that_open_are_told():
    """Axes that are not quite parallel: what follows but for that is not held."""
    made = four_bars(Units()).to_dict()
    made["joint"][2] |= {"axis": [1e-5, 0.0, 1.0]}
    case = Scene.from_dict(made)
    result = solve(case)
    found = result.summary["verdict"]["findings"]
    told = {f["subject"]: f for f in found if f["code"] == "joint_open"}
    assert sorted(told) == ["j2", "j3"]
    # One axis leans by 1e-5 and turns by 0.02 against the other.
    turned = float(result.history["j3.q"].values[-1])
    assert told["j3"]["value"] == pytest.approx(0.5 * 1e-5 * turned, rel=0.1)
    assert told["j3"]["severity"] == "warning"
    (fault,) = opening_findings(case, result.history, {"j2": (1e-3, 0.0), "j3": (0.0, 1e-9)})
    assert (fault.severity, fault.subject) == ("fault", "j2")
    assert "0.001 m, 0.2 % of a body" in fault.text

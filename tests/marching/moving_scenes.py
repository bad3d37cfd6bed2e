"""Small scenes with solids that use everything a checkpoint or several ranks may get wrong."""

import contextlib
from types import SimpleNamespace

import numpy as np
import pytest

import impactfem
import impactfem.models.solids

METHODS = ("explicit", "massless", "conserving", "galerkin", "moreau_jean", "newmark")
FLOOR = {"kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
BALL = {"kind": "sphere", "center": [0.0, -2.0], "radius": 2.0}
DISC = {"kind": "disc", "radius": 0.5, "center": [0.0, 0.51]}

FAR = {
    "kind": "solid", "name": "far", "model": "plane_strain", "strain": "finite",
    "material": "neo_hookean", "density": 1100.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3,
    "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [5.0, 5.0]}, "mesh_size": 0.05,
    "supports": [{"surface": "bottom", "kind": "fixed"}],
}  # fmt: skip
"""Rubber that touches nothing: steps of all bodies are Newton's iterates."""
FAR_3D = FAR | {
    "model": "3d", "shape": {"kind": "block", "size": [0.1] * 3, "corner": [5.0] * 3}
}  # fmt: skip
alone_or_beside = pytest.mark.parametrize("beside", [False, True], ids=["alone", "beside rubber"])


def scene(body, obstacles, duration, gravity, solve, output):
    """A scene with one solid of plane strain, unless the body says otherwise."""
    keys = {
        "name": "body", "kind": "solid", "model": "plane_strain", "density": 1.0,
        "youngs_modulus": 0.75, "poisson_ratio": 0.3, "strain": "small",
    }  # fmt: skip
    return impactfem.Scene.from_dict(
        {
            "title": "moving",
            "duration": duration,
            "gravity": gravity,
            "body": [keys | body],
            "obstacle": [{"name": f"o{i}"} | table for i, table in enumerate(obstacles)],
            "solve": {"estimate": False} | solve,
            "output": {"fields": ["vtkhdf"], "every": 3, "checkpoint": 5} | output,
        }
    )


def driven(method, duration=2.2, **solve):
    """A damped block with moving support, changing loads and gravity, on a moving round floor."""
    body = {
        "shape": {"kind": "block", "size": [1.0, 0.5], "corner": [0.0, 0.01]},
        "mesh_size": 0.125,
        "velocity": [0.02, -0.2],
        "rayleigh_mass": 0.05,
        "rayleigh_stiffness": 0.002,
        "supports": [
            {"surface": "left", "kind": "motion", "value": ["0.01*sin(2*t)", "-0.05*sin(t)"]}
        ],
        "tractions": [
            {
                "surface": "top",
                "value": ["0", "-0.1*t*x - 0.9*max(0, 1 - abs(t - x/3 - 0.7)/1e-2)"],
            }
        ],
        "pressures": [{"surface": "right", "value": "0.05*sin(3*t)"}],
    }
    round_floor = BALL | {"center": [0.8, -2.0], "motion": ["0", "0.02*sin(3*t)"]}
    gravity = [[0.0, [0.0, -0.2]], [1.0, [0.1, -0.1]]]
    settings = {"method": method, "normals": "updated"} | solve
    return scene(body, [round_floor], duration, gravity, settings, {})


def rolling(method, duration=4.0, **solve):
    """A disc that slides and turns down a ball until it meets a slope that comes nearer."""
    body = {"shape": DISC, "mesh_size": 0.125, "velocity": [0.15, -0.1], "angular_velocity": -0.3}
    slope = FLOOR | {"point": [0.6, 0.0], "normal": [-0.6, 0.8], "motion": ["-0.02*t", "0"]}
    settings = {"method": method, "normals": "updated"} | solve
    return scene(body, [BALL, slope], duration, [0.0, -0.05], settings, {})


def pumped(method, duration=4.0, **solve):
    """The disc of `rolling` with a pressure that follows its rim."""
    table = rolling(method, duration, **solve).to_dict()
    table["body"][0]["pressures"] = [{"surface": "rim", "value": "0.03*sin(3*t)"}]
    return impactfem.Scene.from_dict(table)


def resting(method, **solve):
    """A block on a floor, pressed aslant, that lies at rest and then is thrown up and turned."""
    body = {
        "shape": {"kind": "block", "size": [1.0, 0.5], "corner": [0.0, 0.0]}, "mesh_size": 0.125,
        "velocity": ["0", "0.02*x"],
        "pressures": [{"surface": "top", "value": "0.02*x*(1 - t)"}],
    }  # fmt: skip
    table = scene(body, [FLOOR], 2.0, [0.0, -0.05], {"method": method} | solve, {}).to_dict()
    return impactfem.Scene.from_dict(table | {"start": "static"})


def finite(made, method, duration=1.5, **solve):
    """One of the above under finite strain."""
    data = made(method, duration, **solve).to_dict()
    for body in data["body"]:
        body |= {"strain": "finite", "material": "neo_hookean"}
    return impactfem.Scene.from_dict(data)


def sliding(method, duration=3.0, **solve):
    """A long block that slides over a ball: contact runs along its bottom, from rank to rank."""
    body = {
        "shape": {"kind": "block", "size": [2.0, 0.3], "corner": [-1.5, 0.005]},
        "mesh_size": 0.15,
        "velocity": [0.4, -0.05],
    }
    settings = {"method": method, "normals": "updated"} | solve
    return scene(body, [BALL], duration, [0.0, -0.1], settings, {})


def block_on_sphere(method, cells="simplex", degree=1, size=0.2, **solve):
    """A block that slides obliquely over a sphere, in space."""
    body = {
        "model": "3d",
        "shape": {"kind": "block", "size": [1.0, 0.4, 0.6], "corner": [-0.45, 0.01, -0.28]},
        "mesh_size": size,
        "cells": cells,
        "degree": degree,
        "velocity": [0.2, -0.2, 0.1],
    }
    sphere = {"kind": "sphere", "center": [0.0, -1.0, 0.0], "radius": 1.0}
    settings = {"method": method, "normals": "updated"} | solve
    return scene(body, [sphere], 1.5, None, settings, {})


def rubbing(method, duration=1.5, **solve):
    """A disc that rubs on another one and on a floor."""
    table = pair(method, "updated", 0.3).to_dict() | {"duration": duration}
    return impactfem.Scene.from_dict(table | {"solve": table["solve"] | solve})


def pair(method, normals, friction, **more):
    """A disc that strikes another one aslant, above a floor that only one of them may meet."""
    plain = {
        "kind": "solid", "model": "plane_strain", "density": 1.0, "youngs_modulus": 1.0,
        "poisson_ratio": 0.3, "mesh_size": 0.125, "strain": "small",
    }  # fmt: skip
    one = plain | {"name": "one", "shape": DISC, "velocity": [0.1, -0.1]}
    two = plain | {"name": "two", "shape": DISC | {"center": [1.05, 0.71]}}
    return impactfem.Scene.from_dict(
        {
            "title": "pair", "duration": 2.0, "body": [one, two],
            "obstacle": [FLOOR | {"name": "floor"}],
            "contact": [
                {"between": ["one", "two"], "friction_coefficient": friction},
                {"between": ["one", "floor"], "friction_coefficient": friction},
            ],
            "probe": [
                {"name": "tip", "body": "two", "point": [0.72, 0.6],
                 "quantities": ["displacement", "velocity", "stress"]},
            ],
            "solve": {"method": method, "normals": normals, "estimate": False},
            "output": {"fields": ["vtkhdf"], "every": 3, "checkpoint": 4} | more,
        }
    )  # fmt: skip


def folding(method="conserving", friction=0.3, between=("ring", "ring"), **more):
    """A spinning ring in free flight, pinched so fast that it strikes itself."""
    body = {
        "name": "ring", "kind": "solid", "model": "plane_strain", "mesh_size": 0.005,
        "strain": "finite", "material": "neo_hookean", "density": 1100.0, "youngs_modulus": 1e6,
        "poisson_ratio": 0.4, "angular_velocity": 30.0,
        "shape": {
            "kind": "ring", "inner_radius": 0.037, "radius": 0.05, "center": [0.01, 0.02]
        },
        "velocity": ["0.3 + 57*(x - 0.01)", "-190*(y - 0.02)"],
    }  # fmt: skip
    return impactfem.Scene.from_dict(
        {
            "title": "a ring that folds", "duration": 0.014, "body": [body],
            "contact": [{"between": list(between), "friction_coefficient": friction}],
            "solve": {"method": method, "dt": 2e-4, "estimate": False},
            "output": {"fields": [], "checkpoint": 4},
        } | more
    )  # fmt: skip


class Stopped(BaseException):
    """What ends a march between two layers in a test."""


@contextlib.contextmanager
def stopping(monkeypatch, layer):
    """Have marches end before a layer, as a killed process does."""
    from impactfem.marching.level_march import LevelMarch
    from impactfem.marching.newton_march import NewtonMarch
    from impactfem.marching.solids import SolidMarch

    def stopped(advance):
        def stop(self):
            if self.layer == layer:
                raise Stopped
            return advance(self)

        return stop

    with monkeypatch.context() as patch:
        for march in (SolidMarch, NewtonMarch, LevelMarch):
            patch.setattr(march, "_advance", stopped(march._advance))
        try:
            yield
        except Stopped:
            return
    raise AssertionError("the march was not stopped")


@contextlib.contextmanager
def alone(monkeypatch):
    """Have every rank run the whole body by itself."""
    from impactfem.fem import MPI

    own = SimpleNamespace(COMM_WORLD=MPI.COMM_SELF, MAX=MPI.MAX, SUM=MPI.SUM)
    with monkeypatch.context() as patch:
        patch.setattr(impactfem.models.solids, "MPI", own)
        forget()
        yield
    forget()


def forget():
    """Have the next model meshed anew."""
    impactfem.models.solids._model.cache_clear()
    impactfem.models.solids._parts.cache_clear()


def check_ranks(made, monkeypatch, sizes=None, least=1.0):
    """Ranks that share a run and ranks that each do all of it have the same to 1e-10.

    Of the largest value of a column and of ``least``, or of what ``sizes`` gives for it.
    """
    both = impactfem.solve(made())
    with alone(monkeypatch):
        one = impactfem.solve(made())
    for name, apart in differences(both, one).items():
        size = (sizes or {}).get(name) or np.nanmax(np.abs(one.history[name]), initial=least)
        assert apart < 1e-10 * size, name


def check_restart(made, layer, tmp_path, monkeypatch):
    """A run that is stopped in a layer and goes on equals the whole to the last bit; both runs.

    On several ranks too, each of which has a `tmp_path` of its own.
    """
    from impactfem.fem import MPI

    tmp_path = MPI.COMM_WORLD.bcast(tmp_path, root=0)
    whole = impactfem.solve(made)
    with stopping(monkeypatch, layer):
        impactfem.solve(made, checkpoints=tmp_path)
    again = impactfem.solve(made, checkpoints=tmp_path, restart=tmp_path)
    found = MPI.COMM_WORLD.allgather(differences(whole, again))  # all fail, or none
    assert not any(found), found
    return whole, again


def differences(one, other):
    """Largest difference of each column of the histories and of each field, if there is any."""
    found = {}

    def note(name, a, b):
        a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
        if a.shape != b.shape:
            found[name] = f"shapes {a.shape} and {b.shape}"
        elif not np.array_equal(a, b, equal_nan=True):
            found[name] = float(np.nanmax(np.abs(a - b)))

    for name in one.history.data_vars:
        note(name, one.history[name].values, other.history[name].values)
    if one.fields is not None and other.fields is not None:
        note("times", one.fields.times, other.fields.times)
        for layer in range(min(len(one.fields), len(other.fields))):
            a, b = one.fields.read(layer), other.fields.read(layer)
            for name in a:
                note(f"{name} {layer}", a[name], b[name])
    return found

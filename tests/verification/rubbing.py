"""Scenes of solids that rub, with elastic moduli of 1 and weak gravity: bodies are nearly rigid."""

from solid_pairs import block

import impactfem

FLOOR = {"name": "floor", "kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
FLOOR_3D = FLOOR | {"point": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0]}
GRAVITY = 0.01


def rubbing(bodies, contacts, duration, gravity=None, obstacles=(FLOOR,), **solve):
    """A scene; ``contacts`` are two names and the coefficient, or None to leave the key out."""
    plain = {
        "kind": "solid", "model": "plane_strain", "density": 1.0, "youngs_modulus": 1.0,
        "poisson_ratio": 0.3,
    }  # fmt: skip
    laws = [
        {"between": [one, two]} | ({} if mu is None else {"friction_coefficient": mu})
        for one, two, mu in contacts
    ]
    return impactfem.Scene.from_dict(
        {
            "title": "rubbing",
            "duration": duration,
            "gravity": gravity,
            "body": [plain | body for body in bodies],
            "obstacle": list(obstacles),
            "contact": laws,
            "solve": {"estimate": False} | solve,
            "output": {"fields": []},
        }
    )


def settled(weight, height, axes=2):
    """Displacement of a block with nu = 0 and E = 1 under its own weight (density times g)."""
    up = "xyz"[axes - 1]
    return ["0"] * (axes - 1) + [f"-{weight}*({height}*{up} - {up}*{up}/2)"]


def work(result):
    """Frictional work of the run [J]."""
    return result.summary["details"]["friction_work"]


def oblique(mu, method="conserving", normals="fixed", **more):
    """A block that strikes another one obliquely, without gravity."""
    bodies = [
        block("low", [0.0, 0.0], [1.0, 0.5], 0.125),
        block("top", [0.1, 0.51], [0.6, 0.4], 0.1, velocity=[0.05, -0.05], density=2.0),
    ]
    step = {} if method in ("explicit", "galerkin") else {"dt": 0.05}
    settings = {"method": method, "normals": normals} | step | more
    return rubbing(bodies, [("top", "low", mu)], 3.0, None, (), **settings)


def thrown(mu, speed, method="conserving", duration=6.0, height=0.01):
    """A block thrown flat onto a floor, without damping."""
    body = block("block", [0.0, height], [1.0, 0.5], 0.25, velocity=list(speed))
    dt = {} if method == "explicit" else {"dt": 0.1}
    return rubbing(
        [body], [("block", "floor", mu)], duration, [0.0, -GRAVITY], method=method, **dt
    )  # fmt: skip

"""Scenes with several solids that strike each other, and what one reads off their histories."""

import numpy as np

import impactfem

EXPLICIT = ("explicit", "galerkin")
METHODS = ("explicit", "massless", "conserving", "moreau_jean", "galerkin", "newmark")


def scene(bodies, *, duration, obstacles=(), gravity=None, contacts=(), fields=(), **solve):
    """A scene of solids of density and modulus 1, nu = 0, in plane strain unless told otherwise.

    Args:
        bodies: Their tables, which change those values.
        duration: [s].
        obstacles: Tables of obstacles.
        gravity: [m/s^2].
        contacts: Pairs of names; none: every body may meet every other.
        fields: Kinds of files of fields.
        solve: Settings.
    """
    plain = {
        "kind": "solid", "strain": "small", "model": "plane_strain", "density": 1.0,
        "youngs_modulus": 1.0, "poisson_ratio": 0.0,
    }  # fmt: skip
    return impactfem.Scene.from_dict(
        {
            "title": "bodies",
            "duration": duration,
            "gravity": gravity,
            "body": [plain | body for body in bodies],
            "obstacle": [{"name": f"obstacle{k}"} | table for k, table in enumerate(obstacles)],
            "contact": [{"between": list(names)} for names in contacts],
            "solve": {"estimate": False} | solve,
            "output": {"fields": list(fields)},
        }
    )


def block(name, corner, size, mesh_size, **more):
    """Table of a block."""
    shape = {"kind": "block", "size": list(size), "corner": list(corner)}
    return {"name": name, "shape": shape, "mesh_size": mesh_size} | more


def disc(name, center, radius, mesh_size, **more):
    """Table of a disc."""
    shape = {"kind": "disc", "radius": radius, "center": list(center)}
    return {"name": name, "shape": shape, "mesh_size": mesh_size} | more


def velocity(result, name, row=-1):
    """Velocity of a body's centre of mass [m/s], (3,)."""
    return np.array([result.history[f"{name}.v{axis}"].values[row] for axis in "xyz"])

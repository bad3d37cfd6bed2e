"""Scenes with blocks that fall on their bottom, and what one reads off their histories."""

import numpy as np

import impactfem

METHODS = ("massless", "conserving", "explicit", "galerkin", "moreau_jean", "newmark")
EXPLICIT = ("explicit", "galerkin")


def solid_scene(body, obstacles, *, duration, gravity=None, **solve):
    """Scene of one solid of density and modulus 1, without fields."""
    body = {
        "name": "body", "kind": "solid", "model": "plane_strain", "cells": "hexahedron",
        "degree": 1, "strain": "small", "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.0,
    } | body  # fmt: skip
    return impactfem.Scene.from_dict(
        {
            "title": "test",
            "duration": duration,
            "gravity": gravity,
            "body": [body],
            "obstacle": [{"name": f"obstacle{k}"} | table for k, table in enumerate(obstacles)],
            "solve": {"estimate": False} | solve,
            "output": {"fields": []},
        }
    )


def floor(dim, **more):
    """Half-space below y = 0."""
    pad = [0.0] * (dim - 2)
    return {"kind": "half_space", "point": [0.0, 0.0, *pad], "normal": [0.0, 1.0, *pad]} | more


def column(model, elements, *, across=2, gap=0.5, speed=0.5, duration=5.0, gravity=0.0, **more):
    """A column of height 1, some elements along it and few across, thrown at the floor.

    Returns:
        The scene and the area of the column's bottom.
    """
    dim = 3 if model == "3d" else 2
    width, pad = across / elements, [0.0] * (dim - 2)
    body = {
        "model": model,
        "mesh_size": 1.0 / elements,
        "shape": {"kind": "block", "size": [width, 1.0, width][:dim], "corner": [0.0, gap, *pad]},
        "velocity": [0.0, -speed, *pad],
    }
    solve = more.pop("solve", {})
    scene = solid_scene(
        body | more, [floor(dim)], duration=duration,
        gravity=[0.0, -gravity, *pad] if gravity else None, **solve,
    )  # fmt: skip
    return scene, width ** (dim - 1)


def step(method, elements, *, wave_speed=1.0):
    """Step of a method: that of its waves, or the one with which implicit layers disperse least.

    With linear elements of length h and consistent mass, waves of the midpoint rule are right to
    the fourth order if dt = h / (c sqrt(2)).
    """
    if method == "galerkin":
        return {"method": method, "dt": 1.0 / (elements * wave_speed)}
    if method == "explicit":
        return {"method": method, "courant": 1.0}
    return {"method": method, "dt": np.sqrt(0.5) / (elements * wave_speed)}


def pulse(result, area=1.0):
    """Impulse and duration of the contact force.

    The duration is that of the rectangle with the same impulse and the same mean square: it does
    not depend on where weak forces begin and end.
    """
    times, force = result.history["time"].values, result.history["contact_force"].values / area
    impulse = float(np.sum(force[1:] * np.diff(times)))
    return impulse, impulse**2 / float(np.sum(force[1:] ** 2 * np.diff(times)))


def rates(errors):
    """Orders of convergence between errors on meshes each twice as fine as the last."""
    errors = np.abs(errors)
    return np.log2(errors[:-1] / errors[1:])

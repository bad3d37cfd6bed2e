"""Scenes with small solids, for tests of the plan."""

import impactfem

DISC = {"kind": "disc", "radius": 0.5, "center": [0.0, 0.5025]}
FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
FLOOR_3D = FLOOR | {"point": [0.0, 0.0, 0.0], "normal": [0.0, 1.0, 0.0]}


def solid_scene(*, obstacles=(FLOOR,), duration=4.0, gravity=None, solve=None, **body):
    """A disc of plane strain above a floor, unless other keys are given."""
    keys = {
        "name": "body", "kind": "solid", "model": "plane_strain", "shape": DISC, "mesh_size": 0.125,
        "density": 1.0, "youngs_modulus": 0.75, "poisson_ratio": 0.3, "velocity": [0.0, -0.0125],
    }  # fmt: skip
    tables = {
        "title": "plan of a solid",
        "duration": duration,
        "gravity": gravity,
        "body": [keys | body],
        "obstacle": [{"name": f"obstacle{i}"} | table for i, table in enumerate(obstacles)],
        "solve": solve or {},
        "output": {"fields": []},
    }
    return impactfem.Scene.from_dict(tables)

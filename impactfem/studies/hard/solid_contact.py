"""Hard cases of what is told: of peaks, unresolved contact, cut bodies, turns and strains."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from impactfem.studies.hard.board import Case, Claim, Facts
from impactfem.studies.hard.solid_facts import IMPLICIT, SOLID, SPEED, solid_scene, solved

_FACE: dict[str, Any] = {
    "shape": {"kind": "block", "size": [0.2, 1.0], "corner": [0.0, 0.0006]},
    "supports": [{"surface": side, "kind": "symmetry"} for side in ("left", "right")],
    "mesh_size": 0.05,
    "cells": "hexahedron",
}
_SLOW: dict[str, Any] = {"velocity": [0.0, -0.02]}


def _face(method: str) -> Facts:
    """A block's full face strikes a wall: the force is rho c v A until the wave is back."""
    contact = solved(method, solid_scene(2.3, **_FACE)).summary["contact"]
    exact = SPEED * 0.2
    return {"force": abs(contact["max_force"] / exact - 1.0)}


def _silent(method: str, code: str, scene: Any, **settings: Any) -> float:
    """0 if the verdict of a run has a finding of this code, else 1."""
    findings = solved(method, scene, **settings).summary["verdict"]["findings"]
    return float(code not in {finding["code"] for finding in findings})


def _few_steps(method: str) -> Facts:
    shape = {"kind": "disc", "radius": 0.5, "center": [0.0, 0.5002]}
    scene = solid_scene(9.0, shape=shape, **_SLOW)
    return {
        "silent": _silent(method, "contact_unresolved", scene, dt=0.9),
        "false alarm": 1.0 - _silent(method, "contact_unresolved", scene, dt=0.2),
    }


def _corner(method: str) -> Facts:
    square = {"kind": "block", "size": [1.0, 1.0], "corner": [-0.5, 0.5 * math.sqrt(2.0) - 0.499]}
    turned = solid_scene(3.0, shape=square | {"angle": 0.25 * math.pi}, mesh_size=0.2, **_SLOW)
    flat = solid_scene(3.0, shape=square | {"corner": [-0.5, 0.001]}, mesh_size=0.2, **_SLOW)
    return {
        "silent": _silent(method, "contact_single_node", turned),
        "false alarm": 1.0 - _silent(method, "contact_single_node", flat),
    }


def _half(method: str) -> Facts:
    """Half a disc on a mesh that is half of the whole one."""
    common: dict[str, Any] = {"mesh_size": 0.1, "cells": "hexahedron"}
    disc = {"kind": "disc", "radius": 0.5, "center": [0.0, 0.52]}
    shapes = disc, disc | {"symmetry": ["x"]}
    whole, half = (
        solved(method, solid_scene(2.5, shape=shape, **common), dt=0.02).history for shape in shapes
    )
    names = "contact_force", "total_energy", "momentum"
    return {
        "difference": max(
            float(np.abs(half[name] - whole[name]).max() / np.abs(whole[name]).max())
            for name in names
        )
    }


def _beyond(code: str, **body: Any) -> Callable[[str], Facts]:
    """A disc whose motion small strains do not describe, and one a twentieth as fast."""

    def beyond(method: str) -> Facts:
        slow = {key: np.multiply(value, 0.05).tolist() for key, value in body.items()}
        runs = [
            solved(method, solid_scene(1.5, mesh_size=0.25, **keys)).summary
            for keys in (body, slow)
        ]
        codes = [{f["code"] for f in summary["verdict"]["findings"]} for summary in runs]
        return {
            "silent": float(code not in codes[0] or runs[0]["status"] != "out_of_model"),
            "believed": float(runs[0]["verdict"]["level"] != "do_not_trust"),
            "false alarm": float(code in codes[1] or runs[1]["status"] != "completed"),
        }

    return beyond


def _outside(method: str) -> list[Claim]:
    return [*_told(method), Claim("believed", 0.0, "the verdict says: do not trust")]


def _told(_: str) -> list[Claim]:
    return [
        Claim("silent", 0.0, "the verdict says so"),
        Claim("false alarm", 0.0, "it says nothing of it where there is none"),
    ]


CASES: tuple[Case, ...] = (
    Case("full face at a wall", _face,
         lambda m: [Claim("force", 1e-9, "plane waves on layers are exact") if m == "galerkin" else
                    Claim("force", 0.07, "the largest force is rho c v A: rows overshoot by 30 %")],
         SOLID, body="solid"),
    Case("impact of few steps", _few_steps, _told, IMPLICIT, body="solid"),
    Case("square on its corner", _corner, _told, SOLID, body="solid"),
    Case("half a disc", _half,
         lambda _: [Claim("difference", 1e-9, "figures of a cut body are those of the whole")],
         SOLID, body="solid"),
    Case("disc that turns by 0.6", _beyond("model_rotation", velocity=[0.0, -SPEED],
                                           angular_velocity=0.4), _outside, SOLID, body="solid"),
    Case("v0 = 0.4 c, beyond small strains", _beyond("model_strain", velocity=[0.0, -0.4]),
         _outside, SOLID, body="solid"),
)  # fmt: skip
"""Hard cases of solids that ask what is told of contact."""

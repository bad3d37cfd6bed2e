"""Beams that turn far: runs that go on are equal to the last bit."""

from moving_scenes import check_restart

import impactfem


def hinged():
    return impactfem.Scene.from_dict(
        {
            "title": "hinged", "duration": 0.16, "gravity": [0.0, 0.0, -10.0],
            "body": [{
                "kind": "beam", "name": "whip", "length": 1.0, "height": 0.01, "width": 0.01,
                "density": 1000.0, "youngs_modulus": 1e7, "elements": 4,
                "center": [0.5, 0.0, 0.5], "strain": "finite", "contact": "along",
                "quality_factor": 50, "supports": [{"end": "first", "kind": "simply_supported"}],
            }],
            "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0, 0.4],
                          "normal": [0.0, 0.0, 1.0]}],
            "contact": [{"between": ["whip", "floor"], "friction_coefficient": 0.3}],
            "solve": {"dt": 4e-3, "estimate": False}, "output": {"fields": [], "checkpoint": 12},
        }
    )  # fmt: skip


def test_a_beam_that_turned_far_goes_on_as_if_it_had_not_stopped(tmp_path, monkeypatch):
    check_restart(hinged(), 36, tmp_path, monkeypatch)

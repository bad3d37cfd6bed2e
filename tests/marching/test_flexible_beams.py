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


def test_what_impacts_and_friction_take_is_all_that_is_lost():
    """A beam that turns as it strikes and slides: to rounding, in steps of any size."""
    body = {
        "kind": "beam", "name": "whip", "length": 0.4, "height": 0.008, "width": 0.008,
        "density": 1000.0, "youngs_modulus": 5e7, "elements": 8, "center": [0.0, 0.16],
        "inclination": 0.7, "velocity": [0.5, -1.0], "angular_velocity": 4.0,
        "strain": "finite", "contact": "along",
    }  # fmt: skip
    floor = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    contact = {"between": ["whip", "floor"], "friction_coefficient": 0.3}
    for dt in (8e-4, 4e-4):
        scene = {
            "title": "whip", "duration": 0.28, "gravity": [0.0, -9.81], "body": [body],
            "obstacle": [floor], "contact": [contact], "solve": {"dt": dt, "estimate": False},
            "output": {"fields": []},
        }  # fmt: skip
        result = impactfem.solve(impactfem.Scene.from_dict(scene))
        energy, taken = result.history["total_energy"].values, result.summary["energy"]["taken"]
        assert min(taken["impacts"], taken["friction"]) >= 1e-3 * energy[0]
        assert abs(sum(taken.values()) - energy[0] + energy[-1]) <= 1e-12 * energy[0]

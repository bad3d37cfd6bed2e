"""The rounding level of the exact solution, which is its own reference."""

import numpy as np

from impactfem.exact import ExactBar
from impactfem.reference.bar import Errors, exact_bar, exact_motion
from impactfem.scene import Scene

_OTHER_UNITS = 0.7310585786300049, 1.6180339887498949  # metres and seconds of the second solution


def rounding_of_exact(scene: Scene) -> Errors:
    """Difference of the characteristics solution from that of the same problem in other units.

    With other units all roundings differ, so the difference is the rounding level; that the
    solution itself is right is tested against closed forms.
    """
    bar, (metre, second) = scene.bar, _OTHER_UNITS
    exact = exact_bar(scene)
    other = ExactBar.from_functions(
        length=metre * bar.length,
        wave_speed=metre / second * bar.wave_speed,
        duration=second * scene.duration,
        displacement=lambda x: metre * (bar.initial_displacement(x=x / metre) + np.zeros_like(x)),
        velocity=lambda x: metre / second * (bar.initial_velocity(x=x / metre) + np.zeros_like(x)),
        gravity_times=second * np.array(scene.axial_gravity.times),
        gravity_values=metre / second**2 * np.array(scene.axial_gravity.values),
        far_end=exact.far_end,
    )
    # Not on the grid of the events: a jump has two values.
    t = scene.duration * (np.arange(500) + 0.5123) / 501
    x = bar.length * np.linspace(0.0, 1.0, 41)
    motion = exact_motion(exact, bar, scene.axial_gravity, np.append(0.0, t), x, 1)
    u = other.displacement(second * motion.times[:, None], metre * x[None, :]) / metre
    force = other.multiplier(second * t) * (second / metre) ** 2
    scale = np.abs(motion.displacement).max() or 1.0
    norm = np.linalg.norm(motion.displacement) or 1.0
    impulse = np.abs(motion.multiplier).sum() or 1.0
    return Errors(
        "rounding level: against the same solution in other units",
        float(np.abs(u - motion.displacement).max() / scale),
        float(np.linalg.norm(u - motion.displacement) / norm),
        float(np.abs(force - motion.multiplier).sum() / impulse),
    )

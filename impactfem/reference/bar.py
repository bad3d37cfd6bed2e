"""The exact solution of a scene, as a reference for errors and as a method of its own."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.exact import ExactBar
from impactfem.exact.drive import EndDrive
from impactfem.result.table import Series, Table
from impactfem.scene import Bar, PiecewiseConstant, Scene

if TYPE_CHECKING:  # plans need the exact solution, but no results
    from impactfem.result.bar_motion import BarMotion


MAX_TRANSITS = 1e6
"""Longest duration in transits of a wave through the bar."""

_TOLERANCE = 1e-11  # share of a transit's way that the pieces of a driven end may leave
_SAMPLES = 1001  # times of exact curves besides their jumps
_JUMPS = 2000  # jumps that a picture shows

# Gauss points of an interval for the integral of |force - exact force|.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)


def exact_bar(scene: Scene, duration: float | None = None) -> ExactBar:
    """Exact solution of the scene's bar by characteristics.

    Args:
        scene: Scene with one bar and one wall.
        duration: End of the solution [s]; the scene's duration if None.

    Raises:
        SceneError: The duration is too long to follow its waves.
    """
    bar = scene.bar
    transits = scene.duration / bar.transit_time
    if not transits <= MAX_TRANSITS:
        raise SceneError(
            f"duration = {scene.duration:g} s is {transits:.2g} transits L / c = "
            f"{bar.transit_time:g} s of a wave through {bar.name}, more than the "
            f"{MAX_TRANSITS:g} that are followed; give a shorter duration or a longer or softer bar"
        )
    return _followed(bar, scene.axial_gravity, scene.duration if duration is None else duration)


@lru_cache(maxsize=4)  # the plan, the solution and the measure of its error ask for the same one
def _followed(bar: Bar, gravity: PiecewiseConstant, duration: float) -> ExactBar:
    return in_units(bar, gravity, duration)


def in_units(
    bar: Bar, gravity: PiecewiseConstant, duration: float, metre: float = 1.0, second: float = 1.0,
    **settings: Any,
) -> ExactBar:  # fmt: skip
    """The exact solution with lengths multiplied by `metre` and times by `second`."""
    speed = metre / second
    drive = None
    if bar.is_driven:
        drive = EndDrive.sampled(
            lambda t: speed * bar.end_speed(t / second),
            [(second * at.before, second * at.after) for at in bar.end_cuts(duration)],
            duration=second * duration,
            transit=second * bar.transit_time,
            tolerance=settings.get("tolerance", _TOLERANCE),
        )
    return ExactBar.from_functions(
        length=metre * bar.length,
        wave_speed=speed * bar.wave_speed,
        duration=second * duration,
        displacement=lambda x: metre * (bar.initial_displacement(x=x / metre) + np.zeros_like(x)),
        velocity=lambda x: speed * (bar.initial_velocity(x=x / metre) + np.zeros_like(x)),
        gravity_times=second * np.array(gravity.times),
        gravity_values=speed / second * np.array(gravity.values),
        far_end="clamped" if bar.far_end == "clamped" else "free",
        drive=drive,
        damping=bar.end_damping / bar.impedance,
        **settings,
    )


@dataclass(frozen=True)
class Errors:
    """Errors against a reference, relative where the exact value is not 0.

    Attributes:
        reference: What the solution is compared with.
        displacement_max: Largest nodal error over the largest exact displacement.
        displacement_l2: L2 norm over space-time by the trapezoidal rule at the nodes, relative.
        force_l1: Integral of |force - exact force| over that of the exact force.
        measured: Whether that is an exact solution; else they are estimates.
        probes: Of what probes tell besides displacements, by ``PROBE.QUANTITY``: root of the mean
            square in time; None where further runs tell none.
    """

    reference: str
    displacement_max: float
    displacement_l2: float
    force_l1: float
    measured: bool = False
    probes: Mapping[str, float | None] = field(default_factory=dict)

    def plus(self, reference: "Errors") -> "Errors":
        """With those of the reference itself."""
        return Errors(
            f"{self.reference}, with its own error: {reference.reference}",
            self.displacement_max + reference.displacement_max,
            self.displacement_l2 + reference.displacement_l2,
            self.force_l1 + reference.force_l1,
            self.measured,
        )

    def times(self, motion: float, force: float) -> "Errors":
        """Those of the motion and that of the force multiplied."""
        return replace(
            self,
            displacement_max=motion * self.displacement_max,
            displacement_l2=motion * self.displacement_l2,
            force_l1=force * self.force_l1,
        )


def measure(motion: "BarMotion", exact: ExactBar) -> Errors:
    """Errors of a motion at the nodes of its kept levels, and of the force in its layers."""
    t, x = motion.times[motion.kept], motion.positions
    reference = exact.fields(t, x)[0]
    weights = trapezoidal(t), trapezoidal(x)
    size, whole = _largest(reference), norm(reference, *weights)
    difference = np.subtract(motion.displacement, reference, out=reference)  # they may be large
    largest = max(_largest(difference), np.abs(motion.gap - exact.gap(motion.times)).max())
    # Split the layers where the exact force jumps or bends: between it is linear.
    breaks = exact.multiplier_breaks
    inner = breaks[(breaks > motion.times[0]) & (breaks < motion.times[-1])]
    edges = np.union1d(motion.times, inner)
    width = np.diff(edges)[:, None]
    inside = edges[:-1, None] + 0.5 * width * (1.0 + _POINTS)
    layer = np.searchsorted(motion.times, inside[:, 0], side="left") - 1
    force = exact.multiplier(inside)
    quadrature = 0.5 * width * _WEIGHTS
    wrong = np.sum(quadrature * np.abs(motion.multiplier[layer, None] - force))
    how = "exact solution by characteristics"
    if exact.sampled:
        how += f", initial state in {exact.pieces} pieces"
        how += (
            f", prescribed motion of the far end in {exact.drive_pieces}"
            if exact.drive_pieces
            else ""
        )
    if exact.exact_until < t[-1]:
        how += f", exact until {exact.exact_until:.6g} s, then its smallest waves are merged"
    return Errors(
        how,
        relative(largest, size),
        relative(norm(difference, *weights), whole),
        relative(wrong, np.sum(quadrature * np.abs(force))),
        measured=True,
    )


def root_of_squares(values: Floats) -> float:
    """Root of the sum of squares of all values.

    The threads of a BLAS, which NumPy's norm calls, would take longer to wake up than the sum.
    """
    return float(np.sqrt(np.square(values).sum()))


def trapezoidal(grid: Floats) -> Floats:
    """Weights of the trapezoidal rule on a grid."""
    h = np.diff(grid)
    return 0.5 * (np.append(h, 0.0) + np.insert(h, 0, 0.0))


def _largest(values: Floats) -> float:
    """Largest of the sizes of all values, without an array of them."""
    return max(float(values.max()), -float(values.min()))


def norm(values: Floats, rows: Floats, columns: Floats) -> float:
    """Root of the weighted sum of squares of a table."""
    return float(np.sqrt(np.einsum("i,ij,ij,j", rows, values, values, columns)))


def relative(error: float, value: float) -> float:
    """The error over the value, or the error itself where the value is 0."""
    return float(error / value) if value > 0.0 else float(error)


def exact_motion(
    exact: ExactBar, bar: Bar, gravity: PiecewiseConstant, times: Floats, positions: Floats,
    every: int,
) -> "BarMotion":  # fmt: skip
    """The exact solution at given times: every row is at its time, the force its layer's mean."""
    from impactfem.result.bar_motion import BarMotion, Effort, kept_levels  # noqa: PLC0415

    kinetic, elastic, momentum, moment = exact.sums(times)
    mean = moment / bar.length
    kept = kept_levels(len(times) - 1, every)
    displacement, velocity = exact.fields(times[kept], positions)
    multiplier, driven = exact.mean_multiplier(times), exact.end_work(times)
    return BarMotion(
        times=times,
        positions=positions,
        kept=kept,
        displacement=displacement,
        velocity=velocity,
        gap=exact.gap(times),
        multiplier=multiplier,
        active=multiplier < 0.0,
        kinetic=kinetic,
        elastic=elastic,
        potential=bar.length * _potential(exact, gravity, times, mean) - driven,
        mean_displacement=mean,
        mean_velocity=momentum / bar.length,
        effort=Effort(message="closed form"),
        end_work=driven,
    )


def contact_figures(exact: ExactBar, bar: Bar) -> dict[str, Any]:
    """Contacts, largest force and impulse of the exact motion, for the summary."""
    section = bar.section
    return {
        "intervals": [list(contact) for contact in exact.contacts],
        "max_force": section * exact.largest_force,
        "impulse": -section * float(exact.force_integral(0.0, exact.duration)),
    }


def _potential(exact: ExactBar, gravity: PiecewiseConstant, times: Floats, mean: Floats) -> Floats:
    """p(0) u(0) minus the work of gravity per mass [m^2/s^2], see `BarMotion`."""
    switches = np.array([t for t in gravity.times if 0.0 < t < times[-1]])
    borders = np.concatenate([[0.0], switches])
    values = gravity(borders)
    at_borders = exact.mean_displacement(borders)
    start = values[0] * at_borders[0]
    done = start + np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(at_borders))])
    piece = np.searchsorted(switches, times, side="left")
    potential: Floats = done[piece] + values[piece] * (mean - at_borders[piece])
    return potential


def curve_times(jumps: Floats, end: float) -> Floats:
    """Times of a curve up to an end, with two beside each of its jumps [s]."""
    jumps = jumps[jumps < end]
    jumps = jumps[:: len(jumps) // _JUMPS + 1]
    times = np.concatenate([np.linspace(0.0, end, _SAMPLES), jumps, jumps + 1e-9 * end])
    return np.unique(times[times <= end])


def exact_curves(exact: ExactBar, bar: Bar, end: float) -> Table:
    """Exact gap and contact force for pictures, with two samples at each jump of the force."""
    jumps = np.asarray(exact.multiplier_breaks)
    times = curve_times(jumps[jumps > 0.0], end)
    force = -bar.section * exact.multiplier(times) + 0.0
    told = (("gap", exact.gap(times), "m"), ("contact_force", force, "N"))
    return Table.over_time(
        times,
        {
            name: Series(
                ("time",), values, {"units": unit, "long_name": f"exact {name.replace('_', ' ')}"}
            )
            for name, values, unit in told
        },
    )

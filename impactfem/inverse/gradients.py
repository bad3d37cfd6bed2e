"""The gradient of an objective, checked where it is taken."""

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError, SceneError
from impactfem.inverse.steps import Slopes
from impactfem.inverse.varied import Varied
from impactfem.methods import METHODS
from impactfem.scene import Scene

GOOD_RATE = 1.8
"""Least rate at which Taylor remainders of a right gradient fall, where 2 is expected."""

_LONGEST, _SHORTEST, _SHORTER = 1e-3, 1e-6, 10.0  # steps of the check, in sizes of parameters
_HALVINGS = 3
_KINK = 1e-6  # share by which slopes on both sides may differ
_MESHED_KINK = 0.05  # likewise where gaps that close from step to step bend what is computed
_VALLEY = 0.05  # share of the larger slope that the other may fall still: searches end beside kinks
_FAR, _BENT = 1e-2, 0.1  # sizes over which slopes of time steps are looked at; share they may miss
_ROUNDING = 1e-11  # share of the objective's size and change that is rounding in a remainder


@dataclass(frozen=True)
class TaylorCheck:
    """Remainders |J(p + h d) - J(p) - h g.d| in a random direction d, at h, h/2, h/4.

    Attributes:
        steps: h, in sizes of the parameters.
        remainders: As many.
        rate: Least order at which they fall; None if they are rounding only.
        margin: Change of the parameters, in their sizes, at which an impact passes a time that is
            looked at. The objective has a kink there, and remainders fall with the first order.
        sided: Whether they fall as they should against the direction only.
    """

    steps: tuple[float, ...]
    remainders: tuple[float, ...]
    rate: float | None
    margin: float = float("inf")
    sided: bool = False

    @property
    def kinked(self) -> bool:
        """Whether an impact is on a time that is looked at, so that both sides have a slope."""
        return self.margin < _SHORTEST

    @property
    def passed(self) -> bool:
        """Whether the gradient is right as far as this tells."""
        return self.rate is None or self.rate >= GOOD_RATE or self.kinked


@dataclass(frozen=True)
class Gradient:
    """An objective and its gradient.

    Attributes:
        objective: J.
        gradient: dJ/dp by the name of the parameter.
        measures: Of each measure its values and their derivatives by the name of the parameter.
        check: Taylor remainders.
        doubts: Why there may be no gradient here, in words.
        notes: What makes the search difficult, in words.
        method: The method of all runs.
        forward_runs: Runs without derivatives.
        gradient_runs: Runs with them.
        seconds_forward: Time of one run without them, the mean of those of the check [s].
        seconds_gradient: Time of the one with them [s].
        sides: dJ/dp below and above each parameter, by its name, where they differ; the gradient
            is then their mean. None: it is one.
        error: Of each derivative against that of the exact solution, by the name of the parameter;
            None: there is no mesh, or no solution without one.
    """

    objective: float
    gradient: dict[str, float]
    measures: dict[str, dict[str, Any]]
    check: TaylorCheck
    doubts: tuple[str, ...]
    method: str
    forward_runs: int
    gradient_runs: int
    seconds_forward: float
    seconds_gradient: float
    sides: dict[str, tuple[float, float]] | None = None
    error: dict[str, float] | None = None
    notes: tuple[str, ...] = ()

    @property
    def trusted(self) -> bool:
        """Whether the check passed and nothing speaks against a gradient."""
        return self.check.passed and not self.doubts

    def as_dict(self) -> dict[str, Any]:
        """Plain data of ``gradient.json``."""
        return {
            "objective": self.objective,
            "gradient": self.gradient,
            "measures": self.measures,
            "error": self.error,
            "notes": list(self.notes),
            "check": check_as_dict(self.check, self.doubts)
            | {"one_sided": None if self.sides is None else self.sides},
            "method": self.method,
            "cost": {
                "forward_runs": self.forward_runs,
                "gradient_runs": self.gradient_runs,
                "seconds_forward": self.seconds_forward,
                "seconds_gradient": self.seconds_gradient,
            },
        }


def check_as_dict(check: TaylorCheck, doubts: tuple[str, ...] | list[str]) -> dict[str, Any]:
    """Plain data of a check."""
    return {
        "taylor_rate": check.rate,
        "taylor_steps": list(check.steps),
        "taylor_remainders": list(check.remainders),
        "on_one_side": check.sided,
        "strict_complementarity": check.margin if np.isfinite(check.margin) else None,
        "passed": check.passed and not doubts,
        "doubts": list(doubts),
    }


def gradient(scene: Scene | str | Path) -> Gradient:
    """Take the gradient of a scene's objective by its parameters, at their starts.

    Points, one rod and one rigid body are followed from event to event with derivatives along
    (see `impactfem.vibro.tangents`); a bar by its exact solution at neighbouring values; solids
    along the sets of their time steps (see `impactfem.inverse.solids`).

    Args:
        scene: A scene with parameters and an objective, or measures with data; or its file.

    Raises:
        SceneError: The scene cannot work, or its method has no right derivatives.
        ConvergenceError: A run failed, or the motion has no derivative.
    """
    if not isinstance(scene, Scene):
        scene = Scene.from_toml(scene)
    varied = Varied.of(scene)
    start = varied.start
    begun = time.perf_counter()
    told = varied.jacobian(start)
    q, jacobian, doubts = told.numbers, told.jacobian, [*told.doubts, *kinks(varied, told)]
    took = time.perf_counter() - begun
    varied.check_moves(q, jacobian)
    slope = varied.quantities.slope(q) @ jacobian
    seed = scene.objective.seed if scene.objective else 0
    begun, before = time.perf_counter(), varied.forward
    check = replace(taylor_check(varied, start, q, slope, seed), margin=told.margin)
    plain = (time.perf_counter() - begun) / (varied.forward - before)
    doubts += _bends(varied, start, told, seed)
    if check.sided:
        doubts.append("the objective has a kink here: this is its gradient on one side")
    names = [each.name for each in varied.unknowns]
    sides = None
    if told.sides is not None:
        below, above = _beside(varied, told)
        sides = dict(zip(names, zip(below.tolist(), above.tolist(), strict=True), strict=True))
    measures = {
        measure.name: {
            "values": q[own].tolist(),
            "times": varied.quantities.data[k].times.tolist(),
            "gradient": dict(zip(names, jacobian[own].T.tolist(), strict=True)),
        }
        for k, (measure, own) in enumerate(
            zip(scene.measures, varied.quantities.slices, strict=True)
        )
    }
    return Gradient(
        objective=varied.quantities.objective(q),
        gradient=dict(zip(names, slope.tolist(), strict=True)),
        measures=measures,
        check=check,
        doubts=tuple(doubts),
        method=varied.chosen.method,
        forward_runs=varied.forward - varied.sloped,
        gradient_runs=varied.sloped,
        seconds_forward=plain,
        seconds_gradient=took,
        sides=sides,
        error=_error(varied, names, slope),
        notes=varied.quantities.notes,
    )


def _beside(varied: Varied, told: Slopes) -> tuple[Floats, Floats]:
    """Gradients below and above, (P,) each."""
    slope = varied.quantities.slope(told.numbers)
    below, above = (slope @ side for side in told.sides or (told.jacobian, told.jacobian))
    return below, above


def kinks(varied: Varied, told: Slopes, *, valley: bool = False) -> list[str]:
    """Why a gradient is none: kinks that the motion makes.

    Sides that a mesh makes are none: their mean is the derivative without it. Where no run tells
    what it makes, those are that differ by as much as slopes of discrete motions do.

    Args:
        varied: The scene.
        told: Of a run.
        valley: Whether the objective's least value is wanted: where it rises on both sides, a kink
            speaks for it.
    """
    meshed = not METHODS[varied.chosen.method].exact
    if told.sides is None or (meshed and varied.runs.reference(varied.scene) is not None):
        return []
    below, above = _beside(varied, told) if valley else told.sides
    below, above = np.atleast_2d(below), np.atleast_2d(above)
    larger = np.maximum(np.abs(below), np.abs(above))
    apart = np.abs(above - below) > (_MESHED_KINK if meshed else _KINK) * larger
    if valley:
        apart &= (below > _VALLEY * larger) | (above < -_VALLEY * larger)
    if not apart.any():
        return []
    n, k = np.unravel_index(np.where(apart, np.abs(above - below), 0.0).argmax(), apart.shape)
    both = f"{below[n, k]:.6g} below and {above[n, k]:.6g} above"
    name = varied.unknowns[k].name
    return [f"{name}: slopes differ on both sides, {both}; their mean is given"]


def _error(varied: Varied, names: Sequence[str], slope: Floats) -> dict[str, float] | None:
    """How far each derivative is from that of the exact solution; None where it has no mesh."""
    reference = varied.runs.reference(varied.scene)
    if reference is None:
        return None
    told = replace(varied, runs=reference, kept=None, _last=None).jacobian(varied.start)
    other = varied.quantities.slope(told.numbers) @ told.jacobian
    return dict(zip(names, np.abs(other - slope).tolist(), strict=True))


def taylor_check(varied: Varied, at: Floats, q: Floats, slope: Floats, seed: int) -> TaylorCheck:
    """Hold a gradient against runs of their own in a random direction.

    Steps are shortened where the order of events changes within them. The check is made along the
    direction and against it: at a kink, or where something is just touched, a gradient holds on
    one side.

    Args:
        varied: The scene.
        at: Parameters (P,).
        q: Numbers of the run there.
        slope: The gradient (P,).
        seed: Of the direction.
    """
    first, way = varied.quantities.objective(q), _way(varied, at, seed)
    found = [_shortened(varied, at, first, slope, way)]
    with suppress(SceneError):
        found.append(_shortened(varied, at, first, slope, -way))
    passed = [each for each in found if each.passed]
    return replace((passed or found)[0], sided=0 < len(passed) < len(found))


def _way(varied: Varied, at: Floats, seed: int) -> Floats:
    """A random direction, by sizes of the parameters, (P,)."""
    way = np.random.default_rng(seed).standard_normal(len(at))
    way *= varied.scales / np.linalg.norm(way)
    for k in range(len(at)):  # inwards, where there are no scenes beyond
        beside = at.copy()
        beside[k] += _LONGEST * way[k]
        with suppress(SceneError):
            varied.at(beside)
            continue
        way[k] = -way[k]
    return way


def _bends(varied: Varied, at: Floats, told: Slopes, seed: int) -> list[str]:
    """What runs a little farther away change by otherwise than derivatives tell, in words.

    What time steps compute bends as nodes close one after the other, and as a touch passes through
    a step: its slope, however right, may be that of a wrinkle. Where no run without these is known,
    parabolas through runs beside tell.
    """
    if not varied.wrinkles:
        return []
    way, of = _FAR * _way(varied, at, seed), varied.quantities
    for a, b in ((1.0, -1.0), (1.0, 0.5), (-1.0, -0.5)):
        with suppress(SceneError, ConvergenceError):
            beside = [varied.numbers(at + share * way) for share in (a, b)]
            break
    else:
        return []
    here, one, other = (np.append(q, of.objective(q)) for q in (told.numbers, *beside))
    changed = (b * b * (one - here) - a * a * (other - here)) / (a * b * (b - a))
    slopes = np.vstack([told.jacobian, of.slope(told.numbers) @ told.jacobian])
    meant, far = slopes @ way, []
    names = [measure.name for measure in varied.scene.measures]
    for name, own in zip(["objective", *names], [slice(-1, None), *of.slices], strict=True):
        size = max(np.linalg.norm(changed[own]), np.linalg.norm(meant[own]))
        k = own.start + int(np.abs(changed[own] - meant[own]).argmax())
        least = max(_BENT * size, _KINK * float(np.linalg.norm(here[own])))
        if np.linalg.norm(changed[own] - meant[own]) > least:
            far.append(f"{name} {changed[k]:.3g} ({meant[k]:.3g})")
    text = f"over 1 % of what varies runs change by (derivatives tell) {', '.join(far)}: as nodes "
    text += (
        "close one after the other what is computed has wrinkles, and this is the slope of one; "
    )
    return [f"{text}take differences of runs so far apart"] if far else []


def _shortened(varied: Varied, at: Floats, first: float, slope: Floats, way: Floats) -> TaylorCheck:
    """The check in a direction, with shorter steps as long as it fails."""
    tried: list[TaylorCheck] = []
    longest = _LONGEST
    while longest >= _SHORTEST:
        tried.append(_remainders(varied, at, first, slope, way, longest))
        if tried[-1].passed:
            break
        longest /= _SHORTER
    return max(tried, key=lambda each: 2.0 if each.rate is None else each.rate)


def _remainders(
    varied: Varied, at: Floats, first: float, slope: Floats, way: Floats, longest: float
) -> TaylorCheck:
    steps, left, sizes = [], [], []
    for k in range(_HALVINGS):
        h = longest * 0.5**k
        value = _objective(varied, at, h * way)
        steps.append(h)
        left.append(abs(value - first - h * float(slope @ way)))
        sizes.append(abs(first) + abs(value - first))
    noise = _ROUNDING * max(sizes)
    if max(left) <= noise:
        return TaylorCheck(tuple(steps), tuple(left), None)
    rates = [float(np.log2(a / b)) for a, b in pairwise(left) if b > 0.1 * noise]
    return TaylorCheck(tuple(steps), tuple(left), min(rates, default=None))


def _objective(varied: Varied, at: Floats, change: Floats) -> float:
    """J at a place beside.

    Raises:
        SceneError: There is no run.
    """
    try:
        return varied.quantities.objective(varied.numbers(at + change))
    except (SceneError, ConvergenceError) as error:
        raise SceneError(f"gradient: it cannot be checked beside the start: {error}") from error

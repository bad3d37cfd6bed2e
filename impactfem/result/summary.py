"""Types of the summary of a run, for editors and type checkers; keys as in ``summary.json``.

A number that is not finite is None there whatever its type says: then the verdict says why.
"""

from typing import Any, TypedDict


class ActiveSetFigures(TypedDict):
    """How contact was solved: linear solves, changes of the set after each, whether it settled."""

    iterations: int
    set_changes: list[int]
    converged: bool
    message: str
    iterates: list[dict[str, list[Any]]]


class EnergyFigures(TypedDict):
    """Energies [J] and their change over the largest one."""

    initial: float
    final: float
    max_relative_drift: float
    final_relative_drift: float
    max_relative_growth: float
    grows: bool
    driven: bool
    taken: dict[str, float]
    unexplained: float


class ControllerFigures(TypedDict):
    """What a controller has done; see `docs/feedback.md`. None where it is not known."""

    kind: str
    sample: float
    inertia: float | None
    spectral_radius: float | None
    saturated: float
    largest: float
    work: float | None


class ContactFigures(TypedDict, total=False):
    """Contact: intervals [s], forces [N], impulses [N s], penetration [m].

    Points, rods and beams have `max_impulse`; scenes of several pairs `pairs`; `unknown` names
    figures that are None because they depend on the step.
    """

    intervals: list[list[float]]
    max_force: float | None
    max_force_raw: float | None
    force_window: float
    impulse: float | None
    max_impulse: float | None
    max_penetration: float
    pairs: list[dict[str, Any]]
    unknown: list[str]


class ErrorFigures(TypedDict):
    """Relative errors, measured against an exact solution or estimated."""

    reference: str
    displacement_max: float
    displacement_l2: float
    force_l1: float
    measured: bool
    probes: dict[str, float | None]


class FindingFigures(TypedDict):
    """One finding: what is told, of what, the figure against its limit, the remedy."""

    code: str
    severity: str
    text: str
    subject: str
    value: float | None
    limit: float | None
    remedy: str


class VerdictFigures(TypedDict):
    """``trust``, ``care`` or ``do_not_trust``, and why."""

    level: str
    findings: list[FindingFigures]


class Summary(TypedDict, total=False):
    """Figures of a run; all are there, but `files` only of one that was saved."""

    title: str
    status: str
    method: str
    num_dofs: int
    num_steps: int
    wall_time: float
    compile_time: float
    peak_memory_mib: float
    ranks: int
    active_set: ActiveSetFigures
    energy: EnergyFigures
    contact: ContactFigures
    error: ErrorFigures | None
    bodies: dict[str, dict[str, Any]]
    controllers: dict[str, ControllerFigures]
    details: dict[str, Any]
    plan: dict[str, Any]
    verdict: VerdictFigures
    run: dict[str, Any]
    files: list[str]

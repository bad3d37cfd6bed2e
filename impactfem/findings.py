"""What a plan foresees or a run finds about its own figures: findings with a code and a remedy."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

type Severity = Literal["note", "warning", "fault"]
type Level = Literal["trust", "care", "do_not_trust"]

CODES: Mapping[str, str] = {
    "model_rotation": "a body turns further than small-strain elasticity allows",
    "model_strain": "a body is strained further than small-strain elasticity allows",
    "model_thin": "a body is thicker than its theory is for",
    "model_layers": "layers couple bending and stretching, which is left out",
    "contact_unresolved": "a contact lasts too few steps",
    "load_unresolved": "loads, supports or obstacles change within a step",
    "contact_single_node": "a single node carries the contact force",
    "force_peak": "the largest force of a step belongs to the mesh",
    "rounding_growth": "rounding grows from contact to contact",
    "energy_growth": "the energy grows though nothing feeds it",
    "energy_loss": "energy is lost that nothing in the scene takes",
    "error_large": "the error that was measured or estimated is large",
    "penetration": "bodies penetrate",
    "friction_nonunique": "friction allows several motions",
    "overconstrained": "contact forces are not determined by the equations of motion",
    "tie_parted": "a tie has let go",
    "joint_open": "a joint does not hold its bodies together",
    "no_estimate": "the error is neither measured nor estimated",
    "not_converged": "a contact problem or a linear system was not solved",
    "interrupted": "the run ended before its duration",
    "not_finite": "figures are not finite",
    "outside_contact": "nodes without contact unknowns reach an obstacle",
    "meets_nothing": "a body meets nothing",
    "units": "units do not seem to fit",
    "overlapping_parts": "parts of a rigid body share room, which counts twice in its mass",
    "setting": "a setting that changes the answer is missing or unusual",
    "impact_law": "no law is settled for this impact",
    "controller": "what a controller does within its samples, and whether it settles",
    "control_method": "a method for comparison only",
    "locking": "elements are too stiff for this body",
    "ringing": "the contact force rings",
    "mesh_file": "part of a mesh file is not used as it stands",
    "robot_file": "part of a robot file is not used as it stands",
    "drawing": "a picture could not be drawn",
}
"""What each code stands for; a code is never given another meaning."""

ROTATION_LIMITS = (0.1, 0.3)
"""Rotation [rad] from which small-strain elasticity calls for care, and no longer holds."""

STRAIN_LIMITS = (0.05, 0.2)
"""Principal strain of 1 % of a body's volume from which it calls for care, and does not hold."""

_ORDER: tuple[Severity, ...] = ("fault", "warning", "note")


@dataclass(frozen=True)
class Finding:
    """One thing that a user should know before trusting a figure.

    Attributes:
        code: One of `CODES`.
        severity: "note" (no reason to doubt), "warning" (care), "fault" (do not trust).
        text: One sentence in plain words, without the remedy; numbers with units.
        subject: Body, pair, obstacle or file that it is about; empty for the whole run.
        value: What was found, in SI units or as a share; None if it has no number.
        limit: The value from which it is told; None if there is none.
        remedy: What to do.
    """

    code: str
    severity: Severity
    text: str
    subject: str = ""
    value: float | None = None
    limit: float | None = None
    remedy: str = ""

    def __post_init__(self) -> None:
        if self.code not in CODES:
            raise ValueError(f"{self.code!r} is no code of a finding; CODES lists them")

    @property
    def sentence(self) -> str:
        """The text with its remedy."""
        return f"{self.text}; {self.remedy}" if self.remedy else self.text

    def as_dict(self) -> dict[str, Any]:
        """Plain data, as in ``summary.json``."""
        return asdict(self)


def warning(code: str, text: str, subject: str = "", remedy: str = "") -> Finding:
    """A warning without a number."""
    return Finding(code, "warning", text, subject, remedy=remedy)


def by_limits(
    code: str, value: float, limits: tuple[float, float], text: str,
    subject: str = "", remedy: str = "",
) -> tuple[Finding, ...]:  # fmt: skip
    """A warning or a fault where a value exceeds its limit; nothing where it exceeds none.

    Args:
        code: One of `CODES`.
        value: What was found; not a number counts as beyond all limits.
        limits: Values beyond which it is a warning, and a fault.
        text: One sentence.
        subject: What it is about.
        remedy: What to do.
    """
    careful, faulty = limits
    if value <= careful:
        return ()
    severity: Severity = "warning" if value <= faulty else "fault"
    limit = careful if value <= faulty else faulty
    return (Finding(code, severity, text, subject, value, limit, remedy),)


def level_of(findings: Iterable[Finding]) -> Level:
    """What findings together say."""
    severities = {finding.severity for finding in findings}
    if "fault" in severities:
        return "do_not_trust"
    return "care" if "warning" in severities else "trust"


def settled(
    foreseen: Iterable[Finding], found: Iterable[Finding], measured: Iterable[str] = ()
) -> tuple[Finding, ...]:
    """Findings of a plan and of its run, the worst first.

    Args:
        foreseen: Those of the plan.
        found: Those of the run: of the same code and subject they replace the plan's.
        measured: Codes that the run has looked for: what the plan foresaw of them is settled,
            also where nothing was found.
    """
    facts, settled_codes = tuple(found), frozenset(measured)
    known = {(finding.code, finding.subject) for finding in facts}
    kept = [
        finding
        for finding in foreseen
        if finding.code not in settled_codes and (finding.code, finding.subject) not in known
    ]
    every = dict.fromkeys([*facts, *kept])
    return tuple(sorted(every, key=lambda finding: _ORDER.index(finding.severity)))


def percent(share: float) -> str:
    """A share as a percentage; tiny ones as they are, huge ones as a multiple."""
    if share != 0.0 and not 1e-4 <= abs(share) < 100.0:
        return f"{share:.2g}" if abs(share) < 1.0 else f"{share:.2g}-fold"
    return f"{float(f'{100 * share:.2g}'):g} %"

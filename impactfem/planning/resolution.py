"""Whether a contact will be resolved by steps and nodes: what can be said of it."""

from impactfem.findings import Finding

STEPS = (8, 3)
"""Steps from which the speed after an impact is right to some 5 %, and up to which to 20 to 50 %.

Measured with discs and balls: 8 steps leave 2 to 5 %, 16 steps 1 to 2 %, 4 steps 5 to 20 %.
"""

SINGLE_LIMIT = 0.5
"""Share of the impulse that one node carries alone from where the force depends on the mesh."""


def unresolved(steps: float, text: str) -> Finding:
    """A contact of too few steps."""
    fault = steps <= STEPS[1]
    return Finding(
        "contact_unresolved", "fault" if fault else "warning", text, value=steps,
        limit=float(STEPS[1] if fault else STEPS[0]),
        remedy=f"take a smaller solve.dt: {STEPS[0]} steps leave errors of 5 %, 16 of 1 to 2 %",
    )  # fmt: skip


def single_node(share: float, text: str) -> Finding:
    """Contact on a single node."""
    return Finding(
        "contact_single_node", "warning", f"{text}: force and duration depend on the mesh",
        value=share, limit=SINGLE_LIMIT,
        remedy="take smaller elements where it touches, or round the corner off",
    )  # fmt: skip

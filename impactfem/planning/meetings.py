"""How the solids of a scene meet: who carries what, why a node has no contact, who meets nobody."""

from typing import TYPE_CHECKING

from impactfem.findings import Finding, warning
from impactfem.scene.pairing import body_pairs, friction_of

if TYPE_CHECKING:
    from impactfem.models.solids import SolidPart, SolidsModel

_WARNING = "warning: "


def told_contacts(model: "SolidsModel", reasons: dict[str, str]) -> list[Finding]:
    """What may be a mistake: bodies that nothing can touch, and pairs that cannot meet.

    Args:
        model: The solids.
        reasons: Gets one for each pair of bodies that can meet, and for what cannot touch.
    """
    scene, found = model.scene, []
    meetings = [p.names for p in model.pairs] + [met.names for met in model.ball_meetings]
    meetings += model.crowd.names if scene.contacts else []
    met = {name for names in meetings for name in names}
    for pair in model.pairs:
        friction = friction_of(scene, *pair.names)
        words = f", friction {friction:g}" if friction else ""
        key = f"contact {pair.names[0]} and {pair.names[1]}"
        reasons[key] = f"{pair.why} ({pair.count}{words})"
    for part in model.parts:
        found += _told_of(part, reasons, meets=part.solid.name in met, alone=len(model.names) == 1)
    pairs = [set(names) for names in meetings]
    for (one, _), (two, _) in body_pairs(scene) if scene.contacts else []:
        if {one, two} <= met and {one, two} not in pairs:
            text = f"bodies {one} and {two} cannot meet: none of their faces are opposite"
            found.append(warning("meets_nothing", text, f"{one}.{two}"))
    return found


def _told_of(
    part: "SolidPart", reasons: dict[str, str], *, meets: bool, alone: bool
) -> list[Finding]:
    """What its obstacles are told for, and a finding if nothing can touch it."""
    name, scene = part.solid.name, part.scene
    said = () if part.contact is None else part.contact.why
    why = []
    for number, text in enumerate(said, 1):
        if text.startswith(_WARNING):
            why.append(text.removeprefix(_WARNING))
        else:
            reasons[f"contact {number}" if alone else f"contact of {name} {number}"] = text
    if meets:
        return []
    if not why and (part.contact is None or not part.contact.count):
        if any(name in joint.bodies for joint in scene.couplings):
            return []  # a joint moves it
        asked = any(name in {one, two} for (one, _), (two, _) in body_pairs(scene))
        because = "no face of it looks at another body or an obstacle"
        if not asked and not part.obstacles:
            if not scene.obstacles and len(scene.bodies) == 1:
                return []  # it vibrates
            because = "no [[contact]] names it"
        why.append(f"body {name} touches nothing: {because}")
    return [warning("meets_nothing", text, name) for text in why]

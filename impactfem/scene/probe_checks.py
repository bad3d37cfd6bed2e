"""Checks of the probes of a scene."""

from impactfem.scene.column_names import RESERVED
from impactfem.scene.content import Content
from impactfem.scene.nearest import meant
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show


def check_probes(scene: Content) -> None:
    """Refuse probes that contradict the rest of a scene.

    Raises:
        KeyedError: naming the key.
    """
    bodies = {body.name: body for body in scene.bodies}
    taken = dict.fromkeys(RESERVED, "a column") | dict.fromkeys(bodies, "a body")
    for index, probe in enumerate(scene.probes):
        where = f"probe[{index}]"
        if probe.name in taken:
            text = f" = {show(probe.name)} is the name of {taken[probe.name]} too: give another."
            raise KeyedError(where, "name", text)
        taken[probe.name] = where
        if probe.body not in bodies:
            text = f" = {show(probe.body)}: there is no such body; {meant(probe.body, bodies)}."
            raise KeyedError(where, "body", text)
        if len(probe.point) != scene.dim:
            text = f" = {show(list(probe.point))} has {len(probe.point)} entries, but the scene has"
            raise KeyedError(where, "point", f"{text} {scene.dim} coordinates: give {scene.dim}.")
        known = bodies[probe.body].probed
        for quantity in probe.quantities:
            if quantity not in known:
                text = f" = {show(list(probe.quantities))}: of a {bodies[probe.body].kind} only "
                text += f"{' and '.join(known)} are known; remove {show(quantity)}."
                raise KeyedError(where, "quantities", text)

"""Which surfaces of a solid joints hold."""

from typing import TYPE_CHECKING

from impactfem.arrays import Integers
from impactfem.scene.laws import side_of
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show
from impactfem.system.link_shapes import named
from impactfem.system.tips import Tips

if TYPE_CHECKING:
    from impactfem.models.solids import SolidPart


def tips_of(part: "SolidPart", touching: Integers) -> Tips:
    """Surfaces of a solid that joints hold, none if there are none (collective).

    Args:
        part: The solid.
        touching: Canonical numbers of its contact nodes.

    Raises:
        KeyedError: It has no such surface, or is cut by symmetry.
    """
    outside, found = part.outside, {}
    for index, joint in enumerate(part.scene.joints):
        for side in joint.between or ():
            body, surfaces = side_of(side)
            if body != part.solid.name:
                continue
            for name in surfaces or ():
                if part.solid.shape is not None and part.solid.shape.symmetry:
                    text = f" = {show(side)}: {body} is cut by symmetry, which joints do not keep; "
                    raise KeyedError(f"joint[{index}]", "between", text + "model it as a whole.")
                if name not in outside.names:
                    raise named(f"joint[{index}]", "between", side, outside.names, "surface")
                faces = outside.on([name])
                on = outside.touched(faces)
                areas = outside.total(outside.areas, faces)[on]
                found[name] = outside.numbers[on], outside.points[on], areas
    return Tips(part.solid.name, part.system, found, touching)

"""Names that make columns of a history: no two things of a scene may claim the same column."""

from impactfem.scene.content import Content
from impactfem.scene.laws import name_of
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

RESERVED = (
    "momentum", "angular_momentum", "force", "gap", "tangential_force", "slip", "impulse",
)  # fmt: skip
"""First parts of columns that belong to no body."""


def check_column_names(scene: Content) -> None:
    """Refuse names of bodies and pairs that would make the same column twice.

    Raises:
        KeyedError: naming the key.
    """
    for index, body in enumerate(scene.bodies):
        if body.name in RESERVED:
            text = f" = {show(body.name)} begins columns of the history as {body.name}.x: "
            raise KeyedError(f"body[{index}]", "name", f"{text}give another name.")
    taken: dict[str, str] = {}
    for contact, index in zip(scene.laws.each, scene.laws.origin, strict=True):
        name, where = name_of(contact), f"contact[{index}]"
        if name in taken:
            given = "" if contact.name is None else f" = {show(name)}"
            text = f"{given}: the pair has the name {show(name)} of {taken[name]}: give another."
            raise KeyedError(where, "name", text)
        taken[name] = where
    for index, tie in enumerate(scene.ties):
        if tie.name in taken:
            text = f" = {show(tie.name)} is the name of the pair of {taken[tie.name]}, of which "
            text += f"there is a column force.{tie.name} too: give another name."
            raise KeyedError(f"tie[{index}]", "name", text)

"""What extensions are written with: `register`, and what bodies and obstacles are made of.

An extension is a module that registers what it adds, in one line each. A body without a mesh is a
class with keys and a method `system`, an obstacle a class with keys, distance, mirror image and
outline or faces, a method a `SolidScheme` or a `BarScheme`, a law of impacts a `RestitutionLaw`.
"""

from collections.abc import Iterable
from dataclasses import replace
from importlib import import_module
from inspect import currentframe
from typing import TYPE_CHECKING, Any, Literal

from impactfem.contact.distance import signed_distance
from impactfem.errors import SceneError
from impactfem.extensions import ADDED
from impactfem.marching.schemes import SCHEMES, SOLID_SCHEMES, BarScheme, SolidScheme
from impactfem.methods import BAR, METHODS, SOLID, Method
from impactfem.scene.body import BodyKind
from impactfem.scene.contacts import RESTITUTION_LAWS, RestitutionLaw
from impactfem.scene.content import BODIES
from impactfem.scene.flight import Flight
from impactfem.scene.given import MaybeFormulas, MaybeTable
from impactfem.scene.inline import Formulas, InlineTable, ListOf, Vector
from impactfem.scene.kinds import Choice, Integer, Line, Name, Real, Switch
from impactfem.scene.obstacles import OBSTACLES
from impactfem.scene.obstacles.base import MOTION, MOTION_KIND, RigidObstacle
from impactfem.scene.obstacles.mirror import Mirror
from impactfem.scene.obstacles.rotation import ROTATION, ROTATION_KIND, Rotation
from impactfem.scene.schema import KeyedError, entitle, key, keys_of, table
from impactfem.scene.values import NotAllowedError, show
from impactfem.system.few import FewBodies, Lumped, rigid_in_plane
from impactfem.system.generalized import GeneralizedSystem, LinearSystem

if TYPE_CHECKING:
    from impactfem.marching.layers import Sums
    from impactfem.marching.turning import Turning
    from impactfem.system.drive import Drive
    from impactfem.system.linear import LinearSolver

# What interiors are made of, which loads DOLFINx or Numba: when it is asked for.
_LATER = {
    "Drive": "impactfem.system.drive",
    "LinearSolver": "impactfem.system.linear",
    "Sums": "impactfem.marching.layers",
    "Turning": "impactfem.marching.turning",
}

__all__ = [
    "MOTION",
    "MOTION_KIND",
    "ROTATION",
    "ROTATION_KIND",
    "BarScheme",
    "BodyKind",
    "Choice",
    "Drive",
    "FewBodies",
    "Flight",
    "Formulas",
    "GeneralizedSystem",
    "InlineTable",
    "Integer",
    "KeyedError",
    "Line",
    "LinearSolver",
    "LinearSystem",
    "ListOf",
    "Lumped",
    "MaybeFormulas",
    "MaybeTable",
    "Mirror",
    "Name",
    "Real",
    "RestitutionLaw",
    "RigidObstacle",
    "Rotation",
    "SolidScheme",
    "Sums",
    "Switch",
    "Turning",
    "Vector",
    "key",
    "register",
    "rigid_in_plane",
    "signed_distance",
    "table",
]


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name not in _LATER:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_LATER[name]), name)


def register[T](what: T, *, name: str = "", text: str = "") -> T:
    """Add a kind of body or obstacle, a method or a law to those that the package has itself.

    From then on scenes, messages, the JSON schema, plan, run, report and restart know it. A class
    of the same module and name replaces the one before, as where a cell of a notebook is run again;
    scenes that are made keep theirs.

    Args:
        what: A class made by `table`: a `BodyKind` with a method ``system`` that gives its
            `FewBodies`, or a `RigidObstacle`. Or a `SolidScheme` or `BarScheme`. Or a
            `RestitutionLaw`.
        name: Of the method that a scheme makes, for ``solve.method``; of a law, for
            ``restitution_law``.
        text: What it is and where its limits lie, for reports and ``impactfem methods``.

    Returns:
        The same, so that it may stand before a class as a decorator.

    Raises:
        SceneError: Its name is taken, it lacks what is needed, or it is another law or a joint,
            which are not registered.
    """
    if isinstance(what, type) and issubclass(what, BodyKind):
        _check(what, BodyKind, ("dim", "system"))
        _enter("body", what.kind, what, BODIES)
    elif isinstance(what, type) and issubclass(what, RigidObstacle):
        _check(what, RigidObstacle, ("gap", "is_image"))
        if what.outline is RigidObstacle.outline and what.faces is RigidObstacle.faces:
            raise _lacks(what, "outline, in the plane, or faces, in space, for pictures")
        _enter("obstacle", what.kind, what, OBSTACLES)
    elif isinstance(what, SolidScheme | BarScheme | RestitutionLaw):
        frame = currentframe()
        caller = frame.f_back.f_globals["__name__"] if frame and frame.f_back else ""
        if isinstance(what, RestitutionLaw):
            _claim("law", RESTITUTION_LAWS, name, text, caller)
            RESTITUTION_LAWS[name] = replace(what, text=text)
        else:
            _claim("method", METHODS, name, text, caller)
            _enter_method(what, name, text)
    else:
        raise SceneError(
            f"register: {show(what)} is neither a body (a class of BodyKind) nor an obstacle (of "
            "RigidObstacle) nor a SolidScheme, BarScheme or RestitutionLaw; laws of friction, of "
            "materials and joints are part of the package, formulas in force, load and motor reach "
            "far"
        )
    return what


def _claim(sort: str, known: Iterable[str], name: str, text: str, module: str) -> None:
    """Take a name for what has none of its own.

    Raises:
        SceneError: There is no name or text, or the name is taken.
    """
    for what, given in (("name", name), ("text", text)):
        if not given:
            raise SceneError(f"register: a {sort} needs {what} = ...; see impactfem.register")
    if name in known and ADDED.get(f"{sort} {name}") != module:
        raise SceneError(f'register: name = "{name}" is taken by another {sort}; choose another')
    ADDED[f"{sort} {name}"] = module


def _enter_method(scheme: SolidScheme | BarScheme, name: str, text: str) -> None:
    """List a scheme among the methods."""
    limited: Literal["limited", "always"]
    if isinstance(scheme, SolidScheme):
        limited, bodies = "limited" if scheme.explicit else "always", SOLID
        SOLID_SCHEMES[name] = scheme
    else:
        limited, bodies = "limited" if scheme.limited else "always", BAR
        SCHEMES[name] = scheme
    METHODS[name] = Method(text, limited, plannable=False, mixes=bodies is SOLID, bodies=bodies)


def _check(cls: type[Any], base: type[Any], wanted: Iterable[str]) -> None:
    """Refuse a class without keys or without what its base leaves to it.

    Raises:
        SceneError: naming the class and the attribute.
    """
    if "__dataclass_fields__" not in vars(cls):
        raise SceneError(f"register: {cls.__name__} is no table: write @table() above its class")
    try:
        Name().read(getattr(cls, "kind", None))
    except NotAllowedError as error:
        why = f"its name in scenes ({error})" if hasattr(cls, "kind") else "its name in scenes"
        raise _lacks(cls, f'kind, {why}, as kind: ClassVar[str] = "frame"') from None
    if "name" not in keys_of(cls):
        text = f'name: str = key(Name(), "name in histories", default="{cls.kind}")'
        raise _lacks(cls, f"the key name: {text}")
    for name in wanted:
        if getattr(cls, name, None) is getattr(base, name, None):
            raise _lacks(cls, name)


def _lacks(cls: type[Any], what: str) -> SceneError:
    return SceneError(f"register: {cls.__name__} lacks {what}; give it, see impactfem.extend")


def _enter(what: str, name: str, cls: type[Any], known: dict[str, type[Any]]) -> None:
    """List a class among the kinds of a heading.

    Raises:
        SceneError: its name is taken.
    """
    there = known.get(name)
    same = there is not None and _origin(there) == _origin(cls)
    if there is not None and not (same and f"{what} {name}" in ADDED):
        raise SceneError(
            f'register: {cls.__name__}.kind = "{name}" is taken by {".".join(_origin(there))}; '
            "choose another one"
        )
    known[name] = cls
    ADDED[f"{what} {name}"] = cls.__module__
    entitle(f'[[{what}]] with kind = "{name}"', cls)


def _origin(cls: type[Any]) -> tuple[str, str]:
    return cls.__module__, cls.__qualname__

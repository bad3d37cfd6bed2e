"""The scene in words: bodies, obstacles, contact, loads and duration, with units."""

from collections.abc import Callable, Mapping
from fnmatch import fnmatchcase
from typing import Any

from impactfem.report.page.bodies_in_words import any_in_words, body_in_words
from impactfem.report.page.numbers import goings, listed, number, quantity, vector
from impactfem.scene import Scene
from impactfem.scene.laws import side_of
from impactfem.scene.loads import PiecewiseConstant

_MOST = 12  # bodies, obstacles or contacts that are told one by one

type Lines = list[tuple[str, str]]


def in_words(scene: Scene) -> Lines:
    """The scene in plain sentences.

    Returns:
        Pairs of a subject (the name of a body, "Contact", ...) and what there is to say about it;
        plain text, not escaped.
    """
    lines = [(body.name, body_in_words(scene, body)) for body in scene.bodies[:_MOST]]
    lines += _rest(len(scene.bodies), "Further bodies")
    lines += [(each.name, _obstacle(scene, each)) for each in scene.obstacles[:_MOST]]
    lines += _rest(len(scene.obstacles), "Further obstacles")
    lines += _contacts(scene)
    lines.append(("Gravity", _gravity(scene)))
    lines.append(("Duration", f"The motion is followed for {quantity(scene.duration, 's')}."))
    return lines


def _rest(count: int, subject: str) -> Lines:
    return [(subject, f"{count - _MOST} more, see scene.toml.")] if count > _MOST else []


def _obstacle(scene: Scene, obstacle: Any) -> str:
    text = _OBSTACLES.get(obstacle.kind, any_in_words)(scene, obstacle)
    going = goings(obstacle)
    return f"{text} It is rigid and {f'{going} as t goes on' if going else 'at rest'}."


def _wall(scene: Scene, _: Any) -> str:
    whose = "the first bar" if len(scene.bars) > 1 else "the bar"
    return f"A wall at x = 0, in front of the near end of {whose}."


def _half_space(scene: Scene, plane: Any) -> str:
    what = {1: "A stop", 2: "A straight face"}.get(scene.dim, "A plane")
    if scene.dim == 1:
        side = "above" if plane.normal[0] > 0 else "below"
        return f"{what} at x = {quantity(plane.point[0], 'm')}; bodies stay {side} it."
    through, normal = vector(plane.point, "m"), vector(plane.unit_normal)
    return f"{what} through {through}; bodies stay on the side its normal {normal} points to."


def _sphere(scene: Scene, ball: Any) -> str:
    what = "circle" if scene.dim == 2 else "ball"
    size = f"of radius {quantity(ball.radius, 'm')} around {vector(ball.center, 'm')}"
    return f"A {what} {size}; bodies stay {ball.side} it."


def _cylinder(scene: Scene, cylinder: Any) -> str:
    size = f"of radius {quantity(cylinder.radius, 'm')}"
    place = vector(cylinder.point, "m")
    if scene.dim == 2 or cylinder.axis is None:
        return f"A circle {size} around {place}; bodies stay {cylinder.side} it."
    axis = f"whose axis runs through {place} along {vector(cylinder.unit_axis or ())}"
    return f"An endless cylinder {size} {axis}; bodies stay {cylinder.side} it."


def _box(scene: Scene, box: Any) -> str:
    what = "rectangle" if scene.dim == 2 else "box"
    turned = f", turned by {quantity(box.angle, 'rad')}" if box.angle else ""
    edges = listed(box.size, "m", " × ")
    place = vector(box.center, "m")
    return f"A {what} of {edges} around {place}{turned}; bodies stay outside it."


def _polyline(scene: Scene, line: Any) -> str:
    shown = ", ".join(vector(point) for point in line.points[:6])
    more = f", and {len(line.points) - 6} more points" if len(line.points) > 6 else ""
    drawn = ", extruded along z" if scene.dim == 3 else ""
    return f"A chain of straight pieces {shown}{more} [m]{drawn}; bodies stay on its left."


def _mesh(_: Scene, stone: Any) -> str:
    count, source = len(stone.surface.simplices), stone.mesh or stone.heights
    return f"A surface of {count} triangles, from {source}; bodies stay {stone.side} it."


_OBSTACLES: Mapping[str, Callable[[Scene, Any], str]] = {
    "wall": _wall,
    "half_space": _half_space,
    "sphere": _sphere,
    "cylinder": _cylinder,
    "box": _box,
    "polyline": _polyline,
    "mesh": _mesh,
}


def _contacts(scene: Scene) -> Lines:
    """Who may meet whom, and what an impact leaves."""
    if scene.bars:
        where = "neighbours meet" if len(scene.bars) > 1 else "the near end meets the wall"
        text = f"Unilateral and frictionless: {where} and may part, but never pull or overlap. "
        return [("Contact", f"{text}Rebound follows from elasticity, not from a coefficient.")]
    if not scene.contacts:
        mutual = scene.marches and len(scene.bodies) > 1
        met = ["every obstacle"] * bool(scene.obstacles) + ["every other body"] * mutual
        text = f"Every body may meet {' and '.join(met)}, unilaterally and without friction."
        if not met:
            text = "There is nothing to meet."
        law = " An impact leaves no normal velocity (restitution 0)."
        law = "" if all(body.waves for body in scene.bodies) else law
        return [("Contact", text + law)]
    lines = [("Contact", _contact(scene, entry)) for entry in scene.contacts[:_MOST]]
    lines += _rest(len(scene.contacts), "Further contacts")
    return lines


def _contact(scene: Scene, entry: Any) -> str:
    text = f"{' and '.join(entry.between)} may meet"
    told = "without friction"
    if entry.friction_coefficient:
        told = f"with Coulomb friction of coefficient {number(entry.friction_coefficient)}"
    sides = [side_of(name)[0] for name in entry.between]
    met = [body for body in scene.bodies if any(fnmatchcase(body.name, side) for side in sides)]
    if not any(body.waves for body in met):
        law = entry.by_speed
        told += f", with the coefficient of restitution {number(entry.restitution)}"
        told += f" by the law {entry.restitution_law} ({law.text})" if law else ""
    return f"{text}, {told}."


def _gravity(scene: Scene) -> str:
    gravity = scene.gravity
    if isinstance(gravity, PiecewiseConstant):
        shown = [quantity(value, "m/s²") for value in gravity.values]
        along = " towards the wall (negative: away from it)" if len(scene.bars) == 1 else ""
        none = not any(gravity.values)
    else:
        shown = [vector(value, "m/s²") for value in gravity.values]
        along, none = "", not any(any(value) for value in gravity.values)
    if none:
        return "There is none."
    if len(shown) == 1:
        return f"{shown[0]}{along}."
    pairs = list(zip(shown, gravity.times, strict=True))
    parts = [f"{value} from {quantity(time, 's')} on" for value, time in pairs[:_MOST]]
    more = f"; {len(pairs) - _MOST} more pieces" if len(pairs) > _MOST else ""
    return f"In pieces{along}: {'; '.join(parts)}{more}."

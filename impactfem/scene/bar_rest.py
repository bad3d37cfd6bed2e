"""A bar before a wall in equilibrium at t = 0, as the displacement that it begins with.

With the force f per length of load and gravity, F on the far end and R >= 0 of the wall,

    E A u'(x) = N(x),   N(x) = F + f (L - x) of a free far end, -R - f x of one that is held,

and R is what is left of F + f L, or what the far end presses. A wall with a stiffness k gives way
by R / k.
"""

from dataclasses import replace

from impactfem.scene.bodies import PROPERTIES, Bar
from impactfem.scene.formula import Formula
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

_ROUNDS = 1e-14  # share of the forces below which what is left of them is none


def resting(bar: Bar, gravity: float) -> Bar:
    """The bar with the displacement of its equilibrium.

    Args:
        bar: It.
        gravity: At t = 0, towards the wall [m/s^2].

    Raises:
        KeyedError: A property or a load varies along it, or nothing holds it.
    """
    load = bar.load.fixed(t=0.0)
    varies = [name for name in PROPERTIES if not bar.is_uniform]
    for name in ["load", *varies]:
        given = getattr(bar, name)
        if not isinstance(given, Formula) or "x" not in given.used:
            continue
        text = f" = {show(given.text)} varies along a bar that starts at rest: give a number, or "
        raise KeyedError("body[0]", name, f'{text}start = "given" and displacement.')
    size, length = bar.section * bar.wave_speed**2, bar.length
    along = float(load(x=0.0)) - bar.section * gravity
    far, give = float(bar.end_force(t=0.0)), 1.0 / bar.wall_stiffness if bar.wall_stiffness else 0.0
    bend, there = -0.5 * along / size, bar.initial_displacement
    if bar.far_end == "clamped":
        moved = float(bar.far_end_displacement(t=0.0))
        if moved:
            motion = bar.far_end_displacement.plus(-moved)
            bar = replace(bar, far_end_displacement=motion)
        end = float(there(x=length)) + moved
        wall = max(0.0, (bend * length**2 - end) / (length / size + give))
        near = -wall * give if wall else end - bend * length**2
        slope = -wall / size
    else:
        left = far + along * length
        if abs(left) <= _ROUNDS * (abs(far) + abs(along) * length):
            left = 0.0
        if left > 0.0:
            text = f' = "static": nothing holds {bar.name} against its translation away from the '
            text += f"wall, driven by {left:.4g} N: clamp its far end, balance the loads, or give "
            raise KeyedError("", "start", f'{text}start = "given".')
        slope, near = left / size, left * give
        if not left:  # it stays where its middle is
            near = float(there(x=0.5 * length)) - bend * length**2 / 4.0
    gap = max(0.0, near)  # apart, so that strains keep their digits
    text = f"({near - gap!r}) + ({slope!r})*x + ({bend!r})*x**2"
    return replace(bar, gap=gap, displacement=Formula(text) if slope or bend else near - gap)

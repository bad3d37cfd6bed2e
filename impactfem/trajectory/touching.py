"""Contact by complementarity: forces of contact as further unknowns, with what they may be.

A gap g and its force l have 0 <= g _|_ l >= 0. Along a tangent of slip s, Coulomb's friction f is
told by two more pairs, with an unknown w >= -min(s, 0) that takes the part of s below 0:

    0 <= s + w _|_ mu l - f >= 0,    0 <= w _|_ mu l + f >= 0,

so that -f pushes against the slip. Dry friction of joints has a constant in place of mu l. Each
product is held below eps times the sizes of its two factors, and eps goes to 0. In implicit Euler
steps, whose forces are those of the step's end, a gap that closes stays closed: an impact without
rebound (Stewart and Trinkle 1996; Posa, Cantu and Tedrake 2014).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from impactfem.errors import SceneError
from impactfem.trajectory.bodies import Symbolic
from impactfem.trajectory.contacts import Closing
from impactfem.trajectory.symbols import loaded


@dataclass(frozen=True)
class Touching:
    """Forces of contact of bodies in symbols.

    Attributes:
        names: Of the further unknowns (k,), as columns.
        symbols: These (k,).
        rate: v' with them (d,).
        pairs: Both factors of each product that is 0.
        pair_names: For messages.
    """

    names: tuple[str, ...]
    symbols: Any
    rate: Any
    pairs: tuple[tuple[Any, Any], ...]
    pair_names: tuple[str, ...]


def touching(known: Symbolic, gaps: Sequence[Closing]) -> Touching:
    """Forces at gaps.

    Raises:
        SceneError: A gap rebounds, or there is none.
    """
    casadi, tree = loaded(), known.tree
    names, symbols, pairs = list[str](), list[Any](), list[tuple[Any, Any]]()
    told = list[str]()
    pushes: Any = 0

    def unknown(of: str, what: str) -> Any:
        name = f"{of}.{what}"
        count = sum(each.partition("#")[0] == name for each in names)
        names.append(f"{name}#{count}" if count else name)
        symbols.append(casadi.SX.sym(names[-1]))
        return symbols[-1]

    def rubs(of: str, speed: Any, most: Any) -> Any:
        """Friction along a speed, at most so much: what it does to coordinates."""
        against, back = unknown(of, "friction"), unknown(of, "slip_back")
        pairs.extend([(speed + back, most - against), (back, most + against)])
        told.extend([f"friction of {of}"] * 2)
        return -casadi.jacobian(speed, tree.v).T * against

    if not (gaps or tree.rubs):
        raise SceneError(
            "trajectory.transcription: contact_implicit needs contacts that may close, of balls, "
            "boxes and hulls on half-spaces or of balls on balls, with friction in the plane "
            'alone, or joints with friction; give these, or "hermite_simpson"'
        )
    for gap in gaps:
        if gap.restitution:
            raise SceneError(
                f"trajectory.transcription: contact_implicit knows impacts without rebound, and "
                f'{gap.name} has restitution = {gap.restitution:g}; give "hybrid", '
                '"multiple_shooting", or restitution = 0'
            )
        push = unknown(gap.pair, "force")
        pairs.append((gap.gap, push))
        told.append(f"contact of {gap.name}")
        pushes = pushes + casadi.jacobian(gap.gap, tree.q).T * push
        if gap.friction:
            pushes = pushes + rubs(gap.pair, gap.slip, gap.friction * push)
    for rub in tree.rubs:
        pushes = pushes + rubs(rub.rate.removesuffix(".v"), rub.speed, rub.most)
    rate = known.rate + tree.solved(pushes)
    unknowns = casadi.vertcat(casadi.SX(0, 1), *symbols)
    return Touching(tuple(names), unknowns, rate, tuple(pairs), tuple(told))

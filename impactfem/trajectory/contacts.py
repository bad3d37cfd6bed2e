"""What bodies of a scene may strike, in symbols: gaps, impacts with restitution, systems of these.

An impact changes the rates by M^-1 (n lambda + t mu) at once, with the gap's slope n by the
coordinates and that of its slip t: Newton's law n . v+ = -e n . v- and Coulomb's |mu| <= f lambda,
of which mu is what brings the slip to -e_t of what it was, if the cone lets it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene import Joint, Mechanism, Point, Scene
from impactfem.scene.contacts import Contact
from impactfem.scene.obstacles import HalfSpace
from impactfem.scene.pairing import law_of
from impactfem.scene.signal import Signal
from impactfem.system.generalized import GeneralizedSystem
from impactfem.trajectory.bodies import Symbolic, in_symbols
from impactfem.trajectory.impacts import Impact
from impactfem.trajectory.symbols import loaded
from impactfem.trajectory.tree import Tree

_CORNERS = 16  # of a body that keeps off an obstacle
_STILL = Signal()


@dataclass(frozen=True)
class Closing:
    """A gap that may close.

    Attributes:
        name: What it is between, for messages.
        still: Gap of q to what stands still.
        moved: How far that moves towards it, of t.
        motion: The same as a number.
        slip: Velocity along the one tangent, of q and v; None: there is none, or two.
        restitution: Newton's e.
        friction: Coulomb's coefficient.
        turned: Share of the slip that an impact turns back.
    """

    name: str
    still: Any
    slip: Any = None
    restitution: float = 0.0
    friction: float = 0.0
    turned: float = 0.0
    moved: Any = 0
    motion: Signal = _STILL

    @property
    def gap(self) -> Any:
        """Of t and q, >= 0 while it is open."""
        return self.still - self.moved

    def impact(self, known: Symbolic) -> Impact:
        """It, as shooting goes through it."""
        casadi, tree = loaded(), known.tree
        state = casadi.vertcat(tree.q, tree.v)
        count = len(tree.freedoms)
        given = [tree.t, state, known.controls]
        gap = casadi.Function("gap", given, [self.gap])
        rates = tree.v + self._change(tree)
        jump = casadi.Function("jump", given, [casadi.vertcat(state[:count], rates)])
        return Impact(gap, jump, self.name)

    def _change(self, tree: Tree) -> Any:
        """What an impact adds to the rates (d,)."""
        casadi = loaded()
        normal = casadi.jacobian(self.gap, tree.q).T
        closing = casadi.dot(normal, tree.v) - casadi.jacobian(casadi.SX(self.moved), tree.t)
        wanted = -(1.0 + self.restitution) * closing
        answer = tree.solved(normal)
        if not self.friction or self.slip is None:
            return answer * wanted / casadi.dot(normal, answer)
        along = casadi.jacobian(self.slip, tree.v).T
        back = tree.solved(along)
        nn, nt, tt = (
            casadi.dot(a, b) for a, b in ((normal, answer), (normal, back), (along, back))
        )
        turned = -(1.0 + self.turned) * self.slip
        whole = nn * tt - nt**2
        pressed, held = (tt * wanted - nt * turned) / whole, (nn * turned - nt * wanted) / whole
        against = self.friction * casadi.sign(held)
        slides = wanted / (nn + against * nt)
        sticks = casadi.fabs(held) <= self.friction * pressed
        return casadi.if_else(
            sticks, answer * pressed + back * held, slides * (answer + against * back)
        )


def closings(scene: Scene, known: Symbolic) -> tuple[list[Closing], list[str]]:
    """Gaps of a scene, and pairs that have none in symbols."""
    found, unseen = [], list[str]()
    obstacles = {each.name: each for each in scene.obstacles}
    bodies = {body.name: body for body in scene.bodies}
    for one, two in _pairs(scene):
        own = _of_pair(scene, known.tree, bodies[one], obstacles.get(two) or bodies[two])
        if own is None:
            unseen.append(f"{one}.{two}")
            continue
        found += own
    for joint in scene.joints:
        if joint.limits is not None and joint.restitution:
            found += _limits(joint, known.columns)
    return found, unseen


def _limits(joint: Joint, columns: Any) -> list[Closing]:
    column, (low, high) = columns.get(f"{joint.name}.q"), joint.limits or ()
    if column is None:
        return []
    sides = {"lower": column - low, "upper": high - column}
    return [
        Closing(f"the {side} limit of {joint.name}", gap, None, joint.restitution)
        for side, gap in sides.items()
    ]


def _of_pair(scene: Scene, tree: Tree, body: Any, other: Any) -> list[Closing] | None:
    """Gaps of corners and balls to a plane, or of two balls; None: there are none in symbols."""
    nodes, law = _outline(body), law_of(scene, body.name, other.name)
    if nodes is None:
        return None
    of_law: dict[str, Any] = {}
    if law is not None and _strikes(law, scene.dim):
        of_law = {
            "restitution": law.restitution, "friction": law.friction_coefficient,
            "turned": law.tangential_restitution,
        }  # fmt: skip
    along = _slip_of if scene.dim == 2 else _no_slip
    if isinstance(other, HalfSpace):
        return _on_plane(tree, body.name, nodes, other, along, of_law)
    others = _outline(other) if other.name in tree.parts else None
    if others is None or len(nodes[1]) != 1 or len(others[1]) != 1:
        return None
    reach = float(nodes[1][0] + others[1][0])
    ends = [tree.place(b.name, n[0][0]) for b, n in ((body, nodes), (other, others))]
    length = loaded().norm_2(ends[0] - ends[1])
    normal = (ends[0] - ends[1]) / length
    feet = ends[0] - nodes[1][0] * normal, ends[1] + others[1][0] * normal
    slip = along(_speed(tree, body.name, feet[0]) - _speed(tree, other.name, feet[1]), normal)
    return [Closing(f"{body.name} on {other.name}", length - reach, slip, **of_law)] * (reach > 0.0)


def _strikes(law: Contact, dim: int) -> bool:
    """Whether its impacts are those of Newton's and Coulomb's laws; others stay open."""
    gives_way = law.stiffness is not None or law.adhesion is not None
    rubs_more = law.sticking > law.friction_coefficient or (dim == 3 and law.sticking > 0.0)
    return not (gives_way or rubs_more or law.by_impulses)


def _on_plane(
    tree: Tree, body: str, nodes: tuple[Floats, Floats], plane: HalfSpace,
    along: Callable[[Any, Any], Any], of_law: Mapping[str, Any],
) -> list[Closing] | None:  # fmt: skip
    if plane.rotation is not None:
        return None
    casadi, found = loaded(), []
    normal, shift = casadi.DM(_space(plane.unit_normal)), casadi.SX.zeros(3)
    formulas = plane.motion or ()
    for k, formula in enumerate(formulas):
        shift[k] = in_symbols(formula, {"t": tree.t})
    motion = Signal(formulas=tuple(zip(plane.unit_normal, formulas, strict=False)))
    for place, radius in zip(*nodes, strict=True):
        at = tree.place(body, place)
        still = casadi.dot(normal, at - casadi.DM(_space(plane.point))) - radius
        moves = _speed(tree, body, at - radius * normal) - casadi.jacobian(shift, tree.t)
        found.append(
            Closing(f"{body} on {plane.name}", still, along(moves, normal), **of_law,
                    moved=casadi.dot(normal, shift), motion=motion)
        )  # fmt: skip
    return found


def _slip_of(velocity: Any, normal: Any) -> Any:
    """Along the one tangent in the plane."""
    return velocity[0] * normal[1] - velocity[1] * normal[0]


def _no_slip(velocity: Any, normal: Any) -> None:  # noqa: ARG001  (there are two tangents)
    return None


def _speed(tree: Tree, body: str, at: Any) -> Any:
    """Velocity of the material point of a body that is at some place now."""
    centre = tree.centre(body)
    return tree.rate(centre) + loaded().cross(tree.spin(body), at - centre)


def _pairs(scene: Scene) -> list[tuple[str, str]]:
    """What may meet: a body, and an obstacle or another body."""
    names = [body.name for body in scene.bodies]
    if scene.laws.each:
        said = [tuple(name.partition("/")[0] for name in e.between) for e in scene.laws.each]
        return [(a, b) if a in names else (b, a) for a, b in said]
    pairs = [(one, each.name) for one in names for each in scene.obstacles]
    joined = {joint.bodies for joint in scene.joints}
    wide = [b.name for b in scene.bodies if not isinstance(b, Point) or b.radius]
    return pairs + [p for p in combinations(wide, 2) if frozenset(p) not in joined]


def _outline(body: Any) -> tuple[Floats, Floats] | None:
    """Centres at t = 0 (k, 3) and radii (k,) of balls whose hull it is; None: it is none."""
    if isinstance(body, Point):
        return _space(body.position)[None], np.array([body.radius])
    if isinstance(body, Mechanism):
        return None
    form = body.form
    if len(form.rim) or len(form.nodes) > _CORNERS:
        return None
    nodes = body.center + (form.nodes - body.center) @ body.rotation.T
    return np.array([_space(node) for node in nodes]), np.broadcast_to(form.radius, len(nodes))


def system_of(
    known: Symbolic, gaps: Sequence[Closing], control: Callable[[float], Floats]
) -> GeneralizedSystem:
    """The bodies with controls of time as a system, for methods that know nothing of this search.

    Args:
        known: The bodies.
        gaps: What they strike.
        control: Of t to the controls (m,).
    """
    casadi, tree = loaded(), known.tree
    t, q, v, u = tree.t, tree.q, tree.v, known.controls
    mass = casadi.Function("mass", [q], [tree.mass()])
    force = casadi.Function("force", [t, q, v, u], [tree.force()])
    still = casadi.vertcat(casadi.SX(0, 1), *(each.still for each in gaps))
    phi = casadi.Function("phi", [q], [still])
    slopes = casadi.Function("slopes", [q], [casadi.jacobian(still, q)])
    slips = [casadi.SX.zeros(1, v.numel()) if each.slip is None
             else casadi.jacobian(each.slip, v) for each in gaps]  # fmt: skip
    slip = casadi.Function("slip", [q], [casadi.vertcat(casadi.SX(0, v.numel()), *slips)])
    return GeneralizedSystem(
        mass=_called(mass), dofs=v.numel(), jacobian=_called(slopes),
        force=lambda t, q, v: _called(force)(t, q, v, control(t)).ravel(),
        constraints=lambda q: _called(phi)(q).ravel(),
        restitution=[each.restitution for each in gaps],
        friction=[each.friction for each in gaps],
        tangential_restitution=[each.turned for each in gaps],
        slip=_called(slip), motion=[each.motion for each in gaps],
        names=[freedom.name for freedom in tree.freedoms],
    )  # fmt: skip


def _called(function: Any) -> Callable[..., Floats]:
    """A function of CasADi as one of arrays."""

    def call(*given: Any) -> Floats:
        if any(np.iscomplexobj(each) for each in given):
            raise TypeError("CasADi knows no complex numbers")
        return np.asarray(function(*given), dtype=float)

    return call


def _space(values: Any) -> Floats:
    """Three numbers, 0 where fewer are given."""
    found = np.zeros(3)
    found[: len(values)] = values
    return found

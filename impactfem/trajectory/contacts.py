"""What bodies of a scene may strike, in symbols: gaps, impacts with restitution, systems of these.

An impact changes the rates by M^-1 (n lambda + t mu) at once, with the gap's slope n by the
coordinates and that of its slip t: Newton's law n . v+ = -e n . v- and Coulomb's |mu| <= f lambda,
of which mu is what brings the slip to -e_t of what it was, if the cone lets it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any, override

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.scene import Mechanism, Point, Scene
from impactfem.scene.breaks import Break
from impactfem.scene.contacts import Contact
from impactfem.scene.obstacles import HalfSpace
from impactfem.scene.pairing import law_of, pair_name
from impactfem.scene.signal import Signal
from impactfem.system.generalized import GeneralizedSystem, Kin
from impactfem.trajectory.bodies import Symbolic, in_symbols
from impactfem.trajectory.impacts import Impact
from impactfem.trajectory.symbols import loaded
from impactfem.trajectory.tree import Tree, in_space

_CORNERS = 16  # of a body that keeps off an obstacle
_STILL = Signal()


@dataclass(frozen=True, eq=False)
class Closing:
    """A gap that may close.

    Attributes:
        name: What it is between, for messages.
        pair: Name of the pair of bodies, or of the joint.
        still: Gap of q to what stands still.
        moved: How far that moves towards it, of t.
        motion: The same as a number.
        slip: Velocity along the one tangent, of q and v; None: there is none, or two.
        restitution: Newton's e.
        friction: Coulomb's coefficient.
        turned: Share of the slip that an impact turns back.
        limits: Whether it is a limit of a joint.
        known: Whether it strikes by these laws; others only stay open.
    """

    name: str
    pair: str
    still: Any
    slip: Any = None
    restitution: float = 0.0
    friction: float = 0.0
    turned: float = 0.0
    moved: Any = 0
    motion: Signal = _STILL
    limits: bool = False
    known: bool = True

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
    every = {f"{each.name}.q": (each.limits, each.restitution) for each in scene.joints}
    every |= {name: (pair, 0.0) for name, pair in known.limits.items()}
    for column, (ends, restitution) in every.items():
        if ends is not None and column in known.columns:
            joint, at = column.removesuffix(".q"), known.columns[column]
            found += [
                Closing(f"the {side} limit of {joint}", joint, gap, None, restitution, limits=True)
                for side, gap in (("lower", at - ends[0]), ("upper", ends[1] - at))
                if np.isfinite(ends).all()
            ]
    return found, unseen


def _of_pair(scene: Scene, tree: Tree, body: Any, other: Any) -> list[Closing] | None:
    """Gaps of corners and balls to a plane, or of two balls; None: there are none in symbols."""
    nodes, law = _outline(body), law_of(scene, body.name, other.name)
    if nodes is None:
        return None
    of_law: dict[str, Any] = {
        "pair": pair_name(scene, body.name, other.name),
        "known": law is None or _strikes(law, scene.dim),
    }
    if law is not None and of_law["known"]:
        of_law |= {
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
    return [Closing(f"{body.name} on {other.name}", still=length - reach, slip=slip, **of_law)] * (
        reach > 0.0
    )


def _strikes(law: Contact, dim: int) -> bool:
    """Whether its impacts are those of Newton's and Coulomb's laws; others stay open."""
    gives_way = law.stiffness is not None or law.adhesion is not None
    rubs_more = law.sticking > law.friction_coefficient or (dim == 3 and law.sticking > 0.0)
    return not (gives_way or rubs_more or not law.is_newton)


def _on_plane(
    tree: Tree, body: str, nodes: tuple[Floats, Floats], plane: HalfSpace,
    along: Callable[[Any, Any], Any], of_law: Mapping[str, Any],
) -> list[Closing] | None:  # fmt: skip
    if plane.rotation is not None:
        return None
    casadi, found = loaded(), []
    normal, shift = casadi.DM(in_space(plane.unit_normal)), casadi.SX.zeros(3)
    formulas = plane.motion or ()
    for k, formula in enumerate(formulas):
        shift[k] = in_symbols(formula, {"t": tree.t})
    motion = Signal(formulas=tuple(zip(plane.unit_normal, formulas, strict=False)))
    for place, radius in zip(*nodes, strict=True):
        at = tree.place(body, place)
        still = casadi.dot(normal, at - casadi.DM(in_space(plane.point))) - radius
        moves = _speed(tree, body, at - radius * normal) - casadi.jacobian(shift, tree.t)
        found.append(
            Closing(f"{body} on {plane.name}", still=still, slip=along(moves, normal), **of_law,
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
        return in_space(body.position)[None], np.array([body.radius])
    if isinstance(body, Mechanism):
        return None
    form = body.form
    if len(form.rim) or len(form.nodes) > _CORNERS:
        return None
    nodes = body.center + (form.nodes - body.center) @ body.rotation.T
    return np.array([in_space(node) for node in nodes]), np.broadcast_to(form.radius, len(nodes))


def check_events(known: Symbolic) -> None:
    """Refuse bodies that `event_driven` does not follow.

    Raises:
        SceneError: Something in them is beyond it.
    """
    if known.tree.beyond:
        raise SceneError(
            f"{known.tree.beyond}, which event_driven does not know in coordinates of joints: "
            "leave it out, or take what needs no events (trajectories by hermite_simpson or "
            "contact_implicit, steps)"
        )


def system_of(
    known: Symbolic, gaps: Sequence[Closing], control: Callable[[float], Floats],
    stops: Callable[[float], Sequence[Break]] = lambda _: (),
) -> GeneralizedSystem:  # fmt: skip
    """The bodies with controls of time as a system, for methods that know nothing of this search.

    Args:
        known: The bodies.
        gaps: What they strike.
        control: Of t to the controls (m,).
        stops: When forces jump, up to some time.

    Raises:
        SceneError: Something in it is beyond these methods.
    """
    check_events(known)
    return _TreeSystem(known, gaps, control, stops)


class _TreeSystem(GeneralizedSystem):
    """A tree in symbols as a system of arrays, with exact derivatives of its gaps and slips."""

    def __init__(
        self, known: Symbolic, gaps: Sequence[Closing], control: Callable[[float], Floats],
        stops: Callable[[float], Sequence[Break]],
    ) -> None:  # fmt: skip
        casadi, tree = loaded(), known.tree
        t, q, v, u = tree.t, tree.q, tree.v, known.controls
        count = v.numel()
        still = casadi.vertcat(casadi.SX(0, 1), *(each.still for each in gaps))
        none = casadi.SX(1, count)
        slips = [none if e.slip is None else casadi.jacobian(e.slip, v) for e in gaps]
        slopes, slip = casadi.jacobian(still, q), casadi.vertcat(casadi.SX(0, count), *slips)
        self._bends = _array("bends", [q, v], casadi.jtimes(slopes @ v, q, v))
        self._slip_bends = _array("slip_bends", [q, v], casadi.jtimes(slip @ v, q, v))
        function = casadi.Function("force", [t, q, v, u], [tree.force()])
        inertia = casadi.Function("mass", [q], [tree.mass()])
        self._kin = function, inertia
        self._control = control
        force, mass = _told(function), _told(inertia)

        def pushed(t: float, q: Floats, v: Floats) -> Floats:
            return force(t, q, v, control(t)).ravel()

        pushed.stops = stops  # type: ignore[attr-defined]
        phi = _array("phi", [q], still)
        energy = _array("energy", [q], sum(tree.elastic + tree.falls, casadi.SX(0)))
        super().__init__(
            mass=mass, dofs=count, force=pushed,
            constraints=lambda q: phi(q).ravel(), jacobian=_array("slopes", [q], slopes),
            restitution=[each.restitution for each in gaps],
            friction=[each.friction for each in gaps],
            tangential_restitution=[each.turned for each in gaps],
            slip=_array("slip", [q], slip), motion=[each.motion for each in gaps],
            potential=lambda _, q: energy(q).item(),
            names=[freedom.name for freedom in tree.freedoms],
        )  # fmt: skip

    @cached_property
    def kin(self) -> Kin:
        """Forces and mass as text: those of controls, restitution or limits alone are the same."""
        alike = tuple(function.serialize() for function in self._kin)
        return Kin(alike, self._control, self._accelerations)

    def _accelerations(self, t: Floats, u: Floats, v: Floats, given: Floats) -> Floats:
        force, mass = self._kin
        count, d = v.shape
        pushed = np.asarray(force(t[None], u.T, v.T, given.T), dtype=float).T
        masses = np.asarray(mass(u.T), dtype=float).reshape(d, count, d).transpose(1, 0, 2)
        return np.asarray(np.linalg.solve(masses, pushed[:, :, None])[:, :, 0])

    @override
    def gap_curvature(self, t: float, u: Floats, v: Floats) -> Floats:
        return self._bends(u, v).ravel() - self.motion_curvature(t)

    @override
    def slip_curvature(self, u: Floats, v: Floats) -> Floats:
        return self._slip_bends(u, v)


def _array(name: str, given: Sequence[Any], told: Any) -> Callable[..., Floats]:
    """What symbols tell, as a function of arrays."""
    return _told(loaded().Function(name, list(given), [told]))


def _told(function: Any) -> Callable[..., Floats]:
    """A function of symbols as one of arrays."""

    def call(*numbers: Any) -> Floats:
        if any(np.iscomplexobj(each) for each in numbers):
            raise TypeError("CasADi knows no complex numbers")
        return np.asarray(function(*numbers), dtype=float)

    return call

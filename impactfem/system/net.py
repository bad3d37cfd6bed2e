"""Masses and springs as the march takes them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags

from impactfem.arrays import Floats, Integers
from impactfem.errors import MeshError, SceneError
from impactfem.scene import Formula, Scene
from impactfem.scene.body import beside
from impactfem.scene.boundary import Support
from impactfem.scene.damping import rayleigh_of
from impactfem.scene.jets import motion_at
from impactfem.scene.springs import SpringNet
from impactfem.system.few import FewBodies
from impactfem.system.link_shapes import named
from impactfem.system.net_mesh import NetMesh, net_mesh
from impactfem.system.plate_tones import first_frequency
from impactfem.system.regions import region, tip
from impactfem.system.rigid import in_space
from impactfem.system.stations import Asked, Stations, Tied

_STEPS = 10.0  # radians of an edge's vibration in one of the body that steps follow
_ISOTROPIC = 1e-9  # share of the stiffness by which it may depend on the direction


@dataclass(frozen=True, kw_only=True)
class Net(FewBodies):
    """Masses and springs; q are the places of the masses that are not held, node after node.

    Attributes:
        mesh: At rest.
        node_mass: [kg], (nodes,).
        free: Nodes that are not held, (free,).
        led: Nodes that supports move, and their displacements in t [m] along each axis.
        damping: By mass [1/s] and by stiffness [s].
        force: On all of it besides gravity, in t [N], along each axis; none: 0.
    """

    mesh: NetMesh
    node_mass: Floats
    free: Integers
    led: tuple[tuple[Integers, tuple[Formula, ...]], ...] = ()
    damping: tuple[float, float] = (0.0, 0.0)
    force: tuple[Formula, ...] = ()

    def leading(self, time: float) -> tuple[Floats, Floats]:
        """Displacements [m] and velocities [m/s] that supports give at a time, (nodes, dim) each.

        Raises:
            SceneError: One is not finite.
        """
        found = np.zeros((2, *self.mesh.points.shape))
        for nodes, formulas in self.led:
            for axis, formula in enumerate(formulas):
                jet = motion_at(formula, time)
                found[:, nodes, axis] = np.array([[jet.value], [jet.rate]])
        if not np.isfinite(found).all():
            raise SceneError(
                f"body {self.names[0]}: the motion of a support is not finite at t = {time:g} s; "
                "give a formula that is smooth there"
            )
        return found[0], found[1]

    @property
    def figured(self) -> Mapping[str, float | list[list[float]]]:
        """How many masses and springs, and how stiff they are for uniform strains."""
        counts = {"masses": float(len(self.node_mass)), "springs": float(len(self.mesh.edges))}
        return {**counts, **self.stiffness}

    @cached_property
    def stiffness(self) -> Mapping[str, float]:
        """Of strains that are the same everywhere: C11, C22, C12 = C66 [N/m, in space Pa]."""
        moduli = self.mesh.moduli()
        names = ((0, 0), (1, 1), (0, 1), (2, 2), (0, 2), (1, 2))[: 3 * self.dim - 3]
        return {f"C{i + 1}{j + 1}": float(moduli[i, i, j, j]) for i, j in names}

    @cached_property
    def isotropic(self) -> tuple[float, float] | None:
        """Young's modulus [N/m, in space Pa] and Poisson's ratio; None if directions differ."""
        moduli, each, nu = self.mesh.moduli(), np.eye(self.dim), 1.0 / (self.dim + 1.0)
        shear = float(np.einsum("iijj->", moduli)) / (self.dim * (self.dim + 2.0))
        parts = [np.einsum(f"{a},{b}->ijkl", each, each) for a, b in _PAIRS]
        if np.abs(moduli - shear * sum(parts)).max() > _ISOTROPIC * shear:
            return None
        return 2.0 * shear * (1.0 + nu), nu

    def stations(self, asked: Sequence[Asked]) -> Stations:
        """One for each mass, and for each region of a surface, which is a tip in the mean.

        Raises:
            SceneError: No mass is there, or too few are free.
        """
        of, keys, places, rows = [], list[tuple[int, ...]](), list[Floats](), list[Floats]()
        for name, wanted, radius in asked:
            own = None if isinstance(radius, Tied) else radius  # ties hold no nets
            nodes = self._held_at(name, wanted, own)
            if (key := tuple(nodes.tolist())) not in keys:
                made = self._station(name, nodes)
                keys.append(key)
                places.append(made[0])
                rows.append(made[1])
            of.append(keys.index(key))
        names = tuple(asked[of.index(k)][0] for k in range(len(keys)))
        moving, mass = np.array(rows), np.repeat(self.node_mass[self.free], self.dim)
        answers = moving.reshape(-1, len(mass)).T / mass[:, None]
        found = Stations.along(tuple(of), names, np.array(places), moving, answers, self.velocity)
        return replace(found, freedoms=len(mass), given=())

    def _held_at(self, name: str, wanted: Floats, radius: float | None) -> Integers:
        """Free masses that a joint holds at a place [m], (3,)."""
        points, surface = self.mesh.points, name.partition("/")[2]
        if surface:
            if surface not in self.mesh.surfaces:
                raise named("joint", "between", name, list(self.mesh.surfaces), "surface")
            return self._region(name, self.mesh.surfaces[surface], wanted[: self.dim], radius)
        place = wanted[: self.dim]
        node = int(np.linalg.norm(points - place, axis=1).argmin())
        if beside(place, points[node]):
            near = ", ".join(f"{x:.9g}" for x in points[node])
            raise SceneError(
                f"joint: no mass of {name} is at ({', '.join(f'{x:.9g}' for x in place)}), which "
                f"joints hold; give a place of one, the nearest is at ({near}), or a surface"
            )
        return np.intersect1d([node], self.free)

    def _region(
        self, name: str, surface: Integers, place: Floats, radius: float | None
    ) -> Integers:
        """Free masses of a surface about a place."""
        points, mass = self.mesh.points[surface], self.node_mass[surface]
        free = np.isin(surface, self.free)
        sides = np.searchsorted(surface, self.mesh.edges[np.isin(self.mesh.edges, surface).all(1)])
        return surface[region(place, points, sides, radius, mass, free, ("joint", name)).nodes]

    def _station(self, name: str, nodes: Integers) -> tuple[Floats, Floats]:
        """Place of a station (3,), and its velocity and spin by q', (6, d)."""
        rows = np.zeros((6, len(self.node_mass), self.dim))
        if len(nodes) == 1 and "/" not in name:
            rows[: self.dim, nodes[0]] = np.eye(self.dim)
            place = in_space(self.mesh.points[nodes[0]])
        else:
            made = tip(self.mesh.points[nodes], self.node_mass[nodes])
            if made is None:
                raise SceneError(
                    f'joint.between = "{name}": {len(nodes)} of its masses are not held, too few '
                    "to tell how it turns; give another one, or a finer mesh"
                )
            place, rows[:, nodes] = made
        return place, rows[:, self.free].reshape(6, -1)

    def elastic(self, places: Floats) -> float:
        """Elastic energy of nodes at some places (nodes, dim) [J]."""
        ways = places[self.mesh.edges[:, 1]] - places[self.mesh.edges[:, 0]]
        longer = np.linalg.norm(ways, axis=1) - self.mesh.lengths
        return 0.5 * float(self.mesh.stiffness @ longer**2)


_PAIRS = (("ij", "kl"), ("ik", "jl"), ("il", "jk"))


def net_system(scene: Scene, body: SpringNet) -> Net:
    """The masses and springs of a body (collective).

    Raises:
        SceneError: Its shape holds no cell, or too many.
        MeshError: Its mesh file cannot be used, or all of it is held.
    """
    mesh = net_mesh(body, scene.folder or Path())
    count, dim = mesh.points.shape
    held = np.zeros(count, dtype=bool)
    led: list[tuple[Integers, tuple[Formula, ...]]] = []
    for support in body.supports:
        if support.surface not in mesh.surfaces:
            raise MeshError(
                f"body {body.name}: its mesh has no surface {support.surface}; it has "
                f"{', '.join(mesh.surfaces) or 'none'}"
            )
        nodes = mesh.surfaces[support.surface]
        if support.moves or led:
            _check_shared(body, support, nodes[held[nodes]])
        held[nodes] = True
        if support.value is not None:
            led.append((nodes, tuple(u for u in support.value if u is not None)))
    free, mass = np.flatnonzero(~held), body.mass * mesh.weights
    if not len(free):
        raise MeshError(f"body {body.name}: its supports hold all of it; remove one")
    start = mesh.points.copy()
    centre, spin = mesh.weights @ start, np.zeros(3)
    if body.angular_velocity is not None:
        spin[6 - 2 * dim :] = body.angular_velocity
    whirl = np.cross(spin, in_space(start - centre))[:, :dim]
    speed = (body.centre_velocity() + whirl)[free]

    def places(q: Floats) -> Floats:
        found = start.copy()
        found[free] = q.reshape(-1, dim)
        return found

    stiffest = np.zeros(count)
    np.add.at(stiffest, mesh.edges, mesh.stiffness[:, None])
    rate = float(np.sqrt((stiffest / mass).max()))
    found = Net(
        names=(body.name,),
        masses=(body.mass,),
        centers=centre[None],
        speeds=(mass[free] @ speed)[None] / body.mass,
        inertias=(0.0,),
        angles=(0.0,),
        position=start[free].ravel(),
        velocity=speed.ravel(),
        places=places,
        radius=np.full(count, body.radius),
        shell=np.full(count, body.radius),
        touching=~held,
        body=np.zeros(count, dtype=np.int64),
        lines=mesh.edges,
        ends={},
        rate=lambda: rate / _STEPS,
        words="",
        mesh=mesh,
        node_mass=mass,
        free=free,
        led=tuple(led),
        damping=_damping(body, mesh, mass, free),
        force=tuple(body.force or ()),
    )
    object.__setattr__(found, "words", _in_words(found))
    return found


def _check_shared(body: SpringNet, support: Support, shared: Integers) -> None:
    """Refuse masses that two supports hold, one of which moves."""
    if len(shared):
        raise SceneError(
            f"body {body.name}: its supports hold {len(shared)} masses of {support.surface} twice, "
            "and one of them moves; give supports that share none"
        )


def _damping(body: SpringNet, mesh: NetMesh, mass: Floats, free: Integers) -> tuple[float, float]:
    """By mass [1/s] and by stiffness [s].

    Raises:
        SceneError: They go by its first mode, and it has none.
    """
    if not (body.quality_factor or body.damping_ratio):
        return body.rayleigh_mass, body.rayleigh_stiffness
    dim = mesh.points.shape[1]
    first = first_frequency(rest_stiffness(mesh, free), np.repeat(mass[free], dim), 3 * dim - 3)
    if not first > 0.0:
        raise SceneError(
            f"body {body.name}: nothing but rigid motions was found, so that damping by its first "
            "mode says nothing; give damping = { mass, stiffness }"
        )
    return rayleigh_of(body, first, held=bool(body.supports))


def rest_stiffness(mesh: NetMesh, free: Integers) -> csr_matrix:
    """Of what is not strained, in the coordinates of free nodes [N/m], (d, d)."""
    (count, dim), (one, two) = mesh.points.shape, mesh.edges.T
    ways = (mesh.points[two] - mesh.points[one]) / mesh.lengths[:, None]
    each = np.broadcast_to(np.arange(dim), (len(one), dim))
    stretch = coo_matrix(
        (np.concatenate([-ways, ways]).ravel(),
         (np.tile(np.repeat(np.arange(len(one)), dim), 2),
          np.concatenate([dim * one[:, None] + each, dim * two[:, None] + each]).ravel())),
        shape=(len(one), count * dim),
    ).tocsc()[:, (dim * free[:, None] + np.arange(dim)).ravel()]  # fmt: skip
    return csr_matrix(stretch.T @ diags(mesh.stiffness) @ stretch)


def _in_words(net: Net) -> str:
    """What it is and how stiff."""
    text = f"a net of {len(net.node_mass)} masses and {len(net.mesh.edges)} springs"
    unit = "N/m" if net.dim == 2 else "Pa"
    if net.isotropic is not None:
        modulus, nu = net.isotropic
        return f"{text}, isotropic with E = {modulus:.6g} {unit}, Poisson's ratio {nu:.6g}"
    shown = ", ".join(f"{name} = {value:.6g}" for name, value in net.stiffness.items())
    return f"{text}, whose stiffness depends on the direction ({shown} {unit})"

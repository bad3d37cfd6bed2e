"""Trees of rigid bodies in minimal coordinates, by Pinocchio.

Coordinates q may be more than rates v: a free base has a quaternion, a joint without limits cosine
and sine. The first rates of a free base are its velocity along fixed axes and its spin along its
own (Pinocchio's are both along its own): a way dt v then goes straight, and the first three
components of M v are the momentum.
"""

from collections.abc import Collection, Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import MissingDependencyError
from impactfem.scene.rigid_keys import rotation


def import_for_robots(name: str, needed_by: str) -> Any:
    """Import a library of the extra for robots, saying what to install if that fails.

    Raises:
        MissingDependencyError: It is not installed.
    """
    try:
        return import_module(name.lower())
    except (ImportError, OSError) as error:
        raise MissingDependencyError(
            f"{needed_by} needs {name}, which cannot be loaded ({error}). "
            "Remedy: pip install impactfem[robots]"
        ) from error


def import_pinocchio() -> Any:
    """Import Pinocchio; see `import_for_robots`."""
    return import_for_robots("Pinocchio", 'body: kind = "mechanism"')


def cross(one: Floats, two: Floats) -> Floats:
    """Cross products of vectors (..., 3), at a tenth of the cost of NumPy's for few."""
    after, last = [1, 2, 0], [2, 0, 1]
    found: Floats = one[..., after] * two[..., last] - one[..., last] * two[..., after]
    return found


class Tree:
    """Kinematics and dynamics of a tree.

    Attributes:
        model: Pinocchio's.
        single: Joints of one rate of their own by name: the place of their rate.
        followers: Joints that follow one of these: its name, ratio and offset [rad, m].
        mass: Of all that moves [kg].
        free: Whether its base is free.
    """

    def __init__(
        self,
        model: Any,
        mimics: Mapping[str, tuple[str, float, float]] | None = None,
        spherical: Collection[str] = (),
    ) -> None:
        """Take a model of Pinocchio.

        Rates of the model are L v, with constants L: joints that follow others and those that hold
        a place add none.

        Args:
            model: Of Pinocchio.
            mimics: Joints that follow another one: this, ratio and offset.
            spherical: Joints of six rates of the model that only turn.
        """
        self._pin = import_pinocchio()
        self.model, self._data = model, model.createData()
        names, at, counts = list(model.names), list(model.idx_vs), list(model.nvs)
        first = model.njoints > 1 and model.parents[1] == 0 and counts[1] == 6
        self.free = bool(first and names[1] not in spherical)
        single = {names[k]: int(at[k]) for k in range(1, model.njoints) if counts[k] == 1}
        self._first = {name: int(model.idx_qs[model.getJointId(name)]) for name in single}
        self.followers = _followers(mimics or {}, single)
        lift = np.eye(model.nv)
        for name, (of, ratio, _) in self.followers.items():
            lift[single[name], single[of]] = ratio
        held = [single[name] for name in self.followers]
        held += [int(at[model.getJointId(name)]) + k for name in spherical for k in range(3)]
        own = np.setdiff1d(np.arange(model.nv), held)
        self._lift = lift[:, own] if len(held) else None
        self._own_rates = own
        self.single = {
            name: int(np.searchsorted(own, place))
            for name, place in single.items()
            if name not in self.followers
        }
        self._below = np.tril_indices(model.nv, -1)
        self.mass = float(sum(inertia.mass for inertia in list(model.inertias)[1:]))

    @property
    def root(self) -> str:
        """Name of the joint that the first link moves with."""
        return str(self.model.names[1])

    @property
    def rates(self) -> int:
        """Number of v."""
        return len(self._own_rates)

    def neutral(self) -> Floats:
        """Coordinates with all joints at 0, a free base where it is at t = 0."""
        known = self.model.referenceConfigurations
        found = np.array(known["base"] if self.free else self._pin.neutral(self.model))
        for name in {of for of, _, _ in self.followers.values()}:
            self.put(found, name, 0.0)
        return found

    def _lifted(self, v: Floats) -> Floats:
        """Rates of the model."""
        return v if self._lift is None else np.asarray(self._lift @ v)

    @property
    def damping(self) -> Floats:
        """Of joints, by rate [N m s, N s/m], (v,)."""
        own = np.array(self.model.damping)
        return own if self._lift is None else np.asarray(own @ self._lift**2)

    @property
    def friction(self) -> Floats:
        """Coulomb's in joints, by rate [N m, N], (v,)."""
        own = np.array(self.model.upperDryFrictionLimit)
        return own if self._lift is None else np.asarray(own @ np.abs(self._lift))

    def integrate(self, q: Floats, way: Floats) -> Floats:
        """Coordinates after constant rates that make a way."""
        way = self._lifted(way)
        if not self.free:
            return np.asarray(self._pin.integrate(self.model, q, way))
        turned = np.concatenate([np.zeros(3), way[3:]])
        found = np.asarray(self._pin.integrate(self.model, q, turned))
        found[:3] += way[:3]
        return found

    def base(self, q: Floats) -> Floats:
        """Rotation of a free base, (3, 3)."""
        x, y, z, w = q[3:7]
        return rotation(np.array([w, x, y, z]))

    def _own(self, q: Floats, v: Floats) -> Floats:
        """Rates as Pinocchio has them."""
        v = self._lifted(v)
        if not self.free:
            return v
        return np.concatenate([self.base(q).T @ v[:3], v[3:]])

    def _fixed(self, q: Floats, columns: Floats) -> Floats:
        """Derivatives by Pinocchio's rates (..., v) as those by ours."""
        if self.free:
            columns[..., :3] = columns[..., :3] @ self.base(q).T
        return columns if self._lift is None else np.asarray(columns @ self._lift)

    def put(self, q: Floats, name: str, value: float) -> None:
        """Set the position of a single joint [rad, m] in coordinates, and of what follows it."""
        for other, (of, ratio, offset) in self.followers.items():
            if of == name:
                self.put(q, other, ratio * value + offset)
        first = self._first[name]
        if self.model.nqs[self.model.getJointId(name)] == 1:
            q[first] = value
        else:
            q[first : first + 2] = np.cos(value), np.sin(value)

    def position(self, q: Floats, name: str) -> float:
        """Position of a single joint [rad, m], between -pi and pi where it turns without end."""
        first = self._first[name]
        if self.model.nqs[self.model.getJointId(name)] == 1:
            return float(q[first])
        return float(np.arctan2(q[first + 1], q[first]))

    def limits(self) -> tuple[Floats, Floats]:
        """Lower and upper positions of single joints by rate, infinite without, (v,) each."""
        lower, upper = np.full(self.rates, -np.inf), np.full(self.rates, np.inf)
        huge = 1e30  # what files without limits become
        for name, first in self._first.items():
            if self.model.nqs[self.model.getJointId(name)] != 1:
                continue
            low, high = self.model.lowerPositionLimit[first], self.model.upperPositionLimit[first]
            ends = [low if low >= -huge else -np.inf, high if high <= huge else np.inf]
            of, ratio, offset = self.followers.get(name, (name, 1.0, 0.0))
            if ratio == 0.0:
                continue
            ends = sorted((end - offset) / ratio for end in ends)
            at = self.single[of]
            lower[at], upper[at] = max(lower[at], ends[0]), min(upper[at], ends[1])
        return lower, upper

    def inertia(self, q: Floats) -> Floats:
        """Mass matrix M(q), (v, v)."""
        size = self.model.nv  # Pinocchio drops axes of length 1
        found = np.array(self._pin.crba(self.model, self._data, q)).reshape(size, size)
        found[self._below] = found.T[self._below]  # it fills in what is above
        whole = self._fixed(q, found)
        twice = self.free or self._lift is not None
        return self._fixed(q, whole.T.copy()) if twice else whole

    def whirl(self, q: Floats, v: Floats) -> Floats:
        """C(q, v)^T v, (v,), without that of a free base, which is 0 but for what turns with it.

        With it (M v)' are the generalised forces, since M' = C + C^T.
        """
        own = self._own(q, v)
        found = self._pin.computeCoriolisMatrix(self.model, self._data, q, own)
        whirl = np.reshape(found, (len(own), len(own))).T @ own
        whirl[: 6 * self.free] = 0.0
        return np.asarray(whirl if self._lift is None else whirl @ self._lift)

    def bias(self, q: Floats, v: Floats, gravity: Floats) -> Floats:
        """Generalised forces by which rates v stay, of a base that is fixed, (v,)."""
        self.model.gravity.linear = gravity
        found = self._pin.nonLinearEffects(self.model, self._data, q, self._lifted(v))
        return self._fixed(q, np.array(found))

    def drifts(self, q: Floats, v: Floats, names: Sequence[str]) -> tuple[Floats, Floats]:
        """Accelerations while rates v stay, of a base that is fixed.

        Returns:
            Of the centre of mass (3,), and of frames and their spins, (names, 6).
        """
        pin, model, data = self._pin, self.model, self._data
        own, unchanged = self._lifted(v), np.zeros(model.nv)
        pin.centerOfMass(model, data, q, own, unchanged)
        centre = np.array(data.acom[0])
        pin.forwardKinematics(model, data, q, own, unchanged)
        pin.updateFramePlacements(model, data)
        axes, at = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED, model.getFrameId
        found = [pin.getFrameClassicalAcceleration(model, data, at(n), axes).vector for n in names]
        return centre, np.array(found).reshape(-1, 6)

    def centre(self, q: Floats) -> Floats:
        """Centre of mass [m], (3,)."""
        return np.array(self._pin.centerOfMass(self.model, self._data, q))

    def centre_jacobian(self, q: Floats) -> Floats:
        """Its velocities by the rates, (3, v)."""
        found = self._pin.jacobianCenterOfMass(self.model, self._data, q)
        return self._fixed(q, np.reshape(np.array(found), (3, self.model.nv)))

    def momenta(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Momentum [kg m/s], and angular momentum about the centre of mass [kg m^2/s], (3,)."""
        self._pin.ccrba(self.model, self._data, q, self._own(q, v))
        return np.array(self._data.hg.linear), np.array(self._data.hg.angular)

    def poses(self, q: Floats, joints: Sequence[int]) -> tuple[Floats, Floats]:
        """Rotations (joints, 3, 3) and places [m], (joints, 3), of the frames of joints."""
        self._pin.forwardKinematics(self.model, self._data, q)
        each = [self._data.oMi[joint] for joint in joints]
        turns = np.array([pose.rotation for pose in each]).reshape(-1, 3, 3)
        return turns, np.array([pose.translation for pose in each]).reshape(-1, 3)

    def jacobians(self, q: Floats, joints: Sequence[int]) -> Floats:
        """Velocities and spins, along fixed axes, of the frames of joints, (joints, 6, v)."""
        pin, model, data = self._pin, self.model, self._data
        pin.computeJointJacobians(model, data, q)
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        found = [pin.getJointJacobian(model, data, joint, axes) for joint in joints]
        return self._fixed(q, np.array(found).reshape(-1, 6, self.model.nv))

    def frames(self) -> list[str]:
        """Names of links, joints and other frames of the file."""
        return [frame.name for frame in self.model.frames][1:]

    def above(self) -> dict[str, str]:
        """The frame that each frame hangs on, by name."""
        each = list(self.model.frames)
        return {frame.name: str(each[frame.parentFrame].name) for frame in each[1:]}

    def rate_names(self) -> list[str]:
        """Names of the rates: of joints, with a number behind it where they have several."""
        found: list[str] = []
        joints = zip(self.model.names, self.model.idx_vs, self.model.nvs, strict=True)
        for name, first, count in list(joints)[1:]:
            own = np.intersect1d(self._own_rates, np.arange(first, first + count))
            found += [f"{name}.{k}" for k in range(len(own))] if count > 1 else [name] * len(own)
        return found

    def links(self) -> dict[str, int]:
        """Links by name: the joint that each moves with, 0 if it is fixed."""
        body = self._pin.FrameType.BODY
        return {f.name: int(f.parentJoint) for f in self.model.frames if f.type == body}

    def frame(self, q: Floats, name: str) -> tuple[Floats, Floats, Floats]:
        """Place [m], (3,), unit quaternion (w, x, y, z) and Jacobian (6, v) of a frame."""
        pin, model, data = self._pin, self.model, self._data
        at = model.getFrameId(name)
        pin.computeJointJacobians(model, data, q)
        pose = pin.updateFramePlacement(model, data, at)
        x, y, z, w = pin.Quaternion(pose.rotation).coeffs()
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = np.array(pin.getFrameJacobian(model, data, at, axes)).reshape(6, self.model.nv)
        turn = np.array([w, x, y, z])
        turn *= -1.0 if w < 0.0 else 1.0
        return np.array(pose.translation), turn, self._fixed(q, jacobian)


def _followers(
    mimics: Mapping[str, tuple[str, float, float]], single: Collection[str]
) -> dict[str, tuple[str, float, float]]:
    """Joints that follow one with a rate of its own, through chains of such.

    Raises:
        ValueError: One has not one rate, or they follow each other; it names the joint.
    """
    found = {}
    for name in mimics:
        of, ratio, offset = name, 1.0, 0.0
        for _ in range(len(mimics) + 1):
            if of not in single:
                raise ValueError(of)
            if of not in mimics:
                break
            of, by, beside = mimics[of]
            ratio, offset = ratio * by, ratio * beside + offset
        else:
            raise ValueError(name)
        found[name] = (of, ratio, offset)
    return found

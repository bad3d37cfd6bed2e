"""Trees of rigid bodies in minimal coordinates, by Pinocchio.

Coordinates q may be more than rates v: a free base has a quaternion, a joint without limits cosine
and sine. The first rates of a free base are its velocity along fixed axes and its spin along its
own (Pinocchio's are both along its own): a way dt v then goes straight, and the first three
components of M v are the momentum.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import MissingDependencyError
from impactfem.scene.rigid_keys import rotation


def import_pinocchio() -> Any:
    """Import Pinocchio, saying what to install if that fails.

    Raises:
        MissingDependencyError: It is not installed.
    """
    try:
        import pinocchio  # noqa: PLC0415  (an extra)
    except (ImportError, OSError) as error:
        raise MissingDependencyError(
            f'body: kind = "mechanism" needs Pinocchio, which cannot be loaded ({error}). '
            "Remedy: pip install impactfem[robots]"
        ) from error
    return pinocchio


def cross(one: Floats, two: Floats) -> Floats:
    """Cross products of vectors (..., 3), at a tenth of the cost of NumPy's for few."""
    after, last = [1, 2, 0], [2, 0, 1]
    found: Floats = one[..., after] * two[..., last] - one[..., last] * two[..., after]
    return found


class Tree:
    """Kinematics and dynamics of a tree.

    Attributes:
        model: Pinocchio's.
        single: Joints of one rate by name: the place of their rate, (joints,).
        mass: Of all that moves [kg].
        free: Whether its base is free.
    """

    def __init__(self, model: Any) -> None:
        """Take a model of Pinocchio."""
        self._pin = import_pinocchio()
        self.model, self._data = model, model.createData()
        single = [k for k in range(1, model.njoints) if model.nvs[k] == 1]
        self.single = {model.names[k]: int(model.idx_vs[k]) for k in single}
        self._first = {model.names[k]: int(model.idx_qs[k]) for k in single}
        self.free = model.njoints > 1 and model.parents[1] == 0 and model.nvs[1] == 6
        self._below = np.tril_indices(self.rates, -1)
        self.mass = float(sum(inertia.mass for inertia in list(model.inertias)[1:]))

    @property
    def root(self) -> str:
        """Name of the joint that the first link moves with."""
        return str(self.model.names[1])

    @property
    def rates(self) -> int:
        """Number of v."""
        return int(self.model.nv)

    def neutral(self) -> Floats:
        """Coordinates with all joints at 0, a free base where it is at t = 0."""
        known = self.model.referenceConfigurations
        return np.array(known["base"] if self.free else self._pin.neutral(self.model))

    def integrate(self, q: Floats, way: Floats) -> Floats:
        """Coordinates after constant rates that make a way."""
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
        if not self.free:
            return v
        return np.concatenate([self.base(q).T @ v[:3], v[3:]])

    def _fixed(self, q: Floats, columns: Floats) -> Floats:
        """Derivatives by Pinocchio's rates (..., v) as those by ours."""
        if self.free:
            columns[..., :3] = columns[..., :3] @ self.base(q).T
        return columns

    def put(self, q: Floats, name: str, value: float) -> None:
        """Set the position of a single joint [rad, m] in coordinates."""
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
        for name, at in self.single.items():
            if self.model.nqs[self.model.getJointId(name)] == 1:
                first = self._first[name]
                lower[at] = self.model.lowerPositionLimit[first]
                upper[at] = self.model.upperPositionLimit[first]
        huge = 1e30  # what files without limits become
        lower[lower < -huge], upper[upper > huge] = -np.inf, np.inf
        return lower, upper

    def inertia(self, q: Floats) -> Floats:
        """Mass matrix M(q), (v, v)."""
        size = self.rates  # Pinocchio drops axes of length 1
        found = np.array(self._pin.crba(self.model, self._data, q)).reshape(size, size)
        found[self._below] = found.T[self._below]  # it fills in what is above
        whole = self._fixed(q, found)
        return self._fixed(q, whole.T.copy()) if self.free else whole

    def whirl(self, q: Floats, v: Floats) -> Floats:
        """C(q, v)^T v, (v,), without that of a free base, which is 0 but for what turns with it.

        With it (M v)' are the generalised forces, since M' = C + C^T.
        """
        own = self._own(q, v)
        found = self._pin.computeCoriolisMatrix(self.model, self._data, q, own)
        whirl = np.reshape(found, (len(v), len(v))).T @ own
        whirl[: 6 * self.free] = 0.0
        return np.asarray(whirl)

    def centre(self, q: Floats) -> Floats:
        """Centre of mass [m], (3,)."""
        return np.array(self._pin.centerOfMass(self.model, self._data, q))

    def centre_jacobian(self, q: Floats) -> Floats:
        """Its velocities by the rates, (3, v)."""
        found = self._pin.jacobianCenterOfMass(self.model, self._data, q)
        return self._fixed(q, np.reshape(np.array(found), (3, self.rates)))

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
        return self._fixed(q, np.array(found).reshape(-1, 6, self.rates))

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
        for name, count in list(zip(self.model.names, self.model.nvs, strict=True))[1:]:
            found += [name] if count == 1 else [f"{name}.{k}" for k in range(count)]
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
        jacobian = np.array(pin.getFrameJacobian(model, data, at, axes)).reshape(6, self.rates)
        turn = np.array([w, x, y, z])
        turn *= -1.0 if w < 0.0 else 1.0
        return np.array(pose.translation), turn, self._fixed(q, jacobian)

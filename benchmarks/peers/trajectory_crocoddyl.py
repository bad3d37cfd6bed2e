"""A block or a cart and pole moved with least effort by Crocoddyl's differential programming.

    python trajectory_crocoddyl.py CASE      # CASE and answer are JSON; pip install crocoddyl

Controls are constant over each interval of Runge and Kutta's steps; the end is met by a penalty
that grows (the fastest of three sequences that were tried). It begins at the states and controls of
the case.
"""

import json
import sys
import time

import crocoddyl
import numpy as np
import pinocchio

PENALTIES = (1e6, 1e8)
MOST = 500  # iterations for each


def block() -> pinocchio.Model:
    """A mass of 1 kg on a line."""
    model = pinocchio.Model()
    joint = model.addJoint(0, pinocchio.JointModelPX(), pinocchio.SE3.Identity(), "x")
    model.appendBodyToJoint(
        joint, pinocchio.Inertia(1.0, np.zeros(3), np.zeros((3, 3))), pinocchio.SE3.Identity()
    )
    return model


def cart() -> pinocchio.Model:
    """Kelly's pole of .3 kg and .5 m on a cart of 1 kg; the pole hangs at 0."""
    model = block()
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    joint = model.addJoint(
        1, pinocchio.JointModelRevoluteUnaligned(0.0, -1.0, 0.0), pinocchio.SE3.Identity(), "angle"
    )
    tip = pinocchio.Inertia(0.3, np.array([0.0, 0.0, -0.5]), np.zeros((3, 3)))
    model.appendBodyToJoint(joint, tip, pinocchio.SE3.Identity())
    return model


class First(crocoddyl.ActuationModelAbstract):
    """A force on the first joint only."""

    def __init__(self, state: crocoddyl.StateMultibody) -> None:
        super().__init__(state, 1)

    def calc(self, data: crocoddyl.ActuationDataAbstract, _: np.ndarray, u: np.ndarray) -> None:
        """Force of the joints by the control."""
        data.tau = np.append(u, np.zeros(self.state.nv - 1))

    def calcDiff(self, data: crocoddyl.ActuationDataAbstract, *_: np.ndarray) -> None:  # noqa: N802
        """Its derivative."""
        data.dtau_du = np.eye(self.state.nv)[:, :1]


def main() -> None:
    """Print states, controls and seconds."""
    case = json.loads(sys.argv[1])
    model = {"block": block, "cart": cart}[case["name"]]()
    state = crocoddyl.StateMultibody(model)
    actuation = First(state)
    n, steps = model.nv, case["nodes"]
    end = np.concatenate([case["end"], np.zeros(n)])

    def action(weight: float, effort: float, dt: float) -> crocoddyl.ActionModelAbstract:
        costs = crocoddyl.CostModelSum(state, 1)
        control = crocoddyl.CostModelResidual(state, crocoddyl.ResidualModelControl(state, 1))
        place = crocoddyl.CostModelResidual(state, crocoddyl.ResidualModelState(state, end, 1))
        costs.addCost("effort", control, effort)
        costs.addCost("end", place, weight)
        dynamics = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, actuation, costs)
        # Without it the wheel 3.2.1 (Pinocchio 4.1) has wrong derivatives of free motions.
        dynamics.armature = np.zeros(n)
        moved = crocoddyl.IntegratedActionModelRK(dynamics, crocoddyl.RKType.four, dt)
        moved.u_lb = np.array([-case["most"]])
        moved.u_ub = -moved.u_lb
        return moved

    dt = case["duration"] / steps
    first = np.zeros(2 * n)
    running = action(0.0, 2.0, dt)  # a half of its square is the cost
    begin = time.perf_counter()
    us = [np.array([u]) for u in case["controls"]]
    xs = [np.array(x) for x in case["states"]]
    for weight in PENALTIES:
        problem = crocoddyl.ShootingProblem(first, [running] * steps, action(weight, 0.0, 0.0))
        solver = crocoddyl.SolverBoxFDDP(problem)
        solver.th_stop = 1e-12
        solver.solve(xs, us, MOST, False)
        xs, us = list(solver.xs), list(solver.us)
    print(
        json.dumps(
            {
                "version": crocoddyl.__version__,
                "seconds": time.perf_counter() - begin,
                "controls": [float(u[0]) for u in us],
                "states": [x.tolist() for x in xs],
            }
        )
    )


if __name__ == "__main__":
    main()

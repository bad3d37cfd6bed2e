"""The balls of `poured_balls.py` in MuJoCo: python poured_mujoco.py CASE as JSON.

Soft contacts with the settings of `rigid_mujoco.py`: elliptic cone, Newton's method, impratio 100,
solref of two steps, solimp 0.99; restitution is not among its laws.
"""

import json
import resource
import sys
import time

import mujoco
import numpy as np


def main() -> None:
    """Run and print a row."""
    case = json.loads(sys.argv[1])
    balls = "".join(
        f'<body pos="{x} {y} {z}"><freejoint/>'
        f'<geom type="sphere" size="{case["radius"]}" mass="0.1"/></body>'
        for x, y, z in case["places"]
    )
    walls = "".join(
        f'<geom type="plane" size="0 0 1" pos="{" ".join(map(str, point))}" '
        f'zaxis="{" ".join(map(str, normal))}"/>'
        for point, normal in case["walls"]
    )
    text = f"""<mujoco><option timestep="1e-3" integrator="implicitfast" cone="elliptic"
      solver="Newton" tolerance="{case["tolerance"]}" iterations="200" impratio="100"
      gravity="0 0 -9.81"/><size memory="1G"/>
      <default><geom friction="0.3 0 0" condim="3" solref="2e-3 1" solimp="0.99 0.99 1e-6"/>
      </default><worldbody>{walls}{balls}</worldbody></mujoco>"""
    begin = time.process_time()
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    before, depth, marks = time.process_time() - begin, 0.0, [time.process_time()]
    for _ in range(case["steps"]):
        mujoco.mj_step(model, data)
        marks.append(time.process_time())
        depth = max(depth, -float(data.contact.dist.min(initial=0.0)))
    mujoco.mj_energyVel(model, data)
    each, window = 1e3 * np.diff(marks), case["window"]
    pushing = int((data.contact.dist < 0.0).sum())
    row = {
        "by": f"MuJoCo {mujoco.__version__}",
        "balls": len(case["places"]),
        "residual asked": f"tolerance {case['tolerance']}",
        "reached": "-",
        "before and after [s]": f"{before:.1f}",
        "falling [ms]": f"{each[:window].mean():.2g}",
        "at the end [ms]": f"{each[-window:].mean():.2g}",
        "steps": len(each),
        "contacts there": pushing,
        "depth / radius": f"{depth / case['radius']:.3f}",
        "rest": {
            "heights": data.xpos[1:, 2].tolist(),
            "depth": depth,
            "energy": float(data.energy[1]),
            "seconds": float(each.sum()) * 1e-3,
        },
        "memory [MiB]": f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f}",
    }
    print(json.dumps(row))


if __name__ == "__main__":
    main()

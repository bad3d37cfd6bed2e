"""The bodies of `rigid_ensemble.py` in MuJoCo: python ensemble_mujoco.py CASE as JSON.

Settings of `rigid_mujoco.py`; its cylinders are round, their axis along z.
"""

import json
import sys
import time

import mujoco


def main() -> None:
    """Microseconds of a step of one member, on one thread."""
    case = json.loads(sys.argv[1])
    side = {
        "block": 'type="box" size="0.05 0.05 0.05"', "sphere": 'type="sphere" size="0.05"',
        "cylinder": 'type="cylinder" size="0.05 0.01"',
    }[case["kind"]]  # fmt: skip
    text = f"""<mujoco><option timestep="{case["dt"]}" integrator="implicitfast" cone="elliptic"
      solver="Newton" tolerance="1e-8" iterations="200" impratio="100" gravity="0 -9.81 0"/>
      <default><geom friction="0.3 0 0" condim="3" solref="{2 * case["dt"]} 1"
      solimp="0.99 0.99 1e-6"/></default><worldbody>
      <geom type="plane" size="0 0 1" zaxis="0 1 0"/>
      <body pos="0 0.15 0"><freejoint/><geom {side} density="1000"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data, seconds = mujoco.MjData(model), 0.0
    for velocity, spin in zip(case["velocity"], case["spin"], strict=True):
        mujoco.mj_resetData(model, data)
        data.qvel[:3], data.qvel[3:] = velocity, spin
        begin = time.process_time()
        mujoco.mj_step(model, data, nstep=case["steps"])
        seconds += time.process_time() - begin
    found = 1e6 * seconds / case["steps"] / len(case["velocity"])
    print(json.dumps({"seconds": found, "version": mujoco.__version__}))


if __name__ == "__main__":
    main()

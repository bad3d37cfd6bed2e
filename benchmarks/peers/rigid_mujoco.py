"""A scene of `rigid_peers.py` in MuJoCo: python rigid_mujoco.py CASE as JSON.

Contacts are soft. Settings that were best of those tried: implicitfast, elliptic cone, Newton to
1e-14, impratio 100, solref of two steps (the least that it takes), solimp 0.99 throughout, with
``noslip`` iterations after each step (0: none). Bodies settle for 1 s, not timed, before they are
pulled. Top, on a
smooth plane too, and chain: RK4.
"""

import json
import sys
import time

import mujoco
import numpy as np

SETTLE = 1.0  # [s]


def options(case: dict) -> str:
    """How it steps."""
    pull = " ".join(map(str, case["gravity"]))
    if case["kind"] == "plane_top":
        return f"""<option timestep="{case["dt"]}" integrator="RK4" cone="elliptic"
          solver="Newton" tolerance="1e-14" iterations="200" gravity="{pull}"/>
          <default><geom condim="1" solref="{2 * case["dt"]} 1" solimp="0.99 0.99 1e-6"/>
          </default>"""
    if case["kind"] != "floor":
        return f'<option timestep="{case["dt"]}" integrator="RK4" gravity="{pull}"/>'
    return f"""<option timestep="{case["dt"]}" integrator="implicitfast" cone="elliptic"
      solver="Newton" tolerance="1e-14" iterations="200" impratio="100"
      noslip_iterations="{case["noslip"]}" gravity="{pull}"/>
      <default><geom friction="{case["mu"]} 0 0" condim="3" solref="{2 * case["dt"]} 1"
      solimp="0.99 0.99 1e-6"/></default>"""


def content(case: dict) -> str:
    """The bodies."""
    if case["kind"] == "top":
        return '<body><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 2 3"/></body>'
    if case["kind"] == "plane_top":
        moments, half = " ".join(map(str, case["inertia"])), 0.5 * case["tilt"]
        y = case["height"] * np.cos(case["tilt"]) + case["radius"]
        return f"""<geom type="plane" size="50 50 1" zaxis="0 1 0"/>
          <body pos="0 {y} 0" quat="{np.cos(half)} {np.sin(half)} 0 0"><freejoint/>
          <inertial pos="0 0 0" mass="1" diaginertia="{moments}"/>
          <geom type="sphere" size="{case["radius"]}" pos="0 {-case["height"]} 0"/></body>"""
    if case["kind"] == "chain":
        text, (length, mass) = "", case["link"]
        inertia = mass * length**2 / 12.0
        for k in range(case["links"]):
            at = length if k else 0.0
            text += f"""<body pos="{at} 0 0"><joint type="hinge" axis="0 0 1"/>
              <inertial pos="{length / 2} 0 0" mass="{mass}"
              diaginertia="{inertia} {inertia} {inertia}"/>"""
        return text + "</body>" * case["links"]
    side = 'type="sphere" size="0.1"' if case["ball"] else 'type="box" size="0.1 0.05 0.1"'
    return '<geom type="plane" size="50 50 1" zaxis="0 1 0"/>' + "".join(
        f'<body pos="0 {y} 0"><freejoint/><geom {side} mass="{mass}"/></body>'
        for y, mass in zip(case["heights"], case["masses"], strict=True)
    )


def settle(scene: object, data: object, case: dict) -> None:
    """Let bodies come to rest, and give the first one its speed.

    Bodies that just touch fall freely for a step, and would keep that speed at the limit of
    friction: they settle without the pull across the floor.
    """
    scene.opt.gravity[0] = 0.0
    for _ in range(round(SETTLE / case["dt"])):
        mujoco.mj_step(scene, data)
    scene.opt.gravity[0] = case["gravity"][0]
    data.qvel[:] = 0.0
    data.qvel[0] = case["speed"]


def run(case: dict) -> dict:
    """What the case asks for, and seconds."""
    text = f"<mujoco>{options(case)}<worldbody>{content(case)}</worldbody></mujoco>"
    scene = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(scene)
    if case["kind"] == "floor":
        settle(scene, data, case)
    elif case["kind"] in {"top", "plane_top"}:
        data.qvel[3:6] = case["spin"]
    start, spins = data.qpos.copy(), []
    begin = time.process_time()
    for _ in range(round(case["duration"] / case["dt"])):
        mujoco.mj_step(scene, data)
        if case["kind"] == "top":
            spins.append(data.qvel[4])
    seconds = time.process_time() - begin
    found = {"seconds": seconds, "version": mujoco.__version__}
    if case["kind"] == "top":
        return found | {"spins": spins}
    if case["kind"] == "plane_top":
        return found | {"axis": data.xmat[1].reshape(3, 3)[:, 1].tolist()}
    if case["kind"] == "chain":
        angles = np.cumsum(data.qpos)
        tip = case["link"][0] * np.array([np.cos(angles).sum(), np.sin(angles).sum()])
        return found | {"tip": tip.tolist()}
    force, wrench = 0.0, np.zeros(6)
    for k in range(data.ncon):
        if 0 in data.contact[k].geom:
            mujoco.mj_contactForce(scene, data, k, wrench)
            force += wrench[0]
    return found | {"way": data.qpos[0] - start[0], "speed": data.qvel[0], "force": force}


if __name__ == "__main__":
    print(json.dumps(run(json.loads(sys.argv[1]))))

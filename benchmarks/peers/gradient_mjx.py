"""Height of a ball after an impact by that from which it fell, in MuJoCo's MJX, by JAX.

    python gradient_mjx.py CASE      # CASE and answer are JSON; pip install mujoco-mjx

Contact and its restitution are a spring and a damper: ``stiffness`` [N/m] of a ball of 1 kg, damped
so that it comes back with the restitution that is asked for.
"""

import json
import math
import sys
import time

import jax
import jax.numpy as jnp
import mujoco
from mujoco import mjx

jax.config.update("jax_enable_x64", True)


def main() -> None:
    """Print height, derivative and seconds of both."""
    case = json.loads(sys.argv[1])
    logs = math.log(case["restitution"])
    damping = 2.0 * math.sqrt(case["stiffness"]) * -logs / math.hypot(math.pi, logs)
    text = f"""<mujoco><option timestep="{case["dt"]}" gravity="0 0 -9.81" integrator="Euler"
      iterations="20" tolerance="1e-14"/>
      <default><geom friction="0 0 0" condim="1" solref="-{case["stiffness"]} -{damping}"
      solimp="0.9999 0.9999 1e-6"/></default><worldbody>
      <geom type="plane" size="0 0 1"/>
      <body pos="0 0 0"><joint type="slide" axis="0 0 1"/><geom type="sphere" size="0.1" mass="1"/>
      </body></worldbody></mujoco>"""
    model = mjx.put_model(mujoco.MjModel.from_xml_string(text))
    blank = mjx.make_data(model)
    steps = round(case["end"] / case["dt"])

    def height(first: jax.Array) -> jax.Array:
        data = blank.replace(qpos=blank.qpos.at[0].set(first + 0.1))
        last, _ = jax.lax.scan(lambda d, _: (mjx.step(model, d), None), data, None, length=steps)
        return last.qpos[0] - 0.1

    found = {"version": mujoco.__version__}
    for name, function in (("value", height), ("slope", jax.jacfwd(height))):
        compiled = jax.jit(function)
        compiled(jnp.array(1.0)).block_until_ready()
        begin = time.perf_counter()
        found[name] = float(compiled(jnp.array(1.0)).block_until_ready())
        found[f"{name}_seconds"] = time.perf_counter() - begin
    print(json.dumps(found))


if __name__ == "__main__":
    main()

# %% [markdown]
# # An oscillator against a stop
#
# One mass on a spring, driven, with a stop: impacts are located one by one. First as a scene, then
# as a system in Python, then many at once.

# %%
import numpy as np
from matplotlib.figure import Figure

import impactfem
from impactfem.shipped import shipped_scenes

scene = impactfem.Scene.from_toml(shipped_scenes()["oscillator"])
result = impactfem.solve(scene)
result

# %%
result.plot_history("gap", "mass.vx")

# %% [markdown]
# The error of the motion, from a run that is started 1e-9 off.

# %%
print(result.summary["error"])

# %% [markdown]
# The same by a scheme that steps over impacts: its errors fall with the step.

# %%
for dt in (4e-3, 2e-3, 1e-3):
    run = impactfem.solve(scene, method="moreau_jean", dt=dt)
    print(
        f"step {dt:g} s: error of the displacement {run.summary['error']['displacement_max']:.1e}"
    )

# %% [markdown]
# A pendulum of small angles between two stops, as equations: no scene is needed.

# %%
system = impactfem.systems.LinearSystem(
    mass=1.0,
    stiffness=[[9.81]],
    normals=[[1.0], [-1.0]],
    offsets=[0.2, 0.2],
    restitution=0.8,
)
motion = impactfem.integrate(system, [0.0], [1.0], 5.0, method="event_driven")
motion

# %% [markdown]
# Many at once: two hundred throws of a die, in the plane, that differ in their spin.

# %%
die = impactfem.Scene.from_dict(
    {
        "title": "A die, in the plane",
        "duration": 1.5,
        "gravity": [0.0, -9.81],
        "body": [
            {
                "kind": "rigid", "name": "die",
                "shape": {"kind": "block", "size": [0.016, 0.016], "corner": [-0.008, 0.1]},
                "density": 1200.0, "velocity": [0.5, 0.0],
            }
        ],
        "obstacle": [{"kind": "half_space", "name": "table", "point": [0, 0], "normal": [0, 1]}],
        "contact": [
            {"between": ["die", "table"], "friction_coefficient": 0.3, "restitution": 0.5}
        ],
    }
)  # fmt: skip
spins = np.linspace(20.0, 40.0, 200)
ensemble = impactfem.studies.solve_ensemble(die, angular_velocity=spins, dt=1e-3)
sides = np.round(ensemble.position[:, -1, 2] / (np.pi / 2)).astype(int) % 4
print("lies on its sides so many times:", np.bincount(sides, minlength=4))

# %%
figure = Figure(figsize=(8.0, 3.0), layout="constrained")
axes = figure.subplots()
axes.plot(spins, ensemble.position[:, -1, 2] / (2.0 * np.pi), ".", markersize=2)
axes.set(xlabel="spin at the start [rad/s]", ylabel="turns until it lies")
figure

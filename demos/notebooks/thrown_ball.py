# %% [markdown]
# # Drag and restitution from a measured throw
#
# A camera sees the height of a tennis ball 50 times a second, with errors of 2 cm. Which drag has
# it, and how much of its speed does the floor give back? The measurement is made here, from values
# that the search is not told.

# %%
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from matplotlib.figure import Figure

import impactfem

DRAG = ["-c*vx*sqrt(vx*vx + vy*vy)", "-c*vy*sqrt(vx*vx + vy*vy)"]
TABLE = {
    "title": "Thrown ball",
    "duration": 2.5,
    "gravity": [0.0, -9.81],
    "body": [
        {
            "kind": "point", "name": "ball", "mass": 0.06, "position": [0.0, 2.0],
            "velocity": [1.0, 4.0], "force": DRAG,
        }
    ],
    "obstacle": [{"kind": "half_space", "name": "floor", "point": [0, 0], "normal": [0, 1]}],
    "contact": [{"between": ["ball", "floor"], "restitution": 0.75}],
    "parameter": [{"name": "c", "start": 0.0015, "bounds": [1e-5, 0.02]}],
}  # fmt: skip
truth = impactfem.solve(impactfem.Scene.from_dict(TABLE), estimate=False)
times = np.arange(0.02, 2.5, 0.02)
seen = np.interp(times, truth.history["time"], truth.history["ball.y"])
seen += np.random.default_rng(1).normal(0.0, 0.02, times.shape)
data = Path(mkdtemp()) / "heights.csv"
np.savetxt(data, np.column_stack([times, seen]), delimiter=",")

# %% [markdown]
# The scene for the search: both numbers are parameters, begun elsewhere.

# %%
TABLE["parameter"] = [
    {"name": "c", "start": 0.0005, "bounds": [1e-5, 0.02]},
    {"name": "e", "key": "contact.0.restitution", "start": 0.6, "bounds": [0.1, 1.0]},
]
TABLE["measure"] = [
    {"name": "heights", "of": "ball.y", "data": str(data), "sigma": 0.02, "unit": "m"}
]
scene = impactfem.Scene.from_dict(TABLE)
scene

# %%
found = impactfem.identify(scene)
for name, estimate in found.parameters.items():
    low, high = estimate.interval95
    print(f"{name} = {estimate.value:.5f}, with 95 % within {low:.5f} to {high:.5f}")
print("trusted:", found.trusted, *found.doubts, *found.notes, sep="\n  ")

# %% [markdown]
# The motion with the answer, its error, and the heights that were seen.

# %%
result = impactfem.solve(found.scene)
result

# %%
print(result.summary["error"])

# %%
result.plot_history("ball.y", "ball.vy")

# %%
figure = Figure(figsize=(8.0, 3.5), layout="constrained")
axes = figure.subplots()
axes.plot(times, seen, ".", markersize=3, label="seen")
axes.plot(result.history["time"], result.history["ball.y"], label="found")
axes.set(xlabel="time [s]", ylabel="height [m]")
axes.legend(frameon=False)
figure

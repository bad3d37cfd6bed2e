# %% [markdown]
# # A bar against a wall
#
# The founding benchmark: a bar flies against a wall, touches it for $2L/c$ with the force
# $\rho c v A$, and leaves as fast as it came. Here with the impact between two time levels.

# %%
import impactfem
from impactfem import Bar, Scene, Wall

bar = Bar(length=1.0, density=1.0, youngs_modulus=1.0, gap=0.514142, velocity=-0.5)
scene = Scene(title="Bar against a wall", duration=5.0, bodies=[bar], obstacles=[Wall()])
scene

# %% [markdown]
# What would be done, and why. Nothing is solved yet.

# %%
impactfem.plan(scene)

# %%
result = impactfem.solve(scene, method="galerkin", elements=40)
result

# %%
result.plot_history("gap", "contact_force")

# %% [markdown]
# The error is measured against the exact solution, along characteristics.

# %%
for elements in (20, 40, 80, 160):
    error = impactfem.solve(scene, method="galerkin", elements=elements).summary["error"]
    print(elements, f"displacement {error['displacement_max']:.1e}, force {error['force_l1']:.1e}")

# %% [markdown]
# Speed against error of three methods. `figure()` of the study draws it.

# %%
study = impactfem.studies.work_precision(
    scene, ["galerkin", "conserving", "exact@elements=10"], [20, 40, 80], repeats=1
)
study

# %%
study.figure()

# %% [markdown]
# The motion, with a slider.

# %%
result.animate(frames=20)

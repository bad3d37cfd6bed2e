# %% [markdown]
# # A disc is dropped
#
# A rubber disc falls on a floor from 1 cm: a solid in plane strain, its force, its error, its film.

# %%
import impactfem
from impactfem import HalfSpace, Scene, Solid
from impactfem.shapes import Disc

disc = Solid(
    name="disc",
    model="plane_strain",
    shape=Disc(radius=0.05, center=(0.0, 0.052)),
    mesh_size=0.004,
    density=1100.0,
    youngs_modulus=1.5e6,
    poisson_ratio=0.4,
    rayleigh_stiffness=1e-4,
    velocity=(0.0, -0.4),
)
floor = HalfSpace(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0))
scene = Scene(
    title="Rubber disc on a floor", duration=0.02, gravity=(0.0, -9.81), bodies=[disc],
    obstacles=[floor],
)  # fmt: skip
impactfem.plan(scene)

# %%
result = impactfem.solve(scene)
result

# %%
result.plot_history("contact_force", "disc.vy", "total_energy")

# %% [markdown]
# The error is estimated by runs on elements twice and four times as large, and the verdict judges
# the run by it.

# %%
print({name: value for name, value in result.summary["error"].items() if name != "reference"})
print(result.summary["verdict"]["level"])

# %%
result.figure("body")

# %% [markdown]
# What the floor gives back: the speed after over the speed before.

# %%
speed = result.history["disc.vy"]
print(f"restitution {-float(speed[-1]) / float(speed.min()):.2f}")

# %%
result.animate(frames=20)

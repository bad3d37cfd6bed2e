# %% [markdown]
# # A plate switch closes
#
# A voltage pulls a clamped disc of polysilicon onto a dielectric 0.9 µm below it. The pull grows as
# the gap closes: `gap` in the formula of the pressure.

# %%
import impactfem

PULL = "-8.854e-12*{voltage}**2/2/(0.2e-6+gap)**2"
scene = impactfem.Scene.from_dict(
    {
        "title": "Plate switch",
        "duration": 0.8e-6,
        "gravity": [0.0, 0.0, 0.0],
        "body": [
            {
                "kind": "plate", "name": "switch",
                "outline": {"kind": "disc", "radius": 100e-6}, "mesh_size": 14e-6,
                "thickness": 3e-6, "density": 2330.0, "youngs_modulus": 160e9,
                "poisson_ratio": 0.22, "rayleigh_mass": 8e5,
                "supports": [{"edge": "rim", "kind": "clamped"}],
                "pressures": [{"face": "bottom", "value": PULL.format(voltage=130)}],
            }
        ],
        "obstacle": [
            {
                "kind": "half_space", "name": "dielectric", "point": [0.0, 0.0, -2.4e-6],
                "normal": [0.0, 0.0, 1.0],
            }
        ],
        "probe": [{"name": "middle", "body": "switch", "point": [0.0, 0.0, 0.0]}],
        "solve": {"dt": 2e-9},
    }
)  # fmt: skip
impactfem.plan(scene)

# %%
result = impactfem.solve(scene)
result

# %%
result.plot_history("gap", "middle.vz", "contact_force")

# %% [markdown]
# The verdict is *care*, and says why: closing time and impulse are good, the peaks of the force
# belong to the mesh. A smaller `mesh_size` helps.

# %%
print({name: value for name, value in result.summary["error"].items() if name != "reference"})
for finding in result.summary["verdict"]["findings"]:
    print(finding["text"], "->", finding["remedy"])

# %% [markdown]
# A higher voltage closes it earlier.

# %%
for voltage in (120, 130, 150):
    pull = [{"face": "bottom", "value": PULL.format(voltage=voltage)}]
    run = impactfem.solve(scene.with_settings({"body.switch.pressures": pull}), estimate=False)
    start, _ = run.summary["contact"]["intervals"][0]
    print(f"{voltage} V: closes after {1e9 * start:.0f} ns")

# %%
result.figure("body")

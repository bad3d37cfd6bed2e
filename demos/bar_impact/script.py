"""Throw a bar against a wall, on three grids."""

import impactfem
from impactfem import Bar, Scene, Wall

bar = Bar(length=1.0, density=1.0, youngs_modulus=1.0, gap=0.5, velocity=-0.5)
scene = Scene(title="Bar against a wall", duration=5.0, bodies=[bar], obstacles=[Wall()])
for elements in (10, 20, 40):
    result = impactfem.solve(scene, elements=elements)
    print(elements, result.summary["contact"]["intervals"], result.summary["error"])
print(float(result.history["contact_force"].sel(time=2.0, method="nearest")), "N")
result.save("results/script")

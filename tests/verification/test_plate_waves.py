"""Waves along plates, and a thick plate against a solid model of itself."""

import math

import gmsh
import numpy as np
import pytest

import impactfem
from impactfem import Scene

LENGTH, WIDTH = 3.0, 0.05


def frequency(theory, thickness, k):
    """Of a plane wave with D = rho t = 1, nu = 0 [rad/s]: k^2, or by Mindlin's two equations."""
    if theory == "kirchhoff":
        return k * k
    shear, inertia = 5.0 / 6.0 * 6.0 / thickness**2, thickness**2 / 12.0
    # (S k^2 - w^2) (k^2 + S - J w^2) = S^2 k^2
    half = 0.5 * (k * k + shear + inertia * shear * k * k)
    whole = inertia * shear * k**4
    return math.sqrt((half - math.sqrt(half**2 - whole)) / inertia)


@pytest.mark.parametrize(
    ("theory", "thickness", "wave", "size", "within"),
    [("kirchhoff", 0.004, 0.2, 0.0125, 6e-3), ("reissner_mindlin", 0.01, 0.125, 0.0075, 8e-3)],
)
def test_a_group_of_bending_waves_goes_with_its_speed(theory, thickness, wave, size, within):
    """The middle of the square of a packet; its first velocity is that of waves to one side.

    With shear and rotary inertia it is 6.5 % slower there than without.
    """
    k, h = 2.0 * math.pi / wave, 1e-2
    low, own, high = (frequency(theory, thickness, k + d) for d in (-h, 0.0, h))
    speed, bend = (high - low) / (2.0 * h), (high - 2.0 * own + low) / h**2
    assert speed / (2.0 * k) == pytest.approx(1.0 if theory == "kirchhoff" else 0.935, abs=1e-3)
    x, around = f"(x+{0.5 * LENGTH - 0.6})", 0.15
    packet = f"1e-4*exp(-({x}/{around})**2/2)"
    velocity = f"({own}-{0.5 * bend}*({x}**2/{around**4}-{around**-2}))*sin({k}*{x})"
    velocity += f"+{speed / around**2}*{x}*cos({k}*{x})"
    modulus = 12.0 / thickness**3
    scene = Scene.from_dict(
        {"title": "packet", "duration": 1.5 / speed, "gravity": [0.0, 0.0, 0.0],
         "body": [{"kind": "plate", "thickness": thickness, "density": 1.0 / thickness,
                   "outline": {"kind": "rectangle", "size": [LENGTH, WIDTH]}, "mesh_size": size,
                   "youngs_modulus": modulus, "poisson_ratio": 0.0, "theory": theory,
                   "displacement": f"{packet}*cos({k}*{x})",
                   "velocity": f"{packet}*({velocity})"}],
         "solve": {"dt": 0.02 / own, "estimate": False},
         "output": {"fields": ["vtkhdf"], "every": 10**6}}
    )  # fmt: skip
    fields = impactfem.solve(scene).fields
    points, cells = fields.layout.points, fields.layout.connectivity.reshape(-1, 3)
    sides = points[cells[:, 1:]] - points[cells[:, :1]]
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    shares = np.bincount(cells.ravel(), np.repeat(areas, 3))

    def middle(place):
        w = fields.read(place, "displacement")["displacement"][:, 2]
        return (shares * w**2) @ points[:, 0] / (shares @ w**2)

    last = len(fields.times) - 1
    found = (middle(last) - middle(0)) / (fields.times[last] - fields.times[0])
    assert found == pytest.approx(speed, rel=within)


LONG, BROAD, THICK = 0.1, 0.05, 0.01
ALLOY = {"density": 2700.0, "youngs_modulus": 7e10, "poisson_ratio": 0.0}


def strip(path, along, across):
    """A mesh file of triangles in rows: where the stop touches, vertices lie in a line."""
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        geo = gmsh.model.geo
        x, y = 0.5 * LONG, 0.5 * BROAD
        corners = [geo.addPoint(a, b, 0.0) for a, b in ((-x, -y), (x, -y), (x, y), (-x, y))]
        sides = [geo.addLine(corners[k], corners[(k + 1) % 4]) for k in range(4)]
        for side, count in zip(sides, 2 * (along, across), strict=True):
            geo.mesh.setTransfiniteCurve(side, count + 1)
        face = geo.addPlaneSurface([geo.addCurveLoop(sides)])
        geo.mesh.setTransfiniteSurface(face, "AlternateLeft")
        geo.synchronize()
        gmsh.model.addPhysicalGroup(2, [face], name="strip")
        gmsh.model.mesh.generate(2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def struck(body, stop, dim, dt):
    """Impulses of the first 20 us, of the first contact and of all [N s]."""
    scene = Scene.from_dict(
        {"title": "strip", "duration": 3e-4, "gravity": [0.0] * dim,
         "body": [body], "obstacle": [{"name": "stop", "radius": 1.0} | stop],
         "solve": {"dt": dt, "estimate": False, "method": "conserving"}, "output": {"fields": []}}
    )  # fmt: skip
    history = impactfem.solve(scene).history
    time, force = history["time"].values, history["contact_force"].values
    return np.interp([2e-5, 8e-5, 3e-4], time, dt * np.cumsum(force))


def test_a_thick_plate_strikes_as_a_solid_model_of_itself(tmp_path):
    """A free strip of t/L = 0.1 thrown flat at a round stop across its middle, which it hits twice.

    Without Poisson's ratio it moves in a plane, where the solid is cheap and exact enough: halved
    elements change its impulses by 0.4 %.
    """
    low, mesh = -0.5 * THICK - 1e-6, tmp_path / "strip.msh"
    solid = {
        "kind": "solid", "name": "strip", "model": "plane_stress", "thickness": BROAD,
        "shape": {"kind": "block", "size": [LONG, THICK], "corner": [-0.5 * LONG, -0.5 * THICK]},
        "mesh_size": 0.00125, "velocity": [0.0, -1.0], "strain": "small", "degree": 2,
        "contact_surfaces": ["bottom"],
    } | ALLOY  # fmt: skip
    exact = struck(solid, {"kind": "sphere", "center": [0.0, low - 1.0]}, 2, 2e-7)
    strip(mesh, 160, 6)
    plate = {"kind": "plate", "name": "strip", "mesh": str(mesh), "thickness": THICK,
             "theory": "reissner_mindlin", "velocity": -1.0} | ALLOY  # fmt: skip
    round_ = {"kind": "cylinder", "center": [0.0, 0.0, low - 1.0], "axis": [0.0, 1.0, 0.0]}
    found = struck(plate, round_, 3, 2.5e-7)
    assert found == pytest.approx(exact, rel=0.03)
    mass = ALLOY["density"] * LONG * BROAD * THICK
    assert found[2] / mass - 1.0 == pytest.approx(exact[2] / mass - 1.0, rel=0.03)

"""Parts of the discontinuous Galerkin method: sweeps, contact, slices, lines, events."""

import numpy as np
import pytest

import impactfem
from impactfem.errors import MeshError, SceneError
from impactfem.exact import ExactBar
from impactfem.fem import MPI, dolfinx_fem
from impactfem.mesh.fitted import Front, distinct, fitted_lines
from impactfem.mesh.unstructured import Triangulation, triangulate
from impactfem.scene import Bar, Formula, PiecewiseConstant
from impactfem.spacetime import sweep
from impactfem.spacetime.adaptive import indicators, refined
from impactfem.spacetime.discontinuous import DiscontinuousSettings, solve_discontinuous
from impactfem.spacetime.events import wall_events
from impactfem.spacetime.fitting import kinks
from impactfem.spacetime.reflections import BarWaves
from impactfem.spacetime.slices import slice_states
from impactfem.spacetime.waves import Field

STILL = PiecewiseConstant()
UNIT = {"length": 1.0, "density": 1.0, "youngs_modulus": 1.0}


def random_mesh(seed, duration=3.0, number=120):
    """Delaunay triangles of random points, slivers included."""
    from scipy.spatial import Delaunay

    random = np.random.default_rng(seed)
    along = np.sort(random.uniform(0, duration, 24))
    across = np.sort(random.uniform(0, 1, 8))
    sides = [np.stack([along, np.full(24, x)], 1) for x in (0.0, 1.0)]
    ends = [np.stack([np.full(8, t), across], 1) for t in (0.0, duration)]
    corners = np.array([[0, 0], [duration, 0], [0, 1], [duration, 1.0]])
    inside = random.uniform((0, 0), (duration, 1), (number, 2))
    points = np.concatenate([corners, *sides, *ends, inside])
    cells = Delaunay(points).simplices
    a = points[cells]
    area = np.abs(np.linalg.det(a[:, 1:] - a[:, :1]))
    return Triangulation(points, cells[area > 1e-14].astype(np.int64))


def mumps(problem, active, gap):
    """Both waves, coupled at the ends for given contact states, in one system for MUMPS.

    Written down from the equations, without the sweeps: unknowns are the coefficients of r and q
    and the gap at the end of each wall edge.
    """
    from petsc4py import PETSc
    from scipy.sparse import bmat, coo_matrix

    from impactfem import fem
    from impactfem.forms.discontinuous import advection_form

    field, wall, far = problem.field, problem.wall, problem.far
    numbering = field.space.dofmap.list
    loads, matrices = [], []
    for wave, speed in ((problem.arriving, -1.0), (problem.leaving, 1.0)):
        constant = dolfinx_fem.Constant(field.mesh, speed)
        form = fem.compile_form(advection_form(field.space, constant))
        matrices.append(dolfinx_fem.assemble_matrix(form).to_scipy())
        load = np.zeros(numbering.size)
        load[numbering] = np.linalg.solve(wave.inverse, wave.base[..., None])[..., 0]
        loads.append(load)

    def mass(edges, factor):
        rows, columns, values = [], [], []
        for k, cell in enumerate(edges.cells):
            block = factor[k] * np.einsum(
                "p,pi,pj->ij", edges.weights[k], edges.basis[k], edges.basis[k]
            )
            rows.append(np.repeat(numbering[cell], field.dofs))
            columns.append(np.tile(numbering[cell], field.dofs))
            values.append(block.ravel())
        at = (np.concatenate(rows), np.concatenate(columns))
        return coo_matrix((np.concatenate(values), at), shape=(numbering.size,) * 2)

    edges = len(active)
    onto = mass(wall, np.where(active, -1.0, 1.0))
    back = mass(far, np.full(len(far.cells), problem.reflection))
    closing = np.zeros((numbering.size, edges))  # of q: 2 V* = -2 u_{k-1} / h on active edges
    gaps = np.zeros((edges, numbering.size))
    chain = np.eye(edges)
    right = np.zeros(edges)
    for k, cell in enumerate(wall.cells):
        if active[k]:
            if k:
                closing[numbering[cell], k - 1] += (
                    2 / wall.widths[k] * (wall.weights[k] @ wall.basis[k])
                )
        else:
            gaps[k, numbering[cell]] -= wall.weights[k] @ wall.basis[k]
            if k:
                chain[k, k - 1] = -1.0
            else:
                right[0] = gap
    system = bmat(
        [[matrices[0], -back, None], [-onto, matrices[1], closing], [gaps, None, chain]]
    ).tocsr()
    load = np.concatenate([*loads, right])
    matrix = PETSc.Mat().createAIJ(
        system.shape, csr=(system.indptr, system.indices, system.data), comm=MPI.COMM_SELF
    )
    ksp = PETSc.KSP().create(MPI.COMM_SELF)
    ksp.setOperators(matrix)
    ksp.setType("preonly")
    ksp.getPC().setType("lu")
    ksp.getPC().setFactorSolverType("mumps")
    b, x = matrix.createVecLeft(), matrix.createVecRight()
    b.array[:] = load
    ksp.solve(b, x)
    size = numbering.size
    return x.array[:size][numbering], x.array[size : 2 * size][numbering], x.array[2 * size :]


@pytest.mark.parametrize("far_end", ["free", "clamped"])
@pytest.mark.parametrize("degree", [0, 1, 2])
def test_sweeps_solve_the_coupled_system_that_mumps_solves(degree, far_end):
    bar = Bar(
        gap=0.3, velocity="-0.5 - 0.2*x", displacement="0.1*sin(2*x)", far_end=far_end, **UNIT
    )
    gravity = PiecewiseConstant((0.0, 1.1), (0.3, -0.1))
    problem = BarWaves.of_bar(random_mesh(3), degree, bar, gravity)
    assert problem.decide(1e-13).active.any()
    r, q, gaps = mumps(problem, problem.active, problem.gap)
    assert np.abs(r - problem.arriving.values).max() <= 1e-10
    assert np.abs(q - problem.leaving.values).max() <= 1e-10
    assert np.abs(gaps - problem.gaps).max() <= 1e-10


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("degree", [0, 1, 2])
def test_random_triangles_never_make_energy_nor_pull_nor_penetrate(seed, degree):
    bar = Bar(gap=0.2, velocity="-0.4 + 0.1*cos(5*x)", displacement="0.05*x*(1 - x)", **UNIT)
    motion, _ = motion_on(random_mesh(seed), bar, degree)
    energy = motion.kinetic + motion.elastic
    assert energy[-1] <= energy[0] * (1 + 1e-9)  # at the borders of the mesh it cannot grow
    assert energy.max() <= energy[0] * 1.08  # slices through these large cells scatter
    assert motion.gap.min() >= -1e-9
    assert motion.multiplier.max() <= 1e-12
    assert motion.multiplier.min() < -0.1


def motion_on(mesh, bar, degree, gravity=STILL):
    from impactfem.result.bar_motion import Effort
    from impactfem.spacetime.motion import motion_of_waves

    problem = BarWaves.of_bar(mesh, degree, bar, gravity)
    problem.decide(1e-10 * problem.scale)
    return motion_of_waves(problem, Effort(), bar, gravity, 16, 1), problem


def test_contact_decision_is_the_solution_of_the_complementarity_conditions():
    random = np.random.default_rng(0)
    for _ in range(200):
        arriving, widths = random.normal(-0.1, 1, 30), random.uniform(0.1, 2, 30)
        gaps, speeds, active = np.empty(30), np.empty(30), np.empty(30, dtype=bool)
        start = random.uniform(0, 2)
        marks = np.full(30, sweep.DECIDE, dtype=np.int8)
        sweep.contact(arriving, widths, start, marks, 0.0, gaps, speeds, active)
        before = np.concatenate([[start], gaps[:-1]])
        mean = np.where(active, arriving / widths - speeds, 0.0)
        assert gaps.min() >= 0
        assert mean.max() <= 0
        assert np.all(gaps * mean == 0)
        travel = np.where(active, speeds * widths, arriving)
        assert before + travel == pytest.approx(gaps, abs=1e-12)


def test_slices_are_exact_for_polynomials():
    mesh = random_mesh(5)
    field = Field(mesh, 2)
    points = np.stack(  # values at corners and edge middles are the coefficients
        [*(field.corners[:, k] for k in range(3))]
        + [0.5 * (field.corners[:, a] + field.corners[:, b]) for a, b in ((1, 2), (0, 2), (0, 1))],
        axis=1,
    )
    t, x = points[:, :, 0], points[:, :, 1]
    v, s = 1 + t - 2 * x * t + x**2, 3 * x**2 + 2 * x - t
    times, places = np.array([0.4, 1.0, 2.9, 3.0]), np.linspace(0, 1, 7)
    states = slice_states(field, v + s, v - s, times, np.arange(4), places)
    tt, xx = times[:, None], places[None, :]
    assert states.stretch == pytest.approx(xx**3 + xx**2 - tt * xx, abs=1e-12)
    assert states.velocity == pytest.approx(1 + tt - 2 * xx * tt + xx**2, abs=1e-11)
    assert states.mean_velocity == pytest.approx(1 + 1 / 3 + 0 * times, abs=1e-12)
    assert states.mean_stretch == pytest.approx(1 / 4 + 1 / 3 - times / 2, abs=1e-12)


def test_slices_along_edges_count_every_triangle_once():
    x, t = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5))
    points = np.stack([t.ravel(), x.ravel()], 1)
    k = (np.arange(4)[:, None] * 5 + np.arange(4)).ravel()
    cells = np.concatenate([np.stack([k, k + 1, k + 6], 1), np.stack([k, k + 6, k + 5], 1)])
    field = Field(Triangulation(points, cells), 0)
    one = np.ones((32, 1))
    times = np.linspace(0, 1, 9)[1:]
    states = slice_states(field, 2 * one, 0 * one, times, np.arange(8), np.array([0.0, 0.3, 1.0]))
    assert states.stretch == pytest.approx(np.tile([0.0, 0.3, 1.0], (8, 1)), abs=1e-14)
    assert states.kinetic == pytest.approx(0.5, abs=1e-14)


def test_fronts_run_to_and_fro_and_equal_ones_are_merged():
    fronts = [Front(1.0, 0.0), Front(3.0, 0.0), Front(2.0, 1.0, -1), Front(0.0, 0.25, -1)]
    assert distinct(fronts) == [fronts[3], fronts[0]]
    lines = fitted_lines([Front(0.5, 0.0)], np.array([1.0]), 3.0)
    corners = {(0.5, 0.0), (1.5, 1.0), (2.5, 0.0), (3.0, 0.5), (1.0, 0.0), (1.0, 0.5), (1.0, 1.0)}
    assert {tuple(point) for point in lines.points.round(12)} == corners
    with pytest.raises(MeshError, match="too many"):
        fitted_lines([Front(0.1 * k, 0.0) for k in range(20)], np.empty(0), 1000.0)


@pytest.mark.parametrize("apart", [1e-2, 1e-5, 1e-8])
def test_close_lines_do_not_fill_the_mesh(apart):
    lines = fitted_lines([Front(0.35, 0.0), Front(0.35 + apart, 0.0)], np.empty(0), 5.0)
    mesh = triangulate(MPI.COMM_SELF, 5.0, 0.125, lines)
    assert len(mesh.cells) < 2000


def test_lines_are_edges_of_the_mesh():
    lines = fitted_lines([Front(0.3, 0.0), Front(0.75, 1.0, -1)], np.array([1.2]), 3.0)
    mesh = triangulate(MPI.COMM_SELF, 3.0, 0.1, lines)
    corner = mesh.points[mesh.cells]
    for t0, x0, direction in ((0.3, 0.0, 1), (0.75, 1.0, -1)):
        beside = (corner[:, :, 0] - t0) - direction * (corner[:, :, 1] - x0)
        early = corner[:, :, 0].max(axis=1) <= t0 + 1.0
        assert not np.any((beside.min(axis=1) < -1e-14) & (beside.max(axis=1) > 1e-14) & early)


def test_kinks_of_formulas_are_found():
    formula = Formula("abs(x - 0.6) + where(0.5 <= x < 1.5, 1, 0)*max(x, 1.25) + sin(x)")
    assert kinks(formula, 2.0) == pytest.approx([0.25, 0.3, 0.625, 0.75], abs=1e-15)
    assert len(kinks(Formula("sin(3*x)"), 1.0)) == 0


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_first_impact_is_located_on_a_mesh_that_does_not_know_it(degree):
    bar = Bar(gap=0.5123, velocity=-0.5, **UNIT)
    problem = BarWaves.of_bar(triangulate(MPI.COMM_SELF, 2.0, 0.2), degree, bar, STILL)
    problem.decide(1e-12)
    assert wall_events(problem, np.empty(0))[0].time == pytest.approx(1.0246, abs=1e-12)


def test_indicators_are_the_energy_that_is_lost_inside():
    bar = Bar(gap=5.0, displacement="where(x < 0.4, 0.3*x, 0.12)", **UNIT)
    mesh = triangulate(MPI.COMM_SELF, 2.0, 0.1)
    motion, problem = motion_on(mesh, bar, 1)
    lost = motion.kinetic[0] + motion.elastic[0] - motion.kinetic[-1] - motion.elastic[-1]
    found = indicators(problem).sum()
    assert 0.8 * lost <= found <= 1.001 * lost  # the rest: the kinked start, the reflections
    finer = refined(problem)
    corner = finer.points[finer.cells]
    area = np.abs(np.linalg.det(corner[:, 1:] - corner[:, :1])).sum() / 2
    assert area == pytest.approx(2.0)
    assert len(mesh.cells) < len(finer.cells) < 4 * len(mesh.cells)


def test_user_mesh_of_triangles_is_accepted(tmp_path):
    from impactfem.mesh.files import read_mesh

    path = tmp_path / "mesh.geo"
    path.write_text(
        "Point(1) = {0, 0, 0, .1}; Point(2) = {6, 0, 0, .03}; Point(3) = {6, 2, 0, .1};"
        "Point(4) = {0, 2, 0, .1}; Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4};"
        "Line(4) = {4, 1}; Transfinite Curve {2, 4} = 17; Curve Loop(1) = {1, 2, 3, 4};"
        'Plane Surface(1) = {1}; Physical Surface("bar") = {1}; Physical Curve("wall") = {1};'
        'Physical Curve("end") = {2}; Physical Curve("far") = {3}; Physical Curve("start") = {4};'
    )
    bar = Bar(length=2.0, density=1.0, youngs_modulus=4.0, gap=0.5, velocity=-0.5)
    space = read_mesh(MPI.COMM_SELF, path, 2.0, 6.0, 2.0)
    settings = DiscontinuousSettings(mesh=space, elements=8)
    motion, _ = solve_discontinuous(MPI.COMM_SELF, bar, STILL, 6.0, settings)
    exact = ExactBar(
        length=2.0, wave_speed=2.0, duration=6.0, nodes=[0, 2], displacement=[0.5, 0.5],
        velocity=[-0.5, -0.5],
    )  # fmt: skip
    assert np.abs(motion.gap - exact.gap(motion.times)).max() < 0.1


@pytest.mark.parametrize(
    "wrong", [{"degree": 3}, {"window": 5}, {"accuracy": 0.0}, {"fitted": True, "mesh": object()}]
)
def test_contradicting_settings_are_refused(wrong):
    bar = Bar(gap=0.5, velocity=-0.5, **UNIT)
    with pytest.raises(SceneError, match=r"solve\."):
        solve_discontinuous(MPI.COMM_SELF, bar, STILL, 1.0, DiscontinuousSettings(**wrong))


def test_a_mesh_too_large_is_refused_before_it_is_made():
    with pytest.raises(MeshError, match="too large"):
        triangulate(MPI.COMM_SELF, 1e6, 0.01)


@pytest.mark.parametrize("scale", [1e-9, 1e3])
def test_units_do_not_matter(scale):
    answers = []
    for unit in (1.0, scale):
        bar = impactfem.Bar(
            length=unit,
            density=2700.0,
            youngs_modulus=2700.0 * unit**2,
            gap=0.4 * unit,
            velocity=-0.5 * unit,
        )
        settings = DiscontinuousSettings(elements=8, fitted=True)
        motion, figures = solve_discontinuous(
            MPI.COMM_SELF, bar, PiecewiseConstant((0.0,), (0.1 * unit,)), 4.0, settings
        )
        answers.append((motion.displacement / unit, [e["time"] for e in figures["events"]]))
    assert answers[0][0] == pytest.approx(answers[1][0], abs=1e-10)
    assert answers[0][1] == pytest.approx(answers[1][1], abs=1e-10)

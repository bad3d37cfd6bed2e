"""Beams of finite strain: elastica, roll-up, what steps keep, the linear beam at small loads."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from impactfem import Beam, Contact, HalfSpace, Joint, Output, Probe, Scene, Solve, solve
from impactfem.errors import SceneError
from impactfem.system.flexible_beam import flexible_beam

THIN = {"length": 1.0, "height": 0.005, "width": 0.01, "density": 1000.0, "youngs_modulus": 1e9}
EI = 1e9 * 0.01 * 0.005**3 / 12.0
CLAMPED = {"end": "first", "kind": "clamped"}


def run(beam, duration, dt, gravity=None, **others):
    point = (np.asarray(beam.center) + 0.5 * beam.length * beam.along).tolist()
    scene = Scene(
        title="beam", duration=duration, gravity=gravity or [0.0] * beam.dim, bodies=[beam],
        solve=Solve(dt=dt, estimate=False), output=Output(fields=[]),
        probes=[Probe(name="tip", body="beam", point=point)], **others,
    )  # fmt: skip
    return solve(scene)


def tip_at_rest(elements, **load):
    center = [0.5, 0.0, 0.0][: 3 if len(load.get("force", "xy")) == 3 else 2]
    beam = Beam(
        **THIN, elements=elements, center=center, supports=[CLAMPED], strain="finite",
        end_loads=[{"end": "last", **load}],
    )  # fmt: skip
    found = run(beam, 1e-3, 1e-3, start="static").history
    return np.array([found[f"tip.u{axis}"].values[0] for axis in "xy"])


def elastica(alpha):
    """Tip of an inextensible cantilever of unit length under P = alpha E I across it."""

    def missed(k):
        return ellipk(k * k) - ellipkinc(np.arcsin(np.sqrt(0.5) / k), k * k) - np.sqrt(alpha)

    k = brentq(missed, np.sqrt(0.5) + 1e-12, 1.0 - 1e-12)
    own = ellipe(k * k) - ellipeinc(np.arcsin(np.sqrt(0.5) / k), k * k)
    root = np.sqrt(alpha)
    return np.array(
        [np.sqrt(2.0) / root * np.sqrt(2.0 * k * k - 1.0) - 1.0, 1.0 - 2.0 / root * own]
    )


def test_cantilever_bends_as_the_elastica_with_fourth_order():
    known = elastica(4.0)
    off = [np.linalg.norm(tip_at_rest(n, force=["0", repr(4.0 * EI)]) - known) for n in (3, 6)]
    # The elastica does not stretch: P / E A = 4 h^2 / 12 L^2 = 8e-6, a tenth of the second error.
    assert off[0] < 3e-3
    assert off[0] / off[1] > 10.0


def test_end_moment_rolls_a_beam_up_to_a_circle():
    moved = tip_at_rest(12, moment=[repr(2.0 * np.pi * EI)])
    assert moved == pytest.approx([-1.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("dim", [2, 3])
def test_free_beam_keeps_energy_and_momenta_over_many_revolutions(dim):
    spin = 12.0 if dim == 2 else [4.0, 12.0, -5.0]
    beam = Beam(
        **THIN | {"youngs_modulus": 1e7}, elements=6, center=[0.0] * dim, strain="finite",
        velocity=[1.0, 0.5, -0.2][:dim], angular_velocity=spin,
    )  # fmt: skip
    result = run(beam, 12.0 if dim == 2 else 1.0, 2e-2 if dim == 2 else 5e-3)
    found = result.history
    for name in ("total_energy", *(n for n in found if "momentum" in n)):
        values = found[name].values
        assert np.ptp(values) <= 1e-11 * max(1.0, np.abs(values).max()), name
    assert found["elastic_energy"].values.max() > 1e-4 * found["total_energy"].values[0]
    assert "model_rotation" not in {f["code"] for f in result.summary["verdict"]["findings"]}
    if dim == 2:  # turns by 2 atan(dt w / 2) in a step
        turned = found["beam.angle"].values[-1]
        assert turned == pytest.approx(1200 * np.arctan(0.12), rel=1e-2)


def test_forces_are_derivatives_of_the_energy_and_their_tangent_is_theirs():
    beam = flexible_beam(
        Beam(**THIN, elements=3, center=[0.0] * 3, axis=[1.0, 2.0, 2.0], theory="timoshenko",
             supports=[{"end": "last", "kind": "elastic", "rotational_stiffness": 2.0}])
    )  # fmt: skip
    rng = np.random.default_rng(1)
    moved, way = rng.normal(size=(2, 4, 3)) * 0.02
    turned, around = beam.turns.copy(), rng.normal(size=(4, 3)) * 0.2
    from scipy.spatial.transform import Rotation

    def at(share):
        turns = Rotation.from_rotvec(share * around).as_matrix() @ bent
        return moved + share * way, np.ascontiguousarray(turns)

    bent = Rotation.from_rotvec(rng.normal(size=(4, 3)) * 0.3).as_matrix() @ turned
    step, change = 1e-5, np.hstack([way, around])
    energies = [beam.looked(at(share))[2] for share in (-step, step)]
    force, stiffness = beam.standing(at(0.0))
    slope = (energies[1] - energies[0]) / (2.0 * step)
    assert (force * change).sum() == pytest.approx(slope, rel=1e-7)
    forces = [beam.standing(at(share))[0] for share in (-step, step)]
    known = (forces[1] - forces[0]) / (2.0 * step)
    found = np.einsum("nimj,mj->ni", stiffness, change)
    assert np.abs(found - known).max() < 1e-7 * np.abs(known).max()
    stresses = [beam.foreseen(at(share), 0.0 * change) for share in (-step, step)]
    ahead = beam.foreseen(at(0.0), change) - beam.foreseen(at(0.0), 0.0 * change)
    assert (
        np.abs(ahead - (stresses[1] - stresses[0]) / (2.0 * step)).max()
        < 1e-6 * np.abs(ahead).max()
    )


@pytest.mark.parametrize(
    "held",
    [
        {"supports": [CLAMPED], "load": "-0.1*sin(20*t)", "quality_factor": 20.0},
        {"supports": [{"end": e, "kind": "simply_supported"} for e in ("first", "last")]},
        {"supports": [CLAMPED | {"motion": ["0", "1e-4*(1-cos(8*t))"]}]},
        {"supports": [CLAMPED], "end_loads": [{"end": "last", "force": ["0", "1e-3*sin(20*t)"]}]},
    ],
)
def test_small_motions_are_those_of_the_linear_beam(held):
    found = []
    for strain in ("small", "finite"):
        beam = Beam(**THIN, elements=8, center=[0.5, 0.0], strain=strain, **held)
        where = {"gravity": [0.0, -1e-2]} if "motion" not in held["supports"][0] else {}
        history = run(beam, 0.2, 2e-3, **where).history
        found.append(history["beam.y"].values)
    # Rotary inertia shifts phases by (k h)^2 / 24 = 2e-5 of them, masses at nodes by (k L / 8)^4.
    assert np.abs(found[1] - found[0]).max() < 2e-3 * np.ptp(found[0])


def test_joint_at_the_end_equals_a_support_and_supports_in_space_turn_far():
    beams = [
        Beam(**THIN, elements=4, center=[0.5, 0.0, 0.0], strain="finite", supports=supports)
        for supports in ([CLAMPED], [])
    ]
    hold = Joint(name="hold", kind="fixed", between=["ground", "beam"], point=[0.0, 0.0, 0.0])
    found = [
        run(beam, 0.2, 4e-3, [0.0, -3.0, -10.0], joints=joints).history["tip.uz"].values
        for beam, joints in zip(beams, ([], [hold]), strict=True)
    ]
    assert np.abs(found[0]).max() > 0.1
    assert np.abs(found[1] - found[0]).max() < 1e-8
    hinged = Beam(
        **THIN, elements=4, center=[0.5, 0.0, 0.0], strain="finite",
        supports=[{"end": "first", "kind": "simply_supported"}],
    )  # fmt: skip
    found = run(hinged, 0.5, 4e-3, [0.0, 0.0, -10.0]).history
    # A pendulum that falls by 90 degrees and on: energy goes round.
    assert found["tip.uz"].values.min() < -0.95
    assert np.ptp(found["total_energy"].values) < 1e-9


def test_beam_that_falls_flat_comes_to_rest_and_presses_by_its_weight():
    beam = Beam(**THIN, elements=4, center=[0.0, 2e-3], strain="finite", contact="along")
    found = run(
        beam, 0.04, 4e-4, [0.0, -10.0],
        obstacles=[HalfSpace(name="floor", point=[0.0, 0.0], normal=[0.0, 1.0])],
        contacts=[Contact(between=["beam", "floor"], friction_coefficient=0.3)],
    ).history  # fmt: skip
    lying = found["time"].values > 0.021
    assert found["contact_force"].values[lying] == pytest.approx(0.05 * 10.0, rel=1e-9)
    assert np.ptp(found["tip.uy"].values[lying]) < 1e-12


def test_a_beam_says_what_is_wrong_with_loads_on_its_ends():
    for wrong, words in (
        ({"end": "last"}, "force is missing"),
        ({"end": "last", "force": ["1"] * 3}, r"end_loads\[0\].force has 3 entries"),
        ({"end": "last", "moment": ["1"] * 3}, r"end_loads\[0\].moment has 3 entries"),
    ):
        with pytest.raises(SceneError, match=words):
            Beam(**THIN, center=[0.0, 0.0], end_loads=[wrong])

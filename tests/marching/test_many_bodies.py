"""Answers of bodies apart, kept sparse, are those of the full matrices; obstacles asked at once."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene
from impactfem.contact import ball_crowd, pair_responses
from impactfem.marching.time_loop import TimeLoop
from impactfem.models import solids
from impactfem.runs import contacts
from impactfem.system import few, rigid

BOX = [
    {"kind": "half_space", "name": name, "point": point, "normal": normal}
    for name, point, normal in (
        ("floor", [0.0, 0.0], [0.0, 1.0]), ("left", [0.0, 0.0], [1.0, 0.0]),
        ("right", [0.76, 0.0], [-1.0, 0.0]),
    )
]  # fmt: skip


PLACES = [[0.12 + 0.22 * (k % 3) + 0.01 * k, 0.101 + 0.23 * (k // 3)] for k in range(6)]


def grains(places=PLACES, **more):
    bodies = [
        {"kind": "rigid", "name": f"grain_{k}", "mass": 1.0 + k, "angular_velocity": 3.0 * k,
         "shape": {"kind": "disc", "radius": 0.1, "center": place}}
        for k, place in enumerate(places)
    ]  # fmt: skip
    data = {
        "title": "grains", "duration": 0.4, "gravity": [0.0, -9.81], "body": bodies,
        "obstacle": BOX, "contact": [{"between": ["*", "*"], "friction_coefficient": 0.4}],
        "solve": {"dt": 2e-3, "estimate": False}, "output": {"fields": []},
    }  # fmt: skip
    return Scene.from_dict(data | more)


def beside_a_solid():
    """Answers of the solid are found once and stay, those of grains that turn are asked anew."""
    plate = {
        "kind": "solid", "name": "plate", "model": "plane_strain", "mesh_size": 0.1, "degree": 1,
        "shape": {"kind": "block", "size": [0.7, 0.2], "corner": [0.03, 0.0]}, "density": 1e3,
        "youngs_modulus": 1e6, "poisson_ratio": 0.3,
        "supports": [{"surface": "bottom", "kind": "fixed"}],
    }  # fmt: skip
    whole = grains(PLACES[:3], duration=0.1).to_dict()
    for body in whole["body"]:
        body["shape"]["center"][1] += 0.2
        body["angular_velocity"] = 0.0
    return Scene.from_dict(whole | {"body": [plate, *whole["body"]], "obstacle": BOX[1:],
                                    "contact": [{"between": ["plate", "grain_*"]},
                                                {"between": ["grain_*", "*"],
                                                 "friction_coefficient": 0.4}]})  # fmt: skip


@pytest.mark.parametrize("made", [grains, beside_a_solid])
def test_sparse_answers_are_the_full_ones(made, monkeypatch):
    full = impactfem.solve(made()).history
    monkeypatch.setattr(pair_responses, "_MANY", 0)
    sparse = impactfem.solve(made()).history
    assert full["contact_force"].values.max() > 10.0
    # A grain wedged between floor and wall has forces that change no motion: these may differ.
    for name in (name for name in full.data_vars if name.startswith(("grain", "total", "plate"))):
        one, two = full[name].values, sparse[name].values
        size = np.nanmax(np.abs(one), initial=1.0)
        np.testing.assert_allclose(one, two, rtol=0.0, atol=1e-9 * size, err_msg=name)


def test_a_restart_with_sparse_answers_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr(pair_responses, "_MANY", 0)
    made = grains().with_settings({"output.checkpoint": 50})
    check_restart(made, 140, tmp_path, monkeypatch)


def crowd(**more):
    """More discs than have room around one: nodes are shared by those that are near."""
    places = [[0.12 + 0.22 * (k % 3) + 0.002 * k, 0.101 + 0.21 * (k // 3)] for k in range(15)]
    return grains(places, duration=0.15, **more)


def test_nodes_that_balls_share_do_as_their_own(monkeypatch):
    shared = impactfem.solve(crowd()).history
    room = []
    monkeypatch.setattr(rigid, "_room", lambda *_: room.append(1) or 1000)
    solids._model.cache_clear()
    own = impactfem.solve(crowd()).history
    solids._model.cache_clear()
    assert room
    assert (own["contact_force"].values > 10.0).mean() > 0.5
    for name in (name for name in own.data_vars if name.startswith(("grain", "total"))):
        one, two = own[name].values, shared[name].values
        size = np.nanmax(np.abs(one), initial=1.0)
        np.testing.assert_allclose(one, two, rtol=0.0, atol=1e-9 * size, err_msg=name)


def test_a_restart_with_shared_nodes_goes_on(tmp_path, monkeypatch):
    made = crowd().with_settings({"output.checkpoint": 25})
    check_restart(made, 70, tmp_path, monkeypatch)


@pytest.mark.parametrize("kind", ["rigid", "point"])
def test_pairs_of_balls_without_laws_are_arrays_and_those_found_one_by_one(kind, monkeypatch):
    """Half a million objects for a thousand balls would take longer than their run."""
    places = [[0.25 * (k % 6) + 0.11, 0.23 * (k // 6) + 0.11] for k in range(18)]
    scene = grains(places, contact=[]).to_dict()
    if kind == "point":
        each = [{"kind": kind, "name": f"p{k}", "mass": 1.0} for k in range(len(places))]
        scene["body"] = [
            b | {"position": p, "radius": 0.1} for b, p in zip(each, places, strict=True)
        ]
    scene["body"].insert(
        3,
        {
            "kind": "rigid",
            "name": "large",
            "mass": 1.0,
            "shape": {"kind": "block", "corner": [0.05, 2.0], "size": [0.4, 0.3]},
        },
    )
    scene = Scene.from_dict(scene)
    model = solids.solids_model(scene, (), updated=True)
    crowd, others = model.crowd, {met.label for met in model.ball_meetings}
    assert len(crowd) == 18 * 17 // 2
    assert others == {met.label for met in model.ball_meetings if "large" in met.names}
    monkeypatch.setattr(few.FewBodies, "singles", property(lambda _: {}))
    monkeypatch.setattr(rigid.Rigid, "singles", property(lambda _: {}))
    solids._model.cache_clear()
    slow = solids.solids_model(scene, (), updated=True).crowd
    assert slow.labels == crowd.labels == tuple(map(".".join, crowd.names))
    for name in ("pairs", "ends", "radii"):
        np.testing.assert_array_equal(getattr(slow, name), getattr(crowd, name))
    solids._model.cache_clear()


def test_points_that_a_joint_holds_do_not_meet_and_those_on_the_ground_do():
    each = [
        {"kind": "point", "name": f"p{k}", "mass": 1.0, "position": [0.3 * k, 0.0], "radius": 0.1}
        for k in range(4)
    ]
    joints = [
        {
            "kind": "distance",
            "name": "a",
            "between": ["p1", "p2"],
            "points": [[0.3, 0.0], [0.6, 0.0]],
        },
        {
            "kind": "distance",
            "name": "g",
            "between": ["p0", "ground"],
            "points": [[0.0, 0.0], [0.0, 1.0]],
        },
    ]
    table = {"title": "held", "duration": 0.1, "body": each, "joint": joints, "obstacle": BOX[:1]}
    crowd = solids.solids_model(Scene.from_dict(table), (), updated=True).crowd
    assert set(crowd.names) == {
        ("p0", "p1"),
        ("p0", "p2"),
        ("p0", "p3"),
        ("p1", "p3"),
        ("p2", "p3"),
    }


def test_bodies_stepped_together_move_as_each_does_alone():
    """Free flights with spins about no axis of symmetry and forces by formula."""
    bodies = [
        {"kind": "rigid", "name": f"top_{k}", "mass": 1.0 + k, "velocity": [0.1 * k, 0.0, 1.0],
         "angular_velocity": [3.0, 0.2 + k, -1.0], "force": [f"-{k}*vx", "0", "0"],
         "shape": {"kind": "block", "size": [0.1, 0.2, 0.3], "corner": [k, 0.0, 0.0]}}
        for k in range(3)
    ]  # fmt: skip
    base = {"title": "tops", "duration": 0.5, "solve": {"dt": 5e-3, "estimate": False},
            "output": {"fields": []}}  # fmt: skip
    together = impactfem.solve(Scene.from_dict(base | {"body": bodies})).history
    for body in bodies:
        alone = impactfem.solve(Scene.from_dict(base | {"body": [body]})).history
        names = [n for n in alone.data_vars if n.startswith(body["name"])]
        assert names
        for name in names:
            np.testing.assert_allclose(
                together[name].values, alone[name].values, rtol=0.0, atol=1e-12, err_msg=name
            )


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    monkeypatch.setattr(pair_responses, "_MANY", 0)
    check_ranks(beside_a_solid, monkeypatch)


def test_a_residual_that_is_asked_for_is_kept_and_said(monkeypatch):
    """The motion is that of exact forces, to about the residual; energy never grows."""
    monkeypatch.setattr(pair_responses, "_MANY", 0)
    exact = impactfem.solve(crowd()).history
    run = impactfem.solve(crowd().with_settings({"solve.friction_residual": 1e-4}))
    assert 0.0 < run.summary["details"]["friction_residual"] <= 1e-4
    for name in (f"grain_{k}.y" for k in range(15)):
        np.testing.assert_allclose(run.history[name], exact[name], rtol=0.0, atol=2e-5)
    assert np.diff(run.history["total_energy"].values).max() < 1e-5


@pytest.mark.parametrize(
    "changed",
    [{"contact": [{"between": ["*", "*"]}]}, {"solve": {"dt": 2e-3, "friction_residual": 0.2}}],
)
def test_a_residual_without_friction_or_too_large_is_refused(changed):
    with pytest.raises(impactfem.SceneError, match=r"solve\.friction_residual"):
        impactfem.solve(crowd(**{"solve": {"dt": 2e-3, "friction_residual": 1e-3}} | changed))


def test_of_many_pairs_no_rows_are_kept(monkeypatch):
    """A history has columns of up to 100 pairs: of more none take memory in each layer."""
    begin, kept = TimeLoop.begin, []

    def watched(self, observers=()):
        kept.append((self.rows.pair_force.shape, self.rows.slip.shape))
        begin(self, observers)

    monkeypatch.setattr(TimeLoop, "begin", watched)
    many = impactfem.solve(crowd().with_settings({"duration": 0.02})).history
    few = impactfem.solve(grains(duration=0.02)).history
    assert kept == [((11, 0), (11, 0)), ((11, 33), (11, 33))]
    assert "gap.grain_1.grain_2" in few
    assert "gap.grain_1.grain_2" not in many


@pytest.fixture
def lent(monkeypatch):
    """Number of gaps that are lent to pairs, and to which, of each layer."""
    seen, look = [], ball_crowd.NearPairs.__call__

    def watched(self, places, acting):
        met = look(self, places, acting)
        seen.append(self.held)
        return met

    monkeypatch.setattr(ball_crowd.NearPairs, "__call__", watched)
    return seen


def test_gaps_that_are_lent_do_as_those_of_all_pairs(monkeypatch, lent):
    made = crowd(gravity=[6.0, -8.0])
    found = impactfem.solve(made).history
    assert lent
    assert len(lent[-1]) < 105
    assert len({tuple(held) for held in lent}) > 3  # pairs come and go
    monkeypatch.setattr(contacts, "MOST_PAIRS", 1000)
    count = len(lent)
    every = impactfem.solve(made).history
    assert len(lent) == count
    assert (every["contact_force"].values > 10.0).mean() > 0.5
    for name in (name for name in every.data_vars if name.startswith(("grain", "total", "gap"))):
        one, two = found[name].values, every[name].values
        size = np.nanmax(np.abs(two), initial=1.0)
        np.testing.assert_allclose(one, two, rtol=0.0, atol=1e-9 * size, err_msg=name)


def test_a_gap_is_lent_again_only_after_a_layer_in_which_it_was_open():
    ends = np.array([[0, 1], [0, 2], [1, 2]])
    places = np.array([[0.0, 0.0], [1.0, 0.0], [9.0, 0.0]])
    one = np.ones(3)
    pairs = ball_crowd.NearPairs(ball_crowd.BallCrowd(ends, np.ones_like(ends), one, 0.1 * one, 3))
    assert len(pairs.held) == 1
    far = pairs(places, places).gap
    np.testing.assert_allclose(far, 0.0, atol=1e-15)
    moved = places + np.array([[8.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    with pytest.raises(impactfem.errors.ConvergenceError, match="more than there is room"):
        pairs(places[[0, 1, 1]], places)
    met = pairs(moved, moved)  # no other gap is free: it goes to the next pair at once
    assert pairs.held.tolist() == [1]
    np.testing.assert_array_equal(met.weights.toarray(), [[1.0, 0.0, -1.0]])
    wide = ball_crowd.NearPairs(
        ball_crowd.BallCrowd(ends, 4 * np.ones_like(ends), one, 0.1 * one, 12)
    )
    wide(places, places)
    first = wide.held.copy()
    wide(moved, moved)
    assert first.tolist()[0] == 0
    assert wide.held.tolist()[:2] == [-1, 1]
    kept = wide.memory
    wide.recall(kept)
    np.testing.assert_array_equal(wide.held, kept)


def test_a_loose_residual_keeps_momentum_and_never_gives_energy():
    """Balls that fly into each other in space, spinning, with friction."""
    grid = np.stack(np.meshgrid(*[np.arange(3)] * 3), axis=-1).reshape(-1, 3)
    balls = [
        {"kind": "rigid", "name": f"ball_{k}", "mass": 0.1 * (1 + k % 3),
         "velocity": (1.5 * (1.0 - place)).tolist(),
         "angular_velocity": [5.0 * (k % 3), 2.0, -float(k)],
         "shape": {"kind": "sphere", "radius": 0.05, "center": (0.105 * place).tolist()}}
        for k, place in enumerate(grid)
    ]  # fmt: skip
    law = {"between": ["*", "*"], "friction_coefficient": 0.4, "restitution": 0.3}
    data = {"title": "implosion", "duration": 0.02, "body": balls, "contact": [law],
            "solve": {"dt": 1e-3, "estimate": False, "friction_residual": 1e-3},
            "output": {"fields": []}}  # fmt: skip
    run = impactfem.solve(Scene.from_dict(data))
    found = run.history
    assert found["active"].values.max() >= 27
    assert 0.0 < run.summary["details"]["friction_residual"] <= 1e-3
    for axis in "xyz":
        momentum = sum(ball["mass"] * found[f"{ball['name']}.v{axis}"].values for ball in balls)
        np.testing.assert_allclose(momentum, momentum[0], rtol=0.0, atol=1e-14)
    energy = found["total_energy"].values
    assert energy[-1] < 0.5 * energy[0]
    assert np.diff(energy).max() <= 1e-15

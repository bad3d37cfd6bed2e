"""Which nodes carry contact unknowns: discs, blocks, supports, reach; on any number of ranks."""

from typing import Any

import numpy as np
import pytest
from bodies import TestBody, grid, round_off
from numpy.typing import NDArray
from pytest_mpi import parallel_assert

from impactfem.contact.boundary import boundary
from impactfem.contact.facing import FACING_AWAY, UPRIGHT
from impactfem.contact.reach import Reach, reach
from impactfem.contact.surfaces import ContactNodes, contact_nodes
from impactfem.contact.watch import penetration_of_others
from impactfem.errors import SceneError
from impactfem.fem import MPI
from impactfem.scene.obstacles import HalfSpace, RigidPolyline, RigidSphere

ANYWHERE = Reach(np.inf, "there is no bound")
FLOOR = HalfSpace(name="floor", point=(0.0, 0.0), normal=(0.0, 2.0))
WALL = HalfSpace(name="wall", point=(-1.5, 0.0), normal=(1.0, 0.0))


def disc(comm: Any, n: int = 16, degree: int = 1, height: float = 1.02) -> TestBody:
    return grid(
        comm, (n, n), (-1.0, -1.0), (1.0, 1.0),
        simplex=True, degree=degree, bend=round_off((0.0, height), 1.0),
    )  # fmt: skip


def block(comm: Any, low: float = 0.01) -> TestBody:
    return grid(comm, (4, 8), (0.0, low), (1.0, 2.0 + low))


def choose(
    body: TestBody,
    obstacles: list[Any],
    bound: Reach = ANYWHERE,
    fixed: NDArray[np.bool_] | None = None,
    **options: Any,
) -> ContactNodes:
    free = np.zeros(body.places.shape, dtype=bool)
    shape = {k: options[k] for k in ("thickness", "axisymmetric") if k in options}
    options.pop("thickness", None)
    return contact_nodes(
        body.mesh.comm, boundary(body, **shape), obstacles, body.owned,
        free if fixed is None else fixed, 0.0 * free, bound, **options,
    )  # fmt: skip


def test_the_upper_half_of_a_disc_is_left_out() -> None:
    body = disc(MPI.COMM_SELF)
    contact = choose(body, [FLOOR], name="disc")
    arms = body.places - [0.0, 1.02]
    rim = np.flatnonzero(np.abs(np.hypot(*arms.T) - 1) < 1e-9)
    rim = rim[np.argsort(np.arctan2(arms[rim, 1], arms[rim, 0]))]
    before, after = (np.roll(body.places[rim], shift, axis=0) for shift in (1, -1))
    # A node is left out if both chords that meet there face away or stand upright; chords run
    # counterclockwise.
    sines = [-chord[:, 0] / np.hypot(*chord.T) for chord in (body.places[rim] - before,
                                                            after - body.places[rim])]  # fmt: skip
    stays = np.minimum(*sines) < UPRIGHT
    order = np.argsort(body.owned[rim[stays]])
    assert body.owned[rim[stays]][order].tolist() == contact.numbers.tolist()
    assert len(rim) == 64
    assert contact.count == 29  # 31 below the equator but for chords of more than 78.5 degrees
    np.testing.assert_allclose(contact.gap, contact.positions[:, 1], rtol=1e-14)
    np.testing.assert_array_equal(contact.normal, [[0.0, 1.0]] * 29)
    across = ((after - before) @ [[0.0, -1.0], [1.0, 0.0]])[stays][order]
    across /= np.hypot(*across.T)[:, None]
    np.testing.assert_allclose(contact.outward, across, atol=1e-13)
    lengths = np.hypot(*(body.places[rim] - before).T) + np.hypot(*(after - body.places[rim]).T)
    np.testing.assert_allclose(contact.area, lengths[stays][order] / 2, rtol=1e-12)
    assert sorted(body.owned[contact.nodes]) == contact.numbers.tolist()
    np.testing.assert_array_equal(contact.numbers[contact.rows], body.owned[contact.nodes])
    assert len(contact.watched) == 35
    assert contact.why[0].startswith("29 nodes (bottom 17, left 6, right 6) of the 64 on")
    assert "35 nodes (left 10, right 10, top 15) face away" in " ".join(contact.why)


def test_what_cannot_come_near_is_left_out() -> None:
    body = disc(MPI.COMM_SELF)
    bound = reach(0.1, [0.0], [[0.0, 0.0]], [FLOOR], 1.0)
    assert bound.distance == pytest.approx(0.2)
    contact = choose(body, [FLOOR], bound)
    rim = np.abs(np.hypot(body.places[:, 0], body.places[:, 1] - 1.02) - 1) < 1e-9
    near = rim & (body.places[:, 1] <= 0.2)
    assert contact.numbers.tolist() == sorted(body.owned[near].tolist())
    assert 0 < contact.count < 20
    assert any(
        "too far" in line and "initial speed of at most 0.1 m/s" in line for line in contact.why
    )


def test_the_bound_of_the_way() -> None:
    still = reach(0.0, [0.0], [[0.0, 0.0]], [FLOOR], 2.0)
    assert still.distance == 0.0
    assert "nothing that moves it" in still.why
    # 10 m/s^2 for 1 s gives 5 m and a speed of 10 m/s for two more seconds.
    pulse = reach(0.0, [0.0, 1.0], [[6.0, -8.0], [0.0, 0.0]], [FLOOR], 3.0)
    assert pulse.distance == pytest.approx(2 * 25.0)
    late = reach(1.0, [0.0, 5.0], [[0.0, 0.0], [0.0, -9.81]], [FLOOR], 3.0)
    assert late.distance == pytest.approx(2 * 3.0)
    hammer = HalfSpace(point=(0.0, 0.0), normal=(0.0, 1.0), motion=["0", "0.1*sin(2*t)"])
    thrown = reach(0.0, [0.0], [[0.0, 0.0]], [hammer], 3.0)
    assert thrown.distance == pytest.approx(2 * (2 * 0.2 * 3.0) + 0.1, rel=1e-3)
    driven = reach(0.0, [0.0], [[0.0, 0.0]], [FLOOR], 1.0, driven="tractions")
    assert driven.distance == np.inf
    assert "tractions" in driven.why


def test_held_nodes_and_cuts_carry_no_contact() -> None:
    body = block(MPI.COMM_SELF)
    fixed = np.zeros(body.places.shape, dtype=bool)
    fixed[body.places[:, 0] == 0.0, 0] = True  # symmetry: may slide down
    fixed[body.places[:, 0] == 1.0] = True
    contact = choose(body, [FLOOR], fixed=fixed, symmetry=["left"])
    # The bottom without its fixed right end. The left side is no outside, the right one is held.
    order = np.argsort(contact.positions[:, 0])
    np.testing.assert_allclose(contact.positions[order], [[x, 0.01] for x in (0, 0.25, 0.5, 0.75)])
    # At the cut the outside ends: the normal there is that of the bottom.
    np.testing.assert_allclose(contact.outward, [[0.0, -1.0]] * 4, atol=1e-14)
    np.testing.assert_allclose(contact.area[order], [0.125, 0.25, 0.25, 0.25])
    text = " ".join(contact.why)
    assert "9 nodes (bottom 1, right 8) are held by supports along the normal" in text
    assert "4 nodes (top 4) face away" in text
    # Free to slide along the floor only: held along its normal.
    only_x = np.zeros(body.places.shape, dtype=bool)
    only_x[:, 1] = True
    assert choose(body, [FLOOR], fixed=only_x).count == 0


def test_contact_surfaces_limit_the_choice() -> None:
    body = block(MPI.COMM_SELF)
    contact = choose(body, [FLOOR], surfaces=["bottom"])
    assert contact.count == 5
    np.testing.assert_allclose(contact.outward, [[0.0, -1.0]] * 5, atol=1e-14)
    assert contact.area.sum() == pytest.approx(1.0)
    assert any("not on the contact surfaces" in line for line in contact.why)
    with pytest.raises(SceneError, match=r"'body'.*names 'sole'.*'bottom'.*use one"):
        choose(body, [FLOOR], surfaces=["sole"])
    edges = np.arange(body.mesh.topology.index_map(1).size_local, dtype=np.int32)
    body.surfaces["seam"] = np.setdiff1d(edges, np.concatenate(list(body.surfaces.values())))
    with pytest.raises(SceneError, match=r"'seam', which has no face on the outside"):
        choose(body, [FLOOR], surfaces=["bottom", "seam"])


def test_a_body_flies_freely_where_nothing_is_near() -> None:
    contact = choose(block(MPI.COMM_SELF), [FLOOR], Reach(1e-3, "it is slow"))
    assert contact.count == 0
    assert contact.normal.shape == (0, 2)
    assert "warning: no face" in contact.why[0]
    assert any("too far from obstacle 'floor': it is slow" in line for line in contact.why)


def test_between_obstacles_a_node_is_held_off_the_one_it_meets_first() -> None:
    body = disc(MPI.COMM_SELF)
    contact = choose(body, [FLOOR, WALL])
    x, y = contact.positions.T
    # On the way along the radius: y / -sin to the floor, (x + 1.5) / -cos to the wall.
    sine, cosine = np.maximum(1.02 - y, 0.05), np.maximum(-x, 0.05)
    clear = np.abs(y / sine - (x + 1.5) / cosine) > 0.1
    expected = np.where(y / sine <= (x + 1.5) / cosine, 0, 1)
    np.testing.assert_array_equal(contact.obstacle[clear], expected[clear])
    assert 0 < contact.obstacle.sum() < contact.count
    assert any("could touch more than one obstacle" in line for line in contact.why)
    # Flush in a corner, the corner itself is held off the first.
    corner = choose(block(MPI.COMM_SELF, 0.0), [FLOOR, HalfSpace(point=(0, 0), normal=(1, 0))])
    at = np.flatnonzero((corner.positions == 0.0).all(axis=1))
    assert corner.obstacle[at].tolist() == [0]


@pytest.mark.parametrize(
    ("obstacle", "words"),
    [
        (
            HalfSpace(name="floor", point=(0.0, 0.1), normal=(0.0, 1.0)),
            (
                r"5 of its nodes lie inside obstacle 'floor', deepest at \(.*, 0\.01\) by 0\.09 m;"
                r" move the body by 0\.09 m along \(0, 1\)"
            ),
        ),
        (HalfSpace(name="lid", point=(0.0, 0.0), normal=(0.0, -1.0)), "the whole.*turn its normal"),
        (RigidSphere(name="bore", center=(0.5, 1.0), radius=4.0), "'bore'.*side = 'inside'"),
        (RigidPolyline(name="rail", points=[(2.0, 0.0), (-1.0, 0.0)]), "reverse its points"),
    ],
)
def test_a_body_inside_an_obstacle_is_refused(obstacle: Any, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        choose(block(MPI.COMM_SELF), [obstacle], name="block")


def test_touching_at_the_start_is_no_penetration() -> None:
    contact = choose(block(MPI.COMM_SELF, -1e-10), [FLOOR])
    assert contact.gap.min() == pytest.approx(-1e-10)


def test_the_inside_of_a_ring_is_hidden_but_not_the_arch_of_a_bridge() -> None:
    def ring(x: NDArray[np.float64]) -> NDArray[np.float64]:  # the strip's ends are glued by chance
        angle, radius = 2 * np.pi * x[:, 0] - np.pi / 2, 1 + 0.3 * x[:, 1]
        return np.stack([radius * np.cos(angle), 1.32 + radius * np.sin(angle)], axis=1)

    body = grid(MPI.COMM_SELF, (64, 2), (0.01, 0.0), (0.99, 1.0), bend=ring)
    contact = choose(body, [FLOOR], surfaces=["top", "bottom"])  # outer and inner rim
    radius = np.hypot(*(contact.positions - [0.0, 1.32]).T)
    inner = contact.positions[radius < 1.15]
    # Left are those at the slit, which the ways pass, and those that face the floor sidewise.
    share = (inner[:, 1] - 1.32) / 1.0
    assert ((np.abs(inner[:, 0]) < 0.1) | (np.abs(share) < FACING_AWAY + 0.1)).all()
    assert (radius > 1.15).sum() > 25
    assert any("bottom" in line and "between them and" in line for line in contact.why)
    # From inside nothing is between.
    ball = RigidSphere(name="ball", center=(0.0, 1.32), radius=0.9)
    within = choose(body, [ball], surfaces=["top", "bottom"])
    assert np.hypot(*(within.positions - [0.0, 1.32]).T) == pytest.approx(1.0)
    assert within.count == 65

    def bridge(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.stack([x[:, 0], x[:, 1] + 0.3 * np.sin(np.pi * x[:, 0])], axis=1)

    arch = grid(MPI.COMM_SELF, (16, 2), (0.0, 0.01), (1.0, 0.11), bend=bridge)
    assert choose(arch, [FLOOR], surfaces=["bottom"]).count == 17


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.7, -2.4])
def test_faces_of_degree_2_do_not_hide_their_own_middle(angle: float) -> None:
    c, s = np.cos(angle), np.sin(angle)

    def turn(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return x @ np.array([[c, s], [-s, c]])

    body = grid(MPI.COMM_SELF, (5, 8), (0.0, 0.01), (1.0, 2.01), bend=turn, degree=2)
    floor = HalfSpace(name="floor", point=(0.0, 0.0), normal=(-s, c))
    assert choose(body, [floor]).count == 11


def test_initial_displacement_counts() -> None:
    body = block(MPI.COMM_SELF, 0.0)
    lifted = np.zeros(body.places.shape)
    lifted[:, 1] = 0.3 + 0.1 * body.places[:, 0]
    none = np.zeros(body.places.size, dtype=bool)
    contact = contact_nodes(
        MPI.COMM_SELF, boundary(body), [FLOOR], body.owned, none, lifted.ravel(), ANYWHERE
    )
    bottom = contact.gap < 0.45
    np.testing.assert_allclose(np.sort(contact.gap[bottom])[:5], 0.3 + 0.025 * np.arange(5))
    np.testing.assert_allclose(contact.positions[:, 1], contact.gap)


def test_the_watch_notices_what_was_left_out() -> None:
    body = block(MPI.COMM_SELF)
    obstacles = [FLOOR, HalfSpace(name="shelf", point=(0.0, -1.0), normal=(0.0, 1.0))]
    contact = choose(body, obstacles[:1], Reach(0.1, "slow"))
    comm = MPI.COMM_SELF

    def look(places: NDArray[np.float64], against: list[Any]) -> Any:
        return penetration_of_others(comm, contact, against, body.owned, places, 0.0)

    assert look(body.places, obstacles) is None
    # Contact nodes may be in their own obstacle: that is for the contact solver to see.
    sunk = body.places - [0.0, 0.05]
    assert look(sunk, obstacles[:1]) is None
    turned = body.places * [1.0, -1.0]  # upside down
    found = look(turned, obstacles)
    assert found.depth == pytest.approx(2.01)
    assert found.obstacle == 0
    assert found.place[1] == pytest.approx(-2.01)
    # ... and in another obstacle than their own.
    deep = body.places - [0.0, 1.1]
    deep[~np.isin(np.arange(len(deep)), contact.nodes)] += 3.0
    found = look(deep, obstacles)
    assert found.obstacle == 1
    assert found.depth == pytest.approx(0.09)
    assert found.number in contact.numbers


def test_half_of_a_ball_is_left_out() -> None:
    body = grid(
        MPI.COMM_SELF, (6, 6, 6), (-1.0,) * 3, (1.0,) * 3, bend=round_off((0.0, 1.0, 0.0), 1.0)
    )
    floor = HalfSpace(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 1.0, 0.0))
    contact = choose(body, [floor])
    total = 7**3 - 5**3
    assert 0.4 < contact.count / total < 0.5
    assert contact.positions[:, 1].max() < 1.0 + UPRIGHT + 0.3


@pytest.mark.parallel([2, 3, 4])
def test_ranks_agree() -> None:
    comm = MPI.COMM_WORLD
    for degree in (1, 2):
        alone, shared = (disc(c, 8, degree) for c in (MPI.COMM_SELF, comm))
        one = choose(alone, [FLOOR, WALL], surfaces=["left", "bottom"], thickness=0.1)
        many = choose(shared, [FLOOR, WALL], surfaces=["left", "bottom"], thickness=0.1)
        same = (
            np.array_equal(one.numbers, many.numbers)
            and np.array_equal(one.obstacle, many.obstacle)
            and one.why == many.why
        )
        parallel_assert(same, msg=f"degree {degree}: {one.why} != {many.why}")
        for key in ("positions", "outward", "gap", "normal", "area"):
            apart = np.abs(getattr(one, key) - getattr(many, key)).max()
            parallel_assert(apart < 1e-14, msg=f"degree {degree}: {key} differs by {apart}")
        # Every contact node has one owner, and lies where its row says.
        owners = np.zeros(many.count)
        owners[many.rows] = 1.0
        owners = comm.allreduce(owners)
        parallel_assert(bool((owners == 1).all()), msg=f"owners {owners}")
        parallel_assert(np.array_equal(shared.places[many.nodes], many.positions[many.rows]))
        parallel_assert(comm.allreduce(len(many.watched)) == len(one.watched))
        finds = [
            penetration_of_others(c, chosen, [FLOOR], body.owned, -body.places, 0.0)
            for c, chosen, body in ((MPI.COMM_SELF, one, alone), (comm, many, shared))
        ]
        parallel_assert(finds[0] == finds[1], msg=str(finds))


@pytest.mark.parallel([2, 4])
def test_errors_come_to_all_ranks() -> None:
    body = disc(MPI.COMM_WORLD, 8, height=0.9)
    for options, words in (({}, "inside obstacle"), ({"surfaces": ["sole"]}, "'sole'")):
        message = ""
        try:
            choose(body, [FLOOR], **options)
        except SceneError as error:
            message = str(error)
        parallel_assert(words in message, msg=message)

"""Solids on several ranks: the same as on one, also when contact moves from rank to rank."""

import numpy as np
import pytest
from moving_scenes import (
    METHODS,
    alone,
    block_on_sphere,
    differences,
    driven,
    finite,
    folding,
    forget,
    pair,
    pumped,
    resting,
    rolling,
    rubbing,
    sliding,
    stopping,
)
from pytest_mpi import parallel_assert

import impactfem

AGREED = 1e-10


def comm():
    from impactfem.fem import MPI

    return MPI.COMM_WORLD


def check(one, other, within=AGREED):
    """Histories on all ranks, and the last fields on rank 0, differ by rounding at most."""
    bad = {}
    for name in one.history.data_vars:
        a, b = one.history[name].values, other.history[name].values
        # What vanishes by symmetry is compared with speeds and ways of the body, which are .1.
        scale = max(np.nanmax(np.abs(a)), 0.1)
        apart = np.nanmax(np.abs(a - b)) if a.shape == b.shape else np.inf
        if not apart <= within * scale:
            bad[name] = apart / scale
    for name, figures in one.summary["bodies"].items():
        for key, a in figures.items():
            b = other.summary["bodies"][name][key]
            if not np.allclose(a, b, rtol=within, atol=within):
                bad[f"{name} {key}"] = (a, b)
    if comm().rank == 0:
        a, b = one.fields.read(-1), other.fields.read(-1)
        for name in ("displacement", "velocity", "von_mises"):
            apart = np.abs(a[name] - b[name]).max() / np.abs(a[name]).max()
            if not apart <= 10.0 * within:  # single nodes, not sums
                bad[name] = apart
    parallel_assert(not bad, participating=True, msg=str(bad))


def compare(case, monkeypatch, solve=impactfem.solve):
    with alone(monkeypatch):
        one = impactfem.solve(case)
    several = solve(case)
    parallel_assert(one.summary["contact"]["max_force"] > 0.0)
    check(one, several)


# Rounding grows in negative controls: with their energy.
STABLE = [name for name in METHODS if name != "newmark"]


# What four ranks add, parts without contact nodes or neighbours, asks no scheme in particular.
FOUR = ("explicit", "conserving")


@pytest.mark.parallel(4)
@pytest.mark.parametrize("method", FOUR)
def test_contact_that_moves_over_ranks_agrees(method, monkeypatch):
    check_moving(method, monkeypatch)


@pytest.mark.parallel(2)
@pytest.mark.parametrize("method", [name for name in STABLE if name not in FOUR])
def test_contact_that_moves_over_two_ranks_agrees(method, monkeypatch):
    check_moving(method, monkeypatch)


def check_moving(method, monkeypatch):
    touched = set()
    compare(sliding(method), monkeypatch, lambda case: watched(case, touched, monkeypatch))
    # The case is what it is meant to be: nodes of several ranks carried contact, one after another.
    touched = set().union(*comm().allgather(touched))
    parallel_assert(len(touched) > 1, msg=str(touched))


def watched(case, found, monkeypatch):
    """Solve a scene; the rank is found if its nodes were pushed at some time."""
    from impactfem.marching.solids import SolidMarch

    advance = SolidMarch._advance

    def watch(self):
        force = advance(self)
        own = np.zeros(len(force), dtype=bool)
        own[self.interior._surface.rows] = True
        if (force[own] > 0.0).any():
            found.add(comm().rank)
        return force

    with monkeypatch.context() as patch:
        patch.setattr(SolidMarch, "_advance", watch)
        return impactfem.solve(case)


@pytest.mark.parallel(2)
@pytest.mark.parametrize("method", ["explicit", "massless"])
def test_driven_bodies_agree(method, monkeypatch):
    compare(driven(method), monkeypatch)


@pytest.mark.parallel(2)
@pytest.mark.parametrize(
    ("made", "method"),
    [
        (driven, "conserving"),
        (rolling, "massless"),
        (rubbing, "conserving"),
        (rubbing, "explicit"),
        (pumped, "explicit"),
    ],
)
def test_bodies_under_finite_strain_agree(made, method, monkeypatch):
    compare(finite(made, method), monkeypatch)


@pytest.mark.parallel(2)
def test_a_ring_that_strikes_itself_agrees(monkeypatch):
    compare(folding(duration=0.0104, output={"every": 13}), monkeypatch)


@pytest.mark.parallel(2)
@pytest.mark.parametrize("settings", [{}, {"linear_solver": "gamg"}], ids=["mumps", "gamg"])
def test_bodies_that_start_at_rest_agree(settings, monkeypatch):
    compare(resting("conserving", **settings), monkeypatch)


@pytest.mark.parallel(2)
def test_multigrid_agrees(monkeypatch):
    compare(rolling("massless", linear_solver="gamg"), monkeypatch)


@pytest.mark.parallel(4)
@pytest.mark.parametrize(
    "settings",
    [
        {"method": "explicit"},
        {"method": "conserving", "degree": 2, "cells": "hexahedron", "size": 0.3},
    ],
    ids=["explicit", "Q2"],
)
def test_a_block_sliding_over_a_sphere_agrees(settings, monkeypatch):
    compare(block_on_sphere(**settings), monkeypatch)


@pytest.mark.parallel(2)
@pytest.mark.parametrize(
    "settings",
    [
        {"method": "massless", "linear_solver": "gamg"},
        {"method": "explicit", "cells": "hexahedron"},
        {"method": "massless", "degree": 2, "size": 0.3},
    ],
    ids=["multigrid", "hexahedra", "P2"],
)
def test_other_blocks_sliding_over_a_sphere_agree(settings, monkeypatch):
    compare(block_on_sphere(**settings), monkeypatch)


@pytest.fixture
def folder(tmp_path):
    return comm().bcast(tmp_path, root=0)


@pytest.mark.parallel(2)  # on four: from one rank to all, below
@pytest.mark.parametrize(
    "case",
    [
        driven("explicit"),
        driven("conserving"),
        driven("moreau_jean"),
        pair("explicit", "updated", 0.4),
        finite(rolling, "conserving"),
        finite(rubbing, "explicit"),
    ],
    ids=[
        "explicit",
        "conserving",
        "moreau_jean",
        "pair with friction",
        "finite",
        "finite explicit",
    ],
)
def test_a_continued_run_equals_the_whole_one_on_as_many_ranks(case, folder, monkeypatch):
    whole = impactfem.solve(case)
    stop = int(0.6 * whole.summary["num_steps"])
    with stopping(monkeypatch, stop):
        impactfem.solve(case, checkpoints=folder)
    forget()  # as in a new process
    again = impactfem.solve(case, checkpoints=folder, restart=folder)
    found = differences(whole, again)
    parallel_assert(found == {}, msg=str(found))


@pytest.mark.parallel([2, 4])
@pytest.mark.parametrize(
    "case", [rolling("explicit"), rolling("massless"), pair("massless", "updated", 0.4)],
    ids=["explicit", "massless", "pair"],
)  # fmt: skip
def test_a_run_goes_on_on_another_number_of_ranks(case, folder, tmp_path, monkeypatch):
    with alone(monkeypatch):
        whole = impactfem.solve(case)
        stop = int(0.6 * whole.summary["num_steps"])
        with stopping(monkeypatch, stop):
            impactfem.solve(case, checkpoints=tmp_path)
    with stopping(monkeypatch, stop):
        impactfem.solve(case, checkpoints=made(folder / "of all"))
    # From one rank to all; what rank 0 wrote by itself lies in its folder.
    check(whole, impactfem.solve(case, restart=folder))
    # From all ranks to one.
    with alone(monkeypatch):
        again = impactfem.solve(case, restart=copied(folder / "of all", tmp_path / "own"))
    check(whole, again)


def made(path):
    """A folder that all ranks see."""
    path.mkdir(exist_ok=True)
    comm().barrier()
    return path


def copied(source, target):
    """A copy of a folder for this rank."""
    import shutil

    shutil.copytree(source, target)
    return target


@pytest.mark.parallel([2, 4])
def test_a_broken_checkpoint_is_an_error_on_every_rank(folder):
    from impactfem.errors import OutputError
    from impactfem.marching.checkpoint import FILE

    if comm().rank == 0:
        (folder / FILE).write_bytes(b"broken")
    comm().barrier()
    message = ""
    try:
        impactfem.solve(driven("explicit"), restart=folder)
    except OutputError as error:
        message = str(error)
    parallel_assert("no checkpoint that can be read" in message)

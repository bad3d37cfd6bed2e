"""The standing disc: its scene, timed runs, and how far they are from the reference.

A disc of radius 1/2 in plane strain, nu = .3, density and lambda + 2 mu of 1, is thrown with .1 on
a plane .02 below it and watched for 4 s.
"""

import csv
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.log import Progress
from impactfem.models.solids import solids_model
from impactfem.planning import plan
from impactfem.runs.solids import run_solids
from impactfem.runs.tracks import Track
from impactfem.scene import Scene

Floats = NDArray[np.float64]

DURATION = 4.0
GAP = 0.02
SPEED = 0.1
POISSON = 0.3
YOUNG = (1.0 + POISSON) * (1.0 - 2.0 * POISSON) / (1.0 - POISSON)  # lambda + 2 mu = 1
WINDOWS = np.linspace(0.0, DURATION, 401)
"""Ends of the windows over which forces are averaged: waves cross 1/100 of the disc in one."""

STORED = Path(__file__).parent / "results" / "disc_reference.csv"


def scene(elements: int, degree: int = 1, **solve: Any) -> Scene:
    """The disc with so many elements across; keyword arguments are keys of ``[solve]``."""
    body = {
        "name": "disc", "kind": "solid", "model": "plane_strain",
        "shape": {"kind": "disc", "radius": 0.5, "center": [0.0, 0.5 + GAP]},
        "mesh_size": 1.0 / elements, "degree": degree,
        "density": 1.0, "youngs_modulus": YOUNG, "poisson_ratio": POISSON,
        "velocity": [0.0, -SPEED],
    }  # fmt: skip
    floor = {"name": "floor", "kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    return Scene.from_dict({
        "title": "Disc thrown on a plane", "duration": DURATION, "body": [body],
        "obstacle": [floor], "solve": {"estimate": False, **solve}, "output": {"fields": []},
    })  # fmt: skip


class Clock:
    """Seconds on the wall, or of the process where other work disturbs the machine."""

    def __init__(self) -> None:
        """Begin with those on the wall."""
        self.of_process = False

    def now(self) -> float:
        """Time [s]."""
        return time.process_time() if self.of_process else time.perf_counter()


clock = Clock()
"""The clock of all runs of the disc."""


class StopWatch(Progress):
    """Keeps when each stage of a run begins."""

    def __init__(self) -> None:
        """Begin without stages."""
        super().__init__()
        self.starts: list[float] = []

    def step(self, what: str) -> None:  # noqa: ARG002  (the last stage is the loop)
        """Note the time."""
        self.starts.append(clock.now())


@dataclass(frozen=True)
class Run:
    """A run and its cost.

    Attributes:
        track: Centre of mass and contact force.
        energy: Total energy at the end of each layer [J].
        unknowns: Displacement components.
        layers: Time steps.
        meshing, assembly, preparation, loop: [s]; preparation finds the stable step or factors.
    """

    track: Track
    energy: Floats
    unknowns: int
    layers: int
    meshing: float
    assembly: float
    preparation: float
    loop: float

    @property
    def total(self) -> float:
        """Everything from the scene to the motion [s]."""
        return self.meshing + self.assembly + self.preparation + self.loop

    @property
    def growth(self) -> float:
        """Largest gain of energy, relative to that at the start."""
        return float((self.energy.max() - self.energy[0]) / self.energy[0])


@dataclass(frozen=True)
class Body:
    """The discretised disc, which methods share, and what it cost."""

    elements: int
    degree: int
    meshing: float
    assembly: float


def prepare(elements: int, degree: int = 1) -> Body:
    """Mesh and assemble the disc; runs that follow use it."""
    begin = clock.now()
    model = solids_model(scene(elements, degree), [degree]).parts[0]
    meshed = clock.now()
    _ = model.system, model.contact
    return Body(elements, degree, meshed - begin, clock.now() - meshed)


def run(body: Body, **solve: Any) -> Run:
    """March the disc that was prepared last."""
    case = scene(body.elements, body.degree, **solve)
    chosen, watch = plan(case), StopWatch()
    begin = clock.now()
    motion, _ = run_solids(case, chosen, watch)
    end = clock.now()
    started = watch.starts[-1]
    history = motion.history
    unknowns = motion.effort.num_unknowns - motion.effort.details["contact_pairs"]
    return Run(
        Track.of_history(history, case),
        history["total_energy"].values, unknowns, len(history["time"]) - 1,
        body.meshing, body.assembly, started - begin, end - started,
    )  # fmt: skip


@dataclass(frozen=True)
class Samples:
    """A motion at the ends of the windows.

    Attributes:
        way: Of the centre of mass, upwards [m], shape (windows + 1,).
        impulse: Of the contact force up to there [N s].
        variation: Total variation of the contact force from layer to layer [N].
    """

    way: Floats
    impulse: Floats
    variation: float

    @classmethod
    def of(cls, track: Track) -> "Samples":
        """Sample a motion."""
        variation = float(np.abs(np.diff(np.append(track.force[1:], 0.0), prepend=0.0)).sum())
        return cls(track.way(WINDOWS)[:, 1], track.impulse(WINDOWS), variation)

    def error(self, exact: "Samples") -> tuple[float, float, float]:
        """Motion: largest and L2 error; force: L1 error of its means over the windows.

        Motions are relative to the largest (or L2) way, forces to the impulse.
        """
        apart = self.way - exact.way
        force = np.abs(np.diff(self.impulse) - np.diff(exact.impulse)).sum()
        return (
            float(np.abs(apart).max() / np.abs(exact.way).max()),
            float(np.linalg.norm(apart) / np.linalg.norm(exact.way)),
            float(force / exact.impulse[-1]),
        )


def save_references(references: dict[str, Samples], path: Path = STORED) -> None:
    """Store references: for each its way and impulse; the variations stand in the first line."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            ["time", *(f"{k}; {name}; {s.variation!r}" for name, s in references.items()
                       for k in ("way", "impulse"))]
        )  # fmt: skip
        columns = [column for s in references.values() for column in (s.way, s.impulse)]
        for row in zip(WINDOWS, *columns, strict=True):
            writer.writerow([f"{value:.12g}" for value in row])


def load_references(path: Path = STORED) -> dict[str, Samples]:
    """References by name, the one that counts first."""
    with path.open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    values = np.array(rows, dtype=np.float64).T
    found = {}
    for k in range(1, len(head), 2):
        _, name, variation = head[k].split("; ")
        found[name] = Samples(values[k], values[k + 1], float(variation))
    return found

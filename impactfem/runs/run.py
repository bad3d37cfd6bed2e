"""What every runner takes and gives: from a plan to all that a result is made of."""

import resource
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from impactfem.errors import SceneError
from impactfem.first_use import compiled_since
from impactfem.log import Progress
from impactfem.planning import Plan
from impactfem.reference.bar import Errors
from impactfem.result.bar_motion import Effort
from impactfem.result.snapshots import Snapshots
from impactfem.result.table import Table
from impactfem.result.trajectory import Impacts
from impactfem.scene import Scene

_LONG, _BETWEEN = 60.0, 30.0  # planned seconds from which runs are checkpointed, and how often


def checkpoint_every(scene: Scene, plan: Plan[Any]) -> float:
    """Planned share of a run between two checkpoints, or their number of time steps.

    Steps from 1 on are those that the scene asks for; less is a share of all; 0: there are none.
    """
    if scene.output.checkpoint is not None:
        return float(scene.output.checkpoint)
    if scene.solver != "march" or plan.seconds is None or plan.seconds <= _LONG:
        return 0.0
    return _BETWEEN / plan.seconds


@dataclass(frozen=True)
class Checkpointing:
    """Folders of checkpoints: of those to write, and of that to continue from; None for none."""

    folder: Path | None = None
    restart: Path | None = None

    def refuse(self, scene: Scene) -> None:
        """Refuse checkpoints of what has none.

        Raises:
            SceneError: They are asked for.
        """
        if self.folder is not None or self.restart is not None:
            body = next(iter(scene.bodies))
            raise SceneError(f"body {body.name}: a {body.kind} is not checkpointed; leave that out")


@dataclass(frozen=True)
class Cost:
    """What a run took.

    Attributes:
        wall_time: Of the solution [s], without the compilation of code at its first use.
        compile_time: Of that compilation [s]; the next run has none.
        memory_mib: Largest memory of all ranks [MiB].
        ranks: How many there were.
    """

    wall_time: float
    compile_time: float
    memory_mib: float
    ranks: int

    @classmethod
    def since(cls, start: float) -> "Cost":
        """Time from a start and memory, of all ranks; MPI counts only if a method has loaded it."""
        compile_time = compiled_since(start)
        wall_time = time.perf_counter() - start - compile_time
        mpi = sys.modules.get("mpi4py.MPI")
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        if mpi is None:
            return cls(wall_time, compile_time, memory, 1)
        memory = mpi.COMM_WORLD.allreduce(memory)
        return cls(wall_time, compile_time, memory, mpi.COMM_WORLD.size)


@dataclass(frozen=True, kw_only=True)
class Run:
    """What a runner gives.

    Attributes:
        used: The scene with the choices of the plan filled in.
        history: Its history, in the columns of the contract.
        effort: How the method got there.
        errors: Errors against a reference; None if they were not measured.
        cost: What it took, without that for the errors.
        fields: The motion of all bodies at the time levels asked for.
        exact: Exact curves; None if they are unknown.
        impacts: Impacts one by one; None if the method tells none.
        contact: Figures of contact that the method knows better than its history.
        conservative: Whether nothing does work that the history does not hold; else energy may
            grow.
    """

    used: Scene
    history: Table
    effort: Effort
    errors: Errors | None
    cost: Cost
    fields: Snapshots | None = None
    exact: Table | None = None
    impacts: Impacts | None = None
    contact: Mapping[str, Any] = field(default_factory=dict)
    conservative: bool = True


Runner = Callable[[Scene, Plan[Any], Progress, Checkpointing], Run]
"""Solves a scene as planned; see `impactfem.solving.solve` for what it may raise."""

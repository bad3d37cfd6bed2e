"""Searches: what was tried, and what failed."""

import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError, SceneError
from impactfem.inverse.evaluations import Evaluations
from impactfem.inverse.steps import Slopes
from impactfem.inverse.varied import Varied
from impactfem.scene import Scene


@dataclass(frozen=True)
class Iteration:
    """One evaluation of the search.

    Attributes:
        objective: J.
        gradient_norm: Of J by parameters in their sizes.
        step: Change of the parameters since the one before, in their sizes.
        seconds: Since the beginning [s].
        forward_runs: Since the beginning.
        parameters: (P,).
    """

    objective: float
    gradient_norm: float
    step: float
    seconds: float
    forward_runs: int
    parameters: tuple[float, ...]


@dataclass
class Search:
    """A search and what it has tried.

    Attributes:
        varied: What is searched.
        tried: Evaluations, in their order.
        failures: Why runs failed.
        begun: When [s].
    """

    varied: Varied
    tried: list[Iteration] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    begun: float = field(default_factory=time.perf_counter)

    def run(self, values: Floats) -> Slopes | None:
        """The numbers and their derivatives at some values; None where there is no run.

        Raises:
            SceneError, ConvergenceError: There is none at the first values.
        """
        try:
            return self.varied.jacobian(values)
        except (SceneError, ConvergenceError) as error:
            if not self.tried:
                raise
            self.failures.append(str(error))
            return None

    def note(self, values: Floats, objective: float, slope: Floats) -> None:
        """Keep an evaluation: J, and its gradient by the parameters (P,)."""
        before = self.tried[-1].parameters if self.tried else tuple(values)
        change = (values - np.array(before)) / self.varied.scales
        self.tried.append(
            Iteration(
                objective, float(np.linalg.norm(slope * self.varied.scales)),
                float(np.linalg.norm(change)), time.perf_counter() - self.begun,
                self.varied.forward, tuple(map(float, values)),
            )
        )  # fmt: skip


def begun(scene: Scene | str | Path, folder: Path | None, restart: Path | None) -> Search:
    """A search of a scene, or of its file.

    Args:
        scene: The scene.
        folder: Where evaluations are kept so that it can go on; None for nowhere.
        restart: Folder of a search to go on with; ``folder`` is the same if it is None.

    Raises:
        SceneError: The scene cannot work, or its method has no right derivatives.
        FolderError: There is no such search, or it is of another scene.
    """
    if not isinstance(scene, Scene):
        scene = Scene.from_toml(scene)
    varied = Varied.of(scene)
    where = restart if folder is None else folder
    if where is not None:
        varied.kept = Evaluations(scene, Path(where), None if restart is None else Path(restart))
    return Search(varied)

"""From a scene to its result."""

from pathlib import Path
from typing import Any, Unpack

from impactfem.errors import SceneError
from impactfem.facade import Result
from impactfem.log import Progress
from impactfem.planning import Plan, plan
from impactfem.provenance import run_record
from impactfem.runs import runner
from impactfem.runs.run import Checkpointing
from impactfem.runs.summary import summarise
from impactfem.scene import Scene
from impactfem.scene.settings import Settings


def solve(
    scene: Scene | str | Path,
    *,
    progress: Progress | None = None,
    checkpoints: Path | None = None,
    restart: Path | None = None,
    planned: Plan[Any] | None = None,
    **settings: Unpack[Settings],
) -> Result:
    """Solve a scene.

    Args:
        scene: What to model, or the file that says it.
        progress: Told of the stages; silent if None.
        checkpoints: Folder for checkpoints of what is marched, every ``output.checkpoint`` steps,
            or without that key every half a minute of runs planned for more than one; it must
            exist. With the first one, and seldom later, the history so far is written beside it.
        restart: Folder with the checkpoint from which the march continues.
        planned: The plan of this scene, if it is made already; settings make it anew.
        **settings: Keys of the scene's ``[solve]`` table that replace its own, as
            ``solve(scene, elements=80)``.

    Returns:
        The result, on every rank; the fields of a solid on rank 0 only. If the active set did not
        settle, ``summary["status"]`` says so and what was computed is kept.

    Raises:
        SceneError: The scene or a setting cannot work.
        MeshError: The mesh file has a fault, or the mesh cannot be made.
        ConvergenceError: A linear system could not be solved, or contact forces were not found.
        OutputError: The checkpoint cannot be read or written.
        MissingDependencyError: DOLFINx or Gmsh is not installed.
    """
    if isinstance(scene, str | Path):
        scene = Scene.from_toml(scene)
    if not isinstance(scene, Scene):
        raise SceneError(
            f"solve: it was given {type(scene).__name__}, not a Scene; make one by "
            'Scene.from_toml("scene.toml"), Scene.from_dict(...) or Scene(...)'
        )
    if settings:
        scene = scene.with_settings({f"solve.{key}": value for key, value in settings.items()})
        planned = None
    chosen = planned or plan(scene)
    saved = Checkpointing(checkpoints, restart)
    run = runner(scene.solver)(scene, chosen, progress or Progress(), saved)
    if scene.controllers:
        from impactfem.runs.feedback import controlled  # noqa: PLC0415  (loads SciPy and Numba)

        run = controlled(scene, run)
    summary = {**summarise(scene, chosen, run), "run": run_record(said=scene.said)}
    return Result(run.used, run.history, summary, run.fields, run.exact, run.impacts)

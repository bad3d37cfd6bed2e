"""The sub-commands: what each does with its arguments; heavy libraries are loaded when needed."""

import argparse
import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from impactfem.errors import MissingDependencyError, OutputError, SceneError
from impactfem.processes import complain, on_root, rank, say
from impactfem.quick import spare_signatures, without
from impactfem.shipped import find_scene, shipped_scenes
from impactfem.signals import InterruptedRunError, held_back

if TYPE_CHECKING:
    from impactfem.facade import Result
    from impactfem.inverse.gradients import TaylorCheck
    from impactfem.log import Progress
    from impactfem.models.kinematics import Kinematics
    from impactfem.planning import Plan
    from impactfem.scene import Scene

DONE, FAILED, BAD_INPUT, NOT_TRUSTED = 0, 1, 2, 3
"""Exit codes; an interrupted run ends with 128 + the signal's number."""


def _read(given: argparse.Namespace) -> "tuple[Path, Scene]":
    """Read the scene with its --set assignments."""
    from impactfem.scene import Scene, parse_assignment  # noqa: PLC0415  (fast --help)

    path = find_scene(given.scene)
    scene = Scene.from_toml(path)
    settings = dict(parse_assignment(text) for text in given.settings)
    return path, scene.with_settings(settings) if settings else scene


def run(given: argparse.Namespace) -> int:
    """Solve a scene and write its result."""
    from impactfem.log import Progress  # noqa: PLC0415
    from impactfem.methods import METHODS  # noqa: PLC0415
    from impactfem.planning import plan as plan_of  # noqa: PLC0415
    from impactfem.report.table import summary_table  # noqa: PLC0415
    from impactfem.result.occupied import check_free  # noqa: PLC0415
    from impactfem.result.store import CHECKPOINT, PARTIAL, SPOOL  # noqa: PLC0415
    from impactfem.resuming import claimed, clear, kept  # noqa: PLC0415
    from impactfem.runs import RUNNERS  # noqa: PLC0415
    from impactfem.runs.run import checkpoint_every  # noqa: PLC0415

    path, scene, folder = _to_run(given)
    progress = Progress(enabled=rank() == 0 and not given.quiet)
    _prepare(scene)
    chosen = plan_of(scene)
    for warning in chosen.warnings:
        progress.message(f"warning: {warning}")
    if METHODS[chosen.method].assembled or not METHODS[chosen.method].layered:
        _load_finite_elements()
    stages = progress.stages(RUNNERS[scene.solver].stages)
    place = given.restart or folder
    keeps = given.restart is not None or checkpoint_every(scene, chosen) > 0.0
    on_root(lambda: check_free(folder, path))
    with claimed(folder, given.restart), stages, kept(place, keeps):
        result = _solved(scene, chosen, given.restart, place if keeps else None, progress)
        result = result.with_summary({**result.summary, "run": _record(given, result)})
        progress.step("writing the result")
        on_root(lambda: result.write_data(folder))
        clear(place, CHECKPOINT)
        clear(place, PARTIAL)
        on_root(lambda: _add_pictures(result, folder, progress))
        clear(place, SPOOL)  # pictures were drawn from it
    if not given.quiet:
        report = f"Report: {folder / 'report.html'}\n" * result.scene.output.report
        say(f"{summary_table(result.summary)}\n\n{report}Result and pictures: {folder}")
    verdict = result.summary["verdict"]
    if verdict["level"] != "do_not_trust":
        return DONE
    worst = verdict["findings"][0]
    remedy = f". Remedy: {worst['remedy']}" if worst["remedy"] else ""
    complain(
        f"do not trust this run ({result.summary['status']}): {worst['text']}; "
        f"the result is kept in {folder}{remedy}"
    )
    return NOT_TRUSTED


def _record(given: argparse.Namespace, result: "Result") -> dict[str, Any]:
    """Date, versions and machine of a run, with the command that repeats it."""
    from impactfem.provenance import shell_command  # noqa: PLC0415

    words = ["impactfem", "run"] if given.scene is None else ["impactfem", "run", given.scene]
    for text in given.settings:
        words += ["--set", text]
    for text in given.extensions:
        words += ["--extension", text]
    for option in ("out", "restart"):
        if getattr(given, option) is not None:
            words += [f"--{option}", str(getattr(given, option))]
    if result.summary["ranks"] > 1:
        words = ["mpirun", "-n", str(result.summary["ranks"]), *words]
    record: dict[str, Any] = result.summary["run"] | {"command": shell_command(words)}
    return record


def _add_pictures(result: "Result", folder: Path, progress: "Progress") -> None:
    """Draw a result whose data are in its folder; an interrupt does not touch them."""
    from impactfem.report.adding import add_pictures  # noqa: PLC0415

    progress.note("drawing")
    spare_signatures()
    try:
        for line in add_pictures(result, folder)[1]:
            complain(f"warning: {line}")
    except InterruptedRunError as error:
        error.kept = f"the result is in {folder}; draw it with: impactfem plot {folder}"
        raise


def _to_run(given: argparse.Namespace) -> "tuple[Path | None, Scene, Path]":
    """File of the scene (None: that of a checkpoint), the scene, the folder of its result.

    Raises:
        SceneError: Neither a scene nor a checkpoint is given, or both.
    """
    if given.restart is None:
        if given.scene is None:
            raise SceneError("run: no scene is given; name one, or use --restart DIR")
        path, scene = _read(given)
        return path, scene, given.out or Path("results") / _name(path)
    if given.scene is not None or given.settings:
        raise SceneError(
            f"run: --restart {given.restart} continues the scene of its checkpoint; leave SCENE "
            "and --set out"
        )
    _load_finite_elements()
    from impactfem.resuming import scene_to_continue  # noqa: PLC0415

    return None, scene_to_continue(given.restart), given.out or given.restart


def _solved(
    scene: "Scene", chosen: "Plan[Any]", restart: Path | None, place: Path | None,
    progress: "Progress",
) -> "Result":  # fmt: skip
    """Solve a scene as planned, with checkpoints in a place if there is one."""
    from impactfem.solving import solve  # noqa: PLC0415

    return solve(scene, progress=progress, planned=chosen, checkpoints=place, restart=restart)


def _prepare(scene: "Scene") -> None:
    """Load what a plan needs: that of a solid is made of its mesh."""
    sheared = any(getattr(body, "theory", "") == "timoshenko" for body in scene.bodies)
    if scene.marches or sheared or scene.mesh_path is not None:
        _load_finite_elements()


def _load_finite_elements() -> None:
    """Load DOLFINx: if it is missing, say so now; a signal meanwhile would crash its modules."""
    with held_back():
        # FFCx and DOLFINx would load Numba for kernels that no command writes, which takes longer
        # than they do; those that we write load it themselves.
        with without("numba"), suppress(MissingDependencyError):
            import impactfem.fem  # noqa: PLC0415
        import impactfem.fem  # noqa: F401, PLC0415  (one that cannot do without it)


def _name(path: Path) -> str:
    """Name of a scene's result folder: the file's, or its folder's if it is scene.toml."""
    return (path.stem if path.stem != "scene" else path.absolute().parent.name) or "scene"


def plan(given: argparse.Namespace) -> int:
    """Say what would be modelled, why, and what it would cost."""
    from impactfem.planning import plan as plan_of  # noqa: PLC0415
    from impactfem.report.table import plan_table  # noqa: PLC0415

    _, scene = _read(given)
    _prepare(scene)
    made = plan_of(scene)
    say(json.dumps(made.as_json(), indent=2) if given.json else plan_table(made))
    return DONE


def validate(given: argparse.Namespace) -> int:
    """Read a scene and say whether it is in order."""
    from impactfem.planning import plan as plan_of  # noqa: PLC0415

    path, scene = _read(given)
    _prepare(scene)
    warnings = plan_of(scene).warnings
    if scene.mesh_path is not None and not scene.marches:
        _load_finite_elements()
        from impactfem.fem import MPI  # noqa: PLC0415
        from impactfem.mesh.files import read_mesh  # noqa: PLC0415

        bar = scene.bar
        read_mesh(MPI.COMM_WORLD, scene.mesh_path, bar.length, scene.duration, bar.wave_speed)
    say("\n".join([f"{path}: in order ({scene.title})", *(f"warning: {w}" for w in warnings)]))
    return DONE


def kinematics(given: argparse.Namespace) -> int:
    """Say where the frames of mechanisms are at t = 0, and draw them."""
    from impactfem.models.kinematics import kinematics as kinematics_of  # noqa: PLC0415
    from impactfem.report.table import kinematics_table  # noqa: PLC0415

    path, scene = _read(given)
    _load_finite_elements()
    found = kinematics_of(scene)
    folder = given.out or Path("results") / f"{_name(path)}_kinematics"
    on_root(lambda: _write_kinematics(scene, found, folder))
    say(f"{kinematics_table(found)}\n\nwritten to {folder}")
    missed = [each for each in found if each.inverse is not None and not each.inverse.solved]
    for each in missed:
        if each.inverse is not None:
            complain(
                f"{each.name}.place cannot be reached: the nearest is {each.inverse.residual:.4g} m"
                " off; give another target, method, or positions in joints to begin from"
            )
    return NOT_TRUSTED if missed else DONE


def _write_kinematics(scene: "Scene", found: "tuple[Kinematics, ...]", folder: Path) -> None:
    """Write kinematics.json, of several mechanisms by name, and kinematics.png.

    Raises:
        OutputError: They cannot be written.
    """
    from impactfem.report.mechanism_picture import mechanism_picture  # noqa: PLC0415
    from impactfem.report.sheet import write_png  # noqa: PLC0415

    each = {one.name: one.as_json() for one in found}
    told = each if len(each) > 1 else each[found[0].name]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "kinematics.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
        write_png(mechanism_picture(scene, found), folder / "kinematics.png")
    except OSError as error:
        why = f"{folder}: cannot be written ({error.strerror}); choose another folder (--out)"
        raise OutputError(why) from None


def gradient(given: argparse.Namespace) -> int:
    """Take the gradient of a scene's objective by its parameters, and check it."""
    from impactfem.inverse import gradient as gradient_of  # noqa: PLC0415
    from impactfem.inverse.written import gradient_table, write_gradient  # noqa: PLC0415

    path, scene = _read(given)
    folder = given.out or Path("results") / f"{_name(path)}_gradient"
    found = gradient_of(scene)
    on_root(lambda: write_gradient(found, folder))
    say(f"{gradient_table(found)}\n\nwritten to {folder}")
    return _trusted("this gradient", folder, [*found.doubts, *_unchecked(found.check)])


def identify(given: argparse.Namespace) -> int:
    """Find the parameters with which a scene is nearest to what was measured."""
    from impactfem.inverse import identify as identified  # noqa: PLC0415
    from impactfem.inverse.written import identified_table, write_identified  # noqa: PLC0415

    return _searched(given, "identified", identified, identified_table, write_identified)


def optimise(given: argparse.Namespace) -> int:
    """Find the parameters and controls with which the objective of a scene becomes least."""
    from impactfem.inverse import optimise as optimised  # noqa: PLC0415
    from impactfem.inverse.written import optimised_table, write_optimised  # noqa: PLC0415

    return _searched(given, "optimised", optimised, optimised_table, write_optimised)


def trajectory(given: argparse.Namespace) -> int:
    """Find controls with which a scene moves as asked at least cost, and what really follows."""
    from impactfem.provenance import run_record, shell_command  # noqa: PLC0415
    from impactfem.solving import solve  # noqa: PLC0415
    from impactfem.trajectory.running import run_again  # noqa: PLC0415
    from impactfem.trajectory.scenes import trajectory as planned_of  # noqa: PLC0415
    from impactfem.trajectory.written import trajectory_table, write_trajectory  # noqa: PLC0415

    path, scene = _read(given)
    folder = given.out or Path("results") / f"{_name(path)}_trajectory"
    planned = planned_of(scene)
    ran = run_again(planned, solve)
    words = ["impactfem", "trajectory", given.scene]
    words += [word for text in given.settings for word in ("--set", text)]
    words += [word for text in given.extensions for word in ("--extension", text)]
    record = run_record(shell_command(words), scene.said)
    on_root(lambda: write_trajectory(planned, ran, folder, record))
    say(f"{trajectory_table(planned, ran)}\n\nwritten to {folder}")
    doubts = *planned.found.doubts, *ran.doubts(planned.found.allowed)
    return _trusted("this motion", folder, doubts)


def _searched(
    given: argparse.Namespace, what: str, search: Callable[..., Any],
    shown: Callable[[Any], str], write: Callable[[Any, Path, dict[str, Any]], None],
) -> int:  # fmt: skip
    """Search, write what was found, and run the answer with a plan of its own."""
    from impactfem.log import Progress  # noqa: PLC0415
    from impactfem.provenance import run_record, shell_command  # noqa: PLC0415
    from impactfem.solving import solve  # noqa: PLC0415

    path, scene = _read(given)
    folder = given.out or given.restart or Path("results") / f"{_name(path)}_{what}"
    found = search(scene, folder=folder, restart=given.restart)
    words = ["impactfem", given.action.__name__, given.scene]
    words += [word for text in given.settings for word in ("--set", text)]
    words += [word for text in given.extensions for word in ("--extension", text)]
    record = run_record(shell_command(words), found.scene.said)
    on_root(lambda: write(found, folder, record))
    verified = solve(found.scene)
    on_root(lambda: verified.write_data(folder / "verified"))
    on_root(lambda: _add_pictures(verified, folder / "verified", Progress(enabled=False)))
    say(f"{shown(found)}\n\nAnswer, search and report: {folder}")
    why = [*found.doubts, *_unchecked(found.check)]
    if found.status != "converged":
        why.append("the search did not converge")
    faults = (f for f in verified.summary["verdict"]["findings"] if f["severity"] == "fault")
    why += [
        f"the search did well, but by its run ({folder / 'verified'}): {fault['text']}; "
        f"{fault['remedy'] or 'take finer steps or elements'}"
        for fault in faults
    ]
    return _trusted("this answer", folder, why)


def _unchecked(check: "TaylorCheck") -> list[str]:
    """What the check of a gradient says against it, in words."""
    return [] if check.passed else ["the check of its gradient failed"]


def _trusted(what: str, folder: Path, why: Sequence[str]) -> int:
    """The exit code of what is trusted or not, by what speaks against it, which is said."""
    if not why:
        return DONE
    complain(f"do not trust {what}: {why[0]}; it is kept in {folder}")
    return NOT_TRUSTED


def methods(_: argparse.Namespace) -> int:
    """List the solution methods and their limits."""
    from impactfem.methods import METHODS  # noqa: PLC0415
    from impactfem.report.table import table  # noqa: PLC0415

    say(table([(name, method.text) for name, method in METHODS.items()]))
    return DONE


def scenes(_: argparse.Namespace) -> int:
    """List the shipped scenes."""
    from impactfem.report.table import table  # noqa: PLC0415
    from impactfem.scene import Scene  # noqa: PLC0415

    say(table([(name, Scene.from_toml(path).title) for name, path in shipped_scenes().items()]))
    return DONE


def new(given: argparse.Namespace) -> int:
    """Write a commented scene to start from, or list the kinds."""
    from impactfem import starting  # noqa: PLC0415

    starting.new(given, say)
    return DONE


def schema(given: argparse.Namespace) -> int:
    """Print the JSON schema of scenes, for editors."""
    from impactfem import starting  # noqa: PLC0415

    starting.schema(given, say)
    return DONE


def _loaded(folder: Path) -> "Result | None":
    """The result in a folder; None, and said, if there is none that can be read."""
    from impactfem.facade import Result  # noqa: PLC0415

    try:
        return Result.load(folder)
    except OutputError as error:
        complain(str(error))
        return None


def plot(given: argparse.Namespace) -> int:
    """Draw the pictures and the report of a result folder again."""
    spare_signatures()
    from impactfem.report.adding import add_pictures  # noqa: PLC0415
    from impactfem.result.store import CHECKPOINT, SPOOL  # noqa: PLC0415
    from impactfem.resuming import claimed, clear  # noqa: PLC0415
    from impactfem.scene import Output  # noqa: PLC0415

    if (result := _loaded(given.folder)) is None:
        return BAD_INPUT
    with claimed(given.folder):
        names, faults = add_pictures(result, given.folder, Output(film=True))
        if not (given.folder / CHECKPOINT).exists():  # left by a run that was killed as it drew
            clear(given.folder, SPOOL)
    for line in faults:
        complain(line)
    if result.fields is None:
        complain('no fields.vtkhdf: no pictures of the motion; run with fields = ["vtkhdf"]')
    say("\n".join(str(given.folder / name) for name in names))
    return FAILED if faults else DONE


def show(given: argparse.Namespace) -> int:
    """Show a result in space with a time slider, or write a picture of it."""
    from impactfem.report.view import show as shown  # noqa: PLC0415

    if rank():
        return DONE
    if (result := _loaded(given.folder)) is None:
        return BAD_INPUT
    shown(result, given.at, given.field, given.out)
    if given.out is not None:
        say(str(given.out))
    return DONE


def spectrum(given: argparse.Namespace) -> int:
    """Tell which frequencies a column of a result holds, and how oscillators would answer it."""
    from impactfem.report.spectrum_figure import spectrum_table, write_spectrum  # noqa: PLC0415

    if rank():
        return DONE
    if (result := _loaded(given.folder)) is None:
        return BAD_INPUT
    if given.modes is not None:
        _prepare(result.scene)
    both = given.fft == given.srs
    # Asked for by name it is refused of what is no acceleration; else it is left out.
    q = given.q if given.q is not None or not given.srs else 10.0
    found = result.spectrum(given.column, q=q, modes=given.modes)
    folder = given.out or given.folder.with_name(f"{given.folder.resolve().name}_spectrum")
    told = write_spectrum(found, folder, fft=both or given.fft, srs=both or given.srs)
    say(f"{spectrum_table(found, told)}\n\nwritten to {folder}")
    return DONE


def sweep(given: argparse.Namespace) -> int:
    """Run a scene at many values of some of its keys."""
    from impactfem.processes import ranks  # noqa: PLC0415
    from impactfem.studies.sweep_point import Asked  # noqa: PLC0415
    from impactfem.studies.sweeping import Axis  # noqa: PLC0415
    from impactfem.studies.sweeping import sweep as swept  # noqa: PLC0415

    if ranks() > 1:
        raise SceneError("sweep: starts processes of its own; leave mpirun out, give --jobs N")
    path, scene = _read(given)
    folder = given.out or Path("results") / f"{_name(path)}_sweep"
    asked = Asked(tuple(given.figures), given.section, given.period, given.after)
    axes = [Axis.parse(text) for text in given.vary]
    try:
        found = swept(
            scene, axes, folder=folder, jobs=given.jobs, asked=asked, continued=given.continued,
            extensions=given.extensions, say=say,
        )  # fmt: skip
    except InterruptedRunError as error:
        error.kept = f"what is done is kept in {folder}: the same command goes on"
        raise
    found.save(folder)
    say(f"{len(found.points)} points, {found.failed} without a result; table: {folder}/sweep.csv")
    if found.failed < len(found.points):
        return DONE
    complain(f"no point has a result: {found.points[0].message}")
    return BAD_INPUT if {point.code for point in found.points} == {BAD_INPUT} else FAILED


def compare(given: argparse.Namespace) -> int:
    """Say how far the histories of two result folders are apart."""
    from impactfem.report.table import comparison_table  # noqa: PLC0415
    from impactfem.result.compare import compare as compared  # noqa: PLC0415

    try:
        found = compared(given.one, given.other)
    except OutputError as error:
        complain(str(error))
        return BAD_INPUT
    say(comparison_table(found))
    return DONE if found.within(given.tolerance) else NOT_TRUSTED


def bench(given: argparse.Namespace) -> int:
    """Measure errors of methods against time, or run hard cases."""
    from impactfem.studies import bench as studies  # noqa: PLC0415

    return DONE if studies.bench(given, say) else FAILED


def doctor(_: argparse.Namespace) -> int:
    """Say what is installed, what works and what is missing."""
    from impactfem.doctor import examine  # noqa: PLC0415
    from impactfem.report.table import table  # noqa: PLC0415

    rows, faults = examine()
    say(table(rows))
    for fault in faults:
        complain(fault)
    say("everything needed is there" if not faults else f"{len(faults)} faults")
    return FAILED if faults else DONE

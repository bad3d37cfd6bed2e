"""A scene taken step by step, with forces from outside: for controllers and notebooks."""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.facade import Result
from impactfem.findings import Finding
from impactfem.log import Progress
from impactfem.planning import plan
from impactfem.provenance import run_record
from impactfem.runs.feedback import Feedback, controlled
from impactfem.runs.run import Cost
from impactfem.runs.summary import summarise
from impactfem.scene import Scene
from impactfem.scene.nearest import meant
from impactfem.scene.values import show

if TYPE_CHECKING:
    from impactfem.runs.rewinding import State
    from impactfem.runs.solids import Ready

type Force = ArrayLike | Mapping[str, ArrayLike]
"""A force on a body's centre [N], (dim,), or {"force": (dim,), "moment": number or (3,)} [N m]."""


# Ends of the names of columns that a step tells by itself, and beginnings of those of pairs.
_STEPWISE = frozenset([
    "x", "y", "z", "vx", "vy", "vz", "spin", "wx", "wy", "wz", "q", "v", "ux", "uy", "uz",
])  # fmt: skip
_OF_PAIRS = frozenset(["gap", "force", "tangential_force", "moment", "center", "slip", "momentum"])


class Simulation:
    """A scene that is marched step by step.

    Steps are those of `impactfem.solve`: to the end, without forces, the history is the same bit by
    bit. All that is marched in time can be stepped: solids, plates, rigid bodies, joints,
    mechanisms, and points, rods, beams and bars beside others or with friction. Methods that take
    the whole time at once cannot.

    Fields for films are not kept; the error is not estimated where forces have acted.

        >>> sim = impactfem.Simulation("cart.toml")
        >>> while not sim.done:
        ...     sim.step(forces={"cart": [-10.0 * sim.columns["cart.x"], 0.0]})
        >>> result = sim.result()

    Args:
        scene: What to model, or the file that says it.
        **settings: Keys of ``[solve]`` that replace the scene's own.

    Raises:
        SceneError: The scene cannot work, or its method has no steps.
    """

    def __init__(self, scene: Scene | str | Path, **settings: Any) -> None:
        """Plan, mesh, and begin at t = 0 (collective)."""
        begun = time.perf_counter()
        scene = scene if isinstance(scene, Scene) else Scene.from_toml(scene)
        if settings:
            scene = scene.with_settings({f"solve.{key}": value for key, value in settings.items()})
        if scene.solver != "march":
            raise SceneError(_refusal(scene))
        from impactfem.runs.marched import strained  # noqa: PLC0415  (loads DOLFINx)
        from impactfem.runs.solids import prepare  # noqa: PLC0415

        self._said, self._plan, self._begun = scene, plan(scene), begun
        self._scene = strained(scene, self._plan)
        self._first = prepare(self._scene, self._plan, Progress())
        self._take(self._first)
        self._pushed, self._held = False, set[str]()
        self._columns: Mapping[str, float] = {}
        self._known, self._restored = -1, 0  # step of the columns, number of states restored
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            self._march.begin(self._observers)

    def _take(self, ready: "Ready") -> None:
        """March what is ready from here on."""
        self._ready, self._march = ready, ready.seen.march
        self._observers = ready.seen.observers()

    @property
    def scene(self) -> Scene:
        """The scene as given."""
        return self._said

    @property
    def dt(self) -> float:
        """Length of a step [s]."""
        return float(self._march.interior.dt)

    @property
    def time(self) -> float:
        """Now [s]."""
        return self._march.layer * self.dt

    @property
    def done(self) -> bool:
        """Whether the duration of the scene is over."""
        return self._march.layer >= self._march.layers

    def step(
        self,
        forces: Mapping[str, Force] | None = None,
        outputs: Mapping[str, float] | None = None,
    ) -> Self:
        """March one step.

        Args:
            forces: By body, held constant over the step: of points [N], (dim,); of rigid bodies at
                the centre of mass, or with a moment about it: see `Force`. Bodies that are not
                named get none.
            outputs: Of controllers of the kind external, by name, in the unit of what they act on;
                those that are not named hold what they had.

        Returns:
            Itself.

        Raises:
            SceneError: A body takes no forces, a controller is none, or the duration is over.
            ConvergenceError: The step was not found.
        """
        if self.done:
            raise SceneError(
                f"Simulation.step: t = {self.time:g} s is the end; give a longer duration, or "
                "restore an earlier state"
            )
        while self._ready.later is not None and self._march.layer >= self._ready.ends:
            self._take(self._ready.handed())
        self._apply(forces or {})
        if outputs:
            feedback = self._ready.seen.feedback
            (feedback or Feedback(self._scene, self.dt, 0)).hold(outputs)
            self._pushed = True
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            self._march.step(self._observers)
        return self

    def _apply(self, forces: Mapping[str, Force]) -> None:
        dim = self._ready.seen.model.dim
        given = {name: _parted(name, force, dim) for name, force in forces.items()}
        known = [body.name for body in self._scene.bodies]
        for name in given:
            if name not in known:
                text = f"Simulation.step: there is no body {show(name)}; {meant(name, known)}"
                raise SceneError(text)
        none = np.zeros(dim), np.zeros(dim * (dim - 1) // 2)
        each = {n: (few, k) for few in self._ready.few for k, n in enumerate(few.bodies.names)}
        for name, (force, moment) in given.items():
            few, body = each.get(name, (None, 0))
            taken = few is not None and few.apply(body, force, moment)
            if not taken and (force.any() or moment.any()):
                kind = next(body.kind for body in self._scene.bodies if body.name == name)
                raise SceneError(
                    f"Simulation.step: {show(name)} is a {kind}, which does not take this from "
                    "outside: points, rods and beams take forces, rigid bodies forces and moments"
                )
        for name in self._held - {*given}:  # by the last step
            few, body = each[name]
            few.apply(body, *none)
        self._held = {name for name in given if name in each}
        self._pushed = self._pushed or bool(given)

    @property
    def columns(self) -> Mapping[str, float]:
        """The history now: column to number, those of probes, bodies, pairs and joints.

        Places, velocities and spins of bodies, probes and joints are told by the last step. For
        all others, and for their list, all rows so far are looked at, once a step, which costs the
        more the longer the run.
        """
        if self._known != self._march.layer:
            from impactfem.runs.latest import latest  # noqa: PLC0415  (loads DOLFINx)

            layer = self._known = self._march.layer
            restored = self._restored

            def whole() -> dict[str, float]:
                if self._restored != restored:
                    raise SceneError(
                        "Simulation.columns: these are of before a state was restored; ask for "
                        "them before that"
                    )
                rows = self._motion().history
                return {name: float(column.values[layer]) for name, column in rows.items()}

            self._columns = _Now(latest(self._ready.seen, turns=False), whole)
        return self._columns

    def _motion(self) -> Any:
        from impactfem.runs.solid_rows import solids_motion  # noqa: PLC0415  (loads DOLFINx)

        return solids_motion(self._ready.seen)

    @property
    def state(self) -> "State":
        """All that the next step needs, to be restored in this simulation, as often as wanted."""
        from impactfem.runs.rewinding import State  # noqa: PLC0415  (loads DOLFINx)

        return State.of(self._ready.seen, pushed=self._pushed)

    def restore(self, state: "State") -> Self:
        """Go back, or on, to a state of this simulation; steps from there are the same bit by bit.

        Args:
            state: As `state` gave it.

        Returns:
            Itself.

        Raises:
            SceneError: It is no state of this simulation.
        """
        from impactfem.runs.rewinding import State  # noqa: PLC0415  (loads DOLFINx)

        if not isinstance(state, State):
            raise SceneError(
                f"Simulation.restore: it was given {type(state).__name__}; give what sim.state was"
            )
        if not state.fits(self._ready.seen):
            raise SceneError("Simulation.restore: the state belongs to another scene")
        self._take(self._first.at(state.layer))
        state.restore(self._ready.seen)
        self._pushed, self._known = state.pushed, -1
        self._restored += 1
        return self

    def result(self) -> Result:
        """What `impactfem.solve` would return of the steps so far (collective).

        A run that has not come to its end says so in its verdict.
        """
        from impactfem.runs.marched import finished  # noqa: PLC0415  (loads DOLFINx)

        estimate = self.done and not self._pushed
        run = finished(
            self._scene, self._plan, Progress(), self._motion(), None, Cost.since(self._begun),
            estimate=estimate,
        )  # fmt: skip
        notes = []
        if not self.done:
            text = f"the steps end at t = {self.time:.6g} s, before {self._said.duration:g} s"
            notes.append(Finding("interrupted", "warning", text))
        if self._pushed:
            text = "forces from outside have acted: the scene alone does not repeat the run"
            notes.append(Finding("setting", "note", text))
        findings = (*run.effort.findings, *notes)
        run = controlled(self._said, replace(run, effort=replace(run.effort, findings=findings)))
        summary: dict[str, Any] = summarise(self._said, self._plan, run)
        if not self.done and summary["status"] == "completed":
            summary["status"] = "interrupted"
        summary["run"] = run_record("python: impactfem.Simulation(...)", self._said.said)
        return Result(run.used, run.history, summary, None, run.exact, run.impacts)

    def close(self) -> None:
        """Free matrices and factors; the simulation cannot be stepped any more (collective)."""
        self._first.destroy()


class _Now(Mapping[str, float]):
    """Columns of one step: those that the step tells, and all when another is asked for."""

    def __init__(self, told: Mapping[str, float], whole: Callable[[], dict[str, float]]) -> None:
        self._whole, self._every = whole, dict[str, float]()
        self._told = {
            name: value
            for name, value in told.items()
            if name.rpartition(".")[2] in _STEPWISE and name.partition(".")[0] not in _OF_PAIRS
        }

    def __getitem__(self, name: str) -> float:
        found = self._told.get(name)
        return self._all[name] if found is None else found

    def __iter__(self) -> Iterator[str]:
        return iter(self._all)

    def __len__(self) -> int:
        return len(self._all)

    def __repr__(self) -> str:
        return repr(self._all)

    @property
    def _all(self) -> dict[str, float]:
        self._every = self._every or self._whole()
        return self._every


def _parted(name: str, given: Force, dim: int) -> tuple[Floats, Floats]:
    """Force (dim,) and moment (turns,)."""
    turns = dim * (dim - 1) // 2
    parts = given if isinstance(given, Mapping) else {"force": given}
    sizes = {"force": dim, "moment": turns}
    found = {what: np.zeros(size) for what, size in sizes.items()}
    for what, values in parts.items():
        if what not in sizes:
            raise SceneError(
                f"Simulation.step: forces[{show(name)}] has {show(what)}: give force, moment"
            )
        try:
            found[what] = np.atleast_1d(np.asarray(values, dtype=np.float64))
        except (TypeError, ValueError):
            found[what] = np.array([np.nan])
        if found[what].shape != (sizes[what],) or not np.isfinite(found[what]).all():
            raise SceneError(
                f"Simulation.step: the {what} on {show(name)} is no list of {sizes[what]} numbers"
            )
    return found["force"], found["moment"]


def _refusal(scene: Scene) -> str:
    """Why a scene is not stepped, and what would be."""
    kinds = " and ".join(sorted(scene.kinds))
    method = scene.solve.method or plan(scene).method
    text = f"Simulation: {method} takes a scene of {kinds} through all of its time at once"
    if scene.in_coordinates:
        return f"{text}; leave solve.method out, or give conserving"
    return (
        f"{text}; what is marched can be stepped (massless, conserving, explicit, moreau_jean of "
        "solids, plates, rigid bodies, joints, mechanisms; of others where their contacts have "
        "friction or a stiffness, or beside bodies of another kind)"
    )

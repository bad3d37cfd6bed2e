"""The motion of a system with few degrees of freedom, as every method returns it."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.cards import card, curve
from impactfem.result.bar_motion import Effort


@dataclass(frozen=True)
class Impacts:
    """Impacts one by one, in the order of time; several constraints hit at once have equal times.

    Attributes:
        time: [s], shape (impacts,).
        constraint: Index of the constraint, shape (impacts,).
        before: Normal velocity before, <= 0, shape (impacts,).
        after: Normal velocity after, shape (impacts,).
        impulse: [N s], >= 0, shape (impacts,).
    """

    time: Floats
    constraint: Integers
    before: Floats
    after: Floats
    impulse: Floats

    def __len__(self) -> int:
        return len(self.time)

    def write_csv(self, path: Path) -> None:
        """Write one line an impact, with 17 digits."""
        columns = (self.time, self.constraint, self.before, self.after, self.impulse)
        np.savetxt(
            path,
            np.column_stack(columns),
            delimiter=",",
            fmt=["%.17g", "%d", "%.17g", "%.17g", "%.17g"],
            header="time,constraint,before,after,impulse",
            comments="",
        )

    @classmethod
    def read_csv(cls, path: Path) -> "Impacts":
        """Read what `write_csv` has written.

        Raises:
            ValueError: The file holds something else.
        """
        text = path.read_text(encoding="utf-8").splitlines()[1:]
        rows = [tuple(float(entry) for entry in line.split(",")) for line in text]
        if any(len(row) != 5 for row in rows):
            raise ValueError(f"{path}: not five numbers a line")
        return cls.of_rows([(t, int(j), b, a, p) for t, j, b, a, p in rows])

    @classmethod
    def of_rows(cls, rows: "list[tuple[float, int, float, float, float]]") -> "Impacts":
        """Impacts from rows (time, constraint, before, after, impulse)."""
        table = np.array(rows, dtype=float).reshape(-1, 5)
        return cls(table[:, 0], table[:, 1].astype(np.int64), *table[:, 2:].T)


@dataclass(frozen=True)
class Trajectory:
    """Motion of a system in generalised coordinates.

    Attributes:
        times: t_m [s], shape (rows,).
        position: u at t_m, shape (rows, d).
        velocity: u' just after t_m, shape (rows, d). Of the position-level scheme the difference
            (u_{m+1} - u_{m-1}) / 2h, also at both ends.
        gap: phi_j(u) - b_j(t) at t_m, shape (rows, J).
        contact_force: Mean force of lasting contact of each constraint during (t_{m-1}, t_m] [N],
            without the impulses of impacts, shape (rows, J); row 0 is 0.
        impulse: Impulses of impacts and of lasting contact during (t_{m-1}, t_m] [N s], (rows, J).
        kinetic: Kinetic energy at t_m [J], shape (rows,).
        potential: Potential energy at t_m [J], shape (rows,); 0 if unknown.
        peak: Largest sum of the forces of lasting contact [N]; None if there was none.
        window: Time over which `peak` is a mean [s]; 0 for its value at an instant.
        impacts: Impacts one by one, as far as the method resolves them; None if it does not.
        effort: How the method got there.
        friction_work: Of friction since t = 0 [J], shape (rows,); None if unknown or without any.
    """

    times: Floats
    position: Floats
    velocity: Floats
    gap: Floats
    contact_force: Floats
    impulse: Floats
    kinetic: Floats
    potential: Floats
    peak: float | None = None
    window: float = 0.0
    impacts: Impacts | None = None
    effort: Effort = field(default_factory=Effort)
    friction_work: Floats | None = None

    @property
    def total(self) -> Floats:
        """Kinetic plus potential energy [J], shape (rows,)."""
        return self.kinetic + self.potential

    @property
    def is_finite(self) -> bool:
        """Whether positions and velocities are finite."""
        return bool(np.isfinite(self.position).all() and np.isfinite(self.velocity).all())

    def __repr__(self) -> str:
        rows, dofs = self.position.shape
        hits = "" if self.impacts is None else f", impacts={len(self.impacts)}"
        return (
            f"Trajectory(rows={rows}, dofs={dofs}, constraints={self.gap.shape[1]}{hits}, "
            f"until={float(self.times[-1]):g} s)"
        )

    def _repr_html_(self) -> str:
        rows, dofs = self.position.shape
        force = self.contact_force.sum(axis=1)
        loss = self.total[0] - self.total[-1]
        found = [
            ("time", f"{self.times[0]:g} to {self.times[-1]:g} s in {rows} rows"),
            ("coordinates", f"{dofs}, {self.gap.shape[1]} constraints"),
            ("impacts", "not located" if self.impacts is None else str(len(self.impacts))),
            ("smallest gap", f"{self.gap.min():.6g} m" if self.gap.size else "none"),
            ("energy", f"{self.total[0]:.6g} J -> {self.total[-1]:.6g} J, {loss:.3g} J less"),
        ]
        if self.effort.message:
            found.append(("method", self.effort.message))
        text = "force of lasting contact, of all constraints [N]"
        return card("Trajectory", found, parts=[curve(self.times, force, text)])

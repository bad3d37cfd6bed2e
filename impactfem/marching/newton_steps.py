"""What a step under finite strain has found, and what the steps of a layer sum up to."""

from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Booleans, Floats
from impactfem.marching.rubbing import in_space, told


@dataclass
class Step:
    """A step that was solved.

    Attributes:
        directions: Normals, with friction followed by tangents, (gaps, ways, dim).
        force: Along them [N], (gaps, ways).
        way: Increments along them [m], (gaps, ways).
        iterations: Of Newton's method.
        shift: Ways of the obstacles [m], (gaps, dim).
        massive: Pressed gaps whose nodes all have mass, (gaps,).
        left: Normal forces at its end [N], (gaps,); after impacts none.
        struck: Those of them in which nodes arrived with a speed, or others did at once, (gaps,).
        sticks: Gaps that are shut and do not slip, (gaps,); None without static friction.
        turned: Work of moments that resist rolling and spinning [J], (gaps,); 0 without any.
        braked: Work of dashpots beside springs [J].
    """

    directions: Floats
    force: Floats
    way: Floats
    iterations: int
    shift: Floats
    massive: Booleans
    struck: Booleans
    left: Floats
    sticks: Booleans | None = None
    turned: Floats | float = 0.0
    braked: float = 0.0


class LayerSums:
    """What the steps of a layer sum up to.

    Attributes:
        impulse: Of the normal forces [N s], (gaps,).
        vectors: Of all forces [N s], (gaps, dim).
        rubbed: Of friction, as `told` has it [N s], (gaps, 1 or 3).
        slid: Ways while pressed [m], (gaps,).
        friction, obstacles: Work of friction and of moving obstacles on the bodies [J].
        struck: Gaps with impacts between nodes with mass, (gaps,).
        impacts: What impacts have taken, and what rubs in them [J], <= 0.
        braked: What dashpots beside springs have taken [J], <= 0.
        iterations: Of Newton's method.
    """

    def __init__(self, gaps: int, dim: int) -> None:
        self.impulse, self.vectors = np.zeros(gaps), np.zeros((gaps, dim))
        self.rubbed, self.slid = np.zeros((gaps, dim * (dim - 1) // 2)), np.zeros(gaps)
        self.friction, self.obstacles, self.iterations = 0.0, 0.0, 0
        self.struck, self.impacts = np.zeros(gaps, dtype=bool), 0.0
        self.braked = 0.0

    def add(self, step: Step, span: float) -> None:
        """A step of so many seconds."""
        vectors = in_space(step.directions, step.force)
        self.impulse += span * step.force[:, 0]
        self.vectors += span * vectors
        self.obstacles += float((vectors * step.shift).sum())
        self.iterations += step.iterations
        self.braked += step.braked
        self.struck |= step.struck
        work = step.force * step.way
        rubbing = work[:, 1:].sum(axis=1) + step.turned
        self.impacts += float(work[step.massive, 0].sum() + rubbing[step.struck].sum())
        if step.force.shape[1] > 1:
            self.friction += float(rubbing[~step.struck].sum())
            acting, way = told(step.directions, step.force, step.way[:, 1:])
            self.rubbed += span * acting[:, 1:]
            self.slid += np.where(step.force[:, 0] > 0.0, way, 0.0)

    def join(self, other: "LayerSums") -> None:
        """Those of later steps."""
        for name, value in vars(other).items():
            setattr(self, name, getattr(self, name) + value)

    def beside(self, other: "LayerSums") -> "LayerSums":
        """With those of other gaps behind them."""
        found = LayerSums(0, self.vectors.shape[1])
        for name, value in vars(self).items():
            more = getattr(other, name)
            arrays = isinstance(value, np.ndarray)
            setattr(found, name, np.concatenate([value, more]) if arrays else value + more)
        return found

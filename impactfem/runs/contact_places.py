"""Where contact forces act, and their moments about the first body of each pair."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.marching.layers import ContactGaps
from impactfem.marching.rows import Level
from impactfem.marching.time_loop import TimeLoop
from impactfem.models.solids import SolidsModel
from impactfem.result.history import MOST_PAIRS
from impactfem.result.whole import Whole
from impactfem.runs.contacts import Contacts
from impactfem.scene.pairing import named_body_pairs

_MANY = 256  # levels that are summed up at once


class _Seen(NamedTuple):
    """A level with forces: of its entries (see `ContactGaps.entries`) and of gaps with forces."""

    layer: int
    gap: Integers
    node: Integers
    weight: Floats
    pair: Integers
    force: Floats
    vector: Floats
    moved: Floats
    spin: Floats


@dataclass(frozen=True)
class ContactPlaces:
    """Observer that sums up places and moments of the forces of each pair, layer by layer.

    Places are those of the contact nodes, of balls and axes their middle: there the forces act on
    their motion, and normal ones push through it. A moment is the power of the forces with a unit
    spin of the body: with the arms that its angular momentum has.

    Attributes:
        march: Its rows take the sums.
        gaps: Of the march.
        places: Of the contact nodes, to which displacements are added [m], (nodes, dim).
        bodies: Body of each contact node, (nodes,).
        first: First body of each pair, (pairs,).
        start: Where each pair is nearest at t = 0 [m], (pairs, dim).
        every: Layers after which the rows have to be complete.
        seen: Levels that are not in the rows yet.
    """

    march: TimeLoop[Any]
    gaps: ContactGaps
    places: Floats
    bodies: Integers
    first: Integers
    start: Floats
    every: int
    seen: list[_Seen] = field(default_factory=list)

    @classmethod
    def of(
        cls, march: TimeLoop[Any], gaps: ContactGaps, contacts: Contacts, model: SolidsModel
    ) -> "ContactPlaces | None":
        """Prepare at t = 0; the rows of the march get room (collective).

        None where pairs have no columns.
        """
        if not 0 < len(march.pairs) <= MOST_PAIRS:
            return None
        dim, names = model.dim, {name: k for k, name in enumerate(model.names)}
        leading = {
            label: one
            for pair in contacts.pairs
            for label, (one, _) in zip(pair.labels, pair.names, strict=True)
        }
        leading |= {name: one for name, (one, _), _ in named_body_pairs(model.scene)}
        for each in contacts.obstacles:
            # Solids that can reach nothing have no gaps, but pairs.
            own_name = each.names[0][0] if each.names else model.names[each.part]
            leading |= dict.fromkeys(each.gaps.pairs, own_name)
        counts, bodies = [len(numbers) for numbers in model.numbers], len(model.parts)
        own = [np.repeat(np.arange(bodies), counts[:bodies])]
        for few in model.few:
            own.append(bodies + few.body)
            bodies += len(few.names)
        found = cls(
            march, gaps, contacts.places, np.concatenate(own),
            np.array([names[leading[name]] for name in march.pairs]),
            np.array([model.masses[leading[name]][1] for name in march.pairs]),
            model.scene.output.checkpoint or march.layers,
        )  # fmt: skip
        found._look(march.contact.gap)
        rows, pairs = march.layers + 1, len(march.pairs)
        march.rows.place = np.zeros((rows, pairs, dim))
        march.rows.moment = np.zeros((rows, pairs, len(march.interior.spins())))
        return found

    def _look(self, gap: Floats) -> None:
        """Find where pairs are nearest, where that is known."""
        interior, pair = self.march.interior, self.gaps.pair_of()
        place = self.places + interior.surface_displacement + self.march.contact.static
        for k, body in enumerate(self.first):
            mine = np.flatnonzero(pair == k)
            least = gap[mine].min(initial=np.inf)
            at, node, weight = self.gaps.entries(mine[gap[mine] <= least + self.march.tolerance])
            own = np.where(self.bodies[node] == body, weight, 0.0)
            whole = np.rint(np.bincount(at, own))[at] if len(at) else own
            share = np.where(whole == 0.0, np.abs(own), whole * own)
            if share.any():
                self.start[k] = share @ place[node] / share.sum()

    def __call__(self, level: Level) -> None:
        """Keep what is needed of a level with forces."""
        acting = np.flatnonzero(level.force > 0.0)
        if len(acting):
            gap, node, weight = self.gaps.entries(acting)
            spins = self.march.interior.spins()
            seen = _Seen(
                level.layer, gap, node, weight, self.gaps.pair_of()[acting], level.force[acting],
                level.forces[acting], level.surface[node], spins[:, node],
            )  # fmt: skip
            self.seen.append(seen)
        if len(self.seen) >= _MANY or level.layer % self.every == 0:
            self.sum_up()

    def sum_up(self) -> None:
        """Put sums of the levels kept into the rows, and forget these."""
        if not self.seen:
            return
        layers, gaps, *each = zip(*self.seen, strict=True)
        counts = [len(seen.pair) for seen in self.seen]
        first = np.repeat(np.cumsum(counts) - counts, [len(gap) for gap in gaps])
        gap, (nodes, weights, pairs, forces, vectors, moved) = (
            np.concatenate(gaps) + first, map(np.concatenate, each[:-1])
        )  # fmt: skip
        spins = np.concatenate(each[-1], axis=1)
        weight = np.where(self.bodies[nodes] == self.first[pairs[gap]], weights, 0.0)
        # Those of a side sum up to 1 where it carries the forces, else to -1; where a body meets
        # itself, both sides to 0: the place is that on the side that carries.
        whole = np.rint(np.bincount(gap, weight, len(pairs)))[gap]
        amount = np.where(whole == 0.0, np.maximum(weight, 0.0), whole * weight) * forces[gap]
        power = np.einsum("ned,ed->en", spins, weight[:, None] * vectors[gap])
        rows, count = self.march.rows, len(self.first)
        at = (np.repeat(np.arange(len(layers)) * count, counts) + pairs)[gap]
        for into, values in (
            (rows.place, amount[:, None] * (self.places[nodes] + moved)), (rows.moment, power)
        ):  # fmt: skip
            for k, column in enumerate(values.T):
                found = np.bincount(at, column, len(layers) * count)
                into[list(layers), :, k] = found.reshape(-1, count)
        self.seen.clear()

    def course(self, pair: int, force: Floats, place: Floats, whole: Whole, body: Floats) -> Floats:
        """Place of the forces of a pair at all levels [m], (rows, dim).

        Without a force it goes along with the body's centre, as it lay to that at the last contact,
        before the first one as the pair was nearest at t = 0.

        Args:
            pair: Which one.
            force: Its normal forces, impacts included [N], (rows,).
            place: Its row sums [N m], (rows, dim).
            whole: What the solids are parts of.
            body: Places of the centre of its first body [m], (rows, dim).
        """
        touching = force > 0.0
        along = np.divide(place, force[:, None], where=touching[:, None], out=np.zeros_like(place))
        along, start = whole.mean_place(along) - body, whole.mean_place(self.start[pair]) - body[0]
        last = np.maximum.accumulate(np.where(touching, np.arange(len(force)), -1))
        return np.asarray(body + np.where(last[:, None] < 0, start, along[last]))

"""Columns of the last level of a march, while it goes on."""

from collections.abc import Mapping
from dataclasses import fields

import numpy as np

from impactfem.contact.followed_pair import FAR
from impactfem.marching.collect import total
from impactfem.marching.rows import Rows
from impactfem.result.history import Columns, PairMotion, make_history
from impactfem.runs.observed import Observed
from impactfem.runs.solid_bodies import body_motions, momentum_direction
from impactfem.scene.controllers import CUMULATIVE


def latest(seen: Observed, *, turns: bool) -> Mapping[str, float]:
    """Those that sum up no levels before it, by name (collective).

    Args:
        seen: A march on its way.
        turns: Whether angles are wanted: of bodies whose spins sum up to them all levels count.
    """
    march, model, whole = seen.march, seen.model, seen.whole
    first = 0 if turns else march.layer
    rows = Rows(
        *(getattr(march.rows, e.name)[first : march.layer + 1] for e in fields(march.rows))
    ).times(whole.factor)
    each = whole.factor * total(model.comm, march.rows.sums[first : march.layer + 1])
    placed = [part.system.displacement for part in model.parts]
    if seen.loop.started is not None:
        placed = seen.loop.started.of_solids(model)
    attitudes = total(model.comm, rows.attitude)
    momentum, angular, bodies = body_motions(seen, each, attitudes, placed)
    pairs = {}
    for k, name in enumerate(march.pairs):
        gap = np.where(rows.pair_gap[:, k] < 0.5 * FAR, rows.pair_gap[:, k], np.nan)
        rubbed = rows.tangential[:, k] if rows.tangential.shape[1] else None
        pairs[name] = PairMotion(rows.pair_force[:, k], gap, rubbed)
    told = seen.probes.columns(total(model.comm, rows.probes))
    history = make_history(
        Columns(
            time=march.interior.dt * np.arange(first, march.layer + 1, dtype=np.float64),
            gap=np.where(rows.gap < 0.5 * FAR, rows.gap, np.nan),
            contact_force=rows.force,
            kinetic_energy=each[:, :, 0].sum(axis=1),
            elastic_energy=each[:, :, 1].sum(axis=1),
            potential_energy=np.zeros(len(each)),
            momentum=momentum,
            direction=momentum_direction(model),
            angular_momentum=angular,
            active=rows.active,
            bodies=bodies,
            pairs=pairs,
            probes=told,
        )
    )
    return {
        name: float(column.values[-1])
        for name, column in history.items()
        if not {name.partition(".")[0], name.rpartition(".")[2]} & {*CUMULATIVE}
    }

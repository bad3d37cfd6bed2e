"""What pairs of a march did, from the rows that it has left."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.followed_pair import FAR
from impactfem.marching.rows import Rows
from impactfem.marching.schemes import SolidScheme
from impactfem.marching.time_loop import TimeLoop
from impactfem.models.solids import SolidsModel
from impactfem.result.history import BodyMotion, PairMotion
from impactfem.result.whole import Whole
from impactfem.runs.contact_places import ContactPlaces
from impactfem.scene.pairing import named_body_pairs

Floats = NDArray[np.float64]


def pair_motions(
    model: SolidsModel,
    scheme: SolidScheme,
    march: TimeLoop[Any],
    rows: Rows,
    whole: Whole,
    touching: ContactPlaces | None,
    bodies: Mapping[str, BodyMotion],
) -> dict[str, PairMotion]:
    """What each pair does; arguments as of `solids_motion`, and the motions of the bodies."""
    if not march.pairs:
        return {}
    # Forces are those on the carrier, columns those on the first body of the pair.
    first = {name: one for name, (one, _), _ in named_body_pairs(model.scene)}
    turned = {pair.label for pair in model.pairs if pair.names[0] != first[pair.label]}
    turned |= {
        met.label for met in model.ball_meetings if met.carrier != first.get(met.label, met.carrier)
    }
    force = of_layers(scheme, rows.pair_force)
    all_forces = of_layers(scheme, rows.pair_force + rows.pair_impact / march.interior.dt)
    place, moments = of_layers(scheme, rows.place), of_layers(scheme, rows.moment)
    revolved = any(part.system.axisymmetric for part in model.parts)
    open_ = ~(rows.pair_gap < 0.5 * FAR)
    gap = np.where(open_, np.nan, rows.pair_gap)
    found = {}
    for k, name in enumerate(march.pairs):
        tangential = slip = None
        if rows.slip.shape[1]:
            # Images slide the other way along their tangents: in the plane they cancel.
            tangential = of_layers(scheme, rows.tangential[:, k])
            slip = np.cumsum(rows.slip[:, k])
            if tangential.shape[1] > 1:
                tangential = whole.mean(-tangential if name in turned else tangential)
            elif whole.planes:
                tangential, slip = np.zeros_like(tangential), np.zeros_like(slip)
        impulse = rows.pair_impact[:, k] if model.few else None
        center = moment = None
        if touching is not None:
            body = bodies[model.names[touching.first[k]]].position[:, : model.dim]
            center = touching.course(k, all_forces[:, k], place[:, k], whole, body)
            center[:, :1] *= not revolved  # what acts on one side acts on the other, too
            padding = 3 - moments.shape[2]
            moment = np.pad(moments[:, k], ((0, 0), (padding, 0)))
            moment = whole.mean_turn(moment)[:, padding:]
        found[name] = PairMotion(force[:, k], gap[:, k], tangential, slip, impulse, center, moment)
    return found


def of_layers(scheme: SolidScheme, forces: Floats) -> Floats:
    """Contact forces of each layer [N], of those that the march has left, (rows, ...)."""
    found = forces.copy()
    if scheme.massless and scheme.staggered:
        # The force found for a layer acts at its start: a layer has the mean of both its ends.
        found[1:-1] = 0.5 * (forces[1:-1] + forces[2:])
    return found

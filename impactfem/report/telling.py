"""Which moments of a motion pictures show: those that differ most, and those of contact."""

import numpy as np

from impactfem.arrays import Floats
from impactfem.report.skin import Skin, Snapshot
from impactfem.result import Record

_LOOKED = 48  # layers that are compared
_NODES = 400  # of each
_SEEN = 0.5  # share of the size: shorter ways count less than the change of the stress
_TOP = 0.99  # quantile of the stress that counts as the largest
_LEAST = 0.05  # change that counts as the largest if none is larger
_APART = 0.1  # least change from one picture to another, of the largest of the motion


def acting(result: Record) -> tuple[Floats, Floats]:
    """Contact force of the history, or impulses where contact is by impacts; and the times."""
    rows = result.rows
    found = np.nan_to_num(rows["contact_force"].values, posinf=0.0)
    impulse = rows.get("contact_impulse")
    if not found.any() and impulse is not None:
        found = np.nan_to_num(impulse.values, posinf=0.0)
    return rows["time"].values, found


def peak_layer(result: Record, times: Floats) -> int:
    """The layer nearest to the largest contact force."""
    at, force = acting(result)
    return int(np.abs(times - at[int(np.argmax(force))]).argmin())


def _musts(result: Record, times: Floats) -> list[int]:
    """Layers of the largest force, the start, the first contact and the end, in this order."""
    at, force = acting(result)
    last = len(times) - 1
    if not force.any():
        return [0, last]
    begins = at[int(np.argmax(force > 0.0))]
    first = int(np.clip(np.searchsorted(times, begins * (1.0 - 1e-9)), 0, last))
    return [peak_layer(result, times), 0, first, last]


def telling_snapshots(result: Record, skin: Skin, most: int) -> list[Snapshot]:
    """Snapshots that tell the motion, in the order of time.

    The largest force, the start, the first contact and the end, without those that look like one of
    these; then always what differs most from all that are chosen.

    Args:
        result: With fields.
        skin: Of its bodies.
        most: How many at most.
    """
    times = skin.fields.times
    musts = _musts(result, times)
    even = np.linspace(0, len(times) - 1, min(_LOOKED, len(times))).round().astype(int)
    layers = np.union1d(even, musts)
    looks = {
        int(k): _look(skin, snapshot)
        for k in layers
        if (snapshot := skin.snapshot(int(k))).is_finite
    }
    if not looks:
        return []
    layers = np.array(list(looks))
    features = _features(np.array(list(looks.values())), skin.size)
    chosen = list[int]()
    away = np.full(len(layers), np.inf)
    for must in [int(np.flatnonzero(layers == k)[0]) for k in musts if k in looks]:
        if away[must] > _APART:
            chosen.append(must)
            away = np.minimum(away, _distances(features, must))
    while len(chosen) < most and (not chosen or away.max() > _APART):
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, _distances(features, chosen[-1]))
    return [skin.snapshot(int(layers[k])) for k in sorted(chosen)]


def _look(skin: Skin, snapshot: Snapshot) -> Floats:
    """Places and stress of some nodes, shape (4, nodes)."""
    nodes = skin.nodes[:: max(1, len(skin.nodes) // _NODES)]
    return np.vstack([snapshot.place[nodes].T, snapshot.von_mises[nodes]])


def _features(looks: Floats, size: float) -> Floats:
    """Places and stress, the farthest from the start at a distance of 1; (layers, values)."""
    places, stress = looks[:, :3], looks[:, 3]
    way = float(np.linalg.norm(places - places[:1], axis=1).max())
    top = float(np.quantile(stress, _TOP)) or float(stress.max())
    parts = [
        (places / max(way, _SEEN * size)).reshape(len(looks), -1),
        np.minimum(stress / top, 1.0) if top else stress,
    ]
    found = np.concatenate(parts, axis=1)
    count = max(1, stress.shape[1])
    return np.asarray(found / max(_distances(found, 0).max(), _LEAST * np.sqrt(count)))


def _distances(features: Floats, chosen: int) -> Floats:
    return np.asarray(np.linalg.norm(features - features[chosen], axis=1))

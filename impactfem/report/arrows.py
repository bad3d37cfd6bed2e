"""Contact forces as arrows: one for each patch of nodes that are pressed."""

from collections.abc import Sequence

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers

SEEN = 0.01
"""Share of the largest arrow below which none is drawn."""

_ALIKE = 0.8  # share of the sum of the amounts that a resultant has at least, else it is split
_NEAR, _EQUAL = 0.12, 0.1  # share of the size, and of a force, up to which two are one
_SAME = 1e-6  # of the size: nodes nearer to a plane of symmetry lie on it


def resultants(
    forces: Floats,
    places: Floats,
    links: Sequence[Integers],
    mirrors: Sequence[tuple[int, float]] = (),
) -> Floats:
    """Resultants of the forces on patches, which do not depend on how fine a mesh is.

    A patch that is pressed all around, as a shaft in a tight hole, would have none: it is halved
    until its forces go about the same way.

    Args:
        forces: On nodes [N], shape (nodes, 3).
        places: Where they act [m], shape (nodes, 3).
        links: Nodes that are neighbours, as facets and lines, shape (links, nodes of a link) each.
        mirrors: Axis and coordinate [m] of planes of symmetry: images have their forces too, and a
            patch that reaches a plane is one with its image.

    Returns:
        Places and forces, shape (arrows, 2, 3).
    """
    amounts = np.linalg.norm(forces, axis=1)
    patches = _patches(amounts > 0.0, links)
    found = [part for patch in patches for part in _split(patch, forces, amounts, places)]
    size = float(np.ptp(places, axis=0).max(initial=0.0))
    arrows = []
    for part in found:
        weights = amounts[part] / amounts[part].sum()
        arrow = np.stack([weights @ places[part], forces[part].sum(axis=0)])
        own = [arrow]
        for axis, level in mirrors:
            across = [1.0 if k != axis else -1.0 for k in range(3)]
            if np.abs(places[part, axis] - level).min() <= _SAME * size:
                for each in own:
                    each[0, axis], each[1, axis] = level, 0.0
                    each[1] *= 2.0
                continue
            images = [each * across for each in own]
            for image in images:
                image[0, axis] += 2.0 * level
            own += images
        arrows += own
    return np.array(arrows).reshape(-1, 2, 3)


def once(arrows: Floats, size: float) -> Floats:
    """Each force once: without the reactions that bodies have to each other, and near ones joined.

    Args:
        arrows: As of `resultants`, those on the body that shall have them first.
        size: Of the bodies [m].

    Returns:
        The same without the second of two that are opposite and equal, (arrows, 2, 3); of several
        close to each other that go about the same way, the sum.
    """
    sums = list[Floats]()
    while len(arrows):
        first = arrows[0]
        along = arrows[:, 1] @ first[1]
        amounts = np.linalg.norm(arrows[:, 1], axis=1)
        joined = _near(arrows, first, size) & (along > _ALIKE * amounts * amounts[0])
        joined[0] = True
        weights = amounts[joined] / max(float(amounts[joined].sum()), 1e-300)
        sums.append(np.stack([weights @ arrows[joined, 0], arrows[joined, 1].sum(axis=0)]))
        arrows = arrows[~joined]
    found = np.array(sums).reshape(-1, 2, 3)
    kept = [
        not (
            _near(found[:k], one, size)
            & (np.linalg.norm(found[:k, 1] + one[1], axis=1) < _EQUAL * np.linalg.norm(one[1]))
        ).any()
        for k, one in enumerate(found)
    ]
    return np.asarray(found[np.array(kept, dtype=bool)])


def _near(arrows: Floats, one: Floats, size: float) -> Booleans:
    return np.asarray(np.linalg.norm(arrows[:, 0] - one[0], axis=1) < _NEAR * size)


def _patches(pressed: Booleans, links: Sequence[Integers]) -> list[Integers]:
    """Pressed nodes, those that are linked together."""
    label = np.arange(len(pressed))
    pairs = []
    for link in links:
        both = pressed[link]
        first = link[np.arange(len(link)), both.argmax(axis=1)]
        for k in range(link.shape[1]):
            mine = both[:, k]
            pairs.append(np.stack([first[mine], link[mine, k]], axis=1))
    joined = np.concatenate([np.empty((0, 2), dtype=np.int64), *pairs])
    while (label[joined[:, 0]] != label[joined[:, 1]]).any():
        least = label[joined].min(axis=1)
        np.minimum.at(label, joined.ravel(), np.repeat(least, 2))
    return [np.flatnonzero(pressed & (label == k)) for k in np.unique(label[pressed])]


def _split(patch: Integers, forces: Floats, amounts: Floats, places: Floats) -> list[Integers]:
    """Parts of a patch whose forces go about the same way."""
    whole = float(np.linalg.norm(forces[patch].sum(axis=0)))
    if len(patch) == 1 or whole >= _ALIKE * amounts[patch].sum():
        return [patch]
    arms = places[patch] - places[patch].mean(axis=0)
    along = arms @ np.linalg.svd(arms, full_matrices=False)[2][0]
    first = along < np.median(along)
    if not first.any() or first.all():
        return [patch]
    return [
        part
        for half in (patch[first], patch[~first])
        for part in _split(half, forces, amounts, places)
    ]

"""Starts that a penalised corner misleads: derived widths against penalised motions."""

import math

import numpy as np
import pytest
from corner import corner
from corner_share import both_act, depth, sector_share, way
from scipy.integrate import quad


@pytest.mark.parametrize(
    ("theta", "phi"),
    [(0.4 * math.pi, 0.2), (0.4 * math.pi, 0.9), (math.pi / 5, 0.1), (0.75 * math.pi, 1.2)],
)
def test_both_walls_act_within_the_derived_width_and_not_beside_it(theta, phi):
    k, width = 1e5, depth(theta, phi) / math.sqrt(1e5)
    for share, expected in ((1.0 - 1e-4, True), (1.0 + 1e-4, False)):
        b = share * width
        u, v = way(phi, b, 2.0 / math.sqrt(k) + b / math.tan(phi))
        assert both_act(corner(theta), u, v, 60.0 / math.sqrt(k), k) == expected


@pytest.mark.parametrize("theta", [0.3, 0.4 * math.pi, math.pi / 2, 2.5])
def test_the_mean_width_gives_the_share_whatever_the_angle(theta):
    kinks = [x for x in 0.5 * math.pi - theta * np.arange(6) if 0.0 < x < theta]
    mean = quad(lambda phi: depth(theta, phi), 0.0, theta, points=kinks or None)[0] / theta
    # Of starts in a unit sector (b_+ + b_-) / pi head past the vertex closer than b_+, b_-.
    assert sector_share(theta, 100.0) == pytest.approx(2.0 * mean / math.pi / 100.0, rel=1e-9)


def test_no_way_along_an_obtuse_wall_and_away_from_the_vertex_is_misled():
    assert depth(0.75 * math.pi, 1.7) == 0.0
    u, v = way(1.7, 1e-6, 0.02)
    assert not both_act(corner(0.75 * math.pi), u, v, 0.1, 1e5)

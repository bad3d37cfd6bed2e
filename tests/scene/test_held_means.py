"""Means over steps of what controllers hold."""

import pytest

from impactfem.scene import Formula, means
from impactfem.scene.grammar import Held, naming


def test_what_is_held_is_read_once_in_a_step_and_what_changes_beside_it_is_resolved(monkeypatch):
    held = Held()
    with naming({"out": ("held", held)}):
        still, moving = Formula("3*out - v/v", ("t", "v")), Formula("out*t", ("t",))
    mean, varying = means.StepMean(still), means.StepMean(moving)
    held.value = 2.0
    assert varying(1.0, 2.0) == pytest.approx(3.0, rel=1e-15)
    monkeypatch.setattr(means, "_resolved", None)  # looks at many times
    assert mean(0.0, 1.0, v=4.0) == 5.0
    held.value = -1.0
    assert mean(0.0, 1.0, v=4.0) == -4.0
    assert not abs(mean(1.0, 2.0, v=0.0)) < 1e300  # 0/0, as arrays have it

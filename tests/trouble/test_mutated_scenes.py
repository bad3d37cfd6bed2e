"""Mutated scenes, planned and begun in children with limits; `.ci/run` tries many more."""

import json
import sys
from pathlib import Path

import pytest
from trouble_process import started

SCRIPT = Path(__file__).with_name("mutated_scenes.py")
SCENES = 8


@pytest.mark.slow
def test_mutated_scenes_end_with_a_word_within_their_limits(tmp_path):
    folder = tmp_path / "scenes"
    with started(tmp_path, sys.executable, SCRIPT, folder, 0, SCENES, 300) as process:
        out, err = process.communicate(timeout=1200)
    told = [json.loads(line) for line in out.decode().splitlines()]
    assert process.returncode == 0, (err.decode()[-2000:], [one for one in told if one["wrong"]])
    assert len(told) > SCENES // 2  # on a slow machine
    # The generator makes scenes of all sorts: refused, trusted, doubted, and of most sources.
    words = [one["verdict"]["level"] if "verdict" in one else one["plan"] for one in told]
    assert min(words.count(word) for word in (2, "trust", "care")) > len(told) // 20
    assert len({one["scene"] for one in told}) > len(told) // 3


def test_a_word_that_is_wrong_is_seen():
    """The judge itself: what it must complain about."""
    sys.path.insert(0, str(SCRIPT.parent))
    from mutated_scenes import judged

    good = {"verdict": {"level": "trust"}, "error": {"force_l1": 0.1}}
    assert not list(judged(0, good))
    assert list(judged(3, good))
    assert list(judged(0, good | {"energy": [float("nan")]}))
    assert list(judged(0, {"verdict": {"level": "do_not_trust"}}))

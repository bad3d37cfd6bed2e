"""Clips of a ball put together anew: what is run meets their apexes."""

import re
from pathlib import Path

import pytest
from demo_process import script

SCRIPT = Path(__file__).parents[2] / "demos/motion_graph/script.py"


@pytest.mark.slow
def test_what_is_run_is_as_near_as_clips_are_alike(tmp_path):
    said = script(SCRIPT, tmp_path)
    jumps = [float(apart) for apart in re.findall(r"apexes (\S+) apart", said)]
    told = r"(\d+) hops .* most (\S+) m, speeds by (\S+) m/s, times by (\S+) s"
    hops, height, speed, late = map(float, re.search(told, said).groups())
    assert hops == 10
    assert 0.0 < max(jumps) < 0.1
    # A change of clips is off by so much, in sizes of .5 m and 1 m/s; feedback takes it back.
    assert height < 0.5 * max(jumps)
    assert speed < max(jumps)
    assert late < 0.05

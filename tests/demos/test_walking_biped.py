"""The biped that walks: as far as asked, on feet that stand."""

import re
from pathlib import Path

import pytest
from demo_process import script

pytest.importorskip("pinocchio")
pytest.importorskip("clarabel")

SCRIPT = Path(__file__).parents[2] / "demos/walking_biped/script.py"


@pytest.mark.slow
def test_it_walks_and_its_feet_stand(tmp_path):
    said = script(SCRIPT, tmp_path)
    slips = [float(slip) for slip in re.findall(r"slip at most (\S+) mm", said)]
    assert len(slips) == 2
    assert max(slips) < 1.0
    # Six steps of .2 m; each steers the centre of mass anew.
    assert float(re.search(r"way (\S+) m", said)[1]) == pytest.approx(1.2, abs=0.01)

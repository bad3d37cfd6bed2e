"""The study against closed forms and what must hold of any ball."""

import math
from pathlib import Path

import impactfem
import pytest

from rebound import Case, drop, rebound_angle, swing
from rebound.cli import main

COARSE = 2e-3


def test_a_ball_without_damping_returns_nearly_all_its_speed() -> None:
    result, found = drop(Case(0.2, 0.0, COARSE))
    assert 0.97 < found.restitution < 1.0  # the rest has gone into vibrations
    assert abs(found.energy_error) < 1e-6
    # The floor has turned the momentum: its impulse is m (v_in + v_out).
    before = -float(result.history["momentum"][0])
    impulse = before * (1.0 + found.restitution)
    assert result.summary["contact"]["impulse"] == pytest.approx(impulse, rel=1e-6)


def test_damping_takes_speed() -> None:
    _, soft = drop(Case(0.2, 5e-5, COARSE))
    _, hard = drop(Case(0.2, 0.0, COARSE))
    assert soft.restitution < hard.restitution - 0.05
    assert soft.height == pytest.approx(0.2 * soft.restitution**2)


def test_contact_lasts_as_long_as_hertz_says() -> None:
    _, found = drop(Case(0.2, 0.0, 1e-3))
    modulus = 1e7 / (1.0 - 0.4**2)
    mass = 1200.0 * 4.0 / 3.0 * math.pi * 0.02**3
    hertz = 2.87 * (mass**2 / (0.02 * modulus**2 * found.case.speed)) ** 0.2
    assert found.contact_time == pytest.approx(hertz, rel=0.1)


@pytest.mark.parametrize("restitution", [0.3, 0.8, 1.0])
def test_the_pendulum_rebounds_by_the_closed_form(restitution: float) -> None:
    motion = swing(0.7, restitution)
    assert motion.impacts is not None
    first, second = motion.impacts.time[:2]
    between = (motion.times > first) & (motion.times < second)
    highest = float(motion.position[between, 0].max())
    assert highest == pytest.approx(rebound_angle(0.7, restitution), rel=1e-4)


def test_the_command_saves_what_it_says(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--out", str(tmp_path), "--heights", "0.2", "--dampings", "0"]) == 0
    assert "restitution" in capsys.readouterr().out
    lines = (tmp_path / "rebound.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 2
    assert impactfem.Result.load(tmp_path / "last_case").summary["status"] == "completed"
    for name in ("rebound.png", "last_case.png", "methods.png"):
        assert (tmp_path / name).stat().st_size > 5000


def test_a_wrong_value_is_told_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--heights", "0.2", "--dampings", "-1"]) == 2
    assert "rayleigh_stiffness" in capsys.readouterr().err

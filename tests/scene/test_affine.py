"""Affine parts of formulas, and signals in time, against the formulas themselves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactfem.scene.affine import affine_parts
from impactfem.scene.formula import Formula
from impactfem.scene.signal import Signal

STATE = ("x", "vx")
VARIABLES = ("t", *STATE)

numbers = st.floats(-3, 3).map(lambda v: f"({v:.3f})")
of_time = st.sampled_from(["t", "cos(3*t + 1)", "sin(-2*t)", "exp(-t)", "t**2", "max(t, 1)"])


@st.composite
def affine(draw):
    terms = [draw(numbers), *(f"{draw(numbers)}*{name}" for name in STATE)]
    terms.append(f"{draw(numbers)}*{draw(of_time)}")
    terms.append(f"-({draw(of_time)} - {draw(numbers)}*x)/2")
    return " + ".join(draw(st.permutations(terms)))


@settings(max_examples=60, deadline=None)
@given(affine(), st.floats(0, 4), st.floats(-2, 2), st.floats(-2, 2))
def test_parts_make_up_the_formula(text, t, x, vx):
    formula = Formula(text, VARIABLES)
    coefficients, signal = affine_parts(formula, STATE)
    whole = coefficients[0] * x + coefficients[1] * vx + float(signal(t))
    assert whole == pytest.approx(float(formula(t=t, x=x, vx=vx)), abs=1e-10)


@pytest.mark.parametrize(
    "text", ["x*vx", "x**2", "t*x", "sin(x)", "1/x", "abs(vx)", "where(x < 1, 1, 0)", "2**x"]
)
def test_other_formulas_have_none(text):
    assert affine_parts(Formula(text, VARIABLES), STATE) is None


@pytest.mark.parametrize(
    ("text", "exact"),
    [("5*cos(50*t)", True), ("3 - 2*t", True), ("sin(t)*sin(t)", False), ("exp(t)", False)],
)
def test_known_forms_are_recognised(text, exact):
    assert affine_parts(Formula(text, VARIABLES), STATE)[1].is_exact is exact


def test_derivatives_of_a_signal():
    signal = affine_parts(Formula("2 - t + 3*cos(2*t) + exp(-t)", VARIABLES), STATE)[1]
    t = np.linspace(0.1, 3, 7)
    assert signal.rate(t) == pytest.approx(-1 - 6 * np.sin(2 * t) - np.exp(-t), abs=1e-9)
    assert signal.curvature(t) == pytest.approx(-12 * np.cos(2 * t) + np.exp(-t), abs=1e-6)


def test_sum_of_signals_joins_equal_frequencies():
    both = Signal(harmonics=((2.0, 1.0, 0.5),)).plus(Signal(harmonics=((2.0, -1.0, 0.5),)))
    assert both.harmonics == ((2.0, 0.0, 1.0),)
    assert Signal(harmonics=((2.0, 1.0, 0.0),)).times(0.0).is_zero


def test_variables_that_occur():
    assert Formula("x + 0*min(t, vx)", VARIABLES).used == {"x", "t", "vx"}
    assert Formula("3", VARIABLES).used == frozenset()

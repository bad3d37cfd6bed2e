"""Formulas: values, shapes, other namespaces, and comparison with Python's own evaluation."""

import math
import pickle
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactfem.errors import SceneError
from impactfem.scene import Formula
from impactfem.scene.grammar import FUNCTIONS, NUMPY_FUNCTIONS


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 - 2 - 3", -4),
        ("12/2/3", 2),
        ("2 + 3*4", 14),
        ("(2 + 3)*4", 20),
        ("2**3**2", 512),
        ("-2**2", -4),
        ("(-2)**2", 4),
        ("2**-1", 0.5),
        ("--x", 0.25),
        ("+x", 0.25),
        ("x**0.5", 0.5),
        ("(x + 1)**2*4", 6.25),
        ("sin(pi/2)", 1),
        ("log(e)", 1),
        ("sqrt(x)", 0.5),
        ("abs(-x)", 0.25),
        ("min(3, x, 1)", 0.25),
        ("max(3, x, 1)", 3),
        ("where(x < 0.5, 1, 2)", 1),
        ("where(x > 0.25, 1, 2)", 2),
        ("where(x >= 0.25, 1, 2)", 1),
        ("where(0 < x <= 0.25, 1, 2)", 1),
        ("where(0 < x < 0.25 < 3, 1, 2)", 2),
        ("where(1 < 2, x, 3)", 0.25),
        ("where(2 < 1 < x, x, 3)", 3),
        ("where(x < 1, where(x < 0.2, 1, 2), 3)", 2),
        ("1e-3 + 1_000*0", 0.001),
        ("0x10", 16),
        ("(\n1 +\n2)", 3),
        ("asin(1) + acos(1) + atan(0)", math.pi / 2),
        ("sinh(0) + cosh(0) + tanh(0) + exp(0) + cos(0) + tan(0)", 3),
        ("+".join(["x"] * 400), 100),
    ],
)
def test_values(text, value):
    assert Formula(text)(x=0.25) == pytest.approx(value, rel=1e-13)
    assert Formula(text).number({"x": 0.25, "y": 1.0}) == pytest.approx(value, rel=1e-13)


@pytest.mark.parametrize(
    "text",
    ["1/x", "x**-0.5", "(-1 - x)**0.5", "abs((-1 - x)**0.5)", "exp(1000 + x)", "log(x)",
     "sqrt(-1 - x)", "min(x/x, 1)", "max(1, x*1e308*1e308)",
     "(9 + abs(x))*1e308 - (9 + abs(x))*1e308",
     "where(x < 1, 1/x, 2)", "where(x > 1, 1/x, 2)", "asin(2 + x)", "cosh(1e4 + x)"],
)  # fmt: skip
@pytest.mark.parametrize("x", [0.0, -0.0, 1e-300, -3.0, 2.0])
def test_numbers_that_are_not_finite_are_those_of_arrays(text, x):
    formula = Formula(text)
    assert formula.number({"x": x}) == pytest.approx(formula(x=x), rel=1e-14, nan_ok=True)


@pytest.mark.parametrize("name", [n for n in FUNCTIONS if n not in {"where", "min", "max"}])
def test_functions_of_one_argument_agree_with_numpy(name):
    x = np.linspace(0.1, 0.9, 5)
    np.testing.assert_array_equal(Formula(f"{name}(x)")(x=x), NUMPY_FUNCTIONS[name](x))


@pytest.mark.parametrize("shape", [(), (3,), (2, 3), (0,)])
@pytest.mark.parametrize("text", ["0.5", "x", "where(x < 1, 2, 3)", "x*y"])
def test_shapes(text, shape):
    formula = Formula(text, ("x", "y"))
    assert np.shape(formula(x=np.ones(shape), y=1.0)) == shape
    assert np.shape(formula(x=np.ones((4, *((1,) * len(shape)))), y=np.ones(shape))) == (4, *shape)


def test_result_is_a_new_array():
    x = np.arange(3.0)
    y = Formula("x")(x=x)
    y[0] = 7.0
    assert x[0] == 0.0


def test_integer_arrays_are_taken_as_floats():
    np.testing.assert_array_equal(Formula("x**-1")(x=np.array([1, 2])), [1, 0.5])


def test_values_that_are_not_finite_come_without_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        values = Formula("log(x) + 1/x + exp(1000*x) + sqrt(-x)")(x=[0.0, 1.0, -1.0])
    assert not np.isfinite(values).any()


def test_constant_or_not():
    assert Formula("2*pi").is_constant
    assert Formula("sin(1) + 2").is_constant
    assert not Formula("0*x").is_constant
    assert Formula("2*pi")() == 2 * math.pi


def test_other_variables():
    formula = Formula("t*vx + e", ("t", "vx", "e"))
    assert formula(t=2.0, vx=3.0, e=1.0) == 7.0
    with pytest.raises(SceneError, match="unknown name 'x'"):
        Formula("x", ("t",))


def test_missing_value():
    with pytest.raises(SceneError, match="variable 'x' is missing; give it"):
        Formula("x + 1")()


def test_functions_do_not_hinder_copies():
    formula = Formula("2*x")
    assert formula.number({"x": 3.0}) == 6.0
    again = pickle.loads(pickle.dumps(formula))  # noqa: S301
    assert again == formula
    assert again.number({"x": 3.0}) == 6.0


def test_equality_hash_and_repr():
    assert Formula(" x + 1 ") == Formula("x + 1")
    assert hash(Formula("x")) == hash(Formula("x"))
    assert Formula("x") != Formula("x+0")
    assert Formula("x") != Formula("x", ("x", "y"))
    assert eval(repr(Formula("x + 1"))) == Formula("x + 1")  # noqa: S307  # the repr of ours
    assert pickle.loads(pickle.dumps(Formula("sin(x)")))(x=0.0) == 0.0  # noqa: S301


@pytest.mark.parametrize("value", [0, 0.5, -3, 1e22, 1e-7, np.float64(0.1), np.int64(4)])
def test_numbers_stay_numbers(value):
    formula = Formula(value)
    assert formula.is_constant
    assert formula() == value
    assert formula.plain == value
    assert isinstance(formula.plain, float)
    assert Formula(formula.plain) == formula


@pytest.mark.parametrize("text", ["0", "1e3", "2*pi", "x", "-x"])
def test_texts_stay_texts(text):
    assert Formula(text).plain == text


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 10**400, None, True, [1], b"x"])
def test_other_values_are_refused(value):
    with pytest.raises(SceneError, match="give"):
        Formula(value)


def test_plus():
    assert Formula("x")(x=2.0) + 0.5 == Formula("x").plus(0.5)(x=2.0)
    assert Formula("2").plus(0.5) == Formula("2.5")


class TestOtherNamespaces:
    """The same tree evaluated by other functions."""

    def test_only_what_is_used_is_needed(self):
        assert Formula("2*x + 1").apply({}, x=3.0) == 7.0
        with pytest.raises(SceneError, match="'sin' cannot be used here"):
            Formula("sin(x)").apply({}, x=3.0)

    def test_calls(self):
        class Recorder(dict):
            def __missing__(self, name):
                return lambda *args: f"{name}({', '.join(map(str, args))})"

            def __contains__(self, name):
                return True

        text = "where(0 <= x < 1, min(x, 2, 3), exp(x))"
        expected = "where(le(0.0, x), where(lt(x, 1.0), min(min(x, 2.0), 3.0), exp(x)), exp(x))"
        assert Formula(text).apply(Recorder(), x="x") == expected
        assert Formula("where(x > 1, 1, where(x >= 0, x, abs(x)))").apply(Recorder(), x="x") == (
            "where(gt(x, 1.0), 1.0, where(ge(x, 0.0), x, abs(x)))"
        )

    def test_a_variable_may_be_called_functions(self):
        assert Formula("functions", ("functions",)).apply({}, functions=2.0) == 2.0

    def test_ufl(self):
        ufl = pytest.importorskip("ufl")
        functions = {
            "sin": ufl.sin,
            "where": ufl.conditional,
            "lt": ufl.lt,
            "le": ufl.le,
            "min": ufl.min_value,
        }
        x = ufl.variable(ufl.as_ufl(0.25))
        text = "where(0 <= x < 0.5, sin(x)**2 - x/3, min(x, 1))"
        value = Formula(text).apply(functions, x=x)
        assert value(()) == pytest.approx(Formula(text)(x=0.25), rel=1e-14)


def where(condition, a, b):
    return a if condition else b


NUMBERS = st.sampled_from(["0", "1", "2.5", "3", "0.125", "1e-3", "7", "x", "y", "pi"])
MODERATE = st.floats(-3, 3).filter(lambda x: x == 0 or abs(x) > 1e-6)  # no overflow from 1/x
POWERS = st.builds("{}**{}".format, st.integers(1, 5), st.integers(0, 3))


def combine(parts):
    return st.one_of(
        st.builds("{} {} {}".format, parts, st.sampled_from("+-*/"), parts),
        st.builds("({})".format, parts),
        st.builds("-{}".format, parts),
        st.builds("{}({})".format, st.sampled_from(["abs", "sqrt"]), parts),
        st.builds("{}({}, {})".format, st.sampled_from(["min", "max"]), parts, parts),
        st.builds(
            "where({} {} {}, {}, {})".format,
            parts,
            st.sampled_from(["<", "<=", ">", ">="]),
            parts,
            parts,
            parts,
        ),
        # Python skips the last operand when the first comparison fails: nothing in it may fail.
        st.builds("where({} < {} <= {}, {}, 1)".format, parts, parts, NUMBERS, parts),
    )


@settings(deadline=None)
@given(st.recursive(NUMBERS | POWERS, combine, max_leaves=12), MODERATE, MODERATE)
def test_arithmetic_agrees_with_python(text, x, y):
    """All operations here are exactly rounded, so values agree to the last digit."""
    names = {"abs": abs, "sqrt": math.sqrt, "min": min, "max": max, "where": where, "pi": math.pi}
    try:
        # The text comes from the grammar above.
        expected = eval(text, {"__builtins__": {}}, names | {"x": x, "y": y})  # noqa: S307
    except (ZeroDivisionError, ValueError, OverflowError):
        expected = None
    try:
        value = Formula(text, ("x", "y"))(x=x, y=y)
    except SceneError as error:
        value, why = None, str(error)
    if value is None:
        assert "constant part" in why
        assert expected is None
    # Where Python fails (division by zero), numpy may still have a value: 1/(1/0) is 0.
    else:
        assert expected is None or value == expected
        alone = Formula(text, ("x", "y")).number({"x": x, "y": y})
        assert alone == pytest.approx(value, rel=1e-13, nan_ok=True)


ALPHABET = st.sampled_from("x0123456789.+-*/()<>=, _ewsinlogabmxhr")
WORDS = """
x 1 2.5 1e400 1j 0x 0b ( ) + - * / ** < , . = := [ ] ' " \\ # sin where min lambda
if else for in not and await yield __class__
"""
TOKENS = st.sampled_from([*WORDS.split(), " ", "\n", "\0", "\u00b5", "\uff11"])


@pytest.mark.slow
@settings(deadline=None, max_examples=400)
@given(
    st.one_of(
        st.text(max_size=60),
        st.text(ALPHABET, max_size=60),
        st.lists(TOKENS, max_size=40).map("".join),
        st.lists(TOKENS, max_size=40).map(" ".join),
    )
)
def test_any_text_is_a_formula_or_a_scene_error(text):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            formula = Formula(text)
        except SceneError as error:
            message = str(error)
        else:
            message = ""
            values = formula(x=np.linspace(-1, 1, 5))
    if message:
        assert message.isprintable()
        return
    assert values.shape == (5,)
    assert values.dtype == float
    assert Formula(formula.plain) == formula

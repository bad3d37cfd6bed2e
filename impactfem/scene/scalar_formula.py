"""Formulas of single numbers by Python's own arithmetic: fifty times faster than arrays of one.

An integrator asks for forces at one state after the other.
"""

import math
import operator
from collections.abc import Callable, Mapping

from impactfem.scene.grammar import OPERATORS, Node

Values = Mapping[str, float]
Scalar = Callable[[Values], float]


def _power(base: float, exponent: float) -> float:
    found = base**exponent
    if isinstance(found, complex):
        raise ValueError  # NumPy has no number there
    return float(found)


def _least(one: float, other: float) -> float:
    return one if one <= other else other if other < one else math.nan


def _most(one: float, other: float) -> float:
    return one if one >= other else other if other > one else math.nan


_OPERATORS = {**OPERATORS, "Pow": _power}
_ONE = {
    **{name: getattr(math, name) for name in ("sin", "cos", "tan", "asin", "acos", "atan")},
    **{name: getattr(math, name) for name in ("sinh", "cosh", "tanh", "exp", "log", "sqrt")},
    "abs": abs,
}
_TWO = {
    "min": _least, "max": _most, "lt": operator.lt, "le": operator.le, "gt": operator.gt,
    "ge": operator.ge,
}  # fmt: skip


def scalar(tree: Node, otherwise: Scalar) -> Scalar:
    """A formula as a function of single numbers by name.

    Args:
        tree: Its tree.
        otherwise: What is asked where Python has no finite number.
    """
    inner = _made(tree)

    def value(values: Values) -> float:
        try:
            found = inner(values)
        except (ArithmeticError, ValueError):
            found = math.nan
        return found if math.isfinite(found) else otherwise(values)

    return value


def _made(node: Node) -> Scalar:
    match node:
        case float():
            return lambda _: node
        case ("variable", name):
            return operator.itemgetter(name)
        case ("negative", operand):
            inner = _made(operand)
            return lambda values: -inner(values)
        case ("chain", first, steps):
            begin, rest = _made(first), [(_OPERATORS[name], _made(each)) for name, each in steps]

            def chain(values: Values) -> float:
                found = begin(values)
                for act, operand in rest:
                    found = act(found, operand(values))
                return found

            return chain
        case ("call", name, args):
            return _called(name, [_made(each) for each in args])
    raise TypeError(f"unknown node {node!r}")


def _called(name: str, args: list[Scalar]) -> Scalar:
    if name == "where":
        asked, one, other = args
        return lambda values: one(values) if asked(values) else other(values)
    if name in _TWO:
        of_two, (left, right) = _TWO[name], args
        return lambda values: of_two(left(values), right(values))
    of_one, (argument,) = _ONE[name], args
    return lambda values: of_one(argument(values))

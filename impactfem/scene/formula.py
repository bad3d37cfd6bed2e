"""Formulas in text form: parsed against a whitelist, evaluated by walking the tree, never by `eval`."""

import ast
import operator
import re
import unicodedata
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from impactfem.errors import SceneError

MAX_LENGTH = 1000
MAX_DEPTH = 50
CONSTANTS: Mapping[str, float] = {"pi": np.pi, "e": np.e}

# What a namespace given to `Formula.apply` may have to provide, here for numpy.
NUMPY_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "sinh": np.sinh,
    "cosh": np.cosh,
    "tanh": np.tanh,
    "exp": np.exp,
    "log": np.log,
    "sqrt": np.sqrt,
    "abs": np.abs,
    "min": np.minimum,
    "max": np.maximum,
    "where": np.where,
    "lt": np.less,
    "le": np.less_equal,
    "gt": np.greater,
    "ge": np.greater_equal,
}
COMPARISONS: Mapping[type, str] = {ast.Lt: "lt", ast.LtE: "le", ast.Gt: "gt", ast.GtE: "ge"}
FUNCTIONS = tuple(name for name in NUMPY_FUNCTIONS if name not in COMPARISONS.values())

_OPERATORS: Mapping[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_OPERATOR_HINTS: Mapping[type, str] = {
    ast.BitXor: "write a power as **, not ^",
    ast.FloorDiv: "write / instead of //",
    ast.Mod: "the remainder % is not available",
}
_CHARACTER_HINTS: Mapping[str, str] = {
    "^": "write a power as **",
    "\u2212": "write the minus sign as -",
    "\u2013": "write the minus sign as -",
    "\u00b7": "write a product as *",
    "\u00d7": "write a product as *",
    "\u00b2": "write the square as **2",
    "\u03c0": "write pi",
    "%": "the remainder is not available",
}
_ALLOWED_CHARACTERS = re.compile(r"[0-9A-Za-z_+\-*/().,<>=! \t\n]")

# A node is a number, or a tuple whose first entry tells its form:
#   ("variable", name), ("call", name, args), ("negative", a), ("power", a, b),
#   ("chain", first, ((operator, operand), ...)): sums and products, evaluated left to right.
type _Node = float | tuple[Any, ...]


class FormulaError(SceneError):
    """A text is not an allowed formula; `why` is the reason without the text."""

    def __init__(self, text: str, why: str) -> None:
        shown = text if len(text) <= 60 else text[:57] + "..."
        super().__init__(f"formula {shown!r}: {why}")
        self.why = why


@dataclass(frozen=True)
class Formula:
    """A formula of some variables, e.g. ``Formula("-0.5 + 0.1*sin(pi*x)")``.

    Allowed are numbers, ``+ - * / **``, parentheses, the variables, the constants ``pi`` and ``e``, the functions
    of `FUNCTIONS`, and comparisons ``< <= > >=`` (also chained) as first argument of ``where(condition, a, b)``.
    Formulas are equal when their text and variables are.

    Attributes:
        text: the formula; a number given instead becomes its text.
        variables: names that may occur in it.

    Raises:
        SceneError: the text is not an allowed formula, or a constant part of it is not finite (``1/0``).
    """

    text: str
    variables: tuple[str, ...] = ("x",)
    _tree: _Node = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        given: object = self.text
        if isinstance(given, int | float | np.integer | np.floating) and not isinstance(
            given, bool
        ):
            text = _number_text(given)
        elif isinstance(given, str):
            text = given.strip()
        else:
            raise FormulaError(repr(given), "a formula is a number or a text")
        object.__setattr__(self, "text", text)
        object.__setattr__(self, "variables", tuple(self.variables))
        object.__setattr__(self, "_tree", _Parser(text, self.variables).parse())

    @property
    def is_constant(self) -> bool:
        """Whether no variable influences the value."""
        return isinstance(self._tree, float)

    @property
    def plain(self) -> float | str:
        """The value to write into a scene file: a number when the text is one, otherwise the text."""
        try:
            number = float(self.text)
        except ValueError:
            return self.text
        return number if repr(number) == self.text else self.text

    def plus(self, offset: float) -> "Formula":
        """Return this formula plus a number."""
        if self.is_constant:
            return Formula(repr(float(self()) + offset), self.variables)
        shifted = object.__new__(Formula)  # a long text may pass the limit that holds for users
        object.__setattr__(shifted, "text", f"{offset!r} + ({self.text})")
        object.__setattr__(shifted, "variables", self.variables)
        object.__setattr__(shifted, "_tree", ("chain", float(offset), (("Add", self._tree),)))
        return shifted

    def __call__(self, **values: ArrayLike) -> Any:
        """Evaluate with numpy.

        Args:
            values: one number or array per variable; variables that do not occur may be left out.

        Returns:
            Floats of the broadcast shape of all values (a number for numbers). Where the formula has no finite
            value the result is inf or nan, without a warning.
        """
        arrays = {name: np.asarray(value, dtype=float) for name, value in values.items()}
        shape = np.broadcast_shapes(*(array.shape for array in arrays.values()))
        with np.errstate(all="ignore"):
            result = self.apply(NUMPY_FUNCTIONS, **arrays)
        return np.array(np.broadcast_to(np.asarray(result, dtype=float), shape))[()]

    def apply(self, functions: Mapping[str, Callable[..., Any]], **values: Any) -> Any:  # noqa: ANN401
        """Evaluate with the functions of another library, e.g. UFL.

        Args:
            functions: by name, those of `FUNCTIONS` and the comparisons ``lt, le, gt, ge`` that the formula uses;
                ``min`` and ``max`` are called with two arguments. Arithmetic uses Python's operators.
            values: the value of each variable.

        Raises:
            SceneError: a function or the value of a variable is not given.
        """
        return self._walk(self._tree, functions, values)

    def _walk(
        self, node: _Node, functions: Mapping[str, Callable[..., Any]], values: Mapping[str, Any]
    ) -> Any:  # noqa: ANN401
        if not isinstance(node, tuple):
            return node
        match node:
            case ("variable", name):
                if name not in values:
                    raise FormulaError(self.text, f"no value was given for the variable {name!r}")
                return values[name]
            case ("negative", operand):
                return -self._walk(operand, functions, values)
            case ("chain", first, rest):
                result = self._walk(first, functions, values)
                for name, operand in rest:
                    result = _BY_NAME[name](result, self._walk(operand, functions, values))
                return result
        _, name, args = node
        if name not in functions:
            raise FormulaError(self.text, f"the function {name!r} is not available here")
        return functions[name](*(self._walk(arg, functions, values) for arg in args))


_BY_NAME: Mapping[str, Callable[[Any, Any], Any]] = {k.__name__: v for k, v in _OPERATORS.items()}


def _number_text(value: float | np.integer | np.floating) -> str:  # type: ignore[type-arg]
    try:
        number = float(value)
    except OverflowError:
        raise FormulaError(str(value), "the number is too large") from None
    if not np.isfinite(number):
        raise FormulaError(repr(number), "the number must be finite")
    return repr(number)


class _Parser:
    """Turns a text into a tree, refusing everything that is not on the whitelist."""

    def __init__(self, text: str, variables: tuple[str, ...]) -> None:
        self.text = text
        self.variables = variables

    def fail(self, why: str) -> FormulaError:
        return FormulaError(self.text, why)

    def parse(self) -> _Node:
        text = self.text
        if not text:
            raise self.fail("it is empty; write a number or a formula")
        if len(text) > MAX_LENGTH:
            raise self.fail(
                f"it has {len(text)} characters, at most {MAX_LENGTH} are allowed; shorten it"
            )
        self._check_characters()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # "1if" and the like warn before they fail
                tree = ast.parse(text, mode="eval")
        except SyntaxError as error:
            column = f" at column {error.offset}" if error.offset else ""
            raise self.fail(
                f"it is not a complete formula{column}; write products with * and close every parenthesis"
            ) from None
        except (RecursionError, MemoryError, ValueError, OverflowError):
            raise self.fail(
                "it is nested too deeply or has a number too long; simplify it"
            ) from None
        return self._convert(tree.body, 0)

    def _check_characters(self) -> None:
        """Refuse other characters first: Python would normalise lookalikes of letters silently."""
        depth = 0
        for column, character in enumerate(self.text, start=1):
            if not _ALLOWED_CHARACTERS.match(character):
                name = unicodedata.name(character, f"U+{ord(character):04X}").lower()
                shown = f"{character!r} ({name})" if not character.isascii() else repr(character)
                hint = _CHARACTER_HINTS.get(
                    character, "write numbers, names, + - * / ** ( ) and < <= > >= only"
                )
                raise self.fail(f"the character {shown} at column {column} is not allowed; {hint}")
            depth += (character == "(") - (character == ")")
            if depth > MAX_DEPTH:
                raise self.fail(f"it is nested more than {MAX_DEPTH} parentheses deep; simplify it")

    def _convert(self, node: ast.expr, depth: int) -> _Node:
        if depth > MAX_DEPTH:
            raise self.fail(f"it is nested more than {MAX_DEPTH} levels deep; simplify it")
        match node:
            case ast.Constant(value=value):
                return self._number(value)
            case ast.Name(id=name):
                return self._name(name)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=operand):
                inner = self._convert(operand, depth + 1)
                return inner if isinstance(sign, ast.UAdd) else self._fold(("negative", inner))
            case ast.BinOp():
                return self._binary(node, depth)
            case ast.Call():
                return self._call(node, depth)
            case ast.Compare() | ast.BoolOp() | ast.UnaryOp(op=ast.Not()):
                raise self.fail("a comparison may stand only as in where(x < 0.5, a, b)")
            case ast.Attribute():
                raise self.fail("a dot may stand only in numbers; attributes are not allowed")
            case ast.IfExp():
                raise self.fail("write where(condition, a, b) instead of a if condition else b")
            case ast.Tuple():
                raise self.fail(
                    "a comma may stand only between arguments; write numbers with a dot"
                )
        raise self.fail(
            f"{type(node).__name__.lower()} expressions are not allowed; use arithmetic only"
        )

    def _number(self, value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.fail(f"{str(value)[:40]!r} is not allowed; write real numbers only")
        try:
            number = float(value)
        except OverflowError:
            number = np.inf
        if not np.isfinite(number):
            raise self.fail("a number is too large; use numbers below 1.8e308")
        return number

    def _name(self, name: str) -> _Node:
        if name in self.variables:
            return ("variable", name)
        if name in CONSTANTS:
            return CONSTANTS[name]
        if name in FUNCTIONS:
            raise self.fail(f"the function {name!r} needs its argument in parentheses")
        raise self.fail(self._unknown(name, "name"))

    def _unknown(self, name: str, word: str) -> str:
        known = (*self.variables, *CONSTANTS, *FUNCTIONS)
        near = get_close_matches(name[:40], known, 1)
        meant = f"; did you mean {near[0]!r}?" if near else ""
        return (
            f"unknown {word} {name[:40]!r}{meant} (variables: {', '.join(self.variables)}; constants: "
            f"{', '.join(CONSTANTS)}; functions: {', '.join(FUNCTIONS)})"
        )

    def _binary(self, node: ast.BinOp, depth: int) -> _Node:
        rest: list[tuple[str, _Node]] = []
        first: ast.expr = node
        # A sum of many terms leans to the left: walking down that side keeps it flat.
        while isinstance(first, ast.BinOp) and (first is node or not isinstance(first.op, ast.Pow)):
            if type(first.op) not in _OPERATORS:
                hint = _OPERATOR_HINTS.get(type(first.op), "use + - * / **")
                raise self.fail(f"the operator {type(first.op).__name__} is not allowed; {hint}")
            rest.append((type(first.op).__name__, self._convert(first.right, depth + 1)))
            first = first.left
        result = self._convert(first, depth + 1)
        pending: list[tuple[str, _Node]] = []
        for entry in reversed(rest):
            if not pending and isinstance(result, float) and isinstance(entry[1], float):
                result = self._fold(("chain", result, (entry,)))
            else:
                pending.append(entry)
        return ("chain", result, tuple(pending)) if pending else result

    def _call(self, node: ast.Call, depth: int) -> _Node:
        if not isinstance(node.func, ast.Name):
            raise self.fail("only the named functions can be called; write products with *")
        name = node.func.id
        if name not in FUNCTIONS:
            raise self.fail(
                f"{name!r} is no function; write a product with *"
                if name in self.variables or name in CONSTANTS
                else self._unknown(name, "function")
            )
        if node.keywords or any(isinstance(arg, ast.Starred) for arg in node.args):
            raise self.fail(f"{name} takes plain arguments only")
        count = len(node.args)
        if name == "where":
            if count != 3:
                raise self.fail(f"where(condition, a, b) takes 3 arguments, not {count}")
            return self._where(node.args[0], node.args[1], node.args[2], depth)
        if name in {"min", "max"}:
            if count < 2:
                raise self.fail(f"{name}(a, b, ...) takes at least 2 arguments, not {count}")
        elif count != 1:
            more = " (log is the natural logarithm)" if name == "log" else ""
            raise self.fail(f"{name} takes 1 argument, not {count}{more}")
        args = [self._convert(arg, depth + 1) for arg in node.args]
        result = args[0] if count > 1 else self._fold(("call", name, tuple(args)))
        for arg in args[1:]:
            result = self._fold(("call", name, (result, arg)))
        return result

    def _where(self, condition: ast.expr, then: ast.expr, other: ast.expr, depth: int) -> _Node:
        if not isinstance(condition, ast.Compare):
            raise self.fail("the first argument of where must be a comparison such as x < 0.5")
        names = []
        for comparison in condition.ops:
            if type(comparison) not in COMPARISONS:
                raise self.fail("compare with < <= > >= only")
            names.append(COMPARISONS[type(comparison)])
        sides = [
            self._convert(side, depth + 1) for side in (condition.left, *condition.comparators)
        ]
        result = self._convert(then, depth + 1)
        otherwise = self._convert(other, depth + 1)
        # a < b < c becomes where(a < b, where(b < c, ...)): libraries need no logical "and".
        for name, left, right in reversed(list(zip(names, sides, sides[1:], strict=False))):
            if isinstance(left, float) and isinstance(right, float):
                result = result if NUMPY_FUNCTIONS[name](left, right) else otherwise
            else:
                result = ("call", "where", (("call", name, (left, right)), result, otherwise))
        return result

    def _fold(self, node: tuple[Any, ...]) -> _Node:
        """Evaluate a node whose operands are all numbers, refusing a value that is not finite."""
        match node:
            case ("negative", float(operand)):
                return -operand
            case ("chain", float(left), ((name, float(right)),)):
                with np.errstate(all="ignore"):
                    value = _BY_NAME[name](np.float64(left), np.float64(right))
            case ("call", name, args) if all(isinstance(arg, float) for arg in args):
                with np.errstate(all="ignore"):
                    value = NUMPY_FUNCTIONS[name](*args)
            case _:
                return node
        if not np.isfinite(value):
            raise self.fail(
                f"a constant part of it has no finite value ({float(value)}); correct it"
            )
        return float(value)

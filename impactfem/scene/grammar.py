"""Grammar of formulas: text becomes a tree against a whitelist; nothing is ever executed."""

import ast
import operator
import re
import unicodedata
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from impactfem.errors import SceneError
from impactfem.scene.nearest import nearest

MAX_LENGTH = 1000
MAX_DEPTH = 50
CONSTANTS: Mapping[str, float] = {"pi": np.pi, "e": np.e}

# By name, for numpy: everything a namespace given to `Formula.apply` may have to provide.
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
OPERATORS: Mapping[str, Callable[[Any, Any], Any]] = {
    "Add": operator.add,
    "Sub": operator.sub,
    "Mult": operator.mul,
    "Div": operator.truediv,
    "Pow": operator.pow,
}

_ALLOWED_CHARACTERS = re.compile(r"[0-9A-Za-z_+\-*/().,<>=! \t\n]")
_CHARACTER_HINTS: Mapping[str, str] = {
    "^": "write a power as **",
    "\u2212": "write the minus sign as -",
    "\u2013": "write the minus sign as -",
    "\u00b7": "write a product as *",
    "\u00d7": "write a product as *",
    "\u00b2": "write the square as **2",
    "\u03c0": "write pi",
    "%": "a remainder is not available",
}
_USE_ARITHMETIC = "use numbers, names, + - * / ** ( ) and, inside where, < <= > >= only"

# Why other expressions are refused.
_REFUSALS: Mapping[type, str] = {
    ast.Compare: "a comparison may stand only as in where(x < 0.5, a, b)",
    ast.BoolOp: "and, or, not are not available; put one where inside another",
    ast.Attribute: "a dot may stand only in numbers, attributes are not allowed; remove it",
    ast.IfExp: "write where(x < 0.5, a, b) instead of if and else",
    ast.Tuple: "a comma may stand only between arguments; write decimals with a dot",
}

# A node is a number or a tuple whose first entry tells its form:
# "variable" and its name; "held" and a number that others set; "table", a `Table` and an operand;
# "call", the name of a function and its arguments; "negative" and an operand; "chain", the first
# operand and pairs of operator and operand, taken from left to right.
type Node = float | tuple[Any, ...]


class Held:
    """A number in formulas that others set as time goes on, and that stays between."""

    value = 0.0

    def now(self) -> float:
        """The number as it is."""
        return self.value


_NAMED: ContextVar[Mapping[str, Node]] = ContextVar("what formulas know by name")


FOLDER: ContextVar[Path | None] = ContextVar("where relative paths in formulas start", default=None)


@contextmanager
def naming(numbers: Mapping[str, Node]) -> Iterator[None]:
    """Let formulas that are read meanwhile use numbers, and nodes in t, by name."""
    token = _NAMED.set(numbers)
    try:
        yield
    finally:
        _NAMED.reset(token)


def variables_of(node: Node) -> frozenset[str]:
    """Variables that occur in a node."""
    match node:
        case ("variable", name):
            return frozenset((name,))
        case ("held", _):
            return frozenset("t")
        case ("negative", operand) | ("table", _, operand):
            return variables_of(operand)
        case ("chain", first, steps):
            return variables_of(first).union(*(variables_of(operand) for _, operand in steps))
        case ("call", _, args):
            return frozenset().union(*map(variables_of, args))
    return frozenset()


class FormulaError(SceneError):
    """A text is not an allowed formula; `why` is the reason without the text."""

    def __init__(self, text: str, why: str) -> None:
        shown = text if len(text) <= 60 else text[:57] + "..."
        super().__init__(f"formula {shown!a}: {why}")
        self.text, self.why = text, why

    def __reduce__(self) -> tuple[type, tuple[str, str]]:
        return type(self), (self.text, self.why)


class Parser:
    """Parses one text; every refusal is a FormulaError."""

    def __init__(self, text: str, variables: tuple[str, ...]) -> None:
        self.text = text
        self.variables = variables
        self.named = _NAMED.get({})
        self.used: dict[str, Node] = {}
        """What the formula uses by name."""

    def parse(self) -> Node:
        """Return the tree of the text, with its constant parts evaluated."""
        if not self.text:
            self._fail("it is empty; write a number or a formula")
        if len(self.text) > MAX_LENGTH:
            self._fail(f"it has {len(self.text)} characters, more than {MAX_LENGTH}; shorten it")
        self._check_characters()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # "1if" and the like warn before they fail
                tree = ast.parse(self.text, mode="eval")
        except SyntaxError as error:
            place = f" (near column {error.offset})" if error.offset else ""
            self._fail(f"it is not a complete formula{place}; write every * and close every (")
        except (RecursionError, MemoryError, ValueError, OverflowError):
            self._fail("it is nested too deeply or holds too long a number; simplify it")
        return self._convert(tree.body, 0)

    def _fail(self, why: str) -> NoReturn:
        raise FormulaError(self.text, why) from None

    def _check_characters(self) -> None:
        """Refuse all but some ASCII: Python takes lookalikes of letters for the letters."""
        depth = 0
        for column, character in enumerate(self.text, start=1):
            if not _ALLOWED_CHARACTERS.match(character):
                name = unicodedata.name(character, "").lower() or f"U+{ord(character):04X}"
                hint = _CHARACTER_HINTS.get(character, _USE_ARITHMETIC)
                self._fail(f"{character!a} ({name}, column {column}) is not allowed; {hint}")
            depth += (character == "(") - (character == ")")
            if depth > MAX_DEPTH:
                self._fail(f"more than {MAX_DEPTH} parentheses are open; simplify it")

    def _convert(self, node: ast.expr, depth: int) -> Node:  # noqa: RET503  # _fail raises
        if depth > MAX_DEPTH:
            self._fail(f"it is nested more than {MAX_DEPTH} levels deep; simplify it")
        match node:
            case ast.Constant(value=value):
                return self._number(value)
            case ast.Name(id=name):
                return self._name(name)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self._convert(operand, depth + 1)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return self._fold(("negative", self._convert(operand, depth + 1)))
            case ast.BinOp():
                return self._chain(node, depth)
            case ast.Call():
                return self._call(node, depth)
        self._fail(_REFUSALS.get(type(node), f"it is not arithmetic; {_USE_ARITHMETIC}"))

    def _number(self, value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            self._fail(f"{str(value)[:40]!r} is not a real number; write real numbers only")
        try:
            number = float(value)
        except OverflowError:
            number = np.inf
        if not np.isfinite(number):
            self._fail("a number is too large; write numbers below 1.8e308")
        return number

    def _name(self, name: str) -> Node:  # noqa: RET503  # _unknown raises
        if name in self.variables:
            if name in self.named:
                self._fail(
                    f"{name!r} is a variable here, and the name of a parameter or control; give "
                    "that one another name"
                )
            return ("variable", name)
        if name in CONSTANTS:
            return CONSTANTS[name]
        if name in self.named:
            node = self.used[name] = self.named[name]
            for own in variables_of(node) - {*self.variables}:
                self._fail(f"{name!r} changes with {own}, and this does not; use it where it does")
            return node
        if name in FUNCTIONS:
            self._fail(f"the function {name!r} needs its argument in parentheses")
        self._unknown(name)

    def _unknown(self, name: str) -> NoReturn:
        known = (*self.variables, *self.named, *CONSTANTS, *FUNCTIONS)
        near = nearest(name[:40], known)
        meant = f", did you mean {near!r}?" if near else ";"
        self._fail(f"unknown name {name[:40]!r}{meant} use {', '.join(known)}")

    def _chain(self, node: ast.BinOp, depth: int) -> Node:
        # A sum of many terms leans to the left: going down that side in a loop keeps it flat.
        steps: list[tuple[str, Node]] = []
        first: ast.expr = node
        while isinstance(first, ast.BinOp):
            name = type(first.op).__name__
            if name not in OPERATORS:
                self._fail(f"the operator {name} is not available; {_USE_ARITHMETIC}")
            steps.append((name, self._convert(first.right, depth + 1)))
            first = first.left
        result = self._convert(first, depth + 1)
        steps.reverse()
        while steps and isinstance(result, float) and isinstance(steps[0][1], float):
            result = self._fold(("chain", result, (steps.pop(0),)))
        return ("chain", result, tuple(steps)) if steps else result

    def _call(self, node: ast.Call, depth: int) -> Node:
        if isinstance(node.func, ast.Attribute) and node.func.attr in FUNCTIONS:
            self._fail(f"write {node.func.attr}(...) without a module before it")
        if not isinstance(node.func, ast.Name):
            self._fail("only named functions can be called; write a product with *")
        name = node.func.id
        if name in self.variables or name in CONSTANTS:
            self._fail(f"{name!r} is not a function; write a product with *")
        if name not in FUNCTIONS:
            self._unknown(name)
        if node.keywords or any(isinstance(arg, ast.Starred) for arg in node.args):
            self._fail(f"{name} takes plain arguments only; remove = and *")
        count, wanted = len(node.args), {"where": 3, "min": 2, "max": 2}.get(name, 1)
        several = name in {"min", "max"}
        if count < wanted or (count > wanted and not several):
            plural = "s or more" if several else "" if wanted == 1 else "s"
            self._fail(f"{name} takes {wanted} argument{plural}, but {count} are given; correct it")
        if name == "where":
            return self._where(node.args, depth)
        args = [self._convert(arg, depth + 1) for arg in node.args]
        if not several:
            return self._fold(("call", name, tuple(args)))
        result = args[0]
        for arg in args[1:]:
            result = self._fold(("call", name, (result, arg)))
        return result

    def _where(self, args: list[ast.expr], depth: int) -> Node:
        condition = args[0]
        if not isinstance(condition, ast.Compare):
            self._fail("the first argument of where must be a comparison such as x < 0.5")
        names = [COMPARISONS.get(type(comparison), "") for comparison in condition.ops]
        if not all(names):
            self._fail("compare with < <= > >= only")
        sides = [condition.left, *condition.comparators]
        nodes = [self._convert(side, depth + 1) for side in sides]
        result, otherwise = (self._convert(arg, depth + 1) for arg in args[1:])
        # where(a < b < c, ...) becomes where(a < b, where(b < c, ...)): no logical "and" is needed.
        for k in reversed(range(len(names))):
            left, right = nodes[k], nodes[k + 1]
            if isinstance(left, float) and isinstance(right, float):
                result = result if NUMPY_FUNCTIONS[names[k]](left, right) else otherwise
            else:
                test = ("call", names[k], (left, right))
                result = ("call", "where", (test, result, otherwise))
        return result

    def _fold(self, node: tuple[Any, ...]) -> Node:
        """Evaluate a node whose operands are numbers; other nodes stay as they are."""
        with np.errstate(all="ignore"):
            match node:
                case ("negative", float(operand)):
                    value = -operand
                case ("chain", float(left), ((name, float(right)),)):
                    value = OPERATORS[name](np.float64(left), np.float64(right))
                case ("call", name, args) if all(isinstance(arg, float) for arg in args):
                    value = NUMPY_FUNCTIONS[name](*args)
                case _:
                    return node
        if not np.isfinite(value):
            self._fail(f"a constant part of it is {float(value)}, not a finite number; correct it")
        return float(value)

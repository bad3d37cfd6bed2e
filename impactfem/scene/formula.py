"""Formulas in text form, evaluated by walking their tree with numpy or any other library."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats
from impactfem.scene.grammar import (
    COMPARISONS,
    OPERATORS,
    FormulaError,
    Held,
    Node,
    Parser,
    variables_of,
)
from impactfem.scene.pieces import Table
from impactfem.scene.scalar_formula import arrays, scalar
from impactfem.scene.values import NotAllowedError, is_number, number, show


@dataclass(frozen=True)
class Formula:
    """A formula of some variables, e.g. ``Formula("-0.5 + 0.1*sin(pi*x)")``.

    Allowed are numbers, ``+ - * / **``, parentheses, the variables, the constants ``pi`` and
    ``e``, the functions ``sin cos tan asin acos atan sinh cosh tanh exp log sqrt abs min max`` and
    ``where(condition, a, b)`` with a comparison such as ``x < 0.5`` or ``0 <= x < 0.5``. At most
    1000 characters and 50 levels. Formulas are equal when their text, their variables and the
    numbers that they use by name are.

    Attributes:
        text: the formula; a number given instead is turned into its text.
        variables: names that may occur in it.
        named: names in it that a scene gives, as of parameters and controls, and their nodes.

    Raises:
        SceneError: the text is not an allowed formula, or a constant part of it is not finite
            (``1/0``). Values that are not finite for some x only are not noticed here.
    """

    text: str
    variables: tuple[str, ...] = ("x",)
    named: tuple[tuple[str, Node], ...] = field(init=False, repr=False)
    _tree: Node = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        given: object = self.text
        if is_number(given):
            try:
                text = repr(number(given))
            except NotAllowedError as error:
                raise FormulaError(show(given), f"{error}; give a finite number") from None
        elif isinstance(given, str):
            text = given.strip()
        else:
            raise FormulaError(show(given), "it is neither number nor text; give one of these")
        names = tuple(self.variables)
        parser = Parser(text, names)
        tree = parser.parse()
        self._store(
            text, names, tree, tuple((name, parser.used[name]) for name in sorted(parser.used))
        )

    def _store(
        self, text: str, variables: tuple[str, ...], tree: Node,
        named: tuple[tuple[str, Node], ...] = (),
    ) -> None:  # fmt: skip
        object.__setattr__(self, "text", text)
        object.__setattr__(self, "named", named)
        object.__setattr__(self, "variables", variables)
        object.__setattr__(self, "_tree", tree)

    @property
    def tree(self) -> Node:
        """Its tree, for formulas that contain it."""
        return self._tree

    @property
    def is_constant(self) -> bool:
        """Whether the value depends on no variable."""
        return isinstance(self._tree, float)

    @property
    def table(self) -> Table | None:
        """The table of t that it is, if it is one and nothing else."""
        match self._tree:
            case ("table", Table() as table, ("variable", "t")):
                return table
        return None

    @cached_property
    def used(self) -> frozenset[str]:
        """Variables that occur in it."""
        return variables_of(self._tree)

    def compared(self, variable: str) -> Floats:
        """Numbers at which it changes its branch, as in ``where(t < 2, a, b)``, in order, (n,)."""
        known: dict[str, Floats] = self.__dict__.setdefault("_compared", {})
        if variable not in known:
            known[variable] = self._branches(variable)
        return known[variable]

    def _branches(self, variable: str) -> Floats:
        known = ("variable", variable)
        found: set[float] = set()

        def walk(node: Node) -> None:
            match node:
                case ("negative", operand):
                    walk(operand)
                case ("table", table, operand):
                    walk(operand)
                    if operand == known:
                        found.update(table.places.tolist())
                case ("chain", first, steps):
                    walk(first)
                    for _, operand in steps:
                        walk(operand)
                case ("call", name, args):
                    if name in COMPARISONS.values() and known in args:
                        found.update(each for each in args if isinstance(each, float))
                    for each in args:
                        walk(each)

        walk(self._tree)
        return np.array(sorted(found))

    @property
    def plain(self) -> float | str | dict[str, Any]:
        """What a scene file holds: a number when the text is just a number, otherwise the text."""
        try:
            value = float(self.text)
        except ValueError:
            return self.text
        return value if repr(value) == self.text else self.text

    @property
    def record(self) -> tuple[tuple[float, float], str] | None:
        """Of a measured signal: first and last time [s], and unit; None if it is none."""
        return None

    def of(self, variables: tuple[str, ...]) -> "Formula":
        """Return the same text as a formula of other variables.

        Raises:
            FormulaError: It uses others.
        """
        return Formula(self.text, variables)

    def plus(self, offset: float) -> "Formula":
        """Return this formula plus a finite number."""
        if isinstance(self._tree, float):
            return Formula(repr(self._tree + offset), self.variables)
        # Made without parsing: the longer text may pass the limit that holds for users.
        shifted = object.__new__(Formula)
        tree = ("chain", float(offset), (("Add", self._tree),))
        text = f"{float(offset)!r} + ({self.text})"
        shifted._store(text, self.variables, tree, self.named)
        return shifted

    def until(self, time: float | None) -> "Formula":
        """Return this formula up to a time t [s] and 0 after it; itself if there is no end."""
        if time is None:
            return self
        ended = object.__new__(Formula)
        lasts: Node = ("call", "le", (("variable", "t"), float(time)))
        tree: Node = ("call", "where", (lasts, self._tree, 0.0))
        names = (*self.variables, *({"t"} - {*self.variables}))
        ended._store(f"{self.text} until t = {time:g}", names, tree, self.named)
        return ended

    def fixed(self, **numbers: float) -> "Formula":
        """Return this formula with numbers for some of its variables."""
        found = object.__new__(Formula)
        text = ", ".join([self.text, *(f"{name} = {value!r}" for name, value in numbers.items())])
        left = tuple(v for v in self.variables if v not in numbers)
        known = {name: float(value) for name, value in numbers.items()}
        found._store(text, left, _replaced(self._tree, known), self.named)
        return found

    def composed(self, **parts: "Formula") -> "Formula":
        """Return this formula with formulas for all of its variables, which have the same ones."""
        found = object.__new__(Formula)
        text = ", ".join([self.text, *(f"{name} = {part.text}" for name, part in parts.items())])
        named = {**dict(self.named), **{k: v for part in parts.values() for k, v in part.named}}
        variables = next(iter(parts.values())).variables
        trees = {name: part._tree for name, part in parts.items()}  # noqa: SLF001  (its own class)
        found._store(text, variables, _replaced(self._tree, trees), tuple(sorted(named.items())))
        return found

    def marked(self, marks: Sequence[tuple[Node, Any]]) -> "Formula":
        """Return this formula with the variable "mark K" for the K-th of some of its parts."""
        found = object.__new__(Formula)
        tree = self._tree
        for k, (part, _) in enumerate(marks):
            tree = _marked(tree, part, ("variable", f"mark {k}"))
        found._store(self.text, (*self.variables, *(f"mark {k}" for k in range(len(marks)))), tree)
        return found

    def __call__(self, **values: ArrayLike) -> Any:  # float or array of floats
        """Evaluate with numpy.

        Args:
            values: a number or array per variable; variables that do not occur may be left out.

        Returns:
            Floats in the shape to which all values broadcast, a float for numbers; inf or nan,
            without a warning, where the formula has no finite value.

        Raises:
            SceneError: the value of a variable is missing.
        """
        known = {name: np.asarray(value, dtype=float) for name, value in values.items()}
        for name in self.used.difference(known):
            raise FormulaError(self.text, f"the variable {name!r} is missing; give it")
        shape = np.broadcast_shapes(*(array.shape for array in known.values()))
        with np.errstate(all="ignore"):
            result = self.of_arrays(known)
        return np.array(np.broadcast_to(np.asarray(result, dtype=float), shape))[()]

    @cached_property
    def of_arrays(self) -> Callable[[Mapping[str, Any]], Any]:
        """The formula as a function of all its variables' arrays by name, which checks nothing."""
        return arrays(self._tree)

    @cached_property
    def number(self) -> Callable[[Mapping[str, float]], float]:
        """The formula as a function of single numbers by name, far faster than arrays of one.

        Its values are those of the formula but for rounding; inf or nan where these are.
        """
        return scalar(self._tree, lambda values: float(self(**values)))

    def __getstate__(self) -> dict[str, Any]:
        """The state without functions, which cannot be sent to other processes."""
        functions = ("number", "of_arrays", "_compared")
        return {name: value for name, value in self.__dict__.items() if name not in functions}

    def apply(
        self, functions: Mapping[str, Callable[..., Any]], /, **values: Any
    ) -> Any:  # whatever the functions return
        """Evaluate with the functions of another library, e.g. UFL.

        Args:
            functions: by name, the functions that the formula uses: those listed for the class,
                and ``lt, le, gt, ge`` for comparisons. ``min`` and ``max`` get two arguments.
                Arithmetic uses Python's operators. Constant parts come as floats, and so does what
                is held, unless there is a function ``held`` for it. Tables become comparisons,
                unless there is a function ``table`` of a `Table` and its operand.
            values: the value of each variable.

        Raises:
            SceneError: a function or the value of a variable is missing.
        """
        return _applied(self._tree, self.text, functions, values)


def _applied(  # noqa: C901, PLR0911  (a case for each form of a node)
    node: Node, text: str, functions: Mapping[str, Callable[..., Any]], values: Mapping[str, Any]
) -> Any:  # whatever the functions return
    """Evaluate a node, see `Formula.apply`.

    A closure that calls itself would be a circle, which keeps the meshes of its values.
    """

    def of(operand: Node) -> Any:
        return _applied(operand, text, functions, values)

    match node:
        case float():
            return node
        case ("variable", name):
            if name not in values:
                raise FormulaError(text, f"the variable {name!r} is missing; give it")
            return values[name]
        case ("held", held):
            return functions.get("held", Held.now)(held)
        case ("table", table, operand):
            if "table" in functions:
                return functions["table"](table, of(operand))
            return of(table.compared(operand))
        case ("negative", operand):
            return -of(operand)
        case ("chain", first, steps):
            result = of(first)
            for name, operand in steps:
                result = OPERATORS[name](result, of(operand))
            return result
        case ("call", name, args):
            if name not in functions:
                raise FormulaError(text, f"{name!r} cannot be used here; rewrite it")
            return functions[name](*map(of, args))
    raise TypeError(f"unknown node {node!r}")


def _marked(node: Node, part: Node, mark: Node) -> Node:
    """A tree with a mark in the place of some part."""
    if node == part:
        return mark
    match node:
        case ("negative", operand):
            return ("negative", _marked(operand, part, mark))
        case ("table", table, operand):
            return ("table", table, _marked(operand, part, mark))
        case ("chain", first, steps):
            marked = tuple((op, _marked(each, part, mark)) for op, each in steps)
            return ("chain", _marked(first, part, mark), marked)
        case ("call", name, args):
            return ("call", name, tuple(_marked(each, part, mark) for each in args))
    return node


def _replaced(node: Node, parts: Mapping[str, Node]) -> Node:
    """A tree with others in the place of some of its variables."""
    match node:
        case ("variable", name):
            return parts.get(name, node)
        case ("negative", operand):
            return ("negative", _replaced(operand, parts))
        case ("table", table, operand):
            return ("table", table, _replaced(operand, parts))
        case ("chain", first, steps):
            replaced = tuple((op, _replaced(each, parts)) for op, each in steps)
            return ("chain", _replaced(first, parts), replaced)
        case ("call", name, args):
            return ("call", name, tuple(_replaced(each, parts) for each in args))
    return node

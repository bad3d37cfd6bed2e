"""What rank 0 does alone calls nothing that all ranks must do together: they would wait for ever.

The calls are followed through the syntax of the package: names through imports, `self` and what is
annotated through classes with their bases and heirs. An attribute of something unknown stands for
every method and property of its name that is said to be collective.
"""

import ast
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest

import impactfem

SOURCES = Path(impactfem.__file__).parent
OF_MPI = {
    "allreduce", "allgather", "bcast", "barrier", "Barrier", "gather", "scatter", "alltoall",
    "Ibarrier", "Split", "Dup", "scatter_forward", "scatter_reverse", "ghostUpdate",
}  # fmt: skip
OF_FILES = {"read", "write", "load", "open"}
# Layers below those whose objects are distributed: what they are given is not.
LOW = {"report", "scene", "result", "exact", "mesh", "planning"}


class Package:
    """Modules, and what their names stand for."""

    def __init__(self, sources):
        self.of = {}  # functions and classes: module, class, enclosing functions
        self.globals = defaultdict(dict)
        self.imports = defaultdict(dict)
        self.foreign = defaultdict(set)  # names that modules of others have in a module
        self.heirs = defaultdict(list)
        self.collective = defaultdict(list)  # methods by name
        self.alone = []  # callbacks of on_root and blocks of rank 0, each with its function
        for name, text in sources.items():
            self.enter(ast.parse(text), name, None, ())
        for kind in [node for node in self.of if isinstance(node, ast.ClassDef)]:
            for base in self.bases(kind):
                self.heirs[base].append(kind)

    def enter(self, node, module, kind, inside):
        for child in ast.iter_child_nodes(node):
            own, within = kind, inside
            if isinstance(child, ast.ImportFrom):
                for alias in child.names:
                    self.imports[module][alias.asname or alias.name] = (child.module, alias.name)
            elif isinstance(child, ast.Import):
                self.foreign[module] |= {(a.asname or a.name).split(".")[0] for a in child.names}
            elif isinstance(child, ast.ClassDef):
                self.globals[module][child.name] = own = child
                self.of[child] = (module, None, ())
            elif isinstance(child, ast.FunctionDef | ast.Lambda):
                self.of[child] = (module, kind, inside)
                within = (*inside, child)
                if not inside:
                    self.name(child, module, kind)
            elif inside:
                self.start(child, inside[-1])
            self.enter(child, module, own, within)

    def name(self, function, module, kind):
        if isinstance(function, ast.FunctionDef) and kind is None:
            self.globals[module][function.name] = function
        elif isinstance(function, ast.FunctionDef) and said(function):
            self.collective[function.name].append(function)

    def start(self, node, function):
        if isinstance(node, ast.Call) and called(node) == "on_root":
            self.alone.append((function, [node.args[-1]]))
        elif isinstance(node, ast.If) and of_rank_0(node.test):
            self.alone.append((function, node.body))

    def found(self, name, module, depth=5):
        """What a global name stands for: a node, the name of a module, or None."""
        if name in self.globals[module]:
            return self.globals[module][name]
        source, origin = self.imports[module].get(name, (None, None))
        if f"{source}.{origin}" in self.globals:
            return f"{source}.{origin}"
        return self.found(origin, source, depth - 1) if source and depth else None

    def bases(self, kind):
        names = [base.value if isinstance(base, ast.Subscript) else base for base in kind.bases]
        found = [self.found(n.id, self.of[kind][0]) for n in names if isinstance(n, ast.Name)]
        return [base for base in found if isinstance(base, ast.ClassDef)]

    @cache  # noqa: B019  (one of it is made)
    def family(self, kind):
        """A class with its bases and heirs."""
        found = {kind}
        for near in (self.bases, self.heirs.__getitem__):
            todo = [kind]
            while todo:
                new = [other for other in near(todo.pop()) if other not in found]
                found.update(new)
                todo += new
        return found

    @cache  # noqa: B019
    def members(self, kind, *names):
        every = [node for one in self.family(kind) for node in one.body]
        return [n for n in every if isinstance(n, ast.FunctionDef) and n.name in names]

    @cache  # noqa: B019
    def annotated(self, annotation, module):
        """Classes of the package that an annotation names, but protocols; None: unknown."""
        if annotation is None:
            return None
        names = [node.id for node in ast.walk(annotation) if isinstance(node, ast.Name)]
        kinds = [self.found(name, module) for name in names]
        kinds = [kind for kind in kinds if isinstance(kind, ast.ClassDef)]
        loose = any(getattr(b, "id", "") == "Protocol" for kind in kinds for b in kind.bases)
        return None if loose or (not kinds and "Any" in names) else kinds

    def resolve(self, node, function):
        """Functions that a name or an attribute may stand for, and whether that is certain."""
        scope = (*self.of[function][2], function)
        if isinstance(node, ast.Name):
            return self.of_name(node.id, scope), True
        found = self.of_receiver(node.value, node.attr, scope)
        if found is not None:
            return found, True
        if LOW & set(self.of[function][0].split(".")[1:2]) or node.attr in OF_FILES:
            return [], True
        return self.collective.get(node.attr, []), False

    def of_name(self, name, scope):
        for outer in reversed(scope):
            if name in arguments(outer):
                return []
            if name in functions(outer):
                return [functions(outer)[name]]
        return self.as_called(self.found(name, self.of[scope[-1]][0]))

    def of_receiver(self, owner, name, scope):
        """What is known of an attribute by what it is one of; None: nothing."""
        module, kind, _ = self.of[scope[-1]]
        kinds, word = None, getattr(owner, "id", "")
        if isinstance(owner, ast.Call) and getattr(owner.func, "id", "") == "super":
            kinds = [kind]
        elif isinstance(owner, ast.Call) and isinstance(owner.func, ast.Name | ast.Attribute):
            makers = self.resolve(owner.func, scope[-1])[0]
            if len(makers) == 1:
                kinds = self.annotated(makers[0].returns, self.of[makers[0]][0]) or None
        elif word in {"self", "cls"} and kind is not None:
            kinds = [kind]
        elif word:
            given = next((a[word] for f in scope[::-1] if word in (a := arguments(f))), None)
            kinds = self.annotated(given, module)
            whole = self.found(word, module)
            if kinds is None and given is None and word in self.foreign[module]:  # of `os`, say
                return []
            if kinds is None and isinstance(whole, str):  # a module
                return self.as_called(self.found(name, whole))
            if kinds is None and isinstance(whole, ast.ClassDef):
                kinds = [whole]
        return kinds if kinds is None else [f for one in kinds for f in self.members(one, name)]

    def as_called(self, found):
        if isinstance(found, ast.ClassDef):
            return self.members(found, "__init__", "__post_init__")
        return [found] if isinstance(found, ast.FunctionDef) else []

    def waiting(self, function, nodes):
        """Ways from what rank 0 does alone to what waits for the others."""
        seen, todo = set(), [(function, nodes, ())]
        while todo:
            current, body, way = todo.pop()
            here = (*way, f"{self.of[current][0]}:{body[0].lineno}")
            for node in used(tuple(body)):
                if isinstance(node, ast.Attribute) and node.attr in OF_MPI:
                    if getattr(node.value, "attr", "") != "COMM_SELF":
                        yield " > ".join((*here, node.attr))
                    continue
                targets, certain = self.resolve(node, current)
                for target in targets:
                    if said(target):
                        yield " > ".join((*here, f"{self.of[target][0]} {target.name}"))
                    elif certain and target not in seen:
                        seen.add(target)
                        todo.append((target, target.body, here))


def called(call):
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")


def of_rank_0(test):
    text = ast.unparse(test)
    return "rank == 0" in text or "rank() == 0" in text


@cache
def said(function):
    """Whether a function is said to be collective; at its first use only counts, too."""
    return "(collective" in (ast.get_docstring(function) or "")


@cache
def arguments(function):
    found = function.args
    every = [*found.posonlyargs, *found.args, *found.kwonlyargs]
    return {a.arg: getattr(a, "annotation", None) for a in every}


@cache
def functions(function):
    """Those inside of it."""
    every = [node for node in ast.walk(function) if isinstance(node, ast.FunctionDef)]
    return {node.name: node for node in every if node is not function}


@cache
def used(nodes):
    """Names and attributes that are read."""
    every = [node for one in nodes for node in ast.walk(one)]
    read = [node for node in every if isinstance(node, ast.Name | ast.Attribute)]
    return [node for node in read if isinstance(node.ctx, ast.Load)]


def searched(sources):
    package = Package(sources)
    return {way for start in package.alone for way in package.waiting(*start)}, package


SCHEME = """
class Scheme(Protocol):
    def state(self): ...
class Body:
    @property
    def state(self):
        \'\'\'What all ranks have (collective).\'\'\'
    def total(self):
        return self.comm.allreduce(1)
    def size(self):
        return 1
def made() -> Body: ...
"""
HIDDEN = {
    "self.sum()": "",
    "self.scheme.state": "",
    "body.total()": "body: Body",
    "made().total()": "",
    "comm.bcast(1)": "comm: Any",
}


@pytest.mark.parametrize(("call", "given"), HIDDEN.items(), ids=HIDDEN)
def test_a_call_that_waits_is_found(call, given):
    loop = f"""
from impactfem.marching.scheme import Body, made
class Loop:
    def read(self, {given}):
        on_root(self.comm, lambda: self._read({given.partition(":")[0]}))
    def _read(self, {given}):
        def later():
            return {call}
        return later()
class Heir(Loop):
    def sum(self):
        return self.comm.allgather(1)
"""
    names = ("impactfem.marching.scheme", "impactfem.marching.loop")
    assert searched(dict(zip(names, (SCHEME, loop), strict=True)))[0]
    fine = loop.replace(call, "made().size()")
    assert searched(dict(zip(names, (SCHEME, fine), strict=True)))[0] == set()


@pytest.mark.slow
def test_what_rank_0_does_alone_waits_for_no_other():
    sources = {}
    for path in SOURCES.rglob("*.py"):
        words = path.relative_to(SOURCES.parent).with_suffix("").parts
        name = ".".join(words[:-1] if words[-1] == "__init__" else words)
        sources[name] = path.read_text(encoding="utf-8")
    ways, package = searched(sources)
    assert ways == set()
    assert len(package.alone) > 20
    assert len(package.collective["surface_displacement"]) > 0

"""Malformed scenes: each is refused with a message that names key, value and remedy."""

import copy
from datetime import date

import pytest

from impactfem.errors import SceneError
from impactfem.scene import Bar, Output, PiecewiseConstant, Scene, Solve, Wall

GOOD = {
    "title": "a bar",
    "duration": 5.0,
    "gravity": 0.0,
    "body": [
        {
            "kind": "bar",
            "name": "bar",
            "length": 1.0,
            "density": 1.0,
            "youngs_modulus": 1.0,
            "gap": 0.5,
            "velocity": -0.5,
        }
    ],
    "obstacle": [{"kind": "wall"}],
    "solve": {"method": "galerkin", "elements": 40, "courant": 1.0},
    "output": {"fields": ["vtkhdf"], "every": 1},
}
ABSENT = object()


def changed(changes):
    """Return the good scene with values put at paths, or removed."""
    data = copy.deepcopy(GOOD)
    for path, value in changes.items():
        *parents, last = path.split(".")
        place = data
        for part in parents:
            place = place[int(part)] if isinstance(place, list) else place[part]
        if value is ABSENT:
            del place[last]
        else:
            place[last] = value
    return data


BAR = GOOD["body"][0]

# Changes of the good scene, then what the message must hold: path of the key, value, remedy.
CASES = {
    # missing
    "no title": ({"title": ABSENT}, ["title is missing", "give a text"]),
    "no duration": ({"duration": ABSENT}, ["duration is missing", "a number > 0 [s]"]),
    "no body": ({"body": ABSENT}, ["body is missing", "one or more [[body]]"]),
    "no obstacle": (
        {"obstacle": ABSENT, "gravity": 9.81},
        ['method = "galerkin"', "gravity of bars without a wall", 'give "conserving"'],
    ),
    "no length": ({"body.0.length": ABSENT}, ["body[0].length is missing", "a number > 0 [m]"]),
    "no density": ({"body.0.density": ABSENT}, ["body[0].density is missing", "give a number"]),
    "no modulus": ({"body.0.youngs_modulus": ABSENT}, ["body[0].youngs_modulus", "[Pa]"]),
    "no kind": ({"body.0.kind": ABSENT}, ["body[0].kind is missing", 'add kind = "bar"']),
    "no wall kind": ({"obstacle.0.kind": ABSENT}, ["obstacle[0].kind is missing", '"wall"']),
    "nothing": (dict.fromkeys(GOOD, ABSENT), ["title is missing", "add it"]),
    # extra and misspelt: reported before what is missing because of them
    "misspelt length": (
        {"body.0.length": ABSENT, "body.0.lenght": 2.5},
        ["body[0].lenght = 2.5", 'did you mean "length"?'],
    ),
    "misspelt top": ({"tilte": "x"}, ['tilte = "x"', 'did you mean "title"?']),
    "misspelt table": ({"slove": {"dt": 1}}, ["slove = ", 'did you mean "solve"?']),
    "upper case": ({"Gravity": 9.81}, ["Gravity = 9.81", 'did you mean "gravity"?']),
    "misspelt kind": (
        {"body.0.kind": ABSENT, "body.0.knid": "bar"},
        ['body[0].knid = "bar"', 'did you mean "kind"?'],
    ),
    "misspelt in solve": ({"solve.elments": 7}, ["solve.elments = 7", '"elements"?']),
    "misspelt in output": ({"output.evry": 7}, ["output.evry = 7", '"every"?']),
    "extra": ({"body.0.colour": "red"}, ['body[0].colour = "red"', "remove it", "Known keys"]),
    "contact": ({"contact": [{}]}, ["contact[0].between is missing", "names of two bodies"]),
    "wrong table": ({"elements": 10}, ["elements = 10", "belongs to ", " or [solve]; move it"]),
    "top key in table": (
        {"body.0.duration": 3},
        ["body[0].duration = 3", "top of the file", "move it"],
    ),
    "empty key": ({"solve.": 3}, ['solve."" = 3', "remove it"]),
    "long key": ({"k" * 5000: 1}, ["kkk...kkk", "remove it"]),
    # wrong type
    "text for number": ({"body.0.length": "1 m"}, ['body[0].length = "1 m"', "without quotes"]),
    "bool for number": ({"body.0.length": True}, ["body[0].length = true", "give a number"]),
    "list for number": ({"duration": [1.0]}, ["duration = [1.0]", "a list", "give a number"]),
    "date for number": ({"duration": date(2026, 1, 2)}, ["duration = 2026-01-02", "give a num"]),
    "float for integer": ({"solve.elements": 40.0}, ["solve.elements = 40.0", "write 40"]),
    "fraction": ({"solve.elements": 0.5}, ["solve.elements = 0.5", "give an integer"]),
    "bool for integer": ({"output.every": True}, ["output.every = true", "give an integer"]),
    "number for title": ({"title": 3}, ["title = 3", "text in quotes"]),
    "number for name": ({"body.0.name": 1}, ["body[0].name = 1", "text in quotes"]),
    "number for method": ({"solve.method": 1}, ["solve.method = 1", '"galerkin" or "conserving"']),
    "one table": ({"body": dict(BAR)}, ["body = ", "[[body]] with two brackets"]),
    "bodies of numbers": ({"body": [3]}, ["body[0] = 3", "write [[body]]"]),
    "solve as text": ({"solve": "fast"}, ['solve = "fast"', "write [solve]"]),
    "velocity as table": ({"body.0.velocity": {"x": 1}}, ["body[0].velocity = {", "give a num"]),
    # not finite, out of bounds
    "nan": ({"duration": float("nan")}, ["duration = nan", "not a finite", "give a number > 0"]),
    "inf": ({"body.0.density": float("inf")}, ["body[0].density = inf", "give a number > 0"]),
    "huge integer": ({"duration": 10**400}, ["duration = an integer of 401 digits", "give"]),
    "negative": ({"body.0.length": -1}, ["body[0].length = -1", "must be > 0"]),
    "zero": ({"body.0.density": 0}, ["body[0].density = 0", "must be > 0"]),
    "zero duration": ({"duration": 0.0}, ["duration = 0.0", "must be > 0"]),
    "negative gap": ({"body.0.gap": -0.1}, ["body[0].gap = -0.1", "must be >= 0"]),
    "no elements": ({"solve.elements": 0}, ["solve.elements = 0", "an integer from 2"]),
    "too many": ({"solve.elements": 10**7}, ["solve.elements = 10000000", "must be <= 1000000"]),
    "courant": ({"solve.courant": 0}, ["solve.courant = 0", "must be > 0"]),
    "gamma": ({"solve.gamma": -2.0}, ["solve.gamma = -2.0", "must be > 0"]),
    "tolerance": ({"solve.tolerance": 1}, ["solve.tolerance = 1", "must be < 1"]),
    "iterations": ({"solve.max_iterations": 0}, ["solve.max_iterations = 0", "must be >= 1"]),
    "every": ({"output.every": 0}, ["output.every = 0", "must be >= 1"]),
    "no wave speed": (
        {"body.0.youngs_modulus": 1e-300, "body.0.density": 1e300},
        ["body[0].density = 1e+300", "beyond 1e+50", "give SI units"],
    ),
    "no mass": ({"body.0.area": 1e-320, "body.0.density": 1e-9}, ["body[0].area = 1e-320", "SI"]),
    "tiny": ({"body.0.length": 1e-306}, ["body[0].length = 1e-306", "below 1e-50", "SI units"]),
    # words and names
    "kind": ({"body.0.kind": "shell"}, ['body[0].kind = "shell"', 'give "bar"']),
    "near kind": ({"obstacle.0.kind": "Wall"}, ['"Wall"', 'did you mean "wall"?']),
    "method": ({"solve.method": "galerkn"}, ['"galerkn"', 'did you mean "galerkin"?']),
    "far end": ({"body.0.far_end": "fixed"}, ['body[0].far_end = "fixed"', '"free" or "clamped"']),
    "active set": ({"solve.active_set": "newton"}, ['"newton"', '"pdas" or "snes_vi"']),
    "window number": ({"solve.window": 0}, ["solve.window = 0", ">= 1", '"all"']),
    "window of exact": (
        {"solve": {"method": "exact", "window": 4}},
        ["solve.method", '"exact"', "window", "remove one"],
    ),
    "window of dg": (
        {"solve": {"method": "dg", "window": 4}},
        ["window = 4", 'dg knows 1 and "all"'],
    ),
    "window of conserving": (
        {"solve": {"method": "conserving", "window": 4}},
        ["solve.window = 4", '"conserving"', "only galerkin has windows"],
    ),
    "degree of galerkin": (
        {"solve": {"method": "galerkin", "degree": 1}},
        ["degree = 1", 'they belong to method = "dg"'],
    ),
    "degree": ({"solve": {"degree": 3}}, ["solve.degree = 3", "from 0 to 2"]),
    "fitted": ({"solve": {"fitted": "yes"}}, ["solve.fitted", '"yes"', "true or false"]),
    "accuracy": ({"solve": {"accuracy": 1.5}}, ["solve.accuracy = 1.5", "< 1"]),
    "accuracy and elements": (
        {"solve": {"method": "galerkin", "accuracy": 0.1, "elements": 5}},
        ["accuracy = 0.1", "elements = 5", "remove one"],
    ),
    "snes_vi elsewhere": (
        {"solve": {"method": "galerkin", "active_set": "snes_vi"}},
        ['active_set = "snes_vi"', 'method = "monolithic"'],
    ),
    "window word": ({"solve.window": "al"}, ['solve.window = "al"', 'did you mean "all"?']),
    "name": ({"body.0.name": "my bar"}, ['body[0].name = "my bar"', "letters, digits, _ and -"]),
    "name path": ({"body.0.name": "../x"}, ['body[0].name = "../x"', "starts with a letter"]),
    "long name": ({"body.0.name": "b" * 41}, ["body[0].name", "at most 40 letters"]),
    "empty title": ({"title": " "}, ['title = " "', "give a text of 1 to 200"]),
    "long title": ({"title": "t" * 999}, ['title = "ttt', "999 characters", "1 to 200"]),
    "two lines": ({"title": "a\nb"}, [r'title = "a\nb"', "control character U+000A", "one line"]),
    "fields": ({"output.fields": ["vtk"]}, ['"vtk" is not known', "give a list", '"vtkhdf"']),
    "fields text": ({"output.fields": "vtx"}, ['output.fields = "vtx"', 'write a list ["vtx"]']),
    "fields twice": ({"output.fields": ["vtx", "vtx"]}, ['"vtx" is given twice', "remove one"]),
    "mesh": ({"solve": {"mesh": "bar.vtk"}}, ['solve.mesh = "bar.vtk"', ".geo or .msh"]),
    # counts
    "two bars": (
        {"body": [BAR, {**BAR, "name": "other"}]},
        ['body[1].gap = 0.5 lets bar "other" begin', '"bar" ends at 1.5 m', "at least 1.5"],
    ),
    "no bars": ({"body": []}, ["body = []", "there is none", "one or more [[body]]"]),
    "two walls": ({"obstacle": [{"kind": "wall"}] * 2}, ["obstacle = ", "are 2", "exactly one"]),
    "same names": (
        {"obstacle.0.name": "bar"},
        ['obstacle[0].name = "bar"', "body[0] too", "give another name"],
    ),
    # contradictions
    "courant and dt": (
        {"solve.dt": 0.01},
        ["solve.dt = 0.01", "contradicts courant = 1.0", "remove one"],
    ),
    "mesh and elements": (
        {"solve.mesh": "bar.msh"},
        ['solve.mesh = "bar.msh"', "contradicts elements = 40", "remove one"],
    ),
    "mesh and dt": (
        {"solve": {"mesh": "bar.msh", "dt": 0.1}},
        ['solve.mesh = "bar.msh"', "contradicts dt = 0.1", "remove one"],
    ),
    "exact and active set": (
        {"solve.method": "exact", "solve.active_set": "pdas"},
        ['solve.method = "exact"', 'contradicts active_set = "pdas"', "remove one"],
    ),
    "exact and mesh": (
        {"solve": {"method": "exact", "mesh": "a.geo"}},
        ['solve.method = "exact"', 'contradicts mesh = "a.geo"', "remove one"],
    ),
    "long step": (
        {"solve": {"dt": 6.0}},
        ["solve.dt = 6.0", "duration = 5.0", "give a smaller step"],
    ),
    "inside the wall": (
        {"body.0.displacement": "-0.75 + x"},
        ['body[0].displacement = "-0.75 + x"', "= -0.25 < 0", "increase gap = 0.5 by 0.25"],
    ),
    "inside out": (
        {"body.0.displacement": "-1.5*x"},
        ['body[0].displacement = "-1.5*x"', "strain near x = 0 is -1.5", "reduce"],
    ),
    "strain -1": ({"body.0.displacement": "-x"}, ["body[0].displacement", "strain", "reduce"]),
    "jump": (
        {"body.0.displacement": "where(x < 0.5, 0.1, 0)"},
        ["body[0].displacement", "strain near x = 0.49", "or its jumps"],
    ),
    # gravity
    "vector": ({"gravity": [0, -9.81]}, ["gravity = [0, -9.81]", "one axis", "gravity = 9.81"]),
    "late start": ({"gravity": [[0.1, 1.0]]}, ["gravity = [[0.1, 1.0]]", "must be 0.0"]),
    "no entries": ({"gravity": []}, ["gravity = []", "give at least"]),
    "same times": ({"gravity": [[0, 1], [0, 2]]}, ["must increase", "0.0 follows 0.0", "give"]),
    "not pairs": ({"gravity": [[0, 1, 2]]}, ["[0, 1, 2] is not a pair [time, value]", "give"]),
    "mixed": ({"gravity": [[0, 1], 2]}, ["the entry 2 is not a pair", "give"]),
    "text in table": ({"gravity": [[0, "g"]]}, ['entry "g" is not allowed', "without quotes"]),
    "nan in table": ({"gravity": [[0, float("nan")]]}, ["entry nan", "not a finite", "give"]),
    "gravity table": ({"gravity": {"x": 1}}, ["gravity = {", "a table, not a number", "give"]),
    "gravity text": ({"gravity": "9.81"}, ['gravity = "9.81"', "without quotes"]),
    # formulas that are not finite
    "log": ({"body.0.velocity": "log(x)"}, ['"log(x)"', "(-inf) at x = 0", "0 <= x <= 1"]),
    "pole": ({"body.0.velocity": "1/x"}, ['body[0].velocity = "1/x"', "(inf) at x = 0", "finite"]),
    "inner pole": ({"body.0.velocity": "1/(x - 0.5)"}, ["at x = 0.5", "give one finite"]),
    "root": ({"body.0.displacement": "sqrt(0.9 - x)"}, ["(nan) at x = 0.9", "give one finite"]),
    "overflow": ({"body.0.velocity": "exp(1000*x)"}, ["(inf) at x = 0.7", "give one finite"]),
}

HOSTILE = {
    "import": ("__import__('os').system('true')", "apostrophe"),
    "dunder import": ("__import__(x)", "unknown name '__import__'"),
    "class of tuple": ("().__class__", "attributes are not allowed"),
    "class of variable": ("x.__class__", "attributes are not allowed"),
    "class of function": ("sin.__class__(x)", "only named functions"),
    "power tower": ("9**9**9", "constant part of it is inf"),
    "power of powers": ("9**9**9**9**9**9", "constant part of it is inf"),
    "lambda": ("(lambda: 1)()", "is not allowed; use numbers"),
    "lambda without colon": ("(lambda x)", "not a complete formula"),
    "comprehension": ("[y for y in x]", "is not allowed; use numbers"),
    "generator": ("max(x for x in x)", "2 arguments"),
    "generators": ("max((y for y in x), (y for y in x))", "it is not arithmetic; use numbers"),
    "subscript": ("x[0]", "is not allowed; use numbers"),
    "text": ('"a"*1000000', "quotation mark"),
    "f-string": ('f"{x}"', "is not allowed"),
    "walrus": ("(x := 1)", "colon"),
    "keyword": ("sin(x=1)", "takes plain arguments only; remove"),
    "star": ("max(*x, 1)", "takes plain arguments only; remove"),
    "deep parentheses": ("(" * 300 + "x" + ")" * 300, "parentheses are open; simplify"),
    "very deep parentheses": ("(" * 100_000, "more than 1000; shorten it"),
    "deep calls": ("sin(" * 51 + "x" + ")" * 51, "parentheses are open; simplify"),
    "deep signs": ("-" * 900 + "x", "simplify it"),
    "deep powers": ("**".join("x" * 300), "levels deep; simplify it"),
    "long": ("x+" * 600 + "x", "more than 1000; shorten it"),
    "long integer": ("9" * 999, "number is too large; write"),
    "large number": ("1e999", "number is too large; write"),
    "imaginary": ("1j*x", "not a real number; write real"),
    "constant true": ("True", "not a real number; write real"),
    "constant none": ("None", "not a real number; write real"),
    "ellipsis": ("...", "not a real number; write real"),
    "fullwidth letters": ("\uff53\uff49\uff4e(x)", "fullwidth latin small letter s"),
    "mathematical letter": ("\U0001d431 + 1", "mathematical bold small x"),
    "cyrillic x": ("\u0445", "cyrillic small letter ha"),
    "minus sign": ("\u22120.5", "write the minus sign as -"),
    "null": ("x\0", "U+0000"),
    "bidirectional": ("x\u202e", "right-to-left override"),
    "comment": ("x # comment", "number sign"),
    "two formulas": ("x; x", "semicolon"),
    "two lines": ("x\nx", "not a complete formula"),
    "empty": ("  ", "it is empty; write"),
    "unknown name": ("t*x", "unknown name 't'"),
    "near name": ("sinn(x)", "did you mean 'sin'?"),
    "function without call": ("sin", "needs its argument in parentheses"),
    "call of variable": ("x(1)", "write a product with *"),
    "call of number": ("2(x)", "write a product with *"),
    "missing star": ("2x", "write every *"),
    "missing parenthesis": ("sin(x", "close every ("),
    "caret": ("x^2", "write a power as **"),
    "bare comparison": ("x < 1", "may stand only as in where"),
    "equality": ("where(x == 1, 0, 1)", "compare with < <= > >= only"),
    "condition": ("where(x, 0, 1)", "must be a comparison"),
    "logical": ("x and 1", "put one where inside another"),
    "negation": ("not x", "not arithmetic"),
    "if": ("1 if x < 1 else 2", "write where"),
    "tuple": ("1, 2", "write decimals with a dot"),
    "floor": ("x//2", "FloorDiv is not available; use"),
    "arguments": ("sin(x, x)", "takes 1 argument, but 2 are given"),
    "arguments of where": ("where(x < 1, 2)", "takes 3 arguments, but 2 are given"),
    "arguments of min": ("min(x)", "takes 2 arguments or more, but 1 are given"),
    "constant pole": ("x + 1/0", "constant part of it is inf"),
    "constant root": ("x*sqrt(-1)", "constant part of it is nan"),
}


def test_the_scene_to_change_is_good():
    assert Scene.from_dict(GOOD).bodies[0].gap == 0.5


def test_there_are_many_malformed_scenes():
    assert len(CASES) + len(HOSTILE) >= 45


@pytest.mark.parametrize(("changes", "parts"), CASES.values(), ids=CASES)
def test_malformed_scene_is_explained(changes, parts):
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(changed(changes))
    message = str(caught.value)
    for part in parts:
        assert part in message
    assert len(message) < 600
    assert message.isprintable()


@pytest.mark.parametrize(("formula", "part"), HOSTILE.values(), ids=HOSTILE)
@pytest.mark.parametrize("key", ["velocity", "displacement"])
def test_hostile_formula_is_refused(formula, part, key):
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(changed({f"body.0.{key}": formula}))
    message = str(caught.value)
    assert message.startswith(f'body[0].{key} = "')
    assert part in message
    assert "give a number or a formula in x" in message
    assert len(message) < 600
    assert message.isprintable()


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda: Bar(length=-1), ["bar.length = -1", "must be > 0"]),
        (lambda: Bar(length=1, density=1), ["bar.youngs_modulus is missing", "give a number"]),
        (lambda: Wall(name=""), ['wall.name = ""', "starts with a letter"]),
        (lambda: Solve(elements=1.5), ["solve.elements = 1.5", "give an integer"]),
        (lambda: Output(every=-1), ["output.every = -1", "must be >= 1"]),
        (lambda: Output(fields=("vtx", 3)), ["output.fields = [", "write a text in quotes"]),
        (lambda: PiecewiseConstant((0, 1), (1,)), ["2 times and 1 values", "give as many"]),
        (lambda: PiecewiseConstant(0.0, 1.0), ["0.0 is not a list of numbers", "give one"]),
        (lambda: PiecewiseConstant((0, "a"), (1, 2)), ['entry "a"', "without quotes"]),
    ],
)
def test_python_objects_are_checked_alike(make, parts):
    with pytest.raises(SceneError) as caught:
        make()
    for part in parts:
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"bodies": []}, ["body = []", "there is none", "one or more [[body]]"]),
        ({"bodies": 3}, ["body = 3", "a number, not a list"]),
        ({"obstacles": Wall()}, ['obstacle = wall "wall"', "write [ ] around it"]),
        ({"obstacles": [Wall(name="a"), Wall(name="b")]}, ['[wall "a", wall "b"]', "are 2"]),
        ({"bodies": [Wall()]}, ['wall "wall" is not a Bar', "give"]),
        ({"solve": {"elements": 3}}, ["solve = ", "write Solve(...)"]),
        ({"output": None}, ["output = None", "write Output(...)"]),
        ({"gravity": object()}, ["gravity = <object", "not a number"]),
    ],
)
def test_python_scene_is_checked_alike(changes, parts):
    bar = Bar(length=1, density=1, youngs_modulus=1)
    given = {"title": "t", "duration": 1, "bodies": [bar], "obstacles": [Wall()]}
    with pytest.raises(SceneError) as caught:
        Scene(**(given | changes))
    for part in parts:
        assert part in str(caught.value)


@pytest.mark.parametrize("data", [None, [], "scene", 3])
def test_a_scene_that_is_no_table_is_refused(data):
    with pytest.raises(SceneError, match="is not a table"):
        Scene.from_dict(data)


def test_errors_survive_pickling():
    import pickle

    with pytest.raises(SceneError) as caught:
        Bar(length=-1)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)  # noqa: S301

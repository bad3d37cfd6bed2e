"""The search for an interpreter, among stand-ins that answer its question with a lie."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / ".ci" / "find-python"
BASH = shutil.which("bash")

pytestmark = pytest.mark.skipif(
    BASH is None or not SCRIPT.exists(), reason="needs bash and a source tree"
)


class Machine:
    """A made-up machine: a home, interpreters, a PATH with no more than the script needs."""

    def __init__(self, folder):
        self.folder = folder
        self.path = folder / "path"
        self.home = folder / "home of a user"
        self.path.mkdir()
        self.home.mkdir()
        for tool in ("ls", "readlink"):
            (self.path / tool).symlink_to(shutil.which(tool))

    def script(self, place, text):
        file = self.folder / place
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"#!/bin/sh\n{text}\n")
        file.chmod(0o755)
        return str(file)

    def python(self, place, version=(3, 12, 1), lie=""):
        """Put an interpreter of the given version at a place; `lie` is run before the question."""
        pretend = f"sys.version_info = {version}; sys.executable = sys.argv[2]; {lie}"
        code = f"import sys; {pretend}\nexec(sys.argv[1])"
        return self.script(place, f"exec '{sys.executable}' -c '{code}' \"$3\" \"$0\"")

    def find(self, **environment):
        environment = {
            "PATH": str(self.path),
            "HOME": str(self.home),
            "IMPACTFEM_PYTHON_ROOTS": str(self.folder / "opt"),
            **environment,
        }
        command = [BASH, str(SCRIPT)]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)

    def found(self, **environment):
        answer = self.find(**environment)
        assert answer.returncode == 0, answer.stderr
        assert answer.stderr == ""
        return answer.stdout.removesuffix("\n")


@pytest.fixture
def machine(tmp_path):
    machine = Machine(tmp_path)
    machine.script("path/python3.13", "echo 'pyenv: python3.13: command not found' >&2; exit 127")
    machine.python("path/python3", (3, 11, 7))
    return machine


@pytest.mark.parametrize("name", ["python3", "python3.12", "python3.13", "python3.14"])
def test_on_path(machine, name):
    good = machine.python(f"path/{name}")
    assert machine.found() == good


def test_behind_a_shim_of_the_same_name(machine):
    good = machine.python("later/python3.13", (3, 13, 0))
    assert machine.found(PATH=f"{machine.path}:{machine.folder / 'later'}") == good


@pytest.mark.parametrize(
    "place",
    [
        "home of a user/.pyenv/versions/3.13.0/bin/python3",
        "home of a user/.local/share/uv/python/cpython-3.12.4-linux-x86_64-gnu/bin/python3",
        "opt/bin/python3.12",
        "opt/python-3.13/bin/python3",
    ],
)
def test_where_path_does_not_lead(machine, place):
    machine.python("home of a user/.pyenv/versions/3.10.2/bin/python3", (3, 10, 2))
    good = machine.python(place)
    assert machine.found() == good


@pytest.mark.parametrize(
    ("variable", "place"),
    [
        ("PYENV_ROOT", "versions/3.12.1/bin/python3"),
        ("UV_PYTHON_INSTALL_DIR", "cpython-3.12/bin/python3"),
    ],
)
def test_where_a_variable_leads(machine, variable, place):
    good = machine.python(f"elsewhere/{place}")
    assert machine.found(**{variable: str(machine.folder / "elsewhere")}) == good


def test_uv_is_asked(machine):
    good = machine.python("of uv/python3")
    machine.script("path/uv", f'[ "$1 $2" = "python find" ] && echo "{good}"')
    assert machine.found() == good


@pytest.mark.parametrize(
    "lie",
    [
        'sys.modules["ensurepip"] = None',
        'import sysconfig; sysconfig.get_config_var = lambda name: name == "Py_GIL_DISABLED"',
    ],
)
def test_unsuitable_builds_are_passed_over(machine, lie):
    machine.python("path/python3.12", lie=lie)
    good = machine.python("path/python3.14", (3, 14, 0))
    assert machine.found() == good


def test_variable_python_goes_first(machine):
    machine.python("path/python3.12")
    chosen = machine.python("chosen/python", (3, 13, 0))
    assert machine.found(PYTHON=chosen) == chosen


@pytest.mark.parametrize(
    ("name", "reason"), [("python3", "3.11.7"), ("/no/such/python", "cannot be run")]
)
def test_unsuitable_variable_python_is_not_replaced_silently(machine, name, reason):
    machine.python("path/python3.12")
    answer = machine.find(PYTHON=name)
    assert answer.returncode == 1
    assert answer.stdout == ""
    assert f"PYTHON={name}" in answer.stderr
    assert reason in answer.stderr


def test_none_names_what_is_there_and_the_remedies(machine):
    venvless = machine.python("path/python3.12", lie='sys.modules["ensurepip"] = None')
    answer = machine.find()
    assert answer.returncode == 1
    assert answer.stdout == ""
    assert "3.12 or newer" in answer.stderr
    assert f"{machine.path / 'python3'} is Python 3.11.7" in answer.stderr
    assert f"{venvless} is Python 3.12.1 without venv" in answer.stderr
    for remedy in ("apt-get install", "uv python install", "pyenv install", "make PYTHON="):
        assert remedy in answer.stderr
    assert "Traceback" not in answer.stderr
    assert "command not found" not in answer.stderr

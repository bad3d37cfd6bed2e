"""Typical mistakes in scenes with the messages that the code gives for them."""

import tempfile
from pathlib import Path
from textwrap import fill
from typing import NamedTuple

from impactfem.errors import ImpactError
from impactfem.planning import plan
from impactfem.scene import Scene
from impactfem.shipped import shipped_scenes


class Mistake(NamedTuple):
    """A change of a shipped scene, and what it stands for."""

    title: str
    scene: str
    old: str
    new: str


MISTAKES = (
    Mistake("A misspelt key", "bar_impact", "density = 1.0", "densty = 1.0"),
    Mistake("A name from a textbook", "bar_impact", "youngs_modulus = 1.0", "E = 1.0"),
    Mistake("A key in the wrong place", "sliding_block", "rayleigh_stiffness = 2e-4 ",
            "friction = 0.3 "),
    Mistake("A unit behind a number", "bar_impact", "length = 1.0 ", "length = 500 mm "),
    Mistake("A decimal comma", "bar_impact", "gap = 0.5 ", "gap = 0,5 "),
    Mistake("Degrees", "dropped_beam", "inclination = 0.5235987755982988", "inclination = 30.0"),
    Mistake("A value out of range", "dropped_disc", "poisson_ratio = 0.4", "poisson_ratio = 0.5"),
    Mistake("A vector of another dimension", "dropped_disc", "gravity = [0.0, -9.81]",
            "gravity = [0.0, 0.0, -9.81]"),
    Mistake("A formula", "oscillator", "cos(50*t)", "cos(50t)"),
    Mistake("A surface that is not there", "mems_switch", 'surface = "left"', 'surface = "lef"'),
    Mistake("Two settings that contradict each other", "sliding_block", "dt = 2e-4 ",
            "courant = 0.5\ndt = 2e-4 "),
    Mistake("A method of other bodies", "sliding_block", 'method = "conserving"',
            'method = "event_driven"'),
    Mistake("A body inside an obstacle", "dropped_disc", "center = [0.0, 0.06]",
            "center = [0.0, 0.04]"),
    Mistake("Two bodies that overlap", "colliding_discs", "center = [0.05, 0.05]",
            "center = [0.0, 0.05]"),
)  # fmt: skip
DOUBTS = (
    Mistake("Gravity upwards", "dropped_disc", "gravity = [0.0, -9.81]", "gravity = [0.0, 9.81]"),
    Mistake("Away from the wall", "bar_impact", "velocity = -0.5 ", "velocity = 0.5 "),
    Mistake("A modulus in GPa", "dropped_beam", "youngs_modulus = 2.1e11", "youngs_modulus = 210"),
)


def said(mistake: Mistake) -> list[str]:
    """What `impactfem validate` says of a mistake: its error, or its warnings.

    Raises:
        ValueError: The scene does not hold the text any more, or nothing is said.
    """
    text = shipped_scenes()[mistake.scene].read_text(encoding="utf-8")
    if text.count(mistake.old) < 1:
        raise ValueError(f"{mistake.title}: {mistake.scene} does not hold {mistake.old!r}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.toml"
        path.write_text(text.replace(mistake.old, mistake.new, 1), encoding="utf-8")
        try:
            warnings = plan(Scene.from_toml(path)).warnings
        except ImpactError as error:
            return [str(error).replace(f"{folder}/", "")]
    if not warnings:
        raise ValueError(f"{mistake.title}: nothing is said")
    return [f"warning: {text}" for text in warnings]


def listing(mistakes: tuple[Mistake, ...]) -> str:
    """Mistakes as Markdown: the changed line, and the message below it."""
    parts = []
    for mistake in mistakes:
        line = mistake.new.strip()
        message = "\n".join(fill(text, 96, subsequent_indent="    ") for text in said(mistake))
        parts.append(
            f"**{mistake.title}** (in `{mistake.scene}`)\n\n```text\n{line}\n```\n\n"
            f"```text\n{message}\n```\n"
        )
    return "\n".join(parts)


PARTS = {"messages": lambda: listing(MISTAKES), "doubts": lambda: listing(DOUBTS)}

"""Actuators and springs in the joints of MJCF files, as formulas of motors.

An actuator with the signal u pushes its joint with g F(g a u + b_0 + b_1 g q + b_2 g v), where g is
its gear, a, b_0, b_1, b_2 its gains and F and u are held within its ranges; a spring with
-k (q - q_0).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from xml.etree import ElementTree as ET

from impactfem.reading.robot_xml import Defaults
from impactfem.scene import Formula

_VARIABLES = ("t", "q", "v", "u")
_KINDS = ("motor", "position", "velocity", "damper", "general")
_PLAIN = {"", "none", "fixed", "affine"}  # gains, biases and dynamics that are read


@dataclass
class Acting:
    """What acts in a joint.

    Attributes:
        actuators: Formulas in q, v and the signal u; the first one takes the signal of the scene.
        springs: In q.
    """

    actuators: list[str] = field(default_factory=list)
    springs: list[str] = field(default_factory=list)

    def formula(self, motor: Formula | None, control: Formula | None) -> Formula | None:
        """In t, q and v; None if nothing acts.

        Args:
            motor: Of the scene, in place of the actuators.
            control: Signal u of the first one, in t, q and v; None: 0.
        """
        names = _VARIABLES[:3]
        own = self.springs if motor is not None else [*self.actuators, *self.springs]
        if not own:
            return motor
        # Each has a signal of its own; what the scene does not give is 0.
        parts = [each if k == 0 else each.replace("u", "0") for k, each in enumerate(own)]
        summed = Formula(" + ".join(parts), _VARIABLES)
        known = {name: Formula(name, names) for name in names}
        signal = control if control is not None else Formula("0", names)
        found = summed.composed(**known, u=signal)
        if motor is None:
            return found
        both = Formula("q + v", ("q", "v"))
        return both.composed(q=motor, v=found)


def acting_in(root: ET.Element, leave: Callable[[str], None]) -> dict[str, Acting]:
    """Actuators and springs of a file by joint; the former are taken out of it.

    Args:
        root: Of the file.
        leave: Is told what is left out.
    """
    known = Defaults(root)
    found: dict[str, Acting] = {}
    joints = {}
    for joint in root.iterfind("worldbody//joint"):
        joints[joint.get("name")] = known.of(joint)
    for name, given in joints.items():
        stiffness = _numbers(given.get("stiffness", "0"))
        if not any(stiffness):
            continue
        if name is None or len(stiffness) > 1 or not _is_single(given):
            leave(f"the spring of joint {name}")
            continue
        (rest,) = _numbers(given.get("springref", "0")) or [0.0]
        found.setdefault(name, Acting()).springs.append(f"{-stiffness[0]!r}*(q - {_text(rest)})")
    for group in root.findall("actuator"):
        for entry in group:
            given = known.of(entry)
            name, label = given.get("joint"), f"actuator {entry.get('name', entry.tag)}"
            if entry.tag not in _KINDS or not _is_plain(given):
                leave(f"{label}: <{entry.tag}> of its kind is not read")
            elif (
                name is None
                or name not in joints
                or joints[name].get("type", "hinge") in {"ball", "free"}
            ):
                leave(f"{label} acts on no joint of one degree of freedom")
            else:
                found.setdefault(name, Acting()).actuators.append(_pushed(entry.tag, given))
        root.remove(group)
    return found


def _is_single(joint: dict[str, str] | None) -> bool:
    return joint is not None and joint.get("type", "hinge") not in {"ball", "free"}


def _is_plain(given: dict[str, str]) -> bool:
    kinds = {given.get(key, "") for key in ("dyntype", "gaintype", "biastype")}
    return kinds <= _PLAIN and not _numbers(given.get("timeconst", "0"))[0]


def _pushed(kind: str, given: dict[str, str]) -> str:
    """Force of an actuator, in q, v and u."""
    gear = _numbers(given.get("gear", "1"))[0]
    gain, bias = 1.0, [0.0, 0.0, 0.0]
    strong, damping = (_numbers(given.get(key, each))[0] for key, each in (("kp", "1"), ("kv", "")))
    if kind == "position":
        gain, bias = strong, [0.0, -strong, -(damping or 0.0)]
    elif kind in {"velocity", "damper"}:
        damping = damping if "kv" in given else 1.0
        gain, bias = (damping, [0.0, 0.0, -damping]) if kind == "velocity" else (0.0, bias)
    elif kind == "general":
        gain = (_numbers(given.get("gainprm", "1")))[0]
        if given.get("biastype") == "affine":
            bias = (_numbers(given.get("biasprm", "0 0 0")) + [0.0] * 3)[:3]
    signal = _held("u", given, "ctrl")
    terms = [f"{_text(gain)}*{signal}", _text(bias[0])]
    terms += [f"{_text(b * gear)}*{of}" for b, of in zip(bias[1:], "qv", strict=True) if b]
    return f"{_text(gear)}*{_held(f'({" + ".join(terms)})', given, 'force')}"


def _held(text: str, given: dict[str, str], what: str) -> str:
    """A formula within a range, where the actuator has one."""
    limits = _numbers(given.get(f"{what}range", ""))
    said = given.get(f"{what}limited", "auto")
    if said == "false" or len(limits) != 2 or not limits[0] < limits[1]:
        return text
    return f"min(max({text}, {_text(limits[0])}), {_text(limits[1])})"


def _numbers(text: str) -> list[float]:
    """Finite numbers of an attribute; 0 for none."""
    found = []
    for word in text.split():
        try:
            found.append(float(word))
        except ValueError:
            found.append(math.nan)
    return [each if math.isfinite(each) else 0.0 for each in found] or [0.0]


def _text(value: float) -> str:
    return f"({value!r})"

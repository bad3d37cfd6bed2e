"""The nearest correct name to a wrong one: misspellings, and other words for the same thing."""

from collections.abc import Iterable, Mapping
from difflib import get_close_matches

from impactfem.scene.values import show

# What other programs and textbooks call it; the first of these keys that is known here is meant.
_SAME: Mapping[str, tuple[str, ...]] = {
    "e": ("youngs_modulus", "restitution"),
    "modulus": ("youngs_modulus",),
    "elastic_modulus": ("youngs_modulus",),
    "elasticity": ("youngs_modulus",),
    "stiffness": ("youngs_modulus",),
    "rho": ("density",),
    "nu": ("poisson_ratio",),
    "mu": ("friction_coefficient",),
    "friction": ("friction_coefficient",),
    "cor": ("restitution",),
    "g": ("gravity",),
    "t": ("duration",),
    "t_end": ("duration",),
    "end_time": ("duration",),
    "time": ("duration",),
    "name": ("title",),
    "timestep": ("dt",),
    "time_step": ("dt",),
    "step": ("dt",),
    "cfl": ("courant",),
    "solver": ("solve", "method"),
    "scheme": ("method",),
    "v": ("velocity",),
    "v0": ("velocity",),
    "speed": ("velocity",),
    "initial_velocity": ("velocity",),
    "omega": ("angular_velocity",),
    "h": ("mesh_size", "height", "elements"),
    "element_size": ("mesh_size",),
    "n": ("elements",),
    "l": ("length",),
    "r": ("radius",),
    "diameter": ("radius",),
    "origin": ("center", "corner", "point"),
    "centre": ("center",),
    "position": ("center", "corner", "point"),
    "center": ("position", "point", "corner", "points"),
    "angle": ("inclination",),
    "bodies": ("body",),
    "obstacles": ("obstacle",),
    "wall": ("obstacle",),
    "contacts": ("contact", "between"),
    "type": ("kind",),
    "file": ("mesh",),
    "pair": ("between",),
    "law": ("impact_law",),
    "formats": ("fields",),
    # words that are values
    "plane": ("half_space", "plane_strain"),
    "floor": ("half_space",),
    "ground": ("half_space",),
    "line": ("half_space",),
    "circle": ("disc", "sphere"),
    "ball": ("sphere", "disc"),
    "rectangle": ("block", "box"),
    "square": ("block", "box"),
    "cuboid": ("block", "box"),
    "brick": ("block", "box"),
    "box": ("block",),
    "tube": ("ring", "cylinder"),
    "particle": ("point",),
    "mass": ("point",),
    "body": ("solid",),
    "elastic": ("solid",),
    "2d": ("plane_strain",),
    "leapfrog": ("explicit",),
    "central_difference": ("explicit",),
    "verlet": ("explicit",),
    "leap_frog": ("explicit",),
    "triangle": ("simplex",),
    "tetrahedron": ("simplex",),
    "quadrilateral": ("hexahedron",),
    "clamped": ("fixed",),
    "fixed": ("clamped",),
    "roller": ("symmetry",),
    "hinge": ("revolute", "simply_supported"),
    "hinged": ("revolute", "simply_supported"),
    "pin": ("revolute", "simply_supported"),
    "pinned": ("revolute", "simply_supported"),
    "pivot": ("revolute",),
    "continuous": ("revolute",),
    "slide": ("prismatic",),
    "slider": ("prismatic",),
    "rail": ("prismatic",),
    "translational": ("prismatic",),
    "spherical": ("ball",),
    "ball_joint": ("ball",),
    "socket": ("ball",),
    "cardan": ("universal",),
    "hooke": ("universal",),
    "weld": ("fixed",),
    "rigid": ("fixed",),
    "rod": ("distance",),
    "rope": ("distance",),
    "cable": ("distance",),
    "paraview": ("vtkhdf",),
    "vtk": ("vtkhdf",),
    "xdmf": ("vtkhdf",),
    "bernoulli": ("euler_bernoulli",),
    # functions in formulas
    "sine": ("sin",),
    "cosine": ("cos",),
    "ln": ("log",),
    "arcsin": ("asin",),
    "arccos": ("acos",),
    "arctan": ("atan",),
    "maximum": ("max",),
    "minimum": ("min",),
    "heaviside": ("where",),
    "step_function": ("where",),
    "if": ("where",),
}

_MOST_LISTED = 30

_SHORT, _CLOSE, _CLOSE_SHORT = 3, 0.6, 0.5  # letters; shares of letters in common


def same_as(word: str) -> tuple[str, ...]:
    """Keys that go by another word elsewhere; none for most."""
    return _SAME.get(word.lower(), ())


def nearest(word: str, known: Iterable[str]) -> str:
    """The known name that is probably meant by a word; empty if none is near."""
    names, small = list(known), word[:80].lower()
    if small in names:
        return small
    same = next((name for name in same_as(word) if name in names), "")
    if same:
        return same
    # Names in capitals, as those of surfaces of a mesh file, are near to the word as it stands.
    return _close(small, names) or _close(word[:80], names)


def meant(word: str, known: Iterable[str]) -> str:
    """What to give for a name that is not known: which is near, and which there are."""
    names, near = list(known), nearest(word, known)
    more = len(names) - _MOST_LISTED
    listed = ", ".join(names[:_MOST_LISTED]) + (f" and {more} more" if more > 0 else "")
    return f"{f'did you mean {show(near)}? Give' if near else 'give'} one of {listed}"


def _close(word: str, names: list[str]) -> str:
    if len(word) > _SHORT:
        return next(iter(get_close_matches(word, names, 1, _CLOSE)), "")
    near = get_close_matches(word, names, 3, _CLOSE_SHORT)
    return min(near, key=lambda name: abs(len(name) - len(word)), default="")

"""impactfem: non-smooth impact dynamics on DOLFINx and PETSc.

Give it a scene; it answers with displacement, contact force and energy, and says how large the
error is and what it cost.

    >>> import impactfem
    >>> scene = impactfem.Scene.from_toml("scene.toml")
    >>> result = impactfem.solve(scene, elements=80)
    >>> result.summary["error"]

Here are the doors and the kinds of bodies; what these are made of, and all else, is in the rooms
`bodies`, `errors`, `exact`, `extend`, `inverse`, `obstacles`, `shapes`, `studies` and `systems`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any
from warnings import warn

if TYPE_CHECKING:
    from impactfem import (
        bodies,
        errors,
        exact,
        extend,
        inverse,
        obstacles,
        shapes,
        studies,
        systems,
    )
    from impactfem.errors import ImpactError, ImpactWarning, SceneError
    from impactfem.extend import register
    from impactfem.facade import Result
    from impactfem.inverse import gradient, identify, optimise
    from impactfem.planning import Plan, plan
    from impactfem.reading.live import LiveMesh
    from impactfem.result.compare import compare
    from impactfem.scene import (
        Bar,
        Beam,
        Contact,
        HalfSpace,
        Joint,
        Mechanism,
        Output,
        Plate,
        Point,
        Probe,
        RigidBody,
        Rod,
        Scene,
        Solid,
        Solve,
        SpringNet,
        Wall,
    )
    from impactfem.simulation import Simulation
    from impactfem.solving import solve
    from impactfem.trajectory import transcribe
    from impactfem.vibro.integrating import integrate

    __version__: str

# Public names and where they live; loaded when first used, so that `import impactfem` is fast.
_HOMES = {
    "Bar": "impactfem.scene",
    "Beam": "impactfem.scene",
    "Contact": "impactfem.scene",
    "HalfSpace": "impactfem.scene",
    "ImpactError": "impactfem.errors",
    "ImpactWarning": "impactfem.errors",
    "Joint": "impactfem.scene",
    "LiveMesh": "impactfem.reading.live",
    "Mechanism": "impactfem.scene",
    "Output": "impactfem.scene",
    "Plan": "impactfem.planning",
    "Plate": "impactfem.scene",
    "Point": "impactfem.scene",
    "Probe": "impactfem.scene",
    "Result": "impactfem.facade",
    "RigidBody": "impactfem.scene",
    "Rod": "impactfem.scene",
    "Scene": "impactfem.scene",
    "SceneError": "impactfem.errors",
    "Solid": "impactfem.scene",
    "Solve": "impactfem.scene",
    "SpringNet": "impactfem.scene",
    "Wall": "impactfem.scene",
    "compare": "impactfem.result.compare",
    "gradient": "impactfem.inverse",
    "identify": "impactfem.inverse",
    "integrate": "impactfem.vibro.integrating",
    "optimise": "impactfem.inverse",
    "plan": "impactfem.planning",
    "register": "impactfem.extend",
    "Simulation": "impactfem.simulation",
    "solve": "impactfem.solving",
    "transcribe": "impactfem.trajectory",
}

_ROOMS = (
    "bodies",
    "errors",
    "exact",
    "extend",
    "inverse",
    "obstacles",
    "shapes",
    "studies",
    "systems",
)

# Names that stood here up to 0.1, and the room that each is in now.
_MOVED = {
    name: room
    for room, names in {
        "bodies": "BeamSupport EdgeSupport FacePressure Formula Layer Limit Orthotropic "
        "PiecewiseConstant PiecewiseVector Pressure Refinement Signal Spring Support Traction",
        "errors": "ConvergenceError MeshError MissingDependencyError OutputError",
        "exact": "ExactBar ExactBarRow RowBar",
        "inverse": "Control Gradient Identified Measure Objective Optimised Parameter Term",
        "obstacles": "RigidBox RigidCylinder RigidMesh RigidPolyline RigidSphere",
        "shapes": "Block Capsule Cylinder Disc DiscOutline Ellipsoid Hull PolygonOutline "
        "RectangleOutline Ring RingOutline Sphere",
        "studies": "Board Comparison Study hard_cases solve_ensemble work_precision",
        "systems": "GeneralizedSystem LinearSystem Trajectory integrate_ensemble",
    }.items()
    for name in names.split()
}

__all__ = [
    "Bar",
    "Beam",
    "Contact",
    "HalfSpace",
    "ImpactError",
    "ImpactWarning",
    "Joint",
    "LiveMesh",
    "Mechanism",
    "Output",
    "Plan",
    "Plate",
    "Point",
    "Probe",
    "Result",
    "RigidBody",
    "Rod",
    "Scene",
    "SceneError",
    "Simulation",
    "Solid",
    "Solve",
    "SpringNet",
    "Wall",
    "__version__",
    "bodies",
    "compare",
    "errors",
    "exact",
    "extend",
    "gradient",
    "identify",
    "integrate",
    "inverse",
    "obstacles",
    "optimise",
    "plan",
    "register",
    "shapes",
    "solve",
    "studies",
    "systems",
    "transcribe",
]


if not TYPE_CHECKING:  # type checkers shall tell names that do not exist

    def __getattr__(name: str) -> Any:
        if name == "__version__":
            value: Any = _installed_version()
        elif name in _HOMES:
            value = getattr(import_module(_HOMES[name]), name)
        elif name in _ROOMS:
            value = import_module(f"impactfem.{name}")
        elif name in _MOVED:
            room = f"impactfem.{_MOVED[name]}"
            text = f"impactfem.{name} has moved to {room}.{name}; its old name ends with 0.3"
            warn(text, DeprecationWarning, stacklevel=2)
            return getattr(import_module(room), name)
        else:
            raise AttributeError(f"module 'impactfem' has no attribute {name!r}")
        globals()[name] = value
        return value


def _installed_version() -> str:
    """The version that was built and installed, which comes from the tags of the repository."""
    from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415  (slow)

    try:
        return version("impactfem")
    except PackageNotFoundError:  # imported from a folder that is not installed
        return "0+unknown"


def __dir__() -> list[str]:
    return __all__

"""impactfem: non-smooth impact dynamics on DOLFINx and PETSc.

Give it a scene; it answers with displacement, contact force and energy, and says how large the
error is and what it cost.

    >>> import impactfem
    >>> scene = impactfem.Scene.from_toml("scene.toml")
    >>> result = impactfem.solve(scene, elements=80)
    >>> result.summary["error"]
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from impactfem.errors import (
        ConvergenceError,
        ImpactError,
        MeshError,
        MissingDependencyError,
        OutputError,
        SceneError,
    )
    from impactfem.exact import ExactBar
    from impactfem.planning import Plan, plan
    from impactfem.report.hard_cases import Board, hard_cases
    from impactfem.report.study import Study
    from impactfem.report.work_precision import work_precision
    from impactfem.result import Result
    from impactfem.scene import (
        Bar,
        Block,
        Cylinder,
        Disc,
        Formula,
        HalfSpace,
        Output,
        PiecewiseConstant,
        PiecewiseVector,
        Pressure,
        Refinement,
        RigidBox,
        RigidCylinder,
        RigidPolyline,
        RigidSphere,
        Ring,
        Scene,
        Solid,
        Solve,
        Sphere,
        Support,
        Traction,
        Wall,
    )
    from impactfem.solving import solve

__version__ = "0.1.0"

# Public names and where they live; loaded when first used, so that `import impactfem` is fast.
_HOMES = {
    "Bar": "impactfem.scene",
    "Block": "impactfem.scene",
    "Board": "impactfem.report.hard_cases",
    "ConvergenceError": "impactfem.errors",
    "Cylinder": "impactfem.scene",
    "Disc": "impactfem.scene",
    "ExactBar": "impactfem.exact",
    "Formula": "impactfem.scene",
    "HalfSpace": "impactfem.scene",
    "ImpactError": "impactfem.errors",
    "MeshError": "impactfem.errors",
    "MissingDependencyError": "impactfem.errors",
    "Output": "impactfem.scene",
    "OutputError": "impactfem.errors",
    "PiecewiseConstant": "impactfem.scene",
    "PiecewiseVector": "impactfem.scene",
    "Plan": "impactfem.planning",
    "Pressure": "impactfem.scene",
    "Refinement": "impactfem.scene",
    "Result": "impactfem.result",
    "RigidBox": "impactfem.scene",
    "RigidCylinder": "impactfem.scene",
    "RigidPolyline": "impactfem.scene",
    "RigidSphere": "impactfem.scene",
    "Ring": "impactfem.scene",
    "Scene": "impactfem.scene",
    "SceneError": "impactfem.errors",
    "Solid": "impactfem.scene",
    "Solve": "impactfem.scene",
    "Sphere": "impactfem.scene",
    "Study": "impactfem.report.study",
    "Support": "impactfem.scene",
    "Traction": "impactfem.scene",
    "Wall": "impactfem.scene",
    "hard_cases": "impactfem.report.hard_cases",
    "plan": "impactfem.planning",
    "solve": "impactfem.solving",
    "work_precision": "impactfem.report.work_precision",
}

__all__ = [
    "Bar",
    "Block",
    "Board",
    "ConvergenceError",
    "Cylinder",
    "Disc",
    "ExactBar",
    "Formula",
    "HalfSpace",
    "ImpactError",
    "MeshError",
    "MissingDependencyError",
    "Output",
    "OutputError",
    "PiecewiseConstant",
    "PiecewiseVector",
    "Plan",
    "Pressure",
    "Refinement",
    "Result",
    "RigidBox",
    "RigidCylinder",
    "RigidPolyline",
    "RigidSphere",
    "Ring",
    "Scene",
    "SceneError",
    "Solid",
    "Solve",
    "Sphere",
    "Study",
    "Support",
    "Traction",
    "Wall",
    "__version__",
    "hard_cases",
    "plan",
    "solve",
    "work_precision",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'impactfem' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__

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
        ImpactWarning,
        MeshError,
        MissingDependencyError,
        OutputError,
        SceneError,
    )
    from impactfem.exact import ExactBar, ExactBarRow, RowBar
    from impactfem.facade import Result
    from impactfem.inverse import Gradient, Identified, Optimised, gradient, identify, optimise
    from impactfem.planning import Plan, plan
    from impactfem.result.compare import Comparison, compare
    from impactfem.result.trajectory import Trajectory
    from impactfem.runs.ensemble import solve_ensemble
    from impactfem.scene import (
        Bar,
        Beam,
        BeamSupport,
        Block,
        Capsule,
        Contact,
        Control,
        Cylinder,
        Disc,
        DiscOutline,
        EdgeSupport,
        FacePressure,
        Formula,
        HalfSpace,
        Hull,
        Joint,
        Layer,
        Limit,
        Measure,
        Mechanism,
        Objective,
        Orthotropic,
        Output,
        Parameter,
        PiecewiseConstant,
        PiecewiseVector,
        Plate,
        Point,
        PolygonOutline,
        Pressure,
        Probe,
        RectangleOutline,
        Refinement,
        RigidBody,
        RigidBox,
        RigidCylinder,
        RigidMesh,
        RigidPolyline,
        RigidSphere,
        Ring,
        RingOutline,
        Rod,
        Scene,
        Solid,
        Solve,
        Sphere,
        Spring,
        SpringNet,
        Support,
        Term,
        Traction,
        Wall,
    )
    from impactfem.scene.signal import Signal
    from impactfem.solving import solve
    from impactfem.studies.hard.cases import Board, hard_cases
    from impactfem.studies.study import Study
    from impactfem.studies.work_precision import work_precision
    from impactfem.system.generalized import GeneralizedSystem, LinearSystem
    from impactfem.vibro.ensemble import integrate_ensemble
    from impactfem.vibro.integrating import integrate

    __version__: str

# Public names and where they live; loaded when first used, so that `import impactfem` is fast.
_HOMES = {
    "Bar": "impactfem.scene",
    "Beam": "impactfem.scene",
    "BeamSupport": "impactfem.scene",
    "Block": "impactfem.scene",
    "Board": "impactfem.studies.hard.cases",
    "Capsule": "impactfem.scene",
    "Comparison": "impactfem.result.compare",
    "Contact": "impactfem.scene",
    "Control": "impactfem.scene",
    "ConvergenceError": "impactfem.errors",
    "Cylinder": "impactfem.scene",
    "Disc": "impactfem.scene",
    "DiscOutline": "impactfem.scene",
    "EdgeSupport": "impactfem.scene",
    "ExactBar": "impactfem.exact",
    "ExactBarRow": "impactfem.exact",
    "FacePressure": "impactfem.scene",
    "Formula": "impactfem.scene",
    "GeneralizedSystem": "impactfem.system.generalized",
    "Gradient": "impactfem.inverse",
    "HalfSpace": "impactfem.scene",
    "Hull": "impactfem.scene",
    "Identified": "impactfem.inverse",
    "ImpactError": "impactfem.errors",
    "ImpactWarning": "impactfem.errors",
    "Joint": "impactfem.scene",
    "Layer": "impactfem.scene",
    "Limit": "impactfem.scene",
    "LinearSystem": "impactfem.system.generalized",
    "Measure": "impactfem.scene",
    "Mechanism": "impactfem.scene",
    "MeshError": "impactfem.errors",
    "MissingDependencyError": "impactfem.errors",
    "Objective": "impactfem.scene",
    "Optimised": "impactfem.inverse",
    "Orthotropic": "impactfem.scene",
    "Output": "impactfem.scene",
    "OutputError": "impactfem.errors",
    "Parameter": "impactfem.scene",
    "PiecewiseConstant": "impactfem.scene",
    "PiecewiseVector": "impactfem.scene",
    "Plan": "impactfem.planning",
    "Plate": "impactfem.scene",
    "Point": "impactfem.scene",
    "PolygonOutline": "impactfem.scene",
    "Pressure": "impactfem.scene",
    "Probe": "impactfem.scene",
    "RectangleOutline": "impactfem.scene",
    "Refinement": "impactfem.scene",
    "Result": "impactfem.facade",
    "RigidBody": "impactfem.scene",
    "RigidBox": "impactfem.scene",
    "RigidCylinder": "impactfem.scene",
    "RigidMesh": "impactfem.scene",
    "RigidPolyline": "impactfem.scene",
    "RigidSphere": "impactfem.scene",
    "Ring": "impactfem.scene",
    "RingOutline": "impactfem.scene",
    "Rod": "impactfem.scene",
    "RowBar": "impactfem.exact",
    "Scene": "impactfem.scene",
    "SceneError": "impactfem.errors",
    "Signal": "impactfem.scene.signal",
    "Solid": "impactfem.scene",
    "Solve": "impactfem.scene",
    "Sphere": "impactfem.scene",
    "Spring": "impactfem.scene",
    "SpringNet": "impactfem.scene",
    "Study": "impactfem.studies.study",
    "Support": "impactfem.scene",
    "Term": "impactfem.scene",
    "Traction": "impactfem.scene",
    "Trajectory": "impactfem.result.trajectory",
    "Wall": "impactfem.scene",
    "compare": "impactfem.result.compare",
    "gradient": "impactfem.inverse",
    "hard_cases": "impactfem.studies.hard.cases",
    "identify": "impactfem.inverse",
    "integrate": "impactfem.vibro.integrating",
    "integrate_ensemble": "impactfem.vibro.ensemble",
    "optimise": "impactfem.inverse",
    "plan": "impactfem.planning",
    "solve": "impactfem.solving",
    "solve_ensemble": "impactfem.runs.ensemble",
    "work_precision": "impactfem.studies.work_precision",
}

__all__ = [
    "Bar",
    "Beam",
    "BeamSupport",
    "Block",
    "Board",
    "Capsule",
    "Comparison",
    "Contact",
    "Control",
    "ConvergenceError",
    "Cylinder",
    "Disc",
    "DiscOutline",
    "EdgeSupport",
    "ExactBar",
    "ExactBarRow",
    "FacePressure",
    "Formula",
    "GeneralizedSystem",
    "Gradient",
    "HalfSpace",
    "Hull",
    "Identified",
    "ImpactError",
    "ImpactWarning",
    "Joint",
    "Layer",
    "Limit",
    "LinearSystem",
    "Measure",
    "Mechanism",
    "MeshError",
    "MissingDependencyError",
    "Objective",
    "Optimised",
    "Orthotropic",
    "Output",
    "OutputError",
    "Parameter",
    "PiecewiseConstant",
    "PiecewiseVector",
    "Plan",
    "Plate",
    "Point",
    "PolygonOutline",
    "Pressure",
    "Probe",
    "RectangleOutline",
    "Refinement",
    "Result",
    "RigidBody",
    "RigidBox",
    "RigidCylinder",
    "RigidMesh",
    "RigidPolyline",
    "RigidSphere",
    "Ring",
    "RingOutline",
    "Rod",
    "RowBar",
    "Scene",
    "SceneError",
    "Signal",
    "Solid",
    "Solve",
    "Sphere",
    "Spring",
    "SpringNet",
    "Study",
    "Support",
    "Term",
    "Traction",
    "Trajectory",
    "Wall",
    "__version__",
    "compare",
    "gradient",
    "hard_cases",
    "identify",
    "integrate",
    "integrate_ensemble",
    "optimise",
    "plan",
    "solve",
    "solve_ensemble",
    "work_precision",
]


if not TYPE_CHECKING:  # type checkers shall tell names that do not exist

    def __getattr__(name: str) -> Any:
        if name == "__version__":
            value: Any = _installed_version()
        elif name in _HOMES:
            value = getattr(import_module(_HOMES[name]), name)
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

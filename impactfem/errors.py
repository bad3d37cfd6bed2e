"""Errors of impactfem: each message names the object, the value and the remedy."""


class ImpactError(Exception):
    """Base of all errors a user can cause or meet; the command line prints its message only."""


class SceneError(ImpactError):
    """A scene cannot be read or contradicts itself."""


class MeshError(ImpactError):
    """A mesh is missing, broken or does not fit the scene."""


class ConvergenceError(ImpactError):
    """A solver stopped without the requested accuracy."""


class MissingDependencyError(ImpactError):
    """A library that the requested task needs is not installed."""


class OutputError(ImpactError):
    """A result cannot be written or read back."""


class ImpactWarning(UserWarning):
    """A result is correct but must be read with care, as an impact without a unique outcome."""

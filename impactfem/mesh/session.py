"""A Gmsh session on rank 0, and the way from its model to a distributed mesh."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from impactfem import fem
from impactfem.errors import MeshError, MissingDependencyError
from impactfem.signals import given_back


def import_gmsh() -> Any:
    """Import Gmsh, saying what is missing if that fails.

    Raises:
        MissingDependencyError: No Gmsh, or a system library that it needs is absent.
    """
    try:
        import gmsh  # noqa: PLC0415  (loads slowly and needs system libraries)
    except (ImportError, OSError) as error:
        raise MissingDependencyError(
            f"Gmsh cannot be loaded ({error}). Remedy: `pip install gmsh` and its system "
            "libraries (README, section Install), or `apt-get install python3-gmsh`."
        ) from error
    return gmsh


@contextmanager
def gmsh_session(what: str = "the mesh") -> Iterator[Any]:
    """Open a silent Gmsh session with an empty model, and close it whatever happens.

    Args:
        what: What the session is for, for messages.

    Raises:
        MeshError: Gmsh raised an error of its own.
    """
    gmsh = import_gmsh()
    own = not gmsh.isInitialized()
    before = None if own else gmsh.model.getCurrent()
    if own:
        with given_back():  # from Gmsh's own PETSc
            # No personal options, as they could change the mesh. interruptible=True would hand
            # SIGINT to the system and skip our own clean-up.
            gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("impactfem")
    try:
        yield gmsh
    except Exception as error:
        if type(error) is not Exception:  # Gmsh raises nothing finer
            raise
        raise MeshError(f"{what}: Gmsh says: {error}; write it again") from error
    finally:
        gmsh.model.remove()
        if before is not None:
            gmsh.model.setCurrent(before)
        if own:
            with given_back():
                gmsh.finalize()


def distribute[T](comm: Any, build: Callable[[Any], T]) -> tuple[Any, Any, T]:
    """Build a model on rank 0 and distribute its mesh.

    Args:
        comm: MPI communicator.
        build: Fills the current model of the Gmsh module it is given; runs on rank 0 only.

    Returns:
        The mesh, its facet tags, and what ``build`` returned (on every rank).

    Raises:
        MeshError: Gmsh failed; on every rank.
    """

    def guarded(gmsh: Any) -> T:
        try:
            return build(gmsh)
        except (MeshError, MissingDependencyError):
            raise
        except Exception as error:
            raise MeshError(f"Gmsh could not make the mesh: {error}") from error

    if comm.rank != 0:
        answer = fem.on_root(comm, _never)
        mesh, facet_tags = fem.mesh_from_gmsh(None, comm)
        return mesh, facet_tags, answer
    with _session_or_failure(comm) as gmsh:
        answer = fem.on_root(comm, lambda: guarded(gmsh))
        mesh, facet_tags = fem.mesh_from_gmsh(gmsh.model, comm)
    return mesh, facet_tags, answer


@contextmanager
def _session_or_failure(comm: Any) -> Iterator[Any]:
    """Open the session; tell the other ranks if even that fails."""
    try:
        import_gmsh()
    except MissingDependencyError as error:
        comm.bcast((None, error), root=0)
        raise
    with gmsh_session() as gmsh:
        yield gmsh


def _never() -> Any:
    """Stand in for an action that only rank 0 performs."""
    return None

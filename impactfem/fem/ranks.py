"""What ranks do together: gather arrays, act on one, raise the error of one on all."""

from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import ImpactError
from impactfem.fem.loading import MPI


def gather(comm: Any, values: Sequence[Any] | NDArray[Any]) -> NDArray[Any]:
    """Concatenate the arrays of all ranks, in rank order, on every rank."""
    return np.concatenate(comm.allgather(np.asarray(values)))


def raise_together(comm: Any, error: ImpactError | None) -> None:
    """Raise the error of the lowest rank that has one on all ranks (collective).

    Raises:
        ImpactError: That error, as it is.
    """
    if not comm.allreduce(error is not None, op=MPI.LOR):
        return
    raise next(found for found in comm.allgather(error) if found is not None)


def on_root[T](comm: Any, action: Callable[[], T]) -> T:
    """Run ``action`` on rank 0 and give every rank its answer, or its error.

    Raises:
        ImpactError: The error of rank 0, on all ranks, so that none waits for ever.
    """
    answer: T | None = None
    failure: ImpactError | None = None
    if comm.rank == 0:
        try:
            answer = action()
        except ImpactError as error:
            failure = error
    answer, failure = comm.bcast((answer, failure), root=0)
    if failure is not None:
        raise failure
    return cast("T", answer)

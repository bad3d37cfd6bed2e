"""Nodes that touch at an arm along the normal of a gap: on the face of a body, not in its middle.

A force in a gap with the weights W of such nodes, at an arm of a length r against its normal n on
the side that carries it, and along it on the other one, acts where these touch. Nodes that follow
with arms r along the axes of space carry that: to w on a node belong -|w| n_k on what follows it
along the axis k, and |w| sum n_k on itself, so that the sum of weights stays.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats, Integers


@dataclass(frozen=True)
class Faces:
    """Nodes that touch on faces.

    Attributes:
        nodes: Among all contact nodes, (several,).
        followers: What follows each along the axes of space, (several, dim).
    """

    nodes: Integers
    followers: Integers

    def reached(self, weights: Floats | csr_matrix, normals: Floats) -> Floats | csr_matrix:
        """Weights of gaps (gaps, nodes) with the arms along their normals (gaps, dim)."""
        size = abs(weights[:, self.nodes])
        if isinstance(weights, np.ndarray):
            found = weights.copy()
            found[:, self.followers] -= size[:, :, None] * normals[:, None]
            found[:, self.nodes] += size * normals.sum(axis=1, keepdims=True)
            return found
        each = size.tocoo()
        values = each.data[:, None] * normals[each.row]
        columns = np.column_stack([self.followers[each.col], self.nodes[each.col]])
        entries = np.column_stack([-values, values.sum(axis=1)]).ravel()
        rows = np.repeat(each.row, columns.shape[1])
        arms = csr_matrix((entries, (rows, columns.ravel())), shape=weights.shape)
        arms.eliminate_zeros()
        return csr_matrix(weights + arms)

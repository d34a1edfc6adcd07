"""Six linear equations by a Cholesky factorisation, compiled: numba's ``np.linalg`` calls LAPACK, slow at this size."""

from __future__ import annotations

import numpy as np

from belie.geometry import FloatArray
from belie.geometry.compiled import compiled


@compiled()
def solve_cholesky_6(A: FloatArray, b: FloatArray) -> bool:
    """Solve ``A x = b`` in place: A becomes its lower factor, b the solution; False where A is not positive definite.

    Examples
    --------
    >>> A, b = 4.0 * np.eye(6), np.arange(6.0)
    >>> solve_cholesky_6(A, b), b.tolist()
    (True, [0.0, 0.25, 0.5, 0.75, 1.0, 1.25])
    >>> solve_cholesky_6(-np.eye(6), b)
    False
    """
    for i in range(6):
        for j in range(i + 1):
            s = A[i, j]
            for k in range(j):
                s -= A[i, k] * A[j, k]
            if i == j:
                if s <= 1e-30:  # callers add 1e-12 to the diagonal: less is round-off
                    return False
                A[i, i] = np.sqrt(s)
            else:
                A[i, j] = s / A[j, j]
    for i in range(6):
        s = b[i]
        for k in range(i):
            s -= A[i, k] * b[k]
        b[i] = s / A[i, i]
    for i in range(5, -1, -1):
        s = b[i]
        for k in range(i + 1, 6):
            s -= A[k, i] * b[k]
        b[i] = s / A[i, i]
    return True

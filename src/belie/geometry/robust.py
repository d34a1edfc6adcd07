"""Robust kernels: how much a residual may say (Huber, "Robust Estimation of a Location Parameter", 1964).

Both functions take the *squared* residual in units of its variance (chi2), as the optimiser has it at
hand. They are compiled, and callable from compiled code.
"""

from __future__ import annotations

import numpy as np

from belie.geometry.compiled import compiled


@compiled(inline=True)
def huber_weight(chi2: float, delta: float) -> float:
    """Weight of the residual in the reweighted normal equations: 1 inside `delta`, ``delta/|r|`` outside.

    Parameters
    ----------
    chi2 : float
        Squared residual over its variance.
    delta : float
        Where the quadratic becomes linear, in standard deviations.

    Examples
    --------
    >>> huber_weight(1.0, 2.0), huber_weight(16.0, 2.0)
    (1.0, 0.5)
    """
    return 1.0 if chi2 <= delta * delta else delta / np.sqrt(chi2)


@compiled(inline=True)
def huber_cost(chi2: float, delta: float) -> float:
    """Cost of the residual: chi2 inside `delta`, ``2 delta |r| - delta^2`` outside.

    >>> huber_cost(1.0, 2.0), huber_cost(16.0, 2.0)
    (1.0, 12.0)
    """
    return chi2 if chi2 <= delta * delta else 2.0 * delta * np.sqrt(chi2) - delta * delta

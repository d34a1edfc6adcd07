"""How belie compiles its hot loops: one decorator, one set of options.

``nogil``: several cameras can be checked in threads. ``cache``: a kernel compiles once a machine, in 1 to
3 s, not once a start. The decorator keeps the function's type, which numba's own hides from type checkers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(*, inline: bool = False, reassociate: bool = False) -> Callable[[Function], Function]:
    """Compile a function of numbers and arrays with numba, on its first call.

    Parameters
    ----------
    inline : bool
        Inline it into compiled callers: for a few arithmetic operations.
    reassociate : bool
        Let the compiler reorder sums, so that they use vector instructions; the last bits may then differ
        between machines.

    Examples
    --------
    >>> import numpy as np
    >>> @compiled()
    ... def total(values):
    ...     s = 0.0
    ...     for v in values:
    ...         s += v
    ...     return s
    >>> total(np.array([1.0, 2.0]))
    3.0
    """
    options: dict[str, Any] = {"cache": True, "nogil": True}
    if inline:
        options["inline"] = "always"
    if reassociate:
        # Made a part of its caller: else a process that compiles calls the first copy of the function, and one that
        # loads from the cache the copy that was optimised again with the caller, whose sums run in another order.
        options |= {"fastmath": {"reassoc", "contract"}, "forceinline": True}

    def decorate(function: Function) -> Function:
        kernel: Function
        try:
            kernel = njit(**options)(function)
        except RuntimeError:
            # Nowhere to keep the machine code (read-only installation, no home): slower to start, no more.
            kernel = njit(**(options | {"cache": False}))(function)
        return kernel

    return decorate

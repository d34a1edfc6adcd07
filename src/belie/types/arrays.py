"""Freezing and checking of the arrays that travel in belie's values."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from belie.geometry import FloatArray


def frozen(value: npt.ArrayLike, shape: tuple[int, ...], name: str) -> FloatArray:
    """A read-only float64 copy of `value`; -1 in `shape` stands for any length.

    Raises
    ------
    ValueError
        On another shape, NaN or infinity.

    Examples
    --------
    >>> frozen([1, 2, 3], (3,), "position_m").flags.writeable
    False
    """
    return frozen_as(value, shape, name, np.float64)


def frozen_as(
    value: npt.ArrayLike, shape: tuple[int, ...], name: str, dtype: npt.DTypeLike
) -> npt.NDArray[Any]:
    """As `frozen`, of another element type: pixels as float32, levels as int8.

    >>> frozen_as([0, 3], (-1,), "level", np.int8).dtype
    dtype('int8')
    """
    array = np.array(value, dtype=dtype)
    fits = array.ndim == len(shape) and all(w in (-1, g) for w, g in zip(shape, array.shape, strict=True))
    if not fits:
        raise ValueError(f"{name} must have shape {shape}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} holds NaN or infinity")
    array.setflags(write=False)
    return array


def read_only(image: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """A view of an image that cannot be written; nothing is copied.

    Frames are read-only, so every picture that is made of one is made so as well: numba compiles a kernel once more
    for arrays that can be written, and that takes a second or two.

    >>> read_only(np.zeros((2, 2), np.uint8)).flags.writeable
    False
    """
    view = image.view()
    view.setflags(write=False)
    return view

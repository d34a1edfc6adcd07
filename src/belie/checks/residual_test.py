"""One residual, tested: systematic errors removed, noise scaled to what is seen, evidence added up over time."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from belie.checks.noise_scale import NoiseScale, NoiseScaleSettings
from belie.checks.sequential import CusumBank, Evidence, SequentialSettings
from belie.checks.systematic import SystematicErrors
from belie.geometry import FloatArray

_SETTLED = 1.5  # times the noise: below it a residual's variance is not that of the systematic errors
_FORETELLS = 4.0  # sigma: so much of a wild frame is expected to be in the next one too
_ABSURD = 1e6  # sigma: beyond it, and where a claim overflows, a jump is a jump


class ResidualTest:
    """Whitens a residual against everything that is no lie, and runs the sequential tests on what is left.

    Nothing is learned from a frame that is contradicted: a lie never becomes the new normal.

    Parameters
    ----------
    components : int
        Length of the residual, and how many more directions of it are tested.
    errors : SystematicErrors
        Parameters that may explain a steady residual.
    tests : int
        How many residual tests share the stated false-alarm rate.

    Examples
    --------
    >>> errors = SystematicErrors(np.array([0.1]), np.array([0.0]))
    >>> test = ResidualTest(1, errors, SequentialSettings(), NoiseScaleSettings(), tests=1)
    >>> rng, H, noise = np.random.default_rng(0), np.eye(1), np.array([[1e-4]])
    >>> clean = [test.update(rng.normal(0, 0.01, 1) + 0.05, H, noise, i * 10**8, 0.1) for i in range(200)]
    >>> any(e.contradicted for e in clean)
    False
    >>> lie = [test.update(rng.normal(0, 0.01, 1) + 0.1, H, noise, i * 10**8, 0.1) for i in range(200, 210)]
    >>> lie[-1].contradicted
    True
    """

    def __init__(
        self,
        components: int,
        errors: SystematicErrors,
        sequential: SequentialSettings,
        noise: NoiseScaleSettings,
        tests: int,
    ) -> None:
        self.errors = errors
        self._scale = NoiseScale(components, noise)
        self._bank = CusumBank(components, sequential, tests)
        self._jump_sigma = sequential.jump_sigma
        self._previous = np.zeros(components)
        self._learning_s, self._learned_s, self._interval_s = noise.learning_s, 0.0, 0.0
        self.sigma = np.full(components, np.inf)

    @property
    def missing_frames(self) -> int:
        """How many believed frames are missing before the noise is known; until then only jumps are caught."""
        by_time = (
            math.ceil((self._learning_s - self._learned_s) / self._interval_s - 1e-6)
            if self._interval_s
            else 0
        )
        return max(self._scale.missing_frames, by_time)

    def update(
        self,
        r: FloatArray,
        H: FloatArray,
        noise: FloatArray,
        stamp_ns: int,
        interval_s: float,
        tested: npt.NDArray[np.bool_] | None = None,
        directions: FloatArray | None = None,
        *,
        still: bool = False,
    ) -> Evidence:
        """Test the residual `r`, shape (m,), with ``r = H θ + noise``; see `SystematicErrors`.

        Components that are not `tested`, shape (components,), prove nothing, and nothing is learned of their noise.
        What is tested beyond the m components of the residual is what it has along `directions`, shape
        (components - m, m). Where the robot stands `still`, all is quiet: what is known of its noise is not given up
        for that.
        """
        self._interval_s = interval_s
        m = len(r)
        plain, scaled, innovation, S, noise, x = self._standardised(r, H, noise, tested, directions)
        self.sigma = np.sqrt(np.diag(scaled))
        white = (x - self._scale.correlation * self._previous) / np.sqrt(1.0 - self._scale.correlation**2)
        evidence = self._bank.update(white, stamp_ns, interval_s, self.missing_frames > 0)
        self._previous = np.clip(x, -_FORETELLS, _FORETELLS)
        if evidence.contradicted:
            self._scale.reject()
        else:
            self._learned_s += interval_s
            settled = np.diag(S) < _SETTLED * np.diag(noise)
            if not still or self.missing_frames > 0:
                self._scale.learn(innovation / np.sqrt(np.diag(S)), tested, settled)
            self.errors.learn(plain, scaled[:m, :m], H, self._bank.calm)
        return evidence

    def is_jump(
        self,
        r: FloatArray,
        H: FloatArray,
        noise: FloatArray,
        tested: npt.NDArray[np.bool_] | None = None,
        directions: FloatArray | None = None,
    ) -> bool:
        """Whether a residual by itself, without all that has been seen before, would be a contradiction."""
        *_, x = self._standardised(r, H, noise, tested, directions)
        return float(np.abs(x).max()) > self._jump_sigma

    def _standardised(
        self,
        r: FloatArray,
        H: FloatArray,
        noise: FloatArray,
        tested: npt.NDArray[np.bool_] | None,
        directions: FloatArray | None,
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Innovation (m,), and along all that is tested: scaled covariance, innovation, its model, noise, score."""
        m = len(r)
        view = np.eye(m) if directions is None else np.concatenate([np.eye(m), directions])
        plain, S_plain = self.errors.innovation(r, H, noise)
        innovation, S, noise = view @ plain, view @ S_plain @ view.T, view @ noise @ view.T
        scale = self._scale.value
        scaled = S + np.outer(scale, scale) * noise - noise
        sigma = np.sqrt(np.diag(scaled))
        x = (innovation - self._scale.offset * np.sqrt(np.diag(S))) / sigma
        x = np.nan_to_num(np.clip(x, -_ABSURD, _ABSURD), nan=_ABSURD)
        if tested is not None:
            x = np.where(tested, x, 0.0)
        return plain, scaled, innovation, S, noise, self._gross(x, plain, scaled[:m, :m], tested)

    def _gross(
        self, x: FloatArray, r: FloatArray, S: FloatArray, tested: npt.NDArray[np.bool_] | None
    ) -> FloatArray:
        """Where all components together are a jump, ``r' S^-1 r``, the largest of them counts for it.

        Sideways motion and rotation may be hard to tell apart, and each by itself little known; what they do
        together to an image is known to a fraction of a pixel.
        """
        known = np.ones(len(r), dtype=bool) if tested is None else tested[: len(r)]
        if not known.any():
            return x
        part = np.where(known, r, 0.0)
        distance2 = float(r[known] @ np.linalg.solve(S[np.ix_(known, known)], r[known]))
        if not distance2 > self._jump_sigma**2:
            return x
        largest = int(np.argmax(np.abs(part) / np.sqrt(np.diag(S))))
        x = x.copy()
        x[largest] = math.copysign(
            max(min(math.sqrt(distance2), _ABSURD), abs(float(x[largest]))), part[largest]
        )
        return x

    def scales(self) -> FloatArray:
        """How many times noisier than its model each component is, shape (components,)."""
        return self._scale.value

    def floor(self, frames: int = 3) -> FloatArray:
        """Steady lie a frame, in the units of each component, found within `frames` frames on average.

        Few frames: later ones count for less, since a lie that is not found at once is partly learned as noise
        or as a systematic error. Whitening costs a steady lie ``(1 - φ) / sqrt(1 - φ²)`` of its size.
        """
        phi = np.maximum(self._scale.correlation, 0.0)
        kept = (1.0 - phi) / np.sqrt(1.0 - phi**2)
        return np.asarray(self._bank.smallest_shift(frames) * self.sigma / kept)

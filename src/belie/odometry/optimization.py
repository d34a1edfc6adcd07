"""Θ of equation (6): the camera pose that fits all pairs best, and the mean error ``e^G`` that remains.

Levenberg-Marquardt over the six parameters of the pose, with a Huber kernel, as ORB-SLAM does with g2o:

    min over T_odom_cam of  sum_i  huber( |z_i - π(T_odom_cam⁻¹ X_i)|² / σ_i² ),   σ_i = scale of level i

The step is a right-hand perturbation ``T_odom_cam exp(xi)``, translation first. The error that is reported is
the plain mean of ``|z_i - ẑ_i|² / σ_i²`` (g2o's chi2) over *all* pairs at the optimum: the kernel guides the
pose, it does not embellish the error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydantic import Field

from belie.geometry import SE3, CameraModel, FloatArray, flat_camera
from belie.odometry.levenberg_marquardt import fit_pose
from belie.types import Settings, frozen


class OptimizationSettings(Settings):
    """Levenberg-Marquardt of equation (6).

    >>> OptimizationSettings().max_iterations
    20
    """

    huber_sigma: float = Field(
        2.447,
        gt=0.0,
        description="Where a residual begins to count linearly [standard deviations]: the 95 % point of"
        " chi2 with two degrees of freedom, as in ORB-SLAM.",
    )
    max_iterations: int = Field(
        20, ge=1, le=200, description="Most accepted or refused steps [count]; five are usual."
    )
    convergence: float = Field(
        1e-7,
        gt=0.0,
        description="Relative decrease of the cost below which the pose has settled [ratio]; well within"
        " 1e-3 deg and 1 mm of the optimum.",
    )
    inlier_chi2: float = Field(
        5.991, gt=0.0, description="Squared error over level variance below which a pair agrees [px^2]."
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OptimizedPose:
    """What Θ gives.

    Parameters
    ----------
    T_odom_cam : SE3
        The pose that fits best.
    covariance : array (6, 6)
        Of the right-hand perturbation ``T_odom_cam exp(xi)``, translation first, m² and rad²: the inverse
        of the normal matrix, for corners of one pixel sigma on level 0.
    error_px2 : float
        ``e^G``: mean over all pairs of the squared reprojection error over level variance.
    chi2 : array (N,)
        The same, pair by pair; infinite where the point is behind the camera.
    predicted_px : array (N, 2)
        ẑ at the best pose; NaN where the point is not in view.
    """

    T_odom_cam: SE3
    covariance: FloatArray
    error_px2: float
    chi2: FloatArray
    predicted_px: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", frozen(self.covariance, (6, 6), "covariance"))


def _covariance(H: FloatArray) -> FloatArray:
    """Inverse of the normal matrix; directions that no pair constrains get a huge variance."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(H), 1e-12))
    values, vectors = np.linalg.eigh(H * np.outer(scale, scale))
    inverse = (vectors / np.maximum(values, 1e-12)) @ vectors.T
    return np.asarray(inverse * np.outer(scale, scale))


def optimize_pose(
    camera: CameraModel,
    T_odom_cam: SE3,
    points_m: FloatArray,
    observed_px: npt.NDArray[np.floating],
    sigma_px: npt.NDArray[np.floating],
    settings: OptimizationSettings,
) -> OptimizedPose:
    """Pose that fits the pairs best, and what error remains: Θ of equation (6).

    Parameters
    ----------
    camera : CameraModel
    T_odom_cam : SE3
        Predicted pose, where the search begins.
    points_m : array (N, 3)
        Map points, odom coordinates.
    observed_px : array (N, 2)
        Their corners, full-resolution pixels.
    sigma_px : array (N,)
        Standard deviation of each corner: the scale of its pyramid level.
    settings : OptimizationSettings

    Returns
    -------
    OptimizedPose

    Raises
    ------
    ValueError
        With fewer than three pairs, or arrays of different lengths.

    Examples
    --------
    >>> camera = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
    >>> points = np.random.default_rng(0).uniform([-2, -2, 4], [2, 2, 9], (50, 3))
    >>> T_odom_cam = SE3.exp([0.1, -0.05, 0.2, 0.01, 0.02, -0.01])
    >>> observed = camera.project(T_odom_cam.inverse().apply(points))
    >>> found = optimize_pose(
    ...     camera, SE3.identity(), points, observed, np.ones(50), OptimizationSettings())
    >>> found.T_odom_cam.is_close(T_odom_cam, 1e-6), found.error_px2 < 1e-9
    (True, True)
    """
    points = np.ascontiguousarray(points_m, dtype=np.float64)
    observed = np.ascontiguousarray(observed_px, dtype=np.float64)
    sigma = np.ascontiguousarray(sigma_px, dtype=np.float64)
    if not (points.shape == (len(sigma), 3) and observed.shape == (len(sigma), 2) and len(sigma) >= 3):
        raise ValueError(
            f"a pose needs three pairs or more of equal number, got points {points.shape},"
            f" observed {observed.shape}, sigma {sigma.shape}"
        )
    R, t, H, chi2, predicted = fit_pose(
        flat_camera(camera),
        np.array(T_odom_cam.R),
        np.array(T_odom_cam.t),
        points,
        observed,
        1.0 / sigma**2,
        settings.huber_sigma,
        settings.max_iterations,
        settings.convergence,
    )
    return OptimizedPose(
        T_odom_cam=SE3(R, t),
        covariance=_covariance(H),
        error_px2=float(chi2.mean()),
        chi2=chi2,
        predicted_px=predicted,
    )

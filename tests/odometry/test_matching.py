"""Ψ of equation (6), against the obvious implementation."""

import numpy as np
import pytest

from belie.geometry import SE3
from belie.odometry.matching import MatchingSettings, match_nearest
from belie.odometry.prediction import Prediction
from belie.types import Features

SCALE = 1.5


def random_case(seed, points=400, corners=600):
    rng = np.random.default_rng(seed)
    size = (1241, 376)
    prediction = Prediction(
        T_odom_cam=SE3.identity(),
        index=np.arange(points),
        px=rng.uniform(0, size, (points, 2)),
        level=rng.uniform(-0.5, 4.0, points),
    )
    features = Features(
        px=rng.uniform((-0.4, -0.4), size, (corners, 2)),
        level=np.sort(rng.integers(0, 4, corners)),
        score=np.ones(corners),
    )
    return prediction, features


def brute_force(prediction, features, settings):
    pairs = {}
    for i, (px, level) in enumerate(zip(prediction.px, prediction.level, strict=True)):
        distance = np.linalg.norm(features.px.astype(float) - px, axis=1)
        allowed = np.abs(features.level - level) <= settings.max_level_difference
        allowed &= distance <= settings.window_px * SCALE ** max(level, 0.0)
        if allowed.any():
            pairs[i] = int(np.flatnonzero(allowed)[np.argmin(distance[allowed])])
    return pairs


@pytest.mark.parametrize("window_px", [3.0, 15.0, 60.0])
@pytest.mark.parametrize("seed", range(4))
def test_is_the_nearest_of_a_similar_level_in_the_window(seed, window_px):
    prediction, features = random_case(seed)
    settings = MatchingSettings(window_px=window_px)
    pairs = match_nearest(prediction, features, settings, SCALE)
    found = dict(zip(pairs.predicted.tolist(), pairs.observed.tolist(), strict=True))
    assert found == brute_force(prediction, features, settings)
    assert len(pairs) > 0


def test_window_grows_with_the_level():
    prediction = Prediction(
        T_odom_cam=SE3.identity(), index=np.arange(2), px=np.full((2, 2), 50.0), level=np.array([0.0, 2.0])
    )
    features = Features(px=[[50 + 20, 50], [50 + 20, 50]], level=[0, 2], score=[1, 1])
    pairs = match_nearest(prediction, features, MatchingSettings(), SCALE)
    assert (pairs.predicted.tolist(), pairs.observed.tolist()) == ([1], [1])


def test_nothing_to_match():
    prediction, features = random_case(0)
    none = Features(px=np.empty((0, 2)), level=[], score=[])
    assert len(match_nearest(prediction, none, MatchingSettings(), SCALE)) == 0
    nobody = Prediction(T_odom_cam=SE3.identity(), index=np.arange(0), px=np.empty((0, 2)), level=np.empty(0))
    assert len(match_nearest(nobody, features, MatchingSettings(), SCALE)) == 0

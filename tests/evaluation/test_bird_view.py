"""Positions in axes of their own are laid onto what the camera saw; alert parts are marked."""

from dataclasses import replace

import numpy as np
import pytest

from belie.evaluation.bird_view import alerts_on_motion, bird_view
from belie.types import Alert, AlertType


def test_positions_are_turned_onto_the_seen_path(made_run):
    view = bird_view(made_run(60))
    (placed,) = view.positions
    assert placed.source == "/gnss"
    assert placed.points[::10] == pytest.approx(view.seen[::10], abs=1e-6)
    assert not view.in_alert.any()


def test_alerts_are_marked_from_onset_to_end_and_do_not_bend_the_positions(made_run):
    view = bird_view(made_run(60, onset=30, end=40))
    assert np.flatnonzero(view.in_alert).tolist() == list(range(30, 40))
    assert view.apart_m[35] == pytest.approx(1.2)
    assert view.ahead_name == "ahead at the start"


def test_a_lie_about_an_object_is_none_about_the_trajectory(made_run):
    run = made_run(60, onset=30, end=40)
    (traced,) = run.alerts
    alert = Alert(type=AlertType.OBSTACLE_HIDING, source="/detections", onset_ns=traced.raised.alert.onset_ns)
    run = replace(run, alerts=(replace(traced, raised=replace(traced.raised, alert=alert)),))
    assert alerts_on_motion(run) == []
    assert not bird_view(run).in_alert.any()

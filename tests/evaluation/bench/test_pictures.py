"""Pictures that are kept and played again: the drive is the same, and fresh sensors err anew."""

import numpy as np
import pytest

from belie.evaluation.bench.pictures import Pictures
from belie.simulation.scenario import load_scenario
from belie.simulation.simulate import SimulatedRecording
from belie.types import DetectionClaim, PoseClaim, PositionClaim


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    pytest.importorskip("moderngl")
    scenario = load_scenario("street-straight", duration_s=1.0, width=160, height=120, frame_rate_hz=5)
    found = Pictures(scenario=scenario, cache=tmp_path_factory.mktemp("cache"))
    found.render()
    return found


def values(steps):
    """Words and numbers of all claims, apart."""
    words, numbers = [], []
    for step in steps:
        for claim in step.claims:
            words.append((type(claim).__name__, claim.source, claim.stamp_ns))
            if isinstance(claim, DetectionClaim):
                words += [(d.track_id, d.label) for d in claim.detections]
                numbers += [x for d in claim.detections for x in d.box_px]
            elif isinstance(claim, PoseClaim):
                numbers += [*claim.T_odom_body.t]
            elif isinstance(claim, PositionClaim):
                numbers += [*claim.position_m]
    return words, np.array(numbers)


def test_kept_pictures_give_the_claims_that_rendering_gives(pictures):
    direct = list(SimulatedRecording(pictures.scenario).steps())
    _, kept = pictures.steps()
    (words, numbers), (true_words, true_numbers) = values(kept), values(direct)
    assert words == true_words
    np.testing.assert_allclose(
        numbers, true_numbers, atol=0.02
    )  # true boxes are kept to a hundredth of a pixel
    for a, b in zip(kept, direct, strict=True):
        assert a.frame.stamp_ns == b.frame.stamp_ns
        assert np.abs(a.frame.image.astype(int) - b.frame.image).mean() < 3.0  # JPEG
    assert any(step.decode_ms > 0.0 for step in kept)


def test_fresh_sensors_err_anew_before_the_same_pictures(pictures):
    _, first = pictures.steps(1)
    _, second = pictures.steps(2)
    (_, a), (_, b) = values(first), values(second)
    assert len(a) != len(b) or np.abs(a - b).max() > 0.01
    assert all(np.array_equal(a.frame.image, b.frame.image) for a, b in zip(first, second, strict=True))


def test_the_true_objects_of_every_frame_are_kept(pictures):
    rendered = []
    for _ in SimulatedRecording(pictures.scenario, on_view=rendered.append).steps():
        pass
    kept = pictures.labels()
    assert [[o.id for o in labels] for labels in kept] == [[o.id for o in view.labels] for view in rendered]
    assert any(kept)
    np.testing.assert_allclose(kept[0][0].box_px, rendered[0].labels[0].box_px, atol=0.01)


def test_what_is_there_is_not_rendered_again(pictures):
    before = pictures.bag.stat().st_size, pictures.bag.stat().st_ino
    pictures.render(on_frame=lambda: pytest.fail("rendered again"))
    assert (pictures.bag.stat().st_size, pictures.bag.stat().st_ino) == before


def test_another_picture_has_another_name(pictures, tmp_path):
    def bag(**changes):
        return Pictures(scenario=pictures.scenario.model_copy(update=changes), cache=tmp_path).bag

    assert len({bag(), bag(seed=2), bag(weather="night"), bag(width=320), bag(duration_s=2.0)}) == 5

"""The camera check: silent on honest images however poor, quick on frozen, replayed, black, covered ones."""

import cv2
import numpy as np
import pytest

from belie.checks.camera import CameraCheck
from belie.checks.camera_settings import CameraSettings
from belie.geometry import SE3, CameraModel
from belie.odometry.visual_odometry import VisualOdometry
from belie.types import Frame, Status, VisualEstimate

FOCAL_PX = {"kitti00": 718.856, "handheld": 420.5}
DEPTH_M = {"kitti00": 10.0, "handheld": 0.4}
INTERVAL_S = {"kitti00": 0.1, "handheld": 1 / 30, "carla_crossing": 0.3}
IMAGES = {"kitti00": "image_0", "handheld": "images", "carla_crossing": "images"}


def estimate_of(inliers, reason=None):
    return VisualEstimate(
        stamp_ns=1,
        previous_stamp_ns=0,
        T_prev_cur=SE3.identity(),
        covariance=np.eye(6),
        corners=200,
        matches=inliers,
        inliers=inliers,
        parallax_px=0.0,
        reason=reason if inliers else reason or "lost",
    )


class Drive:
    """Images, and what honest claims say of each interval."""

    def __init__(self, data_dir, name, count=70):
        paths = sorted(p for p in (data_dir / name / IMAGES[name]).iterdir() if p.suffix in (".png", ".jpg"))
        self.images = [cv2.imread(str(p), cv2.IMREAD_GRAYSCALE) for p in paths[:count]]
        self.name, self.interval_s = name, INTERVAL_S[name]
        self.poses = self._poses(data_dir / name / "poses.txt")

    def _poses(self, path):
        if self.name == "carla_crossing":
            return [SE3.identity()] * len(self.images)
        rows = np.loadtxt(path)[: len(self.images)]
        if self.name == "kitti00":
            return [SE3(row.reshape(3, 4)[:, :3], row.reshape(3, 4)[:, 3]) for row in rows]
        return [SE3(cv2.Rodrigues(row[:3])[0], row[3:]).inverse() for row in rows]

    def motion(self, a, b):
        """Claimed flow by stream, and claimed speed, from image a to image b."""
        if self.name == "carla_crossing":
            return {"/odom": 0.1, "/imu": 0.1}, 0.0
        T = self.poses[a].inverse() @ self.poses[b]
        turn = FOCAL_PX[self.name] * float(np.linalg.norm(T.log()[3:]))
        distance = float(np.linalg.norm(T.t))
        flow = float(np.hypot(turn, FOCAL_PX[self.name] * distance / DEPTH_M[self.name]))
        return {"/odom": flow, "/localisation": 1.05 * flow}, distance / (b - a) / self.interval_s

    def check(self, images, numbers=None, streams=2, speed=False, lost_at=None):
        """Results, onsets and looks of a check that is shown `images`, the numbers-th of the drive.

        `lost_at`: the frame at which an odometry beside it loses its corners; without, there is none.
        """
        numbers = list(numbers) if numbers is not None else list(range(len(images)))
        check, seen = CameraCheck("/image"), []
        for k, (number, image) in enumerate(zip(numbers, images, strict=True)):
            frame = Frame(
                camera="/image",
                stamp_ns=int(number * self.interval_s * 1e9),
                received_ns=0,
                image=image,
            )
            flow, speed_m_s = self.motion(numbers[k - 1], number) if k else ({}, 0.0)
            flow = dict(list(flow.items())[:streams])
            unusable = check.look(frame)
            seen_corners = 0 if number == lost_at else 200
            estimate = None if unusable or lost_at is None else estimate_of(seen_corners)
            result = check.update(frame, estimate, flow, speed_m_s if speed else None)
            seen.append((result, check.onset_ns, unusable))
        return seen


@pytest.fixture(scope="module", params=["kitti00", "handheld", "carla_crossing"])
def drive(data_dir, request):
    return Drive(data_dir, request.param)


@pytest.fixture(scope="module", params=["kitti00", "handheld"])
def moving(data_dir, request):
    return Drive(data_dir, request.param)


@pytest.fixture(scope="module")
def street(data_dir):
    return Drive(data_dir, "kitti00")


def jpeg(image, quality):
    return cv2.imdecode(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], 0)


def grainy(image, sigma, seed):
    noise = np.random.default_rng(seed).normal(0.0, sigma, image.shape)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


def lit(image, gain):
    return np.clip(image * gain, 0, 255).astype(np.uint8)


def exposures(images):
    gains = np.random.default_rng(0).uniform(0.5, 2.0, len(images))
    return [lit(image, gains[k // 7]) for k, image in enumerate(images)]


def gammas(images):
    powers = np.random.default_rng(1).uniform(0.5, 2.0, len(images))
    return [(255 * (image / 255.0) ** powers[k // 7]).astype(np.uint8) for k, image in enumerate(images)]


HONEST = {
    "as recorded": lambda images: images,
    "JPEG 60": lambda images: [jpeg(image, 60) for image in images],
    "exposure jumps": exposures,
    "gamma jumps": gammas,
    "blur": lambda images: [cv2.GaussianBlur(image, (0, 0), 3) for image in images],
    "blur on and off": lambda images: [
        cv2.GaussianBlur(image, (0, 0), 4) if k // 10 % 2 else image for k, image in enumerate(images)
    ],
    "noise": lambda images: [grainy(image, 5, k) for k, image in enumerate(images)],
    "lone duplicates": lambda images: [images[k - (k % 6 == 5)] for k in range(len(images))],
    "lone re-encoded duplicates": lambda images: [
        jpeg(images[k - 1], 60) if k % 6 == 5 else image for k, image in enumerate(images)
    ],
    "each image twice": lambda images: [images[k - k % 2] for k in range(len(images))],
    "each image three times": lambda images: [images[k - k % 3] for k in range(len(images))],
    "each image twice, re-encoded": lambda images: [
        jpeg(images[k - k % 2], 50 + k % 7) for k in range(len(images))
    ],
    "flashes": lambda images: [
        np.full_like(image, 255) if k % 15 == 12 else image for k, image in enumerate(images)
    ],
    "dusk": lambda images: [lit(image, max(0.0, 1 - k / 40)) for k, image in enumerate(images)],
    "fog": lambda images: [
        cv2.addWeighted(image, max(0.0, 1 - k / 40), np.full_like(image, 150), min(1.0, k / 40), 0)
        for k, image in enumerate(images)
    ],
}


@pytest.mark.parametrize("how", HONEST)
def test_honest_images_are_never_accused(drive, how):
    for result, onset_ns, _ in drive.check(HONEST[how](drive.images)):
        assert result.status is not Status.CONTRADICTED, result.reason
        assert result.status is Status.CONSISTENT or result.reason
        assert onset_ns is None


@pytest.mark.parametrize("kept", ["80 %", "every third"])
def test_dropped_frames_are_no_fault(drive, kept):
    rng = np.random.default_rng(2)
    count = len(drive.images)
    numbers = [k for k in range(count) if (rng.random() > 0.2 if kept == "80 %" else k % 3 == 0)]
    seen = drive.check([drive.images[k] for k in numbers], numbers)
    assert {result.status for result, _, _ in seen} == {Status.CONSISTENT}


def cover(image, patch):
    height, width = patch.shape
    top, left = (image.shape[0] - height) // 2, (image.shape[1] - width) // 2
    covered = image.copy()
    covered[top : top + height, left : left + width] = patch
    return covered


def patch_of(image, texture, k):
    size = (round(image.shape[1] * 0.95), round(image.shape[0] * 0.95))
    if texture == "gray":
        return np.full(size[::-1], 110, np.uint8)
    if texture == "blurred":
        return (0.1 * cv2.resize(cv2.GaussianBlur(image, (0, 0), 25), size) + 90).astype(np.uint8)
    stripes = 120 + 60 * np.sin(np.arange(size[0]) / 17.0) * np.cos(np.arange(size[1]) / 13.0)[:, None]
    return grainy(stripes, 2, k)


ATTACKS = {
    "freeze": lambda images, onset, k: images[onset - 1],
    "freeze with noise": lambda images, onset, k: grainy(images[onset - 1], 2, k),
    "freeze re-encoded": lambda images, onset, k: jpeg(images[onset - 1], 50 + k % 7),
    "replay": lambda images, onset, k: images[k - 20],
    "replay of longer ago": lambda images, onset, k: images[k - 25],
    "replay re-encoded": lambda images, onset, k: jpeg(images[k - 20], 60),
    "replay with noise": lambda images, onset, k: grainy(images[k - 22], 2, k),
    "replay backwards": lambda images, onset, k: jpeg(images[2 * onset - 9 - k], 60),
    "black": lambda images, onset, k: np.zeros_like(images[k]),
    "black with noise": lambda images, onset, k: grainy(np.zeros_like(images[k]), 2, k),
    "white": lambda images, onset, k: np.full_like(images[k], 255),
    "plain cover": lambda images, onset, k: cover(images[k], patch_of(images[k], "gray", k)),
    "blurred cover": lambda images, onset, k: cover(images[k], patch_of(images[k], "blurred", k)),
    "textured cover": lambda images, onset, k: cover(images[k], patch_of(images[k], "stripes", k)),
}


@pytest.mark.parametrize("how", ATTACKS)
def test_attacks_are_found_within_three_frames(moving, how):
    for onset in range(30, 65, 3):
        images = list(moving.images[: onset + 4])
        for k in range(onset, onset + 4):
            images[k] = ATTACKS[how](moving.images, onset, k)
        start = onset - 28
        lost_at = onset if "cover" in how else None
        seen = moving.check(images[start:], range(start, onset + 4), lost_at=lost_at)
        accused = [k + start for k, (result, _, _) in enumerate(seen) if result.status is Status.CONTRADICTED]
        assert accused, (onset, seen[-1][0].reason)
        assert onset <= accused[0] <= onset + 2
        assert seen[accused[0] - start][1] == int(onset * moving.interval_s * 1e9)


@pytest.mark.parametrize("texture", ["gray", "stripes"])
def test_a_cover_is_found_with_the_odometry_beside_it(street, texture):
    """As above with one claim and the corners really tracked: it is the odometry that sees the scene go."""
    onset = 14
    model = CameraModel(width=1241, height=376, fx=718.856, fy=718.856, cx=607.1928, cy=185.2157)
    odometry, check, accused = VisualOdometry(model), CameraCheck("/image"), []
    for k in range(onset + 3):
        image = street.images[k]
        shown_image = image if k < onset else cover(image, patch_of(image, texture, k))
        frame = Frame(camera="/image", stamp_ns=k * 10**8, received_ns=0, image=shown_image)
        unusable = check.look(frame)
        estimate = None if unusable else odometry.update(frame)
        flow = {"/odom": street.motion(k - 1, k)[0]["/odom"]} if k else {}
        if check.update(frame, estimate, flow).status is Status.CONTRADICTED:
            accused.append(k)
    assert accused == [onset + 2]
    assert check.onset_ns == onset * 10**8


def test_an_image_that_stops_at_once_judges_nobody_in_its_first_frame(moving):
    images = [*moving.images[:30], grainy(moving.images[29], 2, 0)]
    assert [unusable for *_, unusable in moving.check(images)][-2:] == [False, True]


def test_one_stream_against_a_plausible_stop_is_undecided(street):
    images = [*street.images[:30], *(grainy(street.images[29], 2, k) for k in range(6))]
    result, *_ = street.check(images, streams=1)[-1]
    assert result.status is Status.UNDECIDED
    assert result.reason == "the image does not move, /odom says that it does: one stream against the camera"


def test_one_stream_suffices_where_no_robot_could_stop_so_quickly(street):
    images = [*street.images[:30], *(grainy(street.images[29], 2, k) for k in range(6))]
    assert street.check(images, streams=1, speed=True)[31][0].status is Status.CONTRADICTED


def test_repeats_without_claims_are_no_accusation_of_being_frozen(street):
    images = [*street.images[:30], *[street.images[29]] * 9]
    assert {r.status for r, *_ in street.check(images, streams=0)} == {Status.CONSISTENT}


def test_a_replay_is_found_without_claims(street):
    images = [*street.images[:40], *street.images[10:16]]
    seen = street.check(images, streams=0)
    assert next(k for k, (r, *_) in enumerate(seen) if r.status is Status.CONTRADICTED) == 42


def shown(check, images, flows, period_ns=10**8):
    results = []
    for k, (image, flow) in enumerate(zip(images, flows, strict=True)):
        frame = Frame(camera="/image", stamp_ns=k * period_ns, received_ns=0, image=image)
        unusable = check.look(frame)
        results.append((check.update(frame, None, flow), unusable))
    return results


def wall(offset):
    rng = np.random.default_rng(3)
    texture = cv2.resize(rng.integers(0, 256, (60, 300), dtype=np.uint8), (2400, 480))
    return np.ascontiguousarray(texture[:, offset : offset + 640])


def test_a_rendered_robot_may_stand_still():
    images = [wall(12 * k) for k in range(20)] + [wall(228)] * 30 + [wall(228 + 12 * k) for k in range(20)]
    flows = [{"/odom": 12.0, "/imu": 12.0}] * 20 + [{"/odom": 0.1, "/imu": 0.0}] * 30
    flows += [{"/odom": 12.0, "/imu": 12.0}] * 20
    flows[50] = flows[49]
    assert {r.status for r, _ in shown(CameraCheck("/image"), images, flows)} == {Status.CONSISTENT}


def test_a_lie_at_a_rendered_standstill_is_not_blamed_on_the_camera():
    images = [wall(12 * k) for k in range(20)] + [wall(228)] * 30
    flows = [{"/odom": 12.0}] * 20 + [{"/odom": 0.0}] * 20 + [{"/odom": 12.0}] * 10
    last, _ = shown(CameraCheck("/image"), images, flows)[-1]
    assert last.status is Status.UNDECIDED
    assert "/odom says that it does" in last.reason


def test_a_fault_ends_when_normal_images_are_back():
    images = [wall(12 * k) for k in range(20)] + [wall(228)] * 5 + [wall(300 + 12 * k) for k in range(30)]
    check = CameraCheck("/image", CameraSettings(release_s=1.0))
    seen = shown(check, images, [{"/odom": 12.0}] * len(images))
    accused = [k for k, (result, _) in enumerate(seen) if result.status is Status.CONTRADICTED]
    assert accused == list(range(21, 34))  # the last frozen image is number 24
    assert seen[-1][0].status is Status.CONSISTENT
    assert check.onset_ns is None


def test_no_view_of_the_odometry_gives_its_reason():
    check = CameraCheck("/image")
    frame = Frame(camera="/image", stamp_ns=0, received_ns=0, image=wall(0))
    check.look(frame)
    nothing = estimate_of(0, "too few corners: 9")
    result = check.update(frame, nothing, {})
    assert (result.status, result.reason) == (Status.UNDECIDED, "too few corners: 9")


def test_misuse_is_refused():
    frame = Frame(camera="/image", stamp_ns=0, received_ns=0, image=wall(0))
    check = CameraCheck("/image")
    with pytest.raises(ValueError, match="look"):
        check.update(frame, None, {})
    check.look(frame)
    with pytest.raises(ValueError, match="0 or more"):
        check.update(frame, None, {"/odom": float("nan")})

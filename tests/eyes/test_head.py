"""Pan-tilt heads: kinematics, bearing, and a gaze that finds and keeps the ball."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.ball.filter import THROWN_BALL, BallFilter
from mitt.core.ball.flight import advance
from mitt.core.errors import InputError, ShapeError
from mitt.core.eyes.camera import Head, Rig, look_at
from mitt.core.eyes.eyes import Eyes, EyesStatus
from mitt.core.eyes.head import active_rig, aim_heads, bearing, lead, pack_heads, pose_of
from mitt.core.eyes.localization import eyes_handle
from mitt.core.eyes.panorama import PANORAMA
from mitt.core.eyes.segmentation import GOOD
from mitt.core.signals import Array, Frame
from mitt.lab.world.imaging import Imager, ImageSensor

ANGLE = st.floats(-1.2, 1.2)
COORDINATE = st.floats(-3.0, 3.0)


def turned(axis: Array, angle: float) -> Array:
    """Return the rotation about a unit axis by Rodrigues' formula, shape (3, 3)."""
    x, y, z = axis
    K = np.array(((0, -z, y), (z, 0, -x), (-y, x, 0)))
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)


@given(ANGLE, ANGLE)
def test_a_pose_is_two_turns_about_the_axes(pan: float, tilt: float) -> None:
    """The pose of the camera is that of two rotations, the lens carried by both."""
    head = Head(
        T_world_base=look_at(np.array((0.1, 0.2, 0.3)), np.array((3.0, 1.0, 0.5))),
        lens=np.array((0.01, -0.02, 0.04)),
    )
    T = pose_of(head, pan, tilt)
    R = turned(np.array((0.0, 1.0, 0.0)), pan) @ turned(np.array((1.0, 0.0, 0.0)), tilt)
    base = head.T_world_base
    assert T[:3, :3] == pytest.approx(base[:3, :3] @ R, abs=1e-12)
    assert T[:3, 3] == pytest.approx(base[:3, 3] + base[:3, :3] @ R @ head.lens, abs=1e-12)


@pytest.mark.parametrize("size", [1e80, 1e160, 1e300])
def test_a_bearing_is_finite_wherever_the_point_is(size: float) -> None:
    """Squares overflow from 1e154 on; angles and rates stay numbers."""
    heads, goal = pack_heads(active_rig()), np.empty(4)
    for signs in ((1.0, -1.0, 1.0), (-1.0, 1.0, 1.0), (1.0, 1.0, -1.0)):
        r = size * np.array(signs)
        for v in (np.array([1.0, 2.0, -3.0]), -r, r[::-1]):
            bearing(heads[0], r, v, goal)
            assert np.all(np.isfinite(goal))


@given(st.floats(1.0, 5.0), COORDINATE, COORDINATE, COORDINATE, COORDINATE, COORDINATE)
def test_a_bearing_puts_the_point_into_the_middle_and_its_rate_is_its_derivative(
    x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> None:
    """A head turned to a bearing sees the point at the principal point; rates by differences."""
    rig = active_rig()
    eyes = Eyes(rig).memory
    r, v, wanted, h = np.array((x, y, z)), np.array((dx, dy, dz)), np.empty(4), 1e-6
    goals = np.empty((2, 4))
    for n in range(2):
        bearing(eyes.heads[n], r, v, goals[n])
        eyes.angles[n] = goals[n, :2]
        ends = []
        for step in (-h, h):
            bearing(eyes.heads[n], r + step * v, v, wanted)
            ends.append(wanted[:2].copy())
        assert goals[n, 2:] == pytest.approx((ends[1] - ends[0]) / (2 * h), rel=1e-4, abs=1e-6)
    aim_heads(eyes_handle(eyes))
    for camera in eyes.cameras:
        local = (r - camera["centre"]) @ camera["R"]
        assert local[:2] / local[2] == pytest.approx((0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_the_heads_find_a_thrown_ball_and_keep_it_in_the_middle(seed: int) -> None:
    """From images alone: seen by both within 80 ms, within 8 px of the middle 60 ms later."""
    rng, rig = np.random.default_rng(500 + seed), active_rig()
    imager, eyes, f = Imager(rig, ImageSensor(), rng), Eyes(rig), BallFilter(THROWN_BALL)
    r = rng.uniform((3.3, -0.5, -0.2), (4.6, 0.6, 0.6))
    dr = (np.array((0.8, 0.0, 0.0)) - r) / 0.55 + np.array((-0.4, 0.0, 2.7))
    first = 0
    for k in range(450):
        t = 1e-3 * k
        frames = imager.render(t, r, 0.04, dr_o=dr)
        sighting = eyes.step(frames)
        if sighting.found:
            f.update(sighting)
        if not first and eyes.status is EyesStatus.BOTH:
            first = k
        ball = f.state(t)
        gaze = eyes.gaze(ball, t + 1e-3)
        assert gaze is not None
        assert np.all(np.isfinite(gaze))
        imager.turn(gaze, 1e-3)
        if first and k > first + 60:
            for n, camera in enumerate(rig.cameras):
                T = pose_of(rig.heads[n], frames[n].pan, frames[n].tilt)
                local = (r - T[:3, 3]) @ T[:3, :3]
                assert camera.f_px * np.hypot(*local[:2]) / local[2] < 8.0
        advance(r, dr, 0.04, 1e-3)
    assert 0 < first <= 80


@pytest.mark.parametrize(("mass", "follows"), [(0.8, True), (1.2, True), (2.5, False)])
def test_a_head_follows_its_image_only_while_that_may_be_the_ball(
    mass: float, follows: bool
) -> None:
    """A target 40 px beside the flight leads the head, unless it is twice as heavy as the ball."""
    eyes = Eyes(active_rig()).memory
    handle, targets = eyes_handle(eyes), eyes.targets
    motion, desired = np.array([(2.0, 0.1, 0.1), (-5.0, 0.0, 0.0)]), np.zeros((2, 4))
    for n in range(2):
        bearing(eyes.heads[n], *motion, desired[n])
    eyes.angles[:] = desired[:, :2]
    aim_heads(handle)
    targets["u"], targets["v"] = (103.5, 23.5), 63.5
    targets["state"], targets["expected"], targets["gain"] = GOOD, 700.0, 100.0
    targets["weighed"], targets["moments"]["mass"] = 20.0, mass * 7e4
    ahead = desired.copy()
    lead(handle, motion, 0.299, 0.3, 0.302, desired)
    turned_by = np.abs(desired[:, 0] - ahead[:, 0])
    assert np.all((turned_by > 0.04) == follows)


@pytest.mark.parametrize("silence", [0.01, 0.03, 0.07])
def test_heads_that_search_agree_on_a_place_between_flight_and_bounce(silence: float) -> None:
    """Their lines of sight meet above where the ball would be if it flew on, if it fell."""
    eyes, desired = Eyes(active_rig()).memory, np.zeros((2, 4))
    handle, (left, right) = eyes_handle(eyes), eyes.cameras
    for falls in (3.0, -3.0):
        motion = np.array([(1.5, 0.1, 0.1), (-4.0, 0.0, -falls)])
        lead(handle, motion, 0.3 - silence, 0.3, 0.3, desired)
        eyes.angles[:] = desired[:, :2]
        aim_heads(handle)
        a, b, apart = left["R"][:, 2], right["R"][:, 2], right["centre"] - left["centre"]
        far = np.linalg.lstsq(np.stack((a, -b), axis=1), apart)[0]
        place = left["centre"] + far[0] * a
        assert place == pytest.approx(right["centre"] + far[1] * b, abs=2e-3)
        raised = place[2] - motion[0, 2]
        assert (-2e-3 < raised < 2.0 * abs(falls) * silence) if falls > 0 else abs(raised) < 2e-3
        assert raised > 0.1 * falls * silence or falls < 0.0 or silence > 0.05


def test_heads_that_cannot_turn_are_refused() -> None:
    """Limits that are none, or heads for some of the cameras, raise."""
    rig = active_rig()
    with pytest.raises(InputError, match="heads"):
        Rig(cameras=rig.cameras, heads=rig.heads[:1])
    with pytest.raises(InputError, match="head"):
        Head(T_world_base=np.eye(4), max_speed=0.0)
    with pytest.raises(ShapeError):
        Head(T_world_base=np.eye(3))


def test_heads_turn_to_what_moves_and_not_to_lamps() -> None:
    """Lamps of half the ball's size on the wall: seen before the throw, they are never followed."""
    rng, rig = np.random.default_rng(502), active_rig()
    imager, eyes, f = Imager(rig, ImageSensor(), rng), Eyes(rig), BallFilter(THROWN_BALL)
    v, u = np.mgrid[:PANORAMA, :PANORAMA]
    wall = np.zeros((PANORAMA, PANORAMA))
    for at_u, at_v in rng.uniform((-200, -200), (328, 328), (24, 2)):
        off_u, off_v = (u - at_u + 512) % PANORAMA - 512, (v - at_v + 512) % PANORAMA - 512
        wall = np.maximum(wall, 200.0 * np.clip(4.5 - np.hypot(off_u, off_v), 0.0, 1.0))

    def lit(frames: tuple[Frame, ...]) -> tuple[Frame, ...]:
        """Return frames with the lamps."""
        for frame in frames:
            f = rig.cameras[frame.camera].f_px
            turn = round(f * frame.tilt), -round(f * frame.pan)
            lamps = np.roll(wall, turn, (0, 1))[: frame.pixels.shape[0], : frame.pixels.shape[1]]
            np.copyto(frame.pixels, np.maximum(frame.pixels, lamps.astype(np.uint8)))
        return frames

    eyes.learn_background([lit(view) for view in imager.before(9, np.zeros((0, 8)))])
    r, seen = np.array((4.0, 0.1, 0.2)), 0
    dr = (np.array((0.8, 0.0, 0.0)) - r) / 0.55 + np.array((-0.4, 0.0, 2.7))
    for k in range(250):
        sighting = eyes.step(lit(imager.render(1e-3 * k, r, 0.04, dr_o=dr)))
        if sighting.found:
            f.update(sighting)
            seen += 1
            assert np.linalg.norm(sighting.r_o - r) < 0.05
        imager.turn(eyes.gaze(f.state(1e-3 * k), 1e-3 * (k + 1)), 1e-3)
        advance(r, dr, 0.04, 1e-3)
    assert seen > 120

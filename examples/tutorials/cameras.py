"""Your cameras: from images to the place of the cameras, a track, and a reference for the arm."""

import os
import tempfile
from pathlib import Path

import cv2
import numpy as np

import mitt
from mitt.cli.main import main
from mitt.core.ball.filter import THROWN_BALL, BallFilter
from mitt.core.ball.flight import advance
from mitt.core.eyes.camera import inverse, look_at
from mitt.core.eyes.eyes import Eyes
from mitt.core.eyes.lens import Lens
from mitt.io.rig import CalibratedRig, RigCamera, read_rig, write_rig
from mitt.lab.world.imaging import Imager, ImageSensor
from mitt.robot.cameras.cameras import ImageSource, open_cameras
from mitt.robot.cameras.video_writer import VideoWriter
from mitt.robot.cell.device_clock import DeviceClock
from mitt.robot.cell.frames import FrameWriter, SharedFrames

RADIUS = 0.04
RATE = 1000.0
rng = np.random.default_rng(2)
work = tempfile.TemporaryDirectory()
folder = Path(work.name)


def camera(name: str, side: float) -> RigCamera:
    """Return a camera beside the arm that looks to the thrower."""
    numbers = np.array([220.0, 220.0, 63.5, 63.5, 0.0, 0.0, 0.0, 0.0, 0.0])  # fu, fv, cu, cv [px]
    lens = Lens(width=128, height=128, numbers=numbers)
    pose = look_at(np.array([-1.8, 1.25 * side, 0.35]), np.array([2.8, -0.35 * side, 0.35]))
    return RigCamera(name=name, lens=lens, T_world_cam=pose, rms_px=0.02)


true = CalibratedRig(frame="robot", cameras=(camera("left", 1.0), camera("right", -1.0)))
from_left = inverse(true.cameras[0].T_world_cam)
write_rig(folder / "cameras.toml", true.seen_from(from_left, "camera"), version=mitt.__version__)

arm = mitt.load_arm("wam", limits="paper")
images = Imager(true.rig(), ImageSensor(), rng)
rows = ["q1_rad,q2_rad,q3_rad"]
for k in range(20):
    q = arm.q_ready + rng.uniform(-0.25, 0.25, arm.n)
    rows.append(",".join(f"{x:.6f}" for x in q))
    for side, frame in zip(("l", "r"), images.render(0.0, arm.position(q), RADIUS), strict=True):
        (folder / side).mkdir(exist_ok=True)
        cv2.imwrite(str(folder / side / f"{k:02d}.png"), frame.pixels)
(folder / "hand.csv").write_text("\n".join(rows) + "\n")

here = f"{folder}/"
hand = ["--hand", here + "hand.csv", "--hand-left", here + "l", "--hand-right", here + "r"]
main(["calibrate", "--rig", here + "cameras.toml", *hand, "--out", here + "RIG.toml"])
rig = read_rig(folder / "RIG.toml")
pairs = zip(rig.cameras, true.cameras, strict=True)
off = max(np.linalg.norm((a.T_world_cam - b.T_world_cam)[:3, 3]) for a, b in pairs)
print(f"cameras: at most {1e3 * off:.1f} mm from their place")

r_o = np.array([3.6, 0.1, 0.3])
dr_o = np.array([-5.5, -0.1, 1.8])
frames = []
for k in range(120):
    frames.append(images.render(k / RATE, None if k < 5 else r_o, RADIUS))  # no ball in the first
    advance(r_o, dr_o, 0.04, 1.0 / RATE)
for which in (0, 1):
    with VideoWriter(folder / f"{which}.mkv", rate=RATE, lossless=True) as video:
        for pair in frames:
            video.write(pair[which].pixels)

main(["see", here + "0.mkv", here + "1.mkv", "--rig", here + "RIG.toml", "--out", here + "t.csv"])
track = np.genfromtxt(folder / "t.csv", delimiter=",", names=True)
print(f"film: a track of {len(track)} rows, the first from the sixth sighting")

eyes = Eyes(rig.rig())
ball_filter = BallFilter(THROWN_BALL)
for pair in frames:  # here: as your cameras deliver them, a mitt.core.signals.Frame each
    sighting = eyes.step(pair)
    if sighting.found:
        ball_filter.update(sighting)
ball = ball_filter.state(len(frames) / RATE)
apart = np.linalg.norm(ball.r_o - r_o)
slow = np.linalg.norm(ball.dr_o - dr_o)
print(f"ball: {1e3 * apart:.1f} mm and {slow:.3f} m/s from the truth")
f = mitt.learn(arm).map.adapt(ball, arm.q_ready, np.zeros(arm.n))
print(f"the arm has {1e3 * f.reference(ball).time_to_catch:.0f} ms until the catch")


def feed(left: ImageSource, right: ImageSource, writer: FrameWriter) -> int:
    """Pass on what two cameras see, until one ends; return how many pairs that were."""
    clock, pairs = DeviceClock(), 0  # the cameras' stamps as times of day
    a, b = left.read(), right.read()
    while a is not None and b is not None:
        if abs(a.t - b.t) > 0.4 / RATE:  # one has lost a frame: the other goes on to the next
            a, b = (left.read(), b) if a.t < b.t else (a, right.read())
            continue
        writer.write(clock.at(0.5 * (a.t + b.t)), (a.pixels, b.pixels))
        pairs += 1
        if pairs == 200:  # what came fastest is known by now; from here on stamps never jump
            clock.fix()
        a, b = left.read(), right.read()
    return pairs


memory = f"tutorial-{os.getpid()}"
with open_cameras([here + "0.mkv", here + "1.mkv"]) as (left, right):
    writer, cell = FrameWriter(memory, 2, 128, 128), SharedFrames(memory, [(128, 128)] * 2)
    missing = cell.open()
    passed = feed(left, right, writer)
    seen = cell.take()
    writer.close()
print(f"cell: {missing or 'the cameras are there'}, {passed} pairs, {len(seen)} still in the ring")

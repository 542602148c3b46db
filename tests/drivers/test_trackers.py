"""What sees the ball beside the robot: the makers' own clients are the judges of each packet."""

import os
import re
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from drivers.capture_servers import Motive, Qtm, motive_frame, parsed_frame, qtm_packet
from local_cell import FaultyRobot, LocalCell
from support import install, thorough

from mitt.clock import monotonic, time_of_day
from mitt.core.arm.description import roll_pitch_yaw
from mitt.core.errors import InputError, MittError, UnknownNameError
from mitt.core.signals import Array, Sighting
from mitt.io.cell import Cell, SourcePart, cell_of, read_cell
from mitt.robot import trackers
from mitt.robot.cell.device_clock import DeviceClock
from mitt.robot.cell.drivers import LocalRobot, check_driver
from mitt.robot.cell.hosted import DriverError
from mitt.robot.cell.loose_markers import LooseMarkers
from mitt.robot.cell.prepare import PreparedCell, prepare
from mitt.robot.cell.robot import Robot
from mitt.robot.cell.trackers import (
    TRACKERS,
    HostedTracker,
    SourceFrame,
    TrackedRobot,
    Tracker,
    check_tracker,
)
from mitt.robot.trackers.motioncapture import CaptureTracker
from mitt.robot.trackers.natnet import NatNetTracker
from mitt.robot.trackers.qtm import QtmTracker

FOLDER = Path(__file__).parent / "tracker"
#: By how much Motive's clock is behind the day here [s].
BEHIND = 1234.5
#: Motive's axes, y up, in those of the arm: x, -z, y.
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def source_of(**given: Any) -> Cell:  # noqa: ANN401
    """Return the shipped cell with a driver that needs no network, and another source."""
    cell = read_cell("wam-sim")
    robot = cell.robot.model_copy(update={"driver": "sim"})
    source = SourcePart(**given)
    return cell.model_copy(update={"robot": robot, "source": source})


def along(t: float) -> Array:
    """Return where a ball is that flies [m]."""
    return np.array([2.0 - 5.0 * t, 0.1, 1.0 + 2.0 * t - 4.9 * t * t])


def heard(points: Callable[[], Sequence[Any]], count: int, within: float = 20.0) -> list[Any]:
    """Return what comes until there is enough of it."""
    found, end = list[Any](), time.monotonic() + within
    while len(found) < count:
        assert time.monotonic() < end
        found += points()
        time.sleep(0.001)
    return found


def test_frames_of_motive_are_where_and_when_the_ball_was() -> None:
    """By natnet over the network: places as sent, times of the middle of the exposure."""
    natnet = pytest.importorskip("natnet")
    exposures = dict[int, float]()

    def frame(number: int) -> bytes:
        now = time_of_day()
        exposures[number] = now - 0.004
        ball = along(0.001 * number)
        sent = now - BEHIND
        return motive_frame(number, [Y_UP.T @ ball], exposed=sent - 0.004, sent=sent)

    server = Motive(frame, rate=240.0)
    client = natnet.NatNetClient(command_port=server.port, use_multicast=False)
    tracker = NatNetTracker(client)
    server.start()
    client.connect(5.0)
    client.run_async()
    try:
        found = heard(lambda: tracker.places(0.05), 60)
    finally:
        client.shutdown()
        server.over.set()
    of = SourceFrame(SourcePart(rpy=(np.pi / 2.0, 0.0, 0.0)))
    seen = [of.sighting(t, r) for t, r in found][30:]
    sent = np.array([along(0.001 * k) for k in exposures])
    for point in seen:
        k = int(np.argmin(np.linalg.norm(sent - point.r_o, axis=1)))
        assert point.found
        assert np.linalg.norm(sent[k] - point.r_o) < 1e-6
        assert abs(point.t - exposures[list(exposures)[k]]) < 0.001
    assert tracker.trouble() == ""


def test_a_rigid_body_is_seen_where_motive_tracks_it() -> None:
    """Where it does not, the ball is not seen; another body, another marker are none."""
    pytest.importorskip("natnet")
    client = SimpleNamespace(on_data_frame_received_event=SimpleNamespace(handlers=[]))
    tracker = NatNetTracker(client, rigid_body=7)
    (take,) = client.on_data_frame_received_event.handlers
    for k, body in enumerate((np.array([1.0, 2.0, 3.0]), None)):
        take(parsed_frame(motive_frame(k, [np.zeros(3)], exposed=1.0, sent=1.1, body=body)))
    first, second = tracker.places(0.0)
    assert np.allclose(first.r, [1.0, 2.0, 3.0])
    assert np.all(np.isnan(second.r))
    other = NatNetTracker(client, rigid_body=8)
    client.on_data_frame_received_event.handlers[1](
        parsed_frame(motive_frame(0, [], exposed=1.0, sent=1.1, body=np.ones(3)))
    )
    assert np.all(np.isnan(other.places(0.0)[0].r))


def test_ticks_that_are_not_what_they_are_said_to_be_are_named() -> None:
    """Motive on another machine counts otherwise: the line says what to write."""
    pytest.importorskip("natnet")
    client = SimpleNamespace(on_data_frame_received_event=SimpleNamespace(handlers=[]))
    tracker = NatNetTracker(client, tick_rate=1e9)
    begun = monotonic()
    while monotonic() - begun < 1.1:
        t = monotonic()
        client.on_data_frame_received_event.handlers[0](
            parsed_frame(motive_frame(0, [], exposed=t, sent=t))
        )
        time.sleep(0.02)
    assert "source.options.tick_rate" in tracker.trouble()
    assert "by 1e+07 a second" in tracker.trouble()


@pytest.mark.parametrize("label", ["", "ball"])
def test_packets_of_qtm_are_where_and_when_the_ball_was(label: str) -> None:
    """By its maker's client over the network: millimetres become metres, stamps times of day."""
    pytest.importorskip("qtm_rt")
    exposures = dict[int, float]()

    def packet(number: int) -> bytes:
        exposures[number] = now = time_of_day()
        balls = [np.array([9.0, 9.0, 9.0]), along(0.001 * number)] if label else [
            along(0.001 * number)
        ]  # fmt: skip
        return qtm_packet(now - BEHIND, balls, labelled=bool(label))

    server = Qtm(packet, rate=240.0, labels=["hat", "ball"])
    tracker = QtmTracker("127.0.0.1", server.begin(), label)
    try:
        found = heard(lambda: tracker.places(0.05), 60)[30:]
        assert tracker.trouble() == ""
    finally:
        tracker.close()
        server.end()
    sent = np.array([along(0.001 * k) for k in exposures])
    for t, r in found:
        k = int(np.argmin(np.linalg.norm(sent - r, axis=1)))
        assert np.linalg.norm(sent[k] - r) < 1e-6
        assert abs(t - exposures[list(exposures)[k]]) < 0.001


def test_a_trajectory_that_qtm_does_not_have_is_named() -> None:
    """With those that it has."""
    pytest.importorskip("qtm_rt")
    server = Qtm(lambda k: qtm_packet(float(k), [], labelled=True), 100.0, ["hat", "glove"])
    with pytest.raises(MittError, match="no trajectory 'ball', but hat, glove"):
        QtmTracker("127.0.0.1", server.begin(), "ball")
    server.end()


def test_where_nobody_serves_the_line_says_so() -> None:
    """Before anything moves."""
    pytest.importorskip("qtm_rt")
    cell = source_of(tracker="qtm", options={"port": 9.0})
    with pytest.raises(DriverError, match=r"QTM does not answer at 127\.0\.0\.1, port 9: start it"):
        HostedTracker(cell)


def test_a_mock_of_motioncapture_goes_through() -> None:
    """Its library's own mock, in a process of its own; it tracks no ball, so none is found."""
    pytest.importorskip("motioncapture")
    cell = source_of(tracker="motioncapture", options={"kind": "mock"})
    with closing(HostedTracker(cell)) as tracker:
        assert not any(point.found for point in heard(tracker.points, 5))
        assert tracker.trouble() == ""


def test_a_body_of_motioncapture_is_a_place_with_its_arrival() -> None:
    """The library has no stamps."""
    body = SimpleNamespace(position=[1.0, 2.0, 3.0])
    link = SimpleNamespace(waitForNextFrame=lambda: None, rigidBodies={"ball": body})
    ((t, r),) = CaptureTracker(link, "ball").places(0.0)
    assert abs(t - time_of_day()) < 0.1
    assert r.tolist() == [1.0, 2.0, 3.0]
    ((_, r),) = CaptureTracker(link, "hat").places(0.0)
    assert np.all(np.isnan(r))


@pytest.mark.parametrize("seed", range(20))
def test_the_ball_is_told_among_markers_that_stand(seed: int) -> None:
    """Up to eight that flicker and jitter: nine frames of ten tell it; no other ever is."""
    rng = np.random.default_rng(seed)
    rate, stands = rng.uniform(100.0, 500.0), rng.uniform(-3.0, 3.0, (rng.integers(0, 9), 3))
    of, told = LooseMarkers(), 0
    frames = int(1.5 * rate)
    for k in range(frames):
        t = k / rate
        there = rng.random(len(stands)) < 0.95
        rows = [stands[there] + rng.normal(0.0, 3e-4, (int(there.sum()), 3))]
        ball = along(t - 0.5) if t >= 0.5 else None
        rows += [] if ball is None else [ball[None]]
        places = rng.permutation(np.concatenate(rows)) if rows else np.zeros((0, 3))
        found = of.ball(t, places)
        if t < 0.5:
            continue
        assert np.any(np.isnan(found)) or (ball is not None and np.array_equal(found, ball))
        told += not np.any(np.isnan(found))
    assert told > 0.9 * 1.0 * rate


def test_of_two_that_fly_none_is_told() -> None:
    """Rather none than the wrong one."""
    of = LooseMarkers()
    for k in range(50):
        two = np.array([along(0.005 * k), along(0.005 * k) + np.array([0.0, 1.0, 0.0])])
        assert np.all(np.isnan(of.ball(0.005 * k, two)))


def test_a_topic_is_a_tracker() -> None:
    """Beside a robot of any driver: who publishes, in which frame, and that nobody does."""
    dds = pytest.importorskip("mitt.robot.cell.dds")
    from mitt.robot.cell import ros2_messages  # noqa: PLC0415
    from mitt.robot.trackers.ros2 import Ros2Tracker  # noqa: PLC0415

    topic = f"/tracked_{os.getpid()}/ball"
    source = SourcePart(tracker="ros2", topic=topic)
    with closing(dds.Node()) as node, closing(Ros2Tracker(dds.Node(), source)) as tracker:
        assert "nobody publishes" in tracker.trouble()
        ball = node.publish(topic, dds.PointStamped, "sensor")
        while tracker.trouble():
            time.sleep(0.01)

        def found() -> Sequence[Any]:
            ball.send(ros2_messages.point(12.5, "world", np.array([1.0, 2.0, 3.0])))
            return tracker.places(0.1)

        t, r = heard(found, 1)[0]
        assert t == 12.5
        assert r.tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("fault", "said"),
    thorough(
        [
            ("blocks", r"tracker 'faulty' does not answer: points has not returned for \d+ ms"),
            ("dies", "tracker 'faulty' has crashed: its process was ended by SIGKILL"),
            ("fails", "tracker 'faulty': ValueError: packet 17 is cut off"),
        ],
        [
            ("exits", "tracker 'faulty': SystemExit: its server has shut down"),
            ("says", "its cameras are covered"),
        ],
    ),
)
def test_whatever_a_tracker_does_is_said(
    fault: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The robot waits for it, so that the arm does not move, or stops within its limits."""
    install(FOLDER, tmp_path, monkeypatch)
    cell = source_of(tracker="faulty", options={"fault": fault}, origin=(0.0, 0.5, 0.0))
    local = LocalCell(throws=1)
    with closing(TrackedRobot(local.robot, HostedTracker(cell))) as robot:
        assert isinstance(robot, Robot)
        points = heard(robot.points, 5)
        assert [p.t for p in points] == [1.0, 2.0, 3.0, 4.0, 5.0]
        assert points[0].r_o.tolist() == [1.0, 0.5, 0.0]
        end = time.monotonic() + 10.0
        while not (why := robot.waits()):
            assert time.monotonic() < end
            time.sleep(0.01)
    assert re.match(said, why), why


def test_a_tracker_that_cannot_be_made_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In its own words."""
    install(FOLDER, tmp_path, monkeypatch)
    with pytest.raises(DriverError, match="tracker 'faulty': RuntimeError: no licence"):
        HostedTracker(source_of(tracker="faulty", options={"fault": "refuses"}))


#: A tracker in one file: a file of lines ``t x y z``.
LINES = """
from pathlib import Path
import numpy as np
from mitt.robot.cell.trackers import TrackedPlace


class Lines:
    def __init__(self, path):
        self._file = open(path)

    def places(self, timeout):
        rows = [[float(x) for x in line.split()] for line in self._file]
        return [TrackedPlace(t, np.array(place)) for t, *place in rows]

    def trouble(self):
        return ""

    def close(self):
        self._file.close()


def lines_tracker(cell):
    return Lines(cell.source.options["file"])


def check_lines(cell, arm):
    return [f"{Path(cell.source.options['file']).name} has to have lines t x y z"]
"""


def test_one_file_in_its_folder_is_a_tracker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing else names it: cells, ``--check`` and the list of an error know it."""
    (tmp_path / "lines.py").write_text(LINES)
    (tmp_path / "ball.txt").write_text("1.0 0.5 0.0 0.25\n2.0 nan nan nan\n")
    monkeypatch.setattr(trackers, "__path__", [*trackers.__path__, str(tmp_path)])
    cell = source_of(tracker="lines", options={"file": str(tmp_path / "ball.txt")})
    arm = prepare(read_cell("wam-sim")).arm
    assert check_tracker(cell, arm) == ["ball.txt has to have lines t x y z"]
    with closing(TRACKERS.made("lines", Tracker, cell)) as tracker:
        (t, r), (_, unseen) = tracker.places(0.0)
    assert t == 1.0
    assert r.tolist() == [0.5, 0.0, 0.25]
    assert np.isnan(unseen).all()
    with pytest.raises(UnknownNameError, match="lines, motioncapture, natnet"):
        TRACKERS.load("nikon")


@pytest.mark.parametrize(
    ("tracker", "options", "said"),
    [
        ("natnet", {"rigid_body": 1.5}, "a streaming ID"),
        ("natnet", {"tick_rate": 0.0}, "1e3 to 1e10 Hz"),
        ("natnet", {"label": "ball"}, "one of address, local"),
        ("qtm", {"port": 0.0}, "a port"),
        ("motioncapture", {}, "one of vicon, vrpn"),
        ("ros2", {"interface": "no-such"}, "source.options.interface"),
        ("nikon", {}, "one of motioncapture, natnet, qtm, ros2"),
    ],
)
def test_a_source_that_cannot_be_is_refused_before_the_start(
    tracker: str, options: dict[str, Any], said: str
) -> None:
    """By what ``--check`` asks and the start asks first."""
    cell = source_of(tracker=tracker, options=options)
    cell = cell.model_copy(update={"robot": read_cell("wam-sim").robot})
    with pytest.raises(InputError, match=said):
        check_driver(cell, prepare(read_cell("wam-sim")).arm)


@pytest.mark.parametrize(
    "source", [{"options": {"port": 1.0}}, {"kind": "images", "tracker": "natnet"}]
)
def test_a_tracker_goes_with_points_alone(source: dict[str, object]) -> None:
    """Options without a tracker, a tracker beside images: one line."""
    with pytest.raises(MittError, match=r"source\.(options|tracker)"):
        cell_of({"schema": "mitt.cell/1", "name": "x", "source": source}, place="x.toml")


def through_motive(local: LocalRobot, prepared: PreparedCell) -> Robot:
    """Return the robot of a simulated cell whose ball goes through Motive's packets, y up."""
    handlers = list[Callable[[Any], None]]()
    client = SimpleNamespace(on_data_frame_received_event=SimpleNamespace(handlers=handlers))
    tracker = NatNetTracker(client, clock=DeviceClock(lambda: local.t))
    of, robot = SourceFrame(prepared.cell.source), FaultyRobot(local)

    def tracked(points: Sequence[Sighting]) -> Sequence[Sighting]:
        """Send each position as a frame of Motive, among two markers that stand."""
        for k, point in enumerate(points):
            loose = [np.array([9.0, 0.5, k]), Y_UP.T @ point.r_o, np.array([-3.0, 2.0, 1.0])]
            times = point.t - BEHIND, local.t - BEHIND
            frame = motive_frame(k, loose, exposed=times[0], sent=times[1])
            handlers[0](parsed_frame(frame))
        return [of.sighting(t, r) for t, r in tracker.places(0.0)]

    robot.on_points = tracked
    return robot


@pytest.mark.slow
@pytest.mark.parametrize("name", thorough(["ur5e-sim"], ["franka-fr3-sim"]))
def test_shipped_cells_catch_what_motive_sees(name: str) -> None:
    """Their ball comes as frames of NatNet, which the maker's parser reads, with Motive's clock."""
    pytest.importorskip("natnet")
    cell = read_cell(name)
    turned = cell.source.model_copy(update={"rpy": (np.pi / 2.0, 0.0, 0.0)})
    prepared = prepare(cell.model_copy(update={"source": turned}))
    assert np.allclose(roll_pitch_yaw(np.array(turned.rpy)), Y_UP)
    local = LocalCell(throws=3, prepared=prepared, driver=through_motive)
    local.begin()
    local.until(lambda: local.simulated.done)
    assert local.simulated.statuses.count("caught") >= 2
    assert "stopped" not in local.simulated.statuses

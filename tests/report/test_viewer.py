"""The viewer shows what the recording says, while it is written as well."""

import json
import os
import urllib.request
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded_trials import CASES, recorded

from mitt.cli.main import main
from mitt.clock import monotonic, pause
from mitt.core.ball.flight import forecast
from mitt.core.errors import FileError
from mitt.core.signals import ArmState, BallState, Senses
from mitt.io.messages import TRUTH
from mitt.io.recordings import Recorded
from mitt.lab.report.replay_3d import NODE, served
from mitt.lab.report.viewer import Viewer, around_catch, ellipsoid, newest, watch, way
from mitt.lab.trials.replayed import catcher_of
from mitt.robot.cell.recorder import Recorder


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded throw with images."""
    case = next(case for case in CASES if case.name == "images")
    ((_, path),) = recorded(case, tmp_path_factory.mktemp("one"), throws=1, seed=5)
    return path


@given(seed=st.integers(0, 999))
def test_the_ellipsoid_is_the_covariance(seed: int) -> None:
    """Half axes squared along the axes of the attitude give nine times the covariance."""
    A = np.random.default_rng(seed).standard_normal((3, 3))
    P = A @ A.T + 0.01 * np.eye(3)
    found, R = ellipsoid(P), np.empty(9)
    mujoco.mju_quat2Mat(R, found.wxyz)
    turn = R.reshape(3, 3)
    np.testing.assert_allclose(
        turn @ np.diag(found.axes**2) @ turn.T, 9.0 * P, rtol=1e-9, atol=1e-9
    )


def test_the_way_is_the_flight_to_the_floor() -> None:
    """Each point is where the flight model puts the ball; the last one is above the floor."""
    r, dr = np.array([3.0, 0.1, 0.4]), np.array([-6.0, 0.0, 2.5])
    ball = BallState(
        t=0.0,
        tracked=True,
        r_o=r,
        dr_o=dr,
        ddr_o=np.zeros(3),
        drag=0.05,
        covariance=np.zeros((6, 6)),
        t_seen=0.0,
        t_first=0.0,
    )
    found = way(r, dr, 0.05, -1.0)
    for k in (1, 10, len(found) - 1):
        np.testing.assert_allclose(found[k], forecast(ball, 0.01 * k).r_o, atol=1e-6)
    assert found[-1, 2] >= -1.0
    assert len(found) > 30


def test_a_tick_is_shown_as_recorded(one: Path) -> None:
    """Ball, true ball, images and the panel are those of the tick; the slider follows."""
    back = Recorded(one)
    with served(port=8870) as server:
        viewer = Viewer(server, one)
        stage: Any = viewer._stage
        for k in (300, 420):
            viewer.show(k)
            row = back.ticks[k]
            ball = stage._bodies[stage._ball]
            np.testing.assert_allclose(ball.position, row["ball"][:3], atol=1e-6)
            t, r = back.track(TRUTH)
            at = r[int(np.searchsorted(t, float(row["t"])))]
            np.testing.assert_allclose(stage._true.position, at, atol=1e-6)
            assert viewer._slider.value == k
            assert f"{1e3 * row['t']:.0f} ms" in viewer._panel.content
            number = int(back.numbers[k])
            for frame in back.frames(number):
                assert np.array_equal(viewer._images[frame.camera].image[..., 0], frame.pixels)
        assert "follow" in viewer._panel.content
        assert NODE.format(stage._ball) == ball.name


def test_a_recording_that_is_written_is_followed(one: Path, tmp_path: Path) -> None:
    """The newest tick is shown within a second of its being recorded."""
    back, path = Recorded(one), tmp_path / "live.mcap"
    catcher, about = catcher_of(back.about), back.about
    with Recorder(path, about) as recorder, served(port=8871) as server:
        viewer = Viewer(server, path)
        for k in range(200):
            arm = ArmState(t=1e-3 * k, q=about.arm.q_ready, dq=np.zeros(about.arm.n))
            senses = Senses(t=1e-3 * k, arm=arm)
            recorder.tick(senses, catcher.step(senses), catcher.result)
        deadline = monotonic() + 10.0
        while viewer._shown < 199 and monotonic() < deadline:
            pause(0.05)
            viewer.step()
        assert viewer._shown == 199
        viewer.play(True)
        viewer.advance(0.1)
        assert viewer._shown == 0
        viewer.advance(0.1)
        assert viewer._shown == 20  # at a fifth of the speed


def test_it_opens_on_the_catch_and_plays_it_again_and_again(one: Path) -> None:
    """From 0.45 s before to 0.35 s behind it; a narrow window looks from farther away."""
    with served(port=8875) as server:
        viewer = Viewer(server, one)
        left = viewer._recorded.ticks["out_time_to_catch"]
        first, end = around_catch(viewer._recorded.ticks)
        assert viewer.playing
        assert viewer._shown == first
        assert 0.44 < left[first] < 0.46
        assert end - first == 800
        viewer.advance(3.99)
        assert viewer._shown == end - 2
        viewer.advance(0.1)
        assert viewer._shown == first
        wide, narrow = (SimpleNamespace(image_width=w, image_height=800) for w in (1400, 420))
        for camera in (wide, narrow):
            viewer._look(camera)
        distance = [np.linalg.norm(np.subtract(x.position, x.look_at)) for x in (wide, narrow)]
        assert distance[1] > 1.5 * distance[0] > 1.5


def test_a_page_is_served_on_the_loopback_and_the_newest_file_is_taken(
    one: Path, tmp_path: Path
) -> None:
    """What is served is a page; of two recordings in a folder the newer one is shown."""
    for name in ("a", "b"):
        (tmp_path / f"{name}.mcap").write_bytes(one.read_bytes())
    assert newest(tmp_path) == tmp_path / "b.mcap"
    assert newest(tmp_path / "b.mcap".replace(".mcap", "-none")) is None
    pages: list[bytes] = []

    def ready(url: str) -> None:
        assert url.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(url, timeout=10) as page:  # noqa: S310 (our own loopback)
            pages.append(page.read(2000))

    watch(lambda: one, host="127.0.0.1", port=8872, ready=ready, until=3.0)
    assert b"<html" in pages[0]


def test_the_command_serves_and_refuses(
    one: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One JSON object with the address, and what is loaded; other files are one line."""
    assert main(["view", str(one), "--json", "--seconds", "2", "--port", "8873"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["url"].startswith("http://127.0.0.1:")
    assert said.err == f"mitt: loading {one}\n"
    assert main(["view", str(one), "--check"]) == 0
    (tmp_path / "x.mcap").write_bytes(b"mine")
    for words in ([str(tmp_path / "x.mcap")], [str(tmp_path / "no")], [str(one), "--port", "0"]):
        assert main(["view", *words]) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) <= 2
    with pytest.raises(FileError):
        watch(lambda: tmp_path / "x.mcap", host="127.0.0.1", port=8874, ready=print, until=1.0)


def test_what_vanishes_leads_nowhere_or_is_no_file_is_no_recording(tmp_path: Path) -> None:
    """The newest is the newest of those that are there; where there is none, none."""
    (tmp_path / "nowhere.mcap").symlink_to(tmp_path / "gone")
    (tmp_path / "loop.mcap").symlink_to(tmp_path / "loop.mcap")
    (tmp_path / "folder.mcap").mkdir()
    os.mkfifo(tmp_path / "pipe.mcap")
    assert newest(tmp_path) is None
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "a.mcap").write_bytes(b"")
    assert newest(tmp_path) == tmp_path / "inner" / "a.mcap"
    assert newest(tmp_path / "none") is None


def test_a_recording_that_vanishes_is_left_for_the_next(
    one: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Gone between the look and the opening, at the start and later: the viewer goes on."""
    gone, there = tmp_path / "gone.mcap", tmp_path / "there.mcap"
    there.write_bytes(one.read_bytes())
    looks = iter((gone, there, there, gone, gone, there))
    seen: list[Path] = []
    monkeypatch.setattr("mitt.lab.report.viewer._LOOK", 0.1)
    monkeypatch.setattr(Viewer, "step", lambda self: seen.append(self.path))
    with pytest.raises(StopIteration):  # after the last look
        watch(lambda: next(looks), host="127.0.0.1", port=8875, ready=lambda _: None)
    assert set(seen) == {there}

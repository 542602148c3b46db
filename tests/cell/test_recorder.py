"""What a live loop hands to the recorder comes back number for number, whatever dies."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from support import thorough

from mitt.core.arm.arm import Arm
from mitt.core.catcher.generators import Direct
from mitt.core.errors import FileError, InputError
from mitt.core.map.learn import Learned
from mitt.core.signals import ArmState, Array, Frame, Senses, Sighting
from mitt.io.about import About
from mitt.io.messages import torques_call, torques_in
from mitt.io.recordings import Recorded
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.world.scene import Scene
from mitt.robot.cell.recorder import Recorder, Ring

_TICKS = 250


@pytest.fixture(scope="module")
def runner(arm: Arm, learned: Learned) -> TrialRunner:
    return TrialRunner(arm, Direct(learned.map), Scene())


@pytest.fixture(scope="module")
def about(runner: TrialRunner, learned: Learned) -> About:
    return runner.about("direct", learned.map)


def _senses(k: int, arm: Arm, rng: np.random.Generator, frames: tuple[Frame, ...] = ()) -> Senses:
    """Return random senses, now and then with points."""
    t, count = 1e-3 * k + 1e-5 * rng.random(), int(rng.integers(3)) if k % 3 == 0 else 0
    roots = rng.random((count, 3, 3))
    points = tuple(
        Sighting(t=t, found=True, r_o=rng.standard_normal(3), covariance=root @ root.T)
        for root in roots
    )
    state = ArmState(t=t - 1e-4, q=rng.standard_normal(arm.n), dq=rng.standard_normal(arm.n))
    return Senses(t=t, arm=state, frames=frames, points=points)


def _same(a: Sighting, b: Sighting) -> bool:
    pairs: tuple[tuple[Array, Array], ...] = ((a.r_o, b.r_o), (a.covariance, b.covariance))
    return a.t == b.t and a.found == b.found and all(np.array_equal(x, y) for x, y in pairs)


def test_every_number_comes_back(
    tmp_path: Path, arm: Arm, runner: TrialRunner, about: About
) -> None:
    """Senses, points, images, commands, calls and texts: all to the last digit, in their order."""
    rng, catcher = np.random.default_rng(0), runner.catcher()
    path, sent = tmp_path / "x.mcap", []
    shape = about.shapes[0]
    with Recorder(path, about, images=True, metadata={"who": "test"}) as recorder:
        for k in range(_TICKS):
            frames = tuple(
                Frame(t=1e-3 * k, camera=n, number=k, pixels=rng.integers(0, 256, shape, np.uint8))
                for n in range(2 if k % 10 == 0 else 0)
            )
            senses = _senses(k, arm, rng, frames)
            command = catcher.step(senses)
            if k == 7:
                recorder.call("stop")
            recorder.tick(senses, command, catcher.result)
            sent.append((senses, command, catcher.result.scalars.copy()))
        recorder.note("missed")
    assert recorder.dropped == 0
    back = Recorded(path)
    assert back.whole
    assert back.dropped == 0
    assert back.notes["who"] == "test"
    assert back.calls == {7: ["stop"]}
    assert [text for _, topic, text in back.notices if topic == "/events"] == ["missed"]
    np.testing.assert_array_equal(back.numbers, np.arange(_TICKS))
    for k, (senses, command, scalars) in enumerate(sent):
        row = back.ticks[k]
        assert (row["t"], row["t_arm"]) == (senses.t, senses.arm.t)
        assert np.array_equal(row["q"], senses.arm.q)
        assert np.array_equal(row["dq"], senses.arm.dq)
        assert np.array_equal(row["command"], command.joints.ravel())
        for name in scalars.dtype.names or ():
            assert row[f"out_{name}"] == scalars[name][0]
        given = back.points(k)
        assert len(given) == len(senses.points)
        assert all(map(_same, given, senses.points))
        for mine, frame in zip(back.frames(k), senses.frames, strict=True):
            assert (mine.t, mine.camera, mine.number) == (frame.t, frame.camera, frame.number)
            assert np.array_equal(mine.pixels, frame.pixels)


@pytest.mark.thorough
def test_a_tick_never_waits_and_what_is_dropped_is_said(
    tmp_path: Path, arm: Arm, runner: TrialRunner, about: About
) -> None:
    """A writer that stands still costs ticks, not time; the file says how many."""
    rng, catcher = np.random.default_rng(1), runner.catcher()
    senses = _senses(1, arm, rng)
    command = catcher.step(senses)
    with Recorder(tmp_path / "x.mcap", about) as recorder:
        recorder._process.send_signal(signal.SIGSTOP)
        for _ in range(20_000):
            recorder.tick(senses, command, catcher.result)
        assert recorder.dropped > 1000
        assert recorder.fullest > 0.99
        recorder._process.send_signal(signal.SIGCONT)
    back = Recorded(tmp_path / "x.mcap")
    assert back.dropped == recorder.dropped == 20_000 - len(back.ticks)
    assert any("dropped" in text for _, _, text in back.notices)


_DIES = """
import os, signal, sys, time
from pathlib import Path
import numpy as np
import mitt
from mitt.core.catcher.state import fresh_result
from mitt.io.recordings import Recorded
from mitt.robot.cell.recorder import Recorder
from mitt.core.signals import ArmState, Command, Senses
about = Recorded(Path(sys.argv[1])).about
recorder = Recorder(Path(sys.argv[2]), about)
q = np.zeros(about.arm.n)
for k in range(500):
    senses = Senses(t=1e-3 * k, arm=ArmState(t=0.0, q=q, dq=q))
    recorder.tick(senses, Command(1e-3 * k, np.zeros((4, len(q))), 0.0), fresh_result(len(q)))
    time.sleep(0.0005)
os.kill(recorder._process.pid if sys.argv[3] == "writer" else os.getpid(), signal.SIGKILL)
time.sleep(0.2)
recorder.tick(senses, Command(1.0, np.zeros((4, len(q))), 0.0), fresh_result(len(q)))
try:
    recorder.close()
except mitt.MittError as error:
    print(error)
"""


@pytest.mark.parametrize("victim", thorough(["loop"], ["writer"]))
def test_a_file_survives_whoever_is_killed(tmp_path: Path, about: About, victim: str) -> None:
    """Killed with -9: the loop's death ends the file well, the writer's costs its last chunk."""
    seed, path = tmp_path / "seed.mcap", tmp_path / "x.mcap"
    Recorder(seed, about).close()
    words = [sys.executable, "-c", _DIES, str(seed), str(path), victim]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
    if victim == "loop":
        assert done.returncode == -signal.SIGKILL
        deadline = time.monotonic() + 20.0
        while not Recorded(path).whole and time.monotonic() < deadline:
            time.sleep(0.05)
        assert len(Recorded(path).ticks) == 500
        assert Recorded(path).whole
    else:
        assert "recording written to its end" in done.stdout
        back = Recorded(path)
        assert not back.whole
        assert len(back.ticks) > 100


@pytest.mark.thorough
def test_an_interpreter_that_starts_slowly_is_waited_for(
    tmp_path: Path, about: About, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However long it takes on a busy machine: patience is with a writer that has begun."""
    (tmp_path / "sitecustomize.py").write_text("import time\ntime.sleep(3.0)\n")
    paths = [str(tmp_path), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))
    monkeypatch.setattr("mitt.robot.cell.recorder._PATIENCE", 2.0)
    with Recorder(tmp_path / "x.mcap", about) as recorder:
        assert recorder.trouble == ""


@pytest.mark.thorough
def test_a_writer_that_stands_still_is_not_waited_for(
    tmp_path: Path, arm: Arm, runner: TrialRunner, about: About, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The end of a recording takes a bounded time, and says how much is not in the file."""
    rng, catcher = np.random.default_rng(6), runner.catcher()
    recorder = Recorder(tmp_path / "x.mcap", about)
    monkeypatch.setattr("mitt.robot.cell.recorder._PATIENCE", 0.5)
    recorder._process.send_signal(signal.SIGSTOP)
    senses = _senses(1, arm, rng)
    recorder.tick(senses, catcher.step(senses), catcher.result)
    before = time.monotonic()
    with pytest.raises(FileError, match=r"did nothing for 0 s; (\d+) of \1 bytes were not written"):
        recorder.close()
    assert time.monotonic() - before < 5.0
    assert recorder._process.poll() is not None


def test_a_file_cut_anywhere_is_readable_to_its_last_chunk(
    tmp_path: Path, arm: Arm, runner: TrialRunner, about: About
) -> None:
    """Ticks that come back are the first ones; a longer file never gives fewer."""
    rng, catcher = np.random.default_rng(2), runner.catcher()
    with Recorder(tmp_path / "x.mcap", about) as recorder:
        for k in range(_TICKS):
            senses = _senses(k, arm, rng)
            recorder.tick(senses, catcher.step(senses), catcher.result)
            time.sleep(0.001)
    whole, cut, most = (tmp_path / "x.mcap").read_bytes(), tmp_path / "cut.mcap", 0
    full, refused = Recorded(tmp_path / "x.mcap").ticks, list[int]()
    for size in [0, 4, 100, *rng.integers(0, len(whole), 40).tolist(), len(whole) - 1]:
        cut.write_bytes(whole[:size])
        try:
            back = Recorded(cut)
        except FileError:
            refused.append(size)
            continue
        assert np.array_equal(back.ticks, full[: len(back.ticks)])
        most = max(most, len(back.ticks))
    assert most == _TICKS
    assert max(refused) < len(about.text)


@pytest.mark.thorough
def test_a_file_that_grows_is_followed(
    tmp_path: Path, arm: Arm, runner: TrialRunner, about: About
) -> None:
    """A reader gets what was added, without reading the rest again, within two chunks."""
    rng, catcher = np.random.default_rng(3), runner.catcher()
    with Recorder(tmp_path / "x.mcap", about) as recorder:
        back = Recorded(tmp_path / "x.mcap")
        seen = [len(back.ticks)]
        for k in range(_TICKS):
            senses = _senses(k, arm, rng)
            recorder.tick(senses, catcher.step(senses), catcher.result)
            if k % 50 == 49:
                time.sleep(0.4)
                back.more()
                seen.append(len(back.ticks))
        assert seen == [0, *range(50, _TICKS + 1, 50)]
        assert not back.whole
    assert back.more() == 0
    assert back.whole


@pytest.mark.thorough
def test_what_cannot_be_recorded_is_refused(tmp_path: Path, about: About) -> None:
    """A file that is there, a folder that is not, and calls that no catcher knows: one line."""
    (tmp_path / "x.mcap").write_bytes(b"mine")
    for path in (tmp_path / "x.mcap", tmp_path / "no" / "x.mcap"):
        with pytest.raises(FileError, match="new file that can be written"):
            Recorder(path, about)
    assert (tmp_path / "x.mcap").read_bytes() == b"mine"
    with Recorder(tmp_path / "y.mcap", about) as recorder, pytest.raises(InputError, match="again"):
        recorder.call("dance")


@pytest.mark.parametrize(
    "call",
    [
        "again",
        "",
        "torques",
        "torques 1.0 2.0",
        "torques 1 x 3",
        "torques 1 nan 3",
        "torques 1 2 3 4",
    ],
)
def test_torques_that_were_taken_over_are_read_to_the_bit(call: str) -> None:
    """And what a file says that are none is not."""
    torques = np.array([0.1, -1e-17, 30.0 / 7.0])
    read = torques_in(torques_call(torques), 3)
    assert read is not None
    assert np.array_equal(read, torques)
    assert torques_in(call, 3) is None


def test_the_ring_gives_back_what_was_put() -> None:
    """Entries of any size come out whole and in order, however often the ring goes round."""
    rng, ring = np.random.default_rng(4), Ring.new(4096)
    other, waiting = Ring(os.dup(ring.fd), ring.size), list[tuple[int, bytes]]()
    refused = 0
    for _ in range(5000):
        entry = int(rng.integers(1, 5)), rng.bytes(int(rng.integers(0, 900)))
        if ring.put(*entry):
            waiting.append(entry)
        else:
            refused += 1
        while waiting and rng.random() < 0.5:
            assert other.take() == waiting.pop(0)
    assert ring.refused == refused > 0
    while waiting:
        assert other.take() == waiting.pop(0)
    assert other.take() is None
    ring.close()
    other.close()

"""A simulated cell in real time: after a stall its clock is right again, without a burst."""

import numpy as np
import pytest

from mitt.core.signals import TICK
from mitt.io.cell import read_cell
from mitt.robot.cell.prepare import feed_of, prepare, scene_of_cell
from mitt.robot.cell.session import Server

#: Tick with a stall, its length [s], number of ticks.
AT = 50
STALL = 0.012
TICKS = 400


class Cell:
    """Counts ticks by a clock that it moves on itself; one of them stalls."""

    released = False

    def __init__(self) -> None:
        """Begin at 0."""
        self.now, self.times, self.done = 0.0, list[float](), False

    def tick(self) -> None:
        """Note the time, take some, and stall once."""
        self.times.append(self.now)
        self.now += STALL if len(self.times) == AT else 1e-4

    def act(self) -> None:
        """End after some ticks."""
        self.done = len(self.times) >= TICKS

    def sleep_until(self, due: float) -> float:
        """Return how late it is."""
        late = max(self.now - due, 0.0)
        self.now = max(self.now, due)
        return late


def test_time_that_was_lost_is_made_up_for_little_by_little(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By ticks that are a quarter shorter: within 50 ms the stamps are those of real time again."""
    cell, prepared = Cell(), prepare(read_cell("wam-sim"))
    scene = scene_of_cell(prepared.cell, None)
    source = feed_of(prepared, scene, seed=0, count=1)
    server = Server(prepared, scene, source, lambda _: None, lambda: None)  # type: ignore[arg-type, return-value]
    monkeypatch.setattr("mitt.robot.cell.session.monotonic", lambda: cell.now)
    monkeypatch.setattr("mitt.robot.cell.session.sleep_until", cell.sleep_until)
    server._go_on(cell)  # type: ignore[arg-type]
    lag = np.array(cell.times) - TICK * np.arange(TICKS)
    assert server.slipped == 1
    assert lag.max() == pytest.approx(STALL - TICK)
    assert np.all(lag[: AT - 1] < 1e-9)
    assert np.all(lag[AT + 50 :] < 1e-9)
    assert np.diff(cell.times).min() >= 0.75 * TICK - 1e-9

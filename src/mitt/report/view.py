"""The viewer: a recording in the browser, to be scrubbed, or followed while it is written."""

import contextlib
import html
import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any, final

import numpy as np

from mitt.catcher.settings import PHASES
from mitt.catcher.state import REASONS, STATES
from mitt.errors import FileError, MittError
from mitt.files.recordings import Recorded
from mitt.link.clock import monotonic, pause
from mitt.report.replay import served
from mitt.report.stage_view import Stage
from mitt.signals import Array
from mitt.trials.score import drive_loads

#: Time between two pictures [s], between two looks for a newer file, and for the first [s].
_FRAME, _LOOK, _WAIT = 0.033, 1.0, 0.2
#: Place of the slider in the panel: behind the title.
_SECOND = 0.5
_SPEEDS = {"1/20": 0.05, "1/10": 0.1, "1/5": 0.2, "1/2": 0.5, "1": 1.0}
_BLUE, _ORANGE = "#0072b2", "#d55e00"
_MARK = {"caught": "#009e73", "stopped": "#cc79a7", "abort": "#cc79a7", "refused": "#d55e00"}


def newest(folder: Path) -> Path | None:
    """Return the recording in a folder that was written last; None where there is none.

    What vanishes meanwhile, leads nowhere or may not be looked at is none.
    """
    found: list[tuple[int, Path]] = []
    for place, _, names in os.walk(folder):
        for path in (Path(place, name) for name in names if name.endswith(".mcap")):
            with contextlib.suppress(OSError):
                status = path.stat()
                if stat.S_ISREG(status.st_mode):
                    found.append((status.st_mtime_ns, path))
    return max(found, default=(0, None))[1]


@final
class Viewer:
    """What the browser shows, and what it is asked for there."""

    def __init__(self, server: Any, path: Path) -> None:  # noqa: ANN401 (viser)
        """Put up the scene and the panel for the first recording."""
        self._server, self._gui = server, server.gui
        server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        server.gui.main_panel.dock_right()
        server.initial_camera.position = (2.1, -3.6, 1.0)
        server.initial_camera.look_at = (1.45, 0.0, 0.05)
        server.initial_camera.fov = 0.75
        self._title = self._gui.add_html("", order=0.0)
        self._slider: Any = None
        self._play = self._gui.add_checkbox("play", initial_value=False)
        self._live = self._gui.add_checkbox("follow", initial_value=True)
        self._speed = self._gui.add_dropdown("speed", tuple(_SPEEDS), initial_value="1/5")
        self._panel = self._gui.add_html("")
        self._images: list[Any] = []
        self._shown = -1
        self.load(path)

    def load(self, path: Path) -> None:
        """Show another recording; the one that is shown stays where it cannot be read.

        Raises:
            FileError: It cannot be.
        """
        recorded = Recorded(path)
        _ = recorded.ticks
        self._recorded = recorded
        with self._server.atomic():
            self._put_up()

    def _put_up(self) -> None:
        """Put up the scene of the recording."""
        self._server.scene.reset()
        self._stage = Stage(self._server.scene, self._recorded)
        for image in self._images:
            image.remove()
        blank = [np.zeros(shape, np.uint8) for shape in self._recorded.about.shapes]
        self._images = [
            self._gui.add_image(np.repeat(x[:, :, None], 3, 2), label=f"camera {k}")
            for k, x in enumerate(blank) if self._recorded.has_images
        ]  # fmt: skip
        self._shown = -1
        if self._slider is not None:
            self._slider.remove()
        self._slider = self._gui.add_slider("tick", 0, self._last, 1, 0, order=_SECOND)
        self._slider.on_update(self._scrubbed)
        self._grown()
        self.show(0 if self._recorded.whole else len(self._recorded.ticks) - 1)

    @property
    def _last(self) -> int:
        """Number of the newest tick; 1 where there are none, as a slider needs a length."""
        return max(len(self._recorded.ticks) - 1, 1)

    @property
    def path(self) -> Path:
        """The recording that is shown."""
        return self._recorded.path

    def step(self, elapsed: float) -> None:
        """Go on by so much time [s]: read what is new, play."""
        grown = False
        with contextlib.suppress(MittError):  # gone or broken: what was read stays
            grown = not self._recorded.whole and self._recorded.more() > 0
        if grown:
            self._grown()
            self._stage.refresh(self._recorded)
            if self._live.value:
                self.show(len(self._recorded.ticks) - 1)
        if self._play.value and len(self._recorded.ticks):
            ahead = max(round(1e3 * elapsed * _SPEEDS[self._speed.value]), 1)
            self.show((self._shown + ahead) % len(self._recorded.ticks))

    def show(self, k: int) -> None:
        """Show a tick."""
        rows = self._recorded.ticks
        if not 0 <= k < len(rows) or k == self._shown:
            return
        self._shown = k
        with self._server.atomic():
            self._stage.show(rows, k)
            self._panel.content = _panel(self._recorded, k)
            number = int(self._recorded.numbers[k])
            for frame in self._recorded.frames(number):
                if frame.camera < len(self._images):
                    grey = np.repeat(frame.pixels[:, :, None], 3, 2)
                    self._images[frame.camera].image = grey
        if self._slider.value != k:
            self._slider.value = k

    def _scrubbed(self, event: Any) -> None:  # noqa: ANN401 (viser)
        """Show what the slider was moved to."""
        if event.client is not None:
            self._live.value = False
            self.show(int(self._slider.value))

    def _grown(self) -> None:
        """Let the slider reach the newest tick."""
        self._slider.max = self._last
        state = "whole" if self._recorded.whole else "being written, or cut"
        self._title.content = (
            f"<div style='font-size:13px;padding:2px 12px'><b>{html.escape(self.path.name)}</b>"
            f"<br>{html.escape(self._recorded.about.arm.model.name)}, limits "
            f"{html.escape(self._recorded.about.arm.limits.name)}, {state}</div>"
        )


def _panel(recorded: Recorded, k: int) -> str:
    """Return state, estimate and limits of a tick as HTML."""
    row, arm = recorded.ticks[k], recorded.about.driven_arm
    phase = PHASES[int(row["out_phase"]) % len(PHASES)].value
    state = STATES[int(row["out_health"]) % len(STATES)].value
    reason = REASONS[int(row["out_reason"]) % len(REASONS)].value
    told = row["command"].reshape(4, arm.n)
    read = np.nan_to_num(np.array([row["q"], row["dq"]]))
    loads = drive_loads(arm, read[:1].copy(), read[1:].copy(), told[3:].copy())
    torque, speed = arm.by_joint(loads.share[0]), np.abs(told[1]) / arm.dq_max
    span = 0.5 * (arm.q_max - arm.q_min)
    spent = np.abs(told[0] - 0.5 * (arm.q_max + arm.q_min)) / span
    left = float(row["out_time_to_catch"])
    known = bool(row["out_tracked"])
    facts = [
        ("time", f"{1e3 * float(row['t']):.0f} ms"),
        ("phase", phase),
        ("state", state if reason == "none" else f"{state}: {reason}"),
        ("1-sigma", f"{1e3 * float(row['out_sigma']):.1f} mm" if known else "\u2013"),
        ("last seen", f"{1e3 * float(row['out_age']):.0f} ms ago" if known else "\u2013"),
        ("catch in", f"{1e3 * left:.0f} ms" if np.isfinite(left) else "\u2013"),
    ]
    lines = "".join(
        f"<tr><td style='color:#6b7785;padding-right:14px'>{name}</td><td style='color:"
        f"{_MARK.get(value, '#1f2933')}'><b>{html.escape(value)}</b></td></tr>"
        for name, value in facts
    )
    bars = "".join(
        _bars(name, shares, arm.names)
        for name, shares in (("torque", torque), ("speed", speed), ("range", spent))
    )
    return f"<div style='font-size:13px;padding:2px 12px'><table>{lines}</table>{bars}</div>"


def _bars(name: str, shares: Array, joints: tuple[str, ...]) -> str:
    """Return shares of limits as bars."""
    rows = "".join(
        f"<tr><td style='width:64px'>{html.escape(joint[:12])}</td><td style='width:150px'>"
        "<div style='background:#eef2f5;height:9px;border-radius:4px'><div style='height:9px;"
        f"border-radius:4px;width:{100.0 * min(share, 1.0):.0f}%;"
        f"background:{_ORANGE if share > 0.9 else _BLUE}'></div></div></td>"
        f"<td style='text-align:right;width:48px'>{100.0 * share:.0f} %</td></tr>"
        for joint, share in zip(joints, np.nan_to_num(shares).tolist(), strict=True)
    )
    return (f"<div style='margin-top:8px;color:#6b7785'>share of {name} limits</div>"
            f"<table>{rows}</table>")  # fmt: skip


def watch(
    find: Callable[[], Path | None], *, host: str, port: int, ready: Callable[[str], None],
    until: float | None = None,
) -> None:  # fmt: skip
    """Serve the viewer until it is interrupted.

    Args:
        find: Returns the recording to be shown, which may change; None while there is none.
        host: Address to listen at.
        port: Port; the next free one where it is taken.
        ready: Is told the address once it can be opened.
        until: Time after which to end [s]; never if left out.
    """
    end = np.inf if until is None else monotonic() + until
    path = _first(find, end)
    if path is None:
        return
    with served(host, port) as server:
        viewer = Viewer(server, path)
        ready(f"http://{server.get_host()}:{server.get_port()}")
        last = look = monotonic()
        while (now := monotonic()) < end:
            viewer.step(now - last)
            last = now
            if now > look:
                look = now + _LOOK
                _switch(viewer, find())
            pause(_FRAME)


def _first(find: Callable[[], Path | None], end: float) -> Path | None:
    """Return the first recording that is found and can be read; None where there is none in time.

    Raises:
        FileError: It cannot be read, and is still what is found.
    """
    while (path := find()) is not None or monotonic() < end:
        try:
            if path is not None:
                Recorded(path)  # refused before anything listens
                return path
        except FileError:
            if find() == path:
                raise
        pause(_WAIT)
    return None


def _switch(viewer: Viewer, path: Path | None) -> None:
    """Show a newer recording once it can be read."""
    if path is not None and path != viewer.path:
        with contextlib.suppress(MittError):  # just begun, or gone again
            viewer.load(path)

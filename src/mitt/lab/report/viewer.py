"""The viewer: a recording in the browser, to be scrubbed, or followed while it is written.

Its scene has arm, hand, ball, what is believed of the ball, and where it will fly.
"""

import contextlib
import html
import os
import stat
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import mujoco
import numpy as np

from mitt.clock import monotonic, pause
from mitt.core.ball.flight import advance, forecast
from mitt.core.catcher.settings import BRAKE, PHASES
from mitt.core.catcher.state import REASONS, STATES
from mitt.core.errors import FileError, InputError, MittError
from mitt.core.signals import Array, BallState
from mitt.io.about import About
from mitt.io.cdr import Rows
from mitt.io.messages import CATCH_POINT, TRUTH
from mitt.io.recordings import Recorded
from mitt.lab.report.replay_3d import HAND, furnish, moving_bodies, place_frames, served
from mitt.lab.report.scene_meshes import BALL
from mitt.lab.trials.score import drive_loads
from mitt.lab.world.build import build_scene
from mitt.lab.world.scene import Scene

#: Age from which an estimate of the ball is not shown [s]: it is caught, or lost.
_STALE = 0.05
#: The same for a part, which slower cameras see [s]; how far ahead its way is drawn [s].
_GONE = 0.3
_AHEAD = 0.5
#: Colours: covariance, sightings, true ball.
_DOUBT = (86, 180, 233)
_SEEN = (110, 120, 130)
_TRUE = (240, 228, 66)


def recorded_scene(about: About) -> Scene:
    """Return a scene with ball or part, belt and floor of a recording, for its shapes alone."""
    scene, s = Scene(), about.settings
    if not about.maps and "scene" in about.notes:
        try:
            return Scene.model_validate_json(about.notes["scene"])
        except ValueError as error:
            raise FileError(
                "the recording", "a scene that can be drawn", str(error)[:80], do="record it again"
            ) from None
    ball = scene.ball.model_copy(update={"radius": s.ball_radius, "mass": s.ball_mass})
    return scene.model_copy(update={"ball": ball, "floor": s.around.floor})


@dataclass(frozen=True, slots=True)
class Ellipsoid:
    """An ellipsoid: half axes [m], shape (3,), and its attitude as w, x, y, z."""

    axes: Array
    wxyz: Array


def ellipsoid(covariance: Array) -> Ellipsoid:
    """Return the ellipsoid of three sigmas of a position's covariance [m^2], shape (3, 3).

    No half axis is shorter than 2 mm, or it would not be seen.
    """
    values, R = np.linalg.eigh(0.5 * (covariance + covariance.T))
    if np.linalg.det(R) < 0.0:
        R[:, 0] *= -1.0
    wxyz = np.empty(4)
    mujoco.mju_mat2Quat(wxyz, np.ascontiguousarray(R).ravel())
    return Ellipsoid(np.maximum(3.0 * np.sqrt(np.maximum(values, 0.0)), 0.002), wxyz)


def way(r: Array, dr: Array, drag: float, floor: float) -> Array:
    """Return where a ball will be each 10 ms, for 0.6 s or until it is on the floor [m], (k, 3)."""
    r, dr, out = r.copy(), dr.copy(), [r.copy()]
    for _ in range(60):
        advance(r, dr, drag, 0.01)
        if not np.all(np.isfinite(r)) or r[2] < floor:
            break
        out.append(r.copy())
    return np.array(out)


def _lay(node: Any, r: Array, covariance: Array) -> None:  # noqa: ANN401 (viser)
    """Lay an ellipsoid about a position [m]."""
    doubt = ellipsoid(covariance[:3, :3])
    node.position, node.wxyz, node.scale = tuple(r), tuple(doubt.wxyz), tuple(doubt.axes)


@final
class ViserScene:
    """Arm, hand and ball of one recording in a Viser scene."""

    def __init__(self, api: Any, recorded: Recorded) -> None:  # noqa: ANN401 (viser)
        """Put everything up.

        Args:
            api: Scene of a Viser server.
            recorded: The recording.

        Raises:
            InputError: Its arm has no hand to be drawn.
        """
        about = recorded.about
        if about.arm.model.hand is None:
            raise InputError("the arm", "one with a hand", "none")
        self._n, self._floor = about.arm.n, about.settings.around.floor
        self._ready, self._arm, self._meets = (
            about.arm.model.q_ready,
            about.arm,
            about.generator == "meeting",
        )
        scene = recorded_scene(about)
        self._model = build_scene(scene, about.arm.model).model
        self._data = mujoco.MjData(self._model)
        furnish(api, about.arm, scene, self._model)
        self._bodies = moving_bodies(api, self._model)
        self._ball = int(self._model.body("ball").id)
        self._free = int(self._model.jnt_qposadr[self._model.body_jntadr[self._ball]])
        hidden: dict[str, Any] = {"visible": False, "cast_shadow": False, "subdivisions": 3}
        self._doubt, self._at_catch = (
            api.add_icosphere(name, radius=1.0, color=_DOUBT, opacity=0.4, **hidden)
            for name in ("/doubt", "/doubt_at_catch")
        )
        nowhere = np.zeros((1, 2, 3), np.float32)
        self._way = api.add_line_segments("/way", nowhere, colors=BALL, thickness=0.006)
        self._trail = api.add_point_cloud(
            "/trail", np.zeros((1, 3), np.float32), _SEEN, point_size=0.014, point_shape="circle"
        )
        self._true = api.add_icosphere(
            "/true",
            radius=0.6 * about.settings.ball_radius,
            color=_TRUE,
            visible=False,
            subdivisions=2,
        )
        self._hand = api.add_icosphere(
            "/catch_point", radius=0.008, color=HAND, subdivisions=1, visible=False
        )
        self.refresh(recorded)

    def refresh(self, recorded: Recorded) -> None:
        """Take over what a recording that grows has now."""
        self._truth = {topic: recorded.track(topic) for topic in (TRUTH, CATCH_POINT)}

    def sphere(self, rows: Rows) -> tuple[Array, float]:
        """Return centre [m] and radius [m] about the arm, and the ball in flight, in some ticks."""
        self._data.qpos[: self._n] = self._ready
        mujoco.mj_kinematics(self._model, self._data)
        points = [self._data.xpos[body].copy() for body in self._bodies if body != self._ball]
        for row in rows[:: max(len(rows) // 20, 1)]:
            self._place(row)
            points += [
                self._data.xpos[body].copy()
                for body in self._bodies
                if body != self._ball or row["out_tracked"]
            ]
        low, high = np.min(points, axis=0), np.max(points, axis=0)
        return 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low)) + 0.15

    def show(self, rows: Rows, k: int) -> None:
        """Show tick ``k`` of a recording's ticks."""
        row = rows[k]
        self._place(row)
        stale = _GONE if self._meets else _STALE
        tracked = bool(row["out_tracked"] and row["out_age"] < stale)
        r, dr = row["ball"][:3], row["ball"][3:6]
        self._doubt.visible = self._way.visible = tracked
        self._at_catch.visible = self._foresee(row)
        self._bodies[self._ball].visible = tracked or self._carries(row)
        if tracked:
            _lay(self._doubt, r, row["covariance"].reshape(6, 6))
            ahead = way(r, dr, float(row["out_drag"]), self._floor)
            if self._meets:  # it does not fly
                ahead = np.array([r, r + _AHEAD * dr])
            if len(ahead) > 1:
                segments = np.stack([ahead[:-1], ahead[1:]], axis=1)
                self._way.points = segments.astype(np.float32)
            self._way.visible = len(ahead) > 1
        before = rows[max(k - 320, 0) : k : 8]  # 40 dots, 8 ms apart
        trail = before["ball"][before["out_tracked"], :3]
        self._trail.visible = len(trail) > 0
        if len(trail):
            self._trail.points = trail.astype(np.float32)
        for topic, node in ((TRUTH, self._true), (CATCH_POINT, self._hand)):
            self._follow(node, topic, float(row["t"]))

    def _place(self, row: np.void) -> None:
        """Place arm, fingers and ball."""
        qpos, n = self._data.qpos, self._n
        q, hand, told = np.nan_to_num(row["q"]), self._arm.model.hand, float(row["hand"])
        qpos[:n], qpos[n : self._free] = q, told if hand is None else hand.fingers_at(told)
        r = self._arm.position(q) if self._carries(row) else row["ball"][:3]
        qpos[self._free : self._free + 7] = (*r, 1.0, 0.0, 0.0, 0.0)
        place_frames(self._bodies, self._model, self._data)

    def _carries(self, row: np.void) -> bool:
        """Say whether the tool holds the part, as far as the catcher knows."""
        return self._meets and bool(row["out_phase"] == BRAKE and row["hand"] > 0.0)

    def _foresee(self, row: np.void) -> bool:
        """Show where the ball will be at a catch within 2 s, and how well known; say whether."""
        t, left = float(row["out_t_ball"]), float(row["out_time_to_catch"])
        if self._meets or not (row["out_tracked"] and 0.0 < left < 2.0):
            return False
        ball = row["ball"].reshape(3, 3).copy()
        drag, covariance = float(row["out_drag"]), row["covariance"].reshape(6, 6).copy()
        r_o, dr_o, ddr_o = ball
        state = BallState(
            t=t,
            tracked=True,
            r_o=r_o,
            dr_o=dr_o,
            ddr_o=ddr_o,
            drag=drag,
            covariance=covariance,
            t_seen=t,
            t_first=t,
        )
        then = forecast(state, t + left)
        if np.all(np.isfinite(then.covariance)):
            _lay(self._at_catch, then.r_o, then.covariance)
        return True

    def _follow(self, node: Any, topic: str, t: float) -> None:  # noqa: ANN401 (viser)
        """Place what is truly where, in a recording of a simulated throw."""
        times, r = self._truth[topic]
        node.visible = len(times) > 0
        if len(times):
            node.position = tuple(r[min(int(np.searchsorted(times, t)), len(r) - 1)])


#: What is played first, ticks before and after the catch.
_BEFORE = 450
_AFTER = 350
#: Of these the last, in which arm and ball are to be in the picture.
_NEAR = 650
#: Field of view from top to bottom [rad], and the direction from which a scene is looked at.
_FIELD = 0.75
_FROM = np.array([0.17, -0.96, 0.24])
#: Width of the panel [px]: beside the scene in a window of twice that, else on its lower half.
_PANEL = 400
#: Time between two looks for a newer file [s].
_LOOK = 1.0
_SPEEDS = {"1/20": 0.05, "1/10": 0.1, "1/5": 0.2, "1/2": 0.5, "1": 1.0}
_BLUE = "#0072b2"
_ORANGE = "#d55e00"
_MARK = {"caught": "#009e73", "stopped": "#cc79a7", "abort": "#cc79a7", "refused": "#d55e00"}


def newest(folder: Path) -> Path | None:
    """Return the recording in a folder that was written last; None where there is none.

    What vanishes meanwhile, leads nowhere or may not be looked at is none.
    """
    found: list[tuple[int, Path]] = []
    for inside, _, names in os.walk(folder):
        for path in (Path(inside, name) for name in names if name.endswith(".mcap")):
            with contextlib.suppress(OSError):
                status = path.stat()
                if stat.S_ISREG(status.st_mode):
                    found.append((status.st_mtime_ns, path))
    return max(found, default=(0, None))[1]


def around_catch(rows: Rows) -> tuple[int, int]:
    """Return the first tick to be played about the last catch, and where to end; all without."""
    near = np.flatnonzero(np.abs(rows["out_time_to_catch"]) < 0.006)
    if not len(near):
        return 0, len(rows)
    at = int(near[-1])
    return max(at - _BEFORE, 0), min(at + _AFTER, len(rows))


@final
class Viewer:
    """What the browser shows, and what it is asked for there."""

    def __init__(self, server: Any, path: Path) -> None:  # noqa: ANN401 (viser)
        """Put up the scene and the panel for the first recording."""
        self._server, self._gui = server, server.gui
        server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        server.gui.main_panel.dock_right()
        self.playing = False
        self._title = self._gui.add_html("", order=0.0)
        self._slider: Any = None
        self._play = self._gui.add_button("play", order=0.6)
        self._play.on_click(lambda _: self.play(not self.playing))
        self._live = self._gui.add_checkbox("follow", initial_value=True)
        self._speed = self._gui.add_dropdown("speed", tuple(_SPEEDS), initial_value="1/5")
        self._panel = self._gui.add_html("")
        self._images: list[Any] = []
        self._shown = -1
        self.load(path)
        server.on_client_connect(lambda client: self._look(client.camera))

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
        self._stage = ViserScene(self._server.scene, self._recorded)
        for image in self._images:
            image.remove()
        blank = [np.zeros(shape, np.uint8) for shape in self._recorded.about.shapes]
        self._images = [
            self._gui.add_image(np.repeat(x[:, :, None], 3, 2), label=f"camera {k}")
            for k, x in enumerate(blank)
            if self._recorded.has_images
        ]
        self._shown = -1
        if self._slider is not None:
            self._slider.remove()
        self._slider = self._gui.add_slider("tick", 0, self._last, 1, 0, order=0.5)
        self._slider.on_update(self._scrubbed)
        self._grown()
        self._turn, whole = around_catch(self._recorded.ticks), self._recorded.whole
        self._sphere = self._stage.sphere(self._recorded.ticks[slice(*self._turn)][-_NEAR:])
        self.show(self._turn[0] if whole else len(self._recorded.ticks) - 1)
        self.play(whole)
        for client in self._server.get_clients().values():
            self._look(client.camera)

    @property
    def _last(self) -> int:
        """Number of the newest tick; 1 where there are none, as a slider needs a length."""
        return max(len(self._recorded.ticks) - 1, 1)

    @property
    def path(self) -> Path:
        """The recording that is shown."""
        return self._recorded.path

    def step(self) -> None:
        """Read what is new."""
        grown = False
        with contextlib.suppress(MittError):  # gone or broken: what was read stays
            grown = not self._recorded.whole and self._recorded.more() > 0
        if grown:
            self._grown()
            self._stage.refresh(self._recorded)
            self._turn = 0, len(self._recorded.ticks)
            if self._live.value:
                self.show(len(self._recorded.ticks) - 1)

    def advance(self, elapsed: float) -> None:
        """Play on by so much time [s]: the catch again and again; all, once the slider moved."""
        first, end = self._turn
        if self.playing and end > first:
            ahead = max(round(1e3 * elapsed * _SPEEDS[self._speed.value]), 1)
            shown = self._shown + ahead
            self.show(shown if first <= shown < end else first)

    def play(self, on: bool) -> None:
        """Play, or stand still."""
        self.playing = on
        self._play.label = "pause" if on else "play"
        self._play.icon = "player-pause" if on else "player-play"

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
            self.play(False)
            self._turn = 0, len(self._recorded.ticks)
            self.show(int(self._slider.value))

    def _look(self, camera: Any) -> None:  # noqa: ANN401 (viser)
        """Let a browser look at arm and flight; a narrow one has the panel in its lower half."""
        centre, radius = self._sphere
        height, beside = 0.5 * _FIELD, camera.image_width > 2 * _PANEL
        free = camera.image_width - (_PANEL if beside else 0)
        width = np.arctan(np.tan(height) * free / camera.image_height)
        away = radius / np.sin(min(height, width))
        middle = centre - [0.0, 0.0, 0.0 if beside else 0.5 * away * np.tan(height)]
        camera.fov, camera.position = _FIELD, tuple(middle + away * _FROM)
        camera.look_at = tuple(middle)  # last: a camera that moves takes its aim along

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
    return (
        f"<div style='margin-top:8px;color:#6b7785'>share of {name} limits</div>"
        f"<table>{rows}</table>"
    )


def watch(
    find: Callable[[], Path | None],
    *,
    host: str,
    port: int,
    ready: Callable[[str], None],
    until: float | None = None,
    loads: Callable[[Path], None] | None = None,
) -> None:
    """Serve the viewer until it is interrupted.

    Args:
        find: Returns the recording to be shown, which may change; None while there is none.
        host: Address to listen at.
        port: Port; the next free one where it is taken.
        ready: Is told the address once it can be opened.
        until: Time after which to end [s]; never if left out.
        loads: Is told which recording is loaded, before that takes its time.
    """
    end = np.inf if until is None else monotonic() + until
    path = _first(find, end)
    if path is None:
        return
    if loads is not None:
        loads(path)
    with served(host, port) as server:
        viewer = Viewer(server, path)
        ready(f"http://{server.get_host()}:{server.get_port()}")
        last = look = monotonic()
        while (now := monotonic()) < end:
            viewer.step()
            if server.get_clients():
                viewer.advance(now - last)
            last = now
            if now > look:
                look = now + _LOOK
                _switch(viewer, find())
            pause(0.033)  # 30 pictures a second


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
        pause(0.2)
    return None


def _switch(viewer: Viewer, path: Path | None) -> None:
    """Show a newer recording once it can be read."""
    if path is not None and path != viewer.path:
        with contextlib.suppress(MittError):  # just begun, or gone again
            viewer.load(path)

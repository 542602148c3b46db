"""The scene of the viewer: arm, hand, ball, what is believed of it, and where it will fly."""

from dataclasses import dataclass
from typing import Any, final

import mujoco
import numpy as np

from mitt.ball.flight import advance, forecast
from mitt.errors import InputError
from mitt.files.about import About
from mitt.files.messages import CATCH_POINT, TRUTH, Rows
from mitt.files.recordings import Recorded
from mitt.report.replay import NODE, furnish
from mitt.signals import Array, BallState
from mitt.world.build import build_scene
from mitt.world.scene import Scene

#: Colours: covariance, predicted way, sightings, true ball, catch point.
_DOUBT, _WAY, _SEEN, _TRUE, _HAND = (
    (86, 180, 233), (213, 94, 0), (110, 120, 130), (240, 228, 66), (0, 114, 178),
)  # fmt: skip
#: How far ahead the way is shown [s], its step [s], and its points.
_STEP, _POINTS = 0.01, 60
#: Sigmas of the ellipsoid, and its least half axis [m].
_SIGMAS, _LEAST = 3.0, 0.002
#: Longest time to the catch for which the ball is shown there [s].
_FAR = 2.0
#: Dots of the trail, and ticks between them.
_TRAIL, _EACH = 40, 8


def scene_of(about: About) -> Scene:
    """Return a scene with the ball and the floor of a recording, for its shapes alone."""
    scene, s = Scene(), about.settings
    ball = scene.ball.model_copy(update={"radius": s.ball_radius, "mass": s.ball_mass})
    return scene.model_copy(update={"ball": ball, "floor": s.around.floor})


@dataclass(frozen=True, slots=True)
class Doubt:
    """An ellipsoid: half axes [m], shape (3,), and its attitude as w, x, y, z."""

    axes: Array
    wxyz: Array


def ellipsoid(covariance: Array) -> Doubt:
    """Return the ellipsoid of three sigmas of a position's covariance [m^2], shape (3, 3)."""
    values, R = np.linalg.eigh(0.5 * (covariance + covariance.T))
    if np.linalg.det(R) < 0.0:
        R[:, 0] *= -1.0
    wxyz = np.empty(4)
    mujoco.mju_mat2Quat(wxyz, np.ascontiguousarray(R).ravel())
    return Doubt(np.maximum(_SIGMAS * np.sqrt(np.maximum(values, 0.0)), _LEAST), wxyz)


def way(r: Array, dr: Array, drag: float, floor: float) -> Array:
    """Return where a ball will fly until it is on the floor [m], shape (k, 3)."""
    r, dr, out = r.copy(), dr.copy(), [r.copy()]
    for _ in range(_POINTS):
        advance(r, dr, drag, _STEP)
        if not np.all(np.isfinite(r)) or r[2] < floor:
            break
        out.append(r.copy())
    return np.array(out)


def _lay(node: Any, r: Array, covariance: Array) -> None:  # noqa: ANN401 (viser)
    """Lay an ellipsoid about a position [m]."""
    doubt = ellipsoid(covariance[:3, :3])
    node.position, node.wxyz, node.scale = tuple(r), tuple(doubt.wxyz), tuple(doubt.axes)


@final
class Stage:
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
        scene = scene_of(about)
        self._model = build_scene(scene, about.arm.model).model
        self._data = mujoco.MjData(self._model)
        furnish(api, about.arm, scene, self._model)
        moving = [b for b in range(1, self._model.nbody) if self._model.body_weldid[b] != 0]
        self._bodies = {b: api.add_frame(NODE.format(b), show_axes=False) for b in moving}
        self._ball = int(self._model.body("ball").id)
        hidden: dict[str, Any] = {"visible": False, "cast_shadow": False, "subdivisions": 3}
        self._doubt, self._at_catch = (
            api.add_icosphere(name, radius=1.0, color=_DOUBT, opacity=0.4, **hidden)
            for name in ("/doubt", "/doubt_at_catch")
        )
        nowhere = np.zeros((1, 2, 3), np.float32)
        self._way = api.add_line_segments("/way", nowhere, colors=_WAY, thickness=0.006)
        self._trail = api.add_point_cloud("/trail", np.zeros((1, 3), np.float32), _SEEN,
                                          point_size=0.014, point_shape="circle")  # fmt: skip
        self._true = api.add_icosphere("/true", radius=0.6 * about.settings.ball_radius,
                                       color=_TRUE, visible=False, subdivisions=2)  # fmt: skip
        self._hand = api.add_icosphere("/catch_point", radius=0.008, color=_HAND, subdivisions=1,
                                       visible=False)  # fmt: skip
        self.refresh(recorded)

    def refresh(self, recorded: Recorded) -> None:
        """Take over what a recording that grows has now."""
        self._truth = {topic: recorded.track(topic) for topic in (TRUTH, CATCH_POINT)}

    def show(self, rows: Rows, k: int) -> None:
        """Show tick ``k`` of a recording's ticks."""
        row = rows[k]
        self._place(row)
        tracked = bool(row["out_tracked"])
        r, dr = row["ball"][:3], row["ball"][3:6]
        self._doubt.visible = self._way.visible = tracked
        self._at_catch.visible = self._foresee(row)
        self._bodies[self._ball].visible = tracked
        if tracked:
            _lay(self._doubt, r, row["covariance"].reshape(6, 6))
            ahead = way(r, dr, float(row["out_drag"]), self._floor)
            if len(ahead) > 1:
                segments = np.stack([ahead[:-1], ahead[1:]], axis=1)
                self._way.points = segments.astype(np.float32)
            self._way.visible = len(ahead) > 1
        before = rows[max(k - _TRAIL * _EACH, 0) : k : _EACH]
        trail = before["ball"][before["out_tracked"], :3]
        self._trail.visible = len(trail) > 0
        if len(trail):
            self._trail.points = trail.astype(np.float32)
        for topic, node in ((TRUTH, self._true), (CATCH_POINT, self._hand)):
            self._follow(node, topic, float(row["t"]))

    def _place(self, row: np.void) -> None:
        """Place arm, fingers and ball."""
        qpos, n = self._data.qpos, self._n
        q = np.nan_to_num(row["q"])
        qpos[:n], qpos[n:-7] = q, row["hand"]
        qpos[-7:] = (*row["ball"][:3], 1.0, 0.0, 0.0, 0.0)
        mujoco.mj_kinematics(self._model, self._data)
        for b, handle in self._bodies.items():
            handle.position, handle.wxyz = tuple(self._data.xpos[b]), tuple(self._data.xquat[b])

    def _foresee(self, row: np.void) -> bool:
        """Show where the ball will be at the catch, and how well that is known; say whether."""
        t, left = float(row["out_t_ball"]), float(row["out_time_to_catch"])
        if not (row["out_tracked"] and 0.0 < left < _FAR):
            return False
        ball = row["ball"].reshape(3, 3).copy()
        drag, covariance = float(row["out_drag"]), row["covariance"].reshape(6, 6).copy()
        r_o, dr_o, ddr_o = ball
        state = BallState(
            t=t, tracked=True, r_o=r_o, dr_o=dr_o, ddr_o=ddr_o, drag=drag, covariance=covariance,
            t_seen=t, t_first=t,
        )  # fmt: skip
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

"""One throw as a 3-D replay: a page of its own that plays, stops, turns and needs no network.

Viser records a scene that changes over time. Its recorder belongs to a server, so one listens on
this machine alone for as long as the page is made; nothing ever connects to it.

A browser lets any page open a websocket to any address, the machine's own included. It says in
``Origin`` which page asks; the server compares that with the address by which it was reached, and
answers its own page alone. That address has to be one of the machine itself: a name that somebody
else has pointed at it is none.
"""

import contextlib
import io
import ipaddress
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

import mujoco
import numpy as np
import viser
import websockets.asyncio.server as websocket_server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from mitt.core.arm.arm import Arm
from mitt.core.catcher.settings import PHASES
from mitt.lab.report.painter import View
from mitt.lab.report.scene_meshes import BALL, body_meshes
from mitt.lab.trials.log import TrialLog
from mitt.lab.world.build import build_scene
from mitt.lab.world.scene import Scene


@contextmanager
def own_pages_alone() -> Iterator[None]:
    """Let servers that start within the block answer their own pages, and programs, alone.

    Viser takes no function that looks at a request, so its own is wrapped as it starts.
    """
    serve = websocket_server.serve

    def guarded(*given: Any, process_request: Any, **named: Any) -> Any:  # noqa: ANN401 (as serve)
        def answered(connection: ServerConnection, request: Request) -> Response | None:
            host, origin = (request.headers.get(x) for x in ("Host", "Origin"))
            if not may_ask(host, origin):
                return connection.respond(403, "this page may not look here\n")
            answer: Response | None = process_request(connection, request)
            return answer

        return serve(*given, process_request=answered, **named)

    websocket_server.serve = guarded  # type: ignore[assignment,misc]  # it is called alike
    try:
        yield
    finally:
        websocket_server.serve = serve  # type: ignore[misc]  # a class


def may_ask(host: str | None, origin: str | None) -> bool:
    """Say whether a request may be answered.

    Args:
        host: The address by which the server was reached, as ``127.0.0.1:8080``.
        origin: The page that asks, as ``http://127.0.0.1:8080``; None where no page does.
    """
    if host is None or not _is_this_machine(host):
        return False
    return origin is None or origin.lower() == f"http://{host.lower()}"


def _is_this_machine(host: str) -> bool:
    """Say whether an address is one that only the machine itself can have: a number, its name."""
    try:
        name = urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return False
    own = socket.gethostname().lower()
    if name in ("localhost", own, own.partition(".")[0], f"{own}.local"):
        return True
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


#: A picture each so many ticks, and how much slower than life it plays.
_EACH = 4
_SLOWER = 5.0
_SKY = (150, 164, 181)
"""Colour behind the scene: that of :mod:`mitt.lab.report.painter`."""
HAND = (0, 114, 178)
"""Colour of the catch point and its path: the blue of the figures."""
NODE = "/bodies/{:02d}"
"""Name of a body's node."""


#: What the replay shows at first, as wide as a page is at most.
BOX = View(eye=(1.25, -2.35, 0.62), target=(0.78, 0.0, 0.02), angle=0.75, size=(1032, 540))


def replay_page(arm: Arm, scene: Scene, log: TrialLog) -> str:
    """Return the replay of a trial as one self-contained HTML page."""
    model = build_scene(scene, arm.model).model
    with served() as server:
        furnish(server.scene, arm, scene, model)
        server.initial_camera.position, server.initial_camera.look_at = BOX.eye, BOX.target
        server.initial_camera.fov = BOX.angle
        page: str = _recorded(server, model, log)
    return page


@contextlib.contextmanager
def served(host: str = "127.0.0.1", port: int = 8080) -> Iterator[Any]:
    """Run Viser for its own page, by default on the loopback; what it prints is not shown."""
    with contextlib.redirect_stdout(io.StringIO()), own_pages_alone():
        server = viser.ViserServer(host=host, port=port, verbose=False)
    try:
        yield server
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()


def furnish(scene_api: Any, arm: Arm, scene: Scene, model: mujoco.MjModel) -> None:  # noqa: ANN401
    """Add floor, light and all bodies."""
    scene_api.set_up_direction("+z")
    scene_api.configure_environment_map(None)
    scene_api.set_background_image(np.full((8, 8, 3), _SKY, np.uint8), format="png")
    scene_api.configure_default_lights(enabled=False)
    scene_api.add_light_hemisphere(
        "/light/sky", sky_color=(255, 255, 255), ground_color=(150, 155, 165), intensity=2.2
    )
    scene_api.add_light_directional(
        "/light/sun",
        color=(255, 250, 240),
        intensity=2.0,
        position=(1.0, -2.0, 3.0),
        cast_shadow=True,
    )
    scene_api.add_grid(
        "/floor",
        width=8.0,
        height=6.0,
        cell_size=0.25,
        section_size=1.0,
        plane="xy",
        cell_color=(137, 151, 168),
        section_color=(160, 173, 189),
        position=(1.5, 0.0, scene.floor),
        plane_color=(118, 132, 149),
        plane_opacity=1.0,
        shadow_opacity=0.45,
        fade_distance=14.0,
    )
    for body in range(model.nbody):
        for k, (mesh, colour) in enumerate(body_meshes(model, body, arm, scene)):
            scene_api.add_mesh_simple(
                f"{NODE.format(body)}/{k}",
                mesh.vertices.astype(np.float32),
                mesh.faces.astype(np.uint32),
                color=colour,
                side="double",
                receive_shadow=False,
            )


def moving_bodies(scene_api: Any, model: mujoco.MjModel) -> dict[int, Any]:  # noqa: ANN401
    """Add a frame for each body that can move, and return these by body."""
    return {
        b: scene_api.add_frame(NODE.format(b), show_axes=False)
        for b in range(1, model.nbody)
        if model.body_weldid[b] != 0
    }


def place_frames(frames: dict[int, Any], model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Place the frames of moving bodies where they are at ``data.qpos``."""
    mujoco.mj_kinematics(model, data)
    for b, frame in frames.items():
        frame.position, frame.wxyz = tuple(data.xpos[b]), tuple(data.xquat[b])


def _recorded(server: Any, model: mujoco.MjModel, log: TrialLog) -> str:  # noqa: ANN401
    """Move the bodies through the trial while Viser records, and return its page."""
    api, trace = server.scene, log.truth
    handles = moving_bodies(api, model)
    label = api.add_label("/clock", "", position=(0.78, 0.0, 0.85), anchor="center-center")
    last = _last(log)
    ticks = np.arange(0, last, _EACH)
    catch = int(np.searchsorted(trace.t, log.t_catch)) if np.isfinite(log.t_catch) else last
    dots = [
        (
            k,
            api.add_icosphere(
                f"/trail/{k:05d}",
                radius=0.008,
                color=BALL,
                subdivisions=1,
                position=tuple(trace.r_o[k]),
                visible=False,
                cast_shadow=False,
            ),
        )
        for k in range(0, catch, 24)
    ]
    path = trace.position[: int(ticks[-1]) : 8].astype(np.float32)
    if len(path) > 1:
        segments = np.stack([path[:-1], path[1:]], axis=1)
        api.add_line_segments("/hand_path", segments, colors=HAND, thickness=0.006)
    data = mujoco.MjData(model)
    recorder = server.get_scene_serializer()
    for k in ticks.tolist():
        data.qpos[:] = trace.qpos[k]
        place_frames(handles, model, data)
        phase = PHASES[log.phase[min(k, len(log.phase) - 1)]].value
        label.text = f"{1e3 * trace.t[k]:.0f} ms  {phase}"
        for at, dot in dots:
            if at <= k < at + _EACH:
                dot.visible = True
        recorder.insert_sleep(_EACH * 1e-3 * _SLOWER)
    recorder.insert_sleep(1.0)
    page: str = recorder.as_html()
    return page


def _last(log: TrialLog) -> int:
    """Return the row of the truth at which the replay ends: 0.45 s after first contact."""
    touched = np.flatnonzero(log.truth.force > 0.0)
    if not len(touched):
        return len(log.truth.t)
    return min(len(log.truth.t), int(touched[0]) + 450)

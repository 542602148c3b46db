"""The replay moves what moved, and leaves nothing running."""

import base64
import re
import socket
import threading
import urllib.error
import urllib.request

import msgspec
import mujoco
import numpy as np
import pytest
import viser
import zstandard
from trimesh import Trimesh
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from mitt.core.arm.arm import Arm
from mitt.lab.report.replay_3d import may_ask, replay_page, served
from mitt.lab.report.scene_meshes import (
    bones,
    capsule,
    cylinder,
    frames,
    geom_mesh,
    rod,
    skeleton,
    sphere,
)
from mitt.lab.trials.runner import LoggedTrial
from mitt.lab.world.build import build_scene
from mitt.lab.world.scene import Scene

#: Meshes of 24 corners around the axis: their volume is short by 1 %, domes by 5 %.
_FACETS = 0.07


@pytest.mark.parametrize(
    ("mesh", "volume"),
    [
        (capsule(0.05, 0.4), np.pi * 0.05**2 * 0.4 + 4.0 / 3.0 * np.pi * 0.05**3),
        (sphere(0.04), 4.0 / 3.0 * np.pi * 0.04**3),
        (cylinder(0.04, 0.02), np.pi * 0.04**2 * 0.02),
        (
            rod(np.array([0.1, 0.2, 0.3]), np.array([0.1, 0.6, 0.3]), 0.05),
            np.pi * 0.05**2 * 0.4 + 4.0 / 3.0 * np.pi * 0.05**3,
        ),
    ],
)
def test_meshes_enclose_the_volume_of_their_shapes(mesh: Trimesh, volume: float) -> None:
    """Closed, facing outwards, and no larger than the round shape that they stand for."""
    assert (1.0 - _FACETS) * volume < mesh.volume < volume


def test_meshes_of_geoms_fill_their_bounds(arm: Arm, scene: Scene) -> None:
    """Each geom's mesh reaches as far from the geom's centre as MuJoCo's own bound."""
    model = build_scene(scene, arm.model).model
    for g in range(model.ngeom):
        mesh = geom_mesh(model, g)
        if mesh is not None:
            far = np.linalg.norm(mesh.vertices - model.geom_pos[g], axis=1).max()
            assert far == pytest.approx(model.geom_rbound[g], rel=1e-6)


def test_a_rod_ends_at_its_points() -> None:
    """In every direction a rod reaches one radius beyond its two points."""
    for axis in np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3)).reshape(3, -1).T:
        if np.linalg.norm(axis) > 0.0:
            unit, start = axis / np.linalg.norm(axis), np.array([0.1, -0.2, 0.3])
            along = (rod(start, start + 0.4 * unit, 0.03).vertices - start) @ unit
            assert (along.min(), along.max()) == pytest.approx((-0.03, 0.43))


def test_the_skeleton_ends_at_the_catch_point_and_follows_mujoco(arm: Arm, scene: Scene) -> None:
    """The drawn line starts at the shoulder, ends at l(q), and its links lie where MuJoCo's do."""
    plant = build_scene(scene, arm.model)
    data, rng = mujoco.MjData(plant.model), np.random.default_rng(2)
    for q in rng.uniform(arm.q_min, arm.q_max, size=(20, arm.n)):
        line = skeleton(arm.model, q)
        np.testing.assert_allclose(line[0], np.zeros(3), atol=1e-12)
        np.testing.assert_allclose(line[-1], arm.position(q), atol=1e-12)
        data.qpos[: arm.n] = q
        mujoco.mj_kinematics(plant.model, data)
        for T, link in zip(frames(arm.model, q), arm.model.links, strict=True):
            body = plant.model.body(f"link_{link.name}").id
            np.testing.assert_allclose(T[:3, 3], data.xpos[body], atol=1e-12)


def test_the_skeleton_shows_both_offsets_of_the_elbow(arm: Arm) -> None:
    """Upright, the line is 0.55 m, 45 mm out, 45 mm back, then 0.35 m and the palm."""
    steps = np.diff(skeleton(arm.model, np.zeros(arm.n)), axis=0)
    np.testing.assert_allclose(
        np.linalg.norm(steps, axis=1), [0.55, 0.045, 0.045, 0.35, 0.12], atol=1e-12
    )
    assert len(bones(arm.model)) == len(arm.model.links)


def test_the_replay_shows_the_arm_moving_the_ball_flying_and_the_fingers_closing(
    arm: Arm, scene: Scene, direct: LoggedTrial, capsys: pytest.CaptureFixture[str]
) -> None:
    """Node poses in the recording are those of the plant; stdout and threads stay as they were."""
    assert direct.log is not None
    before = threading.active_count()
    page = replay_page(arm, scene, direct.log)
    assert capsys.readouterr().out == ""
    assert threading.active_count() <= before + 1
    moves = _moves(page)
    model = build_scene(scene, arm.model).model
    data = mujoco.MjData(model)
    for body in ("ball", "link_j4", "finger0"):
        b = model.body(body).id
        seen = np.array(moves[f"/bodies/{b:02d}"])
        data.qpos[:] = direct.log.truth.qpos[4 * (len(seen) // 2)]
        mujoco.mj_kinematics(model, data)
        gap = np.linalg.norm(seen - data.xpos[b], axis=1)
        assert gap.min() < 1e-6, body
        assert np.ptp(seen, axis=0).max() > 0.1, body


def _moves(page: str) -> dict[str, list[tuple[float, float, float]]]:
    """Return the positions that each node takes, read from the page as its player does."""
    found = re.search(r'__VISER_EMBED_DATA__="([^"]+)"', page)
    assert found is not None
    raw = (
        zstandard.ZstdDecompressor()
        .decompressobj()
        .decompress(base64.b64decode(found.group(1))[8:])
    )
    size = int.from_bytes(raw[:8], "little")
    content = msgspec.msgpack.decode(raw[8 : 8 + size])
    out: dict[str, list[tuple[float, float, float]]] = {}
    for _, message in content["messages"]:
        if message.get("type") == "SetPositionMessage":
            out.setdefault(message["name"], []).append(tuple(message["position"]))
    return out


OWN = socket.gethostname().lower()


@pytest.mark.parametrize(
    ("host", "origin", "may"),
    [
        ("127.0.0.1:8080", None, True),  # a program, as curl
        ("127.0.0.1:8080", "http://127.0.0.1:8080", True),
        ("localhost:8080", "http://localhost:8080", True),
        ("LOCALHOST:8080", "http://localhost:8080", True),
        ("192.168.1.7:8080", "http://192.168.1.7:8080", True),
        ("[::1]:8080", "http://[::1]:8080", True),
        (f"{OWN}:8080", f"http://{OWN}:8080", True),
        ("127.0.0.1:8080", "http://evil.example", False),
        ("127.0.0.1:8080", "http://127.0.0.1:9090", False),  # another server of the machine
        ("127.0.0.1:8080", "https://127.0.0.1:8080", False),
        ("127.0.0.1:8080", "http://localhost:8080", False),
        ("127.0.0.1:8080", "http://127.0.0.1:8080.evil.example", False),
        ("127.0.0.1:8080", "null", False),  # a file, a frame in a sandbox
        ("127.0.0.1:8080", "", False),
        ("evil.example:8080", "http://evil.example:8080", False),  # its name points at us
        ("evil.example:8080", None, False),
        ("127.0.0.1.evil.example:8080", None, False),
        (None, None, False),
        ("", None, False),
        ("[", None, False),
    ],
)
def test_who_may_ask(host: str | None, origin: str | None, may: bool) -> None:
    assert may_ask(host, origin) is may


def test_a_foreign_page_gets_no_scene_and_the_own_page_does() -> None:
    """Refused at the handshake, before a byte of the scene; the same for the pages themselves."""
    protocol = f"viser-v{viser.__version__}"
    with served(port=8876) as server:
        server.scene.add_label("/secret", "secret")
        own = f"127.0.0.1:{server.get_port()}"
        for origin in ("http://evil.example", "null", f"http://localhost:{server.get_port()}"):
            with pytest.raises(InvalidStatus) as stop:
                connect(f"ws://{own}", origin=origin, subprotocols=[protocol])  # type: ignore[list-item,arg-type]
            assert stop.value.response.status_code == 403
        for mine in (f"http://{own}", None):
            with connect(f"ws://{own}", origin=mine, subprotocols=[protocol]) as page:  # type: ignore[list-item,arg-type]
                assert len(page.recv(timeout=20)) > 0
        with urllib.request.urlopen(f"http://{own}", timeout=20) as page:
            assert page.status == 200
        rebound = urllib.request.Request(f"http://{own}", headers={"Host": "evil.example"})
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(rebound, timeout=20)  # noqa: S310

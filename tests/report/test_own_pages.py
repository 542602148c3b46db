"""The viewer's server answers its own page and programs of the machine, and no other page."""

import socket
import urllib.error
import urllib.request

import pytest
import viser
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from mitt.report.replay_3d import may_ask, served

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

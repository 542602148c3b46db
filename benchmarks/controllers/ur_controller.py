"""A controller of Universal Robots as ur_rtde sees one: RTDE, dashboard, and the script's port.

As RTDE's guide describes it, input registers are latched as packages arrive and looked at once a
cycle of 2 ms, so that of two commands in a cycle the second alone is seen. The arm follows speeds
and angles exactly, torques by a rotor without friction. What a real controller does beyond that is
not here: no limit, no lag, no protective stop.
"""

import json
import socket
import struct
import sys
import threading
import time
from collections import Counter
from pathlib import Path

PERIOD = 0.002
#: Inertia of a joint under torques [kg m^2].
_INERTIA = 1.0
#: Commands of ur_rtde's script (rtde_control.script), by their numbers.
SPEEDJ = 9
SERVOJ = 11
TORQUE = 66
#: Kinds of packages of RTDE.
_VERSION = 86
_URCONTROL = 118
_OUTPUTS = 79
_INPUTS = 73
_START = 83
_PAUSE = 80
_DATA = 85
_FORMS = {
    "VECTOR6D": "6d",
    "VECTOR3D": "3d",
    "VECTOR6INT32": "6i",
    "DOUBLE": "d",
    "UINT64": "Q",
    "UINT32": "I",
    "INT32": "i",
    "UINT8": "B",
    "BOOL": "?",
}
_KINDS = {
    "payload_cog": "VECTOR3D",
    "actual_tool_accelerometer": "VECTOR3D",
    "elbow_position": "VECTOR3D",
    "elbow_velocity": "VECTOR3D",
    "joint_mode": "VECTOR6INT32",
    "actual_digital_input_bits": "UINT64",
    "actual_digital_output_bits": "UINT64",
    "robot_mode": "INT32",
    "safety_mode": "INT32",
    "safety_status": "INT32",
    "runtime_state": "UINT32",
    "robot_status_bits": "UINT32",
    "safety_status_bits": "UINT32",
    "output_bit_registers0_to_31": "UINT32",
    "output_bit_registers32_to_63": "UINT32",
    "speed_slider_mask": "UINT32",
}
_VECTORS: tuple[str, ...] = (
    "_q",
    "_qd",
    "_qdd",
    "_current",
    "moment",
    "_pose",
    "_TCP_speed",
    "_force",
    "_output",
)
_VECTORS += ("temperatures", "joint_voltage", "inertia", "wrench")
#: States of a program: stopped, playing.
_STOPPED = 1
_PLAYING = 2
#: What the script says in an output register: it waits for a command, it has done one.
_READY = 1
_DONE = 2


def kind_of(name: str) -> str:
    """Return the type of a field of RTDE."""
    if name in _KINDS:
        return _KINDS[name]
    if "int_register" in name:
        return "INT32"
    if "bit_register" in name:
        return "BOOL"
    if "mask" in name or "digital_output" in name or "analog_output_type" in name:
        return "UINT8"
    return "VECTOR6D" if name.endswith(_VECTORS) and "standard" not in name else "DOUBLE"


class Controller:
    """The controller and its arm.

    Attributes:
        seen: How often each command stood in the registers when they were looked at.
        sent: How often each arrived.
    """

    def __init__(self, q: list[float]) -> None:
        """Stand at angles [rad]."""
        self.q, self.dq = list(q), [0.0] * 6
        self.seen, self.sent = Counter[int](), Counter[int]()
        self.running, self._ready, self._clear = _STOPPED, _READY, threading.Lock()
        self._latched: tuple[int, list[float]] | None = None
        self._acts: tuple[int, list[float]] = (0, [])
        self._time, self._names = 0.0, dict[int, list[str]]()
        self.longest_gap = self._gap = 0

    def take(self, recipe: int, payload: bytes) -> None:
        """Latch what arrives."""
        names = self._names[recipe]
        form = ">" + "".join(_FORMS[kind_of(x)] for x in names)
        values = struct.unpack(form, payload[: struct.calcsize(form)])
        if not names[0].startswith("input_int"):
            return
        command = int(values[0])
        self.sent[command] += 1
        with self._clear:
            self._latched = command, [float(x) for x in values[1:] if isinstance(x, float)]
        if command not in (SPEEDJ, SERVOJ, TORQUE):  # these are never done
            self._ready = _DONE if command else _READY

    def cycle(self) -> None:
        """Look at the registers and move for a cycle."""
        with self._clear:
            latched, self._latched = self._latched, None
        if latched is not None:
            self.seen[latched[0]] += 1
            self._acts = latched
        command, values = self._acts
        moving = command in (SPEEDJ, SERVOJ, TORQUE)
        self._gap = 0 if latched is not None or not moving else self._gap + 1
        self.longest_gap = max(self.longest_gap, self._gap)
        if command == SPEEDJ and len(values) >= 6:
            self.dq = values[:6]
        elif command == SERVOJ and len(values) >= 6:
            self.dq = [(new - now) / PERIOD for new, now in zip(values, self.q, strict=False)]
        elif command == TORQUE and len(values) >= 6:
            self.dq = [v + PERIOD * x / _INERTIA for v, x in zip(self.dq, values, strict=False)]
        elif not moving:
            self.dq = [0.0] * 6
        self.q = [a + PERIOD * v for a, v in zip(self.q, self.dq, strict=True)]
        self._time += PERIOD

    def value(self, name: str) -> list[float]:
        """Return a field."""
        known: dict[str, list[float]] = {
            "timestamp": [self._time],
            "actual_q": self.q,
            "actual_qd": self.dq,
            "runtime_state": [self.running],
            "robot_status_bits": [1 | (2 if self.running == _PLAYING else 0)],
            "safety_status_bits": [1],
            "robot_mode": [7],
            "safety_mode": [1],
        }
        if name in known:
            return known[name]
        if name in ("output_int_register_0", "output_int_register_24"):
            return [self._ready]
        form = _FORMS[kind_of(name)]
        return [0.0] * int(form[:-1] or 1)

    def serve_rtde(self, link: socket.socket) -> None:
        """Speak RTDE."""
        outputs, raw, lock, begun = list[str](), b"", threading.Lock(), threading.Event()

        def send(kind: int, payload: bytes) -> None:
            with lock:
                link.sendall(struct.pack(">HB", 3 + len(payload), kind) + payload)

        def stream() -> None:
            due = time.monotonic()
            while True:
                due += PERIOD
                time.sleep(max(0.0, due - time.monotonic()))
                said = bytes([1])
                for name in outputs:
                    form = _FORMS[kind_of(name)]
                    whole = form[-1] not in "df"
                    said += struct.pack(
                        ">" + form, *(int(x) if whole else x for x in self.value(name))
                    )
                try:
                    send(_DATA, said)
                except OSError:
                    return

        while data := _received(link):
            raw += data
            while len(raw) >= 3 and len(raw) >= struct.unpack(">H", raw[:2])[0]:
                length, kind = struct.unpack(">HB", raw[:3])
                payload, raw = raw[3:length], raw[length:]
                if kind in (_VERSION, _START, _PAUSE):
                    send(kind, bytes([1]))
                    if kind == _START and not begun.is_set():
                        begun.set()
                        threading.Thread(target=stream, daemon=True).start()
                elif kind == _URCONTROL:
                    send(kind, struct.pack(">4I", 5, 26, 0, 0))
                elif kind == _OUTPUTS:
                    outputs[:] = payload[8:].decode().strip(",").split(",")
                    send(kind, bytes([1]) + ",".join(map(kind_of, outputs)).encode())
                elif kind == _INPUTS:
                    names = payload.decode().strip(",").split(",")
                    number = len(self._names) + 1
                    self._names[number] = names
                    send(kind, bytes([number]) + ",".join(map(kind_of, names)).encode())
                elif kind == _DATA:
                    self.take(payload[0], payload[1:])

    def serve_dashboard(self, link: socket.socket) -> None:
        """Answer the dashboard's questions."""
        link.sendall(b"Connected: Universal Robots Dashboard Server\n")
        answers = {
            "is in remote control": "true",
            "PolyscopeVersion": "URSoftware 5.26.0.0",
            "get robot model": "UR5",
            "get serial number": "20265500001",
            "programState": "PLAYING",
            "safetystatus": "Safetystatus: NORMAL",
            "robotmode": "Robotmode: RUNNING",
            "running": "Program running: true",
        }
        while data := _received(link):
            link.sendall((answers.get(data.decode().strip(), "ok") + "\n").encode())

    def serve_script(self, link: socket.socket) -> None:
        """Take a program and play it."""
        while _received(link):
            self.running, self._ready = _PLAYING, _READY


def _received(link: socket.socket) -> bytes:
    """Return what has arrived; nothing where the link is closed."""
    try:
        return link.recv(65536)
    except OSError:
        return b""


def main(log: Path, q: list[float]) -> None:
    """Serve until ended; write what was seen each 0.2 s."""
    controller = Controller(q)
    ports = {30004: controller.serve_rtde, 29999: controller.serve_dashboard}
    ports |= dict.fromkeys((30001, 30002, 30003), controller.serve_script)
    for port, serve in ports.items():
        listener = socket.create_server(("127.0.0.1", port))

        def accept(listener: socket.socket = listener, serve: object = serve) -> None:
            while True:
                link, _ = listener.accept()
                link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                threading.Thread(target=serve, args=(link,), daemon=True).start()  # type: ignore[arg-type]

        threading.Thread(target=accept, daemon=True).start()
    due, count = time.monotonic(), 0
    while True:
        due, count = due + PERIOD, count + 1
        time.sleep(max(0.0, due - time.monotonic()))
        controller.cycle()
        if count % 100 == 0:
            said = {"sent": controller.sent, "seen": controller.seen, "q": controller.q}
            log.write_text(json.dumps(said | {"longest_gap": controller.longest_gap}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), json.loads(sys.argv[2]))

"""DDS as ROS 2 uses it, without ROS: topics, types and QoS by Eclipse Cyclone DDS.

ROS topic ``/name`` is DDS topic ``rt/name``, type ``pkg/Type`` is ``pkg::msg::dds_::Type_``, domain
0 or ``ROS_DOMAIN_ID`` is DDS domain of that number. Messages pass as CDR bytes
(:mod:`mitt.robot.cell.ros2_messages`); the types only tell Cyclone what a topic is.
"""

import os
import re
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from socket import if_nameindex
from typing import Any, Literal, final

from mitt.core.errors import InputError
from mitt.numerals import whole_of

try:
    from cyclonedds.core import (
        DDSException,
        InstanceState,
        ReadCondition,
        SampleState,
        ViewState,
        WaitSet,
    )
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.idl import make_idl_struct
    from cyclonedds.idl import types as idl
    from cyclonedds.pub import DataWriter
    from cyclonedds.qos import Policy, Qos
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
except ImportError as missing:
    raise InputError(
        "driver ros2", "Cyclone DDS", f"{missing}", do='install it with pip install "mitt[ros2]"'
    ) from None

Kind = Literal["command", "sensor"]
"""QoS as ROS 2 users set it: reliable, or best effort."""

#: Name of a topic, from the root on.
_TOPIC = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
#: Messages that wait to be taken.
_DEPTH = {"command": 10, "sensor": 40}
#: Key of a cell that names the interface, where no other is said.
_KEY = "robot.options.interface"
_ANY = SampleState.Any | ViewState.Any | InstanceState.Any


@final
class Received:
    """A message as it came: its bytes, and what DDS says of it."""

    __slots__ = ("cdr", "sample_info")

    def __init__(self, cdr: bytes) -> None:
        """Keep the bytes."""
        self.cdr, self.sample_info = cdr, None


def _part(package: str, name: str, /, **fields: Any) -> Any:  # noqa: ANN401 (Cyclone's)
    """Return a ROS 2 type by its fields, in their order."""
    return make_idl_struct(name, f"{package}::msg::dds_::{name}_", fields)


def _message(package: str, name: str, /, **fields: Any) -> Any:  # noqa: ANN401 (Cyclone's)
    """Return a ROS 2 type whose messages pass as bytes."""
    kind = _part(package, name, **fields)
    kind.serialize = lambda self, **_: self.cdr
    kind.deserialize = classmethod(lambda _, raw: Received(raw))
    kind.deserialize_key = classmethod(lambda _, __: Received(b""))
    return kind


_sequence: Any = idl.sequence
_float = idl.float64
_uint32 = idl.uint32
_floats = _sequence[idl.float64]
_std = "std_msgs"
_geometry = "geometry_msgs"
_diagnostic = "diagnostic_msgs"
Time = _part("builtin_interfaces", "Time", sec=idl.int32, nanosec=_uint32)
Duration = _part("builtin_interfaces", "Duration", sec=idl.int32, nanosec=_uint32)
Header = _part(_std, "Header", stamp=Time, frame_id=str)
Point = _part(_geometry, "Point", x=_float, y=_float, z=_float)
Quaternion = _part(_geometry, "Quaternion", x=_float, y=_float, z=_float, w=_float)
Pose = _part(_geometry, "Pose", position=Point, orientation=Quaternion)
TrajectoryPoint = _part(
    "trajectory_msgs",
    "JointTrajectoryPoint",
    positions=_floats,
    velocities=_floats,
    accelerations=_floats,
    effort=_floats,
    time_from_start=Duration,
)
Dimension = _part(_std, "MultiArrayDimension", label=str, size=_uint32, stride=_uint32)
Layout = _part(_std, "MultiArrayLayout", dim=_sequence[Dimension], data_offset=_uint32)
KeyValue = _part(_diagnostic, "KeyValue", key=str, value=str)
Status = _part(
    _diagnostic,
    "DiagnosticStatus",
    level=idl.byte,
    name=str,
    message=str,
    hardware_id=str,
    values=_sequence[KeyValue],
)
JointState = _message(
    "sensor_msgs",
    "JointState",
    header=Header,
    name=_sequence[str],
    position=_floats,
    velocity=_floats,
    effort=_floats,
)
PointStamped = _message(_geometry, "PointStamped", header=Header, point=Point)
PoseStamped = _message(_geometry, "PoseStamped", header=Header, pose=Pose)
JointTrajectory = _message(
    "trajectory_msgs",
    "JointTrajectory",
    header=Header,
    joint_names=_sequence[str],
    points=_sequence[TrajectoryPoint],
)
MultiArray = _message(_std, "Float64MultiArray", layout=Layout, data=_floats)
Bool = _message(_std, "Bool", data=bool)
String = _message(_std, "String", data=str)
Diagnostics = _message(_diagnostic, "DiagnosticArray", header=Header, status=_sequence[Status])


def domain_id() -> int:
    """Return the domain that ``ROS_DOMAIN_ID`` names, 0 without it."""
    said = os.environ.get("ROS_DOMAIN_ID", "0").strip() or "0"
    number = whole_of(said)
    if number is None or not 0 <= number <= 232:
        raise InputError("ROS_DOMAIN_ID", "a number in 0..232", repr(said[:40]))
    return number


def check_network(interface: str, *, key: str = _KEY) -> int:
    """Return the domain of a node on an interface, named by a key of a cell; joins nothing.

    Raises:
        InputError: ``ROS_DOMAIN_ID`` is no domain, or the interface is not there.
    """
    number = domain_id()
    if not interface.replace("-", "").replace(".", "").replace("_", "").isalnum():
        raise InputError(key, "the name of an interface", repr(interface))
    known = [name for _, name in if_nameindex()]
    if interface not in known:  # DDS would take all networks instead
        raise InputError(key, f"one of {', '.join(known)}", interface)
    return number


def check_topic(name: str) -> None:
    """Refuse what is no name of a ROS topic.

    Raises:
        InputError: It is none.
    """
    if not _TOPIC.fullmatch(name):
        wanted = "a name that begins with /, of letters, digits and _"
        raise InputError("a ROS topic", wanted, repr(name[:60]))


def _configuration(interface: str) -> str:
    """Return Cyclone's configuration: one interface; on the loopback 32 peers, no multicast."""
    loopback = interface == "lo"
    peers = (
        "<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32"
        "</MaxAutoParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers>"
    )
    return (
        f"<CycloneDDS><Domain id='any'><General><Interfaces><NetworkInterface name='{interface}'/>"
        f"</Interfaces><AllowMulticast>{'false' if loopback else 'true'}</AllowMulticast></General>"
        f"<Discovery><LeaseDuration>3s</LeaseDuration>{peers if loopback else ''}</Discovery>"
        f"<Internal><MultipleReceiveThreads>false</MultipleReceiveThreads></Internal>"
        f"</Domain></CycloneDDS>"
    )


def _sockets() -> dict[int, str]:
    """Return the sockets of this process: file descriptor, and what the kernel calls it."""
    found = {}
    for name in os.listdir("/proc/self/fd"):
        with suppress(OSError):
            place = os.readlink(f"/proc/self/fd/{name}")
            if place.startswith("socket:"):
                found[int(name)] = place
    return found


@contextmanager
def kept_to(interface: str, key: str = _KEY) -> Iterator[None]:
    """Bind each UDP socket that is made inside the block to an interface.

    Cyclone DDS 11 binds its receiving sockets to all addresses, whatever interface it is told to
    use. So bound, the kernel drops what comes in by any other interface.
    """
    if sys.platform != "linux":
        raise InputError(
            key,
            "Linux for the loopback alone",
            sys.platform,
            do="name another interface",
        )
    before = _sockets()
    yield
    for fd, place in _sockets().items():
        if before.get(fd) == place:
            continue
        with socket.socket(fileno=os.dup(fd)) as one:
            if one.type != socket.SOCK_DGRAM or one.family not in (socket.AF_INET, socket.AF_INET6):
                continue
            try:
                name = interface.encode() + b"\0"
                one.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, name)
            except OSError as error:
                do = "needs Linux 5.7 or the capability CAP_NET_RAW; or name another interface"
                raise InputError(
                    key,
                    f"sockets bound to {interface}",
                    error.strerror,
                    do=do,
                ) from None


def _qos(kind: Kind) -> Any:  # noqa: ANN401 (Cyclone's)
    """Return the QoS of a kind of topic."""
    reliable = Policy.Reliability.Reliable(1_000_000)  # a writer waits for room for 1 ms
    return Qos(
        Policy.Reliability.BestEffort if kind == "sensor" else reliable,
        Policy.Durability.Volatile,
        Policy.History.KeepLast(_DEPTH[kind]),
    )


def _delete(entity: Any) -> None:  # noqa: ANN401 (Cyclone's)
    """Take an entity out of the domain now, not when the process ends: others know it at once."""
    entity.__del__()  # Cyclone's Python has no other call for it


@final
class Publisher:
    """Publishes one topic."""

    def __init__(self, writer: Any, kind: type[Any]) -> None:  # noqa: ANN401 (Cyclone's)
        """Take Cyclone's writer and the type."""
        self._writer, self._message = writer, object.__new__(kind)

    def send(self, cdr: bytes) -> None:
        """Send a message."""
        self._message.cdr = cdr
        self._writer.write(self._message)

    def listeners(self) -> int:
        """Return how many subscribe."""
        return len(self._writer.get_matched_subscriptions())

    def close(self) -> None:
        """Publish no more."""
        _delete(self._writer)


@final
class Subscriber:
    """Subscribes to one topic."""

    def __init__(self, reader: Any) -> None:  # noqa: ANN401 (Cyclone's)
        """Take Cyclone's reader."""
        self._reader = reader

    def take(self, most: int = 64) -> list[bytes]:
        """Return the messages that have come, oldest first, so many at most."""
        return [cdr for _, cdr in self.heard(most)]

    def heard(self, most: int = 64) -> list[tuple[int, bytes]]:
        """Return such messages, each with a number of the publisher that it comes from."""
        found = self._reader.take(most)
        return [
            (m.sample_info.publication_handle, m.cdr) for m in found if m.sample_info.valid_data
        ]

    def speakers(self) -> int:
        """Return how many publish."""
        return len(self._reader.get_matched_publications())

    def close(self) -> None:
        """Subscribe no more."""
        _delete(self._reader)


@final
class Node:
    """A participant in a domain, with what it publishes and subscribes to."""

    def __init__(self, interface: str = "lo", *, key: str = _KEY) -> None:
        """Join the domain on one network interface, named by a key of a cell."""
        number = check_network(interface, key=key)
        with kept_to(interface, key) if interface == "lo" else nullcontext():
            with suppress(DDSException):  # this process is in the domain already
                self._domain = Domain(number, _configuration(interface))
            try:
                self._participant = DomainParticipant(number)
            except DDSException as error:
                raise InputError(
                    "DDS", f"domain {number} on interface {interface}", f"{error}"[:120]
                ) from error
        self._waiting = WaitSet(self._participant)

    def publish(self, topic: str, kind: type[Any], qos: Kind) -> Publisher:
        """Publish a ROS topic of a type of this module."""
        q = _qos(qos)
        return Publisher(DataWriter(self._participant, self._topic(topic, kind), qos=q), kind)

    def subscribe(
        self,
        topic: str,
        kind: type[Any],
        qos: Kind,
        *,
        wakes: bool = False,
        others: bool = False,
    ) -> Subscriber:
        """Subscribe to a ROS topic.

        Args:
            topic: Its name.
            kind: Its type.
            qos: Kind of QoS.
            wakes: Whether :meth:`wait` is to return for it.
            others: Whether what this node publishes itself is left out.
        """
        q = _qos(qos) + Qos(Policy.IgnoreLocal.Participant) if others else _qos(qos)
        reader = DataReader(self._participant, self._topic(topic, kind), qos=q)
        if wakes:
            self._waiting.attach(ReadCondition(reader, _ANY))
        return Subscriber(reader)

    def wait(self, timeout: float) -> bool:
        """Wait until a topic that wakes has something, at most ``timeout`` [s]; say whether."""
        return bool(self._waiting.wait(max(int(1e9 * timeout), 1)) > 0)

    def close(self) -> None:
        """Leave the domain now: others know it at once, and wait for no lease."""
        _delete(self._participant)

    def _topic(self, name: str, kind: type[Any]) -> Any:  # noqa: ANN401 (Cyclone's)
        """Return the DDS topic of a ROS topic."""
        check_topic(name)
        return Topic(self._participant, "rt" + name, kind)

"""DDS as ROS 2 uses it, without ROS: topics, types and QoS by Eclipse Cyclone DDS.

ROS topic ``/name`` is DDS topic ``rt/name``, type ``pkg/Type`` is ``pkg::msg::dds_::Type_``, domain
0 or ``ROS_DOMAIN_ID`` is DDS domain of that number. Messages pass as CDR bytes
(:mod:`mitt.link.messages`); the classes here only tell Cyclone their types.
"""

import os
from contextlib import nullcontext, suppress
from socket import if_nameindex
from typing import Any, Literal, final

from mitt.errors import InputError
from mitt.link.sockets import kept_to

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
    from cyclonedds.pub import DataWriter
    from cyclonedds.qos import Policy, Qos
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
except ImportError as missing:
    raise InputError("driver ros2", "Cyclone DDS", f"{missing}",
                     do='install it with pip install "mitt[ros2]"') from None  # fmt: skip

Kind = Literal["command", "sensor", "state"]
"""QoS as ROS 2 users set it: reliable, best effort, or reliable and kept for who comes late."""

#: Messages that wait to be taken.
_DEPTH = {"command": 10, "sensor": 40, "state": 10}
#: Most messages taken at once.
_TAKEN = 64
#: Longest that a reliable writer waits for room [ns].
_BLOCK = 1_000_000
#: Participants on one machine that find each other without multicast.
_PARTICIPANTS = 32
_ANY = SampleState.Any | ViewState.Any | InstanceState.Any


def domain_id() -> int:
    """Return the domain that ``ROS_DOMAIN_ID`` names, 0 without it."""
    said = os.environ.get("ROS_DOMAIN_ID", "0").strip() or "0"
    if not said.isdigit() or int(said) > 232:
        raise InputError("ROS_DOMAIN_ID", "a number in 0..232", repr(said[:40]))
    return int(said)


def _configuration(interface: str) -> str:
    """Return Cyclone's configuration: one interface; on the loopback peers without multicast."""
    loopback = interface == "lo"
    peers = (
        f"<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>"
        f"{_PARTICIPANTS}</MaxAutoParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers>"
    )
    return (
        f"<CycloneDDS><Domain id='any'><General><Interfaces><NetworkInterface name='{interface}'/>"
        f"</Interfaces><AllowMulticast>{'false' if loopback else 'true'}</AllowMulticast></General>"
        f"<Discovery><LeaseDuration>3s</LeaseDuration>{peers if loopback else ''}</Discovery>"
        f"<Internal><MultipleReceiveThreads>false</MultipleReceiveThreads></Internal>"
        f"</Domain></CycloneDDS>"
    )


def _qos(kind: Kind) -> Any:  # noqa: ANN401 (Cyclone's)
    """Return the QoS of a kind of topic."""
    reliable = Policy.Reliability.Reliable(_BLOCK)
    return Qos(
        Policy.Reliability.BestEffort if kind == "sensor" else reliable,
        Policy.Durability.TransientLocal if kind == "state" else Policy.Durability.Volatile,
        Policy.History.KeepLast(_DEPTH[kind]),
    )


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


@final
class Subscriber:
    """Subscribes to one topic."""

    def __init__(self, reader: Any) -> None:  # noqa: ANN401 (Cyclone's)
        """Take Cyclone's reader."""
        self._reader = reader

    def take(self, most: int = _TAKEN) -> list[bytes]:
        """Return the messages that have come, oldest first, so many at most."""
        return [m.cdr for m in self._reader.take(most) if m.sample_info.valid_data]

    def speakers(self) -> int:
        """Return how many publish."""
        return len(self._reader.get_matched_publications())


@final
class Node:
    """A participant in a domain, with what it publishes and subscribes to."""

    def __init__(self, interface: str = "lo") -> None:
        """Join the domain on one network interface.

        Raises:
            InputError: The interface, or the domain, cannot be used.
        """
        number = domain_id()
        if not interface.replace("-", "").replace(".", "").replace("_", "").isalnum():
            raise InputError("robot.options.interface", "the name of an interface", repr(interface))
        known = [name for _, name in if_nameindex()]
        if interface not in known:  # DDS would take all networks instead
            raise InputError("robot.options.interface", f"one of {', '.join(known)}", interface)
        with kept_to(interface) if interface == "lo" else nullcontext():
            with suppress(DDSException):  # this process is in the domain already
                self._domain = Domain(number, _configuration(interface))
            try:
                self._participant = DomainParticipant(number)
            except DDSException as error:
                raise InputError("DDS", f"domain {number} on interface {interface}",
                                 f"{error}"[:120]) from error  # fmt: skip
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

    def _topic(self, name: str, kind: type[Any]) -> Any:  # noqa: ANN401 (Cyclone's)
        """Return the DDS topic of a ROS topic."""
        if not name.startswith("/") or len(name) < 2:
            raise InputError("a ROS topic", "a name that begins with /", repr(name))
        return Topic(self._participant, "rt" + name, kind)

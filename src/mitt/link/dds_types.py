"""The ROS 2 message types as Cyclone DDS wants them told; messages pass as CDR bytes."""
# mypy: disable-error-code="type-arg"
# ruff: noqa: D101 (each is the ROS 2 message of its type name)

from dataclasses import dataclass
from typing import Any, final

from mitt.errors import InputError

try:
    from cyclonedds.idl import IdlStruct
    from cyclonedds.idl import types as idl
except ImportError as missing:
    raise InputError("driver ros2", "Cyclone DDS", f"{missing}",
                     do='install it with pip install "mitt[ros2]"') from None  # fmt: skip


@final
class Received:
    """A message as it came.

    Attributes:
        cdr: Its bytes.
        sample_info: What DDS says of it.
    """

    __slots__ = ("cdr", "sample_info")

    def __init__(self, cdr: bytes) -> None:
        """Keep the bytes."""
        self.cdr, self.sample_info = cdr, None


def _plain(kind: Any) -> Any:  # noqa: ANN401 (a class of Cyclone's)
    """Let messages of a type pass as bytes."""
    kind.serialize = lambda self, **_: self.cdr
    kind.deserialize = classmethod(lambda _, raw: Received(raw))
    kind.deserialize_key = classmethod(lambda _, __: Received(b""))
    return kind


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: idl.int32
    nanosec: idl.uint32


@dataclass
class Duration(IdlStruct, typename="builtin_interfaces::msg::dds_::Duration_"):
    sec: idl.int32
    nanosec: idl.uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: idl.float64
    y: idl.float64
    z: idl.float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: idl.float64
    y: idl.float64
    z: idl.float64
    w: idl.float64


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class TrajectoryPoint(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectoryPoint_"):
    positions: idl.sequence[idl.float64]
    velocities: idl.sequence[idl.float64]
    accelerations: idl.sequence[idl.float64]
    effort: idl.sequence[idl.float64]
    time_from_start: Duration


@dataclass
class Dimension(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayDimension_"):
    label: str
    size: idl.uint32
    stride: idl.uint32


@dataclass
class Layout(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayLayout_"):
    dim: idl.sequence[Dimension]
    data_offset: idl.uint32


@dataclass
class KeyValue(IdlStruct, typename="diagnostic_msgs::msg::dds_::KeyValue_"):
    key: str
    value: str


@dataclass
class Status(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticStatus_"):
    level: idl.byte
    name: str
    message: str
    hardware_id: str
    values: idl.sequence[KeyValue]


@_plain
@dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    header: Header
    name: idl.sequence[str]
    position: idl.sequence[idl.float64]
    velocity: idl.sequence[idl.float64]
    effort: idl.sequence[idl.float64]


@_plain
@dataclass
class PointStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PointStamped_"):
    header: Header
    point: Point


@_plain
@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    header: Header
    pose: Pose


@_plain
@dataclass
class JointTrajectory(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectory_"):
    header: Header
    joint_names: idl.sequence[str]
    points: idl.sequence[TrajectoryPoint]


@_plain
@dataclass
class MultiArray(IdlStruct, typename="std_msgs::msg::dds_::Float64MultiArray_"):
    layout: Layout
    data: idl.sequence[idl.float64]


@_plain
@dataclass
class Bool(IdlStruct, typename="std_msgs::msg::dds_::Bool_"):
    data: bool


@_plain
@dataclass
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    data: str


@_plain
@dataclass
class Diagnostics(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticArray_"):
    header: Header
    status: idl.sequence[Status]

"""The tree of coordinate frames that tf makes, and odometry with it: where a sensor was at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import DatasetError
from .ros_bag import Bag
from .ros_messages import ODOMETRY, POSE_STAMPED, TRANSFORMS, frame_id, stamp, timed_pose
from .ros_topics import POSE, choose
from .trajectory import TimedPose, Trajectory

STATIC = "tf_static"


@dataclass(slots=True, eq=False)
class Edge:
    """How one frame moves in the one above it.

    Attributes:
        parent: the frame above.
        static: whether tf says that it does not move: any pose holds at all times.
        poses: `parent_from_child` at several times.
    """

    parent: str
    static: bool
    poses: list[TimedPose] = field(default_factory=list)

    def is_still(self) -> bool:
        """Whether it does not move: many bags repeat what is static among what moves."""
        first = self.poses[0]
        return self.static or all(
            np.array_equal(pose.position, first.position) and np.array_equal(pose.quaternion, first.quaternion)
            for pose in self.poses
        )


class Chain:
    """The edges from the world down to a sensor."""

    def __init__(self, edges: Sequence[Edge]) -> None:
        self._links = [edge.poses[0].matrix() if edge.is_still() else Trajectory(edge.poses) for edge in edges]

    def gap(self, time: float) -> float:
        """Seconds from `time` to the nearest pose, of the edge where that is farthest."""
        return max((link.gap(time) for link in self._links if isinstance(link, Trajectory)), default=0.0)

    def pose_at(self, time: float, max_gap: float) -> NDArray[np.float64]:
        """`world_from_sensor` at `time`, whose `gap` must not exceed `max_gap`; (4, 4) float64."""
        world_from_sensor = np.eye(4)
        for link in self._links:
            pose = link.pose_at(time, max_gap).matrix() if isinstance(link, Trajectory) else link
            world_from_sensor = world_from_sensor @ pose
        return world_from_sensor


def find_chain(bag: Bag, sensor: str, pose_topic: str | None, world: str | None) -> Chain:
    """The chain to a sensor's frame, out of tf and, if tf does not say how the sensor moves, out of a pose topic.

    Args:
        bag: the bag.
        sensor: the frame of the sensor.
        pose_topic: a topic of Odometry or PoseStamped to be taken in any case. A PoseStamped does not say whose pose
            it is, nor do all Odometries; then it is taken as the sensor's.
        world: the frame to take as the world; by default the highest above the sensor. If it is named, the sensor may
            stand still in it.

    Raises:
        DatasetError: if nothing says how the sensor moves, or it has no such frame above it.
    """
    edges = _transforms(bag)
    candidates = bag.topics(ODOMETRY, POSE_STAMPED)
    moves = any(not edge.is_still() for edge in _above(bag, edges, sensor))
    if pose_topic is not None or (candidates and not moves):
        topic = choose(bag, pose_topic, candidates, POSE, "poses (Odometry or PoseStamped)")
        child, edge = _pose_edge(bag, topic, sensor)
        edges[child], moves = edge, True
        if edge not in _above(bag, edges, sensor):
            raise DatasetError(bag.path, f"nothing joins {sensor!r} to {child!r}, which {topic} moves: {_tree(edges)}")
    chain = _above(bag, edges, sensor)
    names = [edge.parent for edge in chain]
    if world is not None:
        if world not in names:
            raise DatasetError(bag.path, f"{world!r} is not above {sensor!r}: {_tree(edges)}")
        chain = chain[: names.index(world) + 1]
    elif not moves:
        still = f" (if it stands still in {names[-1]!r}, name that as world_frame)" if names else ""
        raise DatasetError(
            bag.path,
            f"there are no poses: neither tf nor a topic of Odometry or PoseStamped moves {sensor!r}{still}; "
            f"{_tree(edges)}; topics: {bag.content()}",
        )
    return Chain(chain[::-1])


def _above(bag: Bag, edges: dict[str, Edge], sensor: str) -> list[Edge]:
    """The edges from a frame upwards to the root."""
    chain: list[Edge] = []
    frame = sensor
    while frame in edges:
        if len(chain) == len(edges):
            raise DatasetError(bag.path, f"the transforms go round in a circle: {_tree(edges)}")
        chain.append(edges[frame])
        frame = edges[frame].parent
    return chain


def _transforms(bag: Bag) -> dict[str, Edge]:
    """Every edge of tf, by its child."""
    edges: dict[str, Edge] = {}
    for topic, message in bag.messages(bag.topics(*TRANSFORMS)):
        for transform in message.transforms:
            _add(bag, edges, topic, transform)
    return edges


def _add(bag: Bag, edges: dict[str, Edge], topic: str, transform: Any) -> None:
    child, parent = str(transform.child_frame_id).lstrip("/"), frame_id(transform.header)
    edge = edges.setdefault(child, Edge(parent, topic.endswith(STATIC)))
    if edge.parent != parent:
        raise DatasetError(bag.path, f"{topic}: {child!r} hangs from {edge.parent!r} and from {parent!r}")
    motion = transform.transform
    edge.poses.append(timed_pose(bag.path, topic, stamp(transform), motion.translation, motion.rotation))


def _pose_edge(bag: Bag, topic: str, sensor: str) -> tuple[str, Edge]:
    """The edge that a topic of Odometry or PoseStamped says, with its child."""
    edge: Edge | None = None
    child = sensor
    for _, message in bag.messages([topic]):
        if edge is None:
            edge = Edge(frame_id(message.header), static=False)
            child = str(getattr(message, "child_frame_id", "")).lstrip("/") or sensor
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        edge.poses.append(timed_pose(bag.path, topic, stamp(message), pose.position, pose.orientation))
    if edge is None:
        raise DatasetError(bag.path, f"{topic}: there is no message in it")
    return child, edge


def _tree(edges: dict[str, Edge]) -> str:
    if not edges:
        return "there is no tf"
    return "transforms: " + ", ".join(f"{edge.parent} > {child}" for child, edge in sorted(edges.items()))

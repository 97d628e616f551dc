"""TUM RGB-D: a folder with `depth.txt`, `groundtruth.txt` and perhaps `rgb.txt`, each line beginning with its time."""

from __future__ import annotations

import re
from bisect import bisect_left
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .._core import PinholeCamera
from .colour import ColourRef, first_size, same_view
from .errors import DatasetError
from .listing import Format, FrameRef, Listing, Options
from .png import read_png_depth
from .text import Line, read_comments, read_lines
from .trajectory import TimedPose, Trajectory, unit_quaternion

DEPTH_LIST = "depth.txt"
GROUND_TRUTH = "groundtruth.txt"
COLOR_LIST = "rgb.txt"


def _kinect(fx: float, fy: float, cx: float, cy: float) -> PinholeCamera:
    return PinholeCamera(width=640, height=480, fx=fx, fy=fy, cx=cx, cy=cy)


# The calibrations that the data set's authors publish for its three sensors, and the driver's own for all else.
FREIBURG = {
    "1": _kinect(517.3, 516.5, 318.6, 255.3),
    "2": _kinect(520.9, 521.0, 325.1, 249.7),
    "3": _kinect(535.4, 539.2, 320.1, 247.6),
}
ROS_DEFAULT = _kinect(525.0, 525.0, 319.5, 239.5)

# Seconds between an image and a pose; what the data set's own tools allow.
MAX_GAP = 0.02

_read_depth = partial(read_png_depth, units_per_metre=5000.0)


def _recognise(path: Path) -> bool:
    return (path / DEPTH_LIST).is_file()


def _list_frames(path: Path, options: Options) -> Listing[FrameRef]:
    camera = options.camera or _camera(path)
    max_gap = MAX_GAP if options.max_gap is None else options.max_gap
    trajectory = _read_trajectory(path / GROUND_TRUTH, options.skip_bad)
    colors = _ColorImages(path, max_gap)
    colour_camera = same_view(camera, colors.size())
    frames: list[FrameRef] = []
    dropped: dict[int, str] = {}
    for index, line in enumerate(read_lines(path / DEPTH_LIST)):
        try:
            time, depth_path = _timed_file(line)
        except DatasetError as error:
            if not options.skip_bad:
                raise
            dropped[index] = str(error)
            continue
        gap = trajectory.gap(time)
        if gap > max_gap:
            limit = f"the limit is {max_gap * 1e3:g} ms"
            dropped[index] = f"{depth_path}: the nearest ground-truth pose is {gap * 1e3:.1f} ms away; {limit}"
            continue
        read_depth = partial(_read_depth, depth_path)
        read_pose = partial(_pose_matrix, trajectory, time, max_gap)
        color = colors.nearest(time)
        colour = color and _colour(*color, trajectory, time, max_gap, colour_camera)
        frames.append(FrameRef(index, camera, read_depth, read_pose, time, color and color[1], colour))
    if not frames:
        reasons = f": {next(iter(dropped.values()))}" if dropped else ""
        raise DatasetError(path / DEPTH_LIST, f"none of its {len(dropped)} images can be used{reasons}")
    return Listing(frames, dropped)


def _pose_matrix(trajectory: Trajectory, time: float, max_gap: float) -> NDArray[np.float64]:
    return trajectory.pose_at(time, max_gap).matrix()


def _colour(
    time: float, path: Path, trajectory: Trajectory, depth_time: float, max_gap: float, camera: PinholeCamera
) -> ColourRef | None:
    """The depth is registered to the colour, but was taken at another time, when the camera was elsewhere."""
    if trajectory.gap(time) > max_gap:
        return None
    world_from_depth, world_from_colour = (trajectory.pose_at(t, max_gap).matrix() for t in (depth_time, time))
    return ColourRef.of_file(path, camera, np.linalg.inv(world_from_depth) @ world_from_colour)


def _read_trajectory(path: Path, skip_bad: bool) -> Trajectory:
    poses: list[TimedPose] = []
    first_error = DatasetError(path, "there is no pose in it")
    for line in read_lines(path):
        try:
            poses.append(_timed_pose(line))
        except DatasetError as error:
            if not skip_bad:
                raise
            first_error = error if not poses else first_error
    if not poses:
        raise first_error
    return Trajectory(poses)


def _timed_pose(line: Line) -> TimedPose:
    time, *numbers = line.numbers(8)
    try:
        return TimedPose(time, np.array(numbers[:3]), unit_quaternion(numbers[3:]))
    except ValueError as error:
        raise line.error(str(error)) from None


def _timed_file(line: Line) -> tuple[float, Path]:
    if len(line.words) != 2:
        raise line.error(f"expected a time and a file name, got {' '.join(line.words)[:80]!r}")
    (time,) = Line(line.path, line.number, line.words[:1]).numbers(1)
    return time, line.path.parent / line.words[1]


class _ColorImages:
    """The colour images of `rgb.txt`, if there is one, by time."""

    def __init__(self, folder: Path, max_gap: float) -> None:
        listed = folder / COLOR_LIST
        self._files = sorted(map(_timed_file, read_lines(listed))) if listed.is_file() else []
        self._times = [time for time, _ in self._files]
        self._max_gap = max_gap

    def nearest(self, time: float) -> tuple[float, Path] | None:
        """The time and the file of the image nearest to a time, if it is near enough."""
        after = bisect_left(self._times, time)
        near = self._files[max(after - 1, 0) : after + 1]
        best = min(near, key=lambda file: abs(file[0] - time), default=None)
        return best if best is not None and abs(best[0] - time) <= self._max_gap else None

    def size(self) -> tuple[int, int] | None:
        """Width and height of the images."""
        return first_size(path for _, path in self._files)


def _camera(folder: Path) -> PinholeCamera:
    """The sensor is known by the recording's name: that of the folder, or of the bag file in the lists' comments."""
    names = f"{folder.resolve().name}\n{read_comments(folder / DEPTH_LIST)}"
    sensor = re.search(r"(?:freiburg|(?<![a-z])fr)([123])(?!\d)", names)
    return FREIBURG[sensor[1]] if sensor else ROS_DEFAULT


TUM = Format(
    name="TUM RGB-D",
    looks_for=f"{DEPTH_LIST} and {GROUND_TRUTH}",
    recognise=_recognise,
    list_frames=_list_frames,
)

"""What goes into a recording, and under which name.

| entity | what |
|---|---|
| `world/map/voxels` | occupied voxels as boxes, coloured by height |
| `world/map/mesh` | the surface |
| `world/camera` | pose and intrinsics, a frame at a time |
| `world/camera/depth` | the depth image, which the viewer also shows as points |
| `world/trajectory` | the way of the camera: of each frame, the piece from the frame before |
| `colour` | the colour image |

Time lines: `frame`, the number in the data set, and, where that has times, `time`, seconds since the first frame.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from numpy.typing import ArrayLike, NDArray
from trimesh.transformations import quaternion_from_matrix

from .. import pictures
from .._core import Mesh, OccupancyGrid, PinholeCamera
from ..datasets import Frame
from .voxels import Boxes, occupied_boxes

# Without the extra `viz` there is no recorder, which `opening` says; the module can be looked at all the same.
with suppress(ImportError):
    import rerun as rr
    import rerun.blueprint as rrb

VOXELS, MESH = "world/map/voxels", "world/map/mesh"
CAMERA, DEPTH, TRAJECTORY = "world/camera", "world/camera/depth", "world/trajectory"
COLOUR = "colour"

_MILLIMETRES = 1000.0
_TRAJECTORY_COLOUR = (213, 94, 0)
_CAMERA_SIZE = 0.2
"""Distance of the drawn image plane from the camera, metres."""


class Recorder:
    """Puts maps and frames into one recording.

    Attributes:
        stream: Where to.
        blueprint: How the viewer arranges it.
    """

    def __init__(self, stream: rr.RecordingStream, frames: bool) -> None:
        self.stream = stream
        self.blueprint = _blueprint(frames)
        self._up: NDArray[np.float64] | None = None
        self._before: Frame | None = None
        self._started: float | None = None
        # When something was recorded says nothing about the data.
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)

    def set_up(self, up: ArrayLike) -> None:
        """Say which way is up; otherwise the first frame's camera says it, or z is.

        Args:
            up: (3,) unit vector.
        """
        self._up = np.asarray(up, dtype=np.float64)
        self.stream.log("world", _view_coordinates(self._up), static=True)

    def show_frame(self, frame: Frame) -> None:
        """Add a frame's pose and images, at its time."""
        if self._up is None:
            self.set_up(pictures.up_from_poses([frame.world_from_camera]))
        self._set_time(frame)
        pose = frame.world_from_camera
        self.stream.log(CAMERA, _transform(pose), _pinhole(frame.camera))
        self.stream.log(DEPTH, _depth_image(frame.depth))
        if frame.colour_path is not None:
            self.stream.log(COLOUR, rr.EncodedImage(path=frame.colour_path))
        if self._before is not None:
            way = np.stack([self._before.world_from_camera[:3, 3], pose[:3, 3]])
            self.stream.log(TRAJECTORY, rr.LineStrips3D([way], colors=_TRAJECTORY_COLOUR))
        self._before = frame

    def show_map(self, grid: OccupancyGrid, mesh: Mesh | None = None) -> Boxes:
        """Show a map as it is now: at the time of the frame shown last or, if there was none, at all times.

        Args:
            grid: The map.
            mesh: Its surface, if that is to be shown too.

        Returns:
            What stands for its occupied voxels.
        """
        always = self._before is None
        boxes = occupied_boxes(grid, (0, 0, 1) if self._up is None else self._up)
        halves = np.full_like(boxes.centres, boxes.edge / 2)
        self.stream.log(
            VOXELS,
            rr.Boxes3D(centers=boxes.centres, half_sizes=halves, colors=boxes.colours, fill_mode="solid"),
            static=always,
        )
        if mesh is not None:
            surface = rr.Mesh3D(
                vertex_positions=mesh.vertices,
                triangle_indices=mesh.faces,
                vertex_normals=mesh.normals,
                vertex_colors=None if mesh.colours is None else pictures.opaque(mesh.colours),
                albedo_factor=pictures.FRONT if mesh.colours is None else None,
            )
            self.stream.log(MESH, surface, static=always)
        return boxes

    def _set_time(self, frame: Frame) -> None:
        self.stream.set_time("frame", sequence=frame.index)
        if frame.timestamp is not None:
            self._started = frame.timestamp if self._started is None else self._started
            self.stream.set_time("time", duration=frame.timestamp - self._started)


def _blueprint(frames: bool) -> rrb.Blueprint:
    """The surface and the voxels, large; images beside them, and their time line below, if there are any."""
    to_now = rrb.VisibleTimeRange(
        "frame", start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative()
    )
    way: dict[str | rr.encodings.EntityPath, rrb.VisibleTimeRanges] = {TRAJECTORY: rrb.VisibleTimeRanges([to_now])}
    surface = rrb.Spatial3DView(name="surface", origin="world", contents=["$origin/**", f"- {VOXELS}"], overrides=way)
    voxels = rrb.Spatial3DView(name="voxels", origin="world", contents=["$origin/**", f"- {MESH}"], overrides=way)
    if not frames:
        return rrb.Blueprint(rrb.Tabs(surface, voxels), rrb.TimePanel(state="hidden"), collapse_panels=True)
    images = rrb.Vertical(
        rrb.Spatial2DView(name="depth", origin=DEPTH), rrb.Spatial2DView(name="colour", origin=COLOUR)
    )
    # There are voxels from the first frame on, and a surface only at the end.
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Tabs(voxels, surface), images, column_shares=[3, 1]),
        rrb.TimePanel(timeline="frame"),
        collapse_panels=True,
    )


def _view_coordinates(up: NDArray[np.float64]) -> rr.ViewCoordinates:
    """Right-handed axes, of which the one nearest to `up` is up."""
    axis = int(np.argmax(np.abs(up)))
    name = f"RIGHT_HAND_{'XYZ'[axis]}_{'UP' if up[axis] > 0 else 'DOWN'}"
    coordinates: rr.ViewCoordinates = getattr(rr.ViewCoordinates, name)
    return coordinates


def _transform(pose: NDArray[np.float64]) -> rr.Transform3D:
    """With the nearest rotation: matrices of data sets are rounded, and the viewer draws no camera that is skewed."""
    w, x, y, z = quaternion_from_matrix(pose, isprecise=False)  # type: ignore[no-untyped-call]
    return rr.Transform3D(translation=pose[:3, 3], quaternion=rr.Quaternion(xyzw=(x, y, z, w)))


def _pinhole(camera: PinholeCamera) -> rr.Pinhole:
    """The camera without its lens distortion, which the viewer does not know."""
    return rr.Pinhole(
        focal_length=[camera.fx, camera.fy],
        principal_point=[camera.cx, camera.cy],
        resolution=[camera.width, camera.height],
        camera_xyz=rr.ViewCoordinates.RDF,
        image_plane_distance=_CAMERA_SIZE,
    )


def _depth_image(depth: NDArray[np.float32]) -> rr.DepthImage:
    """In millimetres, half the size of metres in float32; 0 where there is no reading, or none that 16 bits hold."""
    with np.errstate(invalid="ignore"):
        millimetres = np.round(depth * _MILLIMETRES)
        held = (millimetres > 0) & (millimetres <= np.iinfo(np.uint16).max)
    return rr.DepthImage(np.where(held, millimetres, 0).astype(np.uint16), meter=_MILLIMETRES)

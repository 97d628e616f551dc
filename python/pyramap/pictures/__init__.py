"""Pictures of maps, drawn without a display and without a GPU: the mesh, shaded, and slices of probability."""

from .planes import AXES, Plane, axis_plane, plane_through
from .rendering import FRONT, mesh_image, opaque
from .scale_bar import with_scale_bar
from .slices import Slice, cut, cut_difference, cut_plane, difference_image, layer_plane, slice_image
from .views import (
    ANGLE_DEG,
    SIZE,
    View,
    from_pose,
    looking_along,
    looking_at,
    overview,
    unit,
    up_from_mesh,
    up_from_poses,
)

__all__ = [
    "ANGLE_DEG",
    "AXES",
    "FRONT",
    "SIZE",
    "Plane",
    "Slice",
    "View",
    "axis_plane",
    "cut",
    "cut_difference",
    "cut_plane",
    "difference_image",
    "from_pose",
    "layer_plane",
    "looking_along",
    "looking_at",
    "mesh_image",
    "opaque",
    "overview",
    "plane_through",
    "slice_image",
    "unit",
    "up_from_mesh",
    "up_from_poses",
    "with_scale_bar",
]

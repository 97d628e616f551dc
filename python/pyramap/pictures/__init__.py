"""Pictures of maps, drawn without a display and without a GPU: the mesh, shaded, and slices of probability."""

from .rendering import mesh_image
from .scale_bar import with_scale_bar
from .slices import AXES, Slice, cut, slice_image
from .views import SIZE, View, from_pose, looking_at, overview, up_from_mesh, up_from_poses

__all__ = [
    "AXES",
    "SIZE",
    "Slice",
    "View",
    "cut",
    "from_pose",
    "looking_at",
    "mesh_image",
    "overview",
    "slice_image",
    "up_from_mesh",
    "up_from_poses",
    "with_scale_bar",
]

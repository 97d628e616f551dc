"""What the exports of Apple's depth sensors have in common."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LEAST_CONFIDENCE = 1
"""Of ARKit's three levels: 0 is low, 1 medium, 2 high. The low one marks edges and what hardly reflects."""


def without_low_confidence(depth: NDArray[np.float32], confidence: NDArray[np.uint8] | None) -> NDArray[np.float32]:
    """A (H, W) depth image with no reading (0) where the (H, W) confidence is low; as it is without a confidence."""
    return depth if confidence is None else np.where(confidence >= LEAST_CONFIDENCE, depth, np.float32(0))

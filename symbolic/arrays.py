"""Types of the numbers that everything hands around."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Vector3 = tuple[float, float, float]

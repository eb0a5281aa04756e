"""What is asked of the learned policy: how small its regret is to be beside the linear policy's."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from stationkeep.comparison.merit import Regret


@dataclass(frozen=True)
class Target:
    """What median and maximum of the regret may be at most, as parts of the linear policy's."""

    median: float
    largest: float

    def met(self, found: Regret, linear: Regret) -> tuple[bool, bool]:
        """Return whether median and maximum are small enough; to infinite ones nothing is."""
        return (
            found.median <= self.median * linear.median < math.inf,
            found.max <= self.largest * linear.max < math.inf,
        )


# by the largest scale of the envelope that they hold to
REQUIRED = {0.6: Target(1 / 3, 1 / 2), 1.0: Target(1 / 2, 2 / 3)}
MOONSHOT = {0.6: Target(1 / 8, 1 / 5), 1.0: Target(1 / 5, 1 / 3)}


def target(by_scale: Mapping[float, Target], scale: float) -> Target:
    """Return the target at a scale of the envelope, beyond all of them the last."""
    return by_scale[min((s for s in by_scale if s >= scale), default=max(by_scale))]

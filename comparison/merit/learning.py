"""Whether the learner of a run learned."""

from __future__ import annotations

import numpy as np
import xarray as xr

LEVEL = 1e-3  # of the cost; what the rows may still promise where every step was refused


def learning_fault(record: xr.Dataset) -> str | None:
    """Return why nothing was learned in a run in which learning was due, in one sentence, or None.

    Either the model loses the vehicle under every policy that was predicted, so that no step could be
    certified; or every step was refused although the rows of the costate error promise more than
    `LEVEL`: their sum of squares is the share of the cost that a better policy would save, half of
    the steps seeing more than that.
    """
    if not record.sizes.get("learn_time") or "predicted_cost" not in record:
        return None
    predicted, accepted = record["predicted_cost"].values, record["accepted"].values
    if np.isnan(predicted).all() or accepted.any():
        return None
    n = len(predicted)
    if not np.isfinite(predicted).any():
        return (
            f"nothing was learned: each of the {n} predicted costs was infinite, so no step could be "
            "certified; `stationkeep check` says how good predictions are"
        )
    seen = record["sample_error"].values ** 2
    promised = float(np.median(seen[np.isfinite(seen)])) if np.isfinite(seen).any() else 0.0
    if promised <= LEVEL:
        return None
    return (
        f"nothing was learned: each of the {n} steps was refused, although the rows promise "
        f"{100.0 * promised:.2g} % of the cost"
    )

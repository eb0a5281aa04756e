"""Runs and optima as records that are kept, and run again from what they hold alone."""

from .clairvoyant import KIND, clairvoyant_record, optimum_name
from .provenance import FORMAT, OFFLINE_KEY, model_text, provenance
from .recorded import recorded_scenario
from .replay import BIT_EQUAL, DIFFERENT, Replay, replay
from .running import closed_loop, require_runnable
from .runs import (
    contender_record,
    online_record,
    optimal_record,
    optimum_or_failure,
    optimum_provenance,
    trajectory_of,
)
from .store import kept_key, key_of, reused

__all__ = [
    "BIT_EQUAL",
    "DIFFERENT",
    "FORMAT",
    "KIND",
    "OFFLINE_KEY",
    "Replay",
    "clairvoyant_record",
    "closed_loop",
    "contender_record",
    "kept_key",
    "key_of",
    "model_text",
    "online_record",
    "optimal_record",
    "optimum_name",
    "optimum_or_failure",
    "optimum_provenance",
    "provenance",
    "recorded_scenario",
    "replay",
    "require_runnable",
    "reused",
    "trajectory_of",
]

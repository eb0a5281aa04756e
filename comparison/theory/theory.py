"""A learning run beside the paper's theorem: what was watched, V_L, and K against the observed |Z|.

χ is stated: the envelope, in which the samples are drawn and ideal weights are fitted. Whether the
run stayed in it is checked afterwards: Remark 3's own χ depends on K, and K on suprema over χ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from ...offline.ideal_weights import basis_at
from ...online.loop import fixed_points
from ...symbolic import InputError
from ...symbolic.arrays import Array
from ..optima import Ideal
from ..scenario import Scenario
from .conditions import drift_bound
from .uub import (
    Constants,
    Gains,
    Knowledge,
    Suprema,
    admissible_gains,
    constants,
    distance,
    lyapunov,
    measure,
)

ULTIMATE = 0.1  # the last part of a run, over which |Z| is its ultimate size


@dataclass(frozen=True)
class Theory:
    """The theorem's quantities along a run whose ideal weights are known.

    Attributes
    ----------
    time : (T,) of the learning steps [s]
    value : (T,) V as W'σ(ζ)
    errors : (T, 3) |W̃_c|, |W̃_a1| and |W̃_a2|
    lyapunov, size : (T,) V_L, in the paper's form, and |Z|
    ball : the least bound of |W̃_a| that the projection guarantees
    weights_norm, bound : |W| and θ_0 of the projection
    suprema : over χ
    c_lower : infimum of (18)'s λ_min over the run
    gains, found : the run's gains, and the theorem's constants for them
    admissible, slow : gains that (24) and (25) admit and the constants for them; None if there are none
    """

    time: Array
    value: Array
    errors: Array
    lyapunov: Array
    size: Array
    ball: float
    weights_norm: float
    bound: float
    suprema: Suprema
    c_lower: float
    gains: Gains
    found: Constants
    admissible: Gains | None
    slow: Constants | None

    @property
    def ultimate(self) -> float:
        """Largest |Z| over the last tenth of the run."""
        late = self.time >= self.time[-1] - ULTIMATE * (self.time[-1] - self.time[0])
        return float(self.size[late].max())


def require_run(record: xr.Dataset, name: str) -> None:
    """Raise InputError unless the record is one of a run that learned under a monitor."""
    if not (record.sizes.get("look_time") and record.sizes.get("learn_time")):
        raise InputError(f"'{name}' holds no run that learned; make one with 'stationkeep online'")


def along(record: xr.Dataset) -> Array:
    """Return ζ at the learning steps, shape (T, n)."""
    index = np.searchsorted(record["time"].values, record["learn_time"].values - 1e-9)
    return np.asarray(record["zeta"].values[np.minimum(index, record.sizes["time"] - 1)])


def theory(scenario: Scenario, record: xr.Dataset, ideal: Ideal) -> Theory:
    """Return the theorem's quantities along a run of the scenario."""
    setup, learner = scenario.station_keeping(), scenario.learner
    zeta, W = along(record), ideal.weights
    errors = (
        W - record["critic"].values,
        W - record["actor_1"].values,
        W - record["actor_2"].values,
    )
    value = basis_at(setup.basis, zeta)[0] @ W
    pairs = ideal.pairs
    known = Knowledge(W, pairs.states, pairs.values, pairs.gradients)
    drift = drift_bound(setup, max(scenario.samples.number, 500))
    suprema = measure(setup.functions, known, fixed_points(scenario.samples, setup), drift)
    bound = learner.weight_bound * float(np.linalg.norm(setup.riccati_weights))
    ball = float(np.linalg.norm(W)) + 1.1 * bound
    gains = Gains(learner.gain_critic, learner.gain_actor_1, learner.gain_actor_2)
    c_lower = float(record["rank_margin"].min())
    admissible = admissible_gains(suprema, c_lower) if c_lower > 0.0 else None
    return Theory(
        time=record["learn_time"].values,
        value=value,
        errors=np.stack([np.linalg.norm(error, axis=1) for error in errors], axis=1),
        lyapunov=lyapunov(value, errors),
        size=distance(zeta, errors),
        ball=ball,
        weights_norm=float(np.linalg.norm(W)),
        bound=bound,
        suprema=suprema,
        c_lower=c_lower,
        gains=gains,
        found=constants(suprema, gains, c_lower, ball),
        admissible=admissible,
        slow=constants(suprema, admissible, c_lower, ball) if admissible else None,
    )

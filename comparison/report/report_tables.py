"""The outcome of a comparison in words and in tables, for the report and for the terminal."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from ..policies import CONTENDERS
from ..study import Comparison

Table = tuple[list[str], list[list[str]]]
REGRET_OF_A_RUN = (
    "(cost - V_c) / V_c over the time of the run, nothing added for what is left then; V_c is the "
    "clairvoyant optimum's cost"
)
CLAIRVOYANT_CHECK = {
    "value_error": "relative error of the value: mesh and re-integration, summed",
    "mesh_error": "relative change of the value by one degree of the polynomials",
    "reintegration_error": "relative gap of the cost when the plant of the runs is integrated",
    "final_defect": "gap of the state then at the end, in half-widths",
    "largest_defect": "the same at any mesh point",
    "start_spread": "relative spread of the local minima that the starts led to; 0 where all agree",
}


def verdict(comparison: Comparison) -> str:
    """Return the outcome in one sentence."""
    if comparison.disturbed or comparison.regret is None:
        return _disturbed_verdict(comparison)
    learned, linear = (comparison.regret[name].median for name in ("learned", "linear"))
    if not (math.isfinite(learned) and math.isfinite(linear)):
        return "A run ended early, so there is no regret to compare."
    change = 100 * (learned - linear) / linear
    outcome = f"takes {-change:.0f} % off" if change < 0 else f"adds {change:.0f} % to"
    states = "" if comparison.n_states == 1 else f" (median of {comparison.n_states} states)"
    return (
        f"The learned policy costs {100 * learned:.3f} % more than the optimum{states}; the linear "
        f"H-infinity policy, which learns nothing, {100 * linear:.2f} %: learning {outcome} the excess."
    )


def _disturbed_verdict(comparison: Comparison) -> str:
    """Return the outcome against the clairvoyant optimum, or without one between the policies."""
    learned, linear = (comparison.metrics[name] for name in ("learned", "linear"))
    if comparison.regret is None:
        sentence = "There is no clairvoyant optimum to compare with, and so no regret"
        costs = (learned.running_cost, linear.running_cost)
    else:
        sentence = "The clairvoyant optimum knows the whole disturbance beforehand"
        costs = (learned.regret, linear.regret)
    if costs[0] is None or costs[1] is None:
        return f"{sentence}. A run of the two policies ended early, so there are no costs to compare."
    if comparison.regret is None:
        share = 100.0 * (costs[0] - costs[1]) / costs[1]
        words = f"{-share:.1f} % less" if share < 0.0 else f"{share:.1f} % more"
        return f"{sentence}. The learned policy costs {words} than the linear H-infinity policy."
    return (
        f"{sentence}: over the same run the learned policy costs {100 * costs[0]:.2f} % more than it, "
        f"the linear H-infinity policy {100 * costs[1]:.2f} %."
    )


def too_short(comparison: Comparison) -> str:
    """Return a warning that some runs end while their cost still grows."""
    return (
        f"The runs are too short for a regret of {', '.join(comparison.too_short)}: more than 0.1 % of "
        "the cost is the estimate ζ'P ζ for the rest; raise simulation.duration."
    )


def summary(comparison: Comparison) -> Table:
    """Return header and rows of the summary: one row a policy, from the scenario's own state.

    Beside its regret the median and the largest from all states; rms of the distance from the station;
    energy of the thrusters; the largest share of a thruster's limit; the mean time of a control step.
    In `disturbed` mode the cost is that of the time of the run, and there is the dissipation margin.
    """
    ended = {name: _ended(comparison, name) for name in comparison.metrics}
    header = ["policy", *_judgement_header(comparison)]
    header += ["rms [m]", "energy [J]", "peak thrust [%]", "step [μs]"]
    header += ["ended early"] if any(ended.values()) else []
    rows = []
    for name, metrics in comparison.metrics.items():
        row = [
            CONTENDERS[name].label,
            *_judgement(comparison, name),
            _number(metrics.position_rms, ".3f"),
            _number(metrics.energy, ".0f"),
            _number(metrics.peak_thrust, ".0f", 100.0),
            _number(metrics.policy_mean, ".0f"),
            *([ended[name] or "no"] if any(ended.values()) else []),
        ]
        rows.append(row)
    if comparison.regret is not None:
        value = f"{comparison.reference.attrs['value']:.3f}"
        label = "clairvoyant optimum" if comparison.disturbed else "offline optimum"
        rows.append([label, value, "0.000", *[""] * (len(header) - 3)])
    return header, rows


def _judgement_header(comparison: Comparison) -> list[str]:
    header = ["cost"]
    if comparison.regret is not None:
        header += ["regret [%]"]
        header += ["median [%]", "worst [%]"] if comparison.n_states > 1 else []
    return header + (["dissipation margin"] if comparison.disturbed else [])


def _judgement(comparison: Comparison, name: str) -> list[str]:
    """Return cost, regret and margin of a policy, as the header has them."""
    metrics, regret = comparison.metrics[name], comparison.regret
    row = [_number(metrics.running_cost if comparison.disturbed else metrics.cost, ".3f")]
    if regret is not None:
        row.append(_number(metrics.regret, ".3f", 100.0))
        alone = len(comparison.all_metrics[name]) == 1
        row += [
            "–" if alone else _number(value, ".3f", 100.0) if math.isfinite(value) else "∞"
            for value in ((regret[name].median, regret[name].max) if comparison.n_states > 1 else ())
        ]
    if comparison.disturbed:
        row.append(_number(comparison.margins.get(name), ".3g"))
    return row


def _ended(comparison: Comparison, name: str) -> str:
    runs = comparison.all_metrics[name]
    stopped = [run.stopped for run in runs if run.stopped]
    if not stopped:
        return ""
    return str(stopped[0]) if len(runs) == 1 else f"{len(stopped)} of {len(runs)}: {stopped[0]}"


def certificate(comparison: Comparison) -> Table:
    """Return header and rows of the optimum's certificate."""
    attributes = comparison.optimal.attrs
    meanings = {
        "value_error": "relative error of the value: mesh, re-integration, horizon and saddle point",
        "defect": "gap of the re-integrated trajectory, in half-widths",
        "hji_residual": "residual of the HJI (7), relative to the state cost",
        "costate_error": "costate against a finite difference of the value, relative",
        "horizon_error": "relative change of the value when the horizon doubles",
    }
    rows = [[key, f"{attributes[key]:.1e}", meaning] for key, meaning in meanings.items()]
    if comparison.n_states > 1:
        errors = [optimum.value_error for optimum in comparison.optima if optimum.value is not None]
        largest = f"{np.max(errors):.1e}"
        rows.append(["largest value_error", largest, f"over all {comparison.n_states} states"])
    return ["certificate", "value", "meaning"], rows


def clairvoyant_check(record: xr.Dataset) -> Table:
    """Return header and rows of what the record of a clairvoyant optimum was checked by."""
    attributes = record.attrs
    rows = [[key, f"{attributes[key]:.1e}", meaning] for key, meaning in CLAIRVOYANT_CHECK.items()]
    return ["check", "value", "meaning"], rows


def conditions(comparison: Comparison) -> Table:
    """Return header and rows of the paper's conditions."""
    words = {True: "yes", False: "no", None: "not known"}
    rows = [
        [c.name, c.paper, _number(c.value, ".4g"), _number(c.bound, ".4g"), words[c.holds], c.note]
        for c in comparison.conditions
    ]
    return ["condition", "paper", "value", "bound", "holds", "note"], rows


def _number(value: float | None, form: str, factor: float = 1.0) -> str:
    return "–" if value is None else f"{factor * value:{form}}"

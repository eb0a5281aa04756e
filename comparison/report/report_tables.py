"""The outcome of a comparison in words and in tables, for the report and for the terminal."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from ...symbolic import StationKeeping
from ..policies import label_of
from ..study import Comparison

Table = tuple[list[str], list[list[str]]]
CLAIRVOYANT_CHECK = {
    "value_error": "relative error of the value: mesh and re-integration, summed",
    "mesh_error": "relative change of the value by one degree of the polynomials",
    "reintegration_error": "relative gap of the cost when the plant of the runs is integrated",
    "final_defect": "gap of the state then at the end, in half-widths",
    "largest_defect": "the same at any mesh point",
    "start_spread": "relative spread of the local minima that the starts led to; 0 where all agree",
}


def too_short(comparison: Comparison) -> str:
    """Return a warning that some runs end while their cost still grows."""
    return (
        f"The runs are too short for a regret of {', '.join(comparison.too_short)}: more than 0.1 % of "
        "the cost is V* of the state at their end, as if all went on optimally; raise "
        "simulation.duration."
    )


def summary(comparison: Comparison) -> Table:
    """Return header and rows of the summary: one row a policy, from the scenario's own state.

    Cost, and beside its regret the median and the largest from all states; in a real disturbance the
    cost is that of the time of the run, and there is the dissipation margin; for a vehicle the rms of
    the distance from the station, energy of the thrusters and the largest share of a thruster's limit,
    for another problem the rms of the scaled state; the mean time of a control step.
    """
    ended = {name: _ended(comparison, name) for name in comparison.metrics}
    vehicle = isinstance(comparison.setup, StationKeeping)
    sizes = _vehicle_sizes if vehicle else _scaled_size
    header = ["policy", *_judgement_header(comparison)]
    header += [*(VEHICLE_SIZES if vehicle else SCALED_SIZE), "step [μs]"]
    header += ["ended early"] if any(ended.values()) else []
    rows = [
        [
            label_of(name),
            *_judgement(comparison, name),
            *sizes(comparison, name),
            _number(metrics.policy_mean, ".0f"),
            *([ended[name] or "no"] if any(ended.values()) else []),
        ]
        for name, metrics in comparison.metrics.items()
    ]
    if comparison.reference.known:
        value = f"{comparison.shown.attrs['value']:.3f}"
        rows.append([comparison.reference.label, value, "0.000", *[""] * (len(header) - 3)])
    return header, rows


VEHICLE_SIZES = ("rms [m]", "energy [J]", "peak thrust [%]")
SCALED_SIZE = ("rms |x| [-]",)


def _vehicle_sizes(comparison: Comparison, name: str) -> list[str]:
    run = comparison.metrics[name]
    return [
        _number(run.position_rms, ".3f"),
        _number(run.energy, ".0f"),
        _number(run.peak_thrust, ".0f", 100.0),
    ]


def _scaled_size(comparison: Comparison, name: str) -> list[str]:
    return [f"{comparison.scaled_rms[name]:.3g}"]


def _judgement_header(comparison: Comparison) -> list[str]:
    header = ["cost"]
    if comparison.reference.known:
        header += ["regret [%]"]
        header += ["median [%]", "worst [%]"] if comparison.n_states > 1 else []
    return header + (["dissipation margin"] if comparison.margins else [])


def _judgement(comparison: Comparison, name: str) -> list[str]:
    """Return cost, regret and margin of a policy, as the header has them."""
    metrics, regret = comparison.metrics[name], comparison.regret
    row = [_number(comparison.reference.cost(metrics), ".3f")]
    if regret is not None:
        row.append(_number(metrics.regret, ".3f", 100.0))
        alone = len(comparison.all_metrics[name]) == 1
        row += [
            "–" if alone else _number(size, ".3f", 100.0)
            for size in ((regret[name].median, regret[name].max) if comparison.n_states > 1 else ())
        ]
    if comparison.margins:
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
    """Return a number in words: a dash where it is not known, ∞ for what failed."""
    if value is None:
        return "–"
    return f"{factor * value:{form}}" if math.isfinite(value) else "∞"

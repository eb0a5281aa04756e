"""What the paper asks of a run, with what it was: the rows that `check --run` adds."""

from __future__ import annotations

import numpy as np
import xarray as xr

from ..scenario import Scenario
from .condition import Condition
from .theory import Theory
from .uub import Constants


def run_conditions(
    scenario: Scenario, record: xr.Dataset, found: Theory | None = None
) -> list[Condition]:
    """Return what the paper asks of a run, with what it was; the theorem's part needs ideal weights."""
    watched = [*_regressors(record), *_weights(record), _stayed(scenario, record)]
    # without samples there are no regressors
    watched = [row for row in watched if row.value is not None and np.isfinite(row.value)]
    return watched if found is None else [*watched, *_theorem(scenario, record, found)]


def _regressors(record: xr.Dataset) -> list[Condition]:
    margin, rank = record["rank_margin"].values, record["row_rank"].values
    least = int(margin.argmin())
    when = float(record["look_time"].values[least])
    regressor = float(record["regressor"].max())
    normalized = float(record["regressor_normalized"].max())
    return [
        Condition(
            "c_lower > 0 along the run",
            "(18), after Assumption 4",
            float(margin[least]),
            0.0,
            bool(margin[least] > 0.0),
            f"least of {len(margin)} looks, at {when:g} s; λ_max at most "
            f"{float(record['rank_bound'].max()):.3g}; the critic's own rows decide "
            f"{int(rank.min())} to {int(rank.max())} of {record.sizes['basis']} directions",
        ),
        Condition(
            "|ω / p| <= 1 along the run",
            "before the theorem",
            normalized,
            1.0,
            normalized <= 1.0,
            f"at the fixed samples; |ω| itself reaches {regressor:.4g} 1/s",
        ),
    ]


def _weights(record: xr.Dataset) -> list[Condition]:
    norms, acting = record["actor_norm"].values, record["projecting"].values
    rms = record["fixed_error_rms"].values
    return [
        Condition(
            "|Ŵ_a| stays in the projection's ball",
            "(20)(21)",
            float(norms.max()),
            1.1,
            bool(norms.max() <= 1.1 * (1.0 + 1e-9)),
            f"largest part of θ_0: control {norms[:, 0].max():.3g}, disturbance "
            f"{norms[:, 1].max():.3g}; "
            f"the projection acts above 1: at {int(acting.sum())} of {len(acting)} learning steps",
        ),
        Condition(
            "the Bellman error at the samples falls",
            "(17)",
            float(rms[-1]),
            float(rms[0]),
            bool(rms[-1] < rms[0]),
            "rms of δ_j / ζ_j'Qζ_j at the fixed samples, at the end and at the start; critic and "
            f"actors end {100 * float(record['actor_distance'].values[-1].max()):.2g} % apart",
        ),
    ]


def _stayed(scenario: Scenario, record: xr.Dataset) -> Condition:
    envelope = scenario.station_keeping().envelope
    share = np.abs(record["zeta"].values) / envelope
    far, outside = float(share.max()), float(np.mean(share.max(axis=1) > 1.0))
    name = str(record["state"].values[int(share.max(axis=0).argmax())])
    return Condition(
        "the run stays in χ",
        "Remark 3",
        far,
        1.0,
        far <= 1.0,
        f"largest |ζ_i| over its half-width of the envelope ({name}), in which samples, ε' and suprema "
        f"are taken; outside for {100 * outside:.2g} % of the run",
    )


def _theorem(scenario: Scenario, record: xr.Dataset, found: Theory) -> list[Condition]:
    law = "" if scenario.learner.rule == "gradient" else "; the proof is for the gradient law"
    if scenario.simulation.mode == "disturbed":
        law += "; it drives the plant with û_1 + û_2, this run met another disturbance"
    return [
        Condition(
            "W lies in the projection's ball",
            "Assumption 3",
            found.weights_norm,
            found.bound,
            found.weights_norm <= found.bound,
            "|W| and θ_0, a multiple of the norm of the Riccati weights",
        ),
        _alpha(found),
        _ball("ultimate |Z| <= α_3^-1(α_4(K))", found, found.found, "at the gains of the run"),
        _slow_ball(found),
        _closed(scenario, found),
        *_convergence(found, law),
    ]


def _alpha(found: Theory) -> Condition:
    c, s = found.found, found.suprema
    return Condition(
        "α_5 > 0",
        "(31)",
        c.alpha_5,
        0.0,
        c.alpha_5 > 0.0,
        f"φ_ζ = {c.phi_zeta:.3g}, φ_c = {c.phi_c:.3g}, φ_a1 = {c.phi_a1:.3g}, φ_a2 = {c.phi_a2:.3g}; "
        f"κ_c = {c.kappa_c:.3g}, κ_a1 = {s.kappa_a1:.3g}, κ_a2 = {s.kappa_a2:.3g}, κ = {s.kappa:.3g}",
    )


def _ball(name: str, found: Theory, c: Constants, where: str) -> Condition:
    """Compare the ultimate |Z| with the theorem's bound, K of (31) corrected."""
    if not c.alpha_5 > 0.0:
        note = f"{where} there is no K, since α_5 <= 0"
        return Condition(name, "(31), K corrected", found.ultimate, None, None, note)
    bound = c.radius * found.suprema.class_k
    total = sum(c.parts.values())
    worst = max(c.parts, key=lambda part: c.parts[part])
    return Condition(
        name,
        "(31), K corrected",
        found.ultimate,
        bound,
        found.ultimate <= bound,
        f"{where} K = {c.radius:.3g} (printed {c.radius_printed:.3g}), "
        f"{100 * c.parts[worst] / total:.3g} % of K^2 from {worst}; sqrt(α_4/α_3) = "
        f"{found.suprema.class_k:.3g}; {bound / found.ultimate:.2g} times what was observed",
    )


def _slow_ball(found: Theory) -> Condition:
    name = "the same at gains that (24) and (25) admit"
    if found.admissible is None or found.slow is None:
        note = "no gains are admitted, since (18) lost its rank"
        return Condition(name, "(31), K corrected", found.ultimate, None, None, note)
    rate = found.admissible.critic * found.c_lower
    where = (
        f"with η_c = {found.admissible.critic:.2g}, η_a = {found.admissible.actor_1:.2g} 1/s, whose "
        f"slowest time constant is {1.0 / (rate * 3.156e7):.2g} years,"
    )
    return _ball(name, found, found.slow, where)


def _closed(scenario: Scenario, found: Theory) -> Condition:
    """Remark 3's own χ, a ball in ζ, against the one that the suprema were taken over."""
    inside = float(scenario.station_keeping().envelope.min())
    c = found.found if found.found.alpha_5 > 0.0 else found.slow
    radius = float("inf") if c is None else c.radius
    reach = found.suprema.class_k * max(float(found.size[0]), radius)
    known = bool(np.isfinite(reach))
    return Condition(
        "Remark 3's χ lies in the one stated",
        "Remark 3",
        reach if known else None,
        inside,
        reach <= inside if known else None,
        "radius α_3^-1(α_4(max(|Z(0)|, K))) against the least half-width of the envelope; where it "
        "fails the theorem does not close: that the run stayed in χ was observed, not proven",
    )


def _convergence(found: Theory, law: str) -> list[Condition]:
    V_L, error = found.lyapunov, found.errors[:, 0]
    rise = float(np.diff(V_L).max(initial=0.0)) / float(V_L[0])
    return [
        Condition(
            "V_L never rises",
            "(27)(29)",
            rise,
            0.0,
            rise <= 1e-9,
            f"largest rise between two learning steps over V_L(0) = {V_L[0]:.4g}; at the end "
            f"{V_L[-1]:.4g}, of which V has {found.value[-1]:.2g}{law}",
        ),
        Condition(
            "the weights approach W",
            "theorem",
            float(error[-1]),
            float(error[0]),
            bool(error[-1] < error[0]),
            f"|W̃_c| at the end and at the start; |W| = {found.weights_norm:.4g}",
        ),
    ]

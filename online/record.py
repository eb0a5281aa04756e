"""The record of a run: named dimensions, units on every variable, provenance in the attributes."""

from __future__ import annotations

import contextlib
import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..symbolic import InputError
from ..symbolic.vehicle import Array
from .closed_loop import STATE_NAMES, History

FORCE_NAMES = ("X", "Y", "Z", "K", "M", "N")
_STATE_UNITS = "m, rad, m/s, rad/s"
_FORCE_UNITS = "N, N m"


def to_dataset(history: History, provenance: dict[str, Any]) -> xr.Dataset:
    """Return the record of a run.

    Dimensions: `time` (control steps), `learn_time` (learning steps, each with the weights before it,
    and the end of the run), `state`, `force`, `basis`.
    """
    m = len(history.critic[0]) if history.critic else 0
    over_time, over_learning = ("time",), ("learn_time",)
    weights = ("learn_time", "basis")

    def stack(rows: list[Array], width: int) -> Array:
        return np.array(rows).reshape(len(rows), width)

    variables = {
        "zeta": ((*over_time, "state"), stack(history.zeta, 12), _STATE_UNITS),
        "tau_b": ((*over_time, "force"), stack(history.tau_b, 6), _FORCE_UNITS),
        "u_control": ((*over_time, "force"), stack(history.u_control, 6), _FORCE_UNITS),
        "u_disturbance": ((*over_time, "force"), stack(history.disturbance, 6), _FORCE_UNITS),
        "cost": (over_time, np.array(history.cost), "cost"),
        "attenuated": (over_time, np.array(history.attenuated), "cost"),
        "bellman_error": (over_learning, np.array(history.bellman_error), "cost/s"),
        "sample_error": (over_learning, np.array(history.sample_error), "1"),
        "rank_margin": (over_learning, np.array(history.rank_margin), "1"),
        "projecting": (over_learning, np.array(history.projecting, dtype=np.int8), "1"),
        "critic": (weights, stack(history.critic, m), "cost"),
        "actor_1": (weights, stack(history.actor_1, m), "cost"),
        "actor_2": (weights, stack(history.actor_2, m), "cost"),
    }
    coordinates = {
        "time": ("time", np.array(history.time), {"units": "s"}),
        "learn_time": ("learn_time", np.array(history.learn_time), {"units": "s"}),
        "state": list(STATE_NAMES),
        "force": list(FORCE_NAMES),
    }
    data = {name: (dims, values, {"units": unit}) for name, (dims, values, unit) in variables.items()}
    attributes = {**provenance, **versions(), "stopped": history.stopped or ""}
    return xr.Dataset(data, coordinates, attributes)


def versions() -> dict[str, str]:
    """Return the versions that numbers depend on."""
    packages = ("stationkeep", "casadi", "numpy", "scipy")
    return {f"{package}_version": version(package) for package in packages}


def save(dataset: xr.Dataset, path: Path) -> Path:
    """Write a record as netCDF under a temporary name, then rename it.

    Raises
    ------
    InputError
        If the folder can't be written.
    """
    with written_whole(path) as temporary:
        dataset.to_netcdf(temporary, engine="h5netcdf")
    return path


def load(path: Path) -> xr.Dataset:
    """Read a record into memory.

    Raises
    ------
    InputError
        If the file is missing, unreadable, truncated or not a record.
    """
    if not path.is_file():
        raise InputError(f"there is no record '{path}'; give the path of a netCDF file of a run")
    try:
        with xr.open_dataset(path, engine="h5netcdf") as dataset:
            return dataset.load()
    except (OSError, ValueError, KeyError) as error:
        fault = str(error).partition("\n")[0]
        raise InputError(
            f"'{path}' can't be read as a record ({fault}); it may be truncated, run again"
        ) from None


def load_weights(path: Path) -> Array:
    """Return the last critic weights of a record, shape (m,).

    Raises
    ------
    InputError
        If the file is not a record of a learner.
    """
    dataset = load(path)
    if "critic" not in dataset or dataset.sizes.get("learn_time", 0) == 0:
        raise InputError(f"'{path}' holds no learned weights; give the record of an online run")
    return np.asarray(dataset["critic"].values[-1], dtype=np.float64)


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`, and rename it to `path` when the block succeeds.

    Raises
    ------
    InputError
        If the folder can't be made or written (unwritable, full).
    """
    temporary = path.with_name(f".{path.name}-{os.getpid()}-{uuid.uuid4().hex[:8]}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        temporary.replace(path)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            f"'{path}' can't be written ({reason}); choose another folder with --out"
        ) from None
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> Path:
    """Write a text file under a temporary name, then rename it; raises as `written_whole`."""
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path

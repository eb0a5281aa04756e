"""TOML files in, validated settings out; every fault becomes one sentence."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from .errors import InputError, nearest


class Settings(BaseModel):
    """A group of settings: immutable, finite numbers only, unknown keys refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


S = TypeVar("S", bound=BaseModel)


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises
    ------
    InputError
        If the file is missing, unreadable, not UTF-8 or not valid TOML (for instance truncated).
    """
    try:
        with path.open("rb") as file:
            return tomllib.load(file)
    except FileNotFoundError:
        raise InputError(f"there is no file '{path}'; give the path of a TOML file") from None
    except OSError as error:
        raise InputError(f"'{path}' can't be read ({error.strerror}); check the path") from None
    except UnicodeDecodeError:
        raise InputError(f"'{path}' is not UTF-8 text; give a TOML file") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"'{path}' is not valid TOML ({error}); correct or restore it") from None


def shipped_names(package: str, folder: str) -> list[str]:
    """Return the names of the TOML files shipped in `folder` of `package`."""
    files = resources.files(package).joinpath(folder).iterdir()
    return sorted(file.name.removesuffix(".toml") for file in files if file.name.endswith(".toml"))


def locate(name: str | Path, package: str, folder: str, kind: str) -> Path:
    """Return the path of a shipped file by its name, or of a user's file by its path.

    Raises
    ------
    InputError
        If `name` is neither shipped nor the path of a file; the nearest shipped name is given.
    """
    text = str(name)
    if isinstance(name, Path) or text.endswith(".toml") or "/" in text:
        return Path(name).expanduser()
    shipped = shipped_names(package, folder)
    if text in shipped:
        return Path(str(resources.files(package).joinpath(folder, f"{text}.toml")))
    raise InputError(
        f"there is no {kind} '{text}': {nearest(text, shipped)} (or give the path of a .toml file)"
    )


def validate(model: type[S], data: dict[str, Any], where: str) -> S:
    """Validate `data` against `model`.

    Raises
    ------
    InputError
        One sentence about the first fault: the key, what was given, what is required.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise InputError(f"{where}: {_sentence(model, error)}") from None


def _sentence(model: type[BaseModel], error: ValidationError) -> str:
    fault = error.errors()[0]
    location = fault["loc"]
    key = ".".join(str(part) for part in location)
    given = fault.get("input")
    if fault["type"] == "extra_forbidden":
        known = _fields_at(model, location[:-1])
        return f"unknown key '{key}'; {nearest(str(location[-1]), known)}"
    if fault["type"] == "missing":
        return f"the key '{key}' is required and missing; add it"
    if fault["type"] == "value_error":
        message = str(fault["ctx"]["error"])
        return f"'{key}': {message}" if key else message
    text = repr(given)
    shown = text if len(text) <= 60 else text[:57] + "..."
    requirement = str(fault["msg"]).replace("Input should be", "it must be")
    return f"'{key}' is {shown}, but {requirement}; correct it"


def _fields_at(model: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    """Return the field names of the settings group found at `location` inside `model`."""
    for part in location:
        annotation = model.model_fields[str(part)].annotation
        candidates = [annotation, *getattr(annotation, "__args__", ())]
        groups = [c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel)]
        if not groups:
            return []
        model = groups[0]
    return list(model.model_fields)

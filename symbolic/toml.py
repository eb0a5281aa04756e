"""TOML files in, validated settings out; every fault becomes one sentence."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, field_validator
from pydantic_core import PydanticKnownError

from .errors import InputError, nearest


class Settings(BaseModel):
    """A group of settings: immutable, finite numbers only, unknown keys refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _no_words_for_numbers(cls, value: Any, info: ValidationInfo) -> Any:
        """Refuse texts and truth values for numbers, and numbers for these: pydantic would convert."""
        annotation = cls.model_fields[str(info.field_name)].annotation
        kinds = _kinds(annotation)
        numbers = kinds & {int, float} if _fits(annotation, value) else set()
        if numbers and any(kind not in kinds and _holds(value, kind) for kind in (str, bool)):
            if numbers == {int}:
                raise PydanticKnownError("int_type")
            raise PydanticKnownError("float_type")
        if bool in kinds and not numbers and type(value) in (int, float):
            raise PydanticKnownError("bool_type")
        return value


S = TypeVar("S", bound=BaseModel)
LARGEST = 1 << 24  # bytes of a text file
Seed = Annotated[int, Field(ge=0, lt=2**63)]  # as a record can hold it


def _kinds(annotation: Any) -> set[Any]:
    """Return the types at the leaves of an annotation; those of the words of a `Literal`."""
    parts = get_args(annotation)
    if not parts:
        return {annotation if isinstance(annotation, type) else type(annotation)}
    return set().union(*(_kinds(part) for part in parts))


def _fits(annotation: Any, value: Any) -> bool:
    """Whether a number may stand alone where a single value is given; an array is looked into."""
    if isinstance(value, (list, tuple)) or annotation in (int, float):
        return True
    if isinstance(annotation, type) or get_origin(annotation) in (tuple, list, dict):
        return False
    return any(_fits(part, value) for part in get_args(annotation) if part is not type(None))


def _holds(value: Any, kind: type) -> bool:
    """Whether a value is of a type, or an array with an entry of it."""
    if isinstance(value, (list, tuple)):
        return any(_holds(entry, kind) for entry in value)
    return isinstance(value, kind)


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises
    ------
    InputError
        If the file is missing, unreadable, not UTF-8 or not valid TOML (for instance truncated).
    """
    try:
        return tomllib.loads(read_text(path, "a TOML file"))
    except RecursionError:
        raise InputError(f"'{path}' nests its values too deeply; it is no settings file") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"'{path}' is not valid TOML ({error}); correct or restore it") from None


def read_text(path: Path, what: str) -> str:
    """Return the text of a user's file; a byte order mark, as Windows writes it, is no part of it.

    Parameters
    ----------
    what : the file is to be, for messages

    Raises
    ------
    InputError
        If the file is missing, no file of this kind, unreadable, too large or not UTF-8.
    """
    if "\0" in str(path):
        raise InputError(f"{str(path)!r} is no path of a file; give the path of {what}")
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            raise InputError(f"'{path}' is a pipe or a device; give the path of {what}")
        with path.open("rb") as file:
            content = file.read(LARGEST + 1)
        if len(content) > LARGEST:
            raise InputError(f"'{path}' is larger than {LARGEST >> 20} MiB; give the path of {what}")
        return content.decode("utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"there is no file '{path}'; give the path of {what}") from None
    except OSError as error:
        raise InputError(f"'{path}' can't be read ({error.strerror}); check the path") from None
    except UnicodeDecodeError:
        raise InputError(f"'{path}' is not UTF-8 text; give {what}") from None


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
    # the fault that explains the others: a misspelt key before the missing one, a NaN before the shape
    order = {"extra_forbidden": 0, "finite_number": 1}
    fault = min(error.errors(), key=lambda found: order.get(found["type"], 2))
    location = tuple(part for part in fault["loc"] if "[" not in str(part))  # without union labels
    if (
        fault["type"] in ("missing", "too_long")
        and fault["loc"]
        and not isinstance(fault["input"], dict)
    ):
        key = ".".join(part for part in location if isinstance(part, str))
        return f"'{key}' is {_shown(fault['input'])}, but has the wrong number of entries; correct it"
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
    kinds = {"list_type": "an array", "tuple_type": "an array", "model_type": "a table"}
    kinds |= {"float_type": "a number", "float_parsing": "a number"}
    kinds |= {"int_type": "an integer", "int_parsing": "an integer", "int_from_float": "an integer"}
    kinds |= {"bool_type": "true or false", "bool_parsing": "true or false"}
    requirement = str(fault["msg"]).replace("Input should be", "it must be")
    if fault["type"] in ("too_short", "too_long"):
        context = fault["ctx"]
        n = context.get("min_length", context.get("max_length"))
        requirement = f"it must have {n} entries, not {context['actual_length']}"
    if fault["type"] in kinds:
        requirement = f"it must be {kinds[fault['type']]}"
    return f"'{key}' is {_shown(given)}, but {requirement}; correct it"


def _shown(given: object) -> str:
    text = repr(given)
    return text if len(text) <= 60 else text[:57] + "..."


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

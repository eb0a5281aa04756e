"""Keys of settings, `section.key` or `section.key[i]`, and the values they are given."""

from __future__ import annotations

import re
import tomllib
from typing import Any

from ...symbolic import InputError

_KEY = re.compile(r"([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)((?:\[\d+\])*)")


def override(data: dict[str, Any], text: str) -> None:
    """Put "section.key=value", as `--set` takes it, into the data of a scenario; raises InputError."""
    key, separator, value = text.partition("=")
    where = f"--set {text if text.isprintable() else repr(text)}"
    if not separator or not key.strip():
        raise InputError(f"{where}: write section.key=value, for instance game.gamma=3")
    replace_value(data, key.strip(), parse_value(value), where)


def parse_value(text: str) -> Any:
    """Return a value written as in TOML; what is not TOML is a string. Raises InputError for two."""
    found = _toml(f"value = {text}", text)
    return text.strip() if found is None else found["value"]


def _toml(line: str, text: str) -> dict[str, Any] | None:
    """Return what a line of TOML with one key holds, None if it is not TOML.

    Raises
    ------
    InputError
        If it holds other keys too, or nests its values too deeply.
    """
    try:
        found = tomllib.loads(line)
    except tomllib.TOMLDecodeError:
        return None
    except RecursionError:
        raise InputError(
            f"the value {text[:40]}... nests too deeply; write a number or an array"
        ) from None
    if len(found) > 1:
        raise InputError(f"{text!r} sets more than one key; give each a --set of its own")
    return found


def parse_values(text: str) -> list[Any]:
    """Return values with commas between, each as `parse_value` reads it."""
    found = _toml(f"values = [{text}]", text)
    return [parse_value(part) for part in text.split(",")] if found is None else list(found["values"])


def replace_value(data: dict[str, Any], key: str, value: Any, where: str) -> None:
    """Replace the value at `key` in nested tables; `where` begins a message.

    Raises
    ------
    InputError
        If it goes through a value that is no table, or to an entry that an array doesn't have.
    """
    match = _KEY.fullmatch(key)
    if match is None:
        raise InputError(f"{where}: '{key}' is no key; write section.key or section.key[i]")
    *groups, last = match[1].split(".")
    for group in groups:
        data = data.setdefault(group, {})
        if not isinstance(data, dict):
            raise InputError(f"{where}: '{group}' is a value, not a group of settings")
    entries = [int(part) for part in re.findall(r"\d+", match[2])]
    data[last] = _with_entry(data.get(last), entries, value, f"{where}: '{key}'")


def keys_of(data: dict[str, Any], above: str = "") -> set[str]:
    """Return the keys of nested tables, "section.key"."""
    found = set()
    for key, value in data.items():
        found |= keys_of(value, f"{above}{key}.") if isinstance(value, dict) else {f"{above}{key}"}
    return found


def key_in(text: str) -> str:
    """Return the key of "section.key[i]=value"."""
    return text.partition("=")[0].partition("[")[0].strip()


def value_at(data: dict[str, Any], key: str) -> Any:
    """Return what is at `key` in nested tables, None where there is nothing."""
    match = _KEY.fullmatch(key)
    found: Any = data
    for group in match[1].split(".") if match else []:
        found = found.get(group) if isinstance(found, dict) else None
    for part in re.findall(r"\d+", match[2]) if match else []:
        found = (
            found[int(part)] if isinstance(found, (list, tuple)) and int(part) < len(found) else None
        )
    return found


def _with_entry(array: Any, entries: list[int], value: Any, where: str) -> Any:
    """Return a copy of an array with the entry at these indices replaced."""
    if not entries:
        return value
    first, *rest = entries
    if not isinstance(array, (list, tuple)):
        raise InputError(f"{where} has no entries; leave out the brackets")
    if first >= len(array):
        raise InputError(f"{where} goes to entry {first}, but there are 0 to {len(array) - 1}")
    copy = list(array)
    copy[first] = _with_entry(copy[first], rest, value, where)
    return copy

"""Scenario files: TOML to typed, checked configuration.

Unknown keys, wrong types and impossible values are refused before anything starts, with file, key and a hint.
The formation's own consistency (cycles, depth, distances) is checked by `shared.formation`.
"""

import contextlib
import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin

import attrs
import tomli_w
from cattrs import BaseValidationError, Converter, ForbiddenExtraKeysError, transform_error
from cattrs.cols import homogenous_tuple_structure_factory
from cattrs.gen import make_dict_structure_fn

from shared.errors import ConfigError
from shared.scenario import Scenario
from shared.toml_text import parse_toml, read_toml

T = TypeVar("T")

SCENARIOS = Path(__file__).resolve().parent.parent / "deploy" / "scenarios"


def load_scenario(source: str | Path, overrides: Sequence[str] = ()) -> Scenario:
    """Reads one scenario.

    Args:
        source: Path of a TOML file, or the bare name of one that ships (`rhombus`).
        overrides: `key=value` with dotted keys, as given to `--set`; they win over the file.

    Returns:
        The scenario, complete with defaults.

    Raises:
        ConfigError: What is wrong, with file, key and a hint.
    """
    path = find_scenario(source)
    tree = read_toml(path)
    for item in overrides:
        _apply_override(tree, item)
    return structure_scenario(tree, str(path))


def find_scenario(source: str | Path) -> Path:
    """Finds a scenario by path or by the name of one that ships.

    Raises:
        ConfigError: There is none; the message lists those that ship.
    """
    for path in (Path(source), SCENARIOS / f"{source}.toml"):
        with contextlib.suppress(OSError):  # a name that is too long for any file
            if path.is_file():
                return path
    shipped = sorted(path.stem for path in SCENARIOS.glob("*.toml"))
    close = difflib.get_close_matches(str(source), shipped, 1)
    hint = f"did you mean {close[0]!r}?" if close else f"scenarios that ship: {', '.join(shipped)}"
    raise ConfigError(f"{source}: no such scenario file; {hint}")


def structure_scenario(tree: Mapping[str, Any], origin: str) -> Scenario:
    """Turns a parsed tree into a checked `Scenario`.

    Args:
        tree: Nested tables as TOML gives them.
        origin: Where the tree is from, for messages.

    Raises:
        ConfigError: With origin, key and a hint.
    """
    return structure(tree, Scenario, origin)


def structure(tree: Mapping[str, Any], kind: type[T], origin: str) -> T:
    """Turns a parsed tree into any configuration class, as strictly as a scenario.

    Args:
        tree: Nested tables as TOML gives them.
        kind: The class of the outermost table.
        origin: Where the tree is from, for messages.

    Raises:
        ConfigError: With origin, key and a hint.
    """
    try:
        return _converter.structure(tree, kind)
    except BaseValidationError as error:
        raise ConfigError(f"{origin}: {_explain(error)}") from error


def dump_scenario(scenario: Scenario) -> str:
    """Writes a scenario as TOML that `load_scenario` reads back to an equal one."""
    return dump(scenario)


def dump(settings: attrs.AttrsInstance) -> str:
    """Writes any configuration class as TOML that `structure` reads back to an equal one."""
    return tomli_w.dumps(_without_none(_converter.unstructure(settings)))


def _apply_override(tree: dict[str, Any], item: str) -> None:
    key, separator, text = item.partition("=")
    if not separator or not key.strip():
        raise ConfigError(
            f"--set {item}: expected key=value, for example --set formation.n=8 (SWARMTOUCH_SET counts)"
        )
    try:
        value = parse_toml(f"value = {text}", item)["value"]
    except ConfigError:
        value = text
    *parents, last = (chunk.strip().strip("\"'") for chunk in key.split("."))
    node = tree
    for parent in parents:
        node = node.setdefault(parent, {})
        if not isinstance(node, dict):
            raise ConfigError(f"--set {item}: {parent!r} is a value, not a table")
    node[last] = value


def _explain(error: BaseValidationError) -> str:
    """Says the first few faults of a cattrs error in one line: key, what is wrong, hint."""
    return "; ".join(
        line.replace("@ $.", "at key ").replace(" @ $", "")
        for line in transform_error(error, format_exception=_format)[:3]
    )


def _format(error: BaseException, kind: type | None) -> str:
    if isinstance(error, ForbiddenExtraKeysError):
        known = [a.name for a in attrs.fields(error.cl)]
        extra = sorted(error.extra_fields)[0]
        close = difflib.get_close_matches(extra, known, 1)
        hint = f"did you mean {close[0]!r}?" if close else f"known keys: {', '.join(known)}"
        return f"unknown key {extra!r} ({hint})"
    if isinstance(error, KeyError):
        return f"missing key {error}"
    if isinstance(error, ValueError | TypeError):
        return str(error)
    return f"{type(error).__name__}: {error} (expected {kind})"


def _strict_number(value: Any, _: type) -> float:
    if type(value) not in (int, float) or not math.isfinite(value):
        raise ValueError(f"a finite number is expected, not {value!r}")
    return float(value)


def _strict_integer(value: Any, _: type) -> int:
    if type(value) is not int:
        raise ValueError(f"a whole number is expected, not {value!r}")
    return value


def _strict_text(value: Any, _: type) -> str:
    if type(value) is not str:
        raise ValueError(f"a string is expected, not {value!r}")
    return value


def _strict_bool(value: Any, _: type) -> bool:
    if type(value) is not bool:
        raise ValueError(f"true or false is expected, not {value!r}")
    return value


def _is_tuple(kind: Any) -> bool:
    return get_origin(kind) is tuple


def _strict_sequence(kind: Any, converter: Converter) -> Callable[[Any, Any], Any]:
    """Refuses a string where a list is expected (it would become a list of its letters)."""
    kinds = get_args(kind)
    any_length = homogenous_tuple_structure_factory(kind, converter) if ... in kinds else None

    def hook(value: Any, _: Any) -> Any:
        if type(value) not in (list, tuple):
            raise ValueError(f"a list is expected, not {value!r}")
        if any_length:
            return any_length(value, kind)
        if len(value) != len(kinds):
            raise ValueError(f"a list of {len(kinds)} is expected, not {value!r}")
        return tuple(converter.structure(v, k) for v, k in zip(value, kinds, strict=True))

    return hook


def _strict_table(kind: Any, converter: Converter) -> Callable[[Any, Any], Any]:
    structure = make_dict_structure_fn(kind, converter)

    def hook(value: Any, _: Any) -> Any:
        if not isinstance(value, dict):
            raise ValueError(f"a table is expected, not {value!r}")
        return structure(value, kind)

    return hook


def _make_converter() -> Converter:
    converter = Converter(forbid_extra_keys=True, detailed_validation=True)
    converter.register_structure_hook(float, _strict_number)
    converter.register_structure_hook(int, _strict_integer)
    converter.register_structure_hook(str, _strict_text)
    converter.register_structure_hook(bool, _strict_bool)
    converter.register_structure_hook_factory(_is_tuple, _strict_sequence)
    converter.register_structure_hook_factory(attrs.has, _strict_table)
    return converter


def _without_none(value: Any) -> Any:
    """TOML has no null: an absent key is how it says None."""
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [_without_none(item) for item in value]
    return value


_converter = _make_converter()

"""Every command and process with every argument set to nonsense: an answer, never a traceback.

What would begin to fly, measure or listen ends there: then the nonsense was none.
"""

import argparse
import importlib
import itertools
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from deploy.cli import _parser, main
from tests.traces import flight, write

NONSENSE = (
    *("", " ", "-1", "0", "1", "99999", "9" * 5000, "nan", "-inf", "1e308", "0x10", "١", "1,2,", ","),
    *(
        "é",
        "\udcff",
        "x" * 5000,
        "a=b",
        "=",
        "=1",
        "a.b.c=1",
        "a=[",
        'a="',
        "[red]",
        "%s",
        "{0}",
        "\n",
        "\x1b[2J",
    ),
    *(".", "/dev/null/x", "/proc", "/proc/self/mem", "/proc/nowhere/at/all", "~nobody/x", "@/nowhere", "@"),
    *("scripted:", "scripted:tour?peak=", "scripted:tour?peak=nan", "recording:", "recording:/", "pointer://"),
    *("pointer://127.0.0.1:80000", "pointer://[", "serial://", "serial:///dev/null?baud=x", "terminal://"),
    *("screen://", "record://", "record:///proc/nowhere/x", "telepathy:now", "http://[", "://", "?", "#"),
    *("net.base_port=80000", "net.router=tcp/127.0.0.1:80000", "net.endpoints.relay=tcp/127.0.0.1:80000"),
    *("net.endpoints.relay=x", 'net.endpoints."drone/2"=1', "net.profile=field", "net.keys=/proc/nowhere"),
    *("formation.n=0", "formation.n=1e3", "formation.n=99999999999999999999", "rates.control_hz=1e-9"),
    *("vehicles.all.uri=sim://x:80000/{id}", "vehicles.all=1", "swarm.name=**", "drone/*/state", "**", "a//b"),
)
"""Where it names places, nothing can be written there, not even by root."""
EXAMPLES = {
    "scenario": "rhombus",
    "scenarios": "rhombus",
    "key": "drone/*/state",
    "number": "1",
    "node": "relay",
    "output": "out",
    "finger": "3",
    "hz": "200",
    "ms": "100",
    "name": "EI",
    "nodes": "drone/1",
    "id": "1",
    "run_dir": "out",
    "source": "sim:identified",
}
"""Of each argument that must be given, a good one."""
WORK = (
    "shared.bus.ZenohBus.__init__",
    "deploy.lockstep.simulate.relayed",
    "deploy.bench.step.measure",
    "deploy.bench.lockstep.measure",
    "deploy.bench.start.measure",
    "deploy.doctor.examine.examine",
    "deploy.falsify.search.search",
    "deploy.vehicle.identify.excited",
)
"""Where commands begin to work."""


PROCESSES = (
    *("agents.__main__", "agents.vehicles.world.__main__", "human_relay.__main__", "glove_bridge.__main__"),
    *("observer.__main__", "observer.console.__main__", "deploy.router"),
)
PARSER = _parser()


class BeginsError(BaseException):
    """The command has taken its arguments and begins to work."""


def begin(*_: object, **__: object) -> None:
    raise BeginsError


class Leaf(NamedTuple):
    """A command without further sub-commands: its words and what it takes."""

    words: tuple[str, ...]
    takes: tuple[argparse.Action, ...]


def leaves(parser: argparse.ArgumentParser, words: tuple[str, ...] = ()) -> Iterator[Leaf]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, child in action.choices.items():
                yield from leaves(child, (*words, name))
            return
    yield Leaf(words, tuple(action for action in parser._actions if action.nargs != 0))


def cases() -> Iterator[tuple[Leaf, argparse.Action]]:
    """Every argument; what several kinds of one command take alike, once."""
    seen = set()
    for leaf in leaves(PARSER):
        for action in leaf.takes:
            alike = (leaf.words[0], action.dest, getattr(action.type, "__qualname__", ""))
            if alike not in seen:
                seen.add(alike)
                yield leaf, action


def is_needed(action: argparse.Action) -> bool:
    return action.required or (not action.option_strings and action.nargs not in ("?", "*"))


def argument(action: argparse.Action, value: str) -> list[str]:
    return [f"{action.option_strings[-1]}={value}"] if action.option_strings else ["--", value]


def command_line(leaf: Leaf, chosen: argparse.Action, value: str, trace: Path) -> list[str]:
    """Everything that is needed, and one argument that is chosen."""
    examples = EXAMPLES | {"run": str(trace), "runs": str(trace)}
    options, positionals = list[str](), list[str]()
    for action in leaf.takes:
        if action is chosen or is_needed(action):
            text = value if action is chosen else examples[action.dest]
            target = options if action.option_strings else positionals
            target += argument(action, text)[0 if action.option_strings else 1 :]
    return [*leaf.words, *options, "--", *positionals]


def outcome(run: Callable[[], int]) -> object:
    try:
        return run()
    except BeginsError:
        return "begins"
    except SystemExit as ended:
        return ended.code


@pytest.fixture
def nothing_works(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("deploy.cli._parser", lambda: PARSER)
    for name in WORK:
        monkeypatch.setattr(name, begin)


def name_of(case: object) -> str:
    return " ".join(case.words) if isinstance(case, Leaf) else getattr(case, "dest", "")


@pytest.mark.slow
@pytest.mark.usefixtures("nothing_works")
@pytest.mark.parametrize(("leaf", "action"), list(cases()), ids=name_of)
def test_nonsense_gets_an_answer(
    leaf: Leaf, action: argparse.Action, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    trace = tmp_path / "trace"
    write(trace, flight(20))
    unanswered = []
    for value in NONSENSE:
        argv = command_line(leaf, action, value, trace)
        code = outcome(lambda argv=argv: main(argv))  # type: ignore[misc]
        said, error = capfd.readouterr()
        if not is_answer(code, said, error):
            unanswered.append((value[:80], code, error[-400:]))
    assert unanswered == []


@pytest.mark.slow
@pytest.mark.usefixtures("nothing_works")
@pytest.mark.parametrize("name", PROCESSES)
def test_processes_answer_nonsense(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    module = importlib.import_module(name)
    monkeypatch.setattr(module, "prepare_process", lambda *_, **__: threading.Event())
    leaf = Leaf((name,), parser_of(module.main).takes)
    unanswered = []
    for action, value in itertools.product(leaf.takes, NONSENSE):
        monkeypatch.setattr(sys, "argv", command_line(leaf, action, value, tmp_path))
        code = outcome(module.main)
        said, error = capfd.readouterr()
        if not is_answer(code, said, error):
            unanswered.append((action.dest, value[:80], code, error[-400:]))
    assert unanswered == []


def is_answer(code: object, said: str, error: str) -> bool:
    foreseen = "Traceback" not in error and "what led to it" not in error
    return foreseen and (code in (0, "begins") or (code in (1, 2) and bool((error + said).strip())))


def parser_of(run: Callable[[], int]) -> Leaf:
    """What a process takes, from the parser that it makes."""
    found: list[Leaf] = []

    def grab(parser: argparse.ArgumentParser, *_: object) -> None:
        found.extend(leaves(parser))
        raise BeginsError

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(argparse.ArgumentParser, "parse_args", grab)
        outcome(run)
    return found[0]

"""The house: our packages are ours, pure cores are pure, and a flying process stays light."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("agents", "human_relay", "glove_bridge", "observer", "shared", "deploy")

PURE = [
    *sorted((ROOT / "agents/control").glob("*.py")),
    *sorted((ROOT / "agents/vehicles/bodies").glob("*.py")),
    *(ROOT / f"agents/{name}.py" for name in ("agent", "company", "settings", "stepping", "vicinity")),
    ROOT / "agents/vehicles/world/referee.py",
    *(ROOT / f"human_relay/{name}.py" for name in ("velocity", "relay", "pointing")),
    *(
        ROOT / f"glove_bridge/{name}.py"
        for name in (
            *("formation_state", "meaning", "cues", "scheduler", "swarm_view", "distinctiveness"),
            *("protocol", "framing", "session", "calibration"),
        )
    ),
    *sorted((ROOT / "glove_bridge/rules").glob("*.py")),
    *(ROOT / f"glove_bridge/patterns/{name}.py" for name in ("pattern", "schema")),
    *(
        ROOT / f"observer/{name}.py"
        for name in ("flight_stats", "agent_log", "hand_log", "histogram", "through")
    ),
    *sorted((ROOT / "observer/path").glob("*.py")),
    *(ROOT / f"observer/report/{name}.py" for name in ("record", "tables", "page")),
    *(ROOT / f"observer/console/{name}.py" for name in ("access", "notices", "ownership", "protocol", "scene")),
    *(ROOT / f"shared/recordings/{name}.py" for name in ("check", "track")),
    ROOT / "deploy/status/report.py",
    *(
        ROOT / f"shared/{name}.py"
        for name in (
            "codec",
            "fence",
            "formation",
            "geometry",
            "messages",
            "nodes",
            "order",
            "plain_text",
            "plausibility",
            "pointer_link",
            "radio_link",
            "scenario",
            "shapes",
            "spreadsheet",
            "topics",
            "uri",
            "validators",
        )
    ),
]
IMPURE = {
    *("asyncio", "logging", "multiprocessing", "os", "random", "select", "signal", "socket", "subprocess"),
    *("threading", "time", "datetime", "serial", "zenoh", "shared.bus", "shared.process", "shared.clock"),
}
HARMLESS = {"shared.clock.NS_PER_S"}


def imports(path: Path) -> set[str]:
    """Every name that a file imports, `module` or `module.name`, wherever in the file."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def is_below(name: str, package: str) -> bool:
    return name == package or name.startswith(f"{package}.")


def sources() -> list[Path]:
    return sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))


@pytest.mark.parametrize("name", PACKAGES)
def test_a_package_is_ours(name: str) -> None:
    """PyPI's openai-agents installs a package `agents`, too."""
    package = importlib.import_module(name)
    assert package.__file__ == str(ROOT / name / "__init__.py")


@pytest.mark.parametrize("path", PURE, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_pure_core_imports_nothing_impure(path: Path) -> None:
    used = imports(path) - HARMLESS
    assert {name for name in used if any(is_below(name, module) for module in IMPURE)} == set()


@pytest.mark.parametrize("path", PURE, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_pure_core_opens_nothing(path: Path) -> None:
    calls = [
        node.func.id
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    ]
    assert not {"open", "print", "input"} & set(calls)


TEXT_FILES = {"open", "read_text", "write_text", "fdopen", "NamedTemporaryFile", "TextIOWrapper"}
"""Functions that open text files, unless they are told otherwise."""


def says_encoding(call: ast.Call) -> bool:
    keywords = {keyword.arg for keyword in call.keywords}
    modes = [*call.args, *(keyword.value for keyword in call.keywords if keyword.arg == "mode")]
    is_binary = any(isinstance(m, ast.Constant) and isinstance(m.value, str) and "b" in m.value for m in modes)
    return is_binary or "encoding" in keywords or None in keywords


def leaves_encoding_to_the_locale(call: ast.Call) -> bool:
    keywords, function = {keyword.arg for keyword in call.keywords}, call.func
    name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    owner = ast.unparse(function.value) if isinstance(function, ast.Attribute) else ""
    if owner == "subprocess":
        return bool({"text", "universal_newlines"} & keywords) and "encoding" not in keywords
    if name not in TEXT_FILES or (name == "open" and owner in ("os", "zenoh", "self", "console")):
        return False
    if not owner and name != "open":  # our own `read_text` looks for itself
        return False
    if name == "open" and owner and not call.args and "newline" not in keywords:
        return owner.endswith(("path", "file"))
    return not says_encoding(call)


@pytest.mark.parametrize("path", sources(), ids=lambda path: str(path.relative_to(ROOT)))
def test_no_text_is_read_or_written_in_the_encoding_of_the_locale(path: Path) -> None:
    calls = [node for node in ast.walk(ast.parse(path.read_bytes())) if isinstance(node, ast.Call)]
    assert [ast.unparse(call) for call in calls if leaves_encoding_to_the_locale(call)] == []


@pytest.mark.parametrize(
    ("text", "leaves"),
    [
        ("path.read_text()", True),
        ("path.open()", True),
        ("path.open('w', newline='')", True),
        ("open(name)", True),
        ("subprocess.run(command, text=True)", True),
        ("os.fdopen(descriptor, 'w')", True),
        ("path.read_text(encoding='utf-8')", False),
        ("path.open('rb')", False),
        ("subprocess.run(command, text=True, encoding='utf-8')", False),
        ("console.open()", False),
    ],
)
def test_the_check_of_encodings_finds_what_it_is_to_find(text: str, *, leaves: bool) -> None:
    (call,) = (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call))
    assert leaves_encoding_to_the_locale(call) is leaves


def test_only_the_bus_knows_zenoh() -> None:
    users = {
        str(path.relative_to(ROOT)) for path in sources() if any(is_below(n, "zenoh") for n in imports(path))
    }
    assert users == {"shared/bus.py"}


@pytest.mark.parametrize("name", ["agents", "human_relay", "glove_bridge", "observer"])
def test_a_process_package_knows_only_itself_and_the_vocabulary(name: str) -> None:
    strangers = set(PACKAGES) - {name, "shared"}
    for path in (ROOT / name).rglob("*.py"):
        assert {n for n in imports(path) if n.partition(".")[0] in strangers} == set(), path


def loaded_by(module: str) -> set[str]:
    """Top-level modules in a fresh process that has imported one module."""
    code = f"import sys, {module}; print(*{{name.partition('.')[0] for name in sys.modules}})"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], cwd=ROOT, capture_output=True, text=True, check=True, timeout=60
    )
    return set(done.stdout.split())


@pytest.mark.parametrize(
    "module", ["agents.__main__", "human_relay.__main__", "agents.vehicles.world.__main__"]
)
def test_a_flying_process_loads_nothing_heavy(module: str) -> None:
    loaded = loaded_by(module)
    heavy = {"rich", "rosbags", "matplotlib", "scipy", "cryptography", "mcap", "websockets", "http", "asyncio"}
    heavy |= {"starlette", "uvicorn", "numpy"}
    assert loaded & heavy == set()
    assert "zenoh" in loaded


def test_the_control_law_loads_without_bus_or_threads_of_ours() -> None:
    assert loaded_by("agents.agent") & {"zenoh", "serial", "rich", "asyncio"} == set()


@pytest.mark.parametrize(
    "path", [p for p in sources() if p.name == "__main__.py"], ids=lambda p: str(p.relative_to(ROOT))
)
def test_a_main_module_is_short(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 70


def test_every_module_says_what_it_is() -> None:
    silent = [
        p
        for p in sources()
        if p.read_text(encoding="utf-8") and not ast.get_docstring(ast.parse(p.read_text()))
    ]
    assert silent == []


def test_one_console_shows_foreign_text_and_nobody_makes_another() -> None:
    """`PlainConsole` takes what a terminal acts upon out of every string; those of rich do not."""
    own = ROOT / "deploy/launcher/console.py"
    files = [file for package in PACKAGES for file in (ROOT / package).rglob("*.py") if file != own]
    made = {
        f"{file.relative_to(ROOT)}:{node.lineno}"
        for file in files
        if "from rich" in (source := file.read_text(encoding="utf-8"))
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in ("Console", "Text")
    }
    assert not made

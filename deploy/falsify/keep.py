"""Cases on disk: a folder that flies again, with and without its faults.

| file | what |
|---|---|
| `case.toml` | the case, for `swarmtouch falsify --case FOLDER` |
| `scenario.toml` | what it flies, for `swarmtouch sim FOLDER/scenario.toml` |
| `hand.csv` | its hand, for `--hand "recording:FOLDER/hand.csv?lead=0"` of any flight |
"""

from pathlib import Path

from deploy.falsify.case import Case
from deploy.falsify.hand import poses, write_recording
from deploy.falsify.swarm import prepare
from shared.config import dump, dump_scenario, structure
from shared.toml_text import read_toml

CASE_FILE, SCENARIO_FILE, HAND_FILE = "case.toml", "scenario.toml", "hand.csv"


def save_case(case: Case, folder: Path) -> None:
    """Writes a case; the folder is made if it is missing."""
    scenario, _ = prepare(case.scenario, case.overrides)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / CASE_FILE).write_text(dump(case), encoding="utf-8")
    (folder / SCENARIO_FILE).write_text(dump_scenario(scenario), encoding="utf-8")
    write_recording(poses(case, scenario.rates.control_hz), folder / HAND_FILE)


def load_case(folder: Path) -> Case:
    """Reads a case that `save_case` wrote, or its `case.toml`.

    Raises:
        ConfigError: It is missing or wrong; names file and key.
    """
    path = folder / CASE_FILE if folder.is_dir() else folder
    return structure(read_toml(path), Case, str(path))

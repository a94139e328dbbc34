"""URIs: paths as users type them, options where there are some."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glove_bridge.gloves import open_glove
from glove_bridge.patterns import load_patterns
from human_relay.sources import open_source
from shared.errors import ConfigError
from shared.uri import parse_uri

ROWS = "t,x,y,z\n" + "".join(f"{k / 60},0,0,1.2\n" for k in range(60))
NAMES = (
    "take #3.csv",
    "what?.csv",
    "50%25.csv",
    "100%.csv",
    "a&b=c.csv",
    "[1].csv",
    "ü;é.csv",
    "a+b.csv",
    "a:b.csv",
)


@pytest.mark.parametrize("name", [*NAMES, "take%20one.csv"])
@pytest.mark.parametrize("options", ["", "?lead=1", "?lead=1&speed=0.5"])
@pytest.mark.parametrize("slashes", ["", "//"])
def test_a_recording_is_found_under_the_name_that_it_has(
    tmp_path: Path, name: str, options: str, slashes: str
) -> None:
    (tmp_path / name).write_text(ROWS, encoding="ascii")
    open_source(f"recording:{slashes}{tmp_path / name}{options}", 0).close()


def test_a_recording_may_be_named_percent_encoded(tmp_path: Path) -> None:
    (tmp_path / "take #3 50%.csv").write_text(ROWS, encoding="ascii")
    open_source(f"recording:{tmp_path}/take%20%233%2050%25.csv?lead=1", 0).close()


@pytest.mark.parametrize("name", NAMES)
def test_a_glove_writes_into_the_file_that_was_named(tmp_path: Path, name: str) -> None:
    glove = open_glove(f"record://{tmp_path / name}")
    glove.play(load_patterns("paper").patterns["EI"], 0)
    glove.close()
    (written,) = tmp_path.iterdir()
    assert written.name == name
    assert json.loads(written.read_text(encoding="utf-8").splitlines()[0])["pattern"] == "EI"


@pytest.mark.parametrize(
    "text", ["", "tour", ":x", "//x", "1a:x", "scripted:tour?peak", "scripted:tour?peak&lead="]
)
def test_what_is_no_uri_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match=r"for example scripted:tour\?peak=0.4"):
        open_source(text, 0)


def test_a_path_is_wanted() -> None:
    for text in ("recording:", "recording://?lead=1", "recording:a\0b"):
        with pytest.raises(ConfigError, match="no path"):
            open_source(text, 0)


letters = st.characters(blacklist_characters="?/%\0", blacklist_categories=["Cs"])


@given(path=st.text(letters, min_size=1), options=st.dictionaries(st.sampled_from("abc"), st.text("0.x/")))
def test_path_and_options_come_apart_again(path: str, options: dict[str, str]) -> None:
    tail = "&".join(f"{name}={value}" for name, value in options.items())
    uri = parse_uri(f"recording:{path}{'?' if options else ''}{tail}", example="")
    assert (uri.scheme, uri.path, uri.options) == ("recording", path, options)

"""Files as editors leave them: marks, UTF-16, foreign line ends; and ones that have no end."""

import gzip
import re
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from glove_bridge.calibration_file import SHIPPED, load_calibration
from glove_bridge.patterns import FOLDER, load_patterns
from observer.console.serve import find_token
from shared.config import SCENARIOS, load_scenario
from shared.errors import ConfigError
from shared.files import LARGEST, encoding_of, read_text
from shared.recordings.csv_rows import LONGEST_LINE, MOST_CHARACTERS, MOST_LINES
from shared.recordings.csv_table import read_table
from shared.recordings.flight_folder import read_track
from shared.recordings.hand import read_hand
from tests.flight_folders import write_flight

ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32")
TOML = [*sorted(SCENARIOS.glob("*.toml")), SHIPPED, *sorted(FOLDER.glob("*.toml"))]
ROWS = "t,x,y,z,note\n" + "".join(f"{k / 60:.4f},0,0,1.2,ü\n" for k in range(60))


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_an_encoding_is_told_by_the_first_bytes(tmp_path: Path, encoding: str, ending: str) -> None:
    path = tmp_path / "text"
    path.write_bytes(f"tä{ending}b{ending}".encode(encoding))
    if encoding in ("utf-16-le", "utf-16-be"):
        path.write_bytes(f"t{ending}b{ending}".encode(encoding))
        assert read_text(path) == "t\nb\n"
    else:
        assert read_text(path) == "tä\nb\n"


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("packed", [False, True])
def test_a_hand_is_read_in_any_encoding(tmp_path: Path, encoding: str, *, packed: bool) -> None:
    path, data = tmp_path / "hand.csv", ROWS.encode(encoding)
    path.write_bytes(gzip.compress(data) if packed else data)
    hand = read_hand(path)
    assert len(hand.checked.rows) == 60
    path.write_bytes((ROWS + "1.5,0,oops,1.2,ü\n").encode(encoding))
    with pytest.raises(ConfigError, match="line 62: 'oops' is no number"):
        read_hand(path)


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize(
    "file", [*sorted(SCENARIOS.glob("*.toml")), SHIPPED, *sorted(FOLDER.glob("*.toml"))], ids=lambda f: f.name
)
def test_every_toml_is_read_in_any_encoding(tmp_path: Path, file: Path, encoding: str) -> None:
    loaders: dict[Path, Callable[[Path], object]] = {
        SCENARIOS: load_scenario,
        SHIPPED.parent: load_calibration,
        FOLDER: load_patterns,
    }
    load = loaders[file.parent]
    path = tmp_path / file.name
    path.write_bytes(file.read_text(encoding="utf-8").encode(encoding))
    assert load(path) == load(file)


@pytest.mark.parametrize("said", ["", "sep={}\n", '"sep={}"\r\n'])
@pytest.mark.parametrize(("separator", "comma"), [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ",")])
def test_a_table_of_any_spreadsheet_is_read(tmp_path: Path, separator: str, comma: str, said: str) -> None:
    cells = ("0.5", '"a,b;c"', "-1e-1", "1.25")
    rows = [("t", "x", "note", "y", "z"), *((f"{row / 60:.4f}", *cells) for row in range(60))]
    lines = [separator.join(cell.replace(".", comma) for cell in row) for row in rows]
    path = tmp_path / "take.csv"
    path.write_text(said.format(separator) + "\n".join(lines) + "\n", newline="")
    hand = read_hand(path)
    assert hand.remarks == ()
    assert np.allclose(hand.checked.track.position, [0.5, -0.1, 1.25])
    with path.open("a", newline="") as stream:
        stream.write(separator.join(("2", "0_5", "", "0", "1")) + "\n")
    with pytest.raises(ConfigError, match=f"line {62 + bool(said)}: '0_5' is no number"):
        read_hand(path)


@pytest.mark.parametrize(
    "head", ["T,X,Y,Z", "t [s],x (m),Y[M],z", "# me\n\n#\nt,x,y,z", "# t,x,y,z", "#,t,x,y,z"]
)
@pytest.mark.parametrize("separator", [",", ";"])
def test_a_header_may_have_capitals_units_and_comments(tmp_path: Path, head: str, separator: str) -> None:
    row = "{},0.5,-0.1,1.25" if head != "#,t,x,y,z" else "7,{},0.5,-0.1,1.25"
    rows = [row.format(k / 64) for k in range(60)]
    rows[30:30] = ["# a comment, with commas"]
    text = "\n".join((*head.split("\n"), *rows)) + "\n"
    path = tmp_path / "take.csv"
    path.write_text(text if separator == "," else text.replace(",", ";").replace(".", ","))
    hand = read_hand(path)
    assert hand.remarks == ()
    assert np.allclose(hand.checked.track.position, [0.5, -0.1, 1.25])
    with path.open("a") as stream:
        stream.write(rows[-1].replace(",", separator).replace("1", "oops") + "\n")
    lines = len(path.read_text().splitlines())
    with pytest.raises(ConfigError, match=f"line {lines}: "):
        read_hand(path)


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"t,x [mm],y,z\n0,0,0,1\n", "column x [mm]: write x in m"),
        (b"T (ms),x,y,z\n0,0,0,1\n", "column T (ms): write t in s"),
        (b"t,X,x [m],y,z\n0,0,0,0,1\n", "more than one column x"),
        (b"# only words\n", "empty; expected a header"),
        (b"BZh91AY&SY", "packed by bzip2; a hand is read from"),
        (b"\xfd7zXZ\0\0\4", "packed by xz"),
        (b"\x02P\0\0", "a C3D file"),
        ("t,x,y,z,größe\n".encode("latin-1"), "no text in UTF-8 or UTF-16, from about line 1 on"),
        (b"t,x,y,z,x\n0,0,0,1,0\n", "more than one column x; rename the others"),
        (
            b"t,x,y,z\n" + b"".join(b"%d,0,0,1\n" % (row * 16) for row in range(99)),
            "milliseconds? Write seconds",
        ),
        (b"t,x,y,z\n" + b"".join(b"%d,0,0,1\n" % (10**18 + row) for row in range(9)), "or nanoseconds?"),
        (b"t,x,y,z,yaw\n" + b"".join(b"%g,0,0,1,%d\n" % (row / 60, row) for row in range(99)), "degrees?"),
        (b"t,x,y,z\n" + b"".join(b"%g,0,0,1\n" % (-row / 60) for row in range(99)), "sort them by time"),
    ],
)
def test_what_is_no_hand_of_ours_is_named(tmp_path: Path, data: bytes, why: str) -> None:
    path = tmp_path / "take"
    path.write_bytes(data)
    with pytest.raises(ConfigError, match=re.escape(why)):
        read_hand(path)


def test_a_bag_of_ros_2_is_named(tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    with pytest.raises(ConfigError, match="a bag of ROS 2; a hand is read from a ROS 1 bag"):
        read_hand(tmp_path)


def test_a_token_is_read_as_notepad_writes_it(tmp_path: Path) -> None:
    path = tmp_path / "token"
    path.write_bytes("0123456789abcdef\r\n".encode("utf-8-sig"))
    assert find_token(f"@{path}") == "0123456789abcdef"


@pytest.mark.parametrize("data", [b"\xff\xfe\x00", b"caf\xe9 = 1", b"\x80\x81", b"a\0\0"])
def test_what_is_no_text_is_refused_with_what_to_do(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "scenario.toml"
    path.write_bytes(data)
    with pytest.raises(ConfigError, match=r"scenario\.toml"):
        load_scenario(path)


@pytest.mark.parametrize("load", [load_scenario, load_calibration, load_patterns, read_hand])
def test_a_file_without_an_end_is_refused(load: object) -> None:
    assert callable(load)
    with pytest.raises(ConfigError):
        load(Path("/dev/zero"))


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (lambda: bytes(200 << 20), f"longer than {LONGEST_LINE}"),
        (lambda: b"\n" * (50 << 20), "too long a file; at most 20000 lines"),
        (lambda: b"1,0.1,0.2,1.2\n" * (4 << 20), "too long a file; at most 20000 lines"),
    ],
    ids=["one line", "blank lines", "rows"],
)
def test_a_gzipped_table_that_grows_without_end_is_refused_in_little_memory(
    tmp_path: Path, content: Callable[[], bytes], expected: str
) -> None:
    path = tmp_path / "table.csv.gz"
    path.write_bytes(gzip.compress(b"t,x,y,z\n" + content(), compresslevel=1))
    assert path.stat().st_size < 2 << 20
    tracemalloc.start()
    with pytest.raises(ConfigError, match=expected):
        read_table(path, numbers=("t", "x", "y", "z"), most=20_000)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10 << 20
    assert MOST_LINES * LONGEST_LINE > MOST_CHARACTERS, "a long file of long lines ends, too"


@pytest.mark.parametrize("name", ["glove.csv.gz", "cf1.csv.gz"])
def test_a_packed_table_that_is_cut_off_is_read_up_to_there(tmp_path: Path, name: str) -> None:
    path = write_flight(tmp_path) / name
    whole, data = read_track(path), path.read_bytes()
    counts = []
    for size in range(0, len(data), len(data) // 30):
        path.write_bytes(data[:size])
        try:
            track = read_track(path)
        except ConfigError:
            counts.append(0)
            continue
        counts.append(len(track.t_ns))
        assert track.t_ns.tolist() == whole.t_ns[: len(track.t_ns)].tolist()
    assert counts == sorted(counts)
    assert counts[-1] > 0.8 * len(whole.t_ns)


def test_the_largest_file_of_ours_is_far_within_the_bound() -> None:
    assert max(path.stat().st_size for path in SCENARIOS.iterdir()) < LARGEST / 1_000
    assert encoding_of(b"") == "utf-8"

"""Pattern sets as tables: frames, and the prediction of how well they can be told apart."""

from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from deploy.terminal.console import open_console
from glove_bridge.distinctiveness import Prediction, predict
from glove_bridge.patterns import load_patterns, shipped_sets
from glove_bridge.patterns.pattern import Frame, Pattern, PatternSet
from glove_bridge.perception import load_perception


def list_sets() -> None:
    """Prints one row per set that ships."""
    table = _table("", "set", "patterns", "")
    for name in shipped_sets():
        patterns = load_patterns(name)
        table.add_row(name, " ".join(patterns.patterns), patterns.about)
    open_console(stderr=False).print(table)


def show_set(patterns: PatternSet, other: PatternSet | None) -> None:
    """Prints the frames of a set and its prediction, beside that of another one if there is one."""
    console = open_console(stderr=False)
    console.print(f"{patterns.name}: {patterns.about}")
    console.print(_frame_table(patterns))
    shown = [patterns] if other is None else [patterns, other]
    perception = load_perception()
    predictions = [predict(list(one.patterns.values()), perception) for one in shown]
    console.print("Below are the predictions of a fitted model of perception, not measurements.")
    console.print(_comparison_table([one.name for one in shown], predictions))
    for one, prediction in zip(shown, predictions, strict=True):
        _print_confusion(console, one.name, prediction)


def _frame_table(patterns: PatternSet) -> Table:
    table = _table("frames: finger@Hz, ms (1 = thumb; - = pause)", "pattern", "frames", "ms", "gate ms")
    for pattern in patterns.patterns.values():
        table.add_row(pattern.name, frames_text(pattern), str(pattern.length_ms), str(pattern.gate_ms))
    return table


def frames_text(pattern: Pattern) -> str:
    """Writes the frames of a pattern in one line, for example `3@150 200, {2,4}@200 200`."""
    return ", ".join(f"{_fingers_text(frame)} {frame.ms}" for frame in pattern.frames)


def _fingers_text(frame: Frame) -> str:
    levels = sorted(set(frame.hz.values()))
    groups = ([finger for finger in sorted(frame.hz) if frame.hz[finger] == hz] for hz in levels)
    texts = (
        f"{group[0] if len(group) == 1 else '{' + ','.join(map(str, group)) + '}'}@{hz:g}"
        for group, hz in zip(groups, levels, strict=True)
    )
    return " + ".join(texts) or "-"


def _comparison_table(names: Sequence[str], predictions: Sequence[Prediction]) -> Table:
    table = _table("predicted recognition", "", *names)
    table.add_row("correct answers", *(f"{p.accuracy:.1%}" for p in predictions))
    table.add_row("information, bits", *(f"{p.bits:.2f}" for p in predictions))
    closest = [p.closest for p in predictions]
    table.add_row("smallest distance", *(f"{d:.3f} ({one}, {two})" for d, one, two in closest))
    return table


def _print_confusion(console: Console, name: str, prediction: Prediction) -> None:
    table = _table(f"{name}: predicted answers, %", "pattern", *prediction.names)
    for pattern, row in zip(prediction.names, prediction.confusion.tolist(), strict=True):
        table.add_row(pattern, *(f"{100 * share:.0f}" for share in row))
    console.print(table)


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title or None, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for index, column in enumerate(columns):
        table.add_column(
            column, justify="left" if index == 0 or column in ("frames", "patterns", "") else "right"
        )
    return table

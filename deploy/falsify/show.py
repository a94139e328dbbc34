"""A search for people: one row per class, and the commands that fly its worst again."""

import math

from deploy.falsify.case import Case
from deploy.falsify.judge import CLASSES, Kind, Verdict, Worst
from deploy.falsify.search import Finds


def table(finds: Finds) -> list[str]:
    """Returns one line per class: the worst, its limit, how often it was broken, when and whose."""
    lines = [f"{'':44}{'worst m':>9}{'limit m':>9}{'broken':>12}  where"]
    for kind, kept in finds.worst.items():
        worst = kept[0].verdict[kind] if kept else Worst(math.inf)
        broken = f"{finds.broken[kind]}/{finds.flights}"
        where = f"flight {kept[0].number}, {_where(worst)}" if kept else ""
        lines.append(f"{_row(kind, worst)}{broken:>12}  {where}")
    return lines


def verdict_table(verdict: Verdict) -> list[str]:
    """Returns one line per class of a single flight."""
    lines = [f"{'':44}{'worst m':>9}{'limit m':>9}  where"]
    for kind, worst in verdict.items():
        lines.append(f"{_row(kind, worst)}  {_where(worst)}{_mark(kind, worst)}")
    return lines


def describe(case: Case) -> str:
    """Returns in one line what happens in a case."""
    parts = [case.scenario, *case.overrides, f"{case.seconds:.1f} s"]
    parts.append("from a hover" if case.airborne else "from the ground")
    parts += [f"{fault.kind} {fault.drone or ''} {fault.start:.1f}-{fault.end:.1f} s" for fault in case.faults]
    parts += [f"{wished.order} at {wished.t:.1f} s" for wished in case.wishes]
    if case.weather.loss or case.weather.delay:
        parts.append(f"loss {case.weather.loss:.2f}, delay up to {case.weather.delay * 1000:.0f} ms")
    return ", ".join(parts)


def _row(kind: Kind, worst: Worst) -> str:
    value = f"{worst.value:9.3f}" if math.isfinite(worst.value) else f"{'-':>9}"
    return f"{CLASSES[kind].label:44}{value}{CLASSES[kind].limit:9.2f}"


def _where(worst: Worst) -> str:
    if not worst.drones:
        return ""
    return f"{worst.t:.2f} s, drone {' and '.join(map(str, worst.drones))}"


def _mark(kind: Kind, worst: Worst) -> str:
    return "  BROKEN" if CLASSES[kind].margin(worst.value) < 0.0 else ""

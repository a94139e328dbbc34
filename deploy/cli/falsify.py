"""`swarmtouch falsify`: looks for the worst flight of a scenario."""

import argparse
import sys
from pathlib import Path

from deploy.cli.arguments import add_overrides, count, new_folder, seconds, whole

DESCRIPTION = """Looks for the flight in which a scenario comes nearest to a collision, to the hand, to a
column, out of its fence or onto the floor: real agents in lockstep on a virtual clock, with hands up to
1.5 m/s, links that lose and delay, a drone that is cut off, killed, held, blind or empty. Random flights first,
then small changes of the worst. The same seed and --flights find the same. The worst of each class is kept as
a folder that flies again.

Exit code 0: no limit was broken."""
EXAMPLE = """swarmtouch falsify rhombus --seconds 60
         swarmtouch falsify rhombus slalom vee line grid --vary --flights 2000 --seed 7
         swarmtouch falsify --case runs/falsify/rhombus-0/drones"""

DEFAULT_SECONDS = 60.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the arguments."""
    parser.add_argument(
        "scenarios", nargs="*", metavar="SCENARIO", help="names of scenarios that ship, or TOML files"
    )
    add_overrides(parser)
    parser.add_argument(
        "--seconds", type=seconds, metavar="S", help=f"time to search (default: {DEFAULT_SECONDS:.0f})"
    )
    parser.add_argument("--flights", type=count, metavar="N", help="fly so many instead")
    parser.add_argument("--seed", type=int, default=0, help="of everything that is drawn (%(default)s)")
    parser.add_argument("--jobs", type=whole(1, 1024), metavar="N", help="processes (default: all processors)")
    parser.add_argument(
        "--vary", action="store_true", help="draw body, link-loss rule, law, size and columns as well"
    )
    parser.add_argument("--no-faults", action="store_true", help="nothing fails, nobody holds or lands")
    parser.add_argument("--no-weather", action="store_true", help="links neither lose nor delay")
    parser.add_argument("--case", type=Path, metavar="FOLDER", help="fly a kept case again instead")
    parser.add_argument(
        "--keep",
        type=new_folder,
        default=Path("runs/falsify"),
        metavar="DIR",
        help="where the worst of each class is kept (default: %(default)s)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Searches, or flies one case, and returns the exit code."""
    from shared.errors import ConfigError  # noqa: PLC0415  --help stays quick

    if arguments.case is not None:
        return _fly_again(arguments.case)
    if not arguments.scenarios:
        raise ConfigError("falsify: name a scenario, or a kept flight with --case")
    return _search(arguments)


def _fly_again(folder: Path) -> int:
    from deploy.falsify.judge import broken  # noqa: PLC0415
    from deploy.falsify.keep import load_case  # noqa: PLC0415
    from deploy.falsify.search import try_case  # noqa: PLC0415
    from deploy.falsify.show import describe, verdict_table  # noqa: PLC0415

    case = load_case(folder)
    print(describe(case))
    verdict = try_case(case)
    print("\n".join(verdict_table(verdict)))
    return 1 if broken(verdict) else 0


def _search(arguments: argparse.Namespace) -> int:
    from deploy.falsify.draw import Plan  # noqa: PLC0415
    from deploy.falsify.keep import save_case  # noqa: PLC0415
    from deploy.falsify.search import Budget, Finds, search  # noqa: PLC0415
    from deploy.falsify.show import describe, table  # noqa: PLC0415

    plan = Plan(
        scenarios=tuple(arguments.scenarios),
        overrides=tuple(arguments.overrides),
        vary=arguments.vary,
        faults=not arguments.no_faults,
        weather=not arguments.no_weather,
    )
    limit = arguments.seconds or (None if arguments.flights else DEFAULT_SECONDS)

    def report(finds: Finds) -> None:
        if sys.stderr.isatty():
            print(
                f"\r{finds.flights} flights, {sum(finds.broken.values())} broken limits",
                end="",
                file=sys.stderr,
            )

    finds = search(
        plan,
        Budget(flights=arguments.flights, seconds=limit),
        arguments.seed,
        jobs=arguments.jobs,
        report=report,
    )
    print("\n".join(table(finds)))
    root = arguments.keep / f"{'-'.join(Path(name).stem for name in arguments.scenarios)}-{arguments.seed}"
    for kind, kept in finds.worst.items():
        if kept:
            save_case(kept[0].case, root / kind)
            print(f"\n{kind}: {describe(kept[0].case)}\n    swarmtouch falsify --case {root / kind}")
    return 1 if any(finds.broken.values()) else 0

"""Pictures of measurements, readable on a light and on a dark page."""

from pathlib import Path
from typing import Any

from deploy.bench.report import INK, Report
from shared.errors import ConfigError

COLOURS = ("#3b8fd6", "#e07b00", "#2fa36b", "#c2579b")
"""Of equal weight, and told apart by people who see no red or no green."""


def check_plot(file: Path) -> None:
    """Refuses early what could not be drawn after the measurement.

    Raises:
        ConfigError: matplotlib is missing, or does not know the format.
    """
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415  an extra that nothing else needs
    except ImportError as error:
        raise ConfigError("--plot needs matplotlib: pip install 'swarmtouch[plot]'") from error
    known = Figure().canvas.get_supported_filetypes()
    if file.suffix.removeprefix(".") not in known:
        raise ConfigError(f"--plot {file}: the ending must be one of {', '.join(sorted(known))}")


def save_plot(report: Report, file: Path) -> None:
    """Draws a report into a file; its ending chooses the format."""
    from cycler import cycler  # noqa: PLC0415  see `check_plot`
    from matplotlib import rc_context  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    style: dict[Any, Any] = {
        **dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), INK),
        "axes.prop_cycle": cycler(color=COLOURS),
        "axes.spines.top": False,
        "axes.spines.right": False,
        "grid.color": INK,
        "grid.alpha": 0.3,
        "axes.grid": True,
        "legend.frameon": False,
        "svg.hashsalt": "swarmtouch",
    }
    with rc_context(style):
        figure = Figure(figsize=(8.0, 3.6), layout="constrained")
        report.draw(figure)
        figure.savefig(file, transparent=True, metadata={"Date": None} if file.suffix == ".svg" else None)

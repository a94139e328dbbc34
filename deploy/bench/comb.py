"""A formation in which nobody has more to do because there are more drones."""

LENGTH = 4
"""Drones in a column, one behind the other; the first refers to the human."""
SPACING = 1.0
"""Between neighbours, m: at most eight others are within the reach of `shared.nodes.NEAR`."""


def comb(number: int) -> tuple[str, ...]:
    """Returns the overrides that make a scenario fly columns of four side by side.

    Depth and neighbourhood do not grow with the number of drones, and everybody hears only whom it must, so
    the work of one agent is bounded.
    """
    columns = -(-number // LENGTH)
    drones = ", ".join(_drone(drone, columns) for drone in range(1, number + 1))
    return (
        'formation.shape="custom"',
        f"formation.n={number}",
        f"formation.drones=[{drones}]",
        "net.full_mesh=0",
    )


def _drone(drone: int, columns: int) -> str:
    column, row = divmod(drone - 1, LENGTH)
    reference = str(drone - 1) if row else "human"
    side = 0.0 if row else SPACING * (column - (columns - 1) / 2.0)
    return f'{{id={drone}, references=["{reference}"], offset=[{-SPACING}, {side}, 0.0]}}'

"""One process per drone: neighbours and hand in, own goal and set-point out."""

import shared  # noqa: F401  its finder is there before the first of our modules is looked for

"""One process per drone: neighbours and hand in, own goal and set-point out."""

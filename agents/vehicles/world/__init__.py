"""The simulated world: every body, its link to the driver, and the referee (DESIGN section 7)."""

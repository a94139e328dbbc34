"""The control law for one drone in plain floats: what an agent runs 60 times a second.

Numpy spends about a microsecond per call however small the array, and one step of one drone has hundreds of
them. The modules of the same names one level up are the same law for n drones in arrays; a batch of simulated
drones runs those. `tests/unit/test_single.py` holds the two together, function by function.

Values that are made in every step are msgspec structs: as frozen as those of attrs, and made ten times faster.
"""

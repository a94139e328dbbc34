"""The same bodies one by one in plain floats: what a world or a simulator of few drones runs.

Numpy spends about a microsecond per call however few the bodies, and a substep has dozens of calls. The modules
of the same names one level up are the same equations for N bodies in arrays; `tests/unit/test_single_bodies.py`
holds the two together.
"""

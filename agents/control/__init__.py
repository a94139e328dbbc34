"""The control law of one drone as pure functions: state, inputs and time in; state and set-point out.

DESIGN section 4; world frame ENU, metres, seconds. Everything is floats, tuples of floats and final classes
with typed attributes: typed Python that mypyc compiles where there is a C compiler, and that flies unchanged
where there is none. Compiled, an attribute of such a class is a field of a C structure. Settings, made once,
are frozen dataclasses; what is made in every step has an `__init__` of its own with `Final` attributes, for the
one of a dataclass stays Python and would take longer than all of the law.

A length is `sqrt(x x + y y + z z)` and not `math.hypot`: that is the same bits in both forms, and no call in C.
"""

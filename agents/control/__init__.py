"""The control law of one drone as pure functions: state, inputs and time in; state and set-point out.

DESIGN section 4; world frame ENU, metres, seconds. Everything is floats, tuples of floats and final classes
with typed attributes: typed Python that mypyc compiles where there is a C compiler, and that flies unchanged
where there is none. What is made in every step is of such classes because an attribute of theirs is then a
field of a C structure. They have no dictionary, and nothing is assigned after `__init__`.

A length is `sqrt(x x + y y + z z)` and not `math.hypot`: that is the same bits in both forms, and no call in C.
"""

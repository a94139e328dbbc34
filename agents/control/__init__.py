"""The control law as pure functions: state, inputs and time in; state and set-point out (DESIGN section 4).

Everything works on arrays whose first axis is the drone, so that one agent (one row) and the batched simulator
(all rows) run the same code. World frame ENU, metres, seconds.
"""

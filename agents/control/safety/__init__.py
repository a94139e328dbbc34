"""The safety filter: the last to see a set-point before the vehicle, and the only one that knows no mission.

`filter.py` changes what the mission wants only where a barrier is reached (docs/safety.md states the theorem):

    motion.py       what is known of the own body, and its point ahead
    response.py     how the vehicle answers: the point ahead obeys at once, the body follows it
    barrier.py      how fast a gap may close so that it can still be braked
    encounter.py    what there is to keep away from
    demands.py      what fence, floor and encounters demand
    halfplanes.py   the nearest acceleration that satisfies all demands

State and time in, set-point out; floats, tuples and final classes as in all of `agents.control`.
"""

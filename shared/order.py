"""Which of two samples of a publisher is the newer, by (epoch, seq) and the time that passed here. Pure."""

from typing import Final

from shared.clock import NS_PER_S
from shared.errors import DecodeError

FASTEST_HZ: Final = 1000
"""Nobody publishes more often on one key ..."""
AT_ONCE: Final = 256
"""... but what was held up comes together, and clocks drift."""

AHEAD, LATE = "ahead", "out-of-order"
"""Why a sample is refused."""

Sample = tuple[int, int, int]
"""(epoch, seq, arrival in ns on the own clock), as `shared.messages.Heard` is one."""


def check_newer(sample: Sample, last: Sample, stale_s: float) -> None:
    """Accepts what is newer, and refuses the rest.

    A restarted publisher has a newer epoch. An older one, or an older sample of the same epoch, is accepted
    once what was newer has fallen silent. Else a publisher whose clock was set back, or on whose key somebody
    has said a number out of the future, would never be heard again.

    Args:
        sample: The new one.
        last: The last one that was accepted.
        stale_s: Silence after which that one no longer counts, s; infinite for what must never be repeated.

    Raises:
        DecodeError: `out-of-order`, or `ahead`: its number has run ahead of the time that has passed.
    """
    epoch, seq, now_ns = sample
    last_epoch, last_seq, last_ns = last
    if epoch == last_epoch and seq > last_seq:
        if seq - last_seq > AT_ONCE and (seq - last_seq - AT_ONCE) * NS_PER_S > (now_ns - last_ns) * FASTEST_HZ:
            raise DecodeError(AHEAD, f"number {seq} {(now_ns - last_ns) / NS_PER_S:.3f} s after {last_seq}")
        return
    if epoch > last_epoch or ((epoch, seq) != last[:2] and now_ns - last_ns > stale_s * NS_PER_S):
        return
    raise DecodeError(LATE, f"({epoch}, {seq}) after ({last_epoch}, {last_seq})")

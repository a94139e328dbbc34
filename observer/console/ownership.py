"""Who holds the hand: one page at most; others watch and may ask for it. Pure.

Time is in seconds on any monotonic clock.
"""

from attrs import evolve, frozen

from shared.errors import DecodeError
from shared.messages import Vector, Wish

SILENT_S = 0.6
"""A holder that says nothing for so long has lost the hand."""


@frozen(kw_only=True)
class Ownership:
    """Pages and the hand.

    Attributes:
        pages: Numbers of the open pages.
        holder: Page that holds the hand, None while nobody does.
        asking: Pages that ask for it, the longest waiting first.
        heard: When the holder last said something.
        wish: What the holder wants.
        point: Where it wants the mapped hand, None until it has said so.
        yaw: Heading that it wants, rad.
        stopped: Whether any page has said STOP, which is final.
    """

    pages: frozenset[int] = frozenset()
    holder: int | None = None
    asking: tuple[int, ...] = ()
    heard: float = 0.0
    wish: Wish = Wish.GROUND
    point: Vector | None = None
    yaw: float = 0.0
    stopped: bool = False


def join(state: Ownership, page: int) -> Ownership:
    """Opens a page."""
    return evolve(state, pages=state.pages | {page})


def leave(state: Ownership, page: int) -> Ownership:
    """Closes a page; if it held the hand nobody does now."""
    return evolve(release(state, page), pages=state.pages - {page})


def take(state: Ownership, page: int, now: float, wish: Wish) -> Ownership:
    """Takes the hand if nobody holds it, else asks for it.

    Args:
        state: Pages and the hand.
        page: Who wants it.
        now: The time, s.
        wish: What the hand is to say until its holder wants something else.
    """
    if page not in state.pages or page == state.holder:
        return state
    if state.holder is None:
        return _hold(state, page, now, wish)
    return state if page in state.asking else evolve(state, asking=(*state.asking, page))


def release(state: Ownership, page: int) -> Ownership:
    """Lets go of the hand, or withdraws the question."""
    state = evolve(state, asking=tuple(other for other in state.asking if other != page))
    return evolve(state, holder=None, point=None) if page == state.holder else state


def give(state: Ownership, page: int, to: int, now: float) -> Ownership:
    """Hands the hand to a page that has asked; what it says does not change until the new holder speaks.

    Raises:
        DecodeError: `not-holder` or `not-asking`.
    """
    _check_holder(state, page)
    if to not in state.asking:
        raise DecodeError("not-asking", f"page {to} has not asked for the hand")
    return evolve(_hold(state, to, now, state.wish), point=state.point, yaw=state.yaw)


def move(state: Ownership, page: int, point: Vector, yaw: float, now: float) -> Ownership:
    """Points the hand somewhere.

    Raises:
        DecodeError: `not-holder`.
    """
    _check_holder(state, page)
    return evolve(state, point=point, yaw=yaw, heard=now)


def want(state: Ownership, page: int, wish: Wish, now: float) -> Ownership:
    """Says what the operator wants; STOP counts from every page and is final.

    Raises:
        DecodeError: `not-holder`.
    """
    if wish is Wish.STOP:
        return evolve(state, stopped=True)
    _check_holder(state, page)
    return evolve(state, wish=wish, heard=now)


def expire(state: Ownership, now: float) -> Ownership:
    """Lets go of the hand for a holder that has fallen silent."""
    if state.holder is not None and now - state.heard > SILENT_S:
        return release(state, state.holder)
    return state


def _hold(state: Ownership, page: int, now: float, wish: Wish) -> Ownership:
    asking = tuple(other for other in state.asking if other != page)
    return evolve(state, holder=page, asking=asking, heard=now, wish=wish, point=None, yaw=0.0)


def _check_holder(state: Ownership, page: int) -> None:
    if page != state.holder:
        raise DecodeError("not-holder", "this page does not hold the hand; take it first")

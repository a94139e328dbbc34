"""Network profiles for a measurement: with keys that live as long as it does, and what they cost alone."""

import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import attrs
import numpy as np

from deploy.bench.report import Json
from shared.codec import encode
from shared.formation import Formation
from shared.messages import ORIGIN, HandSample, Wish
from shared.net.keyring import Keyring, hand_signer, hand_verifier
from shared.nodes import all_nodes
from shared.scenario import Net, Profile, Scenario
from shared.signature import blank

PLAIN: Profile = "laptop"
FIELD: Profile = "field"
_SIGNED = 500


@contextmanager
def in_profile(scenario: Scenario, formation: Formation, profile: str | None) -> Iterator[Scenario]:
    """Puts a scenario into a profile; `field` gets keys of its own unless the scenario names some.

    Args:
        scenario: The scenario.
        formation: Its formation.
        profile: `laptop` or `field`; None leaves it as it is.
    """
    if profile is None:
        yield scenario
    elif profile == PLAIN:
        yield plain(scenario)
    elif scenario.net.keys:
        yield _with_net(scenario, FIELD, scenario.net.keys)
    else:
        with tempfile.TemporaryDirectory() as folder:
            yield _with_net(scenario, FIELD, str(_temporary_keys(Path(folder), formation)))


def plain(scenario: Scenario) -> Scenario:
    """Returns the scenario as it flies on one machine without keys."""
    return _with_net(scenario, PLAIN, keys="")


def signature_cost(net: Net) -> Json:
    """Measures what signing and checking one hand sample takes, medians; empty without keys."""
    sign, verify = hand_signer(net), hand_verifier(net)
    if sign is None or verify is None:
        return {}
    sample = HandSample(
        epoch=1,
        seq=1,
        stamp_ns=1,
        position=ORIGIN,
        velocity=ORIGIN,
        yaw=0.0,
        mode=Wish.FLY,
        signature=blank(),
    )
    payload = encode(sample)
    signed = sign(payload)
    return {"sign_us": _median_us(lambda: sign(payload)), "verify_us": _median_us(lambda: verify(signed))}


def _with_net(scenario: Scenario, profile: Profile, keys: str) -> Scenario:
    return attrs.evolve(scenario, net=attrs.evolve(scenario.net, profile=profile, keys=keys))


def _temporary_keys(folder: Path, formation: Formation) -> Path:
    from deploy.net.authority import create, issue  # noqa: PLC0415  cryptography is an extra

    keyring = Keyring(folder / "keys")
    create(keyring, "bench")
    for node in all_nodes(formation):
        issue(keyring, node)
    return keyring.folder


def _median_us(work: Callable[[], object]) -> float:
    taken = []
    for _ in range(_SIGNED):
        start = time.perf_counter_ns()
        work()
        taken.append(time.perf_counter_ns() - start)
    return float(np.median(taken)) / 1e3

"""Where a node's keys lie: file names only; `deploy.net` makes them, Zenoh and `shared.signature` read them."""

import re
from pathlib import Path

from attrs import frozen

from shared.errors import ConfigError
from shared.scenario import Net
from shared.signature import Sign, Verify, sign_with, verify_with
from shared.toml_text import read_toml

MEMBERS_FILE = "members.toml"
_NODE_NAME = re.compile(r"[a-z]+(/[1-9][0-9]{0,4})?")


@frozen
class Keyring:
    """The files of one directory of keys. A node needs its own pair and what everybody may read, no more.

    Attributes:
        folder: The directory, as `net.keys` of the scenario names it.
    """

    folder: Path

    @property
    def authority(self) -> Path:
        """Certificate of the swarm's own authority; everybody has it."""
        return self.folder / "ca.crt"

    @property
    def authority_key(self) -> Path:
        """The authority's private key; it stays where certificates are issued."""
        return self.folder / "ca.key"

    @property
    def hand_public(self) -> Path:
        """Public key that hand samples are checked with; everybody has it."""
        return self.folder / "hand.pub"

    @property
    def hand_private(self) -> Path:
        """Private key that hand samples are signed with; only the relay has it."""
        return self.folder / "hand.key"

    def certificate(self, node: str) -> Path:
        """Returns the file of a node's certificate; its common name is the node's name."""
        return self.folder / f"{stem(node)}.crt"

    def key(self, node: str) -> Path:
        """Returns the file of a node's private key."""
        return self.folder / f"{stem(node)}.key"

    def members(self) -> tuple[str, ...]:
        """Reads who belongs to the swarm.

        Raises:
            ConfigError: The file is missing or not of this form.
        """
        file = self.folder / MEMBERS_FILE
        members = read_toml(file, "copy it here from where swarmtouch net keys issue was run").get("members")
        if not isinstance(members, list):
            raise ConfigError(f"{file}: no list of members; see swarmtouch net keys issue")
        for member in members:
            # A name becomes part of the keys in the access rules: no wildcard may come in.
            if not (isinstance(member, str) and _NODE_NAME.fullmatch(member)):
                raise ConfigError(f"{file}: {member!r} is no name of a node; for example relay, drone/2")
        return tuple(members)


def stem(node: str) -> str:
    """Returns a node's name as a file name, for example `drone-2`."""
    return node.replace("/", "-")


def require(file: Path, hint: str) -> str:
    """Returns the absolute path of a file that must exist.

    Raises:
        ConfigError: It does not; says what to do.
    """
    if not file.is_file():
        raise ConfigError(f"{file}: missing; {hint}")
    return str(file.resolve())


def hand_signer(net: Net) -> Sign | None:
    """Returns the relay's signer, None for a swarm without keys.

    Raises:
        ConfigError: The key is missing.
    """
    return sign_with(Keyring(Path(net.keys)).hand_private) if net.keys else None


def hand_verifier(net: Net) -> Verify | None:
    """Returns a listener's check of hand samples, None for a swarm without keys.

    Raises:
        ConfigError: The key is missing.
    """
    return verify_with(Keyring(Path(net.keys)).hand_public) if net.keys else None

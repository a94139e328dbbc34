"""Keys of a swarm, and Zenoh's configuration written out for any node."""

FOLDER = "keys"
"""Where keys lie unless somebody says otherwise."""

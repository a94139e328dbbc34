"""Keys of a swarm, and Zenoh's configuration written out for any node."""

"""How a node is configured on the network: one generator for every profile, pure dictionaries for Zenoh."""

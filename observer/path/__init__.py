"""One hand sample on its way through the swarm: hops, their parts, and pictures of them."""

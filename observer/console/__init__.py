"""The live console: a page in the browser that sees the swarm, feels it, and may be its hand."""

PORT = 8460
"""TCP port unless another is chosen."""

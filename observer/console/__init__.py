"""The live console: a page in the browser that sees the swarm, feels it, and may be its hand."""

"""What `swarmtouch trace` does, one module per action."""

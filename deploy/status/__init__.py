"""How a running swarm is: who is there, who is well."""

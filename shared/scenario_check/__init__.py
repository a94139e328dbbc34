"""Whether the values of a scenario go together: what no single value can say about itself."""

"""The vocabulary every process speaks: messages, topics, codec, bus, configuration, formation, clock."""

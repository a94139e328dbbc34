"""The vocabulary every process speaks: messages, topics, codec, bus, configuration, formation, clock."""

from shared.compiled import prefer_compiled

prefer_compiled()

"""Report of a flight: the paper's figures and tables, from any kind of recording."""

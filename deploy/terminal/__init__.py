"""The terminal that commands are typed into: what they print, the keys they take, and the shell around them."""

"""A run and its record: how it is started, what it writes, and how it is resumed from that."""

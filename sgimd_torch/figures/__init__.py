"""What figures share: maps of T, axes, colours and files. Needs matplotlib."""

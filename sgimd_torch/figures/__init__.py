"""Parts of figures: maps of T, axes, colours and files. Needs matplotlib."""

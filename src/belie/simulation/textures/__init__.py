"""Procedural textures: every picture in the simulated world is computed, none is copied."""

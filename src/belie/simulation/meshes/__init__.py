"""Shapes of the simulated world, built from a few primitives."""

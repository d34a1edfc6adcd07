"""The scenes: each module has ``MANOEUVRES`` and ``build(seed=, manoeuvre=, duration_s=) -> World``."""

"""The recordings layer; see ARCHITECTURE.md."""

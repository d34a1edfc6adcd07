"""The attacks layer; see ARCHITECTURE.md."""

"""The evaluation layer; see ARCHITECTURE.md."""

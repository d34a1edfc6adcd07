"""The detector layer; see ARCHITECTURE.md."""

"""The odometry layer; see ARCHITECTURE.md."""

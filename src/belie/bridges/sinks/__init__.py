"""Where answers go; each sink in a thread of its own, so that one that fails or hangs disturbs no other."""

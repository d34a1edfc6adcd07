"""belie: checks what a robot claims against what its camera sees."""

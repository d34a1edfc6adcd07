"""The middlewares, one a file; each imports its library when it is opened."""

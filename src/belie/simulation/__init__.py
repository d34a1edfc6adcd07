"""A small rendered world with sensors: street, corridor, flight and patch, in every weather, with exact labels."""

"""Files: written whole or not at all, locked, checked, and known by what they were made of."""

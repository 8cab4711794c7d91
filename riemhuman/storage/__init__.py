"""What is kept on disk: fingerprints of what it was made of."""

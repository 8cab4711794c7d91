"""Rankings of bodies by distance, and how well they find bodies of the same class."""

from riemhuman.retrieval.scores import RetrievalScores, scores

__all__ = ["RetrievalScores", "scores"]

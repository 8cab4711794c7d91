"""Rankings of bodies by distance, and how well they find bodies of the same class."""

from riemhuman.retrieval.scores import RetrievalScores, scores
from riemhuman.retrieval.tables import TableRow, format_table, retrieval_table

__all__ = ["RetrievalScores", "TableRow", "format_table", "retrieval_table", "scores"]

"""Messages in one line, whatever is in the names that they quote."""

_LONGEST_WORD = 600  # letters; paths may have hundreds


def one_line(text: str) -> str:
    """Return a text in one line, with codes for what could make a terminal do something."""
    return " ".join(_harmless(word) for word in text.split())


def _harmless(word: str) -> str:
    """Return a word with codes for control characters; the middle of a very long one left out."""
    if len(word) > _LONGEST_WORD:
        part = _LONGEST_WORD // 2
        word = f"{word[:part]}…{word[-part:]}"
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in word)

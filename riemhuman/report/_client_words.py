"""Messages of registrations as sentences on a client's page, without names of code or options."""

from __future__ import annotations

import re

# What names functions, arguments or options says nothing to a client.
_CODE = re.compile(r"--\w|\w=|\w\(|\w_\w|[A-Z]\w*[a-z][A-Z]|\w\.\w")


def sentences_of(message: str) -> list[str]:
    """Return what a message of a registration says to a client, as sentences."""
    clauses = [part.replace(" (not trusted)", "").strip() for part in message.split(";")]
    known = dict.fromkeys(clause.rstrip(".") for clause in clauses)
    return [f"{capital(clause)}." for clause in known if clause and not _CODE.search(clause)]


def capital(text: str) -> str:
    """Return a text that begins with a capital."""
    return text[:1].upper() + text[1:]

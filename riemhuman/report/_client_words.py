"""Messages of registrations in the words of a client's page: what happened, and what to do."""

from __future__ import annotations

import re

_EQUAL = re.compile(
    r"(?P<part>[^:]+): (?:.*, and )?two explanations fit almost equally(?:, (?P<how>.*))?"
)
# Parts of messages, and sentences for them; the first that matches counts.
_SENTENCES = (
    ("landmarks decide", "At the next scan, hold the arms away from the body, with open hands."),
    ("fingers are told", "At the next scan, open the hands and hold them away from the body."),
    ("the up direction was guessed", "Which way is up was guessed."),
)
_AMBIGUITIES = (
    ("forearm is turned", "how far the forearm is turned"),
    ("fingers are open or bent", "whether its fingers are open or bent"),
    ("turned or nods", "which way it is turned"),
)
_NO_FIT = re.compile(r"(?P<part>[^:]+): no pose of its fingers fits the scan")
# What names functions, arguments or options says nothing to a client.
_CODE = re.compile(r"--\w|\w=|\w\(|\w_\w|[A-Z]\w*[a-z][A-Z]|\w\.\w")
_SHARE = re.compile(r"(?P<percent>\d+) % of it lie on parts")


def sentences_of(message: str) -> list[str]:
    """Return what a message of a registration says to a client, as sentences."""
    sentences = []
    for clause in message.rstrip(".").split("; "):
        sentence = _sentence(clause.replace(" (not trusted)", "").strip())
        if sentence and sentence not in sentences:
            sentences.append(sentence)
    # What to do comes last.
    return sorted(sentences, key=lambda sentence: sentence.startswith("At the next scan"))


def _sentence(clause: str) -> str:
    for words, sentence in _SENTENCES:
        if words in clause:
            return sentence
    equal = _EQUAL.fullmatch(clause)
    if equal is not None:
        how = next((said for words, said in _AMBIGUITIES if words in (equal["how"] or "")), "")
        part = f"{capital(equal['part'])}: "
        return f"{part}the scan does not show {how}." if how else f"{part}its position is unclear."
    no_fit = _NO_FIT.fullmatch(clause)
    if no_fit is not None:
        return f"{capital(no_fit['part'])}: the fingers could not be told apart."
    return "" if not clause or _CODE.search(clause) else f"{capital(clause)}."


def reason_of(message: str) -> str:
    """Return why a measurement is missing, in the words of a client's page."""
    share = _SHARE.match(message)
    if share is not None:
        return f"{share['percent']} % of its path lies on parts that cannot be trusted"
    return "" if _CODE.search(message) else message


def capital(text: str) -> str:
    """Return a text that begins with a capital."""
    return text[:1].upper() + text[1:]

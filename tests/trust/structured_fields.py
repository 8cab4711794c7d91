"""Numbers, names, types and line ends of files, handed on as they are or changed."""

import numpy as np

EDGES = [0, 1, 2, 3, 127, 128, 255, 256, 32767, 32768, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1]
EDGES += [2**32, 2**53, 2**53 + 1, 2**61, 2**62, 2**63 - 1, 2**63, 2**64 - 1, 2**64, 10**18, 10**30]
REALS = [0.0, -0.0, 1e-320, 1e308, -1e308, 1e50, 1.1e50, 3.5e38, 65504.0, 65520.0, 0.1, 2.0**53]
REALS += [float("nan"), float("inf"), float("-inf"), 1e-8]
SPELLINGS = ["", "1_0", "0x1", "1e400", "nan", "-inf", "+1", "-0", "01", "1.", ".5", "1e", "1.0"]
SPELLINGS += ["\u0661", "\uff11", "1\u2028", "1\x85", "1\x0c", "1\x0b2", "\x00", "1,5", "--1", "a"]
SPELLINGS += ["9" * 30, "9" * 5000, "1e-400", "#1", "1#", "1/2", "1/", "/1", "1//3", "\\", '"', "'"]
DTYPES = ["<f8", ">f8", "<f4", "<f2", "|i1", "|u1", "<i2", ">i4", "<i4", "<u4", "<i8", ">i8", "<u8"]
DTYPES += ["|b1", "<c16", "<U3", "|S3", "<M8[s]", "|O", "<f16", "|V8", "<U0", "|S0", "<m8[ns]"]
LINE_ENDS = ["\n", "\r\n", "\r", "\n\n", "\u2028", "\x85", "\x0c", "\n\r", " ", "", "\\\n", "\x1e"]
NAMES = ["", "x", "y", "vertex", "face", "vertex_index", "corners", "é", "a b", "x" * 300, "ids"]


class Fields:
    """Hands values on as they are, but changes those of a few fields.

    Parameters
    ----------
    rng : random.Random
        What the changes are drawn with.
    changed : set of int
        Numbers of the fields to change, in the order in which they come.
    """

    def __init__(self, rng, changed=frozenset()):
        self.rng, self.changed, self.count = rng, changed, 0

    def _or(self, value, change):
        self.count += 1
        return change() if self.count - 1 in self.changed else value

    def whole(self, value):
        def change():
            if self.rng.choice([True, False]):
                return self.rng.choice(EDGES) * self.rng.choice([1, 1, -1])
            return value + self.rng.choice([-2, -1, 1, 2])

        return self._or(value, change)

    def real(self, value):
        return self._or(value, lambda: self.rng.choice(REALS))

    def word(self, text):
        return self._or(text, lambda: self.rng.choice(SPELLINGS))

    def of(self, value, others):
        return self._or(value, lambda: self.rng.choice(others))

    def line_end(self, text):
        return self.of(text, LINE_ENDS)

    def some(self, items):
        """Drop, double or move an item."""
        items = list(items)

        def change():
            place = self.rng.randrange(len(items)) if items else 0
            how = self.rng.randrange(3)
            if how == 0:
                return items[:place] + items[place + 1 :]
            if how == 1:
                return items[: place + 1] + items[place:]
            return items[place:] + items[:place]

        return self._or(items, change)

    def array(self, array):
        """Change entries, the type or the shape of an array."""
        array = np.asarray(array)

        def change():
            found, how = array.copy(), self.rng.randrange(5)
            if how == 0 and found.size and found.dtype.kind in "fiu":
                edge = self.rng.choice(REALS if found.dtype.kind == "f" else EDGES)
                with np.errstate(all="ignore"):
                    value = np.array(edge % 2**64 if found.dtype.kind != "f" else edge)
                    found.flat[self.rng.randrange(found.size)] = value.astype(found.dtype)
            elif how == 1:
                kinds = [code for code in DTYPES if code != "|O"]
                with np.errstate(all="ignore"):
                    found = _cast(found, self.rng.choice(kinds))
            elif how == 2 and found.ndim:
                found = found[..., : self.rng.randrange(found.shape[-1] + 1)]
            elif how == 3:
                found = found.reshape(
                    self.rng.choice([(-1,), (1, *found.shape), (*found.shape, 1)])
                )
            elif found.ndim > 1:
                found = self.rng.choice([found.T, np.asfortranarray(found), found[::-1]])
            return found

        return self._or(array, change)


def _cast(array, code):
    if array.dtype.kind == "c":
        return array.real
    try:
        return array.astype(code)
    except (TypeError, ValueError):
        return array

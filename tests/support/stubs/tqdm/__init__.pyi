from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager
from typing import Any, Self, TextIO

class tqdm:
    disable: bool
    n: float
    total: float | None
    def __init__(
        self,
        iterable: Iterable[object] | None = None,
        desc: str | None = None,
        total: float | None = None,
        *,
        initial: float = 0,
        disable: bool | None = False,
        unit: str = "it",
        leave: bool | None = True,
        bar_format: str | None = None,
    ) -> None: ...
    def __iter__(self) -> Iterator[Any]: ...
    def __enter__(self) -> Self: ...
    def __exit__(self, *error: object) -> None: ...
    def update(self, n: float | None = 1) -> bool | None: ...
    def close(self) -> None: ...
    def refresh(self) -> bool | None: ...
    def set_postfix_str(self, s: str = "", refresh: bool = True) -> None: ...
    @classmethod
    def external_write_mode(
        cls, file: TextIO | None = None, nolock: bool = False
    ) -> AbstractContextManager[None]: ...

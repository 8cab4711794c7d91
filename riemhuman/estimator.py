"""The base class of estimators, compatible with scikit-learn, which need not be installed."""

from __future__ import annotations

import inspect
from typing import Self

from riemhuman.errors import ArgumentError
from riemhuman.optional import import_optional
from riemhuman.representation import constructor_text


class Estimator:
    """An object whose parameters are the unchanged arguments of its constructor.

    `fit` checks the parameters and stores its results in attributes that end in an underscore.
    """

    def get_params(self, deep: bool = True) -> dict[str, object]:
        """Return the parameters by name."""
        # By name, as in scikit-learn's protocol.
        params = {name: getattr(self, name) for name in inspect.signature(type(self)).parameters}
        if deep:
            for name, value in list(params.items()):
                if hasattr(value, "get_params") and not isinstance(value, type):
                    inner = value.get_params()
                    params |= {f"{name}__{key}": part for key, part in inner.items()}
        return params

    def set_params(self, **params: object) -> Self:
        """Set parameters by name."""
        names = self.get_params(deep=False)
        for key, value in params.items():
            name, _, inner = key.partition("__")
            if name not in names:
                raise ArgumentError(
                    f"{type(self).__name__} has no parameter {name!r}; it has "
                    f"{', '.join(map(repr, names))}"
                )
            if inner:
                getattr(self, name).set_params(**{inner: value})
            else:
                setattr(self, name, value)  # by name, as in scikit-learn's protocol
        return self

    def __repr__(self) -> str:
        return constructor_text(self)

    def __sklearn_tags__(self) -> object:
        """Return the tags that tools of scikit-learn read."""
        utils = import_optional("sklearn.utils", "statistics")
        return utils.Tags(
            estimator_type=None,
            target_tags=utils.TargetTags(required=False),
            transformer_tags=utils.TransformerTags() if hasattr(self, "transform") else None,
        )

    def _require_fit(self, attribute: str) -> None:
        if not hasattr(self, attribute):
            raise ArgumentError(f"{type(self).__name__} must be fitted first, by its method fit")

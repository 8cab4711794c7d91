"""The base class of estimators, compatible with scikit-learn, which need not be installed."""

from __future__ import annotations

import inspect
import sys
from abc import abstractmethod
from typing import Self

import numpy as np
from numpy.typing import NDArray

from riemhuman.arrays import Array
from riemhuman.checks import checked, choice
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


_CONTAINERS = ("default", "pandas", "polars")


class Transformer(Estimator):
    """An estimator with `transform`, whose result may be a data frame, as in scikit-learn."""

    _sklearn_output_config: dict[str, str]  # this name, because `sklearn.clone` copies it

    @abstractmethod
    def _n_outputs(self) -> int:
        """Return the number of columns of a result."""

    @checked(transform=choice(*_CONTAINERS))
    def set_output(self, *, transform: str | None = None) -> Self:
        """Choose what `transform` and `fit_transform` return.

        Parameters
        ----------
        transform : {"default", "pandas", "polars"}, optional
            "default" for arrays; "pandas" or "polars" for data frames. None changes nothing. Before
            the first call, the setting ``transform_output`` of scikit-learn is used.
        """
        if transform is not None:
            self._sklearn_output_config = {"transform": transform}
        return self

    def get_feature_names_out(self, input_features: object = None) -> NDArray[np.object_]:
        """Return the names of the columns of results: the class in lower case, and a number.

        Parameters
        ----------
        input_features : object
            Not used; tools of scikit-learn pass it.
        """
        prefix = type(self).__name__.lower()
        return np.array([f"{prefix}{k}" for k in range(self._n_outputs())], dtype=object)

    def _in_container(self, values: Array, X: object) -> Array:
        """Return a result, or the data frame that was chosen for it, with the index of its data."""
        config = getattr(self, "_sklearn_output_config", None)
        if config is None and "sklearn" in sys.modules:
            config = {"transform": sys.modules["sklearn"].get_config()["transform_output"]}
        container = (config or {}).get("transform", "default")
        if container == "default":
            return values
        package = import_optional(container, "statistics")
        columns = list(self.get_feature_names_out())
        frame: Array  # to type checkers, which know only the default
        if container == "polars":
            frame = package.DataFrame(values, schema=columns, orient="row")
        else:
            index = X.index if isinstance(X, (package.DataFrame, package.Series)) else None
            frame = package.DataFrame(values, index=index, columns=columns)
        return frame

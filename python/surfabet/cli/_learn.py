"""Learning for the command line: which model, and whether it has the options that were given."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, get_args

import surfabet
from surfabet import _core
from surfabet._methods import METHODS
from surfabet._progress import ProgressCallback
from surfabet.cli._learn_options import ModelName
from surfabet.cli._options import UsageError, spelled
from surfabet.files import AnyModel, Vocabulary

_NAMED = (
    ("keep_outliers=True", "keep_outliers", ""),
    ("min_probability=0", "min_probability", " 0"),
    ("min_probability", "min_probability", ""),
    ("min_points", "min_points", ""),
)
"""Options as warnings of Python name them, and the name and value that the command line has."""


@dataclass(frozen=True)
class Learner:
    """Makes a model of a cloud, with options that are known to be right."""

    model: ModelName
    options: dict[str, Any]
    vocabulary: Vocabulary | None

    @classmethod
    def choose(
        cls, model: ModelName | None, options: dict[str, Any], vocabulary: Vocabulary | None
    ) -> Learner:
        """For the model that was asked for, or that the vocabulary is of; patches otherwise.

        Raises
        ------
        UsageError
            For options that the model does not have, or a vocabulary of another model.
        InvalidInputError
            For options outside their range.
        """
        if vocabulary is not None:
            known = next(
                name for name in get_args(ModelName) if METHODS[name].vocabulary is type(vocabulary)
            )
            if model not in (None, known):
                raise UsageError(f"--vocabulary: is of --model {known}, not of {model}")
            model = known
        chosen = model or "patches"
        _check_names(chosen, options, vocabulary is not None)
        _core.check_options(chosen, options)
        return cls(chosen, options, vocabulary)

    def __call__(self, cloud: surfabet.PointCloud, progress: ProgressCallback) -> AnyModel:
        """Learns, or describes the cloud with the vocabulary."""
        learn = METHODS[self.model].learn if self.vocabulary is None else self.vocabulary.describe
        with warnings.catch_warnings(record=True) as caught:
            for category in (surfabet.DroppedPointsWarning, surfabet.IncompleteModelWarning):
                warnings.simplefilter("always", category)
            model = learn(cloud, progress=progress, **self.options)
        for warning in caught:
            message = str(warning.message)
            for given, option, value in _NAMED:
                message = message.replace(given, spelled(option) + value)
            warnings.warn(message, warning.category, stacklevel=2)
        return model


def _check_names(model: ModelName, options: dict[str, Any], has_vocabulary: bool) -> None:
    """Refuses options that the model does not have, naming those that have them."""
    models = {
        name: {spec["name"]: spec["another_scene"] for spec in specs}
        for name, specs in _core.option_specs().items()
    }
    for option in options:
        if option not in models[model]:
            owners = ", ".join(name for name, own in models.items() if option in own)
            raise UsageError(
                f"{spelled(option)}: not an option of --model {model}, but of {owners}"
            )
        if has_vocabulary and not models[model][option]:
            raise UsageError(f"{spelled(option)}: not with --vocabulary, which nothing is added to")

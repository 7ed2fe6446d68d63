"""The options of all methods: refused alike, named as they were given, and the same everywhere."""

from __future__ import annotations

import inspect
import math
import pickle
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import surfabet as sb
from surfabet import _core
from surfabet.cli import main

LEARN = {
    "patches": sb.learn_patches,
    "hscsm": sb.learn_hscsm,
    "alphabet": sb.learn_alphabet,
    "bic-alphabet": sb.learn_bic_alphabet,
    "planes": sb.learn_planes,
    "gas": sb.learn_gas,
}
ANOTHER_SCENE = {
    "hscsm": sb.HscsmDictionary.describe,
    "alphabet": sb.Alphabet.describe,
    "bic-alphabet": sb.BicAlphabet.describe,
    "gas": sb.GasModel.update,
}
SPECS = _core.option_specs()
ALL = [
    pytest.param(model, spec, id=f"{model}-{spec['name']}")
    for model, specs in SPECS.items()
    for spec in specs
]
CLOUD = sb.PointCloud(np.random.default_rng(0).random((50, 3)))


def moved(spec: dict[str, Any], value: float, towards: float) -> Any:
    """The number next to `value`, for options in steps the next step."""
    if spec["kind"] == "int":
        return int(value) + int(towards)
    by = spec["step"] or 1e-9 * max(abs(value), 1.0)
    return value + towards * by


def as_given(spec: dict[str, Any], value: Any) -> Any:
    """As the option takes it."""
    if spec["kind"] == "int" and isinstance(value, float) and math.isfinite(value):
        return int(value)
    return [value] if spec["kind"] == "floats" else value


def outside(spec: dict[str, Any]) -> Iterator[Any]:
    """Values just outside the range."""
    if spec["kind"] == "choice":
        yield "something else"
    if spec["kind"] not in ("int", "float", "floats"):
        return
    low, high = spec["low"], spec["high"]
    yield as_given(spec, moved(spec, low[0], -1) if low[1] else low[0])
    if high is None:
        yield as_given(spec, math.inf)
    elif math.isfinite(high[0]):
        yield as_given(spec, moved(spec, high[0], 1) if high[1] else high[0])
    if spec["kind"] != "int":
        yield as_given(spec, math.nan)
    if spec["step"]:
        yield low[0] + spec["step"] / 2


def inside(spec: dict[str, Any]) -> Iterator[Any]:
    """The values at both ends of the range, and None where it is one."""
    if spec["optional"]:
        yield None
    yield spec["default"]
    if spec["kind"] == "choice":
        yield from spec["choices"]
    elif spec["kind"] == "bool":
        yield from (True, False)
    elif spec["kind"] == "texts":
        yield from ((), ["colors"], ("colors", "intensities"))
    else:
        low, high = spec["low"], spec["high"]
        yield as_given(spec, low[0] if low[1] else moved(spec, low[0], 1))
        if high is not None:
            # Integers have no infinity, but they have 32 bits.
            end = min(high[0], 2.0**32 - 1) if spec["kind"] == "int" else high[0]
            yield as_given(spec, end if high[1] or end < high[0] else moved(spec, end, -1))


def wrong_types(spec: dict[str, Any]) -> Iterator[Any]:
    """Values of types that the option does not take."""
    yield from ("abc", object()) if spec["kind"] != "choice" else (1, object())
    if spec["kind"] != "bool":
        yield True
    if spec["kind"] in ("int", "bool"):
        yield 1.5
    if spec["kind"] != "floats":
        yield [1.0, 2.0]
    if not spec["optional"]:
        yield None


@pytest.mark.parametrize(("model", "spec"), ALL)
def test_what_is_outside_the_range_is_refused(model: str, spec: dict[str, Any]) -> None:
    for value in outside(spec):
        with pytest.raises(sb.InvalidInputError) as caught:
            LEARN[model](CLOUD, **{spec["name"]: value})
        error = caught.value
        assert not isinstance(error, TypeError)
        assert (error.argument, error.requirement) == (spec["name"], spec["requirement"])
        assert str(error) == f"{spec['name']} is {error.value}, but must be {spec['requirement']}"


@pytest.mark.parametrize(("model", "spec"), ALL)
def test_another_type_is_refused(model: str, spec: dict[str, Any]) -> None:
    for value in wrong_types(spec):
        with pytest.raises(sb.InvalidTypeError) as caught:
            LEARN[model](CLOUD, **{spec["name"]: value})
        error = caught.value
        assert isinstance(error, TypeError)
        assert (error.argument, error.requirement) == (spec["name"], spec["requirement"])
        assert str(error) == f"{spec['name']} is {error.value}, but must be {spec['requirement']}"


@pytest.mark.parametrize(("model", "spec"), ALL)
def test_both_ends_of_the_range_are_taken(model: str, spec: dict[str, Any]) -> None:
    for value in inside(spec):
        _core.check_options(model, {spec["name"]: value})


@pytest.mark.parametrize(("model", "spec"), ALL)
def test_numbers_of_numpy_are_numbers(model: str, spec: dict[str, Any]) -> None:
    of_kind = {"int": np.int64, "float": np.float32, "bool": np.bool_, "floats": np.array}
    if spec["kind"] in of_kind and spec["default"] is not None:
        _core.check_options(model, {spec["name"]: of_kind[spec["kind"]](spec["default"])})


@pytest.mark.parametrize("model", LEARN)
def test_signatures_have_the_options_with_their_defaults(model: str) -> None:
    parameters = inspect.signature(LEARN[model]).parameters
    keywords = [p for p in parameters.values() if p.kind is p.KEYWORD_ONLY]
    defaults = {p.name: p.default for p in keywords if p.name not in ("weights", "progress")}
    expected = {spec["name"]: spec["default"] for spec in SPECS[model]}
    given = {k: list(v) if isinstance(v, tuple) else v for k, v in defaults.items()}
    assert given == expected
    assert list(given) == list(expected)
    with pytest.raises(TypeError, match="colour_step"):
        LEARN[model](CLOUD, colour_step=3)


@pytest.mark.parametrize("model", ANOTHER_SCENE)
def test_another_scene_takes_the_options_that_apply(model: str) -> None:
    parameters = inspect.signature(ANOTHER_SCENE[model]).parameters
    keywords = [p.name for p in parameters.values() if p.kind is p.KEYWORD_ONLY]
    expected = [spec["name"] for spec in SPECS[model] if spec["another_scene"]]
    assert keywords == [*expected, "progress"]


def test_an_error_names_what_was_given() -> None:
    with pytest.raises(ValueError, match="rate is 0, but must be a positive number of squared pix"):
        sb.learn_patches(CLOUD, rate=0)
    with pytest.raises(TypeError, match="resolution is 'abc', but must be a number from 1"):
        sb.learn_patches(CLOUD, resolution="abc")  # type: ignore[arg-type]
    with pytest.raises(sb.InvalidInputError, match=r"iterations is \d+, but must be an integer"):
        sb.learn_hscsm(CLOUD, iterations=10**100)
    with pytest.raises(sb.InvalidInputError, match="sensor is 'lidar', but must be 'structured-l"):
        sb.learn_hscsm(CLOUD, sensor="lidar")  # type: ignore[arg-type]
    with pytest.raises(sb.InvalidInputError, match="random_state is -1, but must be an integer fr"):
        sb.learn_gas(CLOUD, random_state=-1)


def test_errors_survive_another_process() -> None:
    with pytest.raises(sb.InvalidTypeError) as caught:
        sb.learn_planes(CLOUD, min_probability="low")  # type: ignore[arg-type]
    again = pickle.loads(pickle.dumps(caught.value))
    assert type(again) is sb.InvalidTypeError
    assert (again.argument, again.value) == ("min_probability", "'low'")
    assert str(again) == str(caught.value)


@pytest.mark.parametrize(("model", "spec"), ALL)
def test_the_command_line_names_options_as_they_were_given(
    model: str, spec: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    option = "--" + spec["name"].replace("_", "-")
    for value in outside(spec):
        text = value[0] if isinstance(value, list) else value
        command = ["compress", "none.ply", "none.sfb", "--model", model, f"{option}={text}"]
        assert main(command) == 2
        told = capsys.readouterr().err
        if spec["kind"] == "choice":
            assert option in told
        else:
            assert told.startswith(f"surfabet: error: {option} is ")
            assert told.endswith(f", but must be {spec['requirement']}\n")


@pytest.mark.parametrize(("model", "spec"), ALL)
def test_half_an_integer_is_none_on_the_command_line_either(
    model: str, spec: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    if spec["kind"] != "int":
        return
    option = "--" + spec["name"].replace("_", "-")
    for text in ("1.5", "2.0", "many"):
        assert main(["compress", "none.ply", "none.sfb", "--model", model, option, text]) == 2
        told = capsys.readouterr().err
        assert told.startswith(
            f'surfabet: error: Invalid value for {option}: "{text}" is no integer.'
        )


def refused_option(model: str, cloud: sb.PointCloud, **options: Any) -> str | None:
    """The option that learning refuses; None where it takes them."""
    refused = None
    try:
        LEARN[model](cloud, **options)
    except sb.InvalidInputError as error:
        refused = error
    if refused is None:
        return None
    assert str(refused).startswith(f"{refused.argument} is {refused.value}, but must be ")
    assert len(str(refused)) < 200
    return refused.argument


LENGTHS = [
    pytest.param(model, spec, id=f"{model}-{spec['name']}")
    for model, specs in SPECS.items()
    for spec in specs
    if spec["unit"] == "metres"
]


@pytest.mark.parametrize(("model", "spec"), LENGTHS)
def test_lengths_at_the_ends_of_their_range_work_or_are_refused_by_name(
    model: str, spec: dict[str, Any]
) -> None:
    names = {of["name"] for of in SPECS[model]}
    for value in (spec["low"][0], spec["high"][0]):
        assert refused_option(model, CLOUD, **{spec["name"]: value}) in names | {None}
    for value in (5e-324, 1e300, -1e300):
        if value < spec["low"][0] or value > spec["high"][0]:
            assert refused_option(model, CLOUD, **{spec["name"]: value}) == spec["name"]


@pytest.mark.parametrize("model", LEARN)
@pytest.mark.parametrize("scale", [1e-30, 1e-12, 1e-6, 1e6, 1e12, 1e30, 1e37])
def test_clouds_of_another_unit_work_or_are_refused_by_an_option(model: str, scale: float) -> None:
    cloud = sb.PointCloud(CLOUD.points * scale)
    assert refused_option(model, cloud) in {of["name"] for of in SPECS[model]} | {None}


def test_help_has_every_option(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compress", "--help"]) == 0
    told = capsys.readouterr().out
    for specs in SPECS.values():
        for spec in specs:
            assert "--" + spec["name"].replace("_", "-") in told

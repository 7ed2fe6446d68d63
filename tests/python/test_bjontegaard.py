"""The rate differences of `benches/peers/bjontegaard.py` on curves whose difference is known."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

pytest.importorskip("scipy")

SCRIPT = Path(__file__).resolve().parents[2] / "benches" / "peers" / "bjontegaard.py"
CURVE = [(4.4, 153_108), (5.5, 43_965), (7.1, 18_000), (9.0, 10_366)]


@pytest.fixture(scope="module")
def bd() -> ModuleType:
    spec = importlib.util.spec_from_file_location("bjontegaard", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("factor", [0.25, 0.6, 1.0, 3.0])
@pytest.mark.parametrize("straight", [False, True])
def test_a_constant_factor_is_the_rate(bd: ModuleType, factor: float, straight: bool) -> None:
    tested = [(error, factor * n) for error, n in CURVE]
    rate, over = bd.bd_rate(CURVE, tested, straight=straight)
    assert rate == pytest.approx(factor - 1, abs=1e-12)
    assert over == pytest.approx((4.4, 9.0))


def test_a_constant_factor_is_the_rate_over_a_part(bd: ModuleType) -> None:
    tested = [(error, 0.7 * n) for error, n in CURVE]
    rate, over = bd.bd_rate(CURVE, tested, (5.0, 100.0))
    assert rate == pytest.approx(-0.3, abs=1e-12)
    assert over == pytest.approx((5.0, 9.0))


@pytest.mark.parametrize("straight", [False, True])
def test_power_laws_are_integrated_exactly(bd: ModuleType, straight: bool) -> None:
    # Log bytes are straight over quality: n = error^-2 and n = error^-3 differ by error^-1, of
    # which the geometric mean over 2 to 8, even in the logarithm, is 1 / 4.
    errors = np.geomspace(2, 8, 6)
    square = [(e, 1e6 * e**-2) for e in errors]
    cube = [(e, 1e6 * e**-3) for e in np.geomspace(1, 8, 5)]
    rate, over = bd.bd_rate(square, cube, straight=straight)
    assert rate == pytest.approx(1 / 4 - 1, abs=1e-12)
    assert over == pytest.approx((2, 8))


def test_exchanged_curves_have_the_inverse_rate(bd: ModuleType) -> None:
    other = [(4.0, 90_000), (6.0, 20_000), (8.5, 9_000)]
    there, _ = bd.bd_rate(CURVE, other)
    back, _ = bd.bd_rate(other, CURVE)
    assert (1 + there) * (1 + back) == pytest.approx(1, abs=1e-12)


def test_curves_pass_through_their_points_and_end_there(bd: ModuleType) -> None:
    for error, n in CURVE:
        assert bd.bytes_at(CURVE, error) == pytest.approx(n)
    assert math.isnan(bd.bytes_at(CURVE, 4.3))


def test_a_straight_curve_is_the_chord(bd: ModuleType) -> None:
    # The middle of two points in the logarithms of both.
    middle = math.sqrt(5.5 * 7.1)
    assert bd.bytes_at(CURVE, middle, straight=True) == pytest.approx(math.sqrt(43_965 * 18_000))


def test_nothing_in_common_is_refused(bd: ModuleType) -> None:
    with pytest.raises(ValueError, match="in common"):
        bd.bd_rate(CURVE, [(10.0, 5_000), (12.0, 3_000)])
    with pytest.raises(ValueError, match="in common"):
        bd.bd_rate(CURVE, CURVE, (1.0, 4.0))


def test_a_curve_that_is_not_monotone_is_refused(bd: ModuleType) -> None:
    with pytest.raises(ValueError, match="lower hull"):
        bd.bd_rate(CURVE, [*CURVE, (5.0, 200_000)])


def test_lower_hull_keeps_what_nothing_beats(bd: ModuleType) -> None:
    beaten = [(6.0, 60_000), (9.5, 10_366), (9.0, 11_000), (20.0, 10_400)]
    # On the straight line of the logarithms between the first two, and a little above it.
    between = math.sqrt(4.4 * 5.5), 1.01 * math.sqrt(153_108 * 43_965)
    assert bd.lower_hull([*beaten, *reversed(CURVE), between]) == CURVE
    assert bd.lower_hull(CURVE) == CURVE

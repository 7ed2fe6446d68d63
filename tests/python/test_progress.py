"""What `progress=` accepts."""

from __future__ import annotations

import builtins
from typing import Any

import pytest

import surfabet as sb
from surfabet import datasets, sparse
from surfabet._progress import progress_callback


@pytest.mark.parametrize("progress", [None, False])
def test_silent(progress: bool | None, capsys: pytest.CaptureFixture[str]) -> None:
    with progress_callback(progress) as callback:
        assert callback is None
    assert capsys.readouterr() == ("", "")


def test_callable_is_passed_through() -> None:
    seen: list[tuple[str, float]] = []
    with progress_callback(lambda stage, fraction: seen.append((stage, fraction))) as callback:
        assert callback is not None
        callback("read", 0.5)
    assert seen == [("read", 0.5)]


def test_other_things_are_refused() -> None:
    with pytest.raises(TypeError, match="must be None, True or a callable"), progress_callback(1.5):  # type: ignore[arg-type]
        pass


def test_true_is_taken_by_every_function(capsys: pytest.CaptureFixture[str]) -> None:
    scan = datasets.simulated_room(n_poses=1, progress=True)
    cloud = sb.voxel_downsample(scan.cloud, 0.1, progress=True)
    sb.estimate_normals(cloud, progress=True)
    sb.evaluate(cloud, cloud, progress=True)
    sparse.ksvd([[1.0, 2.0], [2.0, 1.0]], n_atoms=1, max_atoms=1, progress=True)
    assert capsys.readouterr().out == ""


def test_bar_goes_to_stderr_only(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_callback(True) as callback:
        assert callback is not None
        callback("read", 0.0)
        callback("learn", 0.5)
    assert capsys.readouterr().out == ""


def test_without_rich_each_stage_is_a_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    real = builtins.__import__

    def without_rich(name: str, *args: Any, **kwargs: Any) -> Any:
        if name.startswith("rich"):
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without_rich)
    with progress_callback(True) as callback:
        assert callback is not None
        for fraction in (0.0, 0.5, 1.0):
            callback("read", fraction)
        callback("learn", 0.0)
    captured = capsys.readouterr()
    assert captured.err.splitlines() == ["read", "learn"]
    assert captured.out == ""


def test_an_exception_passes_through() -> None:
    with pytest.raises(KeyboardInterrupt), progress_callback(True):
        raise KeyboardInterrupt

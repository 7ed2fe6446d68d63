"""The command line: what it prints where, its exit codes, and that nothing half written stays."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surfabet as sb
from surfabet.cli import main
from surfabet.cli._format import unequal_texts

VERBS = ["compress", "decompress", "info", "evaluate", "compare", "verify", "convert"]


@pytest.fixture(scope="module")
def cloud() -> sb.PointCloud:
    """Two coloured walls and a floor, 2 m long, sampled at 1 cm with 1 mm of noise."""
    random = np.random.default_rng(0)
    u, v = (side.ravel() for side in np.meshgrid(np.arange(0, 2, 0.01), np.arange(0, 2, 0.01)))
    zero = np.zeros_like(u)
    points = np.concatenate([np.stack(p, 1) for p in ((u, v, zero), (zero, u, v), (u, zero, v))])
    colors = np.clip(points * 100 + 20, 0, 255).astype(np.uint8)
    return sb.PointCloud(points + random.normal(0, 0.001, points.shape), colors=colors)


@pytest.fixture(scope="module")
def ply(cloud: sb.PointCloud, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("clouds") / "corner.ply"
    sb.write(path, cloud)
    return path


@pytest.fixture(scope="module")
def sfb(ply: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("models") / "corner.sfb"
    assert main(["compress", str(ply), str(path), "--resolution", "0.02", "--quiet"]) == 0
    return path


def parsed(capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    captured = capsys.readouterr()
    assert captured.err == ""
    value = json.loads(captured.out)
    assert isinstance(value, dict)
    return value


def error_line(capsys: pytest.CaptureFixture[str]) -> str:
    """The error message, which must be one line on stderr with nothing on stdout."""
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("surfabet: error: ")
    assert captured.err.count("\n") == 1
    return captured.err


@pytest.mark.parametrize("verb", VERBS)
def test_help_shows_an_example(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([verb, "--help"]) == 0
    captured = capsys.readouterr()
    assert f"surfabet {verb} " in captured.out
    assert captured.err == ""


def test_help_names_every_verb(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    out = capsys.readouterr().out
    assert all(verb in out for verb in VERBS)


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"{sb.__version__}\n"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["compres"], "compress"),
        (["compress", "a.ply"], "OUT"),
        (["compress", "a.ply", "b.sfb", "--model", "cubes"], "planes"),
        (
            ["compress", "a.ply", "b.sfb", "--resolution", "0"],
            "--resolution is 0, but must be a num",
        ),
        (["compress", "a.ply", "b.sfb", "--max-error=-1"], "--max-error is -1, but must be a num"),
        (["compress", "a.ply", "b.sfb", "--n-neurons", "9"], "not an option of --model patches"),
        (["compress", "a.ply", "b.sfb", "--random-state", "1"], "but of hscsm, bic-alphabet, plan"),
        (["compress", "a.ply", "b.sfb", "--resolution", "fine"], "float"),
        (["compress", "a.ply", "b.sfb", "--colour"], "--colour"),
        (["compress", "a.ply", "b.ply"], ".sfb"),
        (["convert", "a.ply", "b.docx"], ".ply"),
        (["convert", "a.ply", "no/such/folder/b.ply"], "no folder"),
        (["info", "a.sfb", "--threads", "0"], ">= 1"),
    ],
)
def test_usage_errors(arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    assert said in error_line(capsys)


def test_output_must_not_be_the_input(ply: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = ply.read_bytes()
    assert main(["convert", str(ply), str(ply)]) == 2
    assert "input" in error_line(capsys)
    assert ply.read_bytes() == before


def test_folder_options_need_a_folder(ply: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = str(ply.with_suffix(".pcd"))
    assert main(["convert", str(ply), output, "--depth-max", "3"]) == 2
    assert "--depth-max" in error_line(capsys)


def test_missing_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["convert", str(tmp_path / "nothing.ply"), str(tmp_path / "out.ply")]) == 1
    assert "nothing.ply" in error_line(capsys)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("verb", ["info", "decompress"])
@pytest.mark.parametrize("content", [b"", b"SFB", b"ply\nformat ascii 1.0\n" * 20])
def test_not_a_model(
    verb: str, content: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = tmp_path / "wrong.sfb"
    wrong.write_bytes(content)
    output = [str(tmp_path / "out.ply")] if verb == "decompress" else []
    assert main([verb, str(wrong), *output]) == 1
    error_line(capsys)
    assert list(tmp_path.iterdir()) == [wrong]


def test_truncated_model(sfb: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cut = tmp_path / "cut.sfb"
    cut.write_bytes(sfb.read_bytes()[:-1])
    assert main(["decompress", str(cut), str(tmp_path / "out.ply")]) == 1
    error_line(capsys)
    assert list(tmp_path.iterdir()) == [cut]


def test_debug_shows_the_traceback(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = tmp_path / "wrong.ply"
    wrong.write_bytes(b"no cloud")
    assert main(["convert", str(wrong), str(tmp_path / "out.ply"), "--debug"]) == 1
    assert "Traceback" in capsys.readouterr().err


def test_convert_keeps_points_and_colors(
    ply: Path, cloud: sb.PointCloud, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "corner.npz"
    assert main(["convert", str(ply), str(output), "--json"]) == 0
    said = parsed(capsys)["output"]
    assert said["points"] == len(cloud)
    assert said["bytes"] == output.stat().st_size
    again = sb.read(output)
    np.testing.assert_allclose(again.points, cloud.points, atol=1e-6)
    np.testing.assert_array_equal(again.colors, cloud.colors)


def test_convert_says_what_is_lost(
    ply: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["convert", str(ply), str(tmp_path / "corner.ply"), "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    index = np.zeros(3, np.uint32)
    cloud = sb.PointCloud(np.eye(3), viewpoints=np.zeros((1, 3)), viewpoint_index=index)
    sb.write(tmp_path / "seen.npz", cloud)
    assert main(["convert", str(tmp_path / "seen.npz"), str(tmp_path / "seen.las"), "-q"]) == 0
    captured = capsys.readouterr()
    assert captured.err.startswith("surfabet: warning: ")
    assert "viewpoints" in captured.err


def test_evaluate_of_a_shifted_cloud(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    grid = np.stack(np.meshgrid(*[np.arange(5.0)] * 3), -1).reshape(-1, 3)
    sb.write(tmp_path / "a.ply", sb.PointCloud(grid))
    sb.write(tmp_path / "b.ply", sb.PointCloud(grid + np.array([0, 0, 0.25])))
    command = ["evaluate", str(tmp_path / "a.ply"), str(tmp_path / "b.ply"), "--sigma", "0.1"]
    assert main([*command, "--json"]) == 0
    said = parsed(capsys)
    for name in ("rmse_forward", "rmse_backward", "rmse", "rmse_pooled"):
        assert said[name] == pytest.approx(0.25, rel=1e-6)
    assert said["inliers"] == 0
    assert said["outliers"] == 1
    assert main(command) == 0
    assert "250 mm" in capsys.readouterr().out


def test_compress_says_what_it_did(
    ply: Path, cloud: sb.PointCloud, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "corner.sfb"
    command = ["compress", str(ply), str(output), "--resolution", "0.02"]
    assert main([*command, "--json"]) == 0
    said = parsed(capsys)
    n_bytes = output.stat().st_size
    assert said["input"]["points"] == len(cloud)
    assert said["input"]["raw_bytes"] == 15 * len(cloud)
    assert said["output"]["bytes"] == n_bytes
    assert said["ratio"] == pytest.approx(15 * len(cloud) / n_bytes)
    again = sb.evaluate(cloud, sb.load(output).decode(as_measured=True))
    assert said["quality"]["rmse"] == pytest.approx(again.rmse)

    assert main(command) == 0
    line = capsys.readouterr().out
    assert line.count("\n") == 1
    for word in ("points", "ratio", "rmse", " s\n"):
        assert word in line

    assert main([*command, "--no-evaluate"]) == 0
    assert "rmse" not in capsys.readouterr().out
    assert main([*command, "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    assert list(tmp_path.iterdir()) == [output]


def test_same_bytes_for_any_number_of_threads(ply: Path, sfb: Path, tmp_path: Path) -> None:
    output = tmp_path / "corner.sfb"
    command = ["compress", str(ply), str(output), "--resolution", "0.02", "--no-evaluate", "-q"]
    try:
        for threads in ("1", "3"):
            assert main([*command, "--threads", threads]) == 0
            assert output.read_bytes() == sfb.read_bytes()
    finally:
        sb.set_num_threads(None)


def test_decompress(sfb: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    coarse, fine = tmp_path / "coarse.ply", tmp_path / "fine.ply"
    assert main(["decompress", str(sfb), str(coarse), "--json"]) == 0
    n_coarse = parsed(capsys)["output"]["points"]
    assert n_coarse == len(sb.read(coarse)) == len(sb.load(sfb).decode())
    assert main(["decompress", str(sfb), str(fine), "--resolution", "0.005", "--json"]) == 0
    assert parsed(capsys)["output"]["points"] > 2 * n_coarse


def test_info_accounts_for_every_byte(sfb: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(sfb), "--json"]) == 0
    said = parsed(capsys)
    assert said["method"] == "patches"
    assert said["bytes"] == sfb.stat().st_size
    assert 0 < sum(said["sections"].values()) <= said["bytes"]
    assert main(["info", str(sfb)]) == 0
    out = capsys.readouterr().out
    assert all(name in out for name in said["sections"])


def test_info_says_in_words_what_a_model_holds(
    sfb: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    decoded = sb.load(sfb).decode()
    assert decoded.bounds is not None
    assert main(["info", str(sfb), "--json"]) == 0
    said = parsed(capsys)
    assert said["bounds"] == [list(side) for side in decoded.bounds]
    assert (said["decoded_points"], said["attributes"]) == (len(decoded), ["colors"])
    assert main(["info", str(sfb)]) == 0
    out = capsys.readouterr().out
    assert f"It holds {said['holds']}." in out
    assert "Kept: positions, colors, the thickness of the scan." in out
    x_low, x_high = (side[0] for side in decoded.bounds)
    assert f"x {x_low:.3f} to {x_high:.3f}" in out
    # The command that is named does what it says.
    command = next(line for line in out.splitlines() if line.startswith("Decode: "))
    assert f"surfabet decompress {sfb} out.ply ({len(decoded):,} points" in command


def test_info_of_a_large_model_leaves_its_box_out(
    sfb: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("surfabet.cli.info.MOST_POINTS", 10)
    assert main(["info", str(sfb), "--json"]) == 0
    said = parsed(capsys)
    assert "bounds" not in said
    assert said["info"]["patches"] > 0
    assert main(["info", str(sfb)]) == 0
    assert "more than 10 points" in capsys.readouterr().out


def test_evaluate_writes_one_page(
    ply: Path, sfb: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "corner.html"
    assert main(["evaluate", str(ply), str(sfb), "--html", str(page)]) == 0
    rows = [line.split("  ")[0] for line in capsys.readouterr().out.splitlines()]
    text = page.read_text("utf-8")
    assert text.count('src="data:image/webp') == 4
    assert text.count("src=") == 4
    assert all(f"<td>{name.strip()}</td>" in text for name in rows if name.startswith("rmse"))
    assert list(tmp_path.iterdir()) == [page]
    assert main(["evaluate", str(ply), str(sfb), "--html", "corner.pdf"]) == 2
    assert ".html" in error_line(capsys)


def test_evaluate_of_a_model_counts_its_bytes_and_draws(
    ply: Path, sfb: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "corner.png"
    assert main(["evaluate", str(ply), str(sfb), "--picture", str(picture), "--json"]) == 0
    assert parsed(capsys)["bytes"] == sfb.stat().st_size
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert list(tmp_path.iterdir()) == [picture]


def test_evaluate_takes_the_dictionary_that_a_model_needs(
    ply: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = tmp_path / "first.sfb", tmp_path / "second.sfb"
    quiet, words = ["--no-evaluate", "--quiet"], ["--vocabulary", str(first)]
    model = ["--model", "hscsm", "--resolution", "0.05"]
    assert main(["compress", str(ply), str(first), *model, *quiet]) == 0
    assert main(["compress", str(ply), str(second), *words, *quiet]) == 0
    assert main(["evaluate", str(ply), str(second), "--json"]) == 2
    assert "--vocabulary" in capsys.readouterr().err
    command = ["evaluate", str(ply), str(second), *words, "--json"]
    assert main(command) == 0
    assert parsed(capsys)["bytes"] == second.stat().st_size


def start_compress(
    ply: Path, output: Path, resolution: str, on_interrupt: signal.Handlers
) -> subprocess.Popen[str]:
    """Starts `surfabet compress` as a shell does in the foreground (`SIG_DFL`) or with `&` and
    after `trap '' INT` (`SIG_IGN`), however the tests themselves were started."""
    code = (
        "import sys; from surfabet.cli import main; print('ready', flush=True)\n"
        "sys.exit(main(sys.argv[1:]))"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, "compress", str(ply), str(output), "--resolution", resolution],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, on_interrupt),
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


def test_interrupt_leaves_nothing_behind(ply: Path, tmp_path: Path) -> None:
    # At this resolution the work takes minutes; wherever in it the interrupt comes, it ends alike.
    process = start_compress(ply, tmp_path / "out.sfb", "0.0005", signal.SIG_DFL)
    time.sleep(1)
    assert process.poll() is None
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err == "surfabet: interrupted\n"
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_while_modules_are_imported_ends_alike() -> None:
    code = (
        "import sys; from surfabet.cli import main\n"
        "class Interrupt:\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name == 'surfabet.cli._app': raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Interrupt())\n"
        "sys.exit(main(['--version']))"
    )
    command = [sys.executable, "-c", code]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (process.returncode, process.stderr) == (130, "surfabet: interrupted\n")


@pytest.mark.parametrize("start", ["-m surfabet", "-m surfabet.cli", "script"])
@pytest.mark.parametrize("on_interrupt", [signal.SIG_DFL, signal.SIG_IGN])
def test_an_interrupt_while_the_package_is_imported_ends_alike(
    start: str, on_interrupt: signal.Handlers, tmp_path: Path
) -> None:
    # The interpreter imports this before anything else.
    (tmp_path / "sitecustomize.py").write_text(
        "import os, signal, sys\n"
        "class Interrupt:\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name == 'surfabet.planes': os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupt())\n"
    )
    script = tmp_path / "surfabet"
    script.write_text("import sys; from surfabet.cli import main; sys.exit(main())")
    words = [str(script)] if start == "script" else start.split()
    package = str(Path(sb.__file__).parent.parent)
    process = subprocess.run(
        [sys.executable, *words, "--version"],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), package])},
        preexec_fn=lambda: signal.signal(signal.SIGINT, on_interrupt),
    )
    if on_interrupt is signal.SIG_IGN:
        assert (process.returncode, process.stderr) == (0, "")
    else:
        assert (process.returncode, process.stderr) == (130, "surfabet: interrupted\n")


def test_an_interrupt_while_a_program_imports_the_package_is_its_own() -> None:
    code = "import signal, surfabet; print(signal.getsignal(signal.SIGINT).__name__)"
    process = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert process.stdout == "default_int_handler\n"


def test_an_interrupt_that_the_parent_ignores_is_ignored(ply: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.sfb"
    process = start_compress(ply, output, "0.05", signal.SIG_IGN)
    interrupts = 0
    while process.poll() is None:
        process.send_signal(signal.SIGINT)
        interrupts += 1
        time.sleep(0.02)
    _, err = process.communicate()
    assert interrupts > 1
    assert (process.returncode, "interrupted" in err) == (0, False)
    assert len(sb.load(output).decode()) > 0


@pytest.mark.parametrize("verb", ["convert", "info", "info --json"])
@pytest.mark.parametrize("output", ["closed", "left"])
def test_a_job_that_is_done_needs_no_reader(
    verb: str, output: str, ply: Path, sfb: Path, tmp_path: Path
) -> None:
    """Without stdout, as by `>&-`, and with a reader that has left, as `head` does."""
    files = [str(ply), str(tmp_path / "c.ply")] if verb == "convert" else [str(sfb)]
    reading, writing = os.pipe()
    os.close(reading)
    # Where each line goes out by itself, verbs get to know while they print.
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with os.fdopen(writing, "w") as left:
        process = subprocess.run(
            [sys.executable, "-m", "surfabet.cli", *verb.split(), *files],
            stdout=left,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            env=buffered,
            preexec_fn=(lambda: os.close(1)) if output == "closed" else None,
        )
    assert (process.returncode, process.stderr) == (0, "")


def test_output_that_is_cut_off_in_its_middle_is_told_by_the_code_alone(tmp_path: Path) -> None:
    """More than fits into buffers: the process gets to know while it prints."""
    code = (
        "import sys; from surfabet.cli import _app\n"
        "def long(): print('x' * 1_000_000)\n"
        "_app.app.command(long); sys.exit(_app.run(['long']))"
    )
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as left:
        process = subprocess.run(
            [sys.executable, "-c", code], stdout=left, stderr=subprocess.PIPE, check=False
        )
    assert (process.returncode, process.stderr) == (141, b"")


def test_missing_extra_is_one_line() -> None:
    code = (
        "import sys; sys.modules['cyclopts'] = None\n"
        "from surfabet.cli import main; sys.exit(main(['--version']))"
    )
    process = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert process.returncode == 1
    assert process.stdout == ""
    assert "pip install 'surfabet[cli]'" in process.stderr
    assert process.stderr.count("\n") == 1


def test_models_and_clouds_in_each_others_place_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud, model = tmp_path / "room.ply", tmp_path / "room.sfb"
    sb.write(cloud, sb.PointCloud([[0, 0, 0], [1, 0, 0]]))
    model.write_bytes((Path(__file__).parents[1] / "golden" / "patches_0_1.sfb").read_bytes())
    renamed = tmp_path / "renamed.ply"
    renamed.write_bytes(model.read_bytes())
    out = str(tmp_path / "out.ply")
    assert main(["decompress", str(cloud), out]) == 2
    assert "room.ply: is a cloud (ply), not a model; surfabet compress" in capsys.readouterr().err
    assert main(["decompress", str(tmp_path), out]) == 2
    assert "is a folder; name a model file (.sfb)" in capsys.readouterr().err
    for path in (model, renamed):
        assert main(["compress", str(path), str(tmp_path / "out.sfb")]) == 2
        assert f"{path}: is a model, not a cloud" in capsys.readouterr().err
    # A model is known by its first bytes.
    assert main(["decompress", str(renamed), out]) == 0


def test_bounds_and_spacings_are_finite(
    ply: Path, sfb: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for value in ("inf", "nan", "0", "-1"):
        assert main(["verify", str(ply), str(sfb), "--max-error", value]) == 2
        assert "--max-error" in capsys.readouterr().err


def test_a_box_without_points_gives_no_file(
    sfb: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "part.ply"
    arguments = ["decompress", str(sfb), str(path), "--box", "9", "9", "9", "10", "10", "10"]
    assert main(arguments) == 2
    assert "--box 9 9 9 10 10 10: no point of" in capsys.readouterr().err
    assert not path.exists()
    assert main([*arguments[:-6], "0", "0", "-1", "1", "1", "1", "--quiet"]) == 0
    assert len(sb.read(path)) > 0


@pytest.mark.parametrize(
    "verb", ["info", "decompress", "evaluate", "locate", "verify", "compress", "export"]
)
def test_missing_files_are_named_in_the_same_words(
    verb: str, ply: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out").mkdir()
    missing = str(tmp_path / ("a.ply" if verb == "compress" else "a.sfb"))
    others = {
        "info": [missing],
        "decompress": [missing, str(tmp_path / "out" / "b.ply")],
        "evaluate": [str(ply), missing],
        "locate": [missing, str(ply)],
        "verify": [str(ply), missing],
        "compress": [missing, str(tmp_path / "out" / "b.sfb")],
        "export": [missing, str(tmp_path / "out" / "b.ply")],
    }
    assert main([verb, *others[verb]]) == 1
    assert capsys.readouterr().err == f"surfabet: error: {missing}: No such file or directory\n"


def test_lengths_that_differ_are_shown_apart() -> None:
    assert unequal_texts(0.05, 0.05) == ("50 mm", "50 mm")
    assert unequal_texts(0.0123, 0.05) == ("12.3 mm", "50 mm")
    assert unequal_texts(0.0500001, 0.05) == ("50.0001 mm", "50 mm")
    assert unequal_texts(1.0000000001, 1.0) == ("1.0000000001 m", "1 m")

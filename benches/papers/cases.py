"""Small files as other tools write them, each with its right answer: what surfabet makes of them.

    python benches/papers/cases.py --cases DIR                        a table of verdicts
    python benches/papers/cases.py --cases DIR --json before.json     and their record
    python benches/papers/cases.py --cases DIR --before before.json   beside an earlier state

DIR has a folder per situation. The checks are those of its README: `right` is the right answer,
`refused` an error that says so in a line, `wrong` everything else: another answer, or the right one
without the word that belongs to it, or a traceback. Run with an earlier state of the code, `--json`
makes the column "before".
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import re
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import surfabet as sb
from surfabet.cli import main as command_line

UTM = (500_000.0, 5_400_000.0, 100.0)
# The room of the README: bounds, colours, intensities.
ROOM = np.array([[-0.006, -0.006, -0.006], [3.998, 2.999, 2.499]])
COLOR, FIRST_COLOR, INTENSITY = (140.5, 136.9, 132.6), (159, 121, 85), 0.536
WIDEST = 150
"""Letters of a warning or an error in the table."""
ERRORS = (sb.FormatError, sb.InvalidInputError, sb.MissingDependencyError)


@dataclass
class Answer:
    """What came of a case, and which of its checks failed."""

    path: Path
    cloud: Any = None
    said: str = ""
    error: str = ""
    crashed: bool = False
    notes: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)

    def check(self, what: str, right: Any) -> None:
        """Takes note of a check that failed."""
        if not right:
            self.failed.append(what)

    def says(self, pattern: str) -> bool:
        """Whether the warnings match, whatever the case of letters."""
        return re.search(pattern, self.said, re.IGNORECASE) is not None

    @property
    def attributes(self) -> list[str]:
        """Names of all columns of the cloud but its coordinates."""
        known = getattr(self.cloud, "attributes", None)
        if known is None:
            names = ("colors", "intensities", "normals", "ranges", "viewpoints")
            known = [name for name in names if getattr(self.cloud, name, None) is not None]
        return list(known)

    @property
    def verdict(self) -> str:
        """`right`, `refused` or `wrong`."""
        if self.error:
            return "wrong" if self.crashed else "refused"
        return "wrong" if self.failed else "right"

    @property
    def text(self) -> str:
        """What came, in a few words."""
        if self.error:
            return short(self.error)
        cloud = self.cloud
        parts = [] if cloud is None else [f"{len(cloud):,} points"]
        if cloud is not None and cloud.colors is not None and len(cloud):
            mean = " ".join(f"{value:.1f}" for value in cloud.colors.mean(axis=0))
            parts.append(f"colour {mean}")
        if cloud is not None and (others := [n for n in self.attributes if n != "colors"]):
            parts.append(short(" ".join(others), 60))
        parts += self.notes
        if self.said:
            parts.append(f'"{short(self.said)}"')
        if self.failed:
            parts.append("not " + ", not ".join(self.failed))
        return "; ".join(parts)


def short(text: str, widest: int = WIDEST) -> str:
    """At most so many letters, fit for a cell of a table."""
    text = " ".join(text.split()).replace("|", "\\|")
    return text if len(text) <= widest else text[: widest - 1] + "…"


def without_path(text: str, path: Path) -> str:
    """The text without the path of the case, and of the folder it lies in."""
    return text.replace(f"{path}: ", "").replace(str(path.parent) + "/", "").replace(str(path), "")


# What the right answers have in common


def near(found: Any, expected: Any, tolerance: float) -> bool:
    """Whether numbers are there and differ by no more than that."""
    if found is None:
        return False
    difference = np.abs(np.asarray(found, np.float64) - np.asarray(expected, np.float64))
    return bool((difference <= tolerance).all())


def room(answer: Answer, shift: tuple[float, ...] = (0, 0, 0), n: int = 3000) -> None:
    """All points of the room at their places, to 2 mm."""
    cloud = answer.cloud
    answer.check(f"{n:,} points", len(cloud) == n)
    low, high = np.array(cloud.points).min(axis=0), np.array(cloud.points).max(axis=0)
    answer.check("at their places", near([low, high], ROOM + np.array(shift), 0.002))


def colors(answer: Answer, tolerance: float = 0.2, first: bool = True) -> None:
    """The mean of the colours, and that of the first point."""
    found = answer.cloud.colors
    answer.check("the room's colours", found is not None and near(found.mean(0), COLOR, tolerance))
    if first and found is not None:
        answer.check("the first point's colour", near(found[0], FIRST_COLOR, 1))


def intensities(answer: Answer, mean: float = INTENSITY, tolerance: float = 0.01) -> None:
    """The mean of the intensities, to this share."""
    found = answer.cloud.intensities
    right = found is not None and near(found.mean(), mean, abs(mean) * tolerance)
    answer.check("the room's intensities", right)


def no_intensities(answer: Answer) -> None:
    answer.check("without intensities", answer.cloud.intensities is None)


def kept_or_named(answer: Answer, *names: str) -> None:
    """Each of these columns is in the cloud, or in the warning."""
    for name in names:
        answer.check(f"{name} kept or named", name in answer.attributes or name in answer.said)


def whole_room(answer: Answer) -> None:
    room(answer)
    colors(answer)


def kept(*names: str) -> Callable[[Answer], None]:
    """The room, with these columns kept or named."""

    def check(answer: Answer) -> None:
        room(answer)
        kept_or_named(answer, *names)

    return check


# Cases of single formats


def survives(answer: Answer, **expected: Any) -> None:
    """These dimensions are in the LAZ file that the cloud is written to."""
    import laspy

    before = laspy.read(str(answer.path))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "again.laz"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            sb.write(path, answer.cloud)
        after = laspy.read(str(path))
    lost = []
    for name in expected:
        names = list(after.point_format.dimension_names)
        if name not in names or not np.array_equal(after[name], before[name]):
            lost.append(name)
    answer.check(f"{', '.join(lost)} in the LAZ written from it", not lost)


LAS_FIELDS = ("classification", "gps_time", "number_of_returns", "point_source_id", "user_data")


def las_attributes(answer: Answer) -> None:
    room(answer, UTM)
    colors(answer)
    survives(answer, **dict.fromkeys(LAS_FIELDS))
    code, out = run("compress", answer.path, "{out}.sfb", "--no-evaluate")
    answer.check("compressed", code == 0)
    lost = [name for name in LAS_FIELDS if name not in out]
    answer.check(f"{', '.join(lost)} named by compress", not lost)


def las_nir(answer: Answer) -> None:
    room(answer, UTM)
    survives(answer, nir=9000)


def las_noise(answer: Answer) -> None:
    heights = answer.cloud.points[:, 2]
    answer.check("z of 100 to 102.5", heights.min() > 99.9 and heights.max() < 102.6)
    answer.check("the number of points left out said", answer.says(r"60 of 3,?000"))


def las_no_colors(answer: Answer) -> None:
    room(answer, UTM)
    answer.check("without colours", answer.cloud.colors is None)
    answer.check("colours said to be 0", answer.says("colo.*0 everywhere"))


def las_one_high(answer: Answer) -> None:
    room(answer, UTM)
    colors(answer, first=False)
    answer.check("three clipped values said", answer.says(r"clip.*: 3\b"))


def las_intensity(answer: Answer) -> None:
    import laspy

    room(answer, UTM)
    real = np.asarray(laspy.read(str(answer.path)).intensity)
    found = answer.cloud.intensities
    answer.check("the real intensity", found is not None and near(found, real, 0.5))
    answer.check("normals of the extra dimensions", answer.cloud.normals is not None)


def las_units(answer: Answer) -> None:
    said = re.sub(r"\s+", " ", answer.said)
    across = re.search(r"(?<!foot )\bmet(re|er)s?\b[^,;]*horizontal", said)
    up = re.search(r"(foot|feet)[^,;]*vertical", said)
    answer.check("metres horizontally said", across is not None)
    answer.check("survey feet vertically said", up is not None)


def ply_cc(answer: Answer) -> None:
    whole_room(answer)
    header = answer.path.read_bytes().split(b"end_header")[0].decode("latin-1")
    for name in re.findall(r"property \w+ (scalar_\w+)", header):
        if name.lower() != "scalar_intensity":
            kept_or_named(answer, name)


def ply_splat(answer: Answer) -> None:
    room(answer)
    colors(answer, 0.6, first=False)
    answer.check("without normals", answer.cloud.normals is None)
    answer.check("said to be a splat", answer.says("splat"))


def ply_nan(answer: Answer) -> None:
    room(answer, n=2700)
    answer.check("NaN counted", answer.says("300 of 3,?000"))


def pcd_zeros(answer: Answer) -> None:
    room(answer, n=2000)
    answer.check("zeros counted", answer.says(r"1,?000 of 3,?000"))


def pcd_viewpoint(answer: Answer) -> None:
    room(answer)
    answer.check("without a viewpoint", answer.cloud.viewpoints is None)
    answer.check("VIEWPOINT said", answer.says("VIEWPOINT"))


def e57_crs(answer: Answer) -> None:
    room(answer, (*UTM[:2], 0))
    named = bool(getattr(answer.cloud, "crs", None)) or answer.says("coordinateMetadata|reference")
    answer.check("CRS kept or named", named)


def e57_invalid(answer: Answer) -> None:
    room(answer)
    colors(answer, 3.0, first=False)
    answer.check("filled colours counted", answer.says(r"colours[^;]*750"))


def e57_quaternion(answer: Answer) -> None:
    whole_room(answer)
    answer.check("the quaternion said", answer.says("quaternion"))


def text_label(answer: Answer) -> None:
    room(answer)
    no_intensities(answer)
    kept_or_named(answer, "label")


def text_colors_and_label(answer: Answer) -> None:
    whole_room(answer)
    text_label(answer)


def text_16_bits(answer: Answer) -> None:
    whole_room(answer)
    answer.check("without normals", answer.cloud.normals is None)


def text_cc(answer: Answer) -> None:
    whole_room(answer)
    intensities(answer)


def pts(answer: Answer) -> None:
    whole_room(answer)
    # 0 to 1 are -2048 to 2047.
    found = answer.cloud.intensities
    told = found is not None and (near(found.mean(), 146.2, 2) or near(found.mean(), 0.536, 0.01))
    answer.check("the room's intensities", told)


def easting(answer: Answer) -> None:
    room(answer, (*UTM[:2], 0))


def nuscenes(answer: Answer) -> None:
    rows = np.fromfile(answer.path, "<f4").reshape(-1, 5)
    right = len(answer.cloud) == len(rows) and near(answer.cloud.points, rows[:, :3], 1e-4)
    answer.check("five floats per point", right)
    kept_or_named(answer, "ring")


# Folders of images


def frames(n: int, said: str = "", n_pixels: int | None = None) -> Callable[[Answer], None]:
    """So many frames are fused, and the warning says this."""

    def check(answer: Answer) -> None:
        found = 0 if answer.cloud.viewpoints is None else len(answer.cloud.viewpoints)
        answer.notes.append(f"{found} frames")
        answer.check(f"{n} frames", found == n)
        if said:
            answer.check(f"/{said}/ said", answer.says(said))
        if n_pixels is not None:
            answer.check(f"{n_pixels:,} points", len(answer.cloud) == n_pixels)

    return check


def scaled_colors(answer: Answer) -> None:
    """The colours are those of the pixels at the same place of the larger images."""
    from PIL import Image

    expected = []
    for path in sorted(answer.path.glob("*.depth.png")):
        depth = np.asarray(Image.open(path)) / 1000
        image = np.asarray(Image.open(str(path).replace(".depth.", ".color.")).convert("RGB"))
        factor = image.shape[0] / depth.shape[0]
        rows, columns = np.nonzero((depth >= 0.3) & (depth <= 4))
        expected.append(
            image[((rows + 0.5) * factor).astype(int), ((columns + 0.5) * factor).astype(int)]
        )
    mean = np.concatenate(expected).mean(axis=0)
    found = answer.cloud.colors
    answer.check("colours of the scaled pixels", found is not None and near(found.mean(0), mean, 2))


# Models


def run(*arguments: Any) -> tuple[int, str]:
    """Exit code and all output of a command line; `{out}` is a name in a folder that goes."""
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        text = io.StringIO()
        stack.enter_context(contextlib.redirect_stdout(text))
        stack.enter_context(contextlib.redirect_stderr(text))
        words = [str(a).replace("{out}", f"{folder}/out") for a in arguments]
        code = command_line(words)
    return int(code or 0), text.getvalue()


def compressed(answer: Answer, *options: str) -> Any:
    """What `compress` made of the file, decoded; its warnings are those of the answer."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.sfb"
        code, out = run("compress", answer.path, path, "--no-evaluate", *options)
        answer.said = " ".join(
            without_path(line.removeprefix("surfabet: "), answer.path).replace(f"{path}: ", "")
            for line in out.splitlines()
            if line.startswith("surfabet: ")
        )
        answer.notes.append(f"exit code {code}")
        if code:
            answer.error = answer.said.removeprefix("error: ")
            return None
        answer.notes.append(f"{path.stat().st_size:,} bytes")
        return sb.load(path)


def share_within(answer: Answer, model: Any, reference: Any, distance: float) -> float:
    """The share of the input that has a point of the decoded surface this near."""
    quality = sb.evaluate(reference, model.decode(), sigma=distance, normal_neighbors=None)
    answer.notes.append(f"{quality.inliers:.1%} within {distance:.3g}")
    return float(quality.inliers or 0)


def complete(distance: float, said: str = "") -> Callable[[Answer], None]:
    """99 % of the input lie this near to the surface that `compress` keeps at its defaults."""

    def check(answer: Answer) -> None:
        if (model := compressed(answer)) is not None:
            share = share_within(answer, model, answer.cloud, distance)
            answer.check("99 % complete", share >= 0.99)
        if said:
            answer.check(f"/{said}/ said", answer.says(said))

    return check


def one_mad(answer: Answer) -> None:
    inside = answer.cloud.select(np.abs(answer.cloud.points).max(axis=1) < 10)
    if (model := compressed(answer)) is not None:
        answer.check("99 % complete", share_within(answer, model, inside, 0.07) >= 0.99)
        far = np.abs(np.array(model.decode().points)).max()
        answer.check("a model of the room", far < 10)
    answer.check("outliers counted", answer.says(r"\b1 (of|point|outlier)|left out 1\b"))


def far_outliers(answer: Answer) -> None:
    inside = answer.cloud.select(np.abs(answer.cloud.points).max(axis=1) < 5)
    if (model := compressed(answer, "--model", "gas")) is None:
        return
    distances, _ = sb.KdTree(np.array(inside.local_points)).query(
        np.asarray(model.neurons.positions, np.float32)
    )
    share = float((np.asarray(distances).reshape(-1) > 0.1).mean())
    answer.notes.append(f"{share:.1%} of {len(distances):,} neurons in empty air")
    answer.check("at most 1 % in empty air", share <= 0.01)
    answer.check("outliers counted", answer.says(r"\b25\b|\b2[0-9] (of|points|outliers)"))


def thin_wall(answer: Answer) -> None:
    planes = sb.learn_planes(answer.cloud).planes
    answer.notes.append(f"{len(planes)} plane{'s' * (len(planes) != 1)}")
    answer.check("two planes", len(planes) == 2)
    given = np.unique(answer.cloud.colors, axis=0).astype(np.float64)
    two = [given[0], given[-1]]
    model = compressed(answer)
    found = np.array(model.decode().colors, np.float64)
    apart = np.min([np.abs(found - color).max(axis=1) for color in two], axis=0)
    # Nearer to the mean of both than to either; colours are coded with some loss.
    mixed = float((apart > 0.25 * np.abs(two[0] - two[1]).max()).mean())
    answer.notes.append(f"{mixed:.1%} of decoded points of mixed colour")
    answer.check("colours apart", mixed <= 0.01)


def vlp16(answer: Answer) -> None:
    model = sb.learn_planes(answer.cloud)
    planes = model.planes
    along = np.abs(np.asarray(planes.normals)).max(axis=1) > np.cos(np.radians(3))
    order = np.argsort(planes.counts)[::-1]
    largest = [k for k in order if along[k]][:6]
    share = float(np.asarray(planes.counts)[largest].sum() / len(answer.cloud))
    axes = {int(np.abs(planes.normals[k]).argmax()) for k in largest}
    answer.notes.append(f"{len(planes)} planes; {len(largest)} along the axes hold {share:.0%}")
    # Up to six: none of the rays of this scan, up to 15 degrees, reaches the ceiling.
    answer.check("six planes of the right direction with 90 %", share >= 0.9)
    answer.check("all three directions", len(axes) == 3)


@dataclass(frozen=True)
class Case:
    """A folder of the cases: its situation in a few words, and its right answer as checks."""

    folder: str
    situation: str
    check: Callable[[Answer], None]
    refusal: str = ""
    """A refusal that matches this is a right answer, too."""


CASES = (
    Case("las_attributes", "LAZ with classes, times, returns, sources", las_attributes),
    Case("las_nir_pf8", "LAZ with near infrared", las_nir),
    Case("las_withheld_noise", "LAZ with withheld points and noise", las_noise),
    Case("las_rgb_zero", "LAS with colours that are all 0", las_no_colors),
    Case("las_rgb8_one_high", "LAS with colours of 8 bits, three values beyond", las_one_high),
    Case("las_extra_intensity", "LAS with an empty extra intensity", las_intensity),
    Case("las_metre_h_ft_v", "LAS in metres and, vertically, feet", las_units),
    Case("ply_cc", "PLY of CloudCompare with scalar fields", ply_cc),
    Case("ply_splat", "PLY of 3D Gaussians", ply_splat, "splat"),
    Case("ply_rgba_packed", "PLY with packed colours", whole_room),
    Case("ply_comment_latin1", "PLY with a comment in Latin-1", whole_room),
    Case("ply_bom", "PLY with a byte order mark", whole_room),
    Case("ply_ascii_hexfloat_nan", "PLY with `-nan(ind)` and `1.#QNAN`", ply_nan),
    Case(
        "pcd_timestamp_ros2",
        "PCD with rings and times",
        kept("ring", "timestamp"),
    ),
    Case("pcd_ouster_zeros", "PCD with a third of points at 0 0 0", pcd_zeros),
    Case("pcd_vp_nan", "PCD with a viewpoint of NaN", pcd_viewpoint),
    Case("pcd_rgb_F_intdigits_ascii", "PCD with colours as digits of an integer", whole_room),
    Case(
        "e57_timestamps",
        "E57 with times",
        kept("timeStamp"),
    ),
    Case("e57_crs", "E57 with a reference system", e57_crs),
    Case("e57_rgb16_nolimits", "E57 with colours of 16 bits without limits", whole_room),
    Case("e57_color_invalid", "E57 with invalid colours", e57_invalid),
    Case("e57_zero_quaternion", "E57 with a quaternion 0 0 0 0", e57_quaternion),
    Case("txt_xyzrgbl", "text: x y z r g b label", text_colors_and_label),
    Case("txt_rgb16_unnamed", "text: x y z and colours of 16 bits", text_16_bits, "columns"),
    Case("txt_xyzl", "text: x y z label", text_label, "columns"),
    Case("txt_rgb16_named_float", "text: colours of 16 bits as floats", whole_room),
    Case("cc_ascii_count", "text of CloudCompare with a count", text_cc),
    Case("cc_ascii_rf", "text of CloudCompare", text_cc),
    Case("pts_leica", "PTS of Leica", pts),
    Case("pts_as_txt", "PTS under the name .txt", pts),
    Case("fmt_ptx", "PTX with a pose", text_cc),
    Case("csv_easting", "CSV: Easting, Northing, Elevation", easting),
    Case("csv_decimal_comma", "CSV with decimal commas", whole_room),
    Case("xyz_utf16", "text in UTF-16", room),
    Case("bin_nuscenes", "five floats per point", nuscenes, "columns"),
    Case("bin_xyz3", "three floats per point", room, "columns"),
    Case(
        "rgbd_tum_far",
        "TUM: a room deeper than the default limit",
        frames(4, r"59,?993 of 76,?800.*depth.limits"),
    ),
    Case("rgbd_tum_missing_depth", "TUM: a depth image is missing", frames(3, "1 of 4 frames")),
    Case("rgbd_tum_assoc", "TUM with associations.txt", frames(4)),
    Case("rgbd_tum_tiff", "TUM with depth as TIFF of floats", frames(4)),
    Case("rgbd_scannet", "ScanNet, a pose of -inf", frames(3, "1 of 4 frames")),
    Case("rgbd_open3d", "Open3D", frames(3)),
    Case("rgbd_frames_color1920", "7-Scenes with larger colour images", scaled_colors),
    Case("npz_xyz_rgb", "NPZ with xyz and rgb", whole_room),
    Case("npz_pyntcloud", "NPZ with a structured array", whole_room),
    Case("gz_named_ply", "gzip under the name .ply", whole_room, "gzip.*unpack"),
    Case("m_room", "60,000 points 2.3 cm apart, compressed at defaults", complete(0.03)),
    Case("m_room_mm", "the room in millimetres", complete(30, "unit|millimet")),
    Case("m_small_object", "a ball of 5 cm", complete(0.002)),
    Case("m_one_mad", "one point at a million metres", one_mad),
    Case("m_far_outliers", "25 points some hundred metres off, as a gas", far_outliers),
    Case("m_thin_wall", "two sheets 3 cm apart, of other colours", thin_wall),
    Case("m_vlp16", "one scan of 16 rings, as planes", vlp16),
)


def answer_of(case: Case, folder: Path) -> Answer:
    """Reads the only file or folder of a case and checks what comes."""
    path = next(p for p in sorted((folder / case.folder).iterdir()))
    answer = Answer(path)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            answer.cloud = sb.read(path)
        own = [w for w in caught if issubclass(w.category, UserWarning)]
        answer.said = "; ".join(without_path(str(w.message), path) for w in own)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            case.check(answer)
    except ERRORS as error:
        answer.error = without_path(str(error), path)
    except Exception as error:
        answer.error = f"{type(error).__name__}: {error}"
        answer.crashed = True
    return answer


def verdict_of(case: Case, answer: Answer) -> str:
    """The answer's, where some refusals are right."""
    refused = answer.verdict == "refused" and case.refusal
    return "right" if refused and re.search(case.refusal, answer.error) else answer.verdict


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=Path, required=True, help="folder of the cases")
    parser.add_argument("--before", type=Path, help="record of an earlier state")
    parser.add_argument("--json", type=Path, help="write the record here")
    parser.add_argument("--only", nargs="*", help="names of folders")
    return parser.parse_args()


def main() -> None:
    """Prints the table."""
    options = parse()
    before = json.loads(options.before.read_text()) if options.before else {}
    record: dict[str, dict[str, str]] = {}
    print(f"| case | situation | {'before | ' if before else ''}now |")
    print(f"|---|---|---|{'---|' if before else ''}")
    for case in CASES:
        if options.only and case.folder not in options.only:
            continue
        answer = answer_of(case, options.cases)
        found = {"verdict": verdict_of(case, answer), "text": answer.text}
        record[case.folder] = found
        told = [
            f"**{one['verdict']}**: {one['text']}"
            for one in (before.get(case.folder), found)
            if one
        ]
        print(f"| `{case.folder}` | {case.situation} | {' | '.join(told)} |", flush=True)
    for name, states in (("before", before), ("now", record)):
        if states:
            verdicts = [one["verdict"] for one in states.values()]
            counts = {v: verdicts.count(v) for v in ("right", "refused", "wrong")}
            print(f"\n{name}: " + ", ".join(f"{n} {v}" for v, n in counts.items()))
    known = {case.folder for case in CASES}
    missing = {p.name for p in options.cases.iterdir() if p.is_dir()} - known
    if missing:
        print(f"\nwithout a check: {', '.join(sorted(missing))}")
    if options.json:
        options.json.write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()

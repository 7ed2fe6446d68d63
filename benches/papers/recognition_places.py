"""`place_similarity` between all real laser scans: does another scan of a place come first?

python benches/papers/recognition_places.py
"""

from __future__ import annotations

from paper_bench import DATA, check_data, print_header, print_row

import surfabet as sb

# Scans of one place share a letter; those of one building or street share a group.
SCANS = {
    **{f"indoor_scan/room_scan{k}.pcd": ("room", "a") for k in (1, 2)},
    **{f"multi_scan/full{k}.pcd": ("hall", "b") for k in (0, 10, 20)},
    **{f"multi_scan/full{k}.pcd": ("hall", f"{k}") for k in (30, 40, 50)},
    **{f"outdoor_360/{k:06}.bin": ("street", "c") for k in (0, 2, 4)},
}


def main() -> None:
    check_data()
    models = {
        name: sb.learn_alphabet(
            sb.read(DATA / name, viewpoint=(0, 0, 0)), radius=0.1, min_range=0.5
        )
        for name in SCANS
    }
    names = list(SCANS)
    likes = {
        (a, b): sb.place_similarity(models[a], models[b])
        for i, a in enumerate(names)
        for b in names[i:]
    }

    def like(a: str, b: str) -> float:
        return likes.get((a, b), likes.get((b, a), 0.0))

    short = [name.split("/")[1].split(".")[0] for name in names]
    print_header("scan", *short, "least same place", "most other place", "first")
    n_first = n_all = 0
    for name, label in zip(names, short, strict=True):
        group, place = SCANS[name]
        others = [other for other in names if other != name]
        same = [like(name, o) for o in others if SCANS[o] == (group, place)]
        # Who has no second scan of the very place is asked for its building.
        if same:
            rest = [like(name, o) for o in others if SCANS[o] != (group, place)]
        else:
            same = [like(name, o) for o in others if SCANS[o][0] == group]
            rest = [like(name, o) for o in others if SCANS[o][0] != group]
        first = min(same) > max(rest)
        n_first, n_all = n_first + first, n_all + 1
        cells = [f"{like(name, other):.3f}" for other in names]
        print_row(label, *cells, f"{min(same):.3f}", f"{max(rest):.3f}", "yes" if first else "no")
    print(f"\n{n_first} of {n_all} scans rank all scans of their own place above all others")


if __name__ == "__main__":
    main()

"""Sums up what tests/mutation/sample found: summary.py FOLDER ROOM..."""

import sys
from pathlib import Path


def lines(path: Path) -> list[str]:
    return path.read_text().splitlines() if path.is_file() else []


def main(folder: str, *rooms: str) -> None:
    print("| room | mutants | noticed | survived | did not compile | score |")
    print("|---|---|---|---|---|---|")
    survivors: list[str] = []
    total = [0, 0, 0]
    for room in rooms:
        found = Path(folder) / room / "mutants.out"
        # A test that never ends would be noticed too.
        noticed = len(lines(found / "caught.txt")) + len(lines(found / "timeout.txt"))
        missed, unviable = lines(found / "missed.txt"), len(lines(found / "unviable.txt"))
        survivors += missed
        counts = [noticed, len(missed), unviable]
        total = [a + b for a, b in zip(total, counts)]
        print(row(room, counts))
    print(row("all", total))
    print("\nSurvivors:", *survivors, sep="\n")


def row(room: str, counts: list[int]) -> str:
    noticed, missed, unviable = counts
    score = f"{100 * noticed / (noticed + missed):.1f} %" if noticed + missed else "-"
    return f"| {room} | {sum(counts)} | {noticed} | {missed} | {unviable} | {score} |"


main(*sys.argv[1:])

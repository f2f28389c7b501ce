"""forcechain import: runs of other codes, and of other scripts, to a folder that every command reads."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from harness.errors import EXIT_GOOD, InputError
from harness.exchange.dump_tables import LAMMPS, LIGGGHTS, Names
from harness.exchange.from_csv import import_csv
from harness.exchange.from_lammps import SETTINGS, import_dumps
from harness.exchange.from_yade import import_states
from harness.exchange.settings import read_settings

HELP = "read runs of other codes: CSV tables, dumps of LAMMPS or LIGGGHTS, saved states of YADE"
EXAMPLE = "forcechain import dumps/ --from lammps --set normal_stiffness=1.05e5 --out runs/lammps"
DIALECTS = {"lammps": LAMMPS, "liggghts": LIGGGHTS}
FORMATS = ("csv", *DIALECTS, "yade")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("source", metavar="SOURCE", type=Path, help="a folder of tables or dumps; yade: or one state")
    parser.add_argument("--from", dest="format", choices=FORMATS, required=True, help="what SOURCE is")
    parser.add_argument("--out", metavar="DIR", type=Path, help="the new run's folder (default: imported/<source>)")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="what dumps do not tell: " + "; ".join(f"{name}: {what}" for name, what in SETTINGS.items()),
    )
    parser.add_argument("--atom-columns", metavar="NAMES", help="names of the columns of atoms, in order, with commas")
    parser.add_argument("--pair-columns", metavar="NAMES", help="names of the columns of pairs, in order, with commas")
    parser.add_argument(
        "--wall", action="append", default=[], metavar="NAME=ID", help="yade: number of the body that is this wall"
    )
    parser.add_argument("--json", action="store_true", help="print the folder and the number of snapshots as JSON")


def execute(args: argparse.Namespace) -> int:
    """Import and say where the run is."""
    dumps = args.format in DIALECTS
    settings = read_settings(args.set, SETTINGS if dumps else {})
    for option, given, fits in (
        ("--atom-columns", args.atom_columns, dumps),
        ("--pair-columns", args.pair_columns, dumps),
        ("--wall", args.wall, args.format == "yade"),
    ):
        if given and not fits:
            raise InputError(f"{option} has no meaning with --from {args.format}; leave it out")
    out = args.out if args.out is not None else Path("imported") / args.source.resolve().name
    if args.format == "csv":
        count = import_csv(args.source, out)
    elif args.format == "yade":
        count = import_states(args.source, out, args.wall)
    else:
        names = Names(atoms=_names(args.atom_columns), pairs=_names(args.pair_columns))
        count = import_dumps(args.source, out, DIALECTS[args.format], settings, names)
    if args.json:
        print(json.dumps({"folder": str(out), "snapshots": count}))
    else:
        print(f"written: {out} ({count} snapshot{'s' * (count != 1)})")
    return EXIT_GOOD


def _names(text: str | None) -> list[str] | None:
    return None if text is None else [name.strip() for name in text.split(",")]

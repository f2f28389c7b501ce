#!/usr/bin/env bash
# tests/release.sh [RELEASE] [ROOT]: the YADE of another Debian release against this machine's.
#
# In a root of RELEASE (trixie; made in ROOT with debootstrap where it is not there yet, kept for the next time) a clean
# checkout of HEAD is set up, its YADE tests are run, and the demo study with `check` against baselines/demo.toml. The same
# demo is run here, and both are held against each other: versions, verdicts, peak stress ratios.
# Needs root and debootstrap, 3 GB of disk and, the first time, some ten minutes. Exit status: that of the first step
# that fails; 1 also when a row passes in one and fails in the other, or numbers differ by more than three standard errors. (Undecided, within a standard error of its tolerance,
# contradicts neither.)
# SEEDS=12 takes the packings 1 to 12 instead of the demo's two.
# MIRROR is debootstrap's; proxies, pip's and apt's settings, certificates and hosts are those of this machine.
set -euo pipefail
cd "$(dirname "$0")/.."
release=${1:-trixie}
root=${2:-/var/tmp/forcechain-$release}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

say() { printf 'release: %s\n' "$*"; }

[ "$(id -u)" = 0 ] || { say "needs root, for debootstrap and chroot; type: sudo $0 $*"; exit 2; }
command -v debootstrap >/dev/null || { say "debootstrap is missing; type: apt-get install debootstrap"; exit 2; }
[ -x .venv/bin/forcechain ] || { say "not set up here; type: ./run setup"; exit 2; }

# Mounts in a namespace of our own: however this ends, the kernel takes them away, and nothing of the host's is in ROOT
if [ -z "${FORCECHAIN_RELEASE_NAMESPACE:-}" ]; then
    rm -rf "$scratch"
    FORCECHAIN_RELEASE_NAMESPACE=1 exec unshare --mount --propagation private "$0" "$release" "$root"
fi

if [ ! -x "$root/usr/bin/apt-get" ]; then
    say "making $root"
    debootstrap --variant=minbase --include=python3,git,ca-certificates "$release" "$root" ${MIRROR:+"$MIRROR"} >"$scratch/debootstrap.log" ||
        { tail -3 "$scratch/debootstrap.log"; say "debootstrap failed: remove $root and try again, or name a mirror in MIRROR"; exit 3; }
fi
for folder in proc sys dev; do mount --rbind "/$folder" "$root/$folder"; done

share() {  # share PATH: what this machine has there, there
    [ -e "$1" ] || return 0
    mkdir -p "$root$(dirname "$1")"
    cp -L --remove-destination "$1" "$root$1"
}
share /etc/resolv.conf
share /etc/hosts
share /etc/ssl/certs/ca-certificates.crt
apt-config dump | grep -E '^Acquire::(http|https)(::| )' >"$root/etc/apt/apt.conf.d/99host" || true
# pip's settings hold in there as well, and so do the folders and files that they name
pip_settings=$(.venv/bin/python -m pip config debug | sed -n "s/^ *\(.*\), exists: True$/\1/p")
for file in $pip_settings; do share "$file"; done
named=$(cat $pip_settings /dev/null; env | grep -E '^(PIP_|SSL_CERT|REQUESTS_CA|CURL_CA)' || true)
for path in $(grep -oE '(file://)?/[^ =:]+' <<<"$named" | sed 's,^file://,,' | sort -u); do
    path=${path%/simple}  # a local index: its files lie beside its pages
    if [ -f "$path" ]; then share "$path"; fi
    if [ -d "$path" ] && [ "$path" != / ] && [ ! -e "$root$path" -o -n "$(find "$root$path" -maxdepth 0 -empty 2>/dev/null)" ]; then
        mkdir -p "$root$path"
        mount --bind "$path" "$root$path"
        mount -o remount,ro,bind "$root$path"
    fi
done

home=/root/forcechain
inside() { chroot "$root" /usr/bin/env HOME=/root LC_ALL=C.UTF-8 PATH=/usr/sbin:/usr/bin:/sbin:/bin TMPDIR=/tmp \
    bash -euc "cd $home; $1"; }

say "a clean checkout of $(git rev-parse --short HEAD) in $root$home"
[ ! -d "$root$home/.venv" ] || mv "$root$home/.venv" "$root/root/.venv-kept"  # set-up takes it when nothing it needs has changed
rm -rf "${root:?}$home"
mkdir -p "$root$home"
git archive HEAD | tar -x -C "$root$home"
[ ! -d "$root/root/.venv-kept" ] || mv "$root/root/.venv-kept" "$root$home/.venv"
inside './run setup'

failed=0
seeds=
[ -z "${SEEDS:-}" ] || seeds="seeds = [$(seq -s ', ' "$SEEDS")]"
sed "s/^seeds = .*/${seeds:-&}/" studies/demo.toml >"$scratch/demo.toml"
cp "$scratch/demo.toml" "$root/root/demo.toml"
say "the demo study, there and here"
inside 'rm -rf /root/demo; .venv/bin/forcechain run /root/demo.toml --out /root/demo && .venv/bin/forcechain analyse /root/demo >/dev/null'
.venv/bin/forcechain run "$scratch/demo.toml" --out "$scratch/demo"
inside '.venv/bin/forcechain check /root/demo --baseline baselines/demo.toml' || { failed=$?; say "check of $release: FAIL"; }
cp -r "$root/root/demo" "$scratch/other"
for folder in demo other; do  # by the same analysis: what is compared is YADE
    rm -rf "$scratch/$folder/analysis"
    .venv/bin/forcechain compare "$scratch/$folder" --json >"$scratch/$folder.json" || [ $? = 1 ]
done

.venv/bin/python - "$scratch" "$release" <<'EOF' || failed=1
import csv
import json
import sys
from math import hypot
from pathlib import Path
from statistics import mean

scratch, release = Path(sys.argv[1]), sys.argv[2]
verdicts, peaks, versions = {}, {}, {}
for name in ("demo", "other"):
    rows = json.loads((scratch / f"{name}.json").read_text())["rows"]
    verdicts[name] = {(row["case"], row["quantity"]): row for row in rows}
    with (scratch / name / "analysis" / "runs.csv").open() as table:
        peaks[name] = mean(float(row["peak_stress_ratio"]) for row in csv.DictReader(table))
    runs = [json.loads(path.read_text()) for path in (scratch / name / "runs").glob("*/run.json")]
    versions[name] = ", ".join(sorted({run["provenance"]["yade_version"] for run in runs}))
print(f"YADE {versions['demo']} here, {versions['other']} in {release}")
print(
    f"mean peak stress ratio of the demo: {peaks['demo']:.4f} here, {peaks['other']:.4f} in {release}, "
    f"difference {peaks['other'] - peaks['demo']:+.4f}"
)


def told(row):
    return row["verdict"] if row["data"] is None else f"{row['verdict']} at {row['data']:.4g}"


decided = {"pass", "FAIL"}
contradicted, apart, same = [], [], 0
for key in sorted(verdicts["demo"].keys() | verdicts["other"].keys()):
    one, other = (verdicts[name].get(key, {"verdict": "missing", "data": None}) for name in ("demo", "other"))
    values = [row.get("data") for row in (one, other)]
    if None not in values:
        error = hypot(*(row.get("standard_error") or 0.0 for row in (one, other)))
        if error and abs(values[0] - values[1]) > 3 * error:
            print(f"{' / '.join(key)}: {told(one)} here, {told(other)} in {release}: beyond three standard errors")
            apart.append(key)
    if one["verdict"] == other["verdict"]:
        same += 1
        continue
    print(f"{' / '.join(key)}: {told(one)} here, {told(other)} in {release}")
    if {one["verdict"], other["verdict"]} == decided or "missing" in (one["verdict"], other["verdict"]):
        contradicted.append(key)
print(
    f"of {len(verdicts['demo'])} verdicts {same} are the same and {len(contradicted)} contradict each other; "
    f"{len(apart)} numbers lie beyond three standard errors of each other"
)
sys.exit(bool(contradicted or apart))
EOF

say "YADE tests of $release"
inside '.venv/bin/python -m pytest -m yade --numprocesses auto --dist loadfile -q tests' || { failed=$?; say "YADE tests of $release: FAIL"; }
exit "$failed"

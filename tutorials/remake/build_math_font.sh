#!/usr/bin/env bash
# Remake tutorials/_static/fonts: STIX Two Math (SIL Open Font License 1.1, from the npm package
# @fontsource/stix-two-math), cut to the letters and signs that formulas of the pages use.
set -euo pipefail
fonts="$(cd "$(dirname "${BASH_SOURCE[0]}")/../_static/fonts" && pwd)"
folder="$(mktemp -d)"
trap 'rm -r "$folder"' EXIT
cd "$folder"
npm pack --silent @fontsource/stix-two-math@5.3.0
tar -xzf ./*.tgz
python3 -m venv venv
venv/bin/pip install --quiet 'fonttools[woff]'
ranges="U+20-7E,U+A0-FF,U+131,U+237,U+2C6,U+2C7,U+2D8-2DD,U+300-338,U+370-3FF,U+2010-2044,U+2070-209F"
ranges+=",U+20D0-20EF,U+2100-214F,U+2190-21FF,U+2200-22FF,U+2308-230B,U+239B-23B4,U+23B0-23E1"
ranges+=",U+27E8-27EF,U+2A00-2A0F,U+1D400-1D7FF"
venv/bin/pyftsubset package/files/stix-two-math-latin-400-normal.woff2 --unicodes="$ranges" \
  --flavor=woff2 --layout-features='*' --output-file="$fonts/stix-two-math.woff2"
cp package/LICENSE "$fonts/LICENSE"

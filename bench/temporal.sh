#!/usr/bin/env bash
# What frames gain that add up: error against many rays and flicker of a still camera.
# Usage: bench/temporal.sh PROGRAM SIZE FRAMES SHOT... > temporal.txt
# Error: relMSE of the whole picture against 256 shadow rays without a filter, from the same virtual
# lights. Flicker: mean absolute change from frame to frame over the mean of the picture.
set -euo pipefail
program=$1 size=$2 frames=$3
shift 3
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for shot in "$@"; do
  render() { "$program" render "$shot" -q --backend cpu --size "$size" "$@"; }
  rm -f "$folder"/*
  render -o "$folder/many.pfm" --set shadow.rays=256 --set filter.enabled=false
  for history in 1 4 16; do
    render -o "$folder/$history-####.pfm" --frames "0..$((frames - 1))" \
      --set filter.temporal=true --set filter.history=$history
    python3 - "$(basename "$shot" .json)" "$history" "$folder/many.pfm" \
      "$folder/$history-"*.pfm <<'PYTHON'
import struct, sys
def read(path):
    data = open(path, "rb").read()
    kind, size, scale, data = data.split(b"\n", 3)
    count = len(data) // 4
    return struct.unpack(("<" if float(scale) < 0 else ">") + f"{count}f", data[: 4 * count])
def mean(values):
    values = list(values)
    return sum(values) / len(values)
shot, history, many, *frames = sys.argv[1:]
many = read(many)
level = mean(many)
slack = 0.01 * mean(b * b for b in many)
frames = [read(path) for path in frames]
def error(frame):
    return mean((a - b) ** 2 / (b * b + slack) for a, b in zip(frame, many))
def change(one, other):
    return mean(abs(a - b) for a, b in zip(one, other)) / level
print(f"{shot}, filter.history={history}")
print("  relMSE  " + " ".join(f"{error(f):.5f}" for f in frames))
print("  flicker " + " ".join(f"{change(*pair):.5f}" for pair in zip(frames[1:], frames)))
print("  bias    " + " ".join(f"{mean(f) / level - 1:+.5f}" for f in frames[:: len(frames) - 1]))
PYTHON
  done
done

#!/usr/bin/env bash
# The gather against brute force on every shot: one CSV line per shot and variant.
# Usage: bench/quality.sh PROGRAM SHOTS_FOLDER RECEIVERS > quality.csv
set -euo pipefail
program=$1 shots=$2 receivers=$3
echo "shot,variant,vpls,alpha,levels,grid_lights,evals,unshadowed_rmse,unshadowed_bias,shadowed_rmse,shadowed_bias"
for shot in "$shots"/*.json; do
  while read -r variant arguments; do
    # shellcheck disable=SC2086 # the arguments are words
    "$program" bench "$shot" --quality "$receivers" --set shadow.rays=48 $arguments --json 2>/dev/null |
      python3 -c '
import json, sys
r = json.load(sys.stdin)[0]["report"]
keys = ["vpls", "alpha", "levels", "grid_lights", "evals", "unshadowed_rmse", "unshadowed_bias", "shadowed_rmse", "shadowed_bias"]
print(",".join(sys.argv[1:3] + [f"{r[k]:.4g}" if isinstance(r[k], float) else str(r[k]) for k in keys]))
' "$(basename "$shot" .json)" "$variant"
  done <<'VARIANTS'
default --set seed=0
default-mean --set shadow.estimate=mean
start1 --set grid.start_level=1
alpha1 --set grid.alpha=1
alpha1.5-point --set grid.alpha=1.5 --set grid.spread=false
paper-alpha1 --preset paper
paper-alpha2 --preset paper --set grid.alpha=2
VARIANTS
done

#!/usr/bin/env bash
# The pictures of docs/methods: what a method does beside the definition, and where it fails.
# Differences are FLIP; every picture has the exposure of its scene, so that they may be compared.
#
# bench/figures.sh PROGRAM OUT
#   PROGRAM  a release build of manylight
#   OUT      where pictures go, and figures.txt with the errors
set -euo pipefail
program=$1 out=$2
mkdir -p "$out"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
: >"$out/figures.txt"

# picture NAME SCENE ARGUMENTS…
picture() {
  local name=$1 scene=$2 size=320x180 exposure=0
  shift 2
  [ "$scene" = cornell ] && size=240x240 exposure=1
  "$program" render "builtin:$scene" --backend cpu --size "$size" --set vpls.count=10000 \
    --set film.exposure_ev="$exposure" "$@" -q -o "$work/$name.exr" -o "$out/$name.png"
}
# against NAME SCENE ARGUMENTS…: the same, judged by brute force over the same lights.
against() {
  picture "$@"
  echo "$1: ${*:2}"
  "$program" compare "$work/$1.exr" "$work/brute-$2.exr" -o "$out/$1-difference.png"
} >>"$out/figures.txt"

picture brute-atrium atrium --method brute
picture brute-cornell cornell --method brute

unfiltered=(--set filter.enabled=false)
exact=(--set shadow.rays=64 "${unfiltered[@]}")
against grid atrium "${exact[@]}"
against grid-one-lobe atrium "${exact[@]}" --set grid.lobes=1 --set grid.start_level=1 \
  --set grid.evals=100
against lighting-few atrium "${exact[@]}" --set grid.evals=60
against lighting-interleaved atrium "${exact[@]}" --set interleave=4
against shadows atrium "${unfiltered[@]}"
against shadows-gray cornell "${exact[@]}"
against filter atrium
against filter-one-ray atrium --set shadow.rays=1

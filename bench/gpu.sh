#!/usr/bin/env bash
# Everything that a machine with a graphics device should measure, in one go: parity with the
# processor, stage times, growth with the number of lights, what optional features of the device
# bring, ray rates, pictures.
#
# bench/gpu.sh PROGRAM SCENES OUT [DEVICE]
#   PROGRAM  a release build of manylight
#   SCENES   the folder with the scenes and shots/*.json
#   OUT      where results go: one .json per measurement, summary.csv, pictures
#   DEVICE   part of the device's name; else the fastest one
#
# Meant to take under eight minutes on an H200-class device; it has not run on one yet. Every step
# has a limit of its own, so that one that hangs does not take the others with it, and none goes
# on beyond 475 s; what failed or was left out is listed at the end. The program may be
# stripped, which leaves a sixth of it.
set -uo pipefail
program=$1 scenes=$2 out=$3 device=${4:-}
mkdir -p "$out"
shots=$scenes/shots
chosen=()
[ -n "$device" ] && chosen=(--set "gpu.device=$device")
failed=()

# step SECONDS NAME ARGUMENTS…: standard output goes to NAME.json.
step() {
  local limit=$1 name=$2
  shift 2
  local start=$SECONDS
  local left=$((475 - start))
  if [ "$left" -lt 5 ]; then
    failed+=("$name: no time left")
    return
  fi
  [ "$limit" -lt "$left" ] || limit=$left
  if ! timeout "$limit" "$program" "$@" "${chosen[@]}" >"$out/$name.json" 2>"$out/$name.err"; then
    failed+=("$name")
  fi
  [ -s "$out/$name.err" ] || rm -f "$out/$name.err"
  echo "$name: $((SECONDS - start)) s"
}
frames() { step 40 "$1" bench "$shots/$2.json" --backend gpu --json --frames "${frames:-100}" "${@:3}"; }

timeout 20 "$program" devices --json >"$out/devices.json"
cat "$out/devices.json"

# Does it run, and is it right?
step 60 diff-cornell diff-stages builtin:cornell --json
step 90 diff-sponza diff-stages "$shots/sponza-atrium.json" --json

# The rows of the design's table.
million=(--set vpls.count=1000000 --set grid.alpha=1)
frames row1-720p sponza-atrium --size 1280x720 "${million[@]}"
frames row1-static sponza-atrium --size 1280x720 "${million[@]}" --static
frames row1-2160p sponza-atrium --size 3840x2160 "${million[@]}"
frames row2-headline sponza-atrium --size 1280x720 --set vpls.count=1000000 --set grid.alpha=2 \
  --set interleave=4
frames default-720p sponza-atrium --size 1280x720
frames paper-720p sponza-atrium --size 1280x720 --preset paper --set vpls.count=1000000

# The same bits on two runs, and all shots as on the processor.
for run in 1 2; do
  step 40 "bits-$run" render "$shots/sponza-atrium.json" --backend gpu --size 320x180 --json \
    -o "$out/bits-$run.pfm"
done
cmp "$out/bits-1.pfm" "$out/bits-2.pfm" || failed+=("bits: two runs differ")
rm -f "$out"/bits-?.pfm
for shot in "$shots"/*.json; do
  name=$(basename "$shot" .json)
  for backend in gpu cpu; do
    step 30 "small-$backend-$name" render "$shot" --backend "$backend" --size 192x108 --json \
      --set vpls.count=10000 -o "$out/$name-$backend.exr"
  done
  timeout 20 "$program" compare "$out/$name-gpu.exr" "$out/$name-cpu.exr" --max-flip 0.01 --json \
    >"$out/compare-small-$name.json" || failed+=("compare-small-$name")
  rm -f "$out/$name-gpu.exr" "$out/$name-cpu.exr"
done

# Pages of textures against textures bound one by one.
for shot in sponza-atrium country_kitchen-main; do
  for bindless in false true; do
    frames=30 frames "bindless-$bindless-$shot" "$shot" --size 1280x720 \
      --set "gpu.bindless=$bindless"
  done
done
for shot in cornell_box-main white_room-main classroom-main country_kitchen-main; do
  frames=30 frames "default-$shot" "$shot" --size 1280x720
done

# Growth with the number of lights.
for count in 1000 10000 100000 1000000 4000000 16000000; do
  frames=20 frames "growth-$count" sponza-atrium --size 1280x720 --set grid.alpha=1 \
    --set "vpls.count=$count"
done

# What a device offers beyond what every one has, without one at a time; `row1-720p` has all but
# textures bound one by one. In turns, since a device that gets warm gets slow.
for turn in 1 2; do
  for set in all subgroups=false half=false large_limits=false ray_queries=false bindless=true base=true; do
    [ "$set" = all ] && choice=() || choice=(--set "gpu.$set")
    frames=30 frames "features-${set/=/-}-$turn" sponza-atrium --size 1280x720 "${million[@]}" \
      ${choice[@]+"${choice[@]}"}
  done
done

# Shadow rays: by ray queries where the device has them, by shaders through the eight-wide
# hierarchy, and in both reports by shaders through a binary one.
for shot in sponza-atrium country_kitchen-main; do
  step 40 "rays-$shot" bench "$shots/$shot.json" --rays --backend gpu --json
  step 40 "rays-shaders-$shot" bench "$shots/$shot.json" --rays --backend gpu --json \
    --set gpu.ray_queries=false
done

# Pictures of both backends, and the judge.
for shot in sponza-atrium white_room-main animated_stage-low; do
  step 30 "picture-$shot" render "$shots/$shot.json" --backend gpu --size 640x360 --json \
    -o "$out/$shot-gpu.png" -o "$out/$shot-gpu.exr"
  step 60 "cpu-$shot" render "$shots/$shot.json" --backend cpu --size 640x360 --json \
    -o "$out/$shot-cpu.png" -o "$out/$shot-cpu.exr"
  timeout 20 "$program" compare "$out/$shot-gpu.exr" "$out/$shot-cpu.exr" --json >"$out/compare-$shot.json" \
    || failed+=("compare-$shot")
  rm -f "$out/$shot-gpu.exr" "$out/$shot-cpu.exr"
done
step 60 path-sponza render "$shots/sponza-atrium.json" --backend gpu --method path --json \
  --size 1280x720 --set path.spp=256 -o "$out/path-sponza.png"

# One table of all frames: name, stage, median, tenth and ninetieth percentile.
echo "name,stage,median_ms,p10_ms,p90_ms" >"$out/summary.csv"
for file in "$out"/*.json; do
  name=$(basename "$file" .json)
  grep -o '"[a-z ]*":{"median_ms":[^}]*}' "$file" 2>/dev/null |
    sed -E "s/\"([^\"]*)\":\{\"median_ms\":([^,]*),\"p10_ms\":([^,]*),\"p90_ms\":([^,]*),.*/$name,\1,\2,\3,\4/" \
      >>"$out/summary.csv"
done
# Ray rates and memory beside them.
echo "name,key,value" >"$out/figures.csv"
for file in "$out"/*.json; do
  name=$(basename "$file" .json)
  grep -oE '"(mrays_per_s|device_memory_mib|dispatches)":[0-9.]+' "$file" 2>/dev/null |
    sed -E "s/\"(.*)\":(.*)/$name,\1,\2/" >>"$out/figures.csv"
done
if [ ${#failed[@]} -gt 0 ]; then
  printf 'failed: %s\n' "${failed[@]}"
  exit 1
fi

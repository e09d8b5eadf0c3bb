#!/bin/sh
# figures.sh [FOLDER]
# Figures 14 and 15 of the paper: black satin lit along the weft and along the warp, and the same satin in three colours, each with the
# paper's surface (tanaka, steps 0 to 5) and beside it with the model that `auto` chooses from the same readings.
#
#     sh docs/examples/paper/figures.sh out/paper
set -eu

here=$(dirname "$0")
out=${1:-out/paper}
size=${SIZE:-640x480}
mkdir -p "$out"
[ -f "$out/cloth/truth/mesh.ply" ] || tsuya capture simulate "$here/scene.yaml" -o "$out/cloth"
for model in tanaka auto; do
    tsuya brdf fit "$here/black_satin.csv" --model $model -o "$out/$model.json"
    for lamp in weft warp; do
        tsuya render "$out/cloth/truth/mesh.ply" --material "$out/$model.json" --lights "$here/along_$lamp.json" \
            --color material --turntable 1 --elevation 40 --size "$size" --noise 0.02 --exposure 1.5 -o "$out/figure14_${lamp}_$model"
    done
    for dye in 8c1c2c 1f3f8c d9b23c; do
        tsuya render "$out/cloth/truth/mesh.ply" --material "$out/$model.json" --lights "$here/along_weft.json" --color "#$dye" \
            --turntable 1 --elevation 40 --size "$size" --noise 0.02 --exposure 1.5 -o "$out/figure15_${dye}_$model"
    done
done

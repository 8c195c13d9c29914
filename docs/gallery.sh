#!/usr/bin/env bash
# Draws the pictures of the README, docs/gallery/*, from media/ with the program itself; ffmpeg scales, labels and joins them.
# Usage: docs/gallery.sh [PROGRAM [PICTURE...]] (default: target/release/plumbline, all pictures)
set -euo pipefail
cd "$(dirname "$0")/.."
program=$(realpath "${1:-target/release/plumbline}")
[ $# -eq 0 ] || shift
media=$PWD/media
gallery=$PWD/docs/gallery
font=/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
export PLUMBLINE_CACHE=

# The background of every picture, and of what lies between two.
paper=0xF4F5F7

plumbline() { "$program" "$@" >&2; }
# One thread and no date, so that the same inputs give the same bytes.
ff() { ffmpeg -v error -nostdin -y -threads 1 "$@" -fflags +bitexact -map_metadata -1; }
still() { ff "$@" -frames:v 1 -c:v libwebp -compression_level 6; } # still INPUTS -quality N OUTPUT

# The filter that writes a caption into the lower left corner of a picture: label TEXT [SIZE]
label() {
    printf "drawtext=fontfile=%s:text='%s':fontsize=%s:fontcolor=white:box=1:boxcolor=black@0.62:boxborderw=6:x=12:y=h-18-ascent" \
        "$font" "$1" "${2:-17}"
}

# A row of meshes as one, each STEP to the right of the last as a viewer at YAW degrees sees it: row STEP YAW FILE.obj...
row() {
    awk -v step="$1" -v yaw="$2" '
        BEGIN { a = yaw * atan2(0, -1) / 180; dx = step * cos(a); dz = -step * sin(a) }
        FNR == 1 { first = count; number++ }
        $1 == "v" { $2 += (number - 1) * dx; $4 += (number - 1) * dz; count++; print }
        $1 == "f" { for (i = 2; i <= NF; i++) { split($i, corner, "/"); $i = corner[1] + first }; print }' "${@:3}"
}

# Before and after of a clip, side by side, and the path of its camera from the report of the same run.
steady() {
    [ -e steady.html ] || plumbline stabilize "$media/street-walk.mp4" -o steady.mp4 --compare --crf 12 --report steady.html
}

draw_stabilize() {
    steady
    local half="crop=iw/2:ih:" size="scale=398:-2:flags=lanczos"
    ff -ss 1.6 -t 4.5 -i steady.compare.mp4 -filter_complex \
        "fps=12,split[a][b];[a]${half}0:0,$size,$(label before 15),pad=iw+4:ih:0:0:$paper[l];[b]${half}iw/2:0,$size,$(label after 15)[r];[l][r]hstack" \
        -c:v libwebp_anim -quality 45 -compression_level 6 -loop 0 "$gallery/stabilize.webp"
}

draw_path() {
    steady
    awk '
        /<figure class="plot">/ && /class="before"/ && n < 2 {
            title = $0; sub(/.*<h3>/, "", title); sub(/<\/h3>.*/, "", title); gsub(/<[^>]*>/, "", title)
            body = $0; sub(/.*<\/figcaption><svg[^>]*>/, "", body); sub(/<\/svg><\/figure>.*/, "", body)
            printf "<text class=\"title\" x=\"64\" y=\"%d\">%s</text>\n", 28 + 190 * n, title
            printf "<svg x=\"64\" y=\"%d\" width=\"716\" height=\"120\">%s</svg>\n", 44 + 190 * n, body
            n++
        }' steady.html >plots
    {
        echo '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 800 390" width="800" height="390" font-family="sans-serif" font-size="12">'
        echo '<style>svg{overflow:visible}text{fill:#59616b}text.title{font-size:14px;font-weight:600;fill:#1b1f24}text.x{text-anchor:middle}'
        echo 'text.y{text-anchor:end;dominant-baseline:central}.grid{stroke:#d9dde2}.axis{stroke:#59616b}.tick{fill:#59616b}'
        echo 'path{fill:none;stroke-linejoin:round;vector-effect:non-scaling-stroke}.before{stroke:#c65102;stroke-width:1.1}'
        echo '.after{stroke:#0064a8;stroke-width:2}rect.mode{fill:none}</style>'
        echo '<rect width="800" height="390" fill="#f4f5f7"/>'
        cat plots
        echo '<line class="before" x1="640" y1="24" x2="664" y2="24"/><text x="670" y="28">before</text>'
        echo '<line class="after" x1="720" y1="24" x2="744" y2="24"/><text x="750" y="28">after</text>'
        echo '</svg>'
    } >"$gallery/path.svg"
}

draw_rectify() {
    local photo=$media/street-fisheye
    local common=("$photo.jpg" --lens "$photo.lens.json")
    plumbline rectify "${common[@]}" --to perspective -o perspective.png
    plumbline rectify "${common[@]}" --faces "$photo.faces.json" -o ours.png
    local high="scale=-2:224:flags=lanczos"
    still -i "$photo.jpg" -i perspective.png -i ours.png -filter_complex \
        "[0]$high,$(label fisheye),pad=iw+4:ih:0:0:$paper[a];[1]$high,$(label rectilinear)[b];[a][b]hstack,scale=800:224,pad=iw:ih+4:0:0:$paper[ab];
         [2]scale=800:-2:flags=lanczos,$(label plumbline)[c];[ab][c]vstack" -quality 82 "$gallery/rectify.webp"
}

draw_retarget() {
    # What matters, painted roughly: both people.
    local box="drawbox=color=white:t=fill"
    ff -f lavfi -i color=gray:size=1200x750 -vf "$box:x=125:y=300:w=150:h=400,$box:x=925:y=300:w=155:h=390" -frames:v 1 people.png
    plumbline retarget "$media/street-people.jpg" -o square.png --size 1:1 --importance people.png
    local gap="pad=iw+4:ih:0:0:$paper" high="scale=352:220:flags=lanczos" square="scale=220:220:flags=lanczos"
    still -i "$media/street-people.jpg" -i square.png -filter_complex \
        "[0]split[s][t];[s]$high,$(label photo),${gap}[a];[t]$square,$(label scaled),${gap}[b];[1]$square,$(label plumbline)[c];[a][b][c]hstack=3" \
        -quality 86 "$gallery/retarget.webp"
}

draw_panorama() {
    plumbline rectify "$media/street-stitched.jpg" --rectangle -o full.png
    local size="scale=800:-2:flags=lanczos"
    still -i "$media/street-stitched.jpg" -i full.png -filter_complex \
        "[0]$size,$(label stitched),pad=iw:ih+4:0:0:$paper[a];[1]$size,$(label rectangle)[b];[a][b]vstack" -quality 84 "$gallery/panorama.webp"
}

# A strip below a picture with a label centered at each of the given fractions of its width: labels FRACTION TEXT...
labels() {
    printf 'pad=iw:ih+34:0:0:%s' "$paper"
    while [ $# -gt 0 ]; do
        printf ",drawtext=fontfile=%s:text='%s':fontsize=16:fontcolor=0x3A4048:x=w*%s-tw/2:y=h-13-ascent" "$font" "$2" "$1"
        shift 2
    done
}

# Draws a mesh over the width of a picture of 800 px; a square view keeps perspective mild at the ends of a row:
# mesh FILE YAW,PITCH HEIGHT FILTERS OUTPUT [OPTION...]
mesh() {
    plumbline render "$1" --view "$2" --size 1600x1600 --background "#${paper#0x}" -o drawn.png --overwrite "${@:6}"
    still -i drawn.png -vf "crop=1600:2*$3,scale=800:$3:flags=lanczos,$4" -quality 88 "$5"
}

# Colors the vertices of a mesh by a rule over x, y, z at rest that says which are held and which are moved: paint REST HELD MOVED MESH
paint() {
    awk -v held="$2" -v moved="$3" '
        $1 == "v" && FILENAME == ARGV[1] { x = $2; y = $3; z = $4; n++
            color[n] = '"$3"' ? "0.92 0.47 0.08" : '"$2"' ? "0.30 0.36 0.46" : "0.84 0.815 0.776" }
        FILENAME == ARGV[2] { if ($1 == "v") print "v", $2, $3, $4, color[++k]; else print }' "$1" "$4"
}

draw_deform() {
    cat >bend.json <<'JSON'
{ "format": "plumbline.handles", "version": 1,
  "handles": [
    {"name": "body", "vertices": {"half_space": {"point": [0, 1.3, 0], "normal": [0, -1, 0]}}},
    {"name": "head", "vertices": {"sphere": {"center": [0.95, 2.4, 0], "radius": 0.34}},
     "rigid": {"rotation": {"axis": [0, 0, 1], "angle_deg": -75}, "translation": [0.41, -0.54, 0]}} ] }
JSON
    plumbline deform "$media/giraffe.ply" --handles bend.json -o bent.obj --frames 2
    local held='y < 1.3' moved='(x - 0.95)^2 + (y - 2.4)^2 + z^2 < 0.34^2'
    for frame in 0 1; do paint bent_0000.obj "$held" "$moved" bent_000$frame.obj >painted_$frame.obj; done
    row 3.4 25 painted_0.obj painted_1.obj >pair.obj
    mesh pair.obj 25,8 440 "$(labels 0.2 'at rest' 0.76 deformed)" "$gallery/deform.webp" --colors
}

draw_skeleton() {
    local filters=() n=0
    for name in giraffe.ply humanoid.glb; do
        plumbline skeleton "$media/$name" --keep auto -o "${name%.*}.json"
        plumbline render "$media/$name" --skeleton "${name%.*}.json" --opacity 0.3 --view 25,8 --size 1000x1000 \
            --background "#${paper#0x}" -o "skeleton_$n.png"
        n=$((n + 1))
    done
    still -i skeleton_0.png -i skeleton_1.png -filter_complex \
        "[0]scale=400:400:flags=lanczos[a];[1]scale=400:400:flags=lanczos[b];[a][b]hstack" -quality 86 "$gallery/skeleton.webp"
}

draw_skinning() {
    cat >candy.json <<'JSON'
{ "format": "plumbline.skeleton", "version": 1,
  "joints": [ {"name": "lower", "translation": [0, 0, 0]},
              {"name": "upper", "parent": "lower", "translation": [0, 0, 1.2]},
              {"name": "end", "parent": "upper", "translation": [0, 0, 1.2]} ] }
JSON
    echo '{ "format": "plumbline.pose", "version": 1, "joints": {"upper": {"turn_deg": [0, 0, 176]}} }' >twist.json
    echo '{ "format": "plumbline.pose", "version": 1, "joints": {} }' >rest.json
    local posed=(pose "$media/candy.ply" --skeleton candy.json)
    plumbline "${posed[@]}" --pose rest.json -o candy_rest.obj
    for method in lbs dqs; do plumbline "${posed[@]}" --pose twist.json --skinning $method -o candy_$method.obj; done
    row 2.2 0 candy_rest.obj candy_lbs.obj candy_dqs.obj >candies.obj
    mesh candies.obj 0,12 410 "$(labels 0.09 'at rest' 0.5 'linear blend' 0.9 'dual quaternions')" "$gallery/skinning.webp" --colors --up z
}

draw_morph() {
    cat >pairs.json <<'JSON'
{ "format": "plumbline.landmarks", "version": 1, "pairs": [
 [[1.17, 2.25, 0], [1.2, 0.9, 0]], [[0.85, 2.5, 0], [0.86, 1.14, 0]], [[0.88, 2.28, 0], [0.86, 0.86, 0]],
 [[0.67, 2.71, 0.12], [0.65, 1.35, 0.14]], [[0.67, 2.71, -0.12], [0.65, 1.35, -0.14]],
 [[-0.79, 0.8, 0], [-1.06, 0.31, 0]], [[-0.69, 1.35, 0], [-0.85, 0.66, 0]], [[-0.58, 1.2, 0], [-0.76, 0.52, 0]],
 [[0.36, -0.02, 0.15], [0.47, -0.02, 0.16]], [[0.36, -0.02, -0.15], [0.47, -0.02, -0.16]],
 [[-0.5, -0.02, 0.15], [-0.62, -0.02, 0.16]], [[-0.5, -0.02, -0.15], [-0.62, -0.02, -0.16]],
 [[0.42, 0.62, 0.15], [0.52, 0.28, 0.16]], [[0.42, 0.62, -0.15], [0.52, 0.28, -0.16]],
 [[-0.62, 0.62, 0.15], [-0.75, 0.28, 0.16]], [[-0.62, 0.62, -0.15], [-0.75, 0.28, -0.16]],
 [[0.6, 1.35, 0], [0.66, 0.6, 0]], [[-0.05, 1.07, 0], [-0.05, 0.4, 0]], [[0.1, 1.65, 0], [0.1, 0.83, 0]], [[-0.4, 1.53, 0], [-0.58, 0.79, 0]],
 [[0.55, 1.95, 0], [0.58, 0.95, 0]], [[0.7, 1.8, 0], [0.72, 0.78, 0]],
 [[0.36, 1.3, 0.29], [0.46, 0.6, 0.25]], [[0.36, 1.3, -0.29], [0.46, 0.6, -0.25]],
 [[-0.46, 1.2, 0.29], [-0.6, 0.52, 0.27]], [[-0.46, 1.2, -0.29], [-0.6, 0.52, -0.27]] ] }
JSON
    plumbline morph "$media/giraffe.ply" "$media/dog.ply" --landmarks pairs.json -o shapes.obj --frames 5
    row 2.3 25 shapes_000?.obj >shapes.row.obj
    mesh shapes.row.obj 25,8 210 null "$gallery/morph.webp"
}

all=(stabilize path rectify retarget panorama deform skeleton skinning morph)
for picture in "${@:-${all[@]}}"; do
    "draw_$picture"
    ls -l "$gallery/$picture".* >&2
done
